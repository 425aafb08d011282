"""Places, lift, torque and inertia of vehicles: the cross of the thesis, and any rotors."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest

from tests.controllers.multirotors import SMALL
from tiltsim_controllers.code.arrays import as_arrays
from tiltsim_controllers.vehicle.body import inertia_matrix, inverse_inertia_matrix
from tiltsim_controllers.vehicle.craft import craft_of, craft_parameters, places, wrench_of_lift
from tiltsim_controllers.vehicle.parameters import PRESETS, SPIN
from tiltsim_controllers.vehicle.rotors import Rotor, wrench_map

CROSS = PRESETS["ar_drone_2"]
ARMS = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
HINGES = ARMS[[0, 1, 0, 3]]
"""Hinge axes of the first four of five rotors; the first and the third share a hinge."""
AXIS = (0.48, 0.64, 0.6)
"""Thrust axis of these at zero tilt, inclined along and across their hinges."""
LAST = Rotor((0.1, 0.1, 0.3), (0.6, 0.0, 0.8), 9e-6, 3e-7, -1.0)


class Case(NamedTuple):
    """A vehicle, and its numbers by another way."""

    craft: Any
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
            craft_of(CROSS, (-1,) * 4),
            lambda tilts: upright,
            lambda tilts: arms,
            0,
            ARMS[:0],
            *coefficients,
        )
    axes = lambda tilts: turned(upright, ARMS, tilts)  # noqa: E731
    craft = craft_of(CROSS, (0, 1, 2, 3))
    return Case(craft, axes, lambda tilts: arms, 4, ARMS, *coefficients)


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
        craft_of(as_arrays(craft_parameters(SMALL, rotors)), (*layout, -1)),
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
def test_places_lift_and_torque_match_sums_over_the_rotors(case):
    rng = np.random.default_rng(0)
    craft, rotors = case.craft, len(case.thrusts)
    spins = np.array([*SPIN, LAST.spin])[:rotors]
    for _ in range(5):
        tilts = rng.uniform(-2.0, 2.0, case.tilts)
        controls, gains = rng.uniform(1e4, 2e5, rotors), rng.uniform(0.0, 0.2, rotors)
        axes, at = case.axes(tilts), case.places(tilts)
        np.testing.assert_allclose(places(craft, tilts).T, at, atol=1e-15)
        pushes = (case.thrusts * controls * gains)[:, np.newaxis] * axes
        found = wrench_of_lift(craft, tilts, craft.thrusts * controls * gains)
        expected = np.r_[pushes.sum(axis=0), np.cross(at, pushes).sum(axis=0)]
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-14)
        pushes = (case.thrusts * controls)[:, np.newaxis] * axes
        drag = -(spins * case.drags * controls)[:, np.newaxis] * axes
        expected = np.r_[pushes.sum(axis=0), (np.cross(at, pushes) + drag).sum(axis=0)]
        found = wrench_map(craft.rotors, tilts) @ (spins * controls)
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-13)


@each_case
def test_hinges_and_inertia(case):
    craft, omega = case.craft, np.array([0.3, -0.2, 0.5])
    np.testing.assert_allclose(craft.hinges, case.hinges, atol=1e-18)
    moments = CROSS.moments if len(case.thrusts) == 4 else 0.012  # of `SMALL`
    momentum = inertia_matrix(craft.body) @ omega
    np.testing.assert_allclose(momentum, np.multiply(moments, omega), rtol=1e-12)
    np.testing.assert_allclose(inverse_inertia_matrix(craft.body) @ momentum, omega, rtol=1e-12)


@each_case
def test_torque_about_the_hinges_of_thrust_and_drag(case):
    """By virtual work: of the thrust on a rotor's place, of the drag torque on its axis."""
    craft, step = case.craft, 1e-5
    spins = np.array([*SPIN, LAST.spin])[: len(case.thrusts)]
    for tilts in np.random.default_rng(3).uniform(-2.0, 2.0, (3, case.tilts)):
        axes, layout = case.axes(tilts), craft.rotors.tilt_of_rotor
        for rotor, tilt in enumerate(layout):
            if tilt < 0:
                continue
            one = step * np.eye(case.tilts)[tilt]
            moved = (case.places(tilts + one) - case.places(tilts - one))[rotor] / (2.0 * step)
            drag = -spins[rotor] * case.drags[rotor] * axes[rotor] @ case.hinges[tilt]
            expected = case.thrusts[rotor] * axes[rotor] @ moved + drag
            assert craft.hinge_loads[rotor] == pytest.approx(expected, rel=1e-6, abs=1e-15)
