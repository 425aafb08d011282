"""Places, lift, torque and momentum of rotors: the cross in closed form, and any rotors."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest

from tests.controllers.multirotors import SMALL
from tiltsim_controllers.vehicle.effectiveness import Rotor
from tiltsim_controllers.vehicle.parameters import PRESETS, SPIN
from tiltsim_controllers.vehicle.rotor_code import (
    TILTING_CROSS,
    UPRIGHT_CROSS,
    rotor_code_of,
    rotors_of,
)

CROSS = PRESETS["ar_drone_2"]
ARMS = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
HINGES = ARMS[[0, 1, 0, 3]]
"""Hinge axes of the first four of five rotors; the first and the third share a hinge."""
AXIS = (0.48, 0.64, 0.6)
"""Thrust axis of these at zero tilt, inclined along and across their hinges."""
LAST = Rotor((0.1, 0.1, 0.3), (0.6, 0.0, 0.8), 9e-6, 3e-7, -1.0)


class Case(NamedTuple):
    """Code for a vehicle, and what NumPy finds for it."""

    code: Any
    vehicle: Any
    axes: Any  # (tilts): thrust axes, shape (N, 3)
    places: Any  # (tilts): of the rotors, m, shape (N, 3)
    tilts: int
    hinges: Any  # unit vectors along them, shape (tilts, 3)
    thrusts: Any  # K_f, shape (N,)
    drags: Any  # K_m


def turned(vectors, arms, tilts):
    """Vectors turned about arms by the tilts."""
    along = arms * np.sum(arms * vectors, axis=1, keepdims=True)
    cosines, sines = np.cos(tilts)[:, np.newaxis], np.sin(tilts)[:, np.newaxis]
    return along + cosines * (vectors - along) + sines * np.cross(arms, vectors)


def on_cross(name):
    upright = np.tile((0.0, 0.0, 1.0), (4, 1))
    coefficients = (np.full(4, CROSS.thrust_coefficient), np.full(4, CROSS.drag_coefficient))
    arms = CROSS.arm_length * ARMS
    if name == "upright cross":
        return Case(
            UPRIGHT_CROSS,
            CROSS,
            lambda tilts: upright,
            lambda tilts: arms,
            0,
            ARMS[:0],
            *coefficients,
        )
    axes = lambda tilts: turned(upright, ARMS, tilts)  # noqa: E731
    return Case(TILTING_CROSS, CROSS, axes, lambda tilts: arms, 4, ARMS, *coefficients)


def any_rotors(hinged):
    """Four rotors a little above their hinges and inclined to them, or fixed, and a canted one."""
    layout = (0, 1, 0, 2) if hinged else (-1,) * 4
    rotors = [
        Rotor(
            tuple(0.2 * arm + (0.0, 0.0, 0.05)), AXIS, 8e-6, 2e-7, SPIN[i], layout[i],
            tuple(0.2 * arm), tuple(HINGES[i]),
        )
        for i, arm in enumerate(ARMS)
    ]  # fmt: skip
    rotors = (*rotors, LAST)

    def around(vectors, last, tilts):
        angles = [tilts[i] if i >= 0 else 0.0 for i in layout]
        return np.vstack([turned(np.tile(vectors, (4, 1)), HINGES, angles), last])

    def places(tilts):
        arms = np.vstack([0.2 * ARMS, np.zeros(3)])
        return arms + around((0.0, 0.0, 0.05), LAST.place, tilts)

    return Case(
        rotor_code_of((*layout, -1)),
        rotors_of(SMALL, rotors),
        lambda tilts: around(AXIS, LAST.axis, tilts),
        places,
        max(layout) + 1,
        HINGES[[0, 1, 3]] if hinged else HINGES[:0],
        np.array([rotor.thrust for rotor in rotors]),
        np.array([rotor.drag for rotor in rotors]),
    )


CASES = {
    "upright cross": on_cross("upright cross"),
    "tilting cross": on_cross("tilting cross"),
    "any upright": any_rotors(False),
    "any tilting": any_rotors(True),
}
each_case = pytest.mark.parametrize("case", CASES.values(), ids=CASES)


@each_case
def test_heights_lift_and_torque_match_numpy(case):
    rng = np.random.default_rng(0)
    code, vehicle, rotors = case.code, case.vehicle, len(case.thrusts)
    spins = np.array([*SPIN, LAST.spin])[:rotors]
    for _ in range(5):
        tilts, up = rng.uniform(-2.0, 2.0, case.tilts), rng.normal(size=3)
        controls, gains = rng.uniform(1e4, 2e5, rotors), rng.uniform(0.0, 0.2, rotors)
        axes, places, given = case.axes(tilts), case.places(tilts), tuple(tilts)
        np.testing.assert_allclose(code.heights(given, tuple(up), vehicle), places @ up, atol=1e-15)
        before = rng.normal(size=3)
        pushes = (case.thrusts * controls * gains)[:, np.newaxis] * axes
        found = code.lift(tuple(before), given, tuple(controls), tuple(gains), vehicle)
        expected = np.r_[before + pushes.sum(axis=0), np.cross(places, pushes).sum(axis=0)]
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-14)
        pushes = (case.thrusts * controls)[:, np.newaxis] * axes
        drag = -(spins * case.drags * controls)[:, np.newaxis] * axes
        expected = (np.cross(places, pushes) + drag).sum(axis=0)
        found = code.torque(given, tuple(controls), vehicle)
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-13)


@each_case
def test_angular_momentum_of_pods_and_body(case):
    code, vehicle = case.code, case.vehicle
    rng = np.random.default_rng(1)
    inertias, rates = np.full(case.tilts, 2e-5), rng.normal(size=case.tilts)
    found = code.pods(tuple(inertias), tuple(rates), vehicle)
    np.testing.assert_allclose(found, inertias * rates @ case.hinges, atol=1e-18)
    omega = tuple(rng.normal(size=3))
    moments = CROSS.moments if vehicle is CROSS else 0.012  # of `SMALL`
    np.testing.assert_allclose(
        code.inertia(omega, vehicle), np.multiply(moments, omega), rtol=1e-12
    )
    back = code.inverse(code.inertia(omega, vehicle), vehicle)
    np.testing.assert_allclose(back, omega, rtol=1e-12)
