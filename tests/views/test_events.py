"""Events of a flight: each reported once and at the right time."""

from __future__ import annotations

from dataclasses import replace

import pytest

import tiltsim
from tests.flights import SAMPLE_FIELDS, flight
from tiltsim.flight.metrics import End
from tiltsim.laws.assembling import assemble
from tiltsim.scenario.loading import load_scenario
from tiltsim.views.titles import EventDetector, conditions


def flight_events(flight):
    """All events of a rotorcraft's flight, in order of time."""
    detector = EventDetector(flight.assembly)
    return [*detector.opening(), *detector.observe(flight), *detector.closing(flight.end)]


def texts(events):
    return [event.text for event in events]


def test_a_flight_without_incidents_has_an_opening_its_margin_and_an_end():
    *first, closest, last = flight_events(flight("fixed"))
    assert texts(first) == [
        "tests/fixed",
        "fixed gait",
        "modified decoupler, attitude-altitude controller",
        "mujoco plant",
    ]
    assert "minimum singularity margin: " in closest.text
    assert (last.text, last.level, last.time) == ("flight completed", "INFO", pytest.approx(1.2))


def test_the_opening_of_a_quadrotor_names_no_gait():
    scenario = load_scenario("ch01_gust/hover#quadrotor")
    opening = EventDetector(assemble(scenario)).opening()
    assert texts(opening) == ["Quadrotor", "yaw-position controller", "mujoco plant"]


def test_saturation_is_reported_at_its_onset():
    events = [event for event in flight_events(flight("limited")) if "saturated" in event.text]
    assert events
    assert {event.level for event in events} == {"WARN"}
    assert all("390 rad/s" in event.text for event in events)


def test_chatter_is_one_event():
    this = flight("fixed")
    samples = this.samples.copy()
    samples[::2, SAMPLE_FIELDS.index("rotor_speed_2")] = -1.0
    found = texts(flight_events(replace(this, samples=samples)))
    assert found.count("rotor 2 reversed") == 1


def test_a_small_margin_is_reported():
    this = flight("fixed")
    samples = this.samples.copy()
    samples[50:60, SAMPLE_FIELDS.index("pitch")] = -1.15
    events = flight_events(replace(this, samples=samples))
    (near,) = [event for event in events if "singularity margin below" in event.text]
    assert near.time == samples[50, 0]
    assert near.level == "WARN"


def test_a_supervisor_is_reported_when_it_becomes_active():
    this = flight("supervised")
    active = this["time"][this["supervision"] > 0.01]
    found = [event for event in flight_events(this) if "supervisor moves" in event.text]
    assert found[0].time == active[0]
    assert {event.text for event in found} == {"supervisor moves the gait toward red"}
    assert any("margin below 0.9 rad" in text for text in texts(flight_events(this)))


def test_a_flight_that_terminates_early_ends_with_its_cause():
    lost = replace(flight("fixed"), end=End("singular", 0.7, "why"))
    last = flight_events(lost)[-1]
    assert (last.level, last.time) == ("ERROR", 0.7)
    assert last.text == "flight terminated early (singular): why"


def test_a_flight_in_pieces_has_the_events_of_a_complete_one():
    this = flight("limited")
    detector = EventDetector(this.assembly)
    pieces = [replace(this, samples=this.samples[at : at + 7]) for at in range(0, len(this), 7)]
    found = [*detector.opening(), *(e for piece in pieces for e in detector.observe(piece))]
    assert [*found, *detector.closing(this.end)] == flight_events(this)


def test_switches_between_control_laws_are_reported():
    scenario = tiltsim.load_scenario(
        "ch02_singular_zone/experiments#experiment_1", {"simulation.duration": 0.5}
    )
    found = [e for e in flight_events(tiltsim.simulate(scenario)) if "switched" in e.text]
    assert [event.text.rpartition(" to ")[2] for event in found] == [
        "yaw-position control",
        "attitude-altitude control",
    ]
    assert found[1].time == pytest.approx(0.308, abs=0.011)


def test_a_tilt_cars_rotor_at_rest_is_saturated():
    this = flight("tilt_car")
    resting = this["rotor_speed_1"] <= 0.0
    found = conditions(this)
    assert [*found] == ["rotor 1 saturated at zero", "rotor 2 saturated at zero"]
    assert (found["rotor 1 saturated at zero"] == resting).all()
