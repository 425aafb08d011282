"""Analysis of any multirotor at fixed tilt angles, and of the fleet, as plain dicts for JSON.

Angles are in rad, everything else in SI units and body axes; values that do not exist are None.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from tiltsim.models.rotor_table import Multirotor
from tiltsim.models.user_vehicle import read_user_vehicle
from tiltsim.resources import shipped_folder
from tiltsim_controllers.analysis.attainable import (
    AttainableSet,
    TiltedRotors,
    attainable_forces,
    attainable_torques,
    side_force_share,
)
from tiltsim_controllers.analysis.hover import (
    MAX_TILT,
    Hover,
    hover,
    level_hover,
    moved_outputs,
    rotor_losses,
)
from tiltsim_controllers.analysis.singularity import world_up
from tiltsim_controllers.analysis.torque_free import (
    SINGULAR_ATTITUDES,
    hover_direction,
    singularity_margin,
    torque_free_forces,
)
from tiltsim_controllers.gaits.plans import Gait
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.rotors import ROTOR_FLOATS, force_and_torque

UNLIMITED: Final = 100.0
"""Share of the weight that a rotor without a speed limit can carry, in a search for a hover."""

BY_TURNS: Final = (0.35, -0.35, 0.35, -0.35, 0.35, -0.35)
"""Tilt angles (rad), about as large as a fixed cant of 20 degrees."""
FLEET: Final[dict[str, tuple[float, ...]]] = {
    "bicopter": (0.0, 0.0),
    "tricopter": (-0.02127199, -0.02127199, -0.02121423),
    "quadrotor": (),
    "cant_quadrotor": (),
    "tiltrotor": (-0.65, -0.65, 0.65, 0.65),
    "hexarotor": (),
    "cant_hexarotor": (),
    "tilt_hexarotor": BY_TURNS,
    "tilt_heptarotor": (*BY_TURNS, 0.0),
    "tilt_octorotor": (*BY_TURNS, 0.35, -0.35),
    "omni_octorotor": (),
}
"""Names of the files, with tilt angles (rad) that show the vehicle's capabilities."""
FEW_ROTORS: Final = ("bicopter", "tricopter")
"""Vehicles whose tilts a law has to command, since a gait leaves too few inputs."""
KEYS: Final = (
    "rotors",
    "tilts",
    "angles",
    "torque_free_dimension",
    "singular_attitudes",
    "singularity_margin",
    "side_force_share",
)


def tilted_rotors(
    vehicle: Multirotor, angles: Sequence[float], limits: tuple[float, float] | None = None
) -> TiltedRotors:
    """The rotors of a vehicle at tilt angles (rad), one for each hinge.

    ``limits``, minimum and maximum rotor speed (rad/s), replace the file's; a rotor that turns
    either way has the maximum both ways.
    """
    ranges = np.array(vehicle.speed_ranges)
    if limits is not None:
        either_way = (ranges[:, 0] < 0.0) & (ranges[:, 1] > 0.0)
        along = np.outer(vehicle.spins, limits)
        ranges = np.sort(along, axis=1)
        ranges[either_way] = (-limits[1], limits[1])
    strongest = UNLIMITED * vehicle.mass * vehicle.gravity / min(vehicle.thrust_coefficients)
    lower, upper = np.clip(ranges * np.abs(ranges), -strongest, strongest).T
    force, torque = force_and_torque(vehicle.table, angles)
    return TiltedRotors(force, torque, lower, upper, vehicle.mass * vehicle.gravity)


