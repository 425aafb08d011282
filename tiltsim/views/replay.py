"""Replaying a flight on a MuJoCo model: where each of its bodies was at every sample.

Nothing here knows a particular vehicle. Free joints take the recorded position and attitude, every
other joint the column that bears its name (`COLUMN_OF_JOINT` lists the exceptions), and what has no
column stays where the model puts it.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import floor, log10
from typing import TYPE_CHECKING, Final, NamedTuple

import mujoco
import numpy as np

from tiltsim.closed_loop.userdata import HEADER_SIZE
from tiltsim.laws.assembling import control_setup
from tiltsim.plants.flight_model import build_model
from tiltsim_controllers.mathematics.rotation import quaternion_from_euler
from tiltsim_controllers.mathematics.scalar import Floats

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import Scenario

Columns = Mapping[str, Floats]

COLUMN_OF_JOINT: Final = {f"tilt_{i}": f"alpha_{i}" for i in (1, 2, 3, 4)} | {"tilt": "alpha"}
"""Columns of joints that do not bear the column's name."""


class Poses(NamedTuple):
    """Poses of all bodies of a model over N samples."""

    position: Floats  # (N, nbody, 3), m
    quaternion: Floats  # (N, nbody, 4), scalar first


def visible_model(scenario: Scenario) -> mujoco.MjModel:
    """The compiled model of a scenario's vehicle with everything that is drawn."""
    # The same arguments as for the flight: what they compose is then at hand.
    userdata_size = HEADER_SIZE + len(control_setup(scenario).userdata)
    return build_model(scenario, userdata_size=userdata_size, visuals=True)


def joint_positions(model: mujoco.MjModel, columns: Columns) -> Floats:
    """MuJoCo's ``qpos`` at every sample, shape (N, nq)."""
    qpos = np.tile(model.qpos0, (len(columns["time"]), 1))
    for joint in range(model.njnt):
        address = model.jnt_qposadr[joint]
        kind = mujoco.mjtJoint(model.jnt_type[joint])
        if kind == mujoco.mjtJoint.mjJNT_FREE:
            qpos[:, address : address + 3] = _stack(columns, ("x", "y", "z"))
            angles = _stack(columns, ("roll", "pitch", "yaw")).tolist()
            qpos[:, address + 3 : address + 7] = [quaternion_from_euler(*row) for row in angles]
        elif kind in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE):
            name = model.joint(joint).name
            column = COLUMN_OF_JOINT.get(name, name)
            if column in columns:
                qpos[:, address] = columns[column]
    return qpos


def world_poses(model: mujoco.MjModel, qpos: Floats) -> Poses:
    """Poses of the bodies in the world."""
    data = mujoco.MjData(model)
    poses = Poses(np.empty((len(qpos), model.nbody, 3)), np.empty((len(qpos), model.nbody, 4)))
    for sample, row in enumerate(qpos):
        data.qpos = row
        mujoco.mj_kinematics(model, data)
        poses.position[sample], poses.quaternion[sample] = data.xpos, data.xquat
    return poses


def poses_in_parents(model: mujoco.MjModel, poses: Poses) -> Poses:
    """Poses of the bodies relative to the bodies that carry them."""
    parents = model.body_parentid
    turn = poses.quaternion[:, parents] * (1.0, -1.0, -1.0, -1.0)  # the inverse rotations
    apart = poses.position - poses.position[:, parents]
    return Poses(rotate(turn, apart), _product(turn, poses.quaternion))


def thrust_sites(model: mujoco.MjModel) -> dict[int, str]:
    """Sites that carry a rotor's thrust along their z axis, and the column that holds it (N)."""
    names = {site: model.site(site).name for site in range(model.nsite)}
    return {
        site: name.replace("rotor_", "thrust_")
        for site, name in names.items()
        if name.startswith("rotor_")
    }


def vehicle_radius(model: mujoco.MjModel) -> float:
    """How far a vehicle's thrusts or bodies reach from its centre (m), at least 1 cm."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    free = first_free_body(model)
    points = [data.site_xpos[site] for site in thrust_sites(model)] or data.xpos[free:]
    return max(0.01, float(np.max(np.linalg.norm(points - data.xpos[free], axis=1))))


def thrust_scale(model: mujoco.MjModel) -> float:
    """Length of a thrust arrow (m/N): 1, 2 or 5 times a power of ten, at hover about one radius."""
    free = first_free_body(model)
    weight = float(model.body_subtreemass[free] * np.linalg.norm(model.opt.gravity))
    rotors = max(1, len(thrust_sites(model)))
    wanted = vehicle_radius(model) * rotors / max(weight, 1e-9)
    decade = 10.0 ** floor(log10(wanted))
    return min((digit * decade for digit in (1.0, 2.0, 5.0, 10.0)), key=lambda x: abs(x - wanted))


def first_free_body(model: mujoco.MjModel) -> int:
    """The body that moves as the vehicle does: the first with a joint."""
    moving = np.flatnonzero(model.body_dofnum)
    return int(moving[0]) if len(moving) else 0


def rotate(quaternion: Floats, vector: Floats) -> Floats:
    """Vectors, shape (..., 3), turned by unit quaternions, shape (..., 4)."""
    axis = quaternion[..., 1:]
    across = 2.0 * np.cross(axis, vector)
    return np.asarray(vector + quaternion[..., :1] * across + np.cross(axis, across))


def _product(left: Floats, right: Floats) -> Floats:
    """Hamilton product of quaternions, shape (..., 4)."""
    scalar = left[..., :1] * right[..., :1]
    scalar = scalar - np.sum(left[..., 1:] * right[..., 1:], axis=-1, keepdims=True)
    vector = left[..., :1] * right[..., 1:] + right[..., :1] * left[..., 1:]
    return np.concatenate([scalar, vector + np.cross(left[..., 1:], right[..., 1:])], axis=-1)


def positions(columns: Columns) -> Floats:
    """The vehicle's positions at every sample, shape (N, 3); 0 along axes that it has not."""
    zero = np.zeros_like(columns["time"])
    return np.stack([columns.get(axis, zero) for axis in "xyz"], axis=1)


def reference_positions(columns: Columns) -> Floats:
    """The reference's positions at every sample, shape (N, 3); 0 along axes that it leaves out."""
    zero = np.zeros_like(columns["time"])
    return np.stack([columns.get(f"{axis}_ref", zero) for axis in "xyz"], axis=1)


def _stack(columns: Columns, names: tuple[str, ...]) -> Floats:
    return np.stack([columns[name] for name in names], axis=1)
