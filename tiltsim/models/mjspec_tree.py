"""MJCF as a tree on `mujoco.MjSpec`, with the interface of dm_control's tree.

It has the part of that interface that gives the shipped vehicles their geometry, so the same
functions edit either tree; attributes have MJCF's names and values. One difference remains: MuJoCo
copies defaults into the elements when it reads a file. Edits must therefore address elements, never
default classes.
"""

from __future__ import annotations

from typing import Any, Final

import mujoco
import numpy as np

_NAMES: Final = {"diaginertia": "inertia"}
"""Attributes with other names in MuJoCo than in MJCF."""


class _Element:
    """An element, whose attributes read and write MuJoCo's own."""

    def __init__(self, own: Any) -> None:
        self.__dict__["own"] = own

    def __getattr__(self, name: str) -> Any:
        value = getattr(self.own, _NAMES.get(name, name))
        if isinstance(value, np.ndarray):
            return None if np.isnan(value[0]) else value.copy()
        return value

    def __setattr__(self, name: str, value: Any) -> None:
        name = _NAMES.get(name, name)
        present = getattr(self.own, name)
        if isinstance(present, np.ndarray):  # as in MJCF, entries not given stay
            value = np.concatenate([value, present[len(value) :]])
        setattr(self.own, name, value)

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


class _Body(_Element):
    @property
    def inertial(self) -> _Inertial | None:
        return _Inertial(self.own) if self.own.explicitinertial else None

    def all_children(self) -> list[_Element]:
        """The children that may have a position or a size."""
        inertial = [] if self.inertial is None else [self.inertial]
        own = self.own
        others = map(_Element, (*own.joints, *own.cameras, *own.lights))
        shapes, bodies = map(_Shape, (*own.geoms, *own.sites)), map(_Body, own.bodies)
        return [*inertial, *others, *shapes, *bodies]


_KINDS: Final = {"body": _Body, "geom": _Shape, "site": _Shape}


class MjSpecTree:
    """The root of a tree, whose edits change a specification of MuJoCo's in place."""

    def __init__(self, spec: mujoco.MjSpec) -> None:
        self.spec = spec

    def find(self, kind: str, name: str) -> Any:
        """The element of a kind and name; None where there is none, and for defaults."""
        own = None if kind == "default" else getattr(self.spec, kind)(name)
        return None if own is None else _KINDS.get(kind, _Element)(own)
