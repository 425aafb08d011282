"""Scalar laws of scenarios: built-in ones, and functions of users, checked before flights."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any

from tiltsim.errors import InputError
from tiltsim.laws.airframe import airframe_of
from tiltsim.laws.rotor_loop import layout_of_vehicle
from tiltsim.laws.scalar_loop import scalar_loop
from tiltsim.laws.scalar_parameters import Key
from tiltsim.scenario.controller import ScalarFunctionController
from tiltsim.scenario.messages import InvalidValueError
from tiltsim.scenario.own_code import describe, load_scalar_function
from tiltsim.scenario.scalar_controller import ScalarController
from tiltsim.scenario.scenario import plan_flight
from tiltsim.vehicles.rotorcraft import initial_tilts
from tiltsim_controllers.laws.observed import Observed
from tiltsim_controllers.mathematics.rotation import quaternion_from_euler
from tiltsim_controllers.mathematics.scalar import Values, scalar

if TYPE_CHECKING:
    from tiltsim.closed_loop.loop import ClosedLoop
    from tiltsim.scenario.scenario import FlightPlan, Scenario


@cache
def _without_parameters(function: Callable[..., Any]) -> Callable[..., Any]:
    """A user's function of what it sees as a law with parameters, of which it has none."""

    @scalar
    def own_law(observed: Observed, parameters: Any) -> tuple[Values, Values, Values]:
        return function(observed)  # type: ignore[no-any-return]

    return own_law


def _not_read(_observed: Observed, _parameters: Any) -> tuple[Values, Values, Values]:
    """In place of the user's function in a recorded flight, which needs no law any more."""
    raise AssertionError("a recorded flight was flown")


def loop_of_scalar_law(scenario: Scenario, *, recorded: bool = False) -> ClosedLoop:
    """The closed loop of a scenario's scalar law, without layers; see `assemble` on ``recorded``.

    Raises `InputError` for a law of a package or of the user's that does not return what it should.
    """
    plan = plan_flight(scenario)
    controller, airframe = scenario.controller, airframe_of(plan)
    law: Callable[..., Any]
    is_foreign = True
    if isinstance(controller, ScalarFunctionController) and recorded:
        law, is_foreign = _not_read, False
    elif isinstance(controller, ScalarFunctionController):
        law = _without_parameters(load_scalar_function(scenario))
    else:
        assert isinstance(controller, ScalarController)
        law = controller.scalar_law(airframe)
        is_foreign = not law.__module__.startswith(("tiltsim.", "tiltsim_controllers."))
    try:
        parameters = controller.law_parameters(airframe)
    except InvalidValueError as error:  # found only with the vehicle and its gait at hand
        raise InputError(f"{scenario.address or 'scenario'}: {error}") from error
    key = Key(
        layout_of_vehicle(airframe.vehicle, scenario.vehicle.model),
        law,
        controller.law,
        type(parameters),
        tuple(controller.state_units(airframe).items()),
        controller.commands_tilts,
        scenario.simulation.latency_steps > 0,
    )
    loop = scalar_loop(key)
    if is_foreign:
        _try_once(loop, plan)
    return loop


def _try_once(loop: ClosedLoop, plan: FlightPlan) -> None:
    """Evaluate a control step at time zero, so that mistakes in a law are found before the flight.

    Raises `InputError`.
    """
    scenario, setup = plan.scenario, loop.setup(plan, loop.signature)
    initial = scenario.initial
    tilts, rates = initial_tilts(plan) if scenario.vehicle.has_tilting_rotors else ((), ())
    qpos = (*initial.position, *quaternion_from_euler(*initial.attitude), *tilts)
    qvel = (*initial.velocity, *initial.angular_velocity, *rates)
    act = tuple(map(float, loop.dynamics.initial_activations(plan, setup)))
    start = f'{scenario.address or "scenario"}: controller.law = "{scenario.controller.law}"'
    rotors, states = len(loop.dynamics.spins), loop.dynamics.controller_states
    requirement = (
        f"{start}: the law must return {rotors} thrusts (N), the tilts (rad) if it commands them, "
        f"and the rates of its states: three tuples of floats"
    )
    try:
        ctrl = loop.sampling.controls(0.0, qpos, qvel, act, setup.parameters, setup.knots)
    except Exception as error:
        calls = 3 + isinstance(scenario.controller, ScalarFunctionController)  # before the law
        if len(traceback.extract_tb(error.__traceback__)) <= calls:
            raise InputError(f"{requirement} ({describe(error, calls)})") from error
        raise InputError(f"{start}: the law raised {describe(error, calls)}") from error
    if len(ctrl) != loop.dynamics.sizes.ctrl or not all(isinstance(v, float) for v in ctrl):
        raise InputError(f"{requirement}; with {states} states they make {len(ctrl)} controls")
