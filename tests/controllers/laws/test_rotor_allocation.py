"""Allocated thrusts and tilts make the requested force and torque."""

from __future__ import annotations

import numpy as np
import pytest

from tests.controllers.multirotors import ring
from tiltsim_controllers.laws.observed import Observed
from tiltsim_controllers.laws.outer_loop import (
    allocated_thrusts,
    allocated_with_tilts,
    lift_without_torque,
)
from tiltsim_controllers.vehicle.rotors import (
    Rotors,
    force_and_torque,
    rotors_in,
    table_per_newton,
    tilt_of_rotor,
    wrench_map,
)


def observing(**known):
    """An observation of these quantities alone."""
    return Observed(*(None,) * len(Observed._fields))._replace(**known)


def per_newton(table):
    return table_per_newton(table, [8.5e-6] * len(tilt_of_rotor(table)))


@pytest.mark.parametrize("rotors", [4, 6])
def test_planned_tilts_make_any_torque_and_force_along_one_axis(rotors):
    rng = np.random.default_rng(rotors)
    table = per_newton(ring(rotors, hinged=True))
    for _ in range(20):
        force, torque = force_and_torque(table, rng.uniform(-0.6, 0.6, rotors))
        observed = observing(force=force, torque=torque)
        lift = lift_without_torque(observed)
        axis = force @ lift
        assert axis[2] == pytest.approx(1.0, rel=1e-9)
        assert torque @ lift == pytest.approx(np.zeros(3), abs=1e-9)
        demand, push = rng.normal(size=3), rng.uniform(1.0, 20.0)
        thrusts = allocated_thrusts(observed, lift, push, demand)
        assert torque @ thrusts == pytest.approx(demand, rel=1e-8, abs=1e-9)
        along = axis / np.linalg.norm(axis)
        assert along @ force @ thrusts == pytest.approx(push, rel=1e-8)


@pytest.mark.parametrize("rotors", [4, 6])
def test_independent_tilts_make_any_force_and_torque_with_the_least_thrusts(rotors):
    rng = np.random.default_rng(rotors)
    table = per_newton(ring(rotors, hinged=True))
    observed = observing(rotors=rotors_in(table, 0, tilt_of_rotor(table)))
    level, across = (
        np.vstack(force_and_torque(table, [angle] * rotors)) for angle in (0.0, np.pi / 2)
    )
    for _ in range(20):
        wrench = np.r_[rng.normal(size=3) * 5.0, rng.normal(size=3)]
        thrusts, tilts = allocated_with_tilts(observed, wrench[:3], wrench[3:])
        force, torque = force_and_torque(table, tilts)
        assert np.r_[force @ thrusts, torque @ thrusts] == pytest.approx(wrench, abs=1e-9)
        least = np.linalg.pinv(np.hstack([level, across])) @ wrench
        assert thrusts == pytest.approx(np.hypot(*least.reshape(2, rotors)), rel=1e-8)


def test_tilts_need_not_be_in_the_order_of_the_rotors():
    layout = (2, 0, 3, 1)
    parts = np.random.default_rng(1).normal(size=(2, 6, 4))
    rotors = Rotors(layout, np.ones(4), np.zeros((6, 4)), *parts)
    observed = observing(rotors=rotors)
    wrench = np.array([1.0, -2.0, 9.0, 0.1, 0.2, -0.1])
    thrusts, tilts = allocated_with_tilts(observed, wrench[:3], wrench[3:])
    assert wrench_map(rotors, tilts) @ thrusts == pytest.approx(wrench, rel=1e-8)
