"""Machine code is generated for the outermost function only, compiled or loaded."""

from __future__ import annotations

import importlib.util

import pytest
from numba.core.codegen import JITCodeLibrary

from tiltsim.engines.compiling import callable_natively, compiled

SOURCE = """
def squared(x):
    return x * x

def norm(x, y):
    return squared(x) + squared(y)

def outermost(x, y):
    return norm(x, y)
"""


@pytest.fixture
def generated(monkeypatch):
    """Names of our functions that get machine code."""
    names, generate = [], JITCodeLibrary._finalize_final_module

    def noted(library):
        if f"def {library.name}(" in SOURCE:  # numba compiles a library of its own once a process
            names.append(library.name)
        generate(library)

    monkeypatch.setattr(JITCodeLibrary, "_finalize_final_module", noted)
    return names


def functions_of(file):
    """Another outermost function whenever the file is loaded, as a module of ours."""
    spec = importlib.util.spec_from_file_location(f"tiltsim.{file.stem}", file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    callable_natively(module.squared)
    callable_natively(module.norm)
    return compiled(module.outermost)


def test_inner_functions_have_none(tmp_path, monkeypatch, generated):
    monkeypatch.setattr("tiltsim.engines.compiling.native_code_folder", lambda: tmp_path)
    file = tmp_path / "source.py"
    file.write_text(SOURCE)
    assert functions_of(file)(3.0, 4.0) == 25.0
    assert generated == ["outermost"]
    for stored in tmp_path.rglob("source.outermost*.nbc"):
        stored.unlink()
    assert functions_of(file)(3.0, 4.0) == 25.0, "of inner functions loaded from the cache"
    assert generated == ["outermost"] * 2


def test_what_is_inlined_is_optimized_by_its_callers_alone(tmp_path, monkeypatch):
    monkeypatch.setattr("tiltsim.engines.compiling.native_code_folder", lambda: tmp_path)
    optimized, optimize = [], JITCodeLibrary._optimize_final_module

    def noted(library):
        optimized.append(library.name.rpartition(".")[2])
        optimize(library)

    monkeypatch.setattr(JITCodeLibrary, "_optimize_final_module", noted)
    gain = 2.0

    @callable_natively
    def inner(x):
        return gain * x

    @callable_natively
    def layer(x):
        return inner(x) + 1.0

    @compiled
    def outermost(x):
        return layer(x)

    assert outermost(3.0) == 7.0
    assert {"inner", "layer", "outermost"} & {*optimized} == {"outermost"}


def test_a_users_function_is_compiled_with_what_it_calls_as_that_is_now(tmp_path, monkeypatch):
    monkeypatch.setattr("tiltsim.engines.compiling.native_code_folder", lambda: tmp_path)
    gain, law = tmp_path / "gain.py", tmp_path / "law.py"
    law.write_text("def law(x):\n    return gain(x)")

    def loaded(file, **called):
        spec = importlib.util.spec_from_file_location(file.stem, file)
        module = importlib.util.module_from_spec(spec)
        vars(module).update(called)
        spec.loader.exec_module(module)
        return callable_natively(getattr(module, file.stem))

    for value in (2.0, 15.0):  # of other lengths, as bytecode is kept by time and size
        gain.write_text(f"def gain(x):\n    return {value} * x")
        known = {"law": loaded(law, gain=loaded(gain))}
        exec("def flown(x):\n    return law(x)", known)
        assert compiled(known["flown"])(3.0) == 3.0 * value
