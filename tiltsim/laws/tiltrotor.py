"""Common parts of the closed loops with the tiltrotor.

A control step goes from MuJoCo's state to MuJoCo's controls, as scalar code for every engine. It is
a pure function of time, `qpos`, `qvel`, `act` and the parameters in `userdata`, so that a saved
state restarts exactly and an integrator may call it at every stage.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup, Dynamics, Sizes, SupervisedLaw
from tiltsim.engines.sample_evaluation import evaluate_over_samples, flights_in
from tiltsim.equations.tiltrotor import equations_of_motion, initial_state, law_state
from tiltsim.laws.rotorcraft import held_controls_of, thrust_controls_of
from tiltsim.vehicles.rotorcraft.layout import TILT_RATE_1
from tiltsim_controllers.analysis.singularity import determinant, margin_over_gait
from tiltsim_controllers.gaits.parameters import GaitParameters
from tiltsim_controllers.gaits.tilts import tilt_reference
from tiltsim_controllers.laws.supervisor import SUPERVISOR_AT_REST
from tiltsim_controllers.laws.tiltrotor_supervisor import SUPERVISION
from tiltsim_controllers.mathematics.rotation import euler_from_quaternion, world_up_in_body
from tiltsim_controllers.mathematics.scalar import Floats, Quad, Triple, Values, Vector, scalar
from tiltsim_controllers.vehicle.decoupling_matrix import (
    sines_and_cosines,
    torque_entries,
    torque_free_force,
)
from tiltsim_controllers.vehicle.parameters import SPIN, Vehicle, drag_ratio
from tiltsim_controllers.vehicle.states import ALPHA_1, PITCH, ROLL, ROTORS, SPEED_1, TILT_FIELDS

if TYPE_CHECKING:
    from tiltsim.scenario.rotorcraft import ServoTable
    from tiltsim.scenario.scenario import FlightPlan, Scenario

REFERENCE_COLUMNS: Final = ("x_ref", "y_ref", "z_ref", "roll_ref", "pitch_ref", "yaw_ref")
TILT_REFERENCE_COLUMNS: Final = tuple(f"alpha_ref_{rotor}" for rotor in ROTORS)


@scalar
def tiltrotor_state(qpos: Vector, qvel: Vector, act: Vector) -> Values:
    """State of the control laws, `TILTROTOR_FIELDS`, from MuJoCo's.

    MuJoCo gives the body's position, its quaternion and the tilt angles in ``qpos``, the velocity
    in world axes, the body rates in body axes and the tilt rates in ``qvel``.
    """
    x, y, z, qw, qx, qy, qz, alpha_1, alpha_2, alpha_3, alpha_4 = qpos
    vx, vy, vz, p, q, r = qvel[:6]
    roll, pitch, yaw = euler_from_quaternion(qw, qx, qy, qz)
    # One tuple: to join two costs Python a third of this function.
    return (
        x, y, z, vx, vy, vz, roll, pitch, yaw, p, q, r,
        alpha_1, alpha_2, alpha_3, alpha_4, act[0], act[1], act[2], act[3],
    )  # fmt: skip


@scalar
def four(values: Vector, first: int) -> Quad:
    """Four consecutive values."""
    return values[first], values[first + 1], values[first + 2], values[first + 3]


rotor_thrust_controls: Final = thrust_controls_of(SPIN)
"""Controls of the thrust actuators, ``s_i varpi_i |varpi_i|`` with ``s = (-1, 1, -1, 1)``."""


@scalar
def gait_servo_commands(time: float, lead: float, gait: GaitParameters, knots: Vector) -> Quad:
    """Commands (rad) of the tilt servos, ahead of the planned gait by their lag.

    Args:
        time, lead: s
        gait, knots: the planned gait
    """
    a1, a2, a3, a4, rate_1, rate_2, rate_3, rate_4 = tilt_reference(time, gait, knots)
    return a1 + lead * rate_1, a2 + lead * rate_2, a3 + lead * rate_3, a4 + lead * rate_4


@scalar
def measured_acceleration(qvel: Vector) -> Triple:
    """The angular acceleration (rad/s^2, body axes) that follows MuJoCo's ten velocities."""
    return qvel[10], qvel[11], qvel[12]


