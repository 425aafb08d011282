"""Visuals that a user's MJCF file lacks: sky, floor, light, arms, rotor discs.

Only pictures have it; the file flies as it is.
"""

from collections.abc import Iterable, Iterator
from typing import Any, Final

import mujoco
import numpy as np

from tiltsim.resources import shipped_folder
from tiltsim_controllers.mathematics.scalar import Floats

DISC_SHARE: Final = 0.45  # of the least distance between rotors: their discs do not touch
MAX_DISC: Final = 0.6  # of a rotor's distance from the body, so that the arms can be seen
ARM_SHARE: Final = 0.03  # of the distance of the farthest rotor
DEPTH: Final = 3.0  # m below the origin, of a floor that the file lacks
CLOCKWISE: Final = (0.05, 0.55, 0.50, 0.45)
COUNTERCLOCKWISE: Final = (0.85, 0.38, 0.10, 0.45)
CARBON: Final = (0.18, 0.19, 0.21, 1.0)
PLANE: Final = mujoco.mjtGeom.mjGEOM_PLANE
SKYBOX: Final = mujoco.mjtTexture.mjTEXTURE_SKYBOX


def dress(spec: mujoco.MjSpec) -> None:
    """Add the visuals that the files of the vehicles in a model lack."""
    model = spec.copy().compile()
    scene = mujoco.MjSpec.from_file(str(shipped_folder("mjcf") / "scene.xml"))
    if SKYBOX not in [texture.type for texture in spec.textures]:
        _copy_texture(spec, scene.texture("sky"))
        spec.visual.headlight.ambient = scene.visual.headlight.ambient
    if not model.nlight:
        light = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
        look = {"diffuse": (0.45, 0.45, 0.45), "dir": (0.1, 0.2, -1.0)}
        spec.worldbody.add_light(type=light, pos=(0.0, 0.0, 10.0), **look)
    planes = [geom for geom in spec.worldbody.geoms if geom.type == PLANE]
    if not planes:
        place = (0.0, 0.0, -DEPTH)
        planes = [spec.worldbody.add_geom(type=PLANE, size=(0.0, 0.0, 1.0), pos=place)]
        planes[0].contype = planes[0].conaffinity = 0
    bare = [plane for plane in planes if not plane.material and not plane.size[:2].all()]
    if bare:
        _copy_texture(spec, scene.texture("grid"))
        grid = spec.add_material(name="tiltsim_grid", texuniform=True, texrepeat=(1.0, 1.0))
        grid.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "tiltsim_grid"
        for plane in bare:
            plane.material = grid.name
    for body, shape in _missing_parts(model):
        mass = {"mass": 0.0, "contype": 0, "conaffinity": 0, "group": 2}
        spec.body(model.body(body).name).add_geom(**shape, **mass)


def _copy_texture(spec: mujoco.MjSpec, texture: Any) -> None:
    names = ("type", "builtin", "mark", "rgb1", "rgb2", "markrgb", "width", "height")
    look = {name: getattr(texture, name) for name in names}
    spec.add_texture(name=f"tiltsim_{texture.name}", **look)


def _missing_parts(model: mujoco.MjModel) -> Iterator[tuple[int, dict[str, Any]]]:
    """Bodies with the shapes of the arms and rotor discs that nothing in the model stands for."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for body in range(model.nbody):
        name = model.body(body).name
        if name == "vehicle" or name.endswith("_vehicle"):
            yield from _missing_on(model, data, body, name.removesuffix("vehicle"))


def _missing_on(
    model: mujoco.MjModel, data: mujoco.MjData, vehicle: int, prefix: str
) -> Iterator[tuple[int, dict[str, Any]]]:
    """See `_missing_parts`: on one vehicle, the names of whose parts begin with a prefix."""
    name = f"{prefix}rotor_"
    sites = [s for s in range(model.nsite) if model.site(s).name.startswith(name)]
    places = data.site_xpos[sites]
    turned = data.xmat[vehicle].reshape(3, 3)
    hubs = (places - data.xpos[vehicle]) @ turned  # along the body's axes
    lengths = np.linalg.norm(hubs, axis=1)
    apart = np.linalg.norm(places[:, np.newaxis] - places, axis=2)
    least = float(apart[apart > 1e-6].min(initial=2.0 * lengths.max()))
    visible = np.flatnonzero((model.geom_group <= 2) & (model.geom_bodyid > 0))
    centers, radii = data.geom_xpos[visible], model.geom_rbound[visible]
    for site, place, hub, length in zip(sites, places, hubs, lengths, strict=True):
        away = np.linalg.norm(centers - place, axis=1)
        radius = min(DISC_SHARE * least, MAX_DISC * float(length) or np.inf)
        if not ((radii >= 0.5 * radius) & (away < 0.5 * radius)).any():
            number = model.site(site).name.removeprefix(name)
            drag = float(model.actuator(f"{prefix}thrust_{number}").gear[5])
            color = COUNTERCLOCKWISE if drag < 0.0 else CLOCKWISE
            yield (
                int(model.site_bodyid[site]),
                {
                    "type": mujoco.mjtGeom.mjGEOM_CYLINDER,
                    "size": (radius, 0.02 * radius, 0.0),
                    "pos": model.site_pos[site],
                    "quat": model.site_quat[site],
                    "rgba": color,
                },
            )
        middle = data.xpos[vehicle] + turned @ (0.6 * hub)
        covered = _contains(model, data, visible.tolist(), middle)
        if length > 2.0 * ARM_SHARE * lengths.max() and not covered:
            yield (
                vehicle,
                {
                    "type": mujoco.mjtGeom.mjGEOM_CAPSULE,
                    "size": (ARM_SHARE * float(lengths.max()), 0.0, 0.0),
                    "fromto": (0.0, 0.0, 0.0, *hub),
                    "rgba": CARBON,
                },
            )


def _contains(
    model: mujoco.MjModel, data: mujoco.MjData, geoms: Iterable[int], point: Floats
) -> bool:
    """Whether a point (world, m) lies in the box around one of some geoms."""
    for geom in geoms:
        local = (point - data.geom_xpos[geom]) @ data.geom_xmat[geom].reshape(3, 3)
        center, half = model.geom_aabb[geom].reshape(2, 3)
        if (np.abs(local - center) <= half).all():
            return True
    return False
