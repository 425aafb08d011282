"""Flights on disk: each file whole or not at all."""

from __future__ import annotations

import json
import os
import tomllib
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from tests.damage import read_with_flipped_bits
from tests.flights import SAMPLE_FIELDS
from tests.refusals import refusal
from tiltsim.errors import InputError
from tiltsim.flight import writing
from tiltsim.flight.flight import Flight
from tiltsim.flight.metrics import End
from tiltsim.flight.reading import load_flight
from tiltsim.flight.writing import metrics_json
from tiltsim.scenario.loading import parse_scenario, scenario_toml, without_none
from tiltsim.system.files import prepare_folder
from tiltsim.vehicles.rotorcraft import COLUMNS

FOREIGN = "not written by this version of tiltsim, or edited since"
NAMES = {"flight.parquet", "metrics.json", "scenario.toml"}
SCENARIO = {"title": "by hand", "simulation": {"duration": 0.5, "seed": 5}}


def flight(x=0.0):
    samples = np.zeros((3, len(SAMPLE_FIELDS)))
    samples[:, 0] = (0.0, 0.25, 0.5)
    samples[:, SAMPLE_FIELDS.index("x")] = x
    samples[:, -8:-4] = (-300.0, 300.0, -300.0, 300.0)
    end = End("singular", 0.5, "why it ended")
    return Flight.of_scenario(parse_scenario(SCENARIO, "by/hand"), samples, end, "python", 0.1)


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_saving_writes_three_files_and_nothing_else(tmp_path):
    folder = tmp_path / "deep" / "down"
    flight().save(folder)
    assert set(contents(folder)) == NAMES


def test_saving_again_replaces_all_three(tmp_path):
    flight(x=1.0).save(tmp_path)
    before = contents(tmp_path)
    flight(x=2.0).save(tmp_path)
    after = contents(tmp_path)
    assert set(after) == NAMES
    assert json.loads(after["metrics.json"])["final_position_error_x"] == -2.0
    assert after["flight.parquet"] != before["flight.parquet"]


@pytest.mark.parametrize("writer", ["parquet_bytes", "metrics_json", "scenario_toml"])
@pytest.mark.parametrize("failure", [InputError("no disk"), KeyboardInterrupt()])
def test_a_write_that_fails_leaves_the_old_file_whole(tmp_path, monkeypatch, writer, failure):
    flight(x=1.0).save(tmp_path)
    before = contents(tmp_path)

    def failing(_content):
        raise failure

    monkeypatch.setattr(writing, writer, failing)
    with pytest.raises(type(failure)):
        flight(x=2.0).save(tmp_path)
    after = contents(tmp_path)
    file = {"parquet_bytes": "flight.parquet", "metrics_json": "metrics.json"}
    failed = file.get(writer, "scenario.toml")
    assert after[failed] == before[failed]
    assert set(after) == NAMES, "no temporary file is left behind"


def test_files_get_the_permissions_of_the_users_umask(tmp_path):
    previous = os.umask(0o027)
    try:
        flight().save(tmp_path)
    finally:
        os.umask(previous)
    modes = {path.name: path.stat().st_mode & 0o777 for path in tmp_path.iterdir()}
    assert modes == dict.fromkeys(NAMES, 0o640)


def test_metrics_json_is_a_flat_object_with_every_digit(tmp_path):
    this = flight(x=0.1 + 0.2)
    this.save(tmp_path)
    text = (tmp_path / "metrics.json").read_text(encoding="utf-8")
    assert json.loads(text) == this.metrics()
    assert text == metrics_json(this.metrics())
    assert text.endswith("}\n")


def test_parquet_holds_every_column_with_its_unit(tmp_path):
    this = flight(x=1.5)
    this.save(tmp_path)
    table = pq.read_table(tmp_path / "flight.parquet")
    units = {field.name: field.metadata[b"unit"].decode() for field in table.schema}
    assert units == {name: column.unit for name, column in COLUMNS.items()}
    assert list(units) == list(COLUMNS)
    for name, column in this.columns.items():
        np.testing.assert_array_equal(table[name].to_numpy(), column)


