"""A scenario as functions of CasADi's symbols, for optimization and linearization."""

from collections.abc import Callable, Mapping
from os import PathLike
from typing import Any, NamedTuple

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.errors import InputError, TiltsimError
from tiltsim.laws.assembling import assemble
from tiltsim.linear.coordinates import entry_names, equation_coordinates, equation_inputs
from tiltsim.scenario.loading import load_scenario
from tiltsim.scenario.scenario import Scenario
from tiltsim.system.public import optional_package
from tiltsim_controllers.code.arrays import program_of, xp
from tiltsim_controllers.code.casadi_function import casadi_function
from tiltsim_controllers.code.messages import TraceError


class Symbolic(NamedTuple):
    """CasADi functions of a scenario on equations of motion; its numbers are constants.

    Attributes:
        dynamics: ``(time, state, inputs) -> rates``: the vehicle, whatever its inputs.
        controller: ``(time, state) -> inputs``.
        closed_loop: ``(time, state) -> rates``.
        sample: ``(time, state) -> sample``: the fields of a recorded sample after its time.
        initial: State at time zero.
        states: Names of the state's entries; a rotation has four of a quaternion, or nine of its
            matrix, rows first.
        inputs: Names of the inputs' entries; empty for one that changes nothing.
        fields: Names of the sample's entries.
    """

    dynamics: Any
    controller: Any
    closed_loop: Any
    sample: Any
    initial: tuple[float, ...]
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    fields: tuple[str, ...]


def _input_names(assembly: Assembly, size: int) -> tuple[str, ...]:
    """Names of the inputs of equations; a thrust is among them as a squared speed."""
    names = [""] * size
    for found in equation_inputs(assembly, size):
        scaled = found.per_unit != 1.0
        names[found.place] = found.name.replace("thrust", "squared_speed" if scaled else "thrust")
    return tuple(names)


def symbolic(scenario: Scenario | str | PathLike[str] | Mapping[str, Any]) -> Symbolic:
    """A scenario as CasADi functions of its dynamics and of its closed loop.

    Args:
        scenario: Anything that `tiltsim.load_scenario` takes; on the plant thesis or rigid_body.

    Raises:
        InputError: If the scenario is invalid or in MuJoCo, or CasADi is missing.
        TiltsimError: If it needs random numbers, which have no symbolic form.
    """
    scenario = load_scenario(scenario)
    if scenario.simulation.plant == "mujoco":
        raise InputError(
            'simulation.plant = "mujoco": symbolic supports "thesis" and "rigid_body" only'
        )
    optional_package("casadi", "tiltsim.symbolic", "'tiltsim[casadi]'")
    assembly = assemble(scenario)
    equations, setup = assembly.loop.equations, assembly.setup
    assert equations is not None  # mujoco is refused
    initial = tuple(map(float, equations.initial(assembly, setup)))
    moved = *setup, scenario.disturbance_acceleration

    def dynamics(time: Any, state: Any, inputs: Any) -> Any:
        return equations.rates(time[0], state, inputs, *moved)

    def controller(time: Any, state: Any) -> Any:
        return equations.inputs(time[0], state, *setup)

    def closed_loop(time: Any, state: Any) -> Any:
        return dynamics(time, state, xp.array(controller(time, state)))

    def sample(time: Any, state: Any) -> Any:
        return equations.observe(time[0], state, xp.array(controller(time, state)), *setup)

    sizes = {"time": 1, "state": len(initial)}

    def function(traced: Callable[..., Any], result: str, **more: int) -> Any:
        program = program_of(traced, **sizes, **more)
        try:
            return casadi_function(program, traced.__name__, result)
        except TraceError as error:
            raise TiltsimError(str(error)) from error

    return Symbolic(
        function(dynamics, "rates", inputs=equations.inputs_size),
        function(controller, "inputs"),
        function(closed_loop, "rates"),
        function(sample, "sample"),
        initial,
        entry_names(equation_coordinates(assembly, len(initial))),
        _input_names(assembly, equations.inputs_size),
        assembly.loop.sample_fields[1:],
    )
