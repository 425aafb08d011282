"""Which scenarios `tiltsim check` flies: words and shards."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tiltsim.resources import shipped_folder
from tiltsim.scenario.library import library_entries, library_families
from tiltsim.scenario.loading import load_scenario
from tiltsim.studies import checking
from tiltsim.studies.checking import CheckResult, check_all, collect, exit_code, shard

SHIPPED = [str(shipped_folder("scenarios"))]
LIBRARY = collect(SHIPPED)

OWN = """
title = "Round and round"
[[variant]]
name = "slow"
[[variant]]
name = "fast"
title = "A gallop"
"""


@pytest.mark.parametrize("count", range(1, 8))
def test_shards_of_the_library_are_disjoint_and_complete(count):
    shards = [shard(LIBRARY, number, count) for number in range(1, count + 1)]
    dealt = [address for part in shards for address in part]
    assert len(dealt) == len(LIBRARY)
    assert set(dealt) == set(LIBRARY)
    assert max(map(len, shards)) - min(map(len, shards)) <= 1


@given(st.integers(0, 60), st.integers(1, 70))
def test_shards_keep_the_order_and_lose_nothing(length, count):
    addresses = [f"{number:02d}" for number in range(length)]
    shards = [shard(addresses, number, count) for number in range(1, count + 1)]
    assert sorted(address for part in shards for address in part) == addresses
    assert all(part == sorted(part) for part in shards)


@pytest.mark.parametrize("word", ["", "CIRCLE#", "fig. 4", "as the family"])
def test_a_word_selects_for_check_what_list_shows(word):
    selected = collect(SHIPPED, word)
    assert selected == [entry.address for entry in library_entries(word)]
    assert selected == [
        family.entry.address + member
        for family in library_families(word)
        for member in [member.address for member in family.members] or [""]
    ]
    assert selected
    assert all(address in LIBRARY for address in selected)


@pytest.mark.parametrize(
    ("word", "selected"),
    [("ROUND AND", ["slow", "fast"]), ("own.toml#s", ["slow"]), ("gallop", ["fast"])],
)
def test_a_word_selects_in_custom_files(tmp_path, monkeypatch, word, selected):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.toml").write_text(OWN)
    (tmp_path / "wrong.toml").write_text("title = 3\nvariant = 4\n")
    addresses = [f"own.toml#{name}" for name in selected]
    assert collect(["own.toml", "wrong.toml"], word) == addresses
    assert collect(["own.toml#fast", *addresses], word) == sorted(
        addresses, key=lambda address: address != "own.toml#fast"
    )
    assert collect(["own.toml", "wrong.toml"], "wrong") == ["wrong.toml"]


def test_scenarios_are_read_once_and_invalid_ones_reported_before_any_is_flown(
    tmp_path, monkeypatch
):
    read = []

    def read_one(*arguments, **options):
        read.append(arguments)
        return load_scenario(*arguments, **options)

    monkeypatch.setattr(checking, "load_scenario", read_one)
    (tmp_path / "good.toml").write_text("[simulation]\nduration = 0.01\n")
    (tmp_path / "wrong.toml").write_text("title = 3\n")
    results = check_all(collect([str(tmp_path)]), 1, {})
    assert [result.status for result in results] == ["invalid", "passed"]
    assert len(read) == 2


def test_a_metric_without_a_value_fails_with_the_reason(tmp_path):
    expected = '[[expect]]\nmetric = "sup_position_error_after_20s"\nmax = 0.1\n'
    (tmp_path / "short.toml").write_text(f"[simulation]\nduration = 0.01\n{expected}")
    (result,) = check_all(collect([str(tmp_path)]), 1, {})
    assert result.status == "failed"
    assert result.message == (
        "sup_position_error_after_20s = flight shorter than 20 s, expected <= 0.1"
    )


def test_the_most_severe_exit_code_is_returned():
    def code(*statuses):
        return exit_code([CheckResult(status, status, "") for status in statuses])

    assert code() == code("passed") == code("passed", "skipped") == 0
    assert code("passed", "failed") == 1
    assert code("failed", "lost", "passed") == 3
    assert code("lost", "invalid") == code("crashed", "failed") == 2
