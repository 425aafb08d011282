"""The multirotor's law, compiled, gives the same bits as in Python."""

from __future__ import annotations

import numpy as np
import pytest
from numba.np.unsafe.ndarray import to_fixed_tuple

from tests.controllers.multirotors import HEXAROTOR, Vehicle, parameters_of, ring
from tests.controllers.scalar_sources import as_native
from tiltsim.engines.compiling import compiled, register_scalar_functions
from tiltsim_controllers.gaits import plans
from tiltsim_controllers.laws.multirotor import multirotor_law_of
from tiltsim_controllers.laws.multirotor_steps import Form
from tiltsim_controllers.references.trajectories import CIRCLE, ReferenceParameters
from tiltsim_controllers.vehicle.effectiveness import tilt_of_rotor, tilts_of

CASES = {
    "fixed rotors, leaning": (Vehicle(ring(6), HEXAROTOR, 1), plans.fixed(())),
    "tilting arms, by force": (
        Vehicle(ring(7, hinged=True), HEXAROTOR, 3, "thrust"),
        plans.waypoints([[0.2, -0.1, 0.3, 0.1, 0.0, -0.2, 0.1], [0.1] * 7], 2.0, tilts=7),
    ),
    "tilting arms, by both": (
        Vehicle(ring(5, hinged=True), HEXAROTOR, 2),
        plans.table([0.0, 1.0, 3.0], np.outer((0.1, 0.3, 0.1), range(5)).tolist(), repeats=True),
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_the_law_gives_the_same_bits_natively(case):
    vehicle, gait = CASES[case]
    reference = ReferenceParameters(CIRCLE, radius=1.0, angular_frequency=0.5)
    law, knots = parameters_of(vehicle, gait, reference, restoring=0.5, slowest=10.0)
    layout = tilt_of_rotor(vehicle.table)
    inputs = multirotor_law_of(layout, Form(vehicle.dimension, vehicle.norm))
    tilts, size = tilts_of(layout), 12 + tilts_of(layout) + len(layout)
    register_scalar_functions()

    @compiled
    def natively(time, state, rates, law, knots):
        fixed = to_fixed_tuple(state, size), to_fixed_tuple(rates, tilts)
        return np.array(inputs(time, fixed[0], fixed[1], (0.1, -0.2, 0.3), law, knots))

    rng = np.random.default_rng(3)
    for time in rng.uniform(0.0, 5.0, 20):
        body, angles = 0.3 * rng.normal(size=12), rng.uniform(-0.5, 0.5, tilts)
        speeds = rng.uniform(200.0, 500.0, len(layout)) * rng.choice((-1.0, 1.0), len(layout))
        state, rates = np.array((*body, *angles, *speeds)), rng.normal(size=tilts)
        expected = inputs(
            time, tuple(state.tolist()), tuple(rates.tolist()), (0.1, -0.2, 0.3), law, knots
        )
        assert np.isfinite(expected).all()
        found = natively(time, state, rates, as_native(law), np.array(knots))
        assert found.tolist() == list(expected)
