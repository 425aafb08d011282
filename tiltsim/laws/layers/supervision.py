"""A supervisor around the laws that fly a planned gait: loops with its states and its column."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

import tiltsim.laws.attitude_altitude as attitude_altitude
import tiltsim.laws.gait_feedforward as gait_feedforward
from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup
from tiltsim.laws.attitude_altitude import TILTROTOR
from tiltsim.laws.gait_feedforward import GAIT_FEEDFORWARD
from tiltsim.laws.tiltrotor import (
    TILT_REFERENCE_COLUMNS,
    reference_columns,
    rotor_thrust_controls,
    singularity_columns,
    tiltrotor_state,
)
from tiltsim_controllers.gaits.parameters import GaitParameters
from tiltsim_controllers.gaits.tilts import tilt_reference
from tiltsim_controllers.laws.attitude_altitude import STATE_FIELDS
from tiltsim_controllers.laws.supervisor import (
    HOLD,
    Supervisor,
    gait_time,
    planned_tilts,
    supervised_derivative,
    supervised_gait_scale,
    supervised_tilts,
)
from tiltsim_controllers.mathematics.rotation import euler_from_quaternion
from tiltsim_controllers.mathematics.scalar import Floats, Quad, Triple, Values, Vector, scalar
from tiltsim_controllers.vehicle.parameters import drag_ratio

if TYPE_CHECKING:
    from tiltsim.scenario.flight_plan import FlightPlan

SUPERVISION: Final = "supervision"
"""A column: how much the supervisor does, 0 nothing to 1 all it can.