def test_parquet_says_where_the_flight_comes_from(tmp_path):
    flight().save(tmp_path)
    metadata = pq.read_schema(tmp_path / "flight.parquet").metadata
    origin = {key.decode(): value.decode() for key, value in metadata.items()}
    assert parse_scenario(json.loads(origin["scenario"]), "by/hand") == flight().scenario
    assert origin["address"] == "by/hand"
    assert origin["seed"] == "5"
    assert origin["engine"] == "python"
    assert (origin["end"], origin["cause"]) == ("singular", "why it ended")
    assert {"tiltsim_version", "mujoco_version", "numpy_version"} <= set(origin)


def test_scenario_toml_writes_out_the_defaults_and_reads_back(tmp_path):
    flight().save(tmp_path)
    document = tomllib.loads((tmp_path / "scenario.toml").read_text(encoding="utf-8"))
    assert document["simulation"]["timestep"] == 0.001
    assert document["simulation"]["duration"] == 0.5
    assert parse_scenario(document, "by/hand") == flight().scenario
    assert "mass" not in document["vehicle"], "TOML has no null"


def test_scenario_toml_is_the_same_for_equal_scenarios():
    assert scenario_toml(parse_scenario(SCENARIO)) == scenario_toml(parse_scenario(SCENARIO))


def test_without_none_reaches_into_lists_and_tables():
    document = {"a": None, "b": {"c": None, "d": 0}, "e": [{"f": None, "g": False}], "h": ()}
    assert without_none(document) == {"b": {"d": 0}, "e": [{"g": False}], "h": []}


def test_prepare_folder_makes_it_with_its_parents(tmp_path):
    prepare_folder(tmp_path / "a" / "b")
    prepare_folder(tmp_path / "a" / "b")
    assert (tmp_path / "a" / "b").is_dir()


def test_a_folder_that_cannot_be_made_is_an_input_error(tmp_path):
    (tmp_path / "file").write_text("in the way")
    for folder, reason in (
        (tmp_path / "file", "is a file; give a folder"),
        (tmp_path / "file" / "below", "cannot be created: "),
    ):
        with pytest.raises(InputError) as caught:
            prepare_folder(folder)
        line = str(caught.value)
        assert line.startswith(f"{folder}: {reason}")
        assert len(line.splitlines()) == 1


def test_a_folder_that_is_not_writable_is_an_input_error(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "access", lambda _path, mode: mode != os.W_OK)
    with pytest.raises(InputError, match="not writable"):
        prepare_folder(tmp_path)


# --- reading back ------------------------------------------------------------------------------


@pytest.mark.parametrize("path", ["", "flight.parquet"])
def test_a_flight_reads_back_whole(tmp_path, path):
    written = flight(x=0.1 + 0.2)
    written.save(tmp_path)
    read = load_flight(tmp_path / path)
    np.testing.assert_array_equal(read.samples, written.samples)
    assert read.scenario == written.scenario
    assert read.scenario.address == "by/hand"
    assert (read.end, read.engine, read.wall_time) == (written.end, "python", 0.1)
    assert read.metrics() == written.metrics()


def refused(path):
    line = refusal(load_flight, path)
    assert str(path) in line
    return line


def test_a_missing_flight_is_an_input_error(tmp_path):
    assert "no flight.parquet in this folder" in refused(tmp_path)
    (tmp_path / "mine.toml").write_text("", encoding="utf-8")
    assert "a scenario, not a flight; give a folder" in refused(tmp_path / "mine.toml")
    assert "no such file" in refused(tmp_path / "nothing.parquet")


@pytest.mark.parametrize("content", [b"", b"PAR1 and then noise", b"\0" * 1000])
def test_a_file_that_is_no_parquet_is_an_input_error(tmp_path, content):
    (tmp_path / "flight.parquet").write_bytes(content)
    assert "not a readable Parquet file" in refused(tmp_path)


