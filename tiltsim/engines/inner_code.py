"""Functions that only compiled code calls: LLVM's code of them, without machine code.

Numba generates machine code for every function that it compiles, and again for what it inlines
into the next one. Of a control step only the outermost function is ever called from outside, and
its machine code holds all others; a loop of many layers compiles in half the time without theirs.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, Final

from llvmlite.binding import parse_bitcode
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompileResult

_NO_MACHINE_CODE: Final = SimpleNamespace(set_env=lambda name, environment: None)
"""In place of the generator of machine code, to which numba passes each function's environment."""


class _InnerLibrary(JITCodeLibrary):  # type: ignore[misc]
    """The code of one function, to be linked into that of its callers."""

    codegen = _NO_MACHINE_CODE

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Zero, as numba has it for a function that a library does not define."""
        return 0

    def serialize_using_object_code(self) -> tuple[str, str, bytes]:
        """What is stored: no object code."""
        stored: tuple[str, str, bytes] = self.serialize_using_bitcode()
        return stored


class _InlinedLibrary(_InnerLibrary):
    """The code of a function that its callers always inline, as written.

    They optimize it with theirs. A layer around a loop would optimize all of the loop once more.
    """

    def _optimize_final_module(self) -> None:
        pass


def loaded_inner_code(target_context: Any, stored: Any) -> CompileResult:
    """A compiled inner function as it was stored; `CompileResult._rebuild` loads machine code."""
    (name, _, code), description, environment, signature, *others = stored
    _, lifted, annotation, reload_init, environments = others
    library = _InnerLibrary(target_context.codegen(), name)
    library._final_module = parse_bitcode(code)
    library._finalize_final_module()
    for reload in reload_init:
        reload()
    return CompileResult(
        typing_context=target_context.typing_context,
        target_context=target_context,
        entry_point=target_context.get_executable(library, description, environment),
        typing_error=None,
        type_annotation=annotation,
        signature=signature,
        library=library,
        objectmode=False,
        lifted=lifted,
        fndesc=description,
        environment=environment,
        call_helper=None,
        metadata=None,
        reload_init=reload_init,
        referenced_envs=environments,
    )


class InnerCompiler(Compiler):  # type: ignore[misc]
    """Numba's compiler, for the ``pipeline_class`` of its decorators."""

    def define_pipelines(self) -> Any:
        """Numba's passes, with a library of ours for their result."""
        state = self.state
        library = _InlinedLibrary if state.flags.forceinline else _InnerLibrary
        state.library = library(state.targetctx.codegen(), state.func_id.func_qualname)
        return super().define_pipelines()
