"""The attitude-altitude law around the tiltrotor.

The control step goes from MuJoCo's state to MuJoCo's controls, as scalar code. One step serves
every engine. It is a pure function of time, `qpos`, `qvel`, `act` and the parameters in
`userdata`, so that a saved state restarts exactly and an integrator may call it at every stage.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.closed_loop.loop import ControlSetup, Dynamics, SignCheck, Sizes
from tiltsim.engines.sample_evaluation import evaluate_over_samples
from tiltsim.vehicles.rotorcraft.layout import (
    ALPHA_1,
    ALPHA_2,
    ALPHA_3,
    ALPHA_4,
    OBSERVED_FIELDS,
    PITCH,
    ROLL,
    SPEED_1,
    SPEED_2,
    SPEED_3,
    SPEED_4,
    TILT_RATE_1,
    TILT_RATE_2,
    TILT_RATE_3,
    TILT_RATE_4,
)
from tiltsim_controllers.analysis.singularity import determinant, margin_over_gait
from tiltsim_controllers.gaits.parameters import GaitParameters
from tiltsim_controllers.gaits.tilts import tilt_reference
from tiltsim_controllers.mathematics.rotation import euler_from_quaternion, world_up_in_body
from tiltsim_controllers.mathematics.scalar import Floats, Quad, Values, Vector, scalar
from tiltsim_controllers.vehicle.decoupling_matrix import (
    sines_and_cosines,
    torque_entries,
    torque_free_force,
)
from tiltsim_controllers.vehicle.parameters import SPIN, Vehicle, drag_ratio

if TYPE_CHECKING:
    from tiltsim.scenario.flight_plan import FlightPlan
    from tiltsim.scenario.scenario import Scenario
    from tiltsim.scenario.vehicle import ServoTable

REFERENCE_COLUMNS: Final = ("x_ref", "y_ref", "z_ref", "roll_ref", "pitch_ref", "yaw_ref")
TILT_COLUMNS: Final = ("alpha_1", "alpha_2", "alpha_3", "alpha_4")
TILT_REFERENCE_COLUMNS: Final = tuple(f"alpha_ref_{rotor}" for rotor in (1, 2, 3, 4))


@scalar
def tiltrotor_state(qpos: Vector, qvel: Vector, act: Vector) -> Values:
    """The law's state (`tiltsim_controllers.vehicle.states.TILTROTOR_FIELDS`) from MuJoCo's.

    MuJoCo gives the body's position, its quaternion and the tilt angles in ``qpos``, the velocity
    in world axes, the body rates in body axes and the tilt rates in ``qvel``.
    """
    x, y, z, qw, qx, qy, qz, alpha_1, alpha_2, alpha_3, alpha_4 = qpos
    vx, vy, vz, p, q, r, _, _, _, _ = qvel
    roll, pitch, yaw = euler_from_quaternion(qw, qx, qy, qz)
    # One tuple: to join two costs Python a third of this function.
    return (
        x, y, z, vx, vy, vz, roll, pitch, yaw, p, q, r,
        alpha_1, alpha_2, alpha_3, alpha_4, act[0], act[1], act[2], act[3],
    )  # fmt: skip


@scalar
def rotor_thrust_controls(act: Vector) -> Quad:
    """Controls of the thrust actuators, ``s_i varpi_i |varpi_i|`` with ``s = (-1, 1, -1, 1)``."""
    speed_1, speed_2, speed_3, speed_4 = act[0], act[1], act[2], act[3]
    return (
        -speed_1 * abs(speed_1),
        speed_2 * abs(speed_2),
        -speed_3 * abs(speed_3),
        speed_4 * abs(speed_4),
    )


@scalar
def gait_servo_commands(time: float, lead: float, gait: GaitParameters, knots: Vector) -> Quad:
    """What the tilt servos are told (rad) to follow the planned gait, their lag allowed for."""
    a1, a2, a3, a4, rate_1, rate_2, rate_3, rate_4 = tilt_reference(time, gait, knots)
    return a1 + lead * rate_1, a2 + lead * rate_2, a3 + lead * rate_3, a4 + lead * rate_4


@scalar
def refreshed_controls(
    time: float, qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector, parameters: Any
) -> Values:
    """Held controls with the thrusts of the present rotor speeds."""
    return (*ctrl[:4], *rotor_thrust_controls(act), *ctrl[8:])


def servo_lead(servo: ServoTable) -> float:
    """By how much (s) a tilt servo lags behind a command that moves evenly."""
    return 2.0 * servo.damping_ratio / servo.natural_frequency


def initial_signed_rotor_speeds(scenario: Scenario) -> Values:
    """The signed rotor speeds (rad/s) at time zero."""
    return tuple(s * speed for s, speed in zip(SPIN, scenario.initial.rotor_speeds(4), strict=True))


def tiltrotor_dynamics(
    controller_states: int = 0, initial: Callable[[FlightPlan], Vector] = lambda _plan: ()
) -> Dynamics:
    """The model of the tiltrotor.

    Parameters
    ----------
    controller_states
        Number of states of the controller.
    initial
        ``(plan) -> states`` at time zero.
    """
    return Dynamics(
        "tiltrotor",
        Sizes(qpos=11, qvel=10, act=4 + controller_states, ctrl=12 + controller_states),
        lambda plan, _setup: (*initial_signed_rotor_speeds(plan.scenario), *initial(plan)),
        controller_states,
    )


@scalar
def tilt_rates(qvel: Vector) -> Quad:
    """Tilt rates (rad/s)."""
    return qvel[TILT_RATE_1], qvel[TILT_RATE_2], qvel[TILT_RATE_3], qvel[TILT_RATE_4]


@scalar
def observe_tiltrotor(qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector) -> Values:
    """Rigid body, tilts, rotor speeds and tilt rates: all of them states of the simulation."""
    return (*tiltrotor_state(qpos, qvel, act), *tilt_rates(qvel))


def singularity_columns(samples: Mapping[str, Floats], vehicle: Vehicle) -> dict[str, Floats]:
    """Determinant of the attitude-altitude law at the present tilts, and the margin to zero."""
    tilts = np.stack([samples[name] for name in TILT_COLUMNS], axis=-1)
    attitude = samples["roll"], samples["pitch"]
    return {
        "singularity_margin": margin_over_gait(tilts, vehicle, *attitude),
        "determinant": determinant(tilts, *attitude, vehicle),
    }


def reference_columns(
    in_force: Callable[..., Values],
    fields: Sequence[str],
    samples: Mapping[str, Floats],
    setup: ControlSetup,
) -> dict[str, Floats]:
    """The columns that a function such as `reference_values` tells of samples' ``fields``."""
    states = np.stack([samples[name] for name in fields], axis=-1)
    names = (*REFERENCE_COLUMNS, *TILT_REFERENCE_COLUMNS)
    rows = evaluate_over_samples(in_force, len(names), samples["time"], states, setup)
    return dict(zip(names, rows.T, strict=True))