def multirotor_report(
    vehicle: Multirotor,
    angles: Sequence[float],
    *,
    limits: tuple[float, float] | None = None,
    roll: float = 0.0,
    pitch: float = 0.0,
    faults: bool = False,
) -> dict[str, Any]:
    """Singularities, hover and attainable sets (``tiltsim gait --mjcf FILE --json``).

    Args:
        vehicle: of any number of rotors
        angles: one for each tilt hinge, rad
        limits: as for `tilted_rotors`
        roll, pitch: attitude of the margin, rad
        faults: whether to add the hovers without each rotor, and with other tilt angles

    Returns:
        Rotor speeds are along the spins, rad/s. Without rotor speed limits ``attainable`` is None,
        and ``side_force_share`` where the dimension is 3.
    """
    rotors = tilted_rotors(vehicle, angles, limits)
    forces = torque_free_forces(rotors.force, rotors.torque)
    dimension, direction = int(forces.dimension), hover_direction(forces)
    basis = np.linalg.svd(forces.projector)[0][:, :dimension]
    strongest = np.linalg.norm(rotors.torque, axis=0).max()
    values = np.linalg.svd(rotors.torque / strongest, compute_uv=False)
    found = hover(rotors)
    is_limited = limits is not None or bool(np.isfinite(vehicle.speed_ranges).all())
    report: dict[str, Any] = {
        "rotors": len(vehicle.spins),
        "tilts": vehicle.tilts,
        "angles": list(angles),
        "rank": int(forces.rank),
        "singular_values": values.tolist(),
        "torque_free_dimension": dimension,
        "torque_free_forces": basis.T.tolist(),
        "torque_free_direction": None if np.isnan(direction).any() else direction.tolist(),
        "singular_attitudes": SINGULAR_ATTITUDES[dimension],
        "singularity_margin": float(singularity_margin(forces, world_up(roll, pitch))),
        "roll": roll,
        "pitch": pitch,
        "hover_rotor_speeds": None if found is None else _along(found, vehicle),
        "hover": _hover(found, vehicle),
        "side_force_share": side_force_share(rotors) if is_limited or dimension < 3 else None,
        "attainable": _attainable(rotors, found) if is_limited else None,
    }
    if vehicle.tilts:
        report["with_tilts"] = _with_tilts(vehicle, rotors)
    if faults:
        report["faults"] = [
            {
                "rotor": lost + 1,
                "hover": _hover(found, vehicle),
                "free_tilts": _free_tilts(vehicle, rotors, lost) if vehicle.tilts else None,
            }
            for lost, found in enumerate(rotor_losses(rotors))
        ]
    report["warnings"] = _warnings(report, is_limited=is_limited)
    return report


def period_report(vehicle: Multirotor, gait: Gait, roll: float, pitch: float) -> dict[str, Any]:
    """The singularities of a moving gait over its period: a table of arrays, and their worst.

    Args:
        vehicle: of any number of rotors
        gait: its tilt angles over time
        roll, pitch: attitude of the margins, rad
    """
    times = gait.sample_times()
    angles = gait.angles(times)
    pairs = [force_and_torque(vehicle.table, row) for row in angles.tolist()]
    force, torque = (np.array(matrices) for matrices in zip(*pairs, strict=True))
    forces = torque_free_forces(force, torque)
    margin = singularity_margin(forces, world_up(roll, pitch))
    return {
        "min_torque_free_dimension": int(forces.dimension.min()),
        "min_singularity_margin": float(margin.min()),
        "time": {
            "time": times.tolist(),
            "angles": angles.tolist(),
            "rank": forces.rank.tolist(),
            "torque_free_dimension": forces.dimension.tolist(),
            "singular_attitudes": np.take(SINGULAR_ATTITUDES, forces.dimension).tolist(),
            "singularity_margin": margin.tolist(),
        },
    }


def _with_tilts(vehicle: Multirotor, rotors: TiltedRotors) -> dict[str, Any] | None:
    """The level hover of least tilt angles, and how many outputs rotors and tilts move there."""
    weight = np.array([0.0, 0.0, rotors.weight])
    found = level_hover(vehicle.table, weight, (rotors.lower, rotors.upper))
    if found is None:
        return None
    tilts, w = found
    return {
        "angles": np.round(tilts, 9).tolist(),
        "rotor_speeds": _speeds_along(w, vehicle.spins),
        **moved_outputs(vehicle.table, tilts, w)._asdict(),
    }


def _speeds_along(w: Floats, spins: Sequence[float]) -> list[float]:
    """Rotor speeds (rad/s) along the spins, of inputs w."""
    return (np.array(spins) * np.copysign(np.sqrt(np.abs(w)), w)).tolist()


def _free_tilts(vehicle: Multirotor, rotors: TiltedRotors, lost: int) -> dict[str, Any] | None:
    """The least tilt angles that hover level without a rotor, given by its index."""
    first = lost * ROTOR_FLOATS
    table = vehicle.table[:first] + vehicle.table[first + ROTOR_FLOATS :]
    remaining = rotors.without(lost)
    found = level_hover(table, np.array([0.0, 0.0, rotors.weight]), remaining[2:4])
    if found is None:
        return None
    # The last pods may have lost their rotors.
    tilts = [*np.round(found[0], 9).tolist(), *[0.0] * vehicle.tilts][: vehicle.tilts]
    force, torque = force_and_torque(table, tilts)
    hovering = hover(remaining._replace(force=force, torque=torque))
    assert hovering is not None
    speeds = _speeds_along(found[1], np.delete(vehicle.spins, lost).tolist())
    return {
        "angles": tilts,
        "rotor_speeds": np.insert(speeds, lost, 0.0).tolist(),
        "controllable": hovering.controllable,
    }


