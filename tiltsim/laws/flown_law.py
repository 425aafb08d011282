"""Laws of scenarios, built-in, from packages or from users, checked before flights."""

from collections.abc import Callable
from functools import cache
from typing import Any

from pydantic import ValidationError

from tiltsim.closed_loop.assembly import ProgramKey, choices_of
from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup
from tiltsim.engines.programs import control_program
from tiltsim.errors import InputError
from tiltsim.laws.law_loop import NO_PARAMETERS, REMEDY, FlownLaw, LawError, airframe_of, law_loop
from tiltsim.laws.layers.instruments import instruments_of, with_instruments
from tiltsim.laws.rotor_loop import layout_of_vehicle
from tiltsim.scenario.controller import NumpyController
from tiltsim.scenario.law_controller import LawController
from tiltsim.scenario.messages import InvalidValueError, one_line_message
from tiltsim.scenario.own_parts import load_law, users_line
from tiltsim.scenario.scenario import FlightPlan, Scenario, plan_flight
from tiltsim.system.arguments import warn_user
from tiltsim.system.text import error_text
from tiltsim.vehicles.rotorcraft import initial_tilts
from tiltsim_controllers.code.messages import TraceError
from tiltsim_controllers.laws.observed import Command, Observed
from tiltsim_controllers.mathematics.attitude import quaternion_of_euler


@cache
def _without_parameters(function: Callable[..., Any]) -> Callable[..., Any]:
    """A user's function of the observation alone as a law with parameters."""

    def own_law(observed: Observed, parameters: Any) -> Command:
        return function(observed)

    return own_law


def _not_flown(_observed: Observed, _parameters: Any) -> Command:
    """In place of the user's function in a recorded flight, which needs no law any more."""
    raise AssertionError("a recorded flight was flown")


def table_of_law(plan: FlightPlan) -> LawController | None:
    """The law of a flight with its keys; None for a user's function, which has none.

    Raises `InputError` or `InvalidValueError` if it cannot be used.
    """
    table, scenario = plan.scenario.controller, plan.scenario
    if not isinstance(table, NumpyController):
        assert isinstance(table, LawController)
        return table
    found = load_law(scenario)
    if isinstance(found, type) and issubclass(found, LawController):
        return _own_table(scenario, table, found)
    if table.parameters:
        raise table.mistake("parameters", f"{table.attribute} is a function, which has none")
    return None


def recorded_table_of_law(plan: FlightPlan) -> LawController | None:
    """`table_of_law` for a recorded flight: no code that its scenario names is executed."""
    return None if isinstance(plan.scenario.controller, NumpyController) else table_of_law(plan)


def _own_table(
    scenario: Scenario, table: NumpyController, law: type[LawController]
) -> LawController:
    """A user's class with the keys of a scenario."""
    for name in ("states", "discrete_states"):
        declared = dict(getattr(law, name))
        if getattr(table, name) != declared:
            raise table.mistake(name, f"must be the {name} of {law.__name__}: {declared}")
    try:
        return law.model_validate(table.parameters)
    except ValidationError as error:
        mistake = one_line_message(error, table.parameters, law)
        text = f"{scenario.address or 'scenario'}: controller.parameters.{mistake}"
        raise InputError(text) from None


def _flown_law(plan: FlightPlan, table: LawController | None, *, recorded: bool) -> FlownLaw:
    """The law of a flight, given its table."""
    scenario, airframe = plan.scenario, airframe_of(plan)
    controller: Any = scenario.controller
    function, parameters, states = _not_flown, NO_PARAMETERS, controller.states
    if table is not None:
        function, parameters = table.law_function(airframe), table.law_parameters(airframe)
        states = table.state_units(airframe)
        table.law_table(airframe)  # raises where there is none for this vehicle and gait
    elif not recorded:
        function = _without_parameters(load_law(scenario))
    return FlownLaw(
        layout_of_vehicle(airframe.vehicle, scenario.any_rotorcraft.cross),
        function,
        type(parameters),
        tuple(states.items()),
        tuple(controller.discrete_states.items()),
        controller.commands_tilts,
        scenario.simulation.latency_steps > 0 and not controller.models_latency,
        controller.models_latency,
        scenario.has_objects,
    )


