"""The closed loops with the quadrotor under the laws of ch. 2.

They demand thrust and torques, which the rotors make at once: their speeds follow from the controls
and are not states. The model's four rotor speed states stay at zero.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
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
from tiltsim.equations.quadrotor import equations_of_motion, initial_state
from tiltsim.laws.parameters import head_of, parameters_of
from tiltsim.laws.rotorcraft import REFERENCE_COLUMNS
from tiltsim.vehicles.rotorcraft import ROTORCRAFT
from tiltsim.vehicles.rotorcraft.layout import CROSS
from tiltsim_controllers.analysis.quadrotor_singularity import (
    normalized_determinant,
    published_determinant,
)
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.code.traceable import traceable
from tiltsim_controllers.laws import quadrotor_attitude_altitude, switching, yaw_position
from tiltsim_controllers.mathematics.attitude import euler_angles
from tiltsim_controllers.mathematics.scalar import Floats, Vector
from tiltsim_controllers.references.trajectories import (
    ReferenceParameters,
    reference_attitude,
    reference_motion,
)
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


# --- columns -----------------------------------------------------------------------------------


@traceable
def _reference_pose(time: Any, state: Any, reference: ReferenceParameters, knots: Any) -> Any:
    """Position (m), roll, pitch and yaw (rad) to track, shape (6,)."""
    position = reference_motion(time, reference, knots)[0]
    return xp.hstack([position, reference_attitude(time, reference, knots)[0]])


def references(
    samples: Mapping[str, Floats],
    reference: ReferenceParameters,
    knots: Vector,
    attitude: Sequence[object] = (),
) -> dict[str, Floats]:
    """The columns of references; tilts have zeros.

    Args:
        samples: By field.
        reference, knots: Reference of the position, with its knots.
        attitude: Columns of roll, pitch and yaw (rad): arrays or constants; empty for the
            reference's.
    """
    time = samples["time"]
    states, setup = np.empty((len(time), 0)), ControlSetup(reference, tuple(knots))
    columns = [*evaluate_over_samples(_reference_pose, 6, time, states, setup).T]
    angles, columns = attitude or columns[3:], columns[:3]
    columns += [np.broadcast_to(np.asarray(angle, dtype=float), time.shape) for angle in angles]
    idle = dict.fromkeys(CROSS.names("alpha_ref"), np.zeros_like(time))
    return dict(zip(REFERENCE_COLUMNS, columns, strict=True)) | idle


def upright_margin(samples: Mapping[str, Floats]) -> Floats:
    """Smallest rotation (rad) to a roll or pitch of 90 degrees, singular under both control laws.

    The thrust axis is then level, so the margin is its angle above the horizon.
    """
    upright = np.cos(samples["roll"]) * np.cos(samples["pitch"])
    return np.asarray(np.arcsin(np.clip(upright, -1.0, 1.0)))


def _extended_singularity(samples: Mapping[str, Floats], vehicle: Vehicle) -> dict[str, Floats]:
    """Exact and published determinant of the yaw-position law, and the margin (rad)."""
    attitude = samples["roll"], samples["pitch"]
    exact = normalized_determinant(*attitude, samples["extension_thrust"], vehicle)
    return {
        "determinant": exact,
        "singularity_margin": upright_margin(samples),
        "published_determinant": published_determinant(*attitude),
        **{name: samples[name] for name in EXTENSION_FIELDS},
    }


def _derive_yaw_position(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
    law = setup.parameters.law
    # Roll and pitch are not outputs: they follow from the position.
    attitude = (samples["roll"], samples["pitch"], law.reference.yaw)
    columns = references(samples, law.reference, setup.knots, attitude)
    return columns | _extended_singularity(samples, law.vehicle)


def _derive_attitude_altitude(
    samples: Mapping[str, Floats], setup: ControlSetup
) -> dict[str, Floats]:
    return {
        **references(samples, setup.parameters.law.reference, setup.knots),
        # cos(roll) cos(pitch) of the altitude times 1 / cos(pitch) of the Euler angles
        "determinant": np.cos(samples["roll"]),
        "singularity_margin": upright_margin(samples),
    }


def _derive_switching(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
    law = setup.parameters.law
    reference = law.reference
    inside = switching.in_attitude_zone(samples["roll"], samples["pitch"], law.zone)
    # Outside the zone roll and pitch are not outputs: they follow from the position.
    roll = np.where(inside, reference.roll, samples["roll"])
    pitch = np.where(inside, reference.pitch, samples["pitch"])
    return {
        **references(samples, reference, setup.knots, (roll, pitch, reference.yaw)),
        **_extended_singularity(samples, law.vehicle),
        "attitude_zone": np.asarray(inside, float),
    }


# --- monitoring --------------------------------------------------------------------------------


@traceable
def _thrust_axis(time: Any, values: Any, parameters: Any, knots: Any) -> Any:
    """The cosine of the thrust axis's tilt."""
    return xp.array([xp.cos(values[ROLL]) * xp.cos(values[PITCH])])


