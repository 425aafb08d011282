"""Metrics of the flights of the tilt-car."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from tiltsim.scenario.scenario import Scenario
from tiltsim.vehicles.spans import (
    at_lower_limit,
    horizontal_error_metrics,
    in_last_second,
    mean_of,
    position_error,
    saturation_metrics,
)
from tiltsim_controllers.mathematics.scalar import Floats


def tilt_car_metrics(
    columns: Mapping[str, Floats], scenario: Scenario, _follows_position: bool
) -> dict[str, Any]:
    """See `tiltsim.closed_loop.loop.VehicleKind.metrics`."""
    timestep = scenario.simulation.timestep
    last_second = in_last_second(columns["time"], timestep)
    errors = {axis: columns[f"{axis}_ref"] - columns[axis] for axis in ("x", "y")}
    speeds = np.array([columns["rotor_speed_1"], columns["rotor_speed_2"]])
    metrics = {
        f"final_position_error_{axis}": mean_of(e, last_second) for axis, e in errors.items()
    }
    metrics |= position_error(*errors.values())
    metrics |= horizontal_error_metrics(columns, timestep)
    metrics |= {f"max_abs_error_{axis}": np.abs(e).max(axis=-1) for axis, e in errors.items()}
    if "lyapunov" in columns:
        metrics["max_lyapunov"] = columns["lyapunov"].max(axis=-1)
    metrics["final_input_split"] = mean_of(columns["input_split"], last_second)
    metrics["final_yaw"] = mean_of(columns["yaw"], last_second)
    metrics["min_rotor_speed"] = speeds.min(axis=(0, -1))
    metrics["max_rotor_speed"] = speeds.max(axis=(0, -1))
    metrics["max_tilt_rate"] = np.abs(columns["alpha_rate"]).max(axis=-1)
    # A thrust cannot pull: at rest a rotor is at its limit.
    return metrics | saturation_metrics(columns["time"], at_lower_limit(speeds, 0.0))
