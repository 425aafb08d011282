"""The vehicles in ``mjcf`` with any number of rotors, and their capabilities."""

from pathlib import Path
from typing import Any, Final

from tiltsim.models.rotor_table import Multirotor
from tiltsim.models.user_vehicle import read_user_vehicle
from tiltsim.resources import shipped_folder
from tiltsim.studies.multirotor_analysis import multirotor_report

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
