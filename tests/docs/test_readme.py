"""The README: short, with a moving picture, and with the numbers of the pages that it cites."""

from __future__ import annotations

import re

from PIL import Image

from tests.docs.pages import ROOT, code
from tiltsim.report.claims import registered_claims, scenario_claims
from tiltsim.report.findings import ERRORS
from tiltsim.scenario.loading import load_scenario

README = (ROOT / "README.md").read_text(encoding="utf-8")


def page(name):
    """A page of docs as one line, without bold type."""
    text = (ROOT / "docs" / name).read_text(encoding="utf-8")
    return re.sub(r"\s+", " ", text.replace("**", ""))


def test_the_readme_is_read_in_five_minutes():
    assert len(README.split()) < 800


def test_the_first_blocks_of_the_readme_set_up_a_clone():
    """`.ci/run` executes them to the letter."""
    fly, check = code("README.md", "sh")[:2]
    setup = "python3 -m venv .venv && .venv/bin/pip install -q -c constraints.txt "
    flight = ".venv/bin/tiltsim run 'beyond/references#figure_eight' --out flights/eight"
    assert fly == f"{setup}. &&\n{flight} &&\n.venv/bin/tiltsim plot flights/eight\n"
    assert check == f"{setup}-e '.[test]' &&\n.venv/bin/python -m pytest -q\n"


def test_the_picture_of_the_readme_moves_and_loads_quickly():
    (name,) = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", README)
    file = ROOT / name
    assert file.stat().st_size < 1_500_000
    with Image.open(file) as picture:
        assert (picture.n_frames > 50, picture.info["loop"]) == (True, 0)


def test_the_readme_counts_rows_correctly():
    """The first sentences of the report, which its command writes, have all its numbers."""
    report = page("reproduction.md")
    statements, rows, flown = re.search(
        r"(\d+) statements in (\d+) rows, (\d+) of them flown, the others computed", report
    ).groups()
    reproduced = re.search(r"computed. (\d+) rows are reproduced", report)[1]
    wrong, errors = re.search(
        r"(\d+) rows are refuted or misprints; they trace back to (\d+) errors", report
    ).groups()
    words = re.sub(r"\s+", " ", README)
    computed = int(rows) - int(flown)
    assert f"{statements} published statements in {rows} rows with a verdict each" in words
    assert f"{flown} rows flown on two simulators, {computed} computed" in words
    assert f"{reproduced} are reproduced; {wrong} are refuted or misprints" in words
    assert f"trace back to [{errors} errors](docs/errors.md)" in words
    assert int(errors) == len(ERRORS)


def test_the_report_agrees_with_the_claims(scenarios):
    """So that its numbers, and the README's, do not come from an earlier library."""
    statements = {claim.statement.id for claim in registered_claims()}
    rows = {claim.id for claim in registered_claims()}
    for scenario in scenarios:
        for claim in scenario_claims(scenario):
            statements.add(claim.statement.id)
            rows.add(claim.id)
    assert f"{len(statements)} statements in {len(rows)} rows" in page("reproduction.md")


def cells(name, row, end):
    """The numbers below 1 in the cells of a table's row, up to the start of another one."""
    found = re.search(rf"\| {row} \|(.*?)\| {end}", page(name))[1]
    return [float(cell) for cell in re.findall(r"0\.\d+", found)]


def test_the_feed_forward_of_the_readme_is_compared_with_ablations():
    words = re.sub(r"\s+", " ", README)
    published = cells("beyond.md", "ch. 4, modified decoupler", "exact")
    ours = [1e3 * cell for cell in cells("beyond.md", "tilt-rate feed-forward", "without")]
    without = cells("beyond.md", "without both", "without")
    assert f"to {min(ours):.0f} to {max(ours):.0f} mm" in words
    assert f"without the tilt rates to {min(without):.2f} to {max(without):.2f} m" in words
    assert f"leaves an error of {min(published):.2f} to {max(published):.2f} m" in words


def test_the_speed_in_the_readme_names_integrator_and_timers():
    words, speed = re.sub(r"\s+", " ", README), page("performance.md")
    rk4, implicitfast = re.search(r"([\d,]+) \(RK4,.*?([\d,]+) \(implicitfast\)", speed).groups()
    assert f"{implicitfast} closed-loop steps per second on one core with implicitfast" in words
    assert f"{rk4} with RK4, the default" in words
    assert load_scenario("ch04_tracking/setpoint#rho_0_modified").simulation.integrator == "RK4"
    native = re.search(r"\| single, native \| 1 \|(.*?)\| recorded", speed)[1]
    ratios = [float(ratio) for ratio in re.findall(r"\d\.\d+", native)]
    assert {f"{ratio:.1f}" for ratio in ratios} == {"1.1"}
    empty = re.search(r"empty callback\* \| 1 \| ([\d.]+) \| ([\d.]+) \| ([\d.]+)", speed).groups()
    assert {f"{float(ratio):.1f}" for ratio in empty} == {"0.9"}
    assert (
        "1.1 times as many as bare `mj_step` with its timers on, 0.9 times with them off" in words
    )
