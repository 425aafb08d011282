"""An interrupt ends a study, though it only shortens the flight in which it comes."""

from __future__ import annotations

import pytest

import tiltsim.simulation.simulate
from tiltsim.commands.thesis import fly_decouplers
from tiltsim.report.pictures import PICTURES
from tiltsim.scenario.loading import load_scenario
from tiltsim.studies.benchmark import bench_accuracy
from tiltsim.studies.checking import check_one
from tiltsim.studies.comparison import SEARCHES, Entry, _survived, compare_one

SETPOINT = "ch04_tracking/setpoint#rho_065_modified"
ENTRY = Entry(SETPOINT, "pid", {"law": "pid"}, {})
DRAWN = next(picture for picture in PICTURES if len(picture.flights) == 1)
STUDIES = {
    "accuracy": bench_accuracy,
    "check": lambda: check_one((SETPOINT, load_scenario(SETPOINT))),
    "comparison": lambda: compare_one(ENTRY, searches=False),
    "decouplers": fly_decouplers,
    "picture": lambda: DRAWN.draw({}),
    "search": lambda: _survived(load_scenario(SETPOINT), SEARCHES["max_mass_factor"]),
}


@pytest.mark.parametrize("study", STUDIES.values(), ids=STUDIES)
def test_an_interrupted_flight_interrupts_its_study(study, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(tiltsim.simulation.simulate, "fly_chunk", interrupted)
    with pytest.raises(KeyboardInterrupt):
        study()