def rotor_speed_checks(sample: Mapping[str, float]) -> tuple[SignCheck, ...]:
    """Rotor speeds along their spin: a matrix with the factor ``2 |varpi|`` is singular at zero."""
    return tuple(
        SignCheck(
            sign * sample[f"rotor_speed_{rotor}"],
            f"the decoupling matrix became singular: rotor {rotor} came to a stop",
        )
        for rotor, sign in enumerate(SPIN, start=1)
    )


@scalar
def rotor_speeds_along_spin(values: Vector) -> Quad:
    """Rotor speeds along their spin, from what `observe_tiltrotor` gives."""
    return -values[SPEED_1], values[SPEED_2], -values[SPEED_3], values[SPEED_4]


@scalar
def scaled_determinant(values: Vector, vehicle: Vehicle) -> float:
    """The determinant of the decoupling matrix but for the rotor speeds, of a sample's values."""
    ratio = drag_ratio(vehicle)
    trig = sines_and_cosines(values[ALPHA_1], values[ALPHA_2], values[ALPHA_3], values[ALPHA_4])
    nx, ny, nz = torque_free_force(trig, torque_entries(trig, ratio), ratio)
    ux, uy, uz = world_up_in_body(values[ROLL], values[PITCH])
    return nx * ux + ny * uy + nz * uz


def determinant_check(sample: Mapping[str, float], vehicle: Vehicle) -> SignCheck:
    """The determinant of the attitude-altitude law at the present tilts and attitude."""
    angles = ", ".join(f"{sample[name]:.3g}" for name in TILT_COLUMNS)
    return SignCheck(
        scaled_determinant([sample[name] for name in OBSERVED_FIELDS], vehicle),
        f"the decoupling matrix became singular at roll = {sample['roll']:.3g} rad, "
        f"pitch = {sample['pitch']:.3g} rad, tilt angles ({angles}) rad",
    )
