"""Compile scalar functions with numba, into a cache of our own.

Numba's settings and classes stay as they are for other code of the process: our functions are
compiled with a cache object that has its own folder and lock.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any, Final

from numba import njit, types
from numba.core import sigutils
from numba.core.caching import (
    CompileResultCacheImpl,
    FunctionCache,
    IndexDataCacheFile,
    UserProvidedCacheLocator,
)
from numba.core.ccallback import CFunc
from numba.core.typing.templates import infer, infer_global, make_overload_template

from tiltsim.engines.cache import (
    failed_saves,
    is_core_code,
    native_code_folder,
    native_code_is_cacheable,
)
from tiltsim.engines.inner_code import InnerCompiler, loaded_inner_code
from tiltsim.system.interrupts import reraise_swallowed_interrupts
from tiltsim.system.locks import locked, one_thread_at_a_time
from tiltsim_controllers.mathematics.scalar import scalar_functions

ERROR_MODEL: Final = {"error_model": "numpy"}
"""Division by zero gives infinity or NaN, as in C; MuJoCo then reports a bad control."""

INNER: Final = {**ERROR_MODEL, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""Options of what only compiled code calls; without entry points it compiles a sixth faster."""


class _Locator(UserProvidedCacheLocator):  # type: ignore[misc]
    """Places the code of a function in `native_code_folder`."""

    def __init__(self, function: Callable[..., Any], file: str) -> None:
        self._py_file, self._lineno = file, function.__code__.co_firstlineno
        self._cache_path = str(native_code_folder() / self.get_suitable_cache_subpath(file))

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> _Locator:
        return cls(function, file)


class _CacheImpl(CompileResultCacheImpl):  # type: ignore[misc]
    _locator_classes = (_Locator,)


class _InnerImpl(_CacheImpl):
    def rebuild(self, target_context: Any, payload: Any) -> Any:
        return loaded_inner_code(target_context, payload)


class _SafeIndex(IndexDataCacheFile):  # type: ignore[misc]
    """An index that processes extend one after the other, of files with checksums.

    Numba reads, extends and writes it as if there were no other process: of two that compile at
    once, both could take the same file name, and each load the other's code. It would also load
    whatever a damaged file holds; here that file counts as missing, and its code is compiled again.
    """

    def save(self, key: Any, data: Any) -> None:
        with locked(Path(f"{self._index_path}.lock"), wait=True):
            super().save(key, data)

    def _save_index(self, overloads: Any) -> None:
        with self._open_for_write(self._index_path) as file:
            file.write(self._dump((self._source_stamp, overloads)))

    def _load_index(self) -> Any:
        stamp, overloads = self._read(self._index_path) or (None, {})
        return overloads if stamp == self._source_stamp else {}

    def _load_data(self, name: str) -> Any:
        return self._read(self._data_path(name))

    def _dump(self, content: Any) -> bytes:
        data: bytes = super()._dump(content)
        return sha256(data).digest() + data

    def _read(self, path: str) -> Any:
        """The content of a file; None if it is missing or damaged."""
        try:
            data = Path(path).read_bytes()
        except OSError:
            return None
        size = sha256().digest_size
        intact = sha256(data[size:]).digest() == data[:size]
        return pickle.loads(data[size:]) if intact else None


class NativeCodeCache(FunctionCache):  # type: ignore[misc]
    """Numba's cache of a function's compiled code, in our folder."""

    _impl_class = _CacheImpl

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        stamp = self._impl.locator.get_source_stamp()
        self._cache_file = _SafeIndex(self._cache_path, self._impl.filename_base, stamp)

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Save compiled code; without space for it, it is used without being saved."""
        try:
            super().save_overload(signature, compiled)
        except OSError as error:
            failed_saves.append(error)


class _InnerCodeCache(NativeCodeCache):
    _impl_class = _InnerImpl


def _cached(
    compiled: Any, function: Callable[..., Any], kind: type[NativeCodeCache] = NativeCodeCache
) -> Any:
    """Give a dispatcher or C callback our cache, if its folder may be used."""
    in_file = Path(function.__code__.co_filename).is_file()  # not in a notebook
    if native_code_is_cacheable() and in_file:
        compiled._cache = kind(function)
    return compiled


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a function for calls from Python, without holding Python's lock."""
    dispatcher = njit(nogil=True, **ERROR_MODEL)(function)
    # Called by numba at the first call, which compiles, not at later ones with the same types.
    dispatcher._compile_for_args = reraise_swallowed_interrupts()(dispatcher._compile_for_args)
    return _cached(dispatcher, function)


def compiled_callback(signature: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compile a function as a C callback of a numba signature."""

    def decorate(function: Callable[..., Any]) -> Any:
        normalized = sigutils.normalize_signature(signature)
        callback = _cached(CFunc(function, normalized, {}, dict(ERROR_MODEL)), function)
        with reraise_swallowed_interrupts():
            callback.compile()
        return callback

    return decorate


def callable_natively(function: Callable[..., Any]) -> Callable[..., Any]:
    """Let compiled code call a Python function, as `numba.extending.register_jitable` does.

    Its code is cached separately, since controllers share most of their functions; but not that of
    a closure, which has no name of its own, nor that of a user's function, which holds the code of
    what it calls in files that may have changed since.
    """

    def implementation(*_args: Any, **_keywords: Any) -> Callable[..., Any]:
        return function

    template = make_overload_template(function, implementation, INNER, False, "never")

    class Template(template):  # type: ignore[misc, valid-type]
        def _get_jit_decorator(self) -> Callable[..., Any]:
            return _decorator_of_inner

    infer(Template)
    infer_global(function, types.Function(Template))
    return function


def _decorator_of_inner(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    def decorate(function: Callable[..., Any]) -> Any:
        if function.__closure__:
            # Made for few callers, with long tuples: to pass those costs as much as to use them.
            return njit(forceinline=True, pipeline_class=InnerCompiler, **options)(function)
        inner = njit(pipeline_class=InnerCompiler, **options)(function)
        return _cached(inner, function, _InnerCodeCache) if is_core_code(function) else inner

    return decorate


@one_thread_at_a_time
def register_scalar_functions() -> None:
    """Let compiled code call every scalar function defined so far."""
    for function in scalar_functions()[len(_registered) :]:
        _registered.append(callable_natively(function))


_registered: Final[list[Callable[..., Any]]] = []
