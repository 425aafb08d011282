"""Events: what is worth telling of a flight, once and at the right time."""

from __future__ import annotations

from dataclasses import replace

import pytest

import tiltsim
from tests.flights import flight
from tiltsim.flight.end import End
from tiltsim.flight.flight import SAMPLE_FIELDS
from tiltsim.scenario.loading import load_scenario
from tiltsim.views.events import EventDetector, flight_events


def texts(events):
    return [event.text for event in events]


def test_a_quiet_flight_tells_what_it_is_how_close_it_came_and_that_it_ended():
    first, closest, last = flight_events(flight("fixed"))
    assert first.text.startswith(
        "tests/fixed: gait fixed, modified decoupler, attitude-altitude law"
    )
    assert "closest to singular: " in closest.text
    assert (last.text, last.level, last.time) == ("flight completed", "INFO", pytest.approx(1.2))


def test_no_gait_is_told_of_a_quadrotor():
    scenario = load_scenario("ch01_gust/hover#quadrotor")
    assert EventDetector(scenario).opening().text == "Quadrotor: yaw-position law, mujoco plant"


def test_saturation_is_told_when_it_sets_in():
    events = [event for event in flight_events(flight("limited")) if "saturated" in event.text]
    assert events
    assert {event.level for event in events} == {"WARN"}
    assert all("390 rad/s" in event.text for event in events)


def test_chatter_is_one_event():
    this = flight("fixed")
    samples = this.samples.copy()
    samples[::2, SAMPLE_FIELDS.index("rotor_speed_2")] = -1.0
    told = texts(flight_events(replace(this, samples=samples)))
    assert told.count("rotor 2 has reversed") == 1


def test_a_small_margin_is_told():
    this = flight("fixed")
    samples = this.samples.copy()
    samples[50:60, SAMPLE_FIELDS.index("pitch")] = -1.15
    events = flight_events(replace(this, samples=samples))
    (near,) = [event for event in events if "singularity margin below" in event.text]
    assert near.time == samples[50, 0]
    assert near.level == "WARN"


def test_a_supervisor_is_told_when_it_sets_in():
    this = flight("supervised")
    acts = this["time"][this["supervision"] > 0.01]
    told = [event for event in flight_events(this) if "supervisor takes" in event.text]
    assert told[0].time == acts[0]
    assert {event.text for event in told} == {"supervisor takes the gait towards red"}
    assert any("margin below 0.9 rad" in text for text in texts(flight_events(this)))


def test_a_lost_flight_ends_with_its_cause():
    lost = replace(flight("fixed"), end=End("singular", 0.7, "why"))
    last = flight_events(lost)[-1]
    assert (last.level, last.text, last.time) == ("ERROR", "flight singular: why", 0.7)


def test_a_flight_in_pieces_tells_the_same_as_a_whole_one():
    this = flight("limited")
    watch = EventDetector(this.scenario)
    pieces = [replace(this, samples=this.samples[at : at + 7]) for at in range(0, len(this), 7)]
    told = [watch.opening(), *(e for piece in pieces for e in watch.observe(piece))]
    assert [*told, *watch.closing(this.end)] == flight_events(this)


def test_switches_between_laws_are_told():
    scenario = tiltsim.load_scenario(
        "ch02_singular_zone/experiments#experiment_1", {"simulation.duration": 0.5}
    )
    found = [e for e in flight_events(tiltsim.simulate(scenario)) if "switched" in e.text]
    assert [event.text.rpartition(" to ")[2] for event in found] == [
        "yaw and position",
        "attitude and altitude",
    ]
    assert found[1].time == pytest.approx(0.308, abs=0.011)
