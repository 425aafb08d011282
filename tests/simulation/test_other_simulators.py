"""Our flights in simulators by others (``pip install -e '.[crosscheck]'``)."""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec

import numpy as np
import pytest

from tests.simulation.other_simulators import FLIGHTS, fly_crazyflow, fly_rotorpy, fly_tiltsim

pytestmark = pytest.mark.slow
each_flight = pytest.mark.parametrize("name", FLIGHTS)


def needs(package):
    reason = f"{package} is not installed; it comes with the extra crosscheck"
    return pytest.mark.skipif(find_spec(package) is None, reason=reason)


@cache
def ours(name):
    positions = fly_tiltsim(name)
    assert np.linalg.norm(np.ptp(positions, axis=0)) > 1.0
    return positions


@needs("rotorpy")
@each_flight
def test_rotorpy_flies_the_same(name):
    np.testing.assert_allclose(fly_rotorpy(name), ours(name), rtol=0, atol=1e-9)


@needs("crazyflow")
@each_flight
def test_crazyflow_flies_the_same_up_to_the_second_order_of_its_step(name, tmp_path):
    """Its RK4 turns the attitude by the mean body rate of a step, which is of second order."""
    coarse, fine = (
        np.abs(fly_crazyflow(name, frequency, tmp_path) - ours(name)).max()
        for frequency in (500, 1000)
    )
    assert fine < 1e-6
    # In addition to the second order: terms of higher orders and our own 1e-11 m.
    assert coarse / fine == pytest.approx(4.0, rel=0.1)
