"""Reading MJCF as a tree, and its edits; limits and versions of the files of a user's MJCF."""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Iterable, Sequence
from importlib.util import find_spec
from math import degrees, isfinite, prod
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final
from xml.etree import ElementTree

import numpy as np

from tiltsim.models.parts import ModelSpec, TiltServo
from tiltsim.system.files import is_file, is_folder

if TYPE_CHECKING:
    import mujoco

MAX_BYTES: Final = 4 * 2**20  # size of the file and all files that it includes, together
MAX_ELEMENTS: Final = 2_000
"""XML elements, with included files and each replica counted.

Ten times the elements of eight rotors on tilting arms. The time to edit a file grows with their
square: with 2,000 some 3 s, with 5,000 above 15 s.
"""
MAX_SAMPLES: Final = 4096**2  # pixels of a texture, or points of a height field
MAX_SIZE: Final = 100_000  # an attribute of ``<size>``
MAX_VALUES: Final = 1_000  # user values of each element of a kind, or of a user's sensor
MAX_FILES: Final = 10_000  # places at which the files are searched that it names
_MODELS: Final = ("include", "model")  # elements that name MJCF
_FOLDERS: Final = ("assetdir", "meshdir", "texturedir")
"""Attributes of ``<compiler>`` that say where files are."""
_TEXTS: Final = frozenset(("name", "class", "childclass", "file", "model"))
"""Attributes that are names, of any spelling."""


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
    import mujoco

    from tiltsim.models.mjspec_tree import MjSpecTree

    return MjSpecTree(mujoco.MjSpec.from_file(str(path)))


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


def spec_of(root: Any) -> mujoco.MjSpec:
    """A tree of `parse_mjcf` in MuJoCo's own form, which is edited and copied much faster."""
    import mujoco

    from tiltsim.models.mjspec_tree import MjSpecTree

    if isinstance(root, MjSpecTree):
        return root.spec
    unnamed = r' name="//unnamed_[^"]*"'  # dm_control's names of unnamed elements
    text = re.sub(unnamed, "", root.to_xml_string())
    return mujoco.MjSpec.from_string(text, assets=root.get_assets())


def set_integration(spec: mujoco.MjSpec, options: ModelSpec) -> None:
    """Set the time step, the integrator and the room for user data."""
    import mujoco

    spec.option.timestep, spec.nuserdata = options.timestep, options.userdata_size
    integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{options.integrator.upper()}")
    spec.option.integrator = integrator


def set_flags(spec: mujoco.MjSpec, **flags: bool) -> None:
    """Enable or disable parts of MuJoCo's physics, by their names in ``<flag>``."""
    import mujoco

    for name, enabled in flags.items():
        bit = int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{name.upper()}"))
        spec.option.disableflags = spec.option.disableflags & ~bit | bit * (not enabled)


def remove_visuals(spec: mujoco.MjSpec, *, contacts: bool, kept: Iterable[str] = ()) -> None:
    """Remove all that is only drawn or measured: geoms, cameras, lights, sensors and their sites.

    ``contacts`` keeps the geoms that take part in contacts, ``kept`` are sites that stay. The
    shipped vehicles have neither springs nor dampers, so that MuJoCo need not look for them.
    """
    import mujoco

    set_flags(spec, spring=False, damper=False)
    acting = (a for a in spec.actuators if a.trntype == mujoco.mjtTrn.mjTRN_SITE)
    kept = {*kept, *(actuator.target for actuator in acting)}
    touching = ("collision", "ground") if contacts else ()
    drawn = (geom for geom in spec.geoms if not geom.name.endswith(touching))
    sites = (site for site in spec.sites if site.name not in kept)
    for element in (*drawn, *spec.cameras, *spec.lights, *spec.sensors, *sites):
        spec.delete(element)


