"""Functions of a closed loop and offsets of its inputs, traced once for many evaluations."""

from collections.abc import Callable, Sequence
from typing import Any

from tiltsim.arrays.lifting import Lifting
from tiltsim.arrays.traced_numbers import trace_scalar_code
from tiltsim.closed_loop.assembly import Assembly
from tiltsim.closed_loop.choices import program_key
from tiltsim.engines.programs import LoopPrograms
from tiltsim.linear.coordinates import Input
from tiltsim_controllers.code.program import InputVector
from tiltsim_controllers.code.python_source import python_function
from tiltsim_controllers.mathematics.scalar import Values

Traced = Callable[..., Sequence[Any]]
"""A function ``(lifting, setup, *vectors)`` that returns numbers."""


def traced_function(assembly: Assembly, function: Traced, **sizes: int) -> Callable[..., Values]:
    """A function of vectors on Python's floats.

    Args:
        assembly: The flight, whose parameters and knots are bound.
        function: Called once, with numbers that are traced.
        sizes: The size of every vector, by name.
    """
    programs = LoopPrograms(program_key(assembly))

    def run(lifting: Lifting, given: Sequence[InputVector]) -> Sequence[Any]:
        *vectors, user = given
        return function(lifting, programs.setup(user), *vectors)

    program = trace_scalar_code(run, **sizes, user=programs.user_size)
    return python_function(program, fixed={"user": assembly.setup.userdata.tolist()})


def offset(commanded: Sequence[Any], inputs: Sequence[Input], offsets: Sequence[Any]) -> list[Any]:
    """Commands with an offset added for each of the vehicle's inputs."""
    values = list(commanded)
    for each, added in zip(inputs, offsets, strict=True):
        values[each.place] = values[each.place] + added * each.per_unit
    return values
