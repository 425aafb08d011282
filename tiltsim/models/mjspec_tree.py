"""MJCF as a tree on `mujoco.MjSpec`, with the interface of dm_control's tree.

It has the part of that interface that the models here use, so the same functions edit either tree;
attributes have MJCF's names and values. One difference remains: MuJoCo copies defaults into the
elements when it reads a file. Edits must therefore address elements, never default classes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import mujoco
import numpy as np

_NAMES: Final = {
    "diaginertia": "inertia",
    "solimplimit": "solimp_limit",
    "solreflimit": "solref_limit",
}
"""Attributes with other names in MuJoCo than in MJCF."""

_ENUMERATIONS: Final[dict[str, tuple[Any, str]]] = {
    "biastype": (mujoco.mjtBias, "mjBIAS_"),
    "cone": (mujoco.mjtCone, "mjCONE_"),
    "dyntype": (mujoco.mjtDyn, "mjDYN_"),
    "gaintype": (mujoco.mjtGain, "mjGAIN_"),
    "integrator": (mujoco.mjtIntegrator, "mjINT_"),
    "limited": (mujoco.mjtLimited, "mjLIMITED_"),
}
"""MuJoCo's values of the attributes that MJCF gives in words, by the end of their names."""


class _Element:
    """An element, whose attributes read and write MuJoCo's own."""

    def __init__(self, spec: mujoco.MjSpec, own: Any) -> None:
        self.__dict__.update(spec=spec, own=own)

    def __getattr__(self, name: str) -> Any:
        value = getattr(self.own, _NAMES.get(name, name))
        if isinstance(value, np.ndarray):
            return None if np.isnan(value[0]) else value.copy()
        return value

    def __setattr__(self, name: str, value: Any) -> None:
        name = _NAMES.get(name, name)
        for ending, (enumeration, prefix) in _ENUMERATIONS.items():
            if name.endswith(ending):
                value = getattr(enumeration, prefix + value.upper())
        present = getattr(self.own, name)
        if isinstance(present, np.ndarray):  # as in MJCF, entries not given stay
            value = np.concatenate([value, present[len(value) :]])
        setattr(self.own, name, value)

    def remove(self) -> None:
        self.spec.delete(self.own)

    def all_children(self) -> list[_Element]:
        return []


_SIZES: Final = {
    mujoco.mjtGeom.mjGEOM_SPHERE: 1,
    mujoco.mjtGeom.mjGEOM_CAPSULE: 2,
    mujoco.mjtGeom.mjGEOM_CYLINDER: 2,
}
"""Count of numbers in the size of a shape, if not three."""


class _Shape(_Element):
    """A geom or a site."""

    @property
    def size(self) -> Any:
        return self.own.size[: _SIZES.get(self.own.type, 3)].copy()

    def __setattr__(self, name: str, value: Any) -> None:
        if name == "zaxis":
            self.own.alt.type = mujoco.mjtOrientation.mjORIENTATION_ZAXIS
            self.own.alt.zaxis = value
        else:
            super().__setattr__(name, value)


class _Inertial(_Element):
    """Mass and inertia of a body."""

    pos = property(lambda self: self.own.ipos.copy())

    def __setattr__(self, name: str, value: Any) -> None:
        super().__setattr__("ipos" if name == "pos" else name, value)

    def remove(self) -> None:
        undefined = [np.nan] + [0.0] * 5
        self.own.explicitinertial = False
        self.own.mass, self.own.ipos, self.own.inertia = 0.0, [0.0] * 3, [0.0] * 3
        self.own.iquat, self.own.fullinertia = [1.0, 0.0, 0.0, 0.0], undefined
        self.own.ialt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT


