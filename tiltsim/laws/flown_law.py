"""Laws of scenarios, built-in, from packages or from users, checked before flights."""

import warnings
from collections.abc import Callable
from functools import cache
from typing import Any

from pydantic import ValidationError

from tiltsim.closed_loop.assembly import ProgramKey, choices_of
from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup
from tiltsim.engines.programs import LoopPrograms
from tiltsim.errors import InputError
from tiltsim.laws.law_loop import REMEDY, FlownLaw, Key, LawError, airframe_of, law_loop
from tiltsim.laws.layers.instruments import instruments_of, with_instruments
from tiltsim.laws.rotor_loop import layout_of_vehicle
from tiltsim.scenario.controller import NumpyController
from tiltsim.scenario.law_controller import LawController
from tiltsim.scenario.messages import InvalidValueError, one_line_message
from tiltsim.scenario.own_code import load_law, users_line
from tiltsim.scenario.scenario import FlightPlan, Scenario, plan_flight
from tiltsim.system.text import error_text
from tiltsim.vehicles.rotorcraft import initial_tilts
from tiltsim_controllers.code.messages import TraceError
from tiltsim_controllers.laws.observed import Command, Observed
from tiltsim_controllers.mathematics.attitude import quaternion_of_euler
from tiltsim_controllers.mathematics.records import make_record_type

NO_PARAMETERS = make_record_type("NoParameters", none=float)(0.0)
"""For laws without parameters."""


@cache
def _without_parameters(function: Callable[..., Any]) -> Callable[..., Any]:
    """A user's function of the observation alone as a law with parameters."""

    def own_law(observed: Observed, parameters: Any) -> Command:
        return function(observed)

    return own_law


def _not_flown(_observed: Observed, _parameters: Any) -> Command:
    """In place of the user's function in a recorded flight, which needs no law any more."""
    raise AssertionError("a recorded flight was flown")


def law_of(plan: FlightPlan) -> FlownLaw:
    """The law of a flight. Raises `InputError` or `InvalidValueError` if it cannot be used."""
    table, airframe = plan.scenario.controller, airframe_of(plan)
    if isinstance(table, NumpyController):
        found = load_law(plan.scenario)
        if not (isinstance(found, type) and issubclass(found, LawController)):
            return _law_of_function(table, found)
        table = _own_table(plan.scenario, table, found)
    assert isinstance(table, LawController)
    function = table.law_function(airframe)
    return FlownLaw(
        function,
        table.law_parameters(airframe),
        table.law_table(airframe),
        table.state_units(airframe),
        table.discrete_states,
        table.initial_states(airframe),
    )


def _law_of_function(table: NumpyController, function: Callable[..., Command]) -> FlownLaw:
    if table.parameters:
        raise table.mistake("parameters", f"{table.attribute} is a function, which has none")
    zeros = (0.0,) * (len(table.states) + len(table.discrete_states))
    law = _without_parameters(function)
    units = table.states, table.discrete_states
    return FlownLaw(law, NO_PARAMETERS, (), *units, zeros)


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


def recorded_law_of(plan: FlightPlan) -> FlownLaw:
    """`law_of` for a recorded flight: no code that its scenario names is executed."""
    table = plan.scenario.controller
    if not isinstance(table, NumpyController):
        return law_of(plan)
    units = table.states, table.discrete_states
    zeros = (0.0,) * (len(table.states) + len(table.discrete_states))
    return FlownLaw(_not_flown, NO_PARAMETERS, (), *units, zeros)


def loop_of_law(scenario: Scenario, *, recorded: bool = False) -> ClosedLoop:
    """The closed loop of a scenario's law, without layers; see `assemble` on ``recorded``.

    Warns of a law of a package or user that cannot be traced: it flies as plain Python.

    Raises:
        InputError: If such a law returns an invalid value.
    """
    plan, name = plan_flight(scenario), scenario.address or "scenario"
    find, controller = (recorded_law_of if recorded else law_of), scenario.controller
    try:
        law = find(plan)
    except InvalidValueError as error:  # found only with the vehicle and its gait at hand
        raise InputError(f"{name}: {error}") from error
    if law.discrete and not scenario.simulation.control_timestep:
        raise InputError(
            f"{name}: simulation.control_timestep = 0: must be positive for a law with discrete "
            "states, which change at control samples"
        )
    key = Key(
        layout_of_vehicle(airframe_of(plan).vehicle, scenario.vehicle.model),
        law.function,
        type(law.parameters),
        tuple(law.states.items()),
        tuple(law.discrete.items()),
        controller.commands_tilts,
        scenario.simulation.latency_steps > 0 and not controller.models_latency,
        controller.models_latency,
        scenario.has_objects,
    )
    loop, module = law_loop(key, find), law.function.__module__
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
    return law_loop(key._replace(traced=False), find)


@cache
def _refusal(loop: ClosedLoop, parameters: Any, reference: Any, knots: int) -> str:
    """Why a loop cannot be traced, in one line; empty if it can be."""
    try:
        LoopPrograms(ProgramKey(loop, parameters, reference, knots)).in_mujoco("controls")
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
    warnings.warn(f"{text}; it flies as plain Python", RuntimeWarning, stacklevel=4)


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
