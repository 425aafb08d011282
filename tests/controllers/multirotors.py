"""Multirotors as tables of rotors, and their flights in plain floats with RK4."""

from __future__ import annotations

from math import cos, inf, pi, sin, sqrt
from typing import NamedTuple

import numpy as np

from tests.controllers.flat_laws import flat
from tests.natively import compiled, machine_code
from tiltsim_controllers.code.program import trace_vectors
from tiltsim_controllers.gaits import plans
from tiltsim_controllers.laws.allocation import RotorRange
from tiltsim_controllers.laws.attitude_altitude import EXACT_DECOUPLING
from tiltsim_controllers.laws.feedback import EXACT
from tiltsim_controllers.laws.gains import GAIN_SETS, IntegralGains
from tiltsim_controllers.laws.gait_feedforward import multirotor_law_of
from tiltsim_controllers.laws.multirotor_keys import ROTATION, FeedforwardTerms, Form, Parameters
from tiltsim_controllers.laws.observed import Failure
from tiltsim_controllers.laws.supervised_vehicles import Watched
from tiltsim_controllers.laws.supervisor import Supervisor
from tiltsim_controllers.mathematics.attitude import euler_of_rotation
from tiltsim_controllers.references.trajectories import SETPOINT, ReferenceParameters
from tiltsim_controllers.vehicle.body import body_of
from tiltsim_controllers.vehicle.craft import equations_of_motion
from tiltsim_controllers.vehicle.parameters import PRESETS, SPIN
from tiltsim_controllers.vehicle.rotors import (
    force_and_torque,
    rotor_entries,
    rotors_in,
    tilt_of_rotor,
    tilts_of,
)

FOUR = PRESETS["ar_drone_2"]
HEXAROTOR = body_of(1.53, np.diag((0.0348, 0.0459, 0.08)), 9.81)
SMALL = body_of(1.0, 0.012 * np.eye(3), 9.81)


def ring(rotors, cant=0.0, *, hinged=False, along=None):
    """Rotors on evenly spaced arms, canted to either side about them, or about one direction."""
    table = []
    for i in range(rotors):
        out = np.array((cos(2.0 * pi * i / rotors), sin(2.0 * pi * i / rotors), 0.0))
        about, turn = out if along is None else np.array(along, float), cant * (-1.0) ** i
        axis = np.array((0.0, 0.0, cos(turn))) + np.cross(about, (0.0, 0.0, sin(turn)))
        hinge = {"tilt": i, "hinge": 0.215 * out, "hinge_axis": out} if hinged else {}
        table += rotor_entries(0.215 * out, axis, 8.5e-6, 1.4e-7, (-1.0) ** (i + 1), **hinge)
    return tuple(table)


def octorotor():
    """Rotors on the corners of a cube that push evenly in every direction (Brescianini 2016)."""
    a, b, c = 0.5 + 1.0 / sqrt(12.0), 0.5 - 1.0 / sqrt(12.0), 1.0 / sqrt(3.0)
    axes = np.array(
        [[-a, b, -b, a, a, -b, b, -a], [b, a, -a, -b, -b, -a, a, b], [c, -c, -c, c, c, -c, -c, c]]
    ).T
    signs = (1.0, -1.0)
    places = [0.25 * c * np.array((x, y, z)) for z in signs for y in signs for x in signs]
    entries = [rotor_entries(p, n, 8.5e-6, 1.5e-7, 1.0) for p, n in zip(places, axes, strict=True)]
    return tuple(value for rotor in entries for value in rotor)


class Vehicle(NamedTuple):
    """A table of rotors, their body, how many components of force are controlled, and the norm."""

    table: tuple[float, ...]
    body: object
    dimension: int
    norm: str = "speed"


def tiltrotor():
    """Ch. 3's vehicle as a table of rotors."""
    table = []
    for i, (x, y) in enumerate(((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))):
        place = (FOUR.arm_length * x, FOUR.arm_length * y, 0.0)
        table += rotor_entries(
            place, (0.0, 0.0, 1.0), FOUR.thrust_coefficient, FOUR.drag_coefficient, SPIN[i],
            tilt=i, hinge=place, hinge_axis=(x, y, 0.0),
        )  # fmt: skip
    inertia = np.diag((FOUR.inertia_xx, FOUR.inertia_yy, FOUR.inertia_zz))
    return Vehicle(tuple(table), body_of(FOUR.mass, inertia, FOUR.gravity), 1)


def random_states(count):
    """States of the tiltrotor near and far from hover, with their times."""
    rng = np.random.default_rng(1)
    for _ in range(count):
        body = (*rng.normal(size=6), *rng.uniform(-0.4, 0.4, 3), *rng.normal(size=3))
        speeds = rng.uniform(100.0, 500.0, 4) * SPIN
        yield rng.uniform(0.0, 30.0), (*body, *rng.uniform(-1.2, 1.2, 4).tolist(), *speeds.tolist())


