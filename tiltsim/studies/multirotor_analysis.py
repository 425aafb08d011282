"""Analysis of gaits of any vehicle, and of the fleet, as plain dicts for JSON.

Angles are in rad, everything else in SI units and body axes; values that do not exist are None.
"""

from collections.abc import Sequence
from math import isfinite
from pathlib import Path
from typing import Any, Final

import numpy as np

from tiltsim.models.cross import as_multirotor
from tiltsim.models.rotor_table import Multirotor
from tiltsim.models.user_vehicle import read_user_vehicle
from tiltsim.resources import shipped_folder
from tiltsim.studies import gait_analysis
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
from tiltsim_controllers.gaits import plans
from tiltsim_controllers.gaits.plans import Gait
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.parameters import Vehicle
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
WORST: Final = ("rank", "torque_free_dimension", "singularity_margin")
"""Numbers whose smallest over a period is reported."""

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
    vehicle: Multirotor, angles: Sequence[float] | Floats, limits: tuple[float, float] | None = None
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


def gait_report(
    gait: Gait,
    vehicle: Vehicle | Multirotor,
    *,
    limits: tuple[float, float] | None = None,
    attitude: tuple[float, float] = (0.0, 0.0),
    faults: bool = False,
) -> dict[str, Any]:
    """Singularities, hover and attainable sets of a gait (``tiltsim gait --json``).

    Args:
        gait: Tilt angles over time.
        vehicle: Their vehicle; for a cross of four rotors the closed forms of
            `tiltsim.studies.gait_analysis` are added.
        limits: See `tilted_rotors`.
        attitude: Roll and pitch of the margins and the determinant, rad.
        faults: Whether to add the hovers without each rotor, and with other tilt angles.

    Returns:
        Values at time zero; rotor speeds are along the spins. A moving gait adds ``time``, a table
        of arrays over one period, and the worst values over it. Without rotor speed limits
        ``attainable`` is None, and ``side_force_share`` where the dimension is 3.
    """
    cross = vehicle if isinstance(vehicle, Vehicle) else None
    craft, start = as_multirotor(vehicle, tilting=True, reverses=False), gait.angles(0.0)
    rotors = tilted_rotors(craft, start, limits)
    found, at_start = hover(rotors), _singularities(start, craft, cross, attitude)
    dimension = at_start["torque_free_dimension"]
    basis = np.linalg.svd(torque_free_forces(rotors.force, rotors.torque).projector)[0]
    is_limited = limits is not None or bool(np.isfinite(craft.speed_ranges).all())
    report: dict[str, Any] = {
        "gait": gait.name,
        "source": gait.source,
        "rotors": len(craft.spins),
        "tilts": craft.tilts,
        "roll": attitude[0],
        "pitch": attitude[1],
        **at_start,
        "torque_free_forces": basis[:, :dimension].T.tolist(),
        "hover": _hover(found, craft),
        "hover_rotor_speeds": None if found is None else _along(found, craft),
        "side_force_share": side_force_share(rotors) if is_limited or dimension < 3 else None,
        "attainable": _attainable(rotors, found) if is_limited else None,
    }
    if not gait.is_constant:
        times = gait.sample_times()
        table = _singularities(gait.angles(times), craft, cross, attitude)
        report |= {
            "period": gait.period,
            "amplitude": gait.amplitude,
            "max_rate": gait.max_rate if isfinite(gait.max_rate) else None,
            "continuous": gait.is_continuous,
            **{f"min_{key}": min(table[key]) for key in WORST},
            "time": table | {"time": times.tolist(), "rates": gait.rates(times).tolist()},
        }
    if cross is not None:
        report |= gait_analysis.cross_report(gait, cross)
    else:
        if craft.tilts:
            report["with_tilts"] = _with_tilts(craft, rotors)
        report["warnings"] = _warnings(report, is_limited=is_limited)
    if faults:
        report["faults"] = [
            {"rotor": lost + 1, "hover": _hover(left, craft)}
            | (
                {"free_tilts": _free_tilts(craft, rotors, lost) if craft.tilts else None}
                if cross is None
                else gait_analysis.cross_loss(lost + 1, start, cross)
            )
            for lost, left in enumerate(rotor_losses(rotors))
        ]
    return report


def _singularities(
    angles: Floats, craft: Multirotor, cross: Vehicle | None, attitude: tuple[float, float]
) -> dict[str, Any]:
    """The singularity analysis of tilt angles of shape (M,), or (K, M) in order of time."""
    force, torque = force_and_torque(craft.table, angles)
    forces = torque_free_forces(force, torque)
    largest = np.linalg.norm(torque, axis=-2).max(axis=-1)[..., np.newaxis, np.newaxis]
    found = {
        "angles": angles,
        "rank": forces.rank,
        "singular_values": np.linalg.svd(torque / largest, compute_uv=False),
        "torque_free_dimension": forces.dimension,
        "torque_free_direction": hover_direction(forces),
        "singular_attitudes": np.take(SINGULAR_ATTITUDES, forces.dimension),
        "singularity_margin": singularity_margin(forces, world_up(*attitude)),
    }
    if cross is not None:
        found |= gait_analysis.closed_forms(angles, cross, attitude)
    directions = _vectors(found["torque_free_direction"])
    return {key: found[key].tolist() for key in found} | {"torque_free_direction": directions}


def _vectors(directions: Floats) -> Any:
    """Vectors as lists, null for NaN."""
    if directions.ndim > 1:
        return [_vectors(direction) for direction in directions]
    return None if np.isnan(directions).any() else directions.tolist()


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
    """The hover at the least tilt angles that keep level without a rotor, given by its index."""
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
    speeds = np.insert(np.copysign(np.sqrt(np.abs(found[1])), found[1]), lost, 0.0)
    return {"angles": tilts} | (_hover(hovering._replace(rotor_speeds=speeds), vehicle) or {})


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
        report = gait_report(plans.fixed(angles), vehicle, faults=True)
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
