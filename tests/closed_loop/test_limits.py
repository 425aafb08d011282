"""The bounds beyond which a flight ends: each one, on both of its sides, for both vehicles."""

from __future__ import annotations

from math import nextafter

import pytest

from tiltsim.closed_loop.limits import (
    ALTITUDE_ERROR,
    BODY_RATE,
    HORIZONTAL_ERROR,
    ROTOR_SPEED,
    WITHIN_LIMITS,
    altitude_error,
    horizontal_error,
)
from tiltsim.vehicles import rotorcraft, tilt_car
from tiltsim_controllers.references.trajectories import REFERENCE_TYPES, ReferenceParameters

REFERENCE = ReferenceParameters(REFERENCE_TYPES["line"], (1.0, 2.0, 3.0), (0.5, -0.5, 0.25))
TIME = 2.0
ON_TRACK = {"x": 2.0, "y": 1.0, "z": 3.5}
BOUNDS = {
    "rotorcraft": {
        "x": (1e4, HORIZONTAL_ERROR),
        "y": (1e4, HORIZONTAL_ERROR),
        "z": (1e4, ALTITUDE_ERROR),
        **{name: (1e3, BODY_RATE + axis) for axis, name in enumerate("pqr")},
        **{f"rotor_speed_{rotor}": (1e5, ROTOR_SPEED + rotor - 1) for rotor in (1, 2, 3, 4)},
    },
    "tilt_car": {
        "x": (1e4, HORIZONTAL_ERROR),
        "y": (1e4, HORIZONTAL_ERROR),
        **{f"rotor_speed_{rotor}": (1e5, ROTOR_SPEED + rotor - 1) for rotor in (1, 2)},
    },
}
VEHICLES = {
    "rotorcraft": (rotorcraft.ROTORCRAFT.observed_fields, rotorcraft.ROTORCRAFT.limit_exceeded),
    "tilt_car": (tilt_car.OBSERVED_FIELDS, tilt_car.TILT_CAR.limit_exceeded),
}


def code(vehicle, follows_position=1.0, **changed):
    fields, limit_exceeded = VEHICLES[vehicle]
    values = [{**ON_TRACK, **changed}.get(name, 0.0) for name in fields]
    return limit_exceeded(TIME, values, REFERENCE, (), follows_position)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(
    ("vehicle", "field"), [(vehicle, field) for vehicle in BOUNDS for field in BOUNDS[vehicle]]
)
def test_each_bound_has_its_code_and_belongs_to_what_is_allowed(vehicle, field, side):
    bound, expected = BOUNDS[vehicle][field]
    centre = ON_TRACK.get(field, 0.0)
    at, beyond = (centre + side * error for error in (bound, bound * (1.0 + 1e-12)))
    assert code(vehicle, **{field: at}) == WITHIN_LIMITS
    assert code(vehicle, **{field: nextafter(beyond, side * 1e9)}) == expected


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_no_other_observed_value_ends_a_flight(vehicle):
    fields, _ = VEHICLES[vehicle]
    others = dict.fromkeys(set(fields) - set(BOUNDS[vehicle]), 1e9)
    assert code(vehicle, **others) == WITHIN_LIMITS


def test_where_the_position_is_free_only_the_altitude_counts():
    assert code("rotorcraft", 0.0, x=1e6, y=-1e6) == WITHIN_LIMITS
    assert code("rotorcraft", 0.0, z=1e6) == ALTITUDE_ERROR
    assert code("tilt_car", 0.0, x=1e6) == WITHIN_LIMITS


def test_errors_are_distances_to_the_reference_at_its_time():
    values = (5.0, -3.0, 1.5)
    assert horizontal_error(TIME, values, REFERENCE, ()) == pytest.approx(5.0)
    assert altitude_error(TIME, values, REFERENCE, ()) == pytest.approx(2.0)


def test_the_first_of_several_is_named():
    assert code("rotorcraft", x=1e5, z=1e5, q=1e4) == HORIZONTAL_ERROR
    assert code("rotorcraft", z=1e5, q=1e4) == ALTITUDE_ERROR
    assert code("rotorcraft", q=1e4, rotor_speed_1=1e6) == BODY_RATE + 1
    assert code("tilt_car", rotor_speed_1=1e6, rotor_speed_2=1e6) == ROTOR_SPEED
