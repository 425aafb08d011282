"""Edit MJCF before it is compiled."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any


def strip(root: Any, contacts: bool) -> None:
    """Remove what is only drawn or read: geoms without contacts, cameras, lights and sensors.

    The shipped vehicles have neither springs nor dampers, so that MuJoCo need not look for them.
    """
    root.option.flag.spring = root.option.flag.damper = "disable"
    for geom in root.find_all("geom"):
        if not contacts or not geom.name.endswith(("collision", "ground")):
            geom.remove()
    for kind in ("camera", "light", "sensor"):
        for element in root.find_all(kind):
            element.remove()
    acted_on = {getattr(actuator.site, "name", actuator.site) for actuator in root.actuator.general}
    for site in root.find_all("site"):
        if site.name not in acted_on:
            site.remove()


def parse_mjcf(path: Path) -> Any:
    """An MJCF file as dm_control's tree."""
    with warnings.catch_warnings():
        # dm_control tries its window systems on import; without a screen GLFW complains.
        warnings.filterwarnings("ignore", module="glfw")
        from dm_control import mjcf
    return mjcf.from_path(str(path))


def add_law_states(root: Any, count: int) -> None:
    """Append the states of a law: integrators that act on nothing."""
    _add_states(root, "law", count)


def _add_states(root: Any, name: str, count: int) -> None:
    """Append integrators that act on nothing; in the keyframes they rest at zero."""
    joint = _idle_joint(root)
    for index in range(1, count + 1):
        root.actuator.add(
            "general",
            name=f"{name}_{index}",
            joint=joint,
            dyntype="integrator",
            gainprm=[0.0],
        )
    _extend_keyframes(root, act=count, ctrl=count)


def _idle_joint(root: Any) -> Any:
    """What actuators without gain act on; of all that there is, a joint costs MuJoCo least."""
    vehicle = root.find("body", "vehicle")
    return vehicle.freejoint or vehicle.joint[-1]


def _add_memories(root: Any, name: str, count: int) -> None:
    """Append actuators without gain, whose controls remember what a held law has said."""
    joint = _idle_joint(root)
    for index in range(1, count + 1):
        root.actuator.add(
            "general",
            name=f"{name}_{index}",
            joint=joint,
            gainprm=[0.0],
        )
    _extend_keyframes(root, ctrl=count)


def _add_wrench(root: Any, name: str) -> None:
    """Append a force and a torque on the body at its centre, in body axes."""
    for index, axis in enumerate(
        ("force_x", "force_y", "force_z", "torque_x", "torque_y", "torque_z")
    ):
        gear = [0.0] * 6
        gear[index] = 1.0
        root.actuator.add("general", name=f"{name}_{axis}", site="imu", gear=gear)
    _extend_keyframes(root, ctrl=6)


def _extend_keyframes(root: Any, act: int = 0, ctrl: int = 0) -> None:
    for key in root.keyframe.key:
        key.act = [*key.act, *[0.0] * act]
        key.ctrl = [*key.ctrl, *[0.0] * ctrl]