def with_measured_inputs(loop: ClosedLoop, inputs: Callable[..., Values]) -> ClosedLoop:
    """A gait-following controller that reads the `measured_acceleration`.

    `tiltsim.laws.layers.measured_acceleration` measures it.

    Args:
        loop: The same controller without.
        inputs: Its controls from the rotor accelerations on, as `SupervisedLaw.controls`.
    """
    assert loop.supervised is not None  # so has every controller that follows a gait

    @scalar
    def controls(
        time: float, qpos: Vector, qvel: Vector, act: Vector, parameters: Any, knots: Vector
    ) -> Values:
        state = tiltrotor_state(qpos, qvel, act)
        return (
            *gait_servo_commands(time, parameters.servo_lead, parameters.law.gait, knots),
            *rotor_thrust_controls(act),
            *inputs(time, state, qvel, act, SUPERVISOR_AT_REST, parameters, knots),
        )

    controls.__qualname__ = f"measured.{loop.sampling.controls.__qualname__}"
    return replace(
        loop,
        sampling=replace(loop.sampling, controls=controls),
        equations=None,
        supervised=loop.supervised._replace(controls=inputs),
    )


refreshed_controls: Final = held_controls_of(SPIN, len(SPIN))
"""Held controls with the thrusts of the present rotor speeds."""


def servo_lead(servo: ServoTable) -> float:
    """Lag (s) of a tilt servo behind a command of constant rate, ``2 zeta / omega_n``."""
    return 2.0 * servo.damping_ratio / servo.natural_frequency


@scalar
def gait_tilts(time: float, state: Vector, parameters: Any, knots: Vector) -> Quad:
    """Tilt angles (rad) that follow the gait exactly."""
    a1, a2, a3, a4, _, _, _, _ = tilt_reference(time, parameters.law.gait, knots)
    return a1, a2, a3, a4


@scalar
def gait_equation_rates(
    time: float, state: Vector, inputs: Vector, parameters: Any, knots: Vector, disturbance: Triple
) -> Values:
    """The thesis's equations with tilt angles that follow the gait exactly."""
    tilts, vehicle = gait_tilts(time, state, parameters, knots), parameters.law.vehicle
    return equations_of_motion(state, tilts, four(inputs, 0), vehicle, disturbance)


@scalar
def observe_gait_equations(
    time: float, state: Vector, inputs: Vector, parameters: Any, knots: Vector
) -> Values:
    """A sample of the thesis's equations; the tilts are the gait's."""
    a1, a2, a3, a4, rate_1, rate_2, rate_3, rate_4 = tilt_reference(
        time, parameters.law.gait, knots
    )
    return (*law_state(state, (a1, a2, a3, a4)), rate_1, rate_2, rate_3, rate_4)


def initial_equation_state(plan: FlightPlan) -> Values:
    """State of the thesis's equations at time zero, without states of the controller."""
    return initial_state(plan.scenario, initial_signed_rotor_speeds(plan.scenario))


def initial_signed_rotor_speeds(scenario: Scenario) -> Values:
    """The signed rotor speeds (rad/s) at time zero."""
    return tuple(s * speed for s, speed in zip(SPIN, scenario.initial.rotor_speeds(4), strict=True))


def tiltrotor_dynamics(
    controller_states: int = 0, initial: Callable[[FlightPlan], Vector] = lambda _plan: ()
) -> Dynamics:
    """The model of the tiltrotor.

    Args:
        controller_states: Number of states of the controller.
        initial: ``(plan) -> states`` at time zero.
    """
    return Dynamics(
        "tiltrotor",
        Sizes(qpos=11, qvel=10, act=4 + controller_states, ctrl=12 + controller_states),
        lambda plan, _setup: (*initial_signed_rotor_speeds(plan.scenario), *initial(plan)),
        controller_states,
    )


@scalar
def observe_tiltrotor(qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector) -> Values:
    """Rigid body, tilts, rotor speeds and tilt rates: all of them states of the simulation."""
    return (*tiltrotor_state(qpos, qvel, act), *four(qvel, TILT_RATE_1))


