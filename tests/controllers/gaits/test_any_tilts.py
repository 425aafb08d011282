"""Gaits of any number of tilts: each tilt moves as one of four does."""

from __future__ import annotations

import numpy as np
import pytest

from tiltsim_controllers.gaits import plans
from tiltsim_controllers.gaits.motion import anticipated_tilts, planned_tilts

TIMES = np.linspace(-0.5, 4.5, 41)
ANGLES = np.random.default_rng(2).uniform(-0.5, 0.5, (3, 6))


def closed(angles):
    return [*angles, angles[0]]


GAITS = {
    "fixed": lambda angles: plans.fixed(angles[0]),
    "waypoints": lambda angles: plans.waypoints(
        angles, 2.0, [0.0, 0.3, 0.7], tilts=len(angles[0])
    ),
    "table": lambda angles: plans.table(
        [0.0, 0.5, 1.2, 2.0], closed(angles), repeats=True
    ),
    "table once": lambda angles: plans.table(
        [0.0, 0.5, 1.2, 2.0], closed(angles), repeats=False
    ),
}  # fmt: skip


def motion(gait, half):
    """Jets of the planned and of the anticipated angles, shape (2, times, tilts, 3)."""
    own = gait.parameters, gait.knots, gait.tilts
    planned = [planned_tilts(t, *own) for t in TIMES.tolist()]
    rounded = [anticipated_tilts(t, *own, half) for t in TIMES.tolist()]
    return np.array((planned, rounded))


@pytest.mark.parametrize("kind", GAITS)
def test_six_tilts_move_as_the_first_and_the_last_four_of_them(kind):
    six = GAITS[kind](ANGLES.tolist()).scaled(2.0)
    first, last = (
        GAITS[kind](ANGLES[:, part].tolist()).scaled(2.0) for part in (np.s_[:4], np.s_[2:])
    )
    whole = motion(six, 0.05)
    assert np.array_equal(whole[:, :, :4], motion(first, 0.05))
    assert np.array_equal(whole[:, :, 2:], motion(last, 0.05))
    for what in ("period", "is_continuous", "is_constant", "min_segment_time"):
        assert getattr(six, what) == getattr(first, what)
    for what in ("amplitude", "max_rate"):
        assert getattr(six, what) == max(getattr(first, what), getattr(last, what))
    assert six.angles(TIMES).shape == six.rates(TIMES).shape == (len(TIMES), 6)


def test_a_vehicle_without_pods_has_a_gait_without_tilts():
    gait = plans.fixed(())
    assert gait.tilts == 0
    assert gait.angles(0.0).shape == (0,)


def test_waypoints_have_one_angle_per_tilt():
    with pytest.raises(ValueError, match="needs a phase and 6 finite tilt angles"):
        plans.waypoints([(0.1,) * 5], 1.0, tilts=6)
