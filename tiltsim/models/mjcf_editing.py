"""Reading MJCF as a tree, and the edits that every vehicle's model needs."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from importlib.util import find_spec
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final
from xml.etree import ElementTree

from tiltsim.models.objects import Objects, add_objects
from tiltsim.models.parts import TiltServo

if TYPE_CHECKING:
    import mujoco


def parse_mjcf(path: Path) -> Any:
    """An MJCF file as dm_control's tree, or as one of the same interface on `mujoco.MjSpec`.

    The latter where dm_control is not installed, for which Python 3.13 is too new, and for files
    that MuJoCo reads and dm_control does not. Both trees compile to equal models.
    """
    if find_spec("dm_control") is not None:
        with warnings.catch_warnings():
            # dm_control tries its window systems on import; without a screen GLFW complains.
            warnings.filterwarnings("ignore", module="glfw")
            from dm_control import mjcf
        try:
            return mjcf.from_xml_string(_with_inclusions(path), model_dir=str(path.parent))
        except Exception:  # of many kinds
            pass
    from tiltsim.models.mjspec_tree import MjSpecTree

    return MjSpecTree(path)


def _with_inclusions(path: Path) -> bytes:
    """The MJCF of a file with included files in place; dm_control would put them at the end."""
    tree = ElementTree.fromstring(path.read_bytes())
    tree.attrib.setdefault("model", "MuJoCo Model")  # as MuJoCo calls it
    pending = [tree]
    while pending:
        element = pending.pop()
        for include in element.findall("include"):
            inside = ElementTree.fromstring((path.parent / include.get("file", "")).read_bytes())
            place = list(element).index(include)
            element[place : place + 1] = list(inside)
            pending.append(element)  # for the files that it includes
            break
        else:
            pending += element
    return ElementTree.tostring(tree)


Compile = Callable[[], "mujoco.MjModel"]


def compiler_of(root: Any, objects: Objects | None = None) -> Compile:
    """A function that compiles a tree as it is now, whatever is edited afterwards.

    Args:
        root: The tree.
        objects: Added to it.
    """
    import mujoco

    from tiltsim.models.mjspec_tree import MjSpecTree

    if isinstance(root, MjSpecTree):
        spec = root.spec.copy()
    else:
        unnamed = r' name="//unnamed_[^"]*"'  # dm_control's names of unnamed elements
        text = re.sub(unnamed, "", root.to_xml_string())
        if objects is None:
            return partial(mujoco.MjModel.from_xml_string, text, root.get_assets())
        spec = mujoco.MjSpec.from_string(text, assets=root.get_assets())
    if objects is not None:
        add_objects(spec, objects)
    compile_copy: Compile = spec.compile
    return compile_copy


def remove_visuals(root: Any, *, contacts: bool) -> None:
    """Remove all that is only drawn or measured: geoms, cameras, lights, sensors and their sites.

    ``contacts`` keeps the geoms that take part in contacts. The shipped vehicles have neither
    springs nor dampers, so that MuJoCo need not look for them.
    """
    root.option.flag.spring = root.option.flag.damper = "disable"
    for geom in root.find_all("geom"):
        if not contacts or not (geom.name or "").endswith(("collision", "ground")):
            geom.remove()
    for kind in ("camera", "light", "sensor"):
        for element in root.find_all(kind):
            element.remove()
    sites = [actuator.site for actuator in root.find_all("actuator")]
    acted_on = {getattr(site, "name", site) for site in sites}
    for site in root.find_all("site"):
        if site.name not in acted_on:
            site.remove()


def set_servos(
    root: Any, names: Sequence[str], servo: TiltServo, inertias: Sequence[float]
) -> None:
    """Give hinges and their actuators, position servos of the same names, a servo's behavior.

    Args:
        root: The tree.
        names: Names of the hinges.
        servo: Natural frequency, damping and stops.
        inertias: About each hinge, kg m^2.
    """
    for name, inertia in zip(names, inertias, strict=True):
        joint, actuator = root.find("joint", name), root.find("actuator", name)
        kp = inertia * servo.natural_frequency**2
        kv = 2.0 * inertia * servo.damping_ratio * servo.natural_frequency
        if actuator.tag == "position":
            actuator.kp, actuator.kv = kp, kv
            actuator.dampratio = actuator.inheritrange = None
        else:
            actuator.gaintype = "fixed"
            actuator.gainprm, actuator.biasprm = [kp, 0.0, 0.0], [0.0, -kp, -kv]
        joint.range = actuator.ctrlrange = (0.0, 0.0)
        joint.limited = actuator.ctrllimited = "false"
        if servo.max_angle is not None:
            _set_stop(root, joint, actuator, servo.max_angle)


def _set_stop(root: Any, joint: Any, actuator: Any, max_angle: float) -> None:
    """Limit a hinge and the command of its servo to plus and minus an angle (rad)."""
    in_file = max_angle if root.compiler.angle == "radian" else degrees(max_angle)
    joint.range, actuator.ctrlrange = (-in_file, in_file), (-max_angle, max_angle)
    joint.limited = actuator.ctrllimited = "true"
    # As stiff as MuJoCo allows: its usual stop is softer than the servo and would do nothing.
    joint.solreflimit = (2.0 * root.option.timestep, 1.0)
    joint.solimplimit = (0.99, 0.99, 0.001, 0.5, 2.0)


def add_states(root: Any, name: str, count: int) -> None:
    """Append integrators ``name_1``, ... that act on nothing; in the keyframes they are zero."""
    _add_idle_actuators(root, name, count, dyntype="integrator")
    _extend_keyframes(root, act=count, ctrl=count)


def add_memories(root: Any, name: str, count: int) -> None:
    """Append actuators ``name_1``, ... without gain, whose controls hold a sampled law's output."""
    _add_idle_actuators(root, name, count)
    _extend_keyframes(root, ctrl=count)


