"""Hexarotors without a rotor fly, or not, as statics predicts; seven swaying arms drift."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from math import asin, atan2

import numpy as np
import pytest

import tiltsim
from tiltsim.models.rotor_table import Multirotor
from tiltsim.models.user_vehicle import read_user_vehicle
from tiltsim.studies.multirotor_analysis import fleet_file, gait_report, tilted_rotors
from tiltsim_controllers.analysis.hover import rotor_losses
from tiltsim_controllers.gaits import plans

ASIDE = (0.03, -0.02, 0.02)
"""Where the flights begin, m."""


KINDS = "rotor|thrust|rotor_speed|tilt|tilt_angle"


def without_rotor(name, lost, folder):
    """The file of a vehicle without rotor ``lost`` and its hinge, the others renumbered."""
    root = ElementTree.parse(fleet_file(name)).getroot()
    root.find("include").set("file", str(fleet_file("scene")))
    for parent in list(root.iter()):
        for element in list(parent):
            if re.fullmatch(f"({KINDS})_{lost}|hover", element.get("name", "")):
                parent.remove(element)
    for element in root.iter():
        for key in ("name", "site", "joint"):
            match = re.fullmatch(rf"({KINDS})_(\d+)", element.get(key, ""))
            if match and int(match[2]) > lost:
                element.set(key, f"{match[1]}_{int(match[2]) - 1}")
    file = folder / f"{name}.xml"
    ElementTree.ElementTree(root).write(file)
    return file


def predicted(name, lost):
    vehicle = read_user_vehicle(str(fleet_file(name)), "multirotor").vehicle
    assert isinstance(vehicle, Multirotor)
    return rotor_losses(tilted_rotors(vehicle, (0.0,) * vehicle.tilts))[lost - 1]


def flown(name, lost, folder, tilts=None, *, dimension=None, **initial):
    """A flight without a rotor, at zero or these tilt angles (rad)."""
    controller = {"law": "attitude_force"} | ({"dimension": dimension} if dimension else {})
    file = without_rotor(name, lost, folder)
    gait = {} if tilts is None else {"gait": {"type": "fixed", "angles": tilts}}
    return tiltsim.simulate(
        {
            "vehicle": {
                "model": "multirotor",
                "mjcf": str(file),
                "min_rotor_speed": 0.0,
                "max_rotor_speed": 838.0,
            },
            "simulation": {"duration": 12.0, "timestep": 0.002},
            "controller": controller,
            "initial": initial,
            "reference": {"type": "setpoint"},
            **gait,
        }
    )


@pytest.mark.slow
@pytest.mark.parametrize("lost", [1, 2, 3, 4])
def test_canted_hexarotor_hovers_leaning_without_a_rotor(lost, tmp_path):
    hover = predicted("cant_hexarotor", lost)
    assert hover.controllable
    up = hover.force / np.linalg.norm(hover.force)
    attitude = [atan2(up[1], up[2]), -asin(up[0]), 0.0]
    speeds = np.abs(np.delete(hover.rotor_speeds, lost - 1)).tolist()
    flight = flown(
        "cant_hexarotor", lost, tmp_path, position=ASIDE, attitude=attitude, rotor_speed=speeds
    )
    metrics = flight.metrics()
    assert not metrics["diverged"]
    assert metrics["saturated_fraction"] == 0.0
    lean = np.cos(metrics["final_roll"]) * np.cos(metrics["final_pitch"])
    assert lean == pytest.approx(np.cos(hover.lean), abs=1e-4)
    for axis in "xyz":
        assert abs(metrics[f"final_position_error_{axis}"]) < 1e-3


@pytest.mark.parametrize("lost", [5, 6])
def test_canted_hexarotor_without_hover_is_refused(lost, tmp_path):
    assert predicted("cant_hexarotor", lost) is None
    with pytest.raises(tiltsim.InputError, match="no rotor speeds within the limits hold"):
        flown("cant_hexarotor", lost, tmp_path)


@pytest.mark.parametrize("name", ["hexarotor", "tilt_hexarotor"])
def test_planar_hexarotor_cannot_be_controlled_without_a_rotor(name, tmp_path):
    assert not predicted(name, 1).controllable
    flight = flown(name, 1, tmp_path)
    assert flight.metrics()["diverged"]
    assert flight.metrics()["duration"] < 0.1


@pytest.mark.slow
def test_tilting_hexarotor_hovers_level_with_other_tilts_without_a_rotor(tmp_path):
    """Its side force, of tilts of 0.01 rad, is too weak to control with: it leans instead."""
    vehicle = read_user_vehicle(str(fleet_file("tilt_hexarotor")), "multirotor").vehicle
    report = gait_report(plans.fixed((0.0,) * 6), vehicle, faults=True)
    tilts = report["faults"][0]["free_tilts"]["angles"]
    assert report["faults"][0]["free_tilts"]["controllable"]
    flight = flown("tilt_hexarotor", 1, tmp_path, tilts[1:], dimension=1, position=ASIDE)
    metrics = flight.metrics()
    assert not metrics["diverged"]
    for metric in ("position_error_x", "position_error_y", "position_error_z", "roll", "pitch"):
        assert abs(metrics[f"final_{metric}"]) < 1e-3


@pytest.mark.slow
def test_seven_swaying_arms_drift_unseen_unless_they_are_restored():
    overrides = {"simulation.duration": 25.0}
    drifting, restored = (
        tiltsim.simulate(tiltsim.load_scenario(f"fleet/state_drift#{name}", overrides)).metrics()
        for name in ("drifting", "restored")
    )
    for metrics in (drifting, restored):
        assert metrics["sup_position_error_after_20s"] < 1e-9
    assert drifting["min_rotor_speed"] < 205.0
    assert restored["min_rotor_speed"] > 225.0