def singularity_columns(samples: Mapping[str, Floats], vehicle: Vehicle) -> dict[str, Floats]:
    """Determinant of the attitude-altitude law, and the margin (rad) to a singular attitude."""
    tilts = np.stack([samples[name] for name in TILT_FIELDS], axis=-1)
    attitude = samples["roll"], samples["pitch"]
    return {
        "singularity_margin": margin_over_gait(
            tilts, vehicle, *attitude, flights=flights_in(samples["time"])
        ),
        "determinant": determinant(tilts, *attitude, vehicle),
    }


@scalar
def watched_vehicle(parameters: Any) -> float:
    """What the tiltrotor's supervisor reads of it."""
    return drag_ratio(parameters.law.vehicle)


def supervised_law(
    controls: Callable[..., Values], references: Callable[..., Values], fields: tuple[str, ...]
) -> SupervisedLaw:
    """A controller of the tiltrotor for a supervisor; arguments as of `SupervisedLaw`."""
    return SupervisedLaw(
        SUPERVISION,
        watched_vehicle,
        tiltrotor_state,
        controls,
        references,
        REFERENCE_COLUMNS,
        fields,
        lambda samples, setup: singularity_columns(samples, setup.parameters.law.vehicle),
    )


def reference_columns(
    in_force: Callable[..., Values],
    fields: Sequence[str],
    samples: Mapping[str, Floats],
    setup: ControlSetup,
    names: tuple[str, ...] = (*REFERENCE_COLUMNS, *TILT_REFERENCE_COLUMNS),
) -> dict[str, Floats]:
    """The columns of references, evaluated over samples.

    Args:
        in_force: Scalar function ``(time, values, parameters, knots)`` of the columns' values.
        fields: Fields of a sample, its ``values``.
        samples: By field.
        setup: The flight's parameters and knots.
        names: Of the columns.
    """
    states = np.stack([samples[name] for name in fields], axis=-1)
    rows = evaluate_over_samples(in_force, len(names), samples["time"], states, setup)
    return dict(zip(names, rows.T, strict=True))


def rotor_stops(rotors: int) -> tuple[str, ...]:
    """Causes of an end where the speed of a rotor reaches zero, one a rotor."""
    return tuple(
        f"the decoupling matrix became singular: rotor {rotor} came to a stop"
        for rotor in range(1, rotors + 1)
    )


ROTOR_STOPS: Final = rotor_stops(4)
"""Causes for `rotor_speeds_along_spin`: the decoupling matrix has the factor ``2 |varpi|``."""


@scalar
def rotor_speeds_along_spin(values: Vector) -> Quad:
    """Rotor speeds (rad/s) along their spin, of a sample's ``values``."""
    s1, s2, s3, s4 = four(values, SPEED_1)
    return -s1, s2, -s3, s4


@scalar
def scaled_determinant(values: Vector, vehicle: Vehicle) -> float:
    """Determinant of the decoupling matrix without the rotor speeds, of a sample's ``values``."""
    ratio = drag_ratio(vehicle)
    a1, a2, a3, a4 = four(values, ALPHA_1)
    trig = sines_and_cosines(a1, a2, a3, a4)
    nx, ny, nz = torque_free_force(trig, torque_entries(trig, ratio), ratio)
    ux, uy, uz = world_up_in_body(values[ROLL], values[PITCH])
    return nx * ux + ny * uy + nz * uz


@scalar
def determinant_and_speeds(time: float, values: Vector, parameters: Any, knots: Vector) -> Values:
    """`scaled_determinant` and `rotor_speeds_along_spin`."""
    determinant = scaled_determinant(values, parameters.law.vehicle)
    return (determinant, *rotor_speeds_along_spin(values))


def determinant_and_speed_causes(
    sample: Mapping[str, float], _setup: ControlSetup
) -> tuple[str, ...]:
    """Causes for `determinant_and_speeds`."""
    return (singular_attitude(sample, TILT_FIELDS), *ROTOR_STOPS)


def singular_attitude(sample: Mapping[str, float], tilts: tuple[str, ...]) -> str:
    """Cause of an end at an attitude and tilt angles, which have these names."""
    angles = ", ".join(f"{sample[name]:.3g}" for name in tilts)
    return (
        f"the decoupling matrix became singular at roll = {sample['roll']:.3g} rad, "
        f"pitch = {sample['pitch']:.3g} rad" + (f", tilt angles ({angles}) rad" if tilts else "")
    )
