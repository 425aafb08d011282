"""A scenario as functions of CasADi's symbols, for optimization and linearization."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from typing import Any, NamedTuple

from tiltsim.arrays.casadi_symbols import CasadiSymbols
from tiltsim.arrays.lifting import Lifting
from tiltsim.errors import InputError
from tiltsim.laws.assembling import assemble
from tiltsim.plants.flight_model import disturbance_acceleration
from tiltsim.scenario.loading import load_scenario
from tiltsim.scenario.scenario import Scenario


class Symbolic(NamedTuple):
    """CasADi functions of a scenario on equations of motion; its numbers are constants.

    Attributes:
        dynamics: ``(time, state, inputs) -> rates``: the vehicle, whatever its inputs.
        controller: ``(time, state) -> inputs``.
        closed_loop: ``(time, state) -> rates``.
        sample: ``(time, state) -> sample``: the fields of a recorded sample after its time.
        initial: State at time zero.
        fields: Names of the sample's entries.
    """

    dynamics: Any
    controller: Any
    closed_loop: Any
    sample: Any
    initial: tuple[float, ...]
    fields: tuple[str, ...]


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
    symbols = CasadiSymbols()
    assembly = assemble(scenario)
    equations, (parameters, knots) = assembly.loop.equations, assembly.setup
    assert equations is not None  # mujoco is refused
    disturbance = disturbance_acceleration(scenario)
    initial = tuple(map(float, equations.initial(assembly, assembly.setup)))
    lifting, sx = Lifting(symbols), symbols.casadi.SX
    law, rates = lifting(equations.inputs), lifting(equations.rates)
    observe = lifting(equations.observe)
    time, state = sx.sym("time"), sx.sym("state", len(initial))
    inputs = sx.sym("inputs", equations.inputs_size)
    states = [state[index] for index in range(len(initial))]
    free = tuple(inputs[index] for index in range(equations.inputs_size))
    chosen = law(time, states, parameters, knots)

    def function(name: str, values: Any, result: str, *arguments: Any) -> Any:
        vector = symbols.casadi.vertcat(*values)
        names = [str(argument[0]).rpartition("_")[0] or "time" for argument in arguments]
        return symbols.casadi.Function(name, [*arguments], [vector], names, [result])

    moved = (parameters, knots, disturbance)
    return Symbolic(
        function("dynamics", rates(time, states, free, *moved), "rates", time, state, inputs),
        function("controller", chosen, "inputs", time, state),
        function("closed_loop", rates(time, states, chosen, *moved), "rates", time, state),
        function("sample", observe(time, states, chosen, parameters, knots), "sample", time, state),
        initial,
        assembly.loop.sample_fields[1:],
    )
