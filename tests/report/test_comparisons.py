"""Flights beyond the thesis, compared with the same flight without the feature."""

from __future__ import annotations

import pytest

from tiltsim.report.flights import other_address
from tiltsim.report.making import Made, make_report
from tiltsim.report.pages import page

PUSHED = """
title = "Pushed"
source = "beyond the thesis: pushes"
without = "#calm"

[simulation]
duration = 0.4
timestep = 0.002

[[variant]]
name = "calm"
title = "Nobody pushes"

[[variant.expect]]
metric = "final_position_error_x"
max = 1.0

[[variant]]
name = "pushed"
title = "A push <from> the | left"
disturbance = [{ type = "acceleration", value = [1.0, 0.0, 0.0] }]

[[variant.expect]]
metric = "final_position_error_x"
max = 1.0

[[variant.expect]]
metric = "diverged"
equals = false

[[variant]]
name = "thrown"
title = "Thrown"
initial = { attitude = [3.0, 0.0, 0.0] }

[[variant.expect]]
metric = "final_position_error_x"
max = 1.0

[[variant]]
name = "alone"
title = "Compared with a flight that is not flown"
without = "ch04_tracking/setpoint#rho_0_modified"

[[variant.expect]]
metric = "max_rotor_speed"
max = 1000.0
"""


@pytest.fixture(scope="module")
def pushed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pushed")
    (folder / "pushed.toml").write_text(PUSHED, encoding="utf-8")
    return make_report([str(folder)], folder / "kept", 1)


def test_values_are_compared_with_the_other_flight(pushed):
    calm, push = (
        pushed.flights[f"{pushed.comparisons[0].file}#{name}", "mujoco"].metrics
        for name in ("calm", "pushed")
    )
    error, end, thrown, alone = pushed.comparisons
    both = [f"{m['final_position_error_x']:.3g}".replace("-", "−") for m in (calm, push)]
    assert error.plants["mujoco"] == " → ".join(both)
    assert both[0] != both[1]
    assert end.plants == {"thesis": "completed → completed", "mujoco": "completed → completed"}
    assert thrown.plants["mujoco"].startswith(f"{both[0]} → terminated at ")
    assert "→" not in alone.plants["mujoco"]
    assert not pushed.rows, "claims of the thesis there are none"


def test_the_page_has_them(pushed):
    html = page(pushed, Made.now())
    assert '<section id="beyond">' in html
    assert "A push &lt;from&gt; the | left" in html


def test_the_page_names_a_flight_once_for_all_its_metrics(pushed):
    html = page(pushed, Made.now())
    assert html.count("A push &lt;from&gt; the | left") == 1
    row = html[html.index('rowspan="2">A push') :]
    row = row[: row.index("Thrown")]
    assert [row.count(f"<td>{name}") for name in ("final position error x", "diverged")] == [1, 1]


def test_the_library_compares_flights_with_flights_of_the_library(scenarios):
    addresses = {scenario.address for scenario in scenarios}
    pairs = {s.address: other_address(s.address, s.without) for s in scenarios}
    named = {without for without in pairs.values() if without}
    assert len(named) > 10
    assert named <= addresses


def test_a_report_of_the_thesis_alone_has_none(report):
    assert report.comparisons == []
