"""Loops of the laws that follow a planned gait, which a supervisor may change.

Those with feed-forward of the gait integrate the position error. Their control law is one function,
``(time, state, tilt_rates, integrals, parameters, knots, supervisor_motion, measured)``: rotor
accelerations (rad/s^2), rates of the integrals (m), the references of roll, pitch and yaw (rad),
and further numbers that are columns.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any, Final

from tiltsim.closed_loop.loop import ClosedLoop, SupervisedLaw
from tiltsim.laws.rotor_loop import RotorLaw, RotorLayout, rotor_loop
from tiltsim.laws.rotorcraft import REFERENCE_COLUMNS, seen_of
from tiltsim.scenario.multirotor_controllers import AttitudeForceController
from tiltsim.scenario.tiltrotor_controllers import AttitudeAltitudeController
from tiltsim_controllers.laws.decouplers import DECOUPLERS
from tiltsim_controllers.laws.gait_feedforward import INTEGRAL_FIELDS
from tiltsim_controllers.laws.supervisor import SUPERVISOR_AT_REST, Supervision
from tiltsim_controllers.mathematics.scalar import Triple, Values, Vector, scalar
from tiltsim_controllers.mathematics.vectors import entries_of
from tiltsim_controllers.references.trajectories import position_reference

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan, Scenario

STATES: Final = len(INTEGRAL_FIELDS)
"""The controller's own, after the rotor speeds."""


def tracking_fields(plan: FlightPlan) -> dict[str, Any]:
    """The parameters that controllers with feed-forward of the gait share, by name."""
    controller, gait = plan.scenario.controller, plan.gait
    assert isinstance(controller, (AttitudeAltitudeController, AttitudeForceController))
    # The thesis's equations omit the gyroscopic torque.
    gyroscopic_torque = plan.scenario.simulation.plant != "thesis"
    return {
        "gains": controller.resolve_gains(),
        "integral": controller.resolve_integral_gains(),
        "max_acceleration": controller.max_acceleration,
        "max_angular_acceleration": controller.max_angular_acceleration,
        "anticipation": min(controller.anticipation, 0.5 * gait.min_segment_time),
        "terms": controller.resolve_feedforward_terms(gyroscopic_torque=gyroscopic_torque),
        "gait": gait.parameters,
        "reference": plan.reference,
        "decoupler": DECOUPLERS[controller.decoupler],
    }


@scalar
def _by_model(moving: Values) -> None:
    """For a law that computes the angular acceleration by its model."""
    return


@cache
def _inputs_of(
    layout: RotorLayout, law: Callable[..., Values], measured: bool
) -> Callable[..., Values]:
    """Scalar code of `SupervisedLaw.inputs`: the ``states`` are the integrals."""
    rotors, tilts = layout.places
    tilt_rates_in, inputs_in = entries_of(0, tilts), entries_of(0, rotors + STATES)
    acceleration_in = entries_of(tilts, 3) if measured else _by_model

    @scalar
    def inputs(
        time: float,
        state: Values,
        moving: Values,
        states: Values,
        parameters: Any,
        knots: Vector,
        motion: Triple = SUPERVISOR_AT_REST,
    ) -> Values:
        rates, acceleration = tilt_rates_in(moving), acceleration_in(moving)
        found: Values = inputs_in(
            law(time, state, rates, states, parameters.law, knots, motion, acceleration)
        )
        return found

    return inputs


@cache
def _references_of(
    layout: RotorLayout, law: Callable[..., Values], further: int
) -> Callable[..., Values]:
    """Scalar code of position, attitude and further numbers; see `SupervisedLaw.references`."""
    rotors, tilts = layout.places
    first = layout.places.speed_1 + rotors
    state_in, rates_of_sample = entries_of(0, first), entries_of(first, tilts)
    integrals_of_sample = entries_of(first + tilts, STATES)
    asked_in = entries_of(rotors + STATES, 3 + further)  # roll, pitch, yaw and what follows

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
        moving, integrals = rates_of_sample(values), integrals_of_sample(values)
        inputs = law(time, state_in(values), moving, integrals, own, knots, motion)
        return (x, y, z, *asked_in(inputs))

    return references


def follows_position(scenario: Scenario) -> bool:
    """Whether a decoupler steers the vehicle to the reference's horizontal position."""
    controller = scenario.controller
    assert isinstance(controller, (AttitudeAltitudeController, AttitudeForceController))
    return controller.decoupler != "none"


def supervised_loop(
    layout: RotorLayout, law: RotorLaw, supervision: Supervision, watched: Callable[..., Any]
) -> ClosedLoop:
    """The closed loop of a law whose planned gait a supervisor may change.

    Args:
        layout: Of the vehicles.
        law: Its ``inputs`` and ``references`` are those of a `SupervisedLaw`, with the
            supervisor at rest by default.
        supervision: The supervisor's code.
        watched: What this reads of a vehicle: ``(time, parameters)``.
    """
    references, margins = law.references, law.margins
    assert references is not None
    assert margins is not None
    supervised = SupervisedLaw(
        code=supervision,
        vehicle=watched,
        seen=seen_of(layout.places, len(law.states), law.measured),
        inputs=law.inputs,
        references=references,
        names=law.names,
        fields=(*layout.places.observed_fields, *law.states),
        margins=margins,
    )
    return replace(
        rotor_loop(layout, law), supervised=supervised, follows_position=follows_position
    )


def tracking_loop(
    layout: RotorLayout, law: RotorLaw, supervision: Supervision, watched: Callable[..., Any]
) -> ClosedLoop:
    """The closed loop of a law with feed-forward of the gait.

    Args:
        layout, supervision, watched: As of `supervised_loop`.
        law: Its ``inputs`` are the law itself; its ``names`` end with those of further numbers.
    """
    code = law.inputs
    following = law._replace(
        inputs=_inputs_of(layout, code, law.measured),
        states=dict.fromkeys(INTEGRAL_FIELDS, "m s"),
        initial=lambda _plan: (0.0,) * STATES,
        references=_references_of(layout, code, len(law.names) - len(REFERENCE_COLUMNS)),
    )
    return supervised_loop(layout, following, supervision, watched)
