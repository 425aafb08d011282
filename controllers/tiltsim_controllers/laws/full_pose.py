"""Full-pose control of rotorcraft: the tilt angles are inputs (ch. 3, Sec. 6.3).

With the tilt angles as inputs a vehicle has more inputs than degrees of freedom. Position and
attitude are tracked by third-order error dynamics. The inputs are the rates of the tilt angles and
of ``w_i = varpi_i |varpi_i|``. Among the inputs that give the desired third derivatives the
controller takes the shortest; the norm weights a tilt rate relative to a rate of ``w``. The
published controller takes (rad/s)^2/s and rad/s as they are. One rad/s then changes the force by
the same amount as 1e5 (rad/s)^2/s, so that tilting does nearly all the work, even for the vertical
force: a pod at a small angle hardly changes it, and its rate grows like 1/sin(alpha) down to angles
of 1e-5 rad, faster than any step can follow. `force_balanced_tilt_weight` weights both by the force
they move.

The thesis shows the flights but neither the control law nor its gains; both come from its author's
public model of the tiltrotor. The gyroscopic torque is omitted, as in ch. 3. A rotor that
is known to have failed is left out of the matrix, with the part of its tilt that moves it.
"""

from collections.abc import Sequence
from math import pi
from typing import Annotated, Any, ClassVar, Final, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from tiltsim_controllers.code.arrays import traceable, xp
from tiltsim_controllers.laws.feedback import body_rate_matrix, error_dynamics
from tiltsim_controllers.laws.keys import (
    GainSets,
    Keys,
    NamedGains,
    Positive,
    Vector3,
    default,
    record_of,
    required,
)
from tiltsim_controllers.laws.observed import Failure, Seen, Step, working
from tiltsim_controllers.mathematics.attitude import attitude_error, rotation_matrix
from tiltsim_controllers.mathematics.linear import cross, least_norm
from tiltsim_controllers.mathematics.moving import Moving
from tiltsim_controllers.references.trajectories import (
    POSES,
    ReferenceParameters,
    reference_attitude,
    reference_motion,
)
from tiltsim_controllers.vehicle.body import Body, angular_acceleration, inertia_matrix, state_of
from tiltsim_controllers.vehicle.rotors import (
    Rotors,
    TiltOfRotor,
    airframe,
    by_tilt,
    rotor_accelerations,
    rotors_in,
    tilt_of_rotor,
    wrench_map,
    wrench_slope,
)


class FullPoseGainTable(Keys):
    """Explicit gains of full-pose control."""

    position: Vector3 = required(
        "on the errors of acceleration, velocity and position [1/s, 1/s^2, 1/s^3]",
        [750.0, 1875.0, 1562.0],
    )
    attitude: Vector3 = required(
        "on the errors of angular acceleration, body rates and attitude [1/s, 1/s^2, 1/s^3]",
        [750.0, 1500.0, 2577.0],
    )


Gains = record_of(FullPoseGainTable)

GAIN_SETS: Final = {
    # the author's public model, HansOersted/tiltrotor_simulator
    "ch03": Gains((750.0, 1875.0, 1562.0), (750.0, 1500.0, 2577.0))
}
"""Gains by name."""


class FullPose(Keys):
    """Keys of `full_pose`."""

    gain_sets: ClassVar[GainSets] = {"gains": GAIN_SETS}

    law: Literal["full_pose"] = required(
        "position and attitude independently: the law commands the tilt angles as well, of the "
        "tiltrotor or of a multirotor whose rotors and tilts move six outputs"
    )
    gains: NamedGains[Literal["ch03"], FullPoseGainTable] = default(
        "ch03", "a set by name, or a table of gains; ch03 is the thesis's author's"
    )
    tilt_weight: Literal["even", "published"] = default(
        "even",
        "how tilt rates count against rotor accelerations in the least-norm solution: even by the "
        "force that they change, published by number, which turns the rotors fast",
    )
    max_tilt_rate: Positive | None = default(
        None, "limit enforced by the law; default: none [rad/s]", 5.0
    )
    max_tilt_angle: Annotated[float, Field(gt=0.0, le=pi)] | None = default(
        None, "limit enforced by the law; default: none [rad]", 1.0
    )


Parameters = record_of(
    FullPose,
    vehicle=Body,  # of the tiltrotor a `tiltsim_controllers.vehicle.parameters.Vehicle`
    reference=ReferenceParameters,
    tilt_weight=float,  # (rad/s)^2/rad: the norm of (w', tilt_weight alpha')
    failure=Failure,
    rotors=float,  # where in the knots the table of the rotors begins
)
"""Parameters of the law: its keys and these."""

PUBLISHED_TILT_WEIGHT: Final = 1.0
"""Rates of ``w`` and of the tilt angles have the same weight, number for number."""


def force_balanced_tilt_weight(vehicle: Any) -> float:
    """The weight with which thrust and tilt rates count by the force they move in hover.

    The vehicle has a ``hover_rotor_speed``, rad/s.
    """
    return vehicle.hover_rotor_speed**2


def input_matrix(rotors: Rotors, tilts: Any, w: Any, weight: Any = 1.0) -> Any:
    """Rates of torque (N m/s) and force (N/s) per rate of the inputs, shape (6, N + M), body axes.

    Args:
        rotors: Rotors of the vehicle, N with M tilts.
        tilts: Tilt angles, rad, shape (M,).
        w: ``varpi |varpi|`` of the rotors, (rad/s)^2, shape (N,).
        weight: Unit of the tilt rates, the last M inputs, 1/rad.
    """
    turned = by_tilt(rotors, wrench_slope(rotors, tilts) * (w / weight))
    rows = xp.hstack([wrench_map(rotors, tilts), turned])
    return xp.vstack([rows[3:], rows[:3]])


