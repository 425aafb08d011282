"""Several vehicles, and objects on cables or in contact, in linear analysis."""

from __future__ import annotations

from math import hypot, log, pi, sqrt

import numpy as np
import pytest

import tiltsim
from tiltsim.errors import InputError
from tiltsim.linear.equilibrium import equilibrium_of
from tiltsim.linear.linearization import linearization_at
from tiltsim.linear.stability import stability_at

HEXAROTOR = {
    "vehicle": {"model": "multirotor", "mjcf": "mjcf/tilt_hexarotor.xml", "max_rotor_speed": 838.0},
    "simulation": {"integrator": "implicitfast", "duration": 12.0},
    "controller": {
        "law": "full_pose",
        "gains": {"position": [762.0, 9036.0, 27000.0], "attitude": [780.0, 22725.0, 168750.0]},
    },
    "gait": {"type": "fixed", "angles": [0.35, -0.35, 0.35, -0.35, 0.35, -0.35]},
    "reference": {"type": "setpoint"},
}
GEOMETRIC = {"reference": {"type": "setpoint"}, "controller": {"law": "geometric"}}
WING = {
    "name": "wing",
    "scenario": "fleet/hexarotor#hover",
    "offset": [0.0, -1.0, 0.0],
    "changes": GEOMETRIC,
}
PARCEL = {
    "name": "parcel",
    "type": "box",
    "position": [0.0, 0.0, -1.0],
    "size": [0.1, 0.1, 0.1],
    "joint": "free",
    "mass": 0.1,
}
BELOW = [0.0, 0.0, -0.05]
TWO_CABLES = HEXAROTOR | {
    "object": [PARCEL],
    "initial": {"position": [-0.5, 0.0, 0.1]},
    "reference": {"type": "setpoint", "position": [-0.5, 0.0, 0.1]},
    "companion": [{"name": "right", "offset": [1.0, 0.0, 0.0]}],
    "cable": [
        {"name": "one", "object": "parcel", "length": 1.2, "attachment": BELOW},
        {"name": "two", "object": "parcel", "length": 1.2, "attachment": BELOW, "vehicle": "right"},
    ],
}


def apart(some, others):
    """Largest distance (rad/s) from a pole to the nearest of the others, either way."""
    assert len(some) == len(others)
    distances = np.abs(np.subtract.outer(some, others))
    return max(distances.min(axis=0).max(), distances.min(axis=1).max())


def test_vehicles_that_nothing_couples_keep_their_poles_and_their_feedback():
    alone = tiltsim.linearize(tiltsim.parse_scenario(HEXAROTOR))
    changes = GEOMETRIC | {"simulation": {"integrator": "implicitfast"}, "expect": []}
    wing = tiltsim.linearize(tiltsim.load_scenario("fleet/hexarotor#hover", changes))
    scenario = tiltsim.parse_scenario(HEXAROTOR | {"companion": [WING]})
    found = equilibrium_of(scenario)
    both = linearization_at(found)
    assert apart(both.poles, np.concatenate((alone.poles, wing.poles))) < 1e-9
    names, inputs = ([each.name for each in of] for of in (both.states, both.inputs))
    for prefix, one in (("", alone), ("wing_", wing)):
        rows = [inputs.index(prefix + each.name) for each in one.inputs]
        own = [names.index(prefix + each.name) for each in one.states]
        others = [index for index in range(len(names)) if index not in own]
        scale = np.abs(one.feedback).max()
        assert np.abs(both.feedback[np.ix_(rows, own)] - one.feedback).max() < 1e-9 * scale
        assert not both.feedback[np.ix_(rows, others)].any()
        units = [both.states[index].unit for index in own]
        assert units == [each.unit for each in one.states]
    modes = {mode.name for mode in stability_at(found).modes}
    assert {"altitude", "wing altitude"} <= modes