def test_a_truncated_file_is_an_input_error(tmp_path):
    flight().save(tmp_path)
    file = tmp_path / "flight.parquet"
    content = file.read_bytes()
    file.write_bytes(content[:-100])
    assert "damaged" in refused(file)
    file.write_bytes(content[:1000])
    assert "not a readable Parquet file" in refused(file)


@pytest.mark.parametrize("flips", [50, pytest.param(1000, marks=pytest.mark.slow)])
def test_a_flipped_bit_is_refused_or_changes_nothing(tmp_path, flips):
    flight().save(tmp_path)
    file = tmp_path / "flight.parquet"
    whole = load_flight(file)
    for found in read_with_flipped_bits(file, lambda: load_flight(file), flips):
        assert found.origin() == whole.origin()
        np.testing.assert_array_equal(found.samples, whole.samples)


def test_a_foreign_parquet_file_is_an_input_error(tmp_path):
    file = tmp_path / "other.parquet"
    pq.write_table(pa.table({"time": [0.0]}), file)
    assert "not a flight" in refused(file)


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("scenario", "{", "not a flight"),
        ("scenario", "[3]", "not a flight"),
        ("scenario", "[" * 100_000, "not a flight"),
        ("engine", "steam", "engine 'steam' is unknown"),
        ("end", "bored", "end 'bored' is unknown"),
        ("end_time", "late", "not a flight"),
        ("end_time", "nan", "end_time = nan: must be from 0 to 1e+09"),
        ("end_time", "1e300", r"end_time = 1e+300: must be from 0 to 1e+09"),
        ("wall_time", None, "no 'wall_time' in its metadata"),
    ],
)
def test_wrong_metadata_are_an_input_error(tmp_path, key, value, words):
    table = flight().to_arrow()
    metadata = {**table.schema.metadata, key.encode(): (value or "").encode()}
    if value is None:
        del metadata[key.encode()]
    pq.write_table(table.replace_schema_metadata(metadata), tmp_path / "flight.parquet")
    assert words in refused(tmp_path / "flight.parquet")


def test_a_missing_column_is_an_input_error(tmp_path):
    pq.write_table(flight().to_arrow().drop_columns(["vx"]), tmp_path / "flight.parquet")
    assert "no column vx" in refused(tmp_path / "flight.parquet")
    twice = flight().to_arrow().append_column("vx", [[0.0, 0.0, 0.0]])
    pq.write_table(twice, tmp_path / "flight.parquet")
    assert "2 columns vx" in refused(tmp_path / "flight.parquet")


# --- what is not replaced ------------------------------------------------------------------------


OWN_SCENARIO = "# mine\n[controller]\nlaw = 'python'\nfunction = 'my_law.py:law'\n"


def flown_with(file, folder):
    """Write a flight as if a user's controller had flown it."""
    own = {**SCENARIO, "controller": {"law": "python", "function": f"{file}:law"}}
    writing.write_flight(folder, flight().to_arrow(), {}, parse_scenario(own))


@pytest.fixture
def law(tmp_path):
    """The file of a user's controller."""
    (tmp_path / "own").mkdir()
    file = tmp_path / "own" / "my_law.py"
    file.write_text("law = None\n")
    return file


@pytest.mark.parametrize("edit", ["", "# mine, too\n"])
def test_a_scenario_that_somebody_wrote_or_edited_is_not_replaced(tmp_path, edit):
    if edit:
        flight().save(tmp_path)
    with (tmp_path / "scenario.toml").open("a") as file:
        file.write(edit or OWN_SCENARIO)
    before = contents(tmp_path)
    with pytest.raises(InputError, match=rf"scenario.toml: {FOREIGN}"):
        flight(x=2.0).save(tmp_path)
    assert contents(tmp_path) == before


@pytest.mark.parametrize("name", ["flight.parquet", "metrics.json"])
def test_a_file_without_a_scenario_of_ours_is_not_replaced(tmp_path, name):
    (tmp_path / name).write_bytes(b"mine")
    with pytest.raises(InputError, match=f"{name}: {FOREIGN}"):
        flight().save(tmp_path)
    assert contents(tmp_path) == {name: b"mine"}


