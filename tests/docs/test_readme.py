"""The README: short, with a moving picture, and with the numbers of the pages that it cites."""

from __future__ import annotations

import re

from PIL import Image

from tests.docs.pages import ROOT, code
from tiltsim.scenario.library import library_entries

README = (ROOT / "README.md").read_text(encoding="utf-8")


def page(name):
    """A page of docs as one line, without bold type."""
    text = (ROOT / "docs" / name).read_text(encoding="utf-8")
    return re.sub(r"\s+", " ", text.replace("**", ""))


def test_it_is_read_in_five_minutes():
    assert len(README.split()) < 800


def test_its_first_blocks_set_up_a_clone():
    """`.ci/run` executes them to the letter."""
    fly, check = code("README.md", "sh")[:2]
    setup = "python3 -m venv .venv && .venv/bin/pip install -q -c constraints.txt "
    assert fly.startswith(f"{setup}. && .venv/bin/tiltsim run ")
    assert check == f"{setup}-e '.[test]' && .venv/bin/python -m pytest -q\n"


def test_its_picture_moves_and_loads_quickly():
    (name,) = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", README)
    file = ROOT / name
    assert file.stat().st_size < 3_000_000
    with Image.open(file) as picture:
        assert (picture.n_frames > 50, picture.info["loop"]) == (True, 0)


def test_it_counts_rows_and_scenarios_as_they_are():
    summary = re.search(
        r"of (\d+) distinct statements. Of all (\d+) rows, (\d+) are reproduced,.* "
        r"in (\d+) the published claim is wrong \((\d+) distinct errors\)",
        page("reproduction.md"),
    )
    statements, rows, reproduced, wrong, errors = summary.groups()
    words = re.sub(r"\s+", " ", README)
    assert f"{statements} published statements, in {rows} rows" in words
    assert f"{reproduced} rows are reproduced; {wrong} are wrong, and" in words
    assert f"trace back to {errors} errors" in words
    assert f"# {len(list(library_entries()))} scenarios" in words


def test_its_figures_are_those_of_the_pages():
    words = re.sub(r"\s+", " ", README)
    table = page("beyond.md")
    published = re.search(r"\| ch. 4, modified decoupler \|(.*?)\| exact", table)[1]
    ours = re.search(r"\| tilt-rate feed-forward \|(.*?)\| without", table)[1]
    published = [float(cell) for cell in re.findall(r"0\.\d+", published)]
    ours = [1e3 * float(cell) for cell in re.findall(r"0\.\d+", ours)]
    assert f"to {min(ours):.0f} to {max(ours):.0f} mm" in words
    assert f"leaves an error of {min(published):.2f} to {max(published):.2f} m" in words
    assert "370,000 (implicitfast)" in page("performance.md")
    assert "370,000 closed-loop steps per second on one core, 1.1 times as many" in words
    native = re.search(r"\| single, native \| 1 \|(.*?)\| recorded", page("performance.md"))[1]
    assert all(1.05 < float(ratio) < 1.15 for ratio in re.findall(r"\d\.\d+", native))
