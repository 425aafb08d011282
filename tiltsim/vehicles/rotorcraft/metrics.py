"""Metrics of the flights of tiltrotors and quadrotors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.scenario import Scenario
from tiltsim.vehicles.saturation import at_lower_limit, at_upper_limit, saturation_metrics
from tiltsim.vehicles.spans import in_last_second, when_settled
from tiltsim_controllers.analysis.singularity import force_matrix, torque_matrix, world_up
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.parameters import Vehicle
from tiltsim_controllers.vehicle.states import TILT_FIELDS

SETTLED_ALTITUDE: Final = 0.005  # m


def rotorcraft_metrics(
    columns: Mapping[str, Floats], scenario: Scenario, follows_position: bool
) -> dict[str, float | bool]:
    """See `tiltsim.closed_loop.vehicle_kind.VehicleKind.metrics`."""
    time = columns["time"]
    limits = scenario.any_rotorcraft
    signs = enumerate(limits.spins, start=1)
    spins = np.array([sign * columns[f"rotor_speed_{i}"] for i, sign in signs])
    saturated = at_upper_limit(spins, limits.max_rotor_speed)
    saturated |= at_lower_limit(spins, limits.min_rotor_speed)
    rates = [np.abs(rate).max() for name, rate in columns.items() if name.startswith("alpha_rate_")]
    return {
        **_position_metrics(columns, scenario, follows_position),
        **_attitude_metrics(columns, scenario.simulation.timestep),
        "min_rotor_speed": float(spins.min()),
        "max_rotor_speed": float(spins.max()),
        **_altitude_metrics(time, columns["z_ref"] - columns["z"]),
        **_singular_zone_metrics(columns),
        "max_tilt_rate": float(max(rates, default=0.0)),
        **_singularity_metrics(columns, limits.resolve()),
        **_null_metrics(columns),
        **saturation_metrics(time, saturated),
    }


def _position_metrics(
    columns: Mapping[str, Floats], scenario: Scenario, follows_position: bool
) -> dict[str, float | bool]:
    clock, metrics = (columns["time"], scenario.simulation.timestep), {}
    last_second, settled = in_last_second(*clock), when_settled(*clock)
    errors = {axis: columns[f"{axis}_ref"] - columns[axis] for axis in ("x", "y", "z")}
    for axis, error in errors.items():
        if follows_position or axis == "z":
            metrics[f"final_position_error_{axis}"] = float(np.mean(error[last_second]))
    if not follows_position or not settled.any():
        return metrics
    horizontal = np.hypot(errors["x"], errors["y"])
    metrics["sup_position_error_after_20s"] = float(horizontal[settled].max())
    metrics["least_position_error_after_20s"] = float(horizontal[settled].min())
    if scenario.reference.type == "circle":
        centre_x, centre_y, _ = scenario.reference.position
        orbit = np.hypot(columns["x"] - centre_x, columns["y"] - centre_y)[settled]
        metrics["max_orbit_radius_after_20s"] = float(orbit.max())
        metrics["min_orbit_radius_after_20s"] = float(orbit.min())
    return metrics


def _attitude_metrics(columns: Mapping[str, Floats], timestep: float) -> dict[str, float | bool]:
    angles, metrics = ("roll", "pitch", "yaw"), {}
    last_second = in_last_second(columns["time"], timestep)
    for angle in angles:
        # Near half a revolution samples of one direction have both signs.
        metrics[f"final_{angle}"] = float(np.mean(np.unwrap(columns[angle][last_second])))
    metrics["final_attitude_error"] = max(
        float(np.abs(_wrapped(columns[f"{angle}_ref"] - columns[angle])[last_second]).max())
        for angle in angles
    )
    for angle in ("roll", "pitch"):
        metrics[f"max_abs_{angle}"] = float(np.abs(columns[angle]).max())
    return metrics


def _wrapped(angle: Floats) -> Floats:
    """An angle within half a turn of zero."""
    return angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi))


def _altitude_metrics(time: Floats, error: Floats) -> dict[str, float | bool]:
    metrics = {"altitude_overshoot": max(0.0, float(-error.min()))}
    outside = np.flatnonzero(np.abs(error) > SETTLED_ALTITUDE)
    if not outside.size or outside[-1] < len(time) - 1:
        metrics["altitude_settling_time"] = float(time[outside[-1] + 1]) if outside.size else 0.0
    return metrics


def _singular_zone_metrics(columns: Mapping[str, Floats]) -> dict[str, float | bool]:
    """Chapter 2's determinant and the switches between its laws, where a flight has them."""
    metrics = {}
    if "published_determinant" in columns:
        metrics["max_published_determinant"] = float(columns["published_determinant"].max())
        metrics["min_published_determinant"] = float(columns["published_determinant"].min())
    if "attitude_zone" in columns:
        switches = np.flatnonzero(np.diff(columns["attitude_zone"]))
        metrics["switches"] = float(switches.size)
        if switches.size:
            metrics["first_switch_time"] = float(columns["time"][switches[0] + 1])
    return metrics


def _null_metrics(columns: Mapping[str, Floats]) -> dict[str, float]:
    if "null_part" not in columns:
        return {}
    return {"max_null_part": float(columns["null_part"].max())}


def _singularity_metrics(
    columns: Mapping[str, Floats], vehicle: Vehicle | Multirotor
) -> dict[str, float]:
    """How close the decoupling matrix came to a singular one, where a flight has such columns."""
    if "singularity_margin" not in columns:
        return {}
    metrics = {"min_singularity_margin": float(columns["singularity_margin"].min())}
    if "decoupling_condition" in columns:
        metrics["min_decoupling_condition"] = float(columns["decoupling_condition"].min())
    elif isinstance(vehicle, Vehicle):
        metrics["min_decoupling_condition"] = _min_decoupling_condition(columns, vehicle)
    return metrics


def _min_decoupling_condition(columns: Mapping[str, Floats], vehicle: Vehicle) -> float:
    tilts = np.stack([columns[name] for name in TILT_FIELDS], axis=-1)
    up = world_up(columns["roll"], columns["pitch"])
    lift = np.einsum("ni,nij->nj", up, force_matrix(tilts))[:, np.newaxis]
    torque = torque_matrix(tilts, vehicle)
    values = np.linalg.svd(np.concatenate([torque, lift], axis=1), compute_uv=False)
    return float((values[:, -1] / values[:, 0]).min())