def set_servos(
    spec: mujoco.MjSpec, names: Sequence[str], servo: TiltServo, inertias: Sequence[float]
) -> None:
    """Give hinges and their actuators, position servos of the same names, a servo's behavior.

    Args:
        spec: The vehicle.
        names: Names of the hinges.
        servo: Natural frequency, damping and stops.
        inertias: About each hinge, kg m^2.
    """
    import mujoco

    limited, angle = mujoco.mjtLimited.mjLIMITED_FALSE, 0.0
    if servo.max_angle is not None:
        limited, angle = mujoco.mjtLimited.mjLIMITED_TRUE, servo.max_angle
    in_file = degrees(angle) if spec.compiler.degree else angle
    for name, inertia in zip(names, inertias, strict=True):
        joint, actuator = spec.joint(name), spec.actuator(name)
        kp = inertia * servo.natural_frequency**2
        kv = 2.0 * inertia * servo.damping_ratio * servo.natural_frequency
        actuator.gaintype = mujoco.mjtGain.mjGAIN_FIXED
        actuator.gainprm[:3], actuator.biasprm[:3] = (kp, 0.0, 0.0), (0.0, -kp, -kv)
        joint.range, actuator.ctrlrange = (0.0 - in_file, in_file), (0.0 - angle, angle)
        actuator.inheritrange = 0.0  # its own range, not the joint's
        joint.limited = actuator.ctrllimited = limited
        if servo.max_angle is not None:
            # As stiff as MuJoCo allows: its usual stop is softer than the servo and does nothing.
            joint.solref_limit = (2.0 * spec.option.timestep, 1.0)
            joint.solimp_limit = (0.99, 0.99, 0.001, 0.5, 2.0)


def add_states(spec: mujoco.MjSpec, name: str, count: int) -> None:
    """Append integrators ``name_1``, ... that act on nothing; in the keyframes they are zero."""
    import mujoco

    add_memories(spec, name, count, dyntype=mujoco.mjtDyn.mjDYN_INTEGRATOR)
    _extend_keyframes(spec, "act", count)


def add_memories(spec: mujoco.MjSpec, name: str, count: int, **attributes: Any) -> None:
    """Append actuators ``name_1``, ... without gain, whose controls hold a sampled law's output."""
    joint = spec.body("vehicle").joints[-1].name  # acting on a joint costs MuJoCo least
    for index in range(1, count + 1):
        _add_actuator(spec, f"{name}_{index}", joint, gain=0.0, **attributes)


def add_wrench(spec: mujoco.MjSpec, name: str, site: str) -> None:
    """Append a force and a torque at a site, along its axes."""
    import mujoco

    axes = [f"{kind}_{axis}" for kind in ("force", "torque") for axis in "xyz"]
    for axis, gear in zip(axes, np.eye(6).tolist(), strict=True):
        at_site = mujoco.mjtTrn.mjTRN_SITE
        _add_actuator(spec, f"{name}_{axis}", site, gear=gear, trntype=at_site)


def add_hinge_torques(spec: mujoco.MjSpec, name: str, hinges: int) -> None:
    """Append a torque about each of the first ``hinges`` tilt hinges."""
    for i in range(1, hinges + 1):
        _add_actuator(spec, f"{name}_hinge_{i}", f"tilt_{i}")


