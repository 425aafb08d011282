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
from tiltsim_controllers.laws.multirotor_steps import INTEGRAL_FIELDS
from tiltsim_controllers.laws.supervisor import SUPERVISOR_AT_REST, Supervision
from tiltsim_controllers.mathematics.scalar import Triple, Values, Vector, scalar
from tiltsim_controllers.mathematics.vectors import entries_of
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
        anticipation=min(controller.anticipation, 0.5 * plan.gait.min_segment_time),
        terms=terms,
        **own,
    )


@scalar
def _by_model(moving: Values) -> None:
    """For a law that computes the angular acceleration by its model."""
    return


@cache
def _inputs_of(
    layout: RotorLayout, law: Callable[..., Values], states: int, measured: bool
) -> Callable[..., Values]:
    """Scalar code of `SupervisedLaw.inputs`."""
    rotors, tilts = layout.places
    tilt_rates_in, inputs_in = entries_of(0, tilts), entries_of(0, rotors + states)
    acceleration_in = entries_of(tilts, 3) if measured else _by_model

    @scalar
    def inputs(
        time: float,
        state: Values,
        moving: Values,
        own: Values,
        parameters: Any,
        knots: Vector,
        motion: Triple = SUPERVISOR_AT_REST,
    ) -> Values:
        rates, acceleration = tilt_rates_in(moving), acceleration_in(moving)
        found: Values = inputs_in(
            law(time, state, rates, own, parameters.law, knots, motion, acceleration)
        )
        return found

    return inputs


@cache
def _references_of(
    layout: RotorLayout, law: Callable[..., Values], states: int, further: int
) -> Callable[..., Values]:
    """Scalar code of position, attitude and further numbers; see `SupervisedLaw.references`."""
    rotors, tilts = layout.places
    first = layout.places.speed_1 + rotors
    state_in, rates_of_sample = entries_of(0, first), entries_of(first, tilts)
    states_of_sample = entries_of(first + tilts, states)
    tracked_in = entries_of(rotors + states, 3 + further)  # roll, pitch, yaw and all that follows

    @scalar
    def references(
        time: float,
        values: Vector,
        parameters: Any,
        knots: Vector,
        motion: Triple = SUPERVISOR_AT_REST,
    ) -> Values:
        own = parameters.law
        x, y, z, _, _, _, _, _, _ = position_reference(time, own.reference, knots)
        moving, states_now = rates_of_sample(values), states_of_sample(values)
        found = law(time, state_in(values), moving, states_now, own, knots, motion)
        return (x, y, z, *tracked_in(found))

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