It is the share of the gait's angles or of its speed that is taken away, or of the way to red.
"""

SUPERVISOR_FIELDS: Final = ("supervisor_state", "supervisor_rate")
"""States of a supervisor that has any: see `tiltsim_controllers.laws.supervisor`."""

_STATE_UNITS: Final = {"hold": ("s", "1"), "return_to_red": ("1", "1/s")}


class _Law(NamedTuple):
    """What a supervisor needs to know of a law; the functions are scalar code.

    ``supervisor_motion`` is the supervisor's state with its rate and acceleration, ``state`` the
    law's as of `tiltrotor_state`.
    """

    supervisor: Callable[[Any], Supervisor]  # of the loop's parameters
    rates: Callable[..., Values]
    """``(time, state, qvel, act, supervisor_motion, parameters, knots)``: the controls from the
    rotor accelerations on."""
    references: Callable[..., Values]
    """``(time, seen, supervisor_motion, parameters, knots)``: `tiltrotor.REFERENCE_COLUMNS`."""
    seen: tuple[str, ...]  # the fields of a sample that the references need


@scalar
def _beside_law(parameters: Any) -> Supervisor:
    supervisor: Supervisor = parameters.supervisor
    return supervisor


@scalar
def _within_law(parameters: Any) -> Supervisor:
    supervisor: Supervisor = parameters.law.supervisor
    return supervisor


_LAWS: Final = {
    TILTROTOR: _Law(
        _beside_law,
        attitude_altitude.law_rates,
        attitude_altitude.supervised_reference_values,
        STATE_FIELDS,
    ),
    GAIT_FEEDFORWARD: _Law(
        _within_law,
        gait_feedforward.law_rates,
        gait_feedforward.supervised_reference_values,
        gait_feedforward.SEEN,
    ),
}


@scalar
def supervised_commands(
    time: float,
    supervisor_motion: Triple,
    gait: GaitParameters,
    knots: Vector,
    supervisor: Supervisor,
    ratio: float,
    lead: float,
) -> Quad:
    """Commands (rad) of the tilt servos under a supervisor with states.

    See `tiltsim_controllers.laws.supervisor`; ``supervisor_motion`` is its state with rate and
    acceleration, ``ratio`` the vehicle's drag ratio.
    """
    clock = gait_time(time, supervisor_motion, supervisor)
    planned = planned_tilts(clock, gait, knots)
    a1, a2, a3, a4 = supervised_tilts(planned, 1.0, supervisor_motion, supervisor, ratio)
    return (a1[0] + lead * a1[1], a2[0] + lead * a2[1], a3[0] + lead * a3[1], a4[0] + lead * a4[1])


@scalar
def scaled_share(
    time: float, roll: float, pitch: float, law: Any, supervisor: Supervisor, knots: Vector
) -> float:
    """The `supervised_gait_scale` of the gait that a ``law`` flies."""
    planned = tilt_reference(time, law.gait, knots)
    return supervised_gait_scale(planned, roll, pitch, supervisor, law.vehicle)


@cache
def _scaling(loop: ClosedLoop) -> ClosedLoop:
    """The loop of a law under a supervisor that scales the gait: it has no states."""
    supervisor_of, inner_controls = _LAWS[loop].supervisor, loop.controls

    @scalar
    def controls(
        time: float, qpos: Vector, qvel: Vector, act: Vector, parameters: Any, knots: Vector
    ) -> Values:
        planned = inner_controls(time, qpos, qvel, act, parameters, knots)
        roll, pitch, _yaw = euler_from_quaternion(qpos[3], qpos[4], qpos[5], qpos[6])
        supervisor = supervisor_of(parameters)
        share = scaled_share(time, roll, pitch, parameters.law, supervisor, knots)
        return (
            *(share * planned[0], share * planned[1], share * planned[2], share * planned[3]),
            *planned[4:],
        )

    def derive(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
        columns = loop.derive(samples, setup)
        share = _shares(samples, setup, supervisor_of(setup.parameters))
        return (
            columns
            | {name: share * columns[name] for name in TILT_REFERENCE_COLUMNS}
            | {SUPERVISION: 1.0 - share}
        )

    controls.__qualname__ = f"scaling.{loop.controls.__qualname__}"
    return replace(loop, controls=controls, derive=derive, equations=None)


def _shares(samples: Mapping[str, Floats], setup: ControlSetup, supervisor: Supervisor) -> Floats:
    attitudes = zip(samples["time"].tolist(), samples["roll"].tolist(), samples["pitch"].tolist())
    law, knots = setup.parameters.law, setup.knots
    return np.array([scaled_share(*attitude, law, supervisor, knots) for attitude in attitudes])


@cache
def _with_states(loop: ClosedLoop) -> ClosedLoop:
    """The loop of a law under a supervisor that holds the gait or returns to red.

    The supervisor's two states follow those of the law.
    """
    supervisor_of, law_rates, references, fields = _LAWS[loop]
    inner_observe, first, seen = loop.observe, loop.sizes.act, len(fields)

    @scalar
    def controls(
        time: float, qpos: Vector, qvel: Vector, act: Vector, parameters: Any, knots: Vector
    ) -> Values:
        law, supervisor = parameters.law, supervisor_of(parameters)
        state = tiltrotor_state(qpos, qvel, act)
        ratio, lead = drag_ratio(law.vehicle), parameters.servo_lead
        supervisor_motion = supervised_derivative(
            *(time, state[6], state[7], act[first], act[first + 1]),
            *(law.gait, knots, supervisor, ratio),
        )
        return (
            *supervised_commands(time, supervisor_motion, law.gait, knots, supervisor, ratio, lead),
            *rotor_thrust_controls(act),
            *law_rates(time, state, qvel, act, supervisor_motion, parameters, knots),
            *(supervisor_motion[1], supervisor_motion[2]),
        )

    @scalar
    def observe(qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector) -> Values:
        return (*inner_observe(qpos, qvel, act, ctrl), act[first], act[first + 1])

    @scalar
    def reference_values(time: float, state: Vector, parameters: Any, knots: Vector) -> Values:
        law, supervisor = parameters.law, supervisor_of(parameters)
        supervisor_motion = (state[seen], state[seen + 1], 0.0)
        ratio = drag_ratio(law.vehicle)
        return (
            *references(time, state, supervisor_motion, parameters, knots),
            *supervised_commands(time, supervisor_motion, law.gait, knots, supervisor, ratio, 0.0),
        )

    def derive(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
        states = (*fields, *SUPERVISOR_FIELDS)
        columns = reference_columns(reference_values, states, samples, setup)
        held, rate = (samples[name] for name in SUPERVISOR_FIELDS)
        supervision = rate if supervisor_of(setup.parameters).strategy == HOLD else held
        return (
            columns
            | singularity_columns(samples, setup.parameters.law.vehicle)
            | {SUPERVISION: supervision}
        )

    def initial_activations(plan: FlightPlan, setup: ControlSetup) -> Vector:
        return (*loop.initial_activations(plan, setup), 0.0, 0.0)

    controls.__qualname__ = f"supervised.{loop.controls.__qualname__}"
    return replace(
        loop,
        sizes=loop.sizes._replace(act=first + 2, ctrl=loop.sizes.ctrl + 2),
        controls=controls,
        initial_activations=initial_activations,
        observe=observe,
        derive=derive,
        equations=None,
        law_states=loop.law_states + 2,
        law_fields=(*loop.law_fields, *SUPERVISOR_FIELDS),
    )


@cache
def with_supervisor(loop: ClosedLoop, strategy: str) -> ClosedLoop:
    """The loop of a law under a supervisor with the given strategy.

    Raises KeyError where the law flies no planned gait.
    """
    units = dict(zip(SUPERVISOR_FIELDS, _STATE_UNITS.get(strategy, ())))
    inner = _with_states(loop) if units else _scaling(loop)
    return replace(inner, extra_columns={**inner.extra_columns, **units, SUPERVISION: "1"})
