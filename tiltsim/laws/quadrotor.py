"""Common parts of the closed loops with the quadrotor.

The control laws of ch. 2 demand thrust and torques, which the rotors make at once: their speeds
follow from the controls and are not states. The model's four rotor speed states stay at zero.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import cos
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.closed_loop.loop import (
    ClosedLoop,
    Columns,
    ControlSetup,
    Dynamics,
    Equations,
    Monitoring,
    Sampling,
    Sizes,
)
from tiltsim.engines.sample_evaluation import evaluate_over_samples
from tiltsim.equations.quadrotor import equations_of_motion, initial_state, rigid_body
from tiltsim.laws.rotorcraft import REFERENCE_COLUMNS
from tiltsim.laws.tiltrotor import TILT_REFERENCE_COLUMNS
from tiltsim.vehicles.rotorcraft import ROTORCRAFT
from tiltsim_controllers.analysis.quadrotor_singularity import (
    normalized_determinant,
    published_determinant,
)
from tiltsim_controllers.mathematics.rotation import euler_from_quaternion
from tiltsim_controllers.mathematics.scalar import Floats, Triple, Values, Vector, scalar
from tiltsim_controllers.references.trajectories import ReferenceParameters, position_reference
from tiltsim_controllers.vehicle.parameters import SPIN, Vehicle
from tiltsim_controllers.vehicle.quadrotor_mixer import speed_along_spin, thrust_controls
from tiltsim_controllers.vehicle.states import PITCH, ROLL

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan

EXTENSION_FIELDS: Final = ("extension_thrust", "extension_thrust_rate")
"""The controller's states, ``zeta`` and ``xi``, in a sample."""

EXTENSION_COLUMNS: Final = {
    "extension_thrust": "N",
    "extension_thrust_rate": "N/s",
    "published_determinant": "1",
}


@scalar
def rigid_body_state(qpos: Vector, qvel: Vector, thrust: float, thrust_rate: float) -> Values:
    """State of the control laws.

    Args:
        qpos, qvel: MuJoCo's state
        thrust, thrust_rate: N and N/s
    """
    x, y, z, qw, qx, qy, qz = qpos
    vx, vy, vz, p, q, r = qvel
    roll, pitch, yaw = euler_from_quaternion(qw, qx, qy, qz)
    return x, y, z, vx, vy, vz, roll, pitch, yaw, p, q, r, thrust, thrust_rate


@scalar
def extended_controls(inputs: Values, vehicle: Vehicle) -> Values:
    """The ten controls for a control law's `INPUT_FIELDS`: thrusts, idle rotors, its states."""
    thrust, roll_torque, pitch_torque, yaw_torque, thrust_derivative, thrust_rate_derivative = (
        inputs
    )
    thrusts = thrust_controls(thrust, roll_torque, pitch_torque, yaw_torque, vehicle)
    return (*thrusts, 0.0, 0.0, 0.0, 0.0, thrust_derivative, thrust_rate_derivative)


@scalar
def sample_values(body: Vector, thrusts: Vector) -> Values:
    """A sample, from the rigid body's twelve states and the thrust controls."""
    return (
        *rigid_body(body),
        0.0,
        0.0,
        0.0,
        0.0,
        -speed_along_spin(thrusts[0]),
        speed_along_spin(thrusts[1]),
        -speed_along_spin(thrusts[2]),
        speed_along_spin(thrusts[3]),
        0.0,
        0.0,
        0.0,
        0.0,
    )


@scalar
def observe_quadrotor(qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector) -> Values:
    """The rigid body, no tilt, rotor speeds from the thrusts in force."""
    return sample_values(rigid_body_state(qpos, qvel, 0.0, 0.0), ctrl)


@scalar
def observe_extended_quadrotor(qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector) -> Values:
    """The quadrotor and the controller's states."""
    return (*observe_quadrotor(qpos, qvel, act, ctrl), act[4], act[5])


@scalar
def thrust_tilt_cosine(values: Vector) -> float:
    """The cosine of the thrust axis's tilt, of a sample's ``values``."""
    return cos(values[ROLL]) * cos(values[PITCH])


@scalar
def equation_rates(
    time: float, state: Vector, inputs: Vector, parameters: Any, knots: Vector, disturbance: Triple
) -> Values:
    """Ch. 2's equations of motion."""
    return equations_of_motion(state, inputs, parameters.vehicle, disturbance)


@scalar
def observe_equations(
    time: float, state: Vector, inputs: Vector, parameters: Any, knots: Vector
) -> Values:
    """A sample of ch. 2's equations; the rotor speeds follow from thrust and torques."""
    thrusts = thrust_controls(inputs[0], inputs[1], inputs[2], inputs[3], parameters.vehicle)
    return sample_values(state, thrusts)


@scalar
def _extended_equation_rates(
    time: float, state: Vector, inputs: Vector, parameters: Any, knots: Vector, disturbance: Triple
) -> Values:
    """Ch. 2's equations of motion, followed by the controller's own two states."""
    body = equations_of_motion(state, inputs, parameters.vehicle, disturbance)
    return (*body, inputs[4], inputs[5])


