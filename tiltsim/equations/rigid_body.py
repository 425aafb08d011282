"""Any rotorcraft as one rigid body with massless pods on servos: what MuJoCo's model has.

Gyroscopic torque, tilt servos of second order with stops, rotors with limits. The state is MuJoCo's
``qpos``, ``qvel`` and ``act``, so the controls are the same function of it. The rotors are those of
a table (`tiltsim_controllers.vehicle.effectiveness`).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import sqrt
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from tiltsim.equations.actuator_level import (
    ActuatorPlant,
    external_acceleration,
    limit_speeds_of,
    mechanics_around,
    mechanics_record,
    servo_accelerations_of,
    stop_pods,
)
from tiltsim.equations.solvers import identity
from tiltsim.vehicles.rotorcraft import initial_motion
from tiltsim.vehicles.rotorcraft.layout import QW, TILT_1, TILT_RATE_1, Layout
from tiltsim_controllers.mathematics.records import make_record_type, vector_of
from tiltsim_controllers.mathematics.rotation import rotation_from_quaternion, to_world
from tiltsim_controllers.mathematics.scalar import Quad, Triple, Values, Vector, scalar
from tiltsim_controllers.mathematics.vectors import componentwise, entries_of
from tiltsim_controllers.vehicle.effectiveness import (
    ROTOR_FLOATS,
    TiltOfRotor,
    cross_table,
    effectiveness_of,
    tilts_of,
)
from tiltsim_controllers.vehicle.multirotor import Body, body_acceleration, body_of, principal_body
from tiltsim_controllers.vehicle.parameters import Vehicle

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan, Scenario


class Form(NamedTuple):
    """What the compiled code of a vehicle is made for; all its numbers are data."""

    tilt_of_rotor: TiltOfRotor
    spins: Values
    has_limits: bool  # of rotor speeds or tilts


def form_of(scenario: Scenario) -> Form:
    """The form of a scenario's rotorcraft."""
    vehicle = scenario.any_rotorcraft
    rotors = range(1, vehicle.rotor_count + 1)
    return Form(
        tuple(map(vehicle.tilt_of_rotor, rotors)),
        vehicle.spins,
        vehicle.has_rotor_limits or vehicle.tilt_servo.max_angle is not None,
    )


@cache
def _rotors_record(count: int) -> Any:
    """The type of the parameters of a body with so many rotors."""
    return make_record_type("Rotors", body=Body, effects=vector_of(ROTOR_FLOATS * count))


def _rotors(scenario: Scenario) -> Any:
    """The true vehicle, not the controller's."""
    vehicle = scenario.true_vehicle
    if isinstance(vehicle, Vehicle):
        table = cross_table(vehicle, tilting=scenario.vehicle.has_tilting_rotors)
        body = principal_body(vehicle)
    else:
        table = vehicle.table
        body = body_of(vehicle.mass, np.reshape(vehicle.inertia, (3, 3)), vehicle.gravity)
    return _rotors_record(scenario.vehicle.rotor_count)(body, table)


@scalar
def quaternion_rates(quaternion: Quad, omega: Triple) -> Quad:
    """Derivative ``q (0, omega) / 2`` (1/s) of the attitude at body rates (rad/s)."""
    w, x, y, z = quaternion
    p, q, r = 0.5 * omega[0], 0.5 * omega[1], 0.5 * omega[2]
    return (
        -x * p - y * q - z * r,
        w * p + y * r - z * q,
        w * q + z * p - x * r,
        w * r + x * q - y * p,
    )


@scalar
def normalized(state: list[float], mechanics: Any) -> list[float]:
    """The state with a quaternion of length one, which no solver keeps."""
    w, x, y, z = state[QW], state[QW + 1], state[QW + 2], state[QW + 3]
    scale = 1.0 / sqrt(w * w + x * x + y * y + z * z)
    unit = state[:]
    for index in range(QW, QW + 4):
        unit[index] = scale * state[index]
    return unit


