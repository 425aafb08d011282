"""Functions of a closed loop and offsets of its inputs, traced once for many evaluations."""

from collections.abc import Callable, Sequence
from typing import Any

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.closed_loop.choices import program_key
from tiltsim.engines.programs import LoopPrograms
from tiltsim.linear.coordinates import Input
from tiltsim_controllers.code.python_source import python_function
from tiltsim_controllers.code.traceable import program_of
from tiltsim_controllers.mathematics.scalar import Values


def traced_function(
    assembly: Assembly, function: Callable[..., Any], **sizes: int
) -> Callable[..., Values]:
    """A function of vectors on Python's floats.

    Args:
        assembly: The flight, whose parameters and knots are bound.
        function: ``(setup, *arrays) -> numbers``; called once, with numbers that are traced.
        sizes: The size of every vector, by name.
    """
    programs = LoopPrograms(program_key(assembly))

    def run(*given: Any) -> Any:
        *vectors, user = given
        return function(programs.setup(user), *vectors)

    program = program_of(run, **sizes, user=programs.user_size)
    return python_function(program, fixed={"user": assembly.setup.userdata.tolist()})


def offset(commanded: Sequence[Any], inputs: Sequence[Input], offsets: Sequence[Any]) -> list[Any]:
    """Commands with an offset added for each of the vehicle's inputs."""
    values = list(commanded)
    for each, added in zip(inputs, offsets, strict=True):
        values[each.place] = values[each.place] + added * each.per_unit
    return values