@pytest.mark.parametrize("kept", [0, 1, 2, 3])
def test_a_killed_process_leaves_a_folder_that_the_next_flight_may_replace(
    tmp_path, law, monkeypatch, kept
):
    """Killed after some of the four files took their places: later ones are not replaced."""
    out, replace = tmp_path / "out", Path.replace
    replaced = []

    def dies(path, target):
        replaced.append(target.name)
        return replace(path, target) if len(replaced) <= kept else None

    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", dies)
        flown_with(law, out)
    assert replaced[0] == "scenario.toml"
    law.write_text("law = 3\n")
    flown_with(law, out)
    assert (out / "my_law.py").read_text() == "law = 3\n"


def test_a_copied_controller_is_replaced_by_a_later_version(tmp_path, law):
    out = tmp_path / "out"
    for text in ("law = None\n", "law = 3\n"):
        law.write_text(text)
        flown_with(law, out)
        assert (out / "my_law.py").read_text() == text
    resolved = tomllib.loads((out / "scenario.toml").read_text())
    assert resolved["controller"]["function"] == "my_law.py:law"
    flown_with(out / "my_law.py", out)  # the copy itself
    assert (out / "my_law.py").read_text() == "law = 3\n"


@pytest.mark.parametrize("flown_before", [False, True])
def test_another_controller_is_not_replaced(tmp_path, law, flown_before):
    out = tmp_path / "out"
    out.mkdir()
    if flown_before:
        flown_with(law, out)
    (out / "my_law.py").write_text("law = 'another'\n")
    before = contents(out)
    with pytest.raises(InputError, match=rf"my_law.py: {FOREIGN}"):
        flown_with(law, out)
    assert contents(out) == before


def test_the_digest_of_a_copied_controller_is_carried_forward(tmp_path, law):
    """By flights of the resolved scenario, and by flights without a custom controller."""
    out = tmp_path / "out"
    flown_with(law, out)
    flown_with(out / "my_law.py", out)
    flight().save(out)
    law.write_text("law = 3\n")
    flown_with(law, out)
    assert (out / "my_law.py").read_text() == "law = 3\n"


@pytest.mark.parametrize("flown_before", [False, True])
def test_a_controller_that_was_flown_from_its_own_folder_is_not_replaced(
    tmp_path, law, flown_before
):
    """It is no copy: the user's own file, or a copy that was edited."""
    out = tmp_path / "out"
    out.mkdir()
    if flown_before:
        flown_with(law, out)
    (out / "my_law.py").write_text("law = 'mine'\n")
    flown_with(out / "my_law.py", out)
    with pytest.raises(InputError, match=rf"my_law.py: {FOREIGN}"):
        flown_with(law, out)
    assert (out / "my_law.py").read_text() == "law = 'mine'\n"


@pytest.mark.parametrize("name", sorted(NAMES))
def test_a_folder_in_the_place_of_a_file_is_noticed_before_anything_is_written(tmp_path, name):
    (tmp_path / name).mkdir()
    with pytest.raises(InputError, match=f"{name}: not a file"):
        flight().save(tmp_path)
    assert list(tmp_path.iterdir()) == [tmp_path / name]


def test_text_that_is_not_unicode_does_not_lose_a_flight(tmp_path):
    one = flight()
    scenario = parse_scenario(SCENARIO, os.fsdecode(b"caf\xe9.toml"))
    end = End("failed", 0.5, "the controller raised \ud800")
    Flight.of_scenario(scenario, one.samples, end, "python", 0.1).save(tmp_path)
    read = load_flight(tmp_path)
    assert read.scenario.address == r"caf\udce9.toml"
    assert read.end.cause == r"the controller raised \ud800"


@pytest.mark.parametrize("table", ["title", "controller.function"])
def test_a_scenario_with_text_that_is_not_unicode_is_refused(table):
    document = {"title": "a\udcff"} if table == "title" else {}
    if not document:
        document = {"controller": {"law": "python", "function": "a\udcff.py:law"}}
    with pytest.raises(InputError, match=rf'{table} = "a.*": not valid Unicode'):
        parse_scenario(document)
