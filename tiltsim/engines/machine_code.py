"""LLVM text as machine code, which is kept on disk, and the memory in which it finds a flight.

A C program reads ``d->qpos``; native code of ours has only the address ``d``. MuJoCo's functions
for reading and writing the state (``mj_getState``) would copy all of it twice per call of the
callback, which takes as long as a controller. So native code reads the fields in place. Their
offsets depend on MuJoCo's version and are documented only in its C headers; here they are measured
in the running library: a small model has, at these offsets, the addresses and values that the
Python bindings report.
"""

import ctypes
import os
import platform
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np

from tiltsim.system.hooks import mujoco_hooks
from tiltsim_controllers.code.lanes import LaneMath

OPTIMIZATION: Final = 1
"""LLVM's optimization level, 0 to 3; higher ones take longer to compile and run no faster."""

_DIGEST: Final = sha256().digest_size


class MachineCode:
    """Compiled functions. Its code lives as long as this object.

    Args:
        text: LLVM's assembly language, which is also what compiled code is kept by.
    """

    def __init__(self, text: str) -> None:
        import llvmlite.binding as llvm

        target, options, identity = _target()
        machine = target.create_target_machine(**options)  # which the engine will own
        file = code_folder() / f"{sha256(f'{identity}{text}'.encode()).hexdigest()}.o"
        keeps = is_usable(file.parent)
        code = _load(file) if keeps else None
        self.compiled = code is None
        if code is None:
            module = llvm.parse_assembly(text)
            tuning = llvm.create_pipeline_tuning_options(speed_level=OPTIMIZATION)
            builder = llvm.create_pass_builder(machine, tuning)
            builder.getModulePassManager().run(module, builder)
            code = machine.emit_object(module)
            if keeps:
                _save(file, code)
        self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
        self._engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        self._engine.finalize_object()

    def function(self, name: str, result: Any, *arguments: Any) -> Any:
        """A function with `ctypes` types; while it runs, Python's lock is free."""
        address = self._engine.get_function_address(name)
        function: Any = ctypes.CFUNCTYPE(result, *arguments)(address)
        function.code = self  # it must live as long as the function
        return function


@cache
def _target() -> tuple[Any, Mapping[str, Any], str]:
    """LLVM's target, the options of its code generator, and a text that identifies both."""
    import llvmlite
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    target = llvm.Target.from_default_triple()
    name, features = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    options = {"cpu": name, "features": features, "opt": OPTIMIZATION}
    return target, options, f"{llvmlite.__version__} {target.triple} {options}\n"


@cache
def widest() -> int:
    """Number of floats in a vector register of this processor."""
    import llvmlite.binding as llvm

    has = llvm.get_host_cpu_features()
    return 8 if has.get("avx512f") else 4 if has.get("avx2") else 2


@cache
def lane_math(*, quick: bool) -> LaneMath:
    """The functions of lanes that this machine has; quick ones may differ in their last digits."""
    import llvmlite.binding as llvm

    fuses = llvm.get_host_cpu_features().get("fma") or platform.machine() in ("aarch64", "arm64")
    if not fuses:
        return "library"
    if quick:
        return "quick"
    name, version = platform.libc_ver()
    known = name == "glibc" and tuple(map(int, version.split(".")[:2])) >= (2, 28)
    return "exact" if known else "library"


def _load(file: Path) -> bytes | None:
    """The content of a file; None if it is missing or damaged."""
    try:
        data = file.read_bytes()
    except OSError:
        return None
    digest, code = data[:_DIGEST], data[_DIGEST:]
    return code if sha256(code).digest() == digest else None


def _save(file: Path, code: bytes) -> None:
    """Write a file in one step; without space for it, the code is used without being kept."""
    try:
        with tempfile.NamedTemporaryFile(dir=file.parent, suffix=".new", delete=False) as own:
            own.write(sha256(code).digest() + code)
        Path(own.name).replace(file)
    except OSError:
        Path(own.name).unlink(missing_ok=True)


def code_folder() -> Path:
    """The folder of compiled code, in the user's folder for caches."""
    base = Path(os.environ.get("XDG_CACHE_HOME", ""))
    if not base.is_absolute():  # to be ignored, as the specification of XDG_CACHE_HOME says
        base = Path.home() / ".cache"
    return base / "tiltsim" / "machine_code"


def is_usable(folder: Path) -> bool:
    """Whether compiled code may be kept and loaded: its folder is writable, and by nobody else.

    Whoever can write there decides what a flight executes.
    """
    try:
        return _is_private(folder.parent) and _is_private(folder) and os.access(folder, os.W_OK)
    except OSError:
        return False


def _is_private(folder: Path) -> bool:
    """Whether a folder is this user's alone; it is created so, whatever the umask."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    with suppress(FileExistsError):
        folder.mkdir(mode=0o700)
    if os.name == "nt":
        return True
    found = folder.stat()
    if found.st_uid != os.getuid():
        return False
    if found.st_mode & 0o077:
        folder.chmod(0o700)
    return True


_PROBE: Final = """
<mujoco>
  <size nuserdata="40503"/>
  <worldbody><body><joint name="hinge"/><geom size="1"/></body></worldbody>
  <actuator><general joint="hinge" dyntype="integrator"/></actuator>
  <sensor><jointpos joint="hinge" nsample="1"/></sensor>
</mujoco>
"""
_TIME: Final = 0.7853981634123456
_ARRAYS: Final = ("qpos", "qvel", "act", "history", "ctrl", "userdata")

_MODEL_BYTES: Final = 2048
_DATA_BYTES: Final = 1 << 20
"""Search ranges of the sizes in mjModel and of the time in mjData, which precedes the arrays."""

_ARRAY_BYTES: Final = 512
"""Search range of the arrays behind the time; they are the first of some hundred."""


class Layout(NamedTuple):
    """Offsets in bytes."""

    model_userdata_size: int  # in mjModel, a 32-bit integer at least
    qpos: int  # in mjData, as all below: the address of an array of floats
    qvel: int
    act: int
    history: int
    ctrl: int
    userdata: int


@cache
def mjdata_layout() -> Layout:
    """Measure the offsets.

    Raises:
        RuntimeError: If a field is not found in the search range.
    """
    with mujoco_hooks():
        model = mujoco.MjModel.from_xml_string(_PROBE)
    data = mujoco.MjData(model)
    data.time = _TIME
    size = _first(model._address, _MODEL_BYTES, ctypes.c_int32, model.nuserdata)
    time = _first(data._address, _DATA_BYTES, ctypes.c_double, _TIME)
    words = np.ctypeslib.as_array(
        (ctypes.c_uint64 * (_ARRAY_BYTES // 8)).from_address(data._address + time)
    )
    offsets = {}
    for name in _ARRAYS:
        found = np.flatnonzero(words == getattr(data, name).ctypes.data)
        if found.size == 0:
            raise _not_found(f"mjData.{name}")
        # An empty array in front of this one has the same address.
        offsets[name] = time + 8 * int(found[-1])
    return Layout(size, **offsets)


def _first(address: int, reach: int, kind: Any, value: float) -> int:
    """The first offset at which memory holds a value; memory behind it is not read."""
    width = ctypes.sizeof(kind)
    for offset in range(0, reach, width):
        if kind.from_address(address + offset).value == value:
            return offset
    raise _not_found(f"{value!r}")


def _not_found(what: str) -> RuntimeError:
    return RuntimeError(
        f"native code cannot find {what} in MuJoCo {mujoco.__version__}'s memory; "
        'fly with simulation.engine = "python"'
    )