def limited_tilt_rate(rates: Any, angles: Any, p: Any) -> Any:
    """Tilt rates (rad/s) within their limit, zero where they take an angle (rad) past its limit."""
    at_stop = (abs(angles) >= p.max_tilt_angle) & (rates * angles > 0.0)
    return xp.where(at_stop, 0.0, xp.clip(rates, -p.max_tilt_rate, p.max_tilt_rate))


def turning_rates(target: Any, turn: Any, omega: Any, omega_rate: Any) -> Moving:
    """Rates of a desired attitude in the turning axes of the body: rad and s, shape (3,).

    Args:
        target: Roll, pitch and yaw with three derivatives, rad and s, shape (4, 3).
        turn: Matrix from the desired axes to the body axes, shape (3, 3).
        omega, omega_rate: Body rates (rad/s) and their rates (rad/s^2), shape (3,) each.
    """
    roll, pitch = (Moving(*target[:3, axis]) for axis in (0, 1))
    rates = body_rate_matrix(roll, pitch) @ Moving(*target[1:])
    value, first, second = turn @ rates.value, turn @ rates.rate, turn @ rates.acceleration
    rate = first - cross(omega, value)
    change = turn @ cross(rates.value, rates.rate) - cross(omega, first)  # of the turn
    return Moving(value, rate, second + change - cross(omega_rate, value) - cross(omega, rate))


@traceable
def full_pose(seen: Seen, p: Any, knots: Any, tilt_of_rotor: TiltOfRotor) -> Step:
    """The N rotor accelerations (rad/s^2) and the M tilt rates (rad/s).

    NaN where the six outputs depend on each other, and for a rotor at rest, whose acceleration does
    not change its thrust.

    Args:
        seen: Its states are the commanded tilt angles, rad, shape (M,), if their limit also counts:
            they are beyond the angle of a pod that its servo's stop holds.
        p: `Parameters`.
        knots: Table data of the flight, with the table of the rotors.
        tilt_of_rotor: The layout.
    """
    time, count = seen.time, len(tilt_of_rotor)
    now, (body, rotors) = state_of(seen.state, tilt_of_rotor), airframe(p, knots, tilt_of_rotor)
    works = working(time, p.failure, count)  # 0 for a failed rotor
    rotors, w = rotors.masked(works), works * now.speeds * abs(now.speeds)

    # Second derivatives of position and attitude by the model (ch. 3, Eqs. 1 and 4).
    wrench = wrench_map(rotors, now.tilts) @ w
    force, torque = wrench[:3], wrench[3:]
    R = rotation_matrix(now.attitude)
    acceleration = R @ force / body.mass - xp.array([0.0, 0.0, body.gravity])
    omega_rate = angular_acceleration(body, torque, now.omega, 0.0)  # without gyroscopic torque

    # Demanded third derivatives of the position, and of the attitude by its error in body axes.
    motion = reference_motion(time, p.reference, knots)  # position and its derivatives, by row
    jerk = error_dynamics(motion[:4], (now.position, now.velocity, acceleration), p.gains.position)
    target = reference_attitude(time, p.reference, knots)
    R_d, (k1, k2, k3) = rotation_matrix(target[0]), p.gains.attitude
    omega_jerk = k3 * attitude_error(R, R_d) - k2 * now.omega - k1 * omega_rate
    if p.reference.type == POSES:  # only then does the desired attitude move
        # Its body rates, with two derivatives, move the errors that the gains act on.
        ahead = turning_rates(target, R.T @ R_d, now.omega, omega_rate)
        omega_jerk = omega_jerk + ahead.acceleration + k1 * ahead.rate + k2 * ahead.value

    # Six equations, (tau w)' = I omega'' and, as the force turns with the body, (F w)' = m R^T jerk
    # - omega x F w, for N + M inputs, w' and tilt_weight alpha', of which the shortest are taken.
    force_rate = body.mass * (R.T @ jerk) - cross(now.omega, force)
    rows = input_matrix(rotors, now.tilts, w, p.tilt_weight)
    rates = least_norm(rows, xp.hstack([inertia_matrix(body) @ omega_jerk, force_rate]))

    # Neither the pods nor the commanded angles go past their limit.
    tilt_rates = rates[count:] / p.tilt_weight
    for angles in (now.tilts, seen.states):
        if len(angles):
            tilt_rates = limited_tilt_rate(tilt_rates, angles, p)
    return Step(rotor_accelerations(rates[:count], now.speeds), tilt_rates)


def pose_rank(table: Sequence[float], tilts: ArrayLike, w: ArrayLike) -> int:
    """How many of the six outputs the inputs move independently, at tilts (rad, shape (M,)).

    The ``w`` are ``varpi |varpi|``, of any unit, 0 for a rotor that is not used, shape (N,).
    """
    squares = np.asarray(w, float)
    rotors = rotors_in(table, 0, tilt_of_rotor(table)).masked(squares != 0.0)
    rows = input_matrix(rotors, np.asarray(tilts, float), squares)
    sizes = np.abs(rows[:3]).max(), np.abs(rows[3:]).max()
    return int(np.linalg.matrix_rank(rows / np.repeat(sizes, 3)[:, np.newaxis], 1e-8))
