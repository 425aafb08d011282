"""Where MuJoCo keeps a flight's state: the places of mjData's public fields in memory.

A C program reads ``d->qpos``; native code of ours has only the address ``d``. MuJoCo's functions
for reading and writing the state (``mj_getState``) copy all of it twice at every call of the
callback, which costs as much as a control law. So the fields are read where they lie. Their places
change with MuJoCo's version and are written down nowhere but in its C headers; here the running
library is asked: in a small model of our own, the places are those where the bindings' own
addresses and values are found.
"""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np

_PROBE: Final = """
<mujoco>
  <size nuserdata="40503"/>
  <worldbody><body><joint name="hinge"/><geom size="1"/></body></worldbody>
  <actuator><general joint="hinge" dyntype="integrator"/></actuator>
  <sensor><jointpos joint="hinge"/></sensor>
</mujoco>
"""
_TIME: Final = 0.7853981634123456
_ARRAYS: Final = ("qpos", "qvel", "act", "ctrl", "userdata")

_MODEL_BYTES: Final = 2048
_DATA_BYTES: Final = 1 << 20
"""How far the sizes in mjModel and the time in mjData are looked for; they come before arrays."""

_ARRAY_BYTES: Final = 512
"""How far behind the time the arrays are looked for: they come first of some hundred."""


class Layout(NamedTuple):
    """Offsets, bytes."""

    model_userdata_size: int  # in mjModel, a 32-bit integer at least
    time: int  # in mjData, a float
    qpos: int  # in mjData, as all below: the address of an array of floats
    qvel: int
    act: int
    ctrl: int
    userdata: int


@cache
def mjdata_layout() -> Layout:
    """Find the fields.

    Raises
    ------
    RuntimeError
        If this MuJoCo keeps them somewhere else altogether.
    """
    model = mujoco.MjModel.from_xml_string(_PROBE)
    data = mujoco.MjData(model)
    data.time = _TIME
    size = _first(model._address, _MODEL_BYTES, ctypes.c_int32, model.nuserdata)
    time = _first(data._address, _DATA_BYTES, ctypes.c_double, _TIME)
    words = np.ctypeslib.as_array(
        (ctypes.c_uint64 * (_ARRAY_BYTES // 8)).from_address(data._address + time)
    )
    places = {}
    for name in _ARRAYS:
        found = np.flatnonzero(words == getattr(data, name).ctypes.data)
        if found.size == 0:
            raise _not_found(f"mjData.{name}")
        # An empty array that lies before this one begins where this one does.
        places[name] = time + 8 * int(found[-1])
    return Layout(size, time, **places)


def _first(address: int, reach: int, kind: Any, value: float) -> int:
    """Offset of the first place that holds a value, read no further than there."""
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
