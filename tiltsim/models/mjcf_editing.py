"""Reading MJCF as dm_control's tree, and the edits that every vehicle's model needs."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

from tiltsim.models.parts import TiltServo
from tiltsim_controllers.vehicle.states import ROTORS


def parse_mjcf(path: Path) -> Any:
    """An MJCF file as dm_control's tree. Raises ValueError, in one line, where it has none."""
    with warnings.catch_warnings():
        # dm_control tries its window systems on import; without a screen GLFW complains.
        warnings.filterwarnings("ignore", module="glfw")
        from dm_control import mjcf
    try:
        return mjcf.from_path(str(path))
    except Exception as error:  # of many kinds, for what MuJoCo reads and dm_control does not
        raise ValueError(f"dm_control says: {' '.join(str(error).split())}") from error


def remove_visuals(root: Any, *, contacts: bool) -> None:
    """Remove all that is only drawn or measured: geoms, cameras, lights, sensors and their sites.

    ``contacts`` keeps the geoms that take part in contacts. The shipped vehicles have neither
    springs nor dampers, so that MuJoCo need not look for them.
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


def set_servo_gains(position: Any, inertia: float, servo: TiltServo) -> None:
    """Give a position actuator a servo's frequency and damping on a hinge's inertia (kg m^2)."""
    position.kp = inertia * servo.natural_frequency**2
    position.kv = 2.0 * inertia * servo.damping_ratio * servo.natural_frequency


def set_stop(joint: Any, position: Any, max_angle: float, timestep: float) -> None:
    """Limit a hinge and its servo's command to plus and minus an angle.

    Args:
        joint, position: Elements of the hinge and of its position actuator, or their defaults.
        max_angle: rad.
        timestep: Physics time step, s, which limits the stiffness of the stop.
    """
    joint.range = position.ctrlrange = (-max_angle, max_angle)
    # As stiff as MuJoCo allows: its usual stop is softer than the servo and would do nothing.
    joint.solreflimit = (2.0 * timestep, 1.0)
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
    joint = vehicle.freejoint or vehicle.joint[-1]  # acting on a joint costs MuJoCo least
    for index in range(1, count + 1):
        root.actuator.add(
            "general", name=f"{name}_{index}", joint=joint, gainprm=[0.0], **attributes
        )


def add_wrench(root: Any, name: str) -> None:
    """Append a force and a torque on the body at its centre, in body axes."""
    for index, axis in enumerate(
        ("force_x", "force_y", "force_z", "torque_x", "torque_y", "torque_z")
    ):
        gear = [0.0] * 6
        gear[index] = 1.0
        root.actuator.add("general", name=f"{name}_{axis}", site="imu", gear=gear)
    _extend_keyframes(root, ctrl=6)


def add_hinge_torques(root: Any, name: str) -> None:
    """Append a torque about each of the tilt hinges."""
    for i in ROTORS:
        root.actuator.add("general", name=f"{name}_hinge_{i}", joint=f"tilt_{i}")
    _extend_keyframes(root, ctrl=len(ROTORS))


def _extend_keyframes(root: Any, act: int = 0, ctrl: int = 0) -> None:
    for key in root.keyframe.key:
        key.act = [*key.act, *[0.0] * act]
        key.ctrl = [*key.ctrl, *[0.0] * ctrl]
