"""The closed loops with the quadrotor under the laws of ch. 2.

They demand thrust and torques, which the rotors make at once: their speeds follow from the controls
and are not states. The model's four rotor speed states stay at zero.
"""

from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Final

import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup
from tiltsim.equations.thesis import equations_of_motion, initial_extended_state
from tiltsim.laws.law import Law
from tiltsim.laws.rotor_loop import REFERENCE_COLUMNS, RotorFunctions, RotorLayout, rotor_loop
from tiltsim.scenario.scenario import FlightPlan
from tiltsim.vehicles.rotorcraft import EXTRA_COLUMNS
from tiltsim_controllers.analysis.singularity import normalized_determinant, published_determinant
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.laws import quadrotor
from tiltsim_controllers.laws.observed import Seen, Step
from tiltsim_controllers.mathematics.scalar import Floats, Vector
from tiltsim_controllers.vehicle.body import BODY_FIELDS, PITCH, ROLL
from tiltsim_controllers.vehicle.cross import speed_along_spin, thrust_controls
from tiltsim_controllers.vehicle.parameters import SPIN

LAYOUT: Final = RotorLayout((-1, -1, -1, -1), SPIN, "quadrotor")

EXTENSION: Final = {"extension_thrust": "N", "extension_thrust_rate": "N/s"}
"""The controller's states, ``zeta`` and ``xi``, with their units."""


class _Thrusting(RotorFunctions):
    """The quadrotor under laws whose inputs are thrust (N) and torques (N m)."""

    commands_thrusts: ClassVar[bool] = True
    state_names: ClassVar[Any] = BODY_FIELDS
    input_names: ClassVar[Any] = ("force", "torque_x", "torque_y", "torque_z")

    def initial_speeds(self, plan: FlightPlan) -> Vector:
        return (0.0,) * 4

    def initial_state(self, plan: FlightPlan) -> Vector:
        return (*initial_extended_state(plan.scenario), *self.law.initial_states(plan))

    def controls(
        self, time: Any, qpos: Any, qvel: Any, act: Any, parameters: Any, knots: Any
    ) -> Any:
        """Thrusts, idle rotor states, rates of the law's states."""
        step = self.law.step(self.in_mujoco(time, qpos, qvel, act), parameters.law, knots)
        thrusts = thrust_controls(step.inputs, parameters.law.vehicle)
        return xp.hstack([thrusts, xp.zeros(4), step.rates])

    def hold(self, time: Any, qpos: Any, qvel: Any, act: Any, ctrl: Any, parameters: Any) -> Any:
        return ctrl

    def with_speeds(self, seen: Seen, thrusts: Any) -> Any:
        """A sample with the rotor speeds of thrust controls."""
        speeds = xp.array(SPIN) * speed_along_spin(thrusts)
        return self.sample(seen._replace(state=xp.hstack([seen.state[:12], speeds])))

    def observe(self, qpos: Any, qvel: Any, act: Any, ctrl: Any) -> Any:
        return self.with_speeds(self.in_mujoco(0.0, qpos, qvel, act), ctrl[:4])

    def in_equations(self, time: Any, state: Any, rates: Any, p: Any, knots: Any) -> Seen:
        """From ch. 2's twelve states and the controller's."""
        return Seen(time, state[:12], xp.zeros(0), state[12 : 12 + len(self.law.states)])

    def equation_rates(
        self, time: Any, state: Any, inputs: Any, parameters: Any, knots: Any, disturbance: Any
    ) -> Any:
        """Ch. 2's equations of motion, followed by the law's own states."""
        motion = equations_of_motion(state, inputs, parameters.law.vehicle, disturbance)
        return xp.hstack([motion, inputs[4:]])

    def observe_equations(
        self, time: Any, state: Any, inputs: Any, parameters: Any, knots: Any
    ) -> Any:
        thrusts = thrust_controls(inputs[:4], parameters.law.vehicle)
        return self.with_speeds(self.in_equations(time, state, None, None, knots), thrusts)


# --- columns and ends of flights ---------------------------------------------------------------


def upright_margin(samples: Mapping[str, Floats]) -> Floats:
    """Smallest rotation (rad) to a roll or pitch of 90 degrees, singular under both control laws.

    The thrust axis is then level, so the margin is its angle above the horizon.
    """
    upright = np.cos(samples["roll"]) * np.cos(samples["pitch"])
    return np.asarray(np.arcsin(np.clip(upright, -1.0, 1.0)))


def upright_columns(samples: Mapping[str, Floats], _parameters: object) -> dict[str, Floats]:
    """Determinant of the attitude-altitude law, and its margin (rad)."""
    # cos(roll) cos(pitch) of the altitude times 1 / cos(pitch) of the Euler angles
    return {"determinant": np.cos(samples["roll"]), "singularity_margin": upright_margin(samples)}


