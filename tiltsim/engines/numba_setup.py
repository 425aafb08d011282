"""How scalar functions are compiled, and where compiled code is kept."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from threading import Lock
from typing import Any, Final

from numba.extending import register_jitable

from tiltsim.engines.cache import (
    native_code_is_cacheable,
)
from tiltsim.system.locks import locked
from tiltsim_controllers.mathematics.scalar import scalar, scalar_functions

# Division by zero gives infinity or NaN, as in C; MuJoCo then reports a bad control.
_OPTIONS: Final = {"error_model": "numpy", "cache": native_code_is_cacheable()}


# What only compiled code calls needs no ways in from Python and C: a sixth less to compile.
_INNER: Final = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}


def _alone(save: Callable[..., None]) -> Callable[..., None]:
    """Numba reads an index, adds to it and writes it as if there were no other process.

    Of two that compile at once, both could take the same name, and each load the other's code.
    """

    def save_alone(index: Any, key: Any, data: Any) -> None:
        with locked(Path(f"{index._index_path}.lock"), wait=True):
            save(index, key, data)

    return save_alone


@scalar
def watch_nothing(values: Any, parameters: Any) -> tuple[float]:
    """For loops that leave watching to Python."""
    return (1.0,)


def _register_scalar_functions() -> None:
    """Let compiled code call every scalar function known so far."""
    with _registering:  # batches build plants in threads
        for function in scalar_functions()[len(_registered) :]:
            # Kept one by one, too: laws share most of them. A closure has no name to be kept by.
            kept = _OPTIONS["cache"] and function.__closure__ is None
            register_jitable(**_INNER, cache=kept)(function)
            _registered.append(function)


_registered: list[Any] = []


_registering = Lock()