@traceable
def _thrust_axis_and_thrust(time: Any, values: Any, parameters: Any, knots: Any) -> Any:
    """The cosine of the thrust axis's tilt and the extension's thrust."""
    return xp.hstack([xp.cos(values[ROLL]) * xp.cos(values[PITCH]), values[24]])


def _thrust_axis_cause(sample: Mapping[str, float], _setup: ControlSetup) -> tuple[str]:
    """Cause for `_thrust_axis`: a roll or pitch of 90 degrees."""
    roll, pitch = sample["roll"], sample["pitch"]
    return (
        "the decoupling matrix became singular: the thrust axis came level, "
        f"at roll = {roll:.3g} rad, pitch = {pitch:.3g} rad",
    )


THRUST_AXIS: Final = Monitoring(_thrust_axis, _thrust_axis_cause)

THRUST_AXIS_AND_THRUST: Final = Monitoring(
    _thrust_axis_and_thrust,
    lambda sample, setup: (
        *_thrust_axis_cause(sample, setup),
        "the decoupling matrix became singular: the thrust came to zero",
    ),
)


# --- loops -------------------------------------------------------------------------------------

Law = Callable[[Any, Any, Any, Any], Any]
"""``(time, state, parameters, knots)``: thrust (N), torques (N m) and rates of own states."""


def _body(qpos: Any, qvel: Any) -> Any:
    """The rigid body's twelve states from MuJoCo's."""
    return xp.hstack([qpos[:3], qvel[:3], euler_angles(qpos[3:7]), qvel[3:6]])


def _sample(body: Any, controls: Any) -> Any:
    """A sample from the rigid body's twelve states and the thrust controls; no tilts."""
    speeds = xp.array(SPIN) * speed_along_spin(controls)
    return xp.hstack([body, xp.zeros(4), speeds, xp.zeros(4)])


@traceable
def _observe(qpos: Any, qvel: Any, act: Any, ctrl: Any) -> Any:
    return xp.hstack([_sample(_body(qpos, qvel), ctrl[:4]), act[4:]])


@traceable
def _rates(
    time: Any, state: Any, inputs: Any, parameters: Any, knots: Any, disturbance: Any
) -> Any:
    """Ch. 2's equations of motion, followed by the law's own states."""
    motion = equations_of_motion(state, inputs, parameters.law.vehicle, disturbance)
    return xp.hstack([motion, inputs[4:]])


@traceable
def _observe_equations(time: Any, state: Any, inputs: Any, parameters: Any, knots: Any) -> Any:
    thrusts = thrust_controls(inputs[:4], parameters.law.vehicle)
    return xp.hstack([_sample(state[:12], thrusts), state[12:]])


def _extension(plan: FlightPlan, own: int) -> tuple[float, ...]:
    """The law's own states begin with the thrust of hover (N), at rest."""
    vehicle = plan.scenario.rotorcraft.resolve()
    return (vehicle.mass * vehicle.gravity, 0.0)[:own]