@cache
def rigid_body_of(form: Form) -> ActuatorPlant:
    """The rigid body of vehicles of a form."""
    layout, tilts = form.tilt_of_rotor, tilts_of(form.tilt_of_rotor)
    qpos_size, qvel_size = TILT_1 + tilts, TILT_RATE_1 + tilts
    rates_of = _rates_of(form)
    first_speed = qpos_size + qvel_size
    limit_speeds, rate_1 = limit_speeds_of(form.spins, first_speed), qpos_size + TILT_RATE_1

    @scalar
    def within_limits(state: list[float], mechanics: Any) -> list[float]:
        limited = limit_speeds(state, mechanics)
        return stop_pods(limited, TILT_1, rate_1, tilts, mechanics.max_tilt)

    def initial(plan: FlightPlan) -> Values:
        qpos, qvel = initial_motion(plan)
        return (*qpos, *qvel)

    return ActuatorPlant(
        motion=first_speed,
        qpos=entries_of(0, qpos_size),
        qvel=entries_of(qpos_size, qvel_size),
        rates=rates_of,
        project_onto_limits=within_limits if form.has_limits else identity,
        initial=initial,
        mechanics=mechanics_record(_rotors_record(len(layout)), len(layout), tilts),
        read=lambda plan: mechanics_around(_rotors(plan.scenario), plan),
        name="rigid_body.limited" if form.has_limits else "rigid_body",
        finish=normalized,
    )


def _rates_of(form: Form) -> Callable[..., Values]:
    """Scalar code of the derivative of the motion; see `ActuatorPlant.rates`."""
    layout, tilts = form.tilt_of_rotor, tilts_of(form.tilt_of_rotor)
    places, qvel_1 = Layout(len(layout), tilts), TILT_1 + tilts
    velocity_in, omega_in = entries_of(qvel_1, 3), entries_of(qvel_1 + 3, 3)
    quaternion_in, tilts_in = entries_of(QW, 4), entries_of(TILT_1, tilts)
    tilt_rates_in = entries_of(qvel_1 + TILT_RATE_1, tilts)
    # The controls are s varpi |varpi| with the spins s, the table's wrench is of varpi |varpi|.
    squares_of = componentwise("squares_of_thrusts", "x, spins", "spins# * x#", places.rotors)
    thrusts_in, servos = (
        entries_of(places.thrust_1, places.rotors),
        servo_accelerations_of(layout, tilts),
    )
    wrench_of, spins = effectiveness_of(layout).wrench, form.spins

    @scalar
    def motion_rates(
        state: Vector, ctrl: Vector, loads: Values, mechanics: Any, disturbance: Triple
    ) -> Values:
        body = mechanics.vehicle.body
        (qw, qx, qy, qz), (p, q, r) = quaternion_in(state), omega_in(state)
        angles, rates = tilts_in(state), tilt_rates_in(state)
        thrusts, effects = thrusts_in(ctrl), mechanics.vehicle.effects
        fx, fy, fz, tx, ty, tz = wrench_of(angles, squares_of(thrusts, spins), effects, 0)
        rotation = rotation_from_quaternion(qw, qx, qy, qz)
        ax, ay, az = to_world(rotation, (fx, fy, fz))
        extra_x, extra_y, extra_z = external_acceleration(rotation, loads, body.mass, disturbance)
        torque = (tx + loads[3], ty + loads[4], tz + loads[5])
        return (
            *velocity_in(state),
            *quaternion_rates((qw, qx, qy, qz), (p, q, r)),
            *rates,
            ax / body.mass + extra_x,
            ay / body.mass + extra_y,
            az / body.mass - body.gravity + extra_z,
            *body_acceleration(body, torque, (p, q, r), 1.0),
            *servos(ctrl, thrusts, angles, rates, loads, mechanics),
        )

    return motion_rates
