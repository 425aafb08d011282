"""The two conventions of axes against each other."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tiltsim_controllers.mathematics.rotation import rotation_from_euler
from tiltsim_controllers.mathematics.z_down import flip_attitude, flip_state, flip_vector

OVER = np.diag([1.0, -1.0, -1.0])

numbers = st.floats(-10.0, 10.0)
states = st.tuples(*[numbers] * 14)
quick = settings(deadline=None, max_examples=60)


@quick
@given(st.tuples(*[st.floats(-1.5, 1.5)] * 3))
def test_attitude_is_that_of_world_and_body_turned_over(attitude):
    turn = np.reshape(rotation_from_euler(*attitude), (3, 3))
    other = np.reshape(rotation_from_euler(*flip_attitude(*attitude)), (3, 3))
    np.testing.assert_allclose(other, OVER @ turn @ OVER, rtol=0, atol=1e-15)


@quick
@given(states)
def test_turning_over_twice_changes_nothing(state):
    assert flip_state(flip_state(state)) == state


@quick
@given(states)
def test_vectors_turn_over_and_thrust_stays(state):
    other = flip_state(state)
    for start in (0, 3, 9):
        vector = state[start : start + 3]
        assert other[start : start + 3] == flip_vector(*vector) == tuple(OVER @ vector)
    assert other[6:9] == flip_attitude(*state[6:9])
    assert other[12:] == state[12:]


def test_up_is_up_and_nose_up_is_nose_up():
    """A climb has z < 0 and a raised nose pitch > 0 in ch. 2's axes, z > 0 and pitch < 0 here."""
    assert flip_vector(0.0, 0.0, -2.0)[2] == 2.0
    nose = np.reshape(rotation_from_euler(0.0, 0.3, 0.0), (3, 3))[:, 0]
    assert nose[2] < 0  # up, z down
    assert flip_attitude(0.0, 0.3, 0.0)[1] == -0.3