def _add_idle_actuators(root: Any, name: str, count: int, **attributes: str) -> None:
    vehicle = root.find("body", "vehicle")
    # Acting on a joint costs MuJoCo least.
    joint = vehicle.find_all("joint", immediate_children_only=True)[-1]
    for index in range(1, count + 1):
        _add_actuator(root, f"{name}_{index}", joint=joint, gainprm=[0.0], **attributes)


def add_wrench(root: Any, name: str, site: str) -> None:
    """Append a force and a torque at a site, along its axes."""
    for index, axis in enumerate(
        ("force_x", "force_y", "force_z", "torque_x", "torque_y", "torque_z")
    ):
        gear = [0.0] * 6
        gear[index] = 1.0
        _add_actuator(root, f"{name}_{axis}", site=site, gear=gear)
    _extend_keyframes(root, ctrl=6)


def add_hinge_torques(root: Any, name: str, hinges: int) -> None:
    """Append a torque about each of the first ``hinges`` tilt hinges."""
    for i in range(1, hinges + 1):
        _add_actuator(root, f"{name}_hinge_{i}", joint=f"tilt_{i}")
    _extend_keyframes(root, ctrl=hinges)


_PLAIN: Final = {
    "gear": [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    "dyntype": "none",
    "gaintype": "fixed",
    "gainprm": [1.0],
    "biastype": "none",
    "ctrllimited": "false",
    "actlimited": "false",
    "forcelimited": "false",
}
"""An actuator whose force is its control, whatever a user's file has as default."""


def _add_actuator(root: Any, name: str, **attributes: Any) -> None:
    root.actuator.add("general", name=name, **(_PLAIN | attributes))


def _extend_keyframes(root: Any, act: int = 0, ctrl: int = 0) -> None:
    for key in root.find_all("key"):
        for name, count in (("act", act), ("ctrl", ctrl)):
            values = getattr(key, name)
            if values is not None:  # else MuJoCo takes zeros for all
                setattr(key, name, [*values, *[0.0] * count])
