"""What the loops around the quadrotor share.

The laws of ch. 2 ask for thrust and torques, which the rotors make at once: their speeds follow
from the controls and are no states here. The model's four rotor speed states stay at zero.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import cos
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup, Equations, SignCheck, Sizes
from tiltsim.equations.quadrotor import initial_state
from tiltsim.laws.tiltrotor import REFERENCE_COLUMNS, TILT_REFERENCE_COLUMNS
from tiltsim.vehicles.rotorcraft import OBSERVED_FIELDS, ROTORCRAFT
from tiltsim_controllers.analysis.quadrotor_singularity import (
    normalized_determinant,
    published_determinant,
)
from tiltsim_controllers.laws.yaw_position import State
from tiltsim_controllers.mathematics.rotation import euler_from_quaternion
from tiltsim_controllers.mathematics.scalar import Floats, Values, Vector, scalar
from tiltsim_controllers.references.trajectories import ReferenceParameters, position_reference
from tiltsim_controllers.vehicle.parameters import Vehicle
from tiltsim_controllers.vehicle.quadrotor_mixer import speed_along_spin, thrust_controls

if TYPE_CHECKING:
    from tiltsim.scenario.flight_plan import FlightPlan

SIZES: Final = Sizes(qpos=7, qvel=6, act=6, ctrl=10)
"""With the thrust and its rate, the states of the yaw-position law."""

LAW_FIELDS: Final = ("extension_thrust", "extension_thrust_rate")
"""The law's own states, ``zeta`` and ``xi``, in a sample."""

EXTENSION_COLUMNS: Final = {
    "extension_thrust": "N",
    "extension_thrust_rate": "N/s",
    "published_determinant": "1",
}


@scalar
def rigid_body_state(qpos: Vector, qvel: Vector, thrust: float, thrust_rate: float) -> State:
    """The laws' state (`tiltsim_controllers.laws.yaw_position.STATE_FIELDS`) from MuJoCo's."""
    x, y, z, qw, qx, qy, qz = qpos
    vx, vy, vz, p, q, r = qvel
    roll, pitch, yaw = euler_from_quaternion(qw, qx, qy, qz)
    return x, y, z, vx, vy, vz, roll, pitch, yaw, p, q, r, thrust, thrust_rate


@scalar
def extended_controls(inputs: Values, vehicle: Vehicle) -> Values:
    """The ten controls for a law's `INPUT_FIELDS`: thrusts, idle rotor states, law states."""
    thrust, roll_torque, pitch_torque, yaw_torque, thrust_derivative, thrust_rate_derivative = (
        inputs
    )
    return (
        *thrust_controls(thrust, roll_torque, pitch_torque, yaw_torque, vehicle),
        *(0.0, 0.0, 0.0, 0.0, thrust_derivative, thrust_rate_derivative),
    )


@scalar
def held_extended_controls(ctrl: Vector, act: Vector) -> Values:
    """Controls as they were sampled: rotors and law states go on with what they were told."""
    return (
        *(ctrl[0], ctrl[1], ctrl[2], ctrl[3], ctrl[4]),
        *(ctrl[5], ctrl[6], ctrl[7], ctrl[8], ctrl[9]),
    )


def extended_activations(plan: FlightPlan, _setup: ControlSetup) -> Values:
    """The extension starts with the thrust of hover, at rest."""
    vehicle = plan.scenario.rotorcraft.resolve()
    return 0.0, 0.0, 0.0, 0.0, vehicle.mass * vehicle.gravity, 0.0


@scalar
def sample_values(body: Vector, thrusts: Vector) -> Values:
    """What a sample holds, from the rigid body's twelve states and the thrust controls."""
    return (
        *(body[0], body[1], body[2], body[3], body[4], body[5]),
        *(body[6], body[7], body[8], body[9], body[10], body[11]),
        *(0.0, 0.0, 0.0, 0.0),
        *(-speed_along_spin(thrusts[0]), speed_along_spin(thrusts[1])),
        *(-speed_along_spin(thrusts[2]), speed_along_spin(thrusts[3])),
        *(0.0, 0.0, 0.0, 0.0),
    )


@scalar
def observe_quadrotor(qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector) -> Values:
    """The rigid body, no tilt, rotor speeds from the thrusts in force."""
    return sample_values(rigid_body_state(qpos, qvel, 0.0, 0.0), ctrl)


@scalar
def observe_equations(state: Vector, inputs: Vector, vehicle: Vehicle) -> Values:
    """The same of ch. 2's equations: thrust and torques in force tell the rotor speeds."""
    return sample_values(
        state, thrust_controls(inputs[0], inputs[1], inputs[2], inputs[3], vehicle)
    )


@scalar
def observe_extended_equations(state: Vector, inputs: Vector, vehicle: Vehicle) -> Values:
    """As `observe_equations`, followed by the law's own states."""
    return (*observe_equations(state, inputs, vehicle), state[12], state[13])