def loop_of_law(scenario: Scenario, *, recorded: bool = False) -> ClosedLoop:
    """The closed loop of a scenario's law, without layers; see `assemble` on ``recorded``.

    Warns of a law of a package or user that cannot be traced: it flies as plain Python.

    Raises:
        InputError: If such a law returns an invalid value.
    """
    plan, name = plan_flight(scenario), scenario.address or "scenario"
    find, controller = (recorded_table_of_law if recorded else table_of_law), scenario.controller
    try:
        flown = _flown_law(plan, find(plan), recorded=recorded)
    except InvalidValueError as error:  # found only with the vehicle and its gait at hand
        raise InputError(f"{name}: {error}") from error
    if flown.discrete and not scenario.simulation.control_timestep:
        raise InputError(
            f"{name}: simulation.control_timestep = 0: must be positive for a law with discrete "
            "states, which change at control samples"
        )
    loop, module = law_loop(flown, find), flown.function.__module__
    if recorded or (module.startswith("tiltsim_controllers.")):
        return loop
    whole = loop
    if scenario.sensors.instruments and controller.estimator is None:
        whole = with_instruments(loop, instruments_of(scenario))
    setup = whole.setup(plan, whole.signature)
    _try_once(whole, plan, setup)
    refusal = _refusal(
        whole, choices_of(setup.parameters), choices_of(plan.reference), len(setup.knots)
    )
    if not refusal:
        return loop
    _require_python(scenario, refusal)
    return law_loop(flown._replace(traced=False), find)


@cache
def _refusal(loop: ClosedLoop, parameters: Any, reference: Any, knots: int) -> str:
    """Why a loop cannot be traced, in one line; empty if it can be."""
    try:
        control_program(ProgramKey(loop, parameters, reference, knots), "controls")
    except TraceError as error:
        return str(error)
    except Exception as error:
        causes: list[BaseException] = [error]
        while causes[-1].__cause__ is not None:
            causes.append(causes[-1].__cause__)
        places = [place for cause in causes if (place := users_line(cause))]
        return f"{(places or [''])[-1]}{error_text(causes[-1])}; {REMEDY}"
    return ""


def _require_python(scenario: Scenario, refusal: str) -> None:
    """Warn that a law flies as plain Python. Raises `InputError` if it is to fly on arrays."""
    controller = scenario.controller
    name = getattr(controller, "function", controller.law)
    text = f"the law {name} cannot be compiled: {refusal}"
    if scenario.simulation.engine == "jax":
        start = f"{scenario.address or 'scenario'}: simulation.engine"
        raise InputError(f'{start} = "jax": {text}')
    warn_user(f"{text}; it flies as plain Python")


def _try_once(loop: ClosedLoop, plan: FlightPlan, setup: ControlSetup) -> None:
    """Evaluate a control step at time zero, so that mistakes in a law are found before the flight.

    Raises `InputError`.
    """
    scenario, initial = plan.scenario, plan.scenario.initial
    tilts, rates = initial_tilts(plan) if scenario.vehicle.has_tilting_rotors else ((), ())
    qpos = (*initial.position, *quaternion_of_euler(initial.attitude), *tilts)
    qvel = (*initial.velocity, *initial.angular_velocity, *rates)
    activations = loop.initial_activations(plan, setup)
    act = (*map(float, activations), *(0.0,) * loop.sizes.after_act)
    start = f'{scenario.address or "scenario"}: controller.law = "{scenario.controller.law}"'
    try:
        loop.controls(0.0, qpos, qvel, act, setup.parameters, setup.knots)
    except LawError as error:
        raise InputError(f"{start}: the law {error}") from None
    except Exception as error:
        place = users_line(error)
        if not place:
            text = "the law must take an observation and return a tiltsim.Command"
            raise InputError(f"{start}: {text} ({error_text(error)})") from error
        raise InputError(f"{start}: the law raised {error_text(error)} ({place[:-2]})") from error
