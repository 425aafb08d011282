"""Steps of the laws that demand a wrench or thrusts: `geometric`, `pid`, `indi` and `lqr`.

Position control demands an acceleration, and an attitude makes it. With planned tilts the rotors
make any torque and a force along one axis of the body (least norm). With tilts that the law
commands, every rotor's thrust ``T`` enters through ``T cos(alpha)`` and ``T sin(alpha)``, in which
force and torque are linear with constant coefficients: static allocation (Kamel et al. 2018, "The
Voliro omniorientational hexacopter", Eqs. 10 to 13). With fewer components than outputs, as of two
tilting rotors, they make any torque and a force along one axis again.
"""

from typing import Any, Final

import numpy as np

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.laws.feedback import exact_decoupler
from tiltsim_controllers.laws.observed import Observed
from tiltsim_controllers.mathematics.attitude import rotation_matrix
from tiltsim_controllers.mathematics.linear import (
    cross,
    nearest_solution,
    norm,
    orthonormal_rows,
    rejection,
)
from tiltsim_controllers.vehicle.rotors import Rotors

UP: Final = (0.0, 0.0, 1.0)


def shortened(vector: Any, limit: Any) -> Any:
    """A vector of the same direction, shape (3,), no longer than a limit."""
    square = vector @ vector
    is_long = square > limit * limit
    return xp.where(is_long, limit / xp.sqrt(xp.where(is_long, square, 1.0)), 1.0) * vector


def tracking_errors(observed: Observed) -> tuple[Any, Any]:
    """Reference minus actual position (m) and velocity (m/s), world axes, shape (3,) each."""
    reference = observed.reference
    return reference.position - observed.position, reference.velocity - observed.velocity


def demanded_acceleration(
    observed: Observed, position_gain: Any, velocity_gain: Any, limit: Any
) -> Any:
    """The reference's acceleration plus feedback of position and velocity, m/s^2, world, (3,).

    Args:
        observed: By the law.
        position_gain, velocity_gain: 1/s^2 and 1/s.
        limit: Largest length of the feedback, m/s^2.
    """
    error, speed = tracking_errors(observed)
    feedback = shortened(position_gain * error + velocity_gain * speed, limit)
    return feedback + observed.reference.acceleration


def pointing_attitude(observed: Observed, acceleration: Any, axis: Any) -> Any:
    """The rotation, shape (3, 3), that points a body axis (3,) along the force for an acceleration.

    The acceleration is in m/s^2, world axes, shape (3,); the yaw comes from the reference.
    """
    (ax, ay, az), yaw = acceleration, observed.reference.attitude[2]
    roll, pitch = exact_decoupler(ax, ay, az, yaw, observed.vehicle.gravity, axis)
    return rotation_matrix(xp.array([roll, pitch, yaw]))


def pointing_rates(observed: Observed, acceleration: Any, axis: Any, attitude: Any) -> Any:
    """Rates (rad/s, the present body axes) of `pointing_attitude` as the reference accelerates.

    The force turns with the reference's jerk, and the yaw stays. The jerk of the feedback is left
    out.

    Args:
        observed: By the law.
        acceleration: Demanded, m/s^2, world axes, shape (3,).
        axis: Axis of the force, body axes, shape (3,).
        attitude: `pointing_attitude`, shape (3, 3).
    """
    force = acceleration + observed.vehicle.gravity * xp.array(UP)
    turning = cross(force, observed.reference.jerk) / (force @ force)
    # Turning about the force as well keeps the yaw: no rate about the axis across pitch and roll.
    direction, nose, cos_pitch = attitude @ axis, attitude[:, 0], norm(attitude[:2, 0])
    across = (xp.array(UP) - nose[2] * nose) / cos_pitch
    turning = turning - (turning @ across) / (direction @ across) * direction
    return observed.rotation.T @ turning


def push_along(observed: Observed, acceleration: Any, axis: Any) -> Any:
    """The component (N) along a body axis of the force for an acceleration (m/s^2, world)."""
    body = observed.vehicle
    force = observed.rotation.T @ (acceleration + body.gravity * xp.array(UP))
    return body.mass * (force @ axis) / norm(axis)


def torque_for(observed: Observed, angular: Any) -> Any:
    """The torque (N m) of an angular acceleration (rad/s^2), body axes, shape (3,) each."""
    momentum = observed.inertia @ observed.body_rates
    return observed.inertia @ angular + observed.gyroscopic * cross(observed.body_rates, momentum)


def lift_without_torque(observed: Observed) -> Any:
    """The shortest thrusts without torque whose force has 1 N along body z, shape (N,).

    Their force ``observed.force @ lift`` is the axis along which the vehicle pushes.
    """
    up = free = observed.force[2]
    for unit in orthonormal_rows(observed.torque):
        free = rejection(free, unit)
    return free / (up @ free)


def allocated_thrusts(observed: Observed, lift: Any, push: Any, torque: Any) -> Any:
    """Thrusts (N) with a torque and a push, shape (N,); NaN where not every torque is possible.

    Args:
        observed: By the law.
        lift: `lift_without_torque`, shape (N,).
        push: Component of the force along its axis, N.
        torque: N m, body axes, shape (3,).
    """
    axis = observed.force @ lift
    turning = nearest_solution(observed.torque, torque, xp.zeros(len(lift)))
    side = axis @ (observed.force @ turning)
    return turning + (push * norm(axis) - side) / (axis @ axis) * lift


def in_components(observed: Observed) -> Observed:
    """The vehicle with the components ``T cos(alpha), T sin(alpha)`` as its 2 N thrusts."""
    rotors = observed.rotors
    along = rotors.cosine
    if -1 in rotors.tilt_of_rotor:  # a fixed rotor has the first component alone
        along = along + np.array([float(i < 0) for i in rotors.tilt_of_rotor]) * rotors.constant
    wrench = xp.hstack([along, rotors.sine])
    return observed._replace(force=wrench[:3], torque=wrench[3:])


def of_components(rotors: Rotors, components: Any) -> tuple[Any, Any]:
    """Thrusts (N), shape (N,), and tilts (rad), shape (M,), of rotors with one on each tilt.

    Components are ``T cos(alpha)`` of all rotors, then ``T sin(alpha)``, N, shape (2 N,).
    """
    along, across = components.reshape(2, -1)
    # Returned in the order of the tilts, which may differ from the order of the rotors.
    angles = xp.arctan2(across, along)
    layout = rotors.tilt_of_rotor
    of_tilt = [layout.index(tilt) for tilt in range(max(layout) + 1)]
    return xp.hypot(along, across), xp.array([angles[rotor] for rotor in of_tilt])


def allocated_with_tilts(observed: Observed, force: Any, torque: Any) -> tuple[Any, Any]:
    """Thrusts (N), shape (N,), and tilts (rad), shape (M,), for rotors with a tilt each.

    The shortest ``T cos(alpha), T sin(alpha)`` of all rotors for a force (N) and a torque (N m) in
    body axes, shape (3,) each; NaN where there are none.
    """
    known, wrench = in_components(observed), xp.hstack([force, torque])
    rows = xp.vstack([known.force, known.torque])
    components = nearest_solution(rows, wrench, xp.zeros(rows.shape[1]))
    return of_components(observed.rotors, components)
