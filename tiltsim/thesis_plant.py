"""The thesis' own equations of motion (ch. 3, Eqs. 1-7) with its fixed-step solver, ode3.

The gait is followed exactly, the pods have no mass, and the gyroscopic term is left out, as
published. The same law runs here and in MuJoCo: the difference between the two plants is a result.

The state is a list of `STATE_SIZE` floats: position, velocity, the rotation (rows first), body
rates, rotor speeds, and the rotor accelerations held since the last control sample.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import asin, atan2
from typing import Final

from controllers.attitude_altitude import Parameters, State, rotor_accelerations
from controllers.decoupling_matrix import body_force, sines_and_cosines, torque_entries
from controllers.gaits import GaitParameters, tilt_reference
from controllers.rotation import rotation_from_euler
from controllers.scalar import Quad, Triple, scalar
from controllers.vehicle import Vehicle, drag_ratio

STATE_SIZE: Final = 26


@scalar
def vehicle_state(
    time: float, state: Sequence[float], gait: GaitParameters, table: Sequence[float]
) -> State:
    """The law's state from the plant's: Euler angles for the rotation, the gait's tilt angles."""
    alpha_1, alpha_2, alpha_3, alpha_4, _, _, _, _ = tilt_reference(time, gait, table)
    sin_pitch = min(1.0, max(-1.0, -state[12]))  # rounding may carry the sine past one
    return (
        *(state[0], state[1], state[2], state[3], state[4], state[5]),
        *(atan2(state[13], state[14]), asin(sin_pitch), atan2(state[9], state[6])),
        *(state[15], state[16], state[17], alpha_1, alpha_2, alpha_3, alpha_4),
        *(state[18], state[19], state[20], state[21]),
    )


@scalar
def plant_state(state: State) -> list[float]:
    """The plant's state at rest of controls, from the law's; the gait gives the tilt angles."""
    return [
        *(state[0], state[1], state[2], state[3], state[4], state[5]),
        *rotation_from_euler(state[6], state[7], state[8]),
        *(state[9], state[10], state[11], state[16], state[17], state[18], state[19]),
        *(0.0, 0.0, 0.0, 0.0),
    ]


@scalar
def rotor_inputs(
    time: float, state: Sequence[float], law: Parameters, table: Sequence[float]
) -> Quad:
    """The law's rotor accelerations (rad/s^2) at a time and plant state."""
    return rotor_accelerations(time, vehicle_state(time, state, law.gait, table), law)


@scalar
def state_rates(
    time: float,
    state: Sequence[float],
    inputs: Quad,
    vehicle: Vehicle,
    gait: GaitParameters,
    table: Sequence[float],
    disturbance: Triple,
) -> tuple[float, ...]:
    """Time derivative of the plant's state under the given rotor accelerations.

    ``vehicle`` is the one that flies, and ``disturbance`` an acceleration (m/s^2, world); the law
    may know another vehicle, and does not know of the disturbance.
    """
    r11, r12, r13, r21, r22, r23 = state[6], state[7], state[8], state[9], state[10], state[11]
    r31, r32, r33, p, q, r = state[12], state[13], state[14], state[15], state[16], state[17]
    s1, s2, s3, s4 = state[18], state[19], state[20], state[21]
    u1, u2, u3, u4 = inputs
    alpha_1, alpha_2, alpha_3, alpha_4, _, _, _, _ = tilt_reference(time, gait, table)
    trig = sines_and_cosines(alpha_1, alpha_2, alpha_3, alpha_4)
    w1, w2, w3, w4 = s1 * abs(s1), s2 * abs(s2), s3 * abs(s3), s4 * abs(s4)

    # Eq. (1): force in body axes, turned to the world, weight and disturbance.
    gust_x, gust_y, gust_z = disturbance
    fx, fy, fz = body_force(trig, w1, w2, w3, w4)
    per_force = vehicle.thrust_coefficient / vehicle.mass
    ax = per_force * (r11 * fx + r12 * fy + r13 * fz) + gust_x
    ay = per_force * (r21 * fx + r22 * fy + r23 * fz) + gust_y
    az = per_force * (r31 * fx + r32 * fy + r33 * fz) - vehicle.gravity + gust_z

    # Eq. (4): torque alone, no gyroscopic term.
    x2, x4, y1, y3, z1, z2, z3, z4 = torque_entries(trig, drag_ratio(vehicle))
    per_torque = vehicle.arm_length * vehicle.thrust_coefficient
    p_rate = per_torque * (x2 * w2 + x4 * w4) / vehicle.inertia_xx
    q_rate = per_torque * (y1 * w1 + y3 * w3) / vehicle.inertia_yy
    r_rate = per_torque * (z1 * w1 + z2 * w2 + z3 * w3 + z4 * w4) / vehicle.inertia_zz

    return (
        *(state[3], state[4], state[5], ax, ay, az),
        *(r12 * r - r13 * q, r13 * p - r11 * r, r11 * q - r12 * p),  # Eq. (7): R' = R omega^
        *(r22 * r - r23 * q, r23 * p - r21 * r, r21 * q - r22 * p),
        *(r32 * r - r33 * q, r33 * p - r31 * r, r31 * q - r32 * p),
        *(p_rate, q_rate, r_rate, u1, u2, u3, u4),
        *(0.0, 0.0, 0.0, 0.0),
    )


@scalar
def stage(state: Sequence[float], step: float, rates: Sequence[float]) -> list[float]:
    """The state one explicit stage further: ``state + step * rates``."""
    return [value + step * rate for value, rate in zip(state, rates)]


@scalar
def advance(
    step_index: int,
    state: list[float],
    timestep: float,
    steps: int,
    control_steps: int,
    law: Parameters,
    vehicle: Vehicle,
    table: Sequence[float],
    disturbance: Triple,
) -> list[float]:
    """Integrate ``steps`` fixed steps with ode3, the third-order method of Bogacki and Shampine.

    ``control_steps`` is the number of steps for which the law's output is held, 0 to evaluate it
    at every stage. ``vehicle`` is the one that flies, the law knows its own. Returns the new state;
    the caller counts the steps.
    """
    for index in range(step_index, step_index + steps):
        time = index * timestep
        if control_steps > 0 and index % control_steps == 0:
            u1, u2, u3, u4 = rotor_inputs(time, state, law, table)
            state[22], state[23], state[24], state[25] = u1, u2, u3, u4
        held = (state[22], state[23], state[24], state[25])
        continuous = control_steps == 0

        inputs = rotor_inputs(time, state, law, table) if continuous else held
        k1 = state_rates(time, state, inputs, vehicle, law.gait, table, disturbance)
        half = stage(state, 0.5 * timestep, k1)
        half_time = time + 0.5 * timestep
        inputs = rotor_inputs(half_time, half, law, table) if continuous else held
        k2 = state_rates(half_time, half, inputs, vehicle, law.gait, table, disturbance)
        late = stage(state, 0.75 * timestep, k2)
        late_time = time + 0.75 * timestep
        inputs = rotor_inputs(late_time, late, law, table) if continuous else held
        k3 = state_rates(late_time, late, inputs, vehicle, law.gait, table, disturbance)
        state = [
            value + timestep * (2.0 / 9.0 * a + 1.0 / 3.0 * b + 4.0 / 9.0 * c)
            for value, a, b, c in zip(state, k1, k2, k3)
        ]
    return state
