"""The memory offsets of mjData's public fields, which hold a flight's state.

A C program reads ``d->qpos``; native code of ours has only the address ``d``. MuJoCo's functions
for reading and writing the state (``mj_getState``) would copy all of it twice per call of the
callback, which takes as long as a controller. So native code reads the fields in place. Their
offsets depend on MuJoCo's version and are documented only in its C headers; here they are measured
in the running library: a small model has, at these offsets, the addresses and values that the
Python bindings report.
"""

import ctypes
from functools import cache
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np

from tiltsim.system.hooks import mujoco_hooks

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
