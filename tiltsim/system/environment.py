"""Environment variables of the command line, and for the processes that libraries start."""

import os
from importlib.util import find_spec
from pathlib import Path


def variables_for_processes() -> dict[str, str]:
    """Variables that keep processes safe, silent and quick, without those already set.

    With PYTHONSAFEPATH an interpreter imports no modules from the working folder, where a struct.py
    may lie beside downloaded scenarios. With PYGLFW_LIBRARY glfw, which MuJoCo imports, loads the
    library that lies in its package: to compare versions it would start an interpreter, which
    takes 25 ms and prints a traceback if a signal ends its parent meanwhile. With
    OPENBLAS_NUM_THREADS numpy and scipy, once loaded, compute on one core: for matrices of a few
    hundred rows further threads mostly wait for each other, and take the cores of other processes.
    """
    variables = {
        "PYTHONSAFEPATH": "1",
        "PYGLFW_LIBRARY": _library_of_glfw(),
        "OPENBLAS_NUM_THREADS": "1",
    }
    return {name: value for name, value in variables.items() if value and name not in os.environ}


def _library_of_glfw() -> str:
    """File of the library in the package glfw, or an empty text: it may use the system's."""
    found = find_spec("glfw")
    if found is None or found.origin is None:
        return ""
    package = Path(found.origin).parent
    chosen = os.environ.get("PYGLFW_LIBRARY_VARIANT") or os.environ.get("XDG_SESSION_TYPE", "")
    variant = "wayland" if chosen.lower() == "wayland" else "x11"
    places = package / variant, package  # on macOS there are no variants
    return next((str(file) for place in places for file in place.glob("libglfw.*")), "")