@scalar
def _observe_extended_equations(
    time: float, state: Vector, inputs: Vector, parameters: Any, knots: Vector
) -> Values:
    """As `observe_equations`, followed by the controller's own states."""
    return (*observe_equations(time, state, inputs, parameters, knots), state[12], state[13])


@scalar
def thrust_axis_value(
    time: float, values: Vector, parameters: object, knots: Vector
) -> tuple[float]:
    """The cosine of the thrust axis's tilt."""
    return (thrust_tilt_cosine(values),)


def extended_loop(
    parameters: type[tuple[Any, ...]],
    setup: Callable[[FlightPlan, float], ControlSetup],
    controls: Callable[..., Values],
    inputs: Callable[..., Values],
    columns: Columns,
    monitoring: Monitoring,
) -> ClosedLoop:
    """A closed loop around a control law that integrates its thrust twice.

    Args:
        parameters: Record with the fields ``signature`` and ``vehicle`` at least.
        setup, controls, columns, monitoring: As in `tiltsim.closed_loop.loop.ClosedLoop`.
        inputs: The control law on ch. 2's equations; see `tiltsim.closed_loop.loop.Equations`.
    """
    return ClosedLoop(
        kind=ROTORCRAFT,
        parameters=parameters,
        setup=setup,
        dynamics=Dynamics(
            "quadrotor",
            Sizes(qpos=7, qvel=6, act=6, ctrl=10),
            lambda plan, _setup: (0.0, 0.0, 0.0, 0.0, *_hover_thrust(plan)),
            controller_states=2,
            commands_thrusts=True,
            spins=SPIN,
        ),
        sampling=Sampling(controls),
        columns=columns,
        monitoring=monitoring,
        equations=Equations(
            inputs=inputs,
            inputs_size=6,
            rates=_extended_equation_rates,
            initial=lambda plan, _setup: (*initial_state(plan.scenario), *_hover_thrust(plan)),
            observe=_observe_extended_equations,
        ),
        uses_gait=False,
    )


def _hover_thrust(plan: FlightPlan) -> tuple[float, float]:
    """The extension starts with the thrust of hover (N), at rest."""
    vehicle = plan.scenario.rotorcraft.resolve()
    return vehicle.mass * vehicle.gravity, 0.0


@scalar
def _reference_position(
    time: float, state: Vector, reference: ReferenceParameters, knots: Vector
) -> Triple:
    """The position (m) to track."""
    x, y, z, _, _, _, _, _, _ = position_reference(time, reference, knots)
    return x, y, z


def references(
    samples: Mapping[str, Floats],
    reference: ReferenceParameters,
    knots: Vector,
    attitude: Sequence[object] = (),
    tilts: tuple[str, ...] = TILT_REFERENCE_COLUMNS,
) -> dict[str, Floats]:
    """The columns of references; those of the tilts are zero.

    Args:
        samples: By field.
        reference, knots: Of the position.
        attitude: Columns of roll, pitch and yaw (rad): arrays or constants; empty for the
            reference's.
        tilts: Names of the tilts' columns.
    """
    time = samples["time"]
    states, setup = np.empty((len(time), 0)), ControlSetup(reference, tuple(knots))
    columns = [*evaluate_over_samples(_reference_position, 3, time, states, setup).T]
    angles = attitude or (reference.roll, reference.pitch, reference.yaw)
    columns += [np.broadcast_to(np.asarray(angle, dtype=float), time.shape) for angle in angles]
    idle = dict.fromkeys(tilts, np.zeros_like(time))
    return dict(zip(REFERENCE_COLUMNS, columns, strict=True)) | idle


def upright_margin(samples: Mapping[str, Floats]) -> Floats:
    """Smallest rotation (rad) to a roll or pitch of 90 degrees, singular under both control laws.

    The thrust axis is then level, so the margin is its angle above the horizon.
    """
    upright = np.cos(samples["roll"]) * np.cos(samples["pitch"])
    return np.asarray(np.arcsin(np.clip(upright, -1.0, 1.0)))


def extended_singularity_columns(
    samples: Mapping[str, Floats], vehicle: Vehicle
) -> dict[str, Floats]:
    """Exact and published determinant of the yaw-position law, and the margin (rad)."""
    attitude = samples["roll"], samples["pitch"]
    exact = normalized_determinant(*attitude, samples["extension_thrust"], vehicle)
    return {
        "determinant": exact,
        "singularity_margin": upright_margin(samples),
        "published_determinant": published_determinant(*attitude),
        **{name: samples[name] for name in EXTENSION_FIELDS},
    }


def thrust_axis_cause(sample: Mapping[str, float], _setup: ControlSetup) -> tuple[str]:
    """Cause for `thrust_axis_value`: a roll or pitch of 90 degrees."""
    roll, pitch = sample["roll"], sample["pitch"]
    return (
        "the decoupling matrix became singular: the thrust axis came level, "
        f"at roll = {roll:.3g} rad, pitch = {pitch:.3g} rad",
    )