def balance_report(
    vehicle: Multirotor,
    acceleration: tuple[float, float, float],
    limits: tuple[float, float] | None = None,
) -> dict[str, list[float]]:
    """Tilt angles and rotor speeds that hold the vehicle level under an acceleration (m/s^2).

    The acceleration is constant, world axes at yaw 0; ``limits`` as for `tilted_rotors`. Raises
    ValueError if no tilt angles and rotor speeds within the limits do.
    """
    rotors = tilted_rotors(vehicle, (0.0,) * vehicle.tilts, limits)
    weight = np.array([0.0, 0.0, vehicle.gravity])
    force = vehicle.mass * (weight - acceleration)
    found = level_hover(vehicle.table, force, rotors[2:4]) if force.any() else None
    if found is None:
        raise ValueError(
            f"no tilt angles up to {MAX_TILT:.3g} rad and rotor speeds within the limits hold the"
            " vehicle level"
        )
    tilts, w = found
    return {
        "acceleration": list(acceleration),
        "angles": tilts.tolist(),
        "rotor_speeds": _speeds_along(w, vehicle.spins),
    }


def _along(found: Hover, vehicle: Multirotor) -> list[float]:
    return [float(s * w) for s, w in zip(vehicle.spins, found.rotor_speeds, strict=True)]


def _hover(found: Hover | None, vehicle: Multirotor) -> dict[str, Any] | None:
    if found is None:
        return None
    return {
        "lean": found.lean,
        "force": found.force.tolist(),
        "rotor_speeds": _along(found, vehicle),
        "max_rotor_speed": found.max_rotor_speed,
        "controllable": found.controllable,
    }


def _attainable(rotors: TiltedRotors, found: Hover | None) -> dict[str, Any]:
    """The torque-free forces, and the torques while the lift of the hover carries the weight."""
    sets = {"forces": attainable_forces(rotors)}
    if found is not None:
        sets["torques"] = attainable_torques(rotors, found.force / rotors.weight)
    return {name: _extent(attainable) for name, attainable in sets.items()}


def _extent(attainable: AttainableSet) -> dict[str, Any]:
    empty = attainable.is_empty
    return {
        "dimension": attainable.dimension,
        "lower": None if empty else attainable.lower.tolist(),
        "upper": None if empty else attainable.upper.tolist(),
        "vertices": attainable.vertices.tolist(),
    }


def _warnings(report: dict[str, Any], *, is_limited: bool) -> list[str]:
    warnings = []
    if report["rank"] < 3:
        warnings.append(
            f"rank of tau is {report['rank']}: the decoupling matrix is singular at every attitude"
        )
    elif report["torque_free_dimension"] == 0:
        warnings.append(
            "the rotors make no force without torque: the decoupling matrix is singular at every"
            " attitude"
        )
    tilting = report.get("with_tilts")
    if report["torque_free_dimension"] == 0 and tilting and tilting["attitude_and_lift"] == 4:
        warnings[-1] += "; with its tilts as inputs the vehicle hovers and can be controlled"
    if report["hover"] is None:
        warnings.append("no hover within the rotors' limits")
    elif not report["hover"]["controllable"]:
        warnings.append("in hover a rotor is at a limit, or tau has lost rank: no full control")
    if not is_limited:
        warnings.append(
            "the file gives no highest rotor speeds (actrange of rotor_speed_i): what the rotors"
            " can attain is not known; give --speed-limits MIN,MAX"
        )
    return warnings


def fleet_file(name: str) -> Path:
    """The MJCF file of a vehicle of the fleet."""
    return shipped_folder("mjcf") / f"{name}.xml"


def fleet_report() -> list[dict[str, Any]]:
    """The vehicles, in the order of `FLEET` (``tiltsim fleet --json``).

    ``survives`` lists the rotors, from 1, whose loss leaves a hover that can be controlled, if need
    be with other tilt angles.
    """
    rows = []
    for name, angles in FLEET.items():
        vehicle = read_user_vehicle(str(fleet_file(name)), "multirotor").vehicle
        assert isinstance(vehicle, Multirotor)
        report = multirotor_report(vehicle, angles, faults=True)
        rows.append(
            {
                "name": name,
                **{key: report[key] for key in KEYS},
                "with_tilts": report.get("with_tilts"),
                "max_rotor_speed": report["hover"]["max_rotor_speed"],
                "survives": [loss["rotor"] for loss in report["faults"] if _survives(loss)],
            }
        )
    return rows


def _survives(loss: dict[str, Any]) -> bool:
    hovers = [hover for hover in (loss["hover"], loss["free_tilts"]) if hover is not None]
    return any(hover["controllable"] for hover in hovers)
