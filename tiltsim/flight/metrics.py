"""A flight in numbers: the metrics that expectations judge and sweeps collect."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING, Final

import numpy as np

from tiltsim.flight.saturation import at_lower_limit, at_upper_limit
from tiltsim.laws.assembling import loop_of
from tiltsim_controllers.analysis.singularity import force_matrix, torque_matrix, world_up
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.parameters import SPIN

if TYPE_CHECKING:
    from tiltsim.flight.flight import Flight


SETTLED_ALTITUDE: Final = 0.005  # m
SETTLED: Final = 20.0  # s, from when the supremum of the position error counts


def compute_metrics(flight: Flight) -> dict[str, float | bool]:
    """All metrics of a flight, over its recorded samples."""
    metrics = _METRICS_OF_KIND[loop_of(flight.scenario).kind.name](flight)
    return {name: value for name, value in metrics.items() if isfinite(value)}


def _rotorcraft_metrics(flight: Flight) -> dict[str, float | bool]:
    columns = flight.columns
    time = columns["time"]
    last_second = time >= time[-1] - 1.0
    metrics: dict[str, float | bool] = {}

    def final(values: Floats) -> float:
        return float(np.mean(values[last_second]))

    errors = {axis: columns[f"{axis}_ref"] - columns[axis] for axis in ("x", "y", "z")}
    follows_position = loop_of(flight.scenario).follows_position(flight.scenario)
    for axis, error in errors.items():
        if follows_position or axis == "z":
            metrics[f"final_position_error_{axis}"] = final(error)
    settled = time >= SETTLED
    if follows_position and settled.any():
        horizontal = np.hypot(errors["x"], errors["y"])
        metrics["sup_position_error_after_20s"] = float(horizontal[settled].max())
        metrics["least_position_error_after_20s"] = float(horizontal[settled].min())
        reference = flight.scenario.reference
        if reference.type == "circle":
            centre_x, centre_y, _ = reference.position
            orbit = np.hypot(columns["x"] - centre_x, columns["y"] - centre_y)[settled]
            metrics["max_orbit_radius_after_20s"] = float(orbit.max())
            metrics["min_orbit_radius_after_20s"] = float(orbit.min())
    for angle in ("roll", "pitch", "yaw"):
        # Near half a revolution samples of one direction have both signs.
        metrics[f"final_{angle}"] = float(np.mean(np.unwrap(columns[angle][last_second])))
    metrics["final_attitude_error"] = max(
        float(np.abs(_wrapped(columns[f"{angle}_ref"] - columns[angle])[last_second]).max())
        for angle in ("roll", "pitch", "yaw")
    )
    for angle in ("roll", "pitch"):
        metrics[f"max_abs_{angle}"] = float(np.abs(columns[angle]).max())

    spins = np.array([sign * columns[f"rotor_speed_{i}"] for i, sign in enumerate(SPIN, start=1)])
    metrics["min_rotor_speed"] = float(spins.min())
    metrics["max_rotor_speed"] = float(spins.max())
    metrics["altitude_overshoot"] = max(0.0, float(-errors["z"].min()))
    outside = np.flatnonzero(np.abs(errors["z"]) > SETTLED_ALTITUDE)
    if not outside.size or outside[-1] < len(time) - 1:
        metrics["altitude_settling_time"] = float(time[outside[-1] + 1]) if outside.size else 0.0
    if "published_determinant" in columns:
        metrics["max_published_determinant"] = float(columns["published_determinant"].max())
        metrics["min_published_determinant"] = float(columns["published_determinant"].min())
    if "attitude_zone" in columns:
        switches = np.flatnonzero(np.diff(columns["attitude_zone"]))
        metrics["switches"] = float(switches.size)
        if switches.size:
            metrics["first_switch_time"] = float(time[switches[0] + 1])
    rates = [np.abs(columns[f"alpha_rate_{i}"]).max() for i in (1, 2, 3, 4)]
    metrics["max_tilt_rate"] = float(max(rates))
    metrics["min_singularity_margin"] = float(columns["singularity_margin"].min())
    metrics["min_decoupling_condition"] = _min_decoupling_condition(flight)
    metrics["saturated_fraction"] = _saturated_fraction(flight, spins)
    metrics["diverged"] = flight.end.kind in {"diverged", "singular", "failed"}
    metrics["duration"] = float(time[-1])
    metrics["realtime_factor"] = float(time[-1] / max(flight.wall_time, 1e-9))
    return metrics


def _tilt_car_metrics(flight: Flight) -> dict[str, float | bool]:
    columns = flight.columns
    time = columns["time"]
    last_second, settled = time >= time[-1] - 1.0, time >= SETTLED
    errors = {axis: columns[f"{axis}_ref"] - columns[axis] for axis in ("x", "y")}
    speeds = np.array([columns["rotor_speed_1"], columns["rotor_speed_2"]])
    metrics: dict[str, float | bool] = {}
    for axis, error in errors.items():
        metrics[f"final_position_error_{axis}"] = float(np.mean(error[last_second]))
    if settled.any():
        horizontal = np.hypot(errors["x"], errors["y"])
        metrics["sup_position_error_after_20s"] = float(horizontal[settled].max())
    for axis, error in errors.items():
        metrics[f"max_abs_error_{axis}"] = float(np.abs(error).max())
    if "lyapunov" in columns:
        metrics["max_lyapunov"] = float(columns["lyapunov"].max())
    metrics["final_input_split"] = float(np.mean(columns["input_split"][last_second]))
    metrics["final_yaw"] = float(np.mean(columns["yaw"][last_second]))
    metrics["min_rotor_speed"] = float(speeds.min())
    metrics["max_rotor_speed"] = float(speeds.max())
    metrics["max_tilt_rate"] = float(np.abs(columns["alpha_rate"]).max())
    # A thrust cannot pull: at rest a rotor is at its limit.
    metrics["saturated_fraction"] = float(at_lower_limit(speeds, 0.0).any(axis=0).mean())
    metrics["diverged"] = flight.end.kind in {"diverged", "singular"}
    metrics["duration"] = float(time[-1])
    metrics["realtime_factor"] = float(time[-1] / max(flight.wall_time, 1e-9))
    return metrics


_METRICS_OF_KIND: Final = {"rotorcraft": _rotorcraft_metrics, "tilt_car": _tilt_car_metrics}


def _wrapped(angle: Floats) -> Floats:
    """An angle within half a turn of zero."""
    return angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi))


def _saturated_fraction(flight: Flight, spins: Floats) -> float:
    vehicle = flight.scenario.rotorcraft
    saturated = at_upper_limit(spins, vehicle.max_rotor_speed)
    saturated |= at_lower_limit(spins, vehicle.min_rotor_speed)
    return float(saturated.any(axis=0).mean())


def _min_decoupling_condition(flight: Flight) -> float:
    columns = flight.columns
    tilts = np.stack([columns[f"alpha_{rotor}"] for rotor in (1, 2, 3, 4)], axis=-1)
    up = world_up(columns["roll"], columns["pitch"])
    lift = np.einsum("ni,nij->nj", up, force_matrix(tilts))[:, np.newaxis]
    torque = torque_matrix(tilts, flight.scenario.rotorcraft.resolve())
    values = np.linalg.svd(np.concatenate([torque, lift], axis=1), compute_uv=False)
    return float((values[:, -1] / values[:, 0]).min())