def _add_actuator(
    spec: mujoco.MjSpec, name: str, target: str, gain: float = 1.0, **attributes: Any
) -> None:
    """An actuator whose force is its control times a gain, whatever a file has as default."""
    import mujoco

    free = mujoco.mjtLimited.mjLIMITED_FALSE
    plain = {
        "trntype": mujoco.mjtTrn.mjTRN_JOINT,
        "gear": [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        "dyntype": mujoco.mjtDyn.mjDYN_NONE,
        "gaintype": mujoco.mjtGain.mjGAIN_FIXED,
        "biastype": mujoco.mjtBias.mjBIAS_NONE,
        **dict.fromkeys(("ctrllimited", "actlimited", "forcelimited"), free),
        **dict.fromkeys(("ctrlrange", "forcerange"), (0.0, 0.0)),
        "inheritrange": 0.0,
    }
    actuator = spec.add_actuator(name=name, target=target)
    for attribute, value in (plain | attributes).items():
        setattr(actuator, attribute, value)
    actuator.gainprm[0] = gain
    _extend_keyframes(spec, "ctrl", 1)


def _extend_keyframes(spec: mujoco.MjSpec, vector: str, count: int) -> None:
    for key in spec.keys:
        values = list(getattr(key, vector))
        if values:  # else MuJoCo takes zeros for all
            setattr(key, vector, [*values, *[0.0] * count])


def check_mjcf(path: Path) -> set[Path]:
    """Raise ValueError, in one line, for MJCF that is no XML, too large, or has a NaN in it.

    Returns:
        The file and all that its includes, meshes and textures can be: MuJoCo and dm_control search
        for them in different places. Most of these do not exist.
    """
    waiting, bytes_read, elements = [path], 0, 0
    names, folders = {path.name}, {"."}
    while waiting:
        file = waiting.pop()
        if not is_file(file):
            continue  # MuJoCo reports it
        bytes_read += file.stat().st_size
        if bytes_read > MAX_BYTES:
            raise ValueError(f"more than {MAX_BYTES} bytes with what it includes")
        inside = file.parent.is_relative_to(path.parent)
        folders.add(str(file.parent.relative_to(path.parent) if inside else file.parent))
        try:
            # MuJoCo reads some text that is no XML; dm_control, which edits the file, does not.
            root = ElementTree.fromstring(file.read_bytes())
        except (ElementTree.ParseError, ValueError, OSError) as error:
            raise ValueError(f"not XML: {' '.join(str(error).split())}") from None
        pending = [(root, 1)]
        while pending:
            element, replicas = pending.pop()
            _check_attributes(element)
            named = {value for name, value in element.attrib.items() if name.startswith("file")}
            names |= named | {Path(name).name for name in named}
            if element.tag in _MODELS:
                waiting += {
                    folder / name for name in named for folder in (path.parent, file.parent)
                }
            elif element.tag == "compiler":
                folders |= {element.get(key, ".") for key in _FOLDERS}
            replicas *= prod(max(1, int(count)) for count in _numbers(element.get("count", "")))
            elements += replicas
            if elements > MAX_ELEMENTS:
                raise ValueError(f"more than {MAX_ELEMENTS} elements")
            pending += [(child, replicas) for child in element]
    if len(names) * len(folders) ** 2 > MAX_FILES:
        raise ValueError(f"more than {MAX_FILES} places of files that it names")
    found = {path.parent / one / two / name for one in folders for two in folders for name in names}
    for file in sorted(found):
        if os.path.lexists(file) and not (is_file(file) or is_folder(file)):
            raise ValueError(f"{file}: no file to read, but a pipe, a device or a broken link")
    return found


Version = tuple[tuple[Path, int, int], ...]
"""Time of the last change (ns) and size of files; zeros for files that do not exist."""

_versions: dict[Path, Version] = {}


def mjcf_version(path: Path) -> Version:
    """The version of an MJCF file and its named files. Raises ValueError as `check_mjcf`."""
    known = _versions.get(path)
    if known is None or known != _version_of(file for file, *_ in known):
        known = _versions[path] = _version_of(sorted(check_mjcf(path)))
    return known


def _version_of(files: Iterable[Path]) -> Version:
    found = []
    for file in files:
        try:
            state = file.stat()
        except (OSError, ValueError):
            found.append((file, 0, 0))
        else:
            found.append((file, state.st_mtime_ns, state.st_size))
    return tuple(found)


def _check_attributes(element: Any) -> None:
    for name, value in element.attrib.items():
        if name not in _TEXTS and not all(map(isfinite, _numbers(value))):
            raise ValueError(f"{element.tag} {name} = {value[:60]!r}: must be finite")
    for pair in (("nrow", "ncol"), ("width", "height")):
        samples = prod(number for name in pair for number in _numbers(element.get(name, "")))
        if samples > MAX_SAMPLES:
            raise ValueError(f"{element.tag} {' x '.join(pair)}: more than {MAX_SAMPLES} samples")
    for name, value in element.attrib.items():
        most = MAX_VALUES if name == "dim" or name.startswith("nuser_") else MAX_SIZE
        limited = name == "dim" or element.tag == "size"
        if limited and any(number > most for number in _numbers(value)):
            raise ValueError(f"{element.tag} {name} = {value[:60]}: at most {most}")


def _numbers(text: str) -> list[float]:
    """The numbers in an attribute; other words are left out."""
    found = []
    for word in text.split():
        try:
            found.append(float(word))
        except ValueError:
            continue
    return found
