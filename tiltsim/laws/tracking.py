"""Loops of the laws that follow a planned gait, which a supervisor may change.

A law is one function ``(time, state, tilt_rates, states, parameters, knots, supervisor_motion,
measured)``: rotor accelerations (rad/s^2), rates of its states, references of roll, pitch and
yaw (rad), and further numbers that are columns. With feed-forward of the gait its states are
integrals of the position error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any, Final

from tiltsim.closed_loop.loop import ClosedLoop, SupervisedLaw
from tiltsim.laws.parameters import parameters_of
from tiltsim.laws.rotor_loop import RotorLaw, RotorLayout, rotor_loop
from tiltsim.laws.rotorcraft import REFERENCE_COLUMNS, seen_of
from tiltsim.scenario.multirotor_controllers import AttitudeForceController
from tiltsim.scenario.tiltrotor_controllers import AttitudeAltitudeController
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.laws.multirotor_steps import INTEGRAL_FIELDS
from tiltsim_controllers.laws.supervisor import SUPERVISOR_AT_REST, Supervision
from tiltsim_controllers.mathematics.scalar import Values
from tiltsim_controllers.references.trajectories import position_reference

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan, Scenario

INTEGRALS: Final = dict.fromkeys(INTEGRAL_FIELDS, "m s")
"""States of a law that integrates the position error, with their units."""


def integrals_at_rest(_plan: FlightPlan) -> Values:
    """These states at time zero."""
    return (0.0,) * len(INTEGRALS)


def tracking_parameters(plan: FlightPlan, record: Any, **own: Any) -> Any:
    """The parameters of a law that follows a gait.

    Args:
        plan, record, own: See `parameters_of`.
    """
    scenario, controller = plan.scenario, plan.scenario.controller
    assert isinstance(controller, (AttitudeAltitudeController, AttitudeForceController))
    # The thesis's equations omit the gyroscopic torque.
    terms = controller.resolve_feedforward_terms(
        gyroscopic_torque=scenario.simulation.plant != "thesis"
    )
    return parameters_of(
        plan,
        record,
        gains=controller.resolve_gains(),
        integral=controller.resolve_integral_gains(),
        anticipation=xp.minimum(controller.anticipation, 0.5 * plan.gait.min_segment_time),
        terms=terms,
        **own,
    )


@cache
def _inputs_of(
    layout: RotorLayout, law: Callable[..., Values], states: int, measured: bool
) -> Callable[..., Values]:
    """`SupervisedLaw.inputs`."""
    rotors, tilts = layout.places

    def inputs(
        time: Any,
        state: Any,
        moving: Any,
        own: Any,
        parameters: Any,
        knots: Any,
        motion: Any = SUPERVISOR_AT_REST,
    ) -> Any:
        acceleration = moving[tilts : tilts + 3] if measured else None
        found = law(time, state, moving[:tilts], own, parameters.law, knots, motion, acceleration)
        return found[: rotors + states]

    return inputs


@cache
def _references_of(
    layout: RotorLayout, law: Callable[..., Values], states: int, further: int
) -> Callable[..., Values]:
    """Position, attitude and further numbers; see `SupervisedLaw.references`."""
    rotors, tilts = layout.places
    first = layout.places.speed_1 + rotors
    end = first + tilts
    tracked = slice(rotors + states, rotors + states + 3 + further)  # roll, pitch, yaw and further

    def references(
        time: Any, values: Any, parameters: Any, knots: Any, motion: Any = SUPERVISOR_AT_REST
    ) -> Any:
        own, (state, moving) = parameters.law, (values[:first], values[first:end])
        position = position_reference(time, own.reference, knots)[:3]
        found = law(time, state, moving, values[end : end + states], own, knots, motion)
        return xp.hstack([position, found[tracked]])

    return references


def follows_position(scenario: Scenario) -> bool:
    """Whether a decoupler steers the vehicle to the reference's horizontal position."""
    controller = scenario.controller
    assert isinstance(controller, (AttitudeAltitudeController, AttitudeForceController))
    return controller.decoupler != "none"


def tracking_loop(
    layout: RotorLayout, law: RotorLaw, supervision: Supervision, watched: Callable[..., Any]
) -> ClosedLoop:
    """The closed loop of a law whose planned gait a supervisor may change.

    Args:
        layout: Layout of the vehicles.
        law: Its ``inputs`` are the law itself; its ``names`` end with names of further numbers.
        supervision: The supervisor's code.
        watched: Vehicle parameters that this reads: ``(time, parameters)``.
    """
    code, states, margins = law.inputs, len(law.states), law.margins
    assert margins is not None
    inputs = _inputs_of(layout, code, states, law.measured)
    references = _references_of(layout, code, states, len(law.names) - len(REFERENCE_COLUMNS))
    supervised = SupervisedLaw(
        code=supervision,
        vehicle=watched,
        seen=seen_of(layout.places, states, law.measured),
        inputs=inputs,
        references=references,
        names=law.names,
        fields=(*layout.places.observed_fields, *law.states),
        margins=margins,
    )
    following = law._replace(inputs=inputs, references=references)
    return replace(
        rotor_loop(layout, following), supervised=supervised, follows_position=follows_position
    )
