"""Restarting a plant from a saved state."""

from __future__ import annotations

import numpy as np

from tiltsim.laws.assembling import assemble
from tiltsim.simulation.simulate import make_plant


def assert_restarts(scenario, saved_at, steps):
    """Another plant, restored from a saved state, continues like the first bit for bit.

    Args:
        scenario: Scenario to fly.
        saved_at: Steps before the state is saved.
        steps: Steps after that.
    """
    straight = make_plant(assemble(scenario))
    straight.advance(saved_at)
    saved, seen = straight.state, straight.observe()
    straight.advance(steps)
    restarted = make_plant(assemble(scenario))
    restarted.advance(saved_at // 4)
    restarted.state = saved
    assert restarted.observe() == seen
    restarted.advance(steps)
    np.testing.assert_array_equal(restarted.state, straight.state)
    assert restarted.observe() == straight.observe()