def _extended_singularity(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
    """Exact and published determinant of the yaw-position law, and the margin (rad)."""
    attitude = samples["roll"], samples["pitch"]
    thrust, vehicle = samples["extension_thrust"], setup.parameters.law.vehicle
    return {
        "determinant": normalized_determinant(*attitude, thrust, vehicle),
        "singularity_margin": upright_margin(samples),
        "published_determinant": published_determinant(*attitude),
    }


def _thrust_axis(seen: Seen, _p: Any, _knots: Any) -> Any:
    """The cosine of the thrust axis's tilt."""
    return xp.array([xp.cos(seen.state[ROLL]) * xp.cos(seen.state[PITCH])])


def _thrust_axis_and_thrust(seen: Seen, p: Any, knots: Any) -> Any:
    """The cosine of the thrust axis's tilt and the extension's thrust."""
    return xp.hstack([_thrust_axis(seen, p, knots), seen.states[:1]])


def _thrust_axis_cause(sample: Mapping[str, float], _setup: ControlSetup) -> tuple[str, ...]:
    """Cause for `_thrust_axis`: a roll or pitch of 90 degrees."""
    roll, pitch = sample["roll"], sample["pitch"]
    return (
        "the decoupling matrix became singular: the thrust axis came level, "
        f"at roll = {roll:.3g} rad, pitch = {pitch:.3g} rad",
    )


# --- loops -------------------------------------------------------------------------------------


def _tracked(seen: Seen, p: Any) -> Any:
    """The attitude of the yaw-position law (rad): roll and pitch follow from the position."""
    return xp.hstack([seen.state[ROLL], seen.state[PITCH], p.reference.yaw])


def _attitude_altitude(seen: Seen, p: Any, knots: Any) -> Step:
    return Step(
        quadrotor.attitude_altitude_inputs(
            seen.time, seen.state, p.vehicle, p.gains, p.reference, knots
        )
    )


def _yaw_position(seen: Seen, p: Any, knots: Any) -> Step:
    state = xp.hstack([seen.state[:12], seen.states])
    inputs = quadrotor.yaw_position_inputs(seen.time, state, p, knots)
    return Step(inputs[:4], inputs[4:], _tracked(seen, p))


def _switching(seen: Seen, p: Any, knots: Any) -> Step:
    state, reference = xp.hstack([seen.state[:12], seen.states]), p.reference
    inputs = quadrotor.switching_inputs(seen.time, state, p, knots)
    inside = quadrotor.in_attitude_zone(state[ROLL], state[PITCH], p.zone)
    demanded = xp.array([reference.roll, reference.pitch, reference.yaw])
    tracked = xp.where(inside, demanded, _tracked(seen, p))
    return Step(inputs[:4], inputs[4:], xp.hstack([tracked, xp.where(inside, 1.0, 0.0)]))


def _extension(plan: FlightPlan) -> tuple[float, ...]:
    """The law's own states begin with the thrust of hover (N), at rest."""
    vehicle = plan.scenario.rotorcraft.resolve()
    return vehicle.mass * vehicle.gravity, 0.0


def _loop(step: Callable[[Seen, Any, Any], Step], record: Any, **options: Any) -> ClosedLoop:
    common = {"columns": (*EXTRA_COLUMNS,), "signs": _thrust_axis, "causes": _thrust_axis_cause}
    return rotor_loop(LAYOUT, Law(step, record, **{**common, **options}), _Thrusting)


YAW_POSITION: Final = _loop(
    _yaw_position,
    quadrotor.YawPositionParameters,
    states=EXTENSION,
    initial=_extension,
    signals=REFERENCE_COLUMNS[3:],
    units={"published_determinant": "1"},
    margins=_extended_singularity,
    signs=_thrust_axis_and_thrust,
    causes=lambda sample, setup: (
        *_thrust_axis_cause(sample, setup),
        "the decoupling matrix became singular: the thrust came to zero",
    ),
)
"""The yaw-position controller of the quadrotor."""

QUADROTOR_ATTITUDE_ALTITUDE: Final = _loop(
    _attitude_altitude,
    quadrotor.AttitudeAltitudeParameters,
    margins=upright_columns,
    follows_position=lambda _scenario: False,
)
"""The attitude-altitude controller of the quadrotor (ch. 2, Appendix B)."""

SWITCHING: Final = _loop(
    _switching,
    quadrotor.SwitchingParameters,
    states=EXTENSION,
    initial=_extension,
    signals=(*REFERENCE_COLUMNS[3:], "attitude_zone"),
    units={"published_determinant": "1", "attitude_zone": "1"},
    margins=_extended_singularity,
    # In the zone, where the vehicle is meant to end up, position and thrust are free.
    follows_position=lambda _scenario: False,
)
"""Switching between yaw-position and attitude-altitude control of the quadrotor (ch. 2, Sec. 5)."""