@pytest.mark.slow
def test_a_margin_of_a_vehicle_is_its_margin_alone():
    alone = {each.place: each for each in tiltsim.margins(tiltsim.parse_scenario(HEXAROTOR))}
    scenario = tiltsim.parse_scenario(HEXAROTOR | {"companion": [WING]})
    among = {each.place: each for each in tiltsim.margins(scenario)}
    for place in ("z", "rotation_x", "tilt_command_3"):
        assert among[place].gain == pytest.approx(alone[place].gain, rel=1e-6)
        assert among[place].delay == pytest.approx(alone[place].delay, rel=1e-6)
    assert {"wing_z", "wing_rotor_acceleration_1"} <= {*among}


@pytest.mark.slow
def test_an_object_on_a_cable_has_the_poles_of_a_load():
    load = {"mass": 0.1, "length": 1.0, "attachment": [0.0, 0.0, 0.0]}
    cable = {"name": "sling", "object": "parcel", "length": 1.0}
    loaded, hung = (
        tiltsim.stability(tiltsim.parse_scenario(HEXAROTOR | more))
        for more in ({"payload": load}, {"object": [PARCEL], "cable": [cable]})
    )
    assert apart(hung.poles, loaded.poles) < 1e-8
    assert hung.states == tuple(name.replace("swing", "parcel_swing") for name in loaded.states)


BALL = PARCEL | {"type": "sphere", "size": [0.05], "friction": 0.0}
WALL = {"name": "wall", "type": "wall", "position": [0.04995, 0.0, -1.0], "size": [0.2, 0.2]}
WALL["friction"] = 0.0


@pytest.mark.parametrize(
    ("objects", "reason"),
    [
        ([PARCEL | {"floating": True}], "sling is slack at rest: let it end, or shorten it"),
        pytest.param(
            [BALL, WALL],
            "parcel hangs and touches something at rest; part them",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_an_object_that_its_cable_alone_does_not_hold_is_refused(objects, reason):
    cable = {"name": "sling", "object": "parcel", "length": 1.0}
    with pytest.raises(InputError, match=reason):
        tiltsim.stability(tiltsim.parse_scenario(HEXAROTOR | {"object": objects, "cable": [cable]}))


@pytest.mark.slow
def test_a_push_returns_to_its_force_as_its_matrix_says():
    """A second after the integral of the force was moved, but for the delay of the reading."""
    found = equilibrium_of(tiltsim.load_scenario("interaction/push#hold"))
    names, motion, state = found.minimal.names, found.motion, found.root.state
    offset = np.zeros(motion.coordinates.size)
    offset[motion.coordinates.names.index("push_integral")] = 0.05
    start = motion.coordinates.moved(state, offset)
    ends = [motion.flown(found.step, each, 1000) for each in (state, start)]
    after = motion.coordinates.between(*ends)[found.kept]
    values, vectors = np.linalg.eig(found.matrix)
    moving = vectors @ np.diag(np.exp(values)) @ np.linalg.pinv(vectors)
    expected = (moving @ (found.minimal.rows @ offset)).real
    for name in ("push_integral", "filtered_push_force", "y"):
        index = names.index(name)
        assert after[index] == pytest.approx(expected[index], rel=1e-2), name


@pytest.mark.slow
def test_two_vehicles_and_their_load_swing_in_flight_as_their_poles_say():
    found = tiltsim.stability(tiltsim.parse_scenario(TWO_CABLES))
    assert found.states[-2:] == ("parcel_swing_y", "parcel_swing_rate_y")
    mode = found.modes[1]
    assert mode.states[0].startswith("parcel_swing")
    aside = PARCEL | {"position": [0.0, 0.02, -1.0]}
    flight = tiltsim.simulate(tiltsim.parse_scenario(TWO_CABLES | {"object": [aside]}))
    swing, time = flight["parcel_y"], flight["time"]
    tops = 1 + np.flatnonzero((swing[1:-1] > swing[:-2]) & (swing[1:-1] >= swing[2:]))[-4:]
    cycles = time[tops[-1]] - time[tops[0]]
    frequency, decay = 6.0 * pi / cycles, log(swing[tops[0]] / swing[tops[-1]]) / cycles
    assert frequency == pytest.approx(mode.frequency * sqrt(1.0 - mode.damping**2), rel=2e-3)
    assert decay / hypot(frequency, decay) == pytest.approx(mode.damping, rel=0.05)
