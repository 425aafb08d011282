"""Scalar code stays scalar: what the registry holds must compile as it stands."""

from __future__ import annotations

import ast
import builtins
import dis
import inspect
import math
import pkgutil
import subprocess
import sys
from functools import cache
from importlib import import_module
from pathlib import Path
from types import CodeType, FunctionType

import pytest

import tiltsim.equations.solvers
import tiltsim.laws.assembling
import tiltsim_controllers
from tiltsim_controllers.gaits.parameters import GAIT_TYPES, GaitParameters
from tiltsim_controllers.laws.attitude_altitude import Parameters, rotor_accelerations
from tiltsim_controllers.laws.decouplers import DECOUPLERS
from tiltsim_controllers.laws.gains import GAIN_SETS
from tiltsim_controllers.mathematics.scalar import scalar_functions
from tiltsim_controllers.references.trajectories import REFERENCE_TYPES, ReferenceParameters
from tiltsim_controllers.vehicle.parameters import PRESETS

MODULES = [
    import_module(module.name)
    for module in pkgutil.walk_packages(tiltsim_controllers.__path__, "tiltsim_controllers.")
]
for module in pkgutil.walk_packages(tiltsim.laws.__path__, "tiltsim.laws."):
    import_module(module.name)
FUNCTIONS = scalar_functions()
PLAIN_BUILTINS = {
    "abs",
    "float",
    "int",
    "len",
    "max",
    "min",
    "range",
    "zip",
    "round",
    "bool",
    "list",
}
MADE_FIELDS = {  # of records that are made at run time
    keyword.arg
    for root in (tiltsim, tiltsim_controllers)
    for file in Path(root.__path__[0]).rglob("*.py")
    if "make_record_type(" in (text := file.read_text())
    for node in ast.walk(ast.parse(text))
    if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "make_record_type"
    for keyword in node.keywords
}
RECORD_FIELDS = MADE_FIELDS | {
    field
    for name, module in list(sys.modules.items())
    if name.partition(".")[0] in {"tiltsim", "tiltsim_controllers"}
    for kind in vars(module).values()
    if inspect.isclass(kind) and issubclass(kind, tuple)
    for field in getattr(kind, "_fields", ())
}
READS_GLOBAL = {"LOAD_GLOBAL", "LOAD_NAME"}
READS_ATTRIBUTE = {"LOAD_ATTR", "LOAD_METHOD"}
FORBIDDEN = {"IMPORT_NAME", "STORE_GLOBAL", "STORE_ATTR", "RAISE_VARARGS", "YIELD_VALUE"}


def name_of(function):
    return f"{function.__module__}.{function.__name__}"


def instructions(code: CodeType):
    """The instructions of a function and of the comprehensions within."""
    yield from dis.get_instructions(code)
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from instructions(constant)


@cache
def code_of(function):
    return tuple(instructions(function.__code__))


def names_read(function, operations):
    return {i.argval for i in code_of(function) if i.opname in operations}


def globals_read(function):
    """The objects behind the global names that a function reads."""
    known = vars(builtins) | function.__globals__
    return {name: known[name] for name in names_read(function, READS_GLOBAL)}


def is_math(value):
    return getattr(math, getattr(value, "__name__", ""), None) is value


def is_constant(value):
    """A number, or a tuple of numbers."""
    numbers = value if isinstance(value, tuple) else (value,)
    return all(isinstance(number, int | float) for number in numbers)


def test_there_is_scalar_code():
    assert rotor_accelerations in FUNCTIONS
    assert tiltsim.laws.attitude_altitude.TILTROTOR.sampling.controls in FUNCTIONS


def test_nothing_is_registered_twice():
    assert len(set(FUNCTIONS)) == len(FUNCTIONS)


def test_scalar_code_calls_only_arithmetic_math_and_scalar_code():
    used = [
        (f"{name_of(function)} uses {name}", value)
        for function in FUNCTIONS
        for name, value in globals_read(function).items()
        if name not in PLAIN_BUILTINS
    ]
    foreign = [
        use
        for use, value in used
        if not (is_constant(value) or is_math(value) or value in FUNCTIONS)
    ]
    assert foreign == []


def test_scalar_code_reads_no_attributes_but_fields_of_records():
    read = {function: names_read(function, READS_ATTRIBUTE) for function in FUNCTIONS}
    assert [name_of(function) for function in FUNCTIONS if read[function] - RECORD_FIELDS] == []


def test_scalar_code_has_no_side_effects():
    assert [name_of(f) for f in FUNCTIONS if {i.opname for i in code_of(f)} & FORBIDDEN] == []


def test_powers_are_written_as_products():
    """A power of Python's differs from the products of native code in the last bit."""
    powers = {"**", "**="}
    assert [name_of(f) for f in FUNCTIONS if {i.argrepr for i in code_of(f)} & powers] == []


def test_callees_are_registered_before_their_callers():
    position = {function: index for index, function in enumerate(FUNCTIONS)}
    late = [
        f"{name_of(function)} calls {value.__name__}"
        for function in FUNCTIONS
        for value in globals_read(function).values()
        if isinstance(value, FunctionType) and position[value] >= position[function]
    ]
    assert late == []


@pytest.mark.parametrize("decoupler", DECOUPLERS)
@pytest.mark.parametrize("decoupling", [0.0, 1.0])
def test_the_law_turns_python_floats_into_python_floats(decoupler, decoupling):
    parameters = Parameters(
        vehicle=PRESETS["ar_drone_2"],
        gains=GAIN_SETS["exact"],
        gait=GaitParameters(GAIT_TYPES["fixed"]),
        reference=ReferenceParameters(REFERENCE_TYPES["setpoint"]),
        decoupler=DECOUPLERS[decoupler],
        decoupling=decoupling,
    )
    state = (*[0.1] * 12, *[0.2, -0.1, 0.3, 0.1], -300.0, 310.0, -320.0, 330.0)
    inputs = rotor_accelerations(0.0, state, parameters)
    assert [type(value) for value in inputs] == [float] * 4


def test_controllers_load_neither_simulator_nor_compiler_nor_testbed():
    names = [module.__name__ for module in MODULES]
    code = (
        "import sys\n"
        f"for name in {names}: __import__(name)\n"
        "print(*{name.partition('.')[0] for name in sys.modules})"
    )
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert "tiltsim_controllers" in loaded.stdout.split()
    assert not {"mujoco", "llvmlite", "tiltsim"} & set(loaded.stdout.split())