def _quadrotor_loop(
    parameters_type: Any,
    law: Law,
    columns: Mapping[str, str],
    derive: Callable[[Mapping[str, Floats], ControlSetup], dict[str, Floats]],
    monitoring: Monitoring,
    *,
    own: int,
) -> ClosedLoop:
    """A closed loop around a law that demands thrust and torques.

    Args:
        parameters_type: Type of the parameters of the law.
        law: See `Law`.
        columns: Further columns of a flight, with their units.
        derive, monitoring: See `Columns` and `Monitoring`.
        own: Number of the law's own states: the thrust and its rate, or none.
    """
    fields, record = EXTENSION_FIELDS[:own], head_of(parameters_type)

    def setup(plan: FlightPlan, signature: float) -> ControlSetup:
        law = parameters_of(plan, parameters_type, vehicle=plan.scenario.rotorcraft.resolve())
        return ControlSetup(record(signature, law), plan.knots)

    @traceable
    def controls(time: Any, qpos: Any, qvel: Any, act: Any, parameters: Any, knots: Any) -> Any:
        """Thrusts, idle rotor states, the law's states."""
        state = xp.hstack([_body(qpos, qvel), act[4:]])
        inputs = law(time, state, parameters.law, knots)
        thrusts = thrust_controls(inputs[:4], parameters.law.vehicle)
        return xp.hstack([thrusts, xp.zeros(4), inputs[4:]])

    @traceable
    def equation_inputs(time: Any, state: Any, parameters: Any, knots: Any) -> Any:
        return law(time, state, parameters.law, knots)

    return ClosedLoop(
        kind=ROTORCRAFT,
        parameters=record,
        setup=setup,
        dynamics=Dynamics(
            "quadrotor",
            Sizes(qpos=7, qvel=6, act=4 + own, ctrl=8 + own),
            lambda plan, _setup: (0.0, 0.0, 0.0, 0.0, *_extension(plan, own)),
            controller_states=own,
            commands_thrusts=True,
            spins=SPIN,
        ),
        sampling=Sampling(controls),
        columns=Columns(_observe, derive, fields, columns, observe_reads_controls=True),
        monitoring=monitoring,
        equations=Equations(
            inputs=equation_inputs,
            inputs_size=4 + own,
            rates=_rates,
            initial=lambda plan, _setup: (*initial_state(plan.scenario), *_extension(plan, own)),
            observe=_observe_equations,
        ),
        uses_gait=False,
    )


def _attitude_altitude(time: Any, state: Any, p: Any, knots: Any) -> Any:
    return quadrotor_attitude_altitude.attitude_altitude_inputs(
        time, state, p.vehicle, p.gains, p.reference, knots
    )


YAW_POSITION: Final = _quadrotor_loop(
    yaw_position.Parameters,
    yaw_position.yaw_position_inputs,
    EXTENSION_COLUMNS,
    _derive_yaw_position,
    THRUST_AXIS_AND_THRUST,
    own=2,
)
"""The yaw-position controller of the quadrotor."""

QUADROTOR_ATTITUDE_ALTITUDE: Final = replace(
    _quadrotor_loop(
        quadrotor_attitude_altitude.Parameters,
        _attitude_altitude,
        {},
        _derive_attitude_altitude,
        THRUST_AXIS,
        own=0,
    ),
    follows_position=lambda _scenario: False,
)
"""The attitude-altitude controller of the quadrotor (ch. 2, Appendix B)."""

SWITCHING: Final = replace(
    _quadrotor_loop(
        switching.Parameters,
        switching.switching_inputs,
        {**EXTENSION_COLUMNS, "attitude_zone": "1"},
        _derive_switching,
        THRUST_AXIS,  # the thrust may be anything while the other law is active
        own=2,
    ),
    # In the zone, where the vehicle is meant to end up, the position is free.
    follows_position=lambda _scenario: False,
)
"""Switching between yaw-position and attitude-altitude control of the quadrotor (ch. 2, Sec. 5)."""
