"""The motion of any multirotor as a rigid body with massless pods.

The first eighteen numbers of a state are the rigid body's (`RigidState`); the rotor speeds, signed,
follow.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final, NamedTuple

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.code.traceable import traceable
from tiltsim_controllers.mathematics.linear import cross
from tiltsim_controllers.vehicle.body import Body, angular_acceleration
from tiltsim_controllers.vehicle.rotors import Rotors, wrench_map

BODY_STATES: Final = 18
"""Numbers of a state before the rotor speeds."""


class RigidState(NamedTuple):
    """The motion of a rigid body, in the order of a state's first `BODY_STATES` numbers."""

    position: Any  # m, world axes, shape (3,)
    velocity: Any  # m/s, world axes, shape (3,)
    rotation: Any  # body to world, shape (3, 3)
    omega: Any  # body rates, rad/s, shape (3,)


def rigid_state(state: Any) -> RigidState:
    """The parts of a state, shape (`BODY_STATES` + any, )."""
    return RigidState(state[:3], state[3:6], state[6:15].reshape(3, 3), state[15:BODY_STATES])


def joined(parts: Iterable[Any]) -> Any:
    """Parts of a state, arrays of any shape, as one vector."""
    return xp.hstack([part.ravel() for part in parts])


def rotation_rate(rotation: Any, omega: Any) -> Any:
    """``R' = R omega^`` (ch. 3, Eq. 7), 1/s, shape (3, 3), at body rates (rad/s)."""
    return xp.array([cross(row, omega) for row in rotation])


def accelerations(
    body: Body, rotation: Any, omega: Any, wrench: Any, disturbance: Any, gyroscopic: float
) -> tuple[Any, Any]:
    """Acceleration (m/s^2, world axes) and angular acceleration (rad/s^2, body axes).

    Args:
        body: The body.
        rotation: Body to world, shape (3, 3).
        omega: Body rates, rad/s, shape (3,).
        wrench: Force (N) and torque (N m) without weight, body axes, shape (6,).
        disturbance: A further acceleration, m/s^2, world axes, shape (3,).
        gyroscopic: Factor of the gyroscopic torque, 1 or 0.
    """
    weight = xp.array([0.0, 0.0, body.gravity])
    acceleration = rotation @ wrench[:3] / body.mass - weight + disturbance
    return acceleration, angular_acceleration(body, wrench[3:], omega, gyroscopic)


@traceable
def equations_of_motion(
    state: Any,
    tilts: Any,
    inputs: Any,
    body: Body,
    rotors: Rotors,
    disturbance: Any,
    gyroscopic: float,
) -> Any:
    """Derivative of a state of a vehicle with massless pods (ch. 3, Eqs. 1-7), (18 + N,).

    Args:
        state: `BODY_STATES` numbers and N rotor speeds, rad/s, shape (18 + N + any,).
        tilts: rad, shape (M,).
        inputs: Rotor accelerations, rad/s^2, shape (N + any,).
        body: Body of the vehicle.
        rotors: Its N rotors.
        disturbance: An acceleration unknown to the controller, m/s^2, world axes, shape (3,).
        gyroscopic: Factor of the gyroscopic torque, 1 or 0.
    """
    count = len(rotors.tilt_of_rotor)
    motion, speeds = rigid_state(state), state[BODY_STATES : BODY_STATES + count]
    wrench = wrench_map(rotors, tilts) @ (speeds * abs(speeds))
    _, velocity, rotation, omega = motion
    moved = accelerations(body, rotation, omega, wrench, disturbance, gyroscopic)
    rates = RigidState(velocity, moved[0], rotation_rate(rotation, omega), moved[1])
    return joined((*rates, inputs[:count]))