def parameters_of(vehicle, gait=None, reference=None, **changes):
    """Parameters without limits, and the knots of the gait and of the table."""
    gait = gait or plans.fixed(())
    reference = reference or ReferenceParameters(SETPOINT)
    law = Parameters(
        vehicle=vehicle.body,
        gains=GAIN_SETS["feedforward"],
        integral=IntegralGains(),
        side_gains=(12.0, 48.0, 64.0),
        side_integral=0.0,
        max_acceleration=inf,
        max_angular_acceleration=inf,
        anticipation=0.0,
        terms=FeedforwardTerms(),
        gait=gait.parameters,
        reference=reference,
        decoupler=EXACT,
        decoupling=EXACT_DECOUPLING,
        attitude_error=ROTATION,
        restoring=0.0,
        slowest_rotor=0.0,
        turn_time=0.0,
        rotors=float(len(gait.knots)),
        failure=Failure(),
        limits=RotorRange(),
        supervisor=Supervisor(),
        watched=Watched(),
        watched_without=Watched(),
        upper_side=(0.0, 0.0, 0.0),
        upper_side_without=(0.0, 0.0, 0.0),
    )
    return law._replace(**changes), (*gait.knots, *vehicle.table)


def hover_speeds(vehicle, angles=(), acceleration=(0.0, 0.0, 0.0)):
    """Rotor speeds of the least sum of squares of w that accelerate the level vehicle (m/s^2)."""
    force, torque = force_and_torque(vehicle.table, angles)
    lift = vehicle.body.mass * np.add(acceleration, (0.0, 0.0, vehicle.body.gravity))
    rows = np.vstack([force / 1e-5, torque / 1e-6])
    w = np.linalg.pinv(rows, rcond=1e-9) @ np.array([*lift / 1e-5, 0.0, 0.0, 0.0])
    return np.sign(w) * np.sqrt(np.abs(w))


class Flight(NamedTuple):
    """Samples at the ends of the steps, time first."""

    time: np.ndarray
    position: np.ndarray  # (steps, 3)
    up: np.ndarray  # (steps, 3), world up in body axes
    speeds: np.ndarray  # (steps, N)
    null_part: np.ndarray


def fly(vehicle, law, knots, duration, *, gait=None, step=0.005, start=(), wind=(0.0, 0.0, 0.0)):
    """Fly along a gait; ``start`` is position, velocity and acceleration, level and at rest."""
    layout = tilt_of_rotor(vehicle.table)
    rotors, tilts = len(layout), tilts_of(layout)
    own_rotors = rotors_in(np.array(knots), int(law.rotors), layout)
    planned = gait or plans.fixed((0.0,) * tilts)
    still = (0.0,) * (12 + tilts + rotors), (0.0,) * tilts, (0.0,) * 3
    own = flat(multirotor_law_of(layout, Form(vehicle.dimension, vehicle.norm)))
    inputs = compiled(own, 0.0, *still, law, knots)
    states, used = 21 + rotors, 21 + rotors + tilts

    def moving(given):
        state, angles, u = np.split(np.array([*given], dtype=object), [states, used])
        return equations_of_motion(state, angles, u, law.vehicle, own_rotors, wind, 1.0)

    size = used + len(inputs(0.0, *still, law, knots))
    motion = machine_code(trace_vectors(moving, {"given": size}))
    seen = []

    def rates(time, state):
        angles, turning = planned.angles(time), planned.rates(time)
        angles, turning = tuple(angles.tolist()), tuple(turning.tolist())
        attitude = euler_of_rotation(np.reshape(state[6:15], (3, 3)))
        speeds, integrals = state[18 : 18 + rotors], tuple(state[18 + rotors :])
        law_state = (*state[:6], *attitude, *state[15:18], *angles, *speeds)
        u = inputs(time, law_state, turning, integrals, law, knots)
        seen.append(u[-1])
        moved = motion([*state, *angles, *u])
        return np.array((*moved, *u[rotors : rotors + 3]))

    start = start or (0.0,) * 9
    speeds = hover_speeds(vehicle, planned.angles(0.0), start[6:])
    state = np.array((*start[:6], *np.eye(3).ravel(), 0.0, 0.0, 0.0, *speeds, 0.0, 0.0, 0.0))
    rows = []
    for k in range(round(duration / step)):
        time = k * step
        k1 = rates(time, state.tolist())
        part = seen[-1]
        k2 = rates(time + 0.5 * step, (state + 0.5 * step * k1).tolist())
        k3 = rates(time + 0.5 * step, (state + 0.5 * step * k2).tolist())
        k4 = rates(time + step, (state + step * k3).tolist())
        state = state + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        rows.append((time + step, *state[:3], *state[12:15], *state[18 : 18 + rotors], part))
    rows = np.array(rows)
    return Flight(rows[:, 0], rows[:, 1:4], rows[:, 4:7], rows[:, 7:-1], rows[:, -1])