@scalar
def observe_extended_quadrotor(qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector) -> Values:
    """The quadrotor and the law's own states."""
    return (*observe_quadrotor(qpos, qvel, act, ctrl), act[4], act[5])


@scalar
def thrust_tilt_cosine(values: Vector) -> float:
    """The cosine of the thrust axis' tilt, from what `observe_quadrotor` gives."""
    return cos(values[6]) * cos(values[7])


def equations(
    inputs: Callable[..., Values],
    inputs_size: int,
    rates: Callable[..., Values],
    observe: Callable[..., Values],
) -> Equations:
    """A law on ch. 2's equations; the functions are those of `tiltsim.closed_loop.loop.Equations`.

    A law whose inputs go on after thrust and torques has states of its own, which these integrate;
    they start as in MuJoCo.
    """
    law_states = inputs_size - 4

    def initial(plan: FlightPlan, setup: ControlSetup) -> Values:
        extension = extended_activations(plan, setup)[4:][:law_states]
        return (*initial_state(plan.scenario), *extension)

    return Equations(inputs, inputs_size, rates, initial, observe)


@scalar
def thrust_axis_value(values: Vector, parameters: object) -> tuple[float]:
    """What `thrust_axis_check` watches, from what `observe_quadrotor` gives."""
    return (thrust_tilt_cosine(values),)


def extended_loop(
    parameters: type[tuple[Any, ...]],
    controls: Callable[..., Values],
    on_equations: Equations,
    *,
    setup: Callable[[FlightPlan, float], ControlSetup],
    derive: Callable[[Mapping[str, Floats], ControlSetup], dict[str, Floats]],
    watched: Callable[[Mapping[str, float], ControlSetup], tuple[SignCheck, ...]],
    watch: Callable[..., Values],
    own_columns: Mapping[str, str] | None = None,
    follows_position: bool = True,
) -> ClosedLoop:
    """Close the loop around a law that integrates its thrust twice.

    ``own_columns`` are those beyond the `EXTENSION_COLUMNS`, with their units.
    """
    return ClosedLoop(
        kind=ROTORCRAFT,
        model="quadrotor",
        sizes=SIZES,
        parameters=parameters,
        controls=controls,
        refresh=held_extended_controls,
        setup=setup,
        initial_activations=extended_activations,
        observe=observe_extended_quadrotor,
        observes_controls=True,
        derive=derive,
        watched=watched,
        watch=watch,
        uses_gait=False,
        law_states=2,
        law_fields=LAW_FIELDS,
        extra_columns={**EXTENSION_COLUMNS, **(own_columns or {})},
        follows_position=lambda _scenario: follows_position,
        equations=on_equations,
    )


def references(
    samples: Mapping[str, Floats],
    reference: ReferenceParameters,
    knots: Vector,
    attitude: Sequence[object],
) -> dict[str, Floats]:
    """Reference columns; ``attitude`` are those of roll, pitch and yaw, arrays or constants."""
    time = samples["time"]
    position = np.array([position_reference(t, reference, knots)[:3] for t in time.tolist()])
    columns = [*position.reshape(len(time), 3).T]
    columns += [np.broadcast_to(np.asarray(angle, dtype=float), time.shape) for angle in attitude]
    tilts = dict.fromkeys(TILT_REFERENCE_COLUMNS, np.zeros_like(time))
    return dict(zip(REFERENCE_COLUMNS, columns, strict=True)) | tilts


def upright_margin(samples: Mapping[str, Floats]) -> Floats:
    """Smallest rotation (rad) to a roll or pitch of 90 degrees, where both laws are singular.

    Either has the thrust axis level, so it is what the thrust axis lacks to 90 degrees.
    """
    upright = np.cos(samples["roll"]) * np.cos(samples["pitch"])
    return np.asarray(np.arcsin(np.clip(upright, -1.0, 1.0)))


def extended_singularity_columns(
    samples: Mapping[str, Floats], vehicle: Vehicle
) -> dict[str, Floats]:
    """Exact and published determinant of the yaw-position law, and the margin to the exact one."""
    attitude = samples["roll"], samples["pitch"]
    exact = normalized_determinant(*attitude, samples["extension_thrust"], vehicle)
    return {
        "determinant": exact,
        "singularity_margin": upright_margin(samples),
        "published_determinant": published_determinant(*attitude),
        **{name: samples[name] for name in LAW_FIELDS},
    }


def thrust_axis_check(sample: Mapping[str, float]) -> SignCheck:
    """The cosine of the thrust axis' tilt, zero at a roll or pitch of 90 degrees."""
    roll, pitch = sample["roll"], sample["pitch"]
    return SignCheck(
        thrust_tilt_cosine([sample[name] for name in OBSERVED_FIELDS]),
        "the decoupling matrix became singular: the thrust axis came level, "
        f"at roll = {roll:.3g} rad, pitch = {pitch:.3g} rad",
    )
