"""Flights of the rigid body under the scalar laws, in plain floats with RK4."""

from __future__ import annotations

from math import cos, isfinite, pi, sin

import numpy as np

from tiltsim_controllers.mathematics.attitude import rotation_matrix
from tiltsim_controllers.vehicle.cross import cross_force, cross_torque
from tiltsim_controllers.vehicle.parameters import drag_ratio


def quadrotor_rates(state, inputs, vehicle):
    """Newton and Euler in z-up axes for thrust and torques; the law's own two states integrate."""
    _, _, _, vx, vy, vz, roll, pitch, yaw, p, q, r, _, _ = state
    thrust, roll_torque, pitch_torque, yaw_torque, zeta_rate, xi_rate = inputs
    ix, iy, iz = vehicle.inertia_xx, vehicle.inertia_yy, vehicle.inertia_zz
    sr, cr, sp, cp, sy, cy = sin(roll), cos(roll), sin(pitch), cos(pitch), sin(yaw), cos(yaw)
    lift = thrust / vehicle.mass
    turn = (sr * q + cr * r) / cp
    return (
        *(vx, vy, vz),
        lift * (cr * sp * cy + sr * sy),
        lift * (cr * sp * sy - sr * cy),
        lift * cr * cp - vehicle.gravity,
        *(p + sp * turn, cr * q - sr * r, turn),
        ((iy - iz) * q * r + roll_torque) / ix,
        ((iz - ix) * p * r + pitch_torque) / iy,
        ((ix - iy) * p * q + yaw_torque) / iz,
        *(zeta_rate, xi_rate),
    )


def tiltrotor_rates(state, inputs, vehicle):
    """Ch. 3, Eqs. (1)-(7), with exact Euler rates; inputs are rotor accelerations, tilt rates."""
    _, _, _, vx, vy, vz, roll, pitch, yaw, p, q, r = state[:12]
    tilts, speeds = np.array(state[12:16]), np.array(state[16:20])
    w = speeds * abs(speeds)
    r11, r12, r13, r21, r22, r23, r31, r32, r33 = rotation_matrix((roll, pitch, yaw)).ravel()
    fx, fy, fz = vehicle.thrust_coefficient / vehicle.mass * (cross_force(tilts) @ w)
    lever = vehicle.thrust_coefficient * vehicle.arm_length
    turning = lever * (cross_torque(tilts, drag_ratio(vehicle)) @ w) / vehicle.moments
    turn = (sin(roll) * q + cos(roll) * r) / cos(pitch)
    return (
        *(vx, vy, vz),
        r11 * fx + r12 * fy + r13 * fz,
        r21 * fx + r22 * fy + r23 * fz,
        r31 * fx + r32 * fy + r33 * fz - vehicle.gravity,
        *(p + sin(pitch) * turn, cos(roll) * q - sin(roll) * r, turn),
        *turning.tolist(),
        *inputs[4:8],
        *inputs[:4],
    )


def step_further(state, step, rates):
    return tuple(value + step * rate for value, rate in zip(state, rates))


def rk4_step(rates, time, state, step):
    k1 = rates(time, state)
    k2 = rates(time + step / 2, step_further(state, step / 2, k1))
    k3 = rates(time + step / 2, step_further(state, step / 2, k2))
    k4 = rates(time + step, step_further(state, step, k3))
    return tuple(
        x + step / 6 * (a + 2 * b + 2 * c + d) for x, a, b, c, d in zip(state, k1, k2, k3, k4)
    )


def fly(law, plant, vehicle, state, duration, step):
    """Times and states until the end or until the attitude leaves +-90 degrees."""

    def rates(time, state):
        return plant(state, law(time, state), vehicle)

    times, states = [0.0], [state]
    for index in range(round(duration / step)):
        state = rk4_step(rates, index * step, state, step)
        times.append((index + 1) * step)
        states.append(state)
        lost = max(abs(state[6]), abs(state[7])) > pi / 2
        if lost or not all(isfinite(value) for value in state):
            break
    return np.array(times), np.array(states)
