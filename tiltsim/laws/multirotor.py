"""The controller of attitude and force in closed loops with multirotors of any layout."""

from collections.abc import Mapping
from functools import cache
from typing import Any, Final

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup
from tiltsim.laws.law import (
    INTEGRALS,
    Law,
    decouples_position,
    integrals_at_rest,
    supervised,
    tracking_parameters,
)
from tiltsim.laws.rotor_loop import (
    CONDITION,
    RotorLayout,
    body_of_vehicle,
    layout_of_vehicle,
    rotor_loop,
    rotor_stops,
    singular_attitude,
    table_of,
    torque_free_columns,
)
from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.multirotor_controllers import AttitudeForceController, upper_side
from tiltsim.scenario.scenario import FlightPlan, Scenario
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.laws.allocation import RotorRange
from tiltsim_controllers.laws.attitude_altitude import PUBLISHED_DECOUPLING
from tiltsim_controllers.laws.gait_feedforward import multirotor_law_of, prioritized
from tiltsim_controllers.laws.multirotor import NULL_PART, SIGNALS, independence, present_wrench
from tiltsim_controllers.laws.multirotor_steps import Direction, Form, Parameters
from tiltsim_controllers.laws.observed import Seen
from tiltsim_controllers.laws.supervised_vehicles import Watched, multirotor_supervision_of, watched
from tiltsim_controllers.laws.supervisor import Supervisor
from tiltsim_controllers.mathematics.scalar import Floats, Values
from tiltsim_controllers.vehicle.effectiveness import without_rotor
from tiltsim_controllers.vehicle.states import state_of

REVERSING: Final = 'controller.norm = "thrust", with which rotors reverse'
"""The remedy where a rotor would have to reverse."""


def _setup(plan: FlightPlan) -> tuple[Any, Values]:
    scenario, gait = plan.scenario, plan.gait
    controller, vehicle = scenario.controller, scenario.vehicle.resolve()
    assert isinstance(controller, AttitudeForceController)
    assert isinstance(vehicle, Multirotor)
    dimension = controller.resolve_force(vehicle, gait).dimension
    side, lost = upper_side(vehicle, gait), controller.failed_rotor
    side_without = side if lost is None else upper_side(vehicle, gait, lost)
    law = tracking_parameters(
        plan,
        Parameters,
        vehicle=body_of_vehicle(vehicle),
        side_integral=0.0,
        watched=Watched(),
        watched_without=Watched(),
        supervisor=Supervisor(),
        restoring=controller.resolve_restoring(len(vehicle.spins), dimension, gait),
        failure=controller.resolve_failure(),
        limits=RotorRange(
            *scenario.any_rotorcraft.speeds_along_spin, controller.allocation_horizon
        ),
        upper_side=Direction(*side),
        upper_side_without=Direction(*side_without),
    )
    if controller.supervision is None:
        return law, vehicle.table
    table, known = vehicle.table, watched(vehicle.table, len(plan.knots), side)
    law = law._replace(supervisor=controller.resolve_supervisor(vehicle), watched=known)
    if lost is None:
        return law, table
    x, y, z = side_without
    others = known._replace(rotors=known.rotors + len(table), side_x=x, side_y=y, side_z=z)
    return law._replace(watched_without=others), (*table, *without_rotor(table, lost))


@cache
def multirotor_loop(
    layout: RotorLayout, form: Form, measured: bool, strategy: str, limited: bool
) -> ClosedLoop:
    """The closed loop of all multirotors of a layout.

    Args:
        layout: Layout of the vehicles.
        form: Options of the law.
        measured, strategy, limited: See `tiltsim.laws.tiltrotor.tiltrotor_loop`.
    """
    rotors, places = layout.tilt_of_rotor, layout.places
    turning = places.rotors if form.norm == "speed" else 0  # else they may stop
    stops = rotor_stops(turning, REVERSING)

    def margins(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
        failure, table = setup.parameters.law.failure, table_of(places, setup)
        return torque_free_columns(places, table, samples, form.dimension, failure)

    def signs(seen: Seen, p: Any, knots: Any) -> Any:
        """Independence of the outputs and, in the norm of the speeds, the rotors' speeds."""
        side, without = xp.array(p.upper_side), xp.array(p.upper_side_without)
        rows, up = present_wrench(seen, p, knots, rotors)
        side = xp.where(seen.time >= p.failure.known_from, without, side)
        speeds = state_of(seen.state, rotors).speeds[:turning]
        if p.decoupling == PUBLISHED_DECOUPLING:  # the factor 2 |varpi| is in rows of force only
            speeds = xp.ones(turning)
        return xp.hstack([independence(rows, up, side, form), speeds])

    def causes(sample: Mapping[str, float], setup: ControlSetup) -> tuple[str, ...]:
        failure = setup.parameters.law.failure
        attitude = singular_attitude(sample, places.names("alpha"))
        if sample["time"] >= failure.known_from:
            attitude += f", without rotor {failure.rotor:g}"
        return (attitude, *stops)

    step = multirotor_law_of(rotors, form)
    law = Law(
        prioritized(step, rotors) if limited else step,
        Parameters,
        _setup,
        states=INTEGRALS,
        initial=integrals_at_rest,
        signals=SIGNALS,
        units={NULL_PART: "1", CONDITION: "1"},
        margins=margins,
        signs=signs,
        causes=causes,
        measured=measured,
        follows_position=decouples_position,
    )
    supervision = multirotor_supervision_of(rotors, form.dimension, form.forward)
    return rotor_loop(layout, supervised(law, supervision, strategy))


def loop_of_multirotor(scenario: Scenario, measured: bool, strategy: str) -> ClosedLoop:
    """The `multirotor_loop` of a scenario, without layers."""
    controller, vehicle = scenario.controller, scenario.vehicle.resolve()
    assert isinstance(controller, AttitudeForceController)
    assert isinstance(vehicle, Multirotor)
    form = controller.resolve_force(vehicle, scenario.gait.plan(vehicle))
    limited = controller.prioritizes_attitude
    return multirotor_loop(layout_of_vehicle(vehicle), form, measured, strategy, limited)