class _Body(_Element):
    @property
    def inertial(self) -> _Inertial | None:
        return _Inertial(self.spec, self.own) if self.own.explicitinertial else None

    def add(self, kind: str, **attributes: Any) -> None:
        """Give the body a site, or an ``inertial``, which it does not have."""
        if kind == "site":
            self.own.add_site(**attributes)
            return
        self.own.explicitinertial = True
        _set(_Inertial(self.spec, self.own), attributes)

    def find_all(self, kind: str, *, immediate_children_only: bool = False) -> list[_Element]:
        own = self.own.find_all(kind)
        if immediate_children_only:
            own = [element for element in own if element.parent == self.own]
        return [_wrapped(self.spec, kind, element) for element in own]

    def all_children(self) -> list[_Element]:
        """The children that may have a position or a size."""
        kinds = ("joint", "geom", "site", "camera", "light", "body")
        inertial = [] if self.inertial is None else [self.inertial]
        groups = [self.find_all(kind, immediate_children_only=True) for kind in kinds]
        return [*inertial, *(element for group in groups for element in group)]


class _Actuator(_Element):
    def __setattr__(self, name: str, value: Any) -> None:
        super().__setattr__(name, value)
        if name == "ctrlrange":
            self.own.inheritrange = 0.0  # its own range, not the joint's

    @property
    def site(self) -> str | None:
        return self.own.target if self.own.trntype == mujoco.mjtTrn.mjTRN_SITE else None


class _Actuators:
    def __init__(self, spec: mujoco.MjSpec) -> None:
        self._spec = spec

    def add(
        self, _general: str, *, name: str, joint: Any = None, site: str = "", **attributes: Any
    ) -> None:
        """Append a general actuator on a joint, given by its element or name, or on a site."""
        kind = mujoco.mjtTrn.mjTRN_SITE if joint is None else mujoco.mjtTrn.mjTRN_JOINT
        target = site if joint is None else getattr(joint, "name", joint)
        own = self._spec.add_actuator(name=name, trntype=kind, target=target)
        _set(_Actuator(self._spec, own), attributes)


class _Key(_Element):
    def __getattr__(self, name: str) -> Any:
        return list(getattr(self.own, name)) or None

    def __setattr__(self, name: str, value: Sequence[float]) -> None:
        setattr(self.own, name, value)


class _Flags:
    """``<flag>`` of an option: words for bits that MuJoCo sets where something is disabled."""

    def __init__(self, spec: mujoco.MjSpec) -> None:
        self.__dict__["spec"] = spec

    def __setattr__(self, name: str, word: str) -> None:
        bit = int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{name.upper()}"))
        option = self.__dict__["spec"].option
        option.disableflags = option.disableflags & ~bit | (bit if word == "disable" else 0)


class _Option(_Element):
    @property
    def flag(self) -> _Flags:
        return _Flags(self.spec)


class _Compiler(_Element):
    @property
    def angle(self) -> str:
        return "degree" if self.own.degree else "radian"


_KINDS: Final = {"actuator": _Actuator, "body": _Body, "geom": _Shape, "key": _Key, "site": _Shape}


class MjSpecTree:
    """The root of a tree, whose edits change a specification of MuJoCo's in place."""

    def __init__(self, spec: mujoco.MjSpec) -> None:
        self.spec = spec
        self.size = _Element(spec, spec)
        self.option, self.compiler = _Option(spec, spec.option), _Compiler(spec, spec.compiler)
        self.actuator = _Actuators(spec)

    def find(self, kind: str, name: str) -> Any:
        """The element of a kind and name; None where there is none, and for defaults."""
        own = None if kind == "default" else getattr(self.spec, kind)(name)
        return None if own is None else _wrapped(self.spec, kind, own)

    def find_all(self, kind: str) -> list[Any]:
        """All elements of a kind, in their order."""
        return [_wrapped(self.spec, kind, own) for own in getattr(self.spec, f"{kind}s")]


def _wrapped(spec: mujoco.MjSpec, kind: str, own: Any) -> Any:
    return _KINDS.get(kind, _Element)(spec, own)


def _set(element: _Element, attributes: dict[str, Any]) -> None:
    for name, value in attributes.items():
        setattr(element, name, value)
