"""Parameters of a law in a flight: numbers of its keys, its vehicle, gait and reference."""

from functools import cache
from typing import Any, Final

from tiltsim.scenario.multirotor_controllers import AttitudeForceController
from tiltsim.scenario.scenario import FlightPlan, Scenario
from tiltsim.scenario.tiltrotor_controllers import AttitudeAltitudeController
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.laws.keys import number_of
from tiltsim_controllers.laws.multirotor_steps import INTEGRAL_FIELDS
from tiltsim_controllers.mathematics.records import make_record_type

INTEGRALS: Final = dict.fromkeys(INTEGRAL_FIELDS, "m s")
"""States of a law that integrates the position error, with their units."""


@cache
def head_of(law: Any, **own: type) -> Any:
    """The type of the head of `userdata`, around the parameters of a law.

    Args:
        law: Type of these parameters.
        own: Further fields, such as ``servo_lead``: rate feed-forward of the tilt servos, s,
            ``2 zeta / omega_n``.
    """
    # The signature is `tiltsim.closed_loop.loop.ClosedLoop.signature`.
    return make_record_type("LoopParameters", signature=float, **own, law=law)


def parameters_of(plan: FlightPlan, record: Any, **own: Any) -> Any:
    """The parameters of a flight's law.

    Args:
        plan: Plan of the flight.
        record: Their type, see `tiltsim_controllers.laws.keys.record_of`.
        own: Values of fields that are neither keys nor parts of the plan.
    """
    known = {
        "gait": plan.gait.parameters,
        "reference": plan.reference,
        "rotors": float(len(plan.knots)),  # where the law's tables follow in the knots
        **own,
    }
    controller = plan.scenario.controller
    return record(
        *(known[key] if key in known else number_of(controller, key) for key in record._fields)
    )


def tracking_parameters(plan: FlightPlan, record: Any, **own: Any) -> Any:
    """The parameters of a law with feed-forward of a gait.

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


def integrals_at_rest(_plan: FlightPlan) -> tuple[float, ...]:
    """The states `INTEGRALS` at time zero."""
    return (0.0,) * len(INTEGRALS)


def decouples_position(scenario: Scenario) -> bool:
    """Whether a decoupler steers the vehicle to the reference's horizontal position."""
    controller = scenario.controller
    assert isinstance(controller, (AttitudeAltitudeController, AttitudeForceController))
    return controller.decoupler != "none"
