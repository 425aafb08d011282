"""Metrics of all vehicles, the spans of samples that they cover, and the metrics of rotorcraft.

Columns have shape (..., N): one flight, or several in rows, with equal times (N,).
Spans are counted in physics steps instead of sums of their lengths.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.metric_names import METRICS
from tiltsim.scenario.rotorcraft import AnyVehicleTable
from tiltsim.scenario.scenario import Scenario
from tiltsim.vehicles.rotorcraft.others import SWING
from tiltsim_controllers.analysis.singularity import force_matrix, torque_matrix, world_up
from tiltsim_controllers.laws.estimator import NAVIGATION_ERRORS
from tiltsim_controllers.mathematics.scalar import Floats, chi_square_quantile
from tiltsim_controllers.vehicle.body import TILT_FIELDS
from tiltsim_controllers.vehicle.parameters import Vehicle

SETTLED: Final = 20.0  # time (s) from which on the supremum of the position error is taken
_ROUNDING: Final = 1e-9  # relative: of a time over a time step, of a speed at its limit


def in_last_second(time: Floats, timestep: float) -> npt.NDArray[np.bool_]:
    """The samples of the last second, both ends included; ``time`` and ``timestep`` in s."""
    steps = np.rint(time / timestep)
    return steps[-1] - steps <= (1.0 + _ROUNDING) / timestep


def when_settled(time: Floats, timestep: float) -> npt.NDArray[np.bool_]:
    """The samples from `SETTLED` on; ``time`` and ``timestep`` in s."""
    return np.rint(time / timestep) >= (1.0 - _ROUNDING) * SETTLED / timestep


def mean_of(column: Floats, span: npt.NDArray[np.bool_]) -> Any:
    """The mean over some samples, in one order of summation for one flight and for rows."""
    return np.mean(np.compress(span, column, axis=-1), axis=-1)


def position_error(*errors: Floats) -> dict[str, Any]:
    """Metrics of the distance from the reference, from its components (m), shape (..., N) each."""
    square = sum(error * error for error in errors)
    return {
        "rms_position_error": np.sqrt(np.mean(square, axis=-1)),
        "max_position_error": np.sqrt(square).max(axis=-1),
    }


NUMBERS: Final[Mapping[str, Callable[[Floats], Any]]] = {
    "max": lambda column: column.max(axis=-1),
    "min": lambda column: column.min(axis=-1),
    "max_abs": lambda column: np.abs(column).max(axis=-1),
    "last": lambda column: column[..., -1],
}
"""Numbers of a column that a metric may be."""


def with_columns_metrics(own: dict[str, Any], columns: Mapping[str, Floats]) -> dict[str, Any]:
    """Metrics of a kind of vehicle and the numbers of columns among the metrics, in order."""
    found = {
        name: NUMBERS[metric.number](columns[metric.column])
        for name, metric in METRICS.items()
        if metric.column in columns
    }
    whole = own | found
    return {name: whole[name] for name in METRICS if name in whole}


def largest(values: Iterable[Any]) -> Any:
    """The largest of arrays (...), one by one; a NaN that comes first stays, as in ``max``."""
    first, *others = values
    for other in others:
        first = np.where(other > first, other, first)
    return first


def first_and_last(where: npt.NDArray[np.bool_]) -> tuple[Any, Any]:
    """The first and the last sample, shape (...), at which something is the case, -1 if none."""
    count = where.shape[-1]
    if not count:
        return np.full(where.shape[:-1], -1), np.full(where.shape[:-1], -1)
    found = where.any(axis=-1)
    first, last = where.argmax(axis=-1), count - 1 - where[..., ::-1].argmax(axis=-1)
    return np.where(found, first, -1), np.where(found, last, -1)


def time_of(time: Floats, sample: Any) -> Any:
    """The times (s) of samples (...), NaN for -1."""
    return np.where(sample < 0, np.nan, time[sample])


def at_upper_limit(speeds: Floats, limit: Any) -> npt.NDArray[np.bool_]:
    """Where rotor speeds along the spin (rad/s) are at their upper limit; nowhere without one."""
    return speeds >= (np.inf if limit is None else limit * (1.0 - _ROUNDING))


def at_lower_limit(speeds: Floats, limit: Any) -> npt.NDArray[np.bool_]:
    """Where rotor speeds along the spin (rad/s) are at their lower limit; nowhere without one."""
    return speeds <= (-np.inf if limit is None else limit * (1.0 + _ROUNDING))


def speeds_along_spin(columns: Mapping[str, Floats], vehicle: AnyVehicleTable) -> Floats:
    """Rotor speeds along their spins, rad/s, shape (rotors, ..., N)."""
    signs = enumerate(vehicle.spins, start=1)
    return np.array([sign * columns[f"rotor_speed_{i}"] for i, sign in signs])


def rotor_metrics(columns: Mapping[str, Floats], vehicle: AnyVehicleTable) -> dict[str, Any]:
    """Ranges of rotor speeds and tilt rates; share of samples with a rotor at its limit, and when.

    The first and last of these samples are NaN where there is none.
    """
    speeds = speeds_along_spin(columns, vehicle)
    low, high = vehicle.rotor_range
    reached = at_upper_limit(speeds, high) | at_lower_limit(speeds, low)
    limited: npt.NDArray[np.bool_] = np.any(reached, axis=0)
    first, last = first_and_last(limited)
    names = [name for name in columns if name.startswith("alpha_rate")]
    rates = [np.abs(columns[name]).max(axis=-1) for name in names]
    return {
        "min_rotor_speed": speeds.min(axis=(0, -1)),
        "max_rotor_speed": speeds.max(axis=(0, -1)),
        "max_tilt_rate": largest(rates) if rates else np.zeros(speeds.shape[1:-1]),
        "saturated_fraction": limited.mean(axis=-1),
        "first_saturation_time": time_of(columns["time"], first),
        "last_saturation_time": time_of(columns["time"], last),
    }


def horizontal_error_metrics(columns: Mapping[str, Floats], timestep: float) -> dict[str, Any]:
    """The largest and the smallest horizontal position error (m) from `SETTLED` on, if it lasts."""
    settled = when_settled(columns["time"], timestep)
    if not settled.any():
        return {}
    x, y = (columns[f"{axis}_ref"] - columns[axis] for axis in ("x", "y"))
    error = np.hypot(x, y)[..., settled]
    return {
        "sup_position_error_after_20s": error.max(axis=-1),
        "least_position_error_after_20s": error.min(axis=-1),
    }


# --- rotorcraft ----------------------------------------------------------------------------------

SETTLED_ALTITUDE: Final = 0.005  # m
BAND: Final = (0.025, 0.975)  # ends of the 95 % band of a distribution

SETTLED_FORCE: Final = 1.0
"""s after the full force is commanded, from where on the error of the force counts."""


def rotorcraft_metrics(
    columns: Mapping[str, Floats], scenario: Scenario, follows_position: bool
) -> dict[str, Any]:
    """See `tiltsim.closed_loop.loop.VehicleKind.metrics`."""
    time = columns["time"]
    vehicle = scenario.vehicle
    own = {
        **_position_metrics(columns, scenario, follows_position),
        **_attitude_metrics(columns, scenario),
        **rotor_metrics(columns, vehicle),
        "rms_rotor_acceleration": _rms_change(time, speeds_along_spin(columns, vehicle)),
        **_altitude_metrics(time, columns["z_ref"] - columns["z"]),
        **_singular_zone_metrics(columns),
        **_singularity_metrics(columns, vehicle.resolve()),
        **_contact_metrics(columns, in_last_second(time, scenario.simulation.timestep)),
        **_estimate_metrics(columns),
    }
    return with_columns_metrics(own, columns)


def _rms_change(time: Floats, speeds: Floats) -> Any:
    """Root mean square of the rates (rad/s^2) of speeds (rotors, ..., N); NaN of one sample."""
    if len(time) < 2:
        return np.full(speeds.shape[1:-1], np.nan)
    rates = np.diff(speeds, axis=-1) / np.diff(time)
    # By rotor, so that the order of the sum does not depend on the number of flights.
    return np.sqrt(sum(np.mean(rate * rate, axis=-1) for rate in rates) / len(rates))


def _position_metrics(
    columns: Mapping[str, Floats], scenario: Scenario, follows_position: bool
) -> dict[str, Any]:
    clock = columns["time"], scenario.simulation.timestep
    last_second, settled = in_last_second(*clock), when_settled(*clock)
    errors = {axis: columns[f"{axis}_ref"] - columns[axis] for axis in ("x", "y", "z")}
    metrics = {
        f"final_position_error_{axis}": mean_of(error, last_second)
        for axis, error in errors.items()
        if follows_position or axis == "z"
    }
    if not follows_position:
        return metrics | position_error(errors["z"])
    metrics |= position_error(*errors.values())
    metrics |= horizontal_error_metrics(columns, clock[1])
    if scenario.reference.type == "circle" and settled.any():
        centre_x, centre_y, _ = scenario.reference.position
        orbit = np.hypot(columns["x"] - centre_x, columns["y"] - centre_y)[..., settled]
        metrics["max_orbit_radius_after_20s"] = orbit.max(axis=-1)
        metrics["min_orbit_radius_after_20s"] = orbit.min(axis=-1)
    return metrics


def _attitude_metrics(columns: Mapping[str, Floats], scenario: Scenario) -> dict[str, Any]:
    angles, metrics = ("roll", "pitch", "yaw"), {}
    last_second = in_last_second(columns["time"], scenario.simulation.timestep)
    for angle in angles:
        # Near half a revolution samples of one direction have both signs.
        metrics[f"final_{angle}"] = np.mean(
            np.unwrap(np.compress(last_second, columns[angle], axis=-1)), axis=-1
        )
    if scenario.controller.records_attitude(scenario):
        metrics["final_attitude_error"] = largest(
            np.abs(_wrapped(columns[f"{angle}_ref"] - columns[angle])[..., last_second]).max(
                axis=-1
            )
            for angle in angles
        )
    return metrics


def _wrapped(angle: Floats) -> Floats:
    """An angle within half a turn of zero."""
    return angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi))


def _altitude_metrics(time: Floats, error: Floats) -> dict[str, Any]:
    overshoot = -error.min(axis=-1)
    _, last = first_and_last(np.abs(error) > SETTLED_ALTITUDE)  # last: outside
    settled_at = np.append(time, np.nan)[last + 1]  # nan: not at the end
    return {
        "altitude_overshoot": np.where(overshoot > 0.0, overshoot, 0.0),
        "altitude_settling_time": np.where(last < 0, 0.0, settled_at),
    }


def _singular_zone_metrics(columns: Mapping[str, Floats]) -> dict[str, Any]:
    """The switches between chapter 2's laws, where a flight has them."""
    if "attitude_zone" not in columns:
        return {}
    switched = np.diff(columns["attitude_zone"]) != 0.0
    first, _ = first_and_last(switched)
    return {
        "switches": switched.sum(axis=-1, dtype=float),
        "first_switch_time": time_of(columns["time"], np.where(first < 0, -1, first + 1)),
    }


def _contact_metrics(columns: Mapping[str, Floats], last_second: Any) -> dict[str, Any]:
    """Forces on objects and swing of a load, where a flight has any."""
    metrics = {}
    tensions = [column for name, column in columns.items() if name.endswith("_tension")]
    if tensions:
        metrics["max_cable_tension"] = np.max(tensions, axis=(0, -1))
    if "cable_tension" in columns:
        swing = np.hypot(*(columns[name] for name in SWING))
        metrics["max_swing"] = swing.max(axis=-1)
        metrics["final_swing"] = np.compress(last_second, swing, axis=-1).max(axis=-1)
    if "push_force_ref" in columns:
        time, commanded = columns["time"], columns["push_force_ref"]
        full = commanded == commanded.max(axis=-1, keepdims=True)
        _, ramp_end = first_and_last(~full)
        settled = time > (time[ramp_end] + SETTLED_FORCE)[..., np.newaxis]
        error = np.where(settled, columns["push_force"] - commanded, 0.0)
        count = settled.sum(axis=-1)
        with np.errstate(invalid="ignore", divide="ignore"):  # NaN where the flight is too short
            metrics["rms_force_error"] = np.sqrt((error * error).sum(axis=-1) / count)
    return metrics


def _estimate_metrics(columns: Mapping[str, Floats]) -> dict[str, Any]:
    """How true the covariance of an estimate is, where a flight has one."""
    if "nees" not in columns:
        return {}
    nees, count = columns["nees"], columns["nis_count"][..., -1]
    low, high = (chi_square_quantile(share, NAVIGATION_ERRORS) for share in BAND)
    band = [np.vectorize(chi_square_quantile)(share, np.maximum(count, 1.0)) for share in BAND]
    with np.errstate(invalid="ignore", divide="ignore"):  # NaN where no reading arrived
        nis, least, greatest = (x / count for x in (columns["nis"][..., -1], *band))
    return {
        "nees": nees.mean(axis=-1) / NAVIGATION_ERRORS,
        "nees_in_band": ((nees >= low) & (nees <= high)).mean(axis=-1),
        "nis": nis,
        "nis_low": least,
        "nis_high": greatest,
    }


def _singularity_metrics(
    columns: Mapping[str, Floats], vehicle: Vehicle | Multirotor
) -> dict[str, Any]:
    """How close the decoupling matrix came to a singular one, where a flight has such columns."""
    if "singularity_margin" not in columns:
        return {}
    if "decoupling_condition" in columns:
        return {"min_decoupling_condition": columns["decoupling_condition"].min(axis=-1)}
    if isinstance(vehicle, Vehicle):
        return {"min_decoupling_condition": _min_decoupling_condition(columns, vehicle)}
    return {}


def _min_decoupling_condition(columns: Mapping[str, Floats], vehicle: Vehicle) -> Any:
    tilts = np.stack([columns[name] for name in TILT_FIELDS], axis=-1)
    up = world_up(columns["roll"], columns["pitch"])
    lift = np.einsum("...i,...ij->...j", up, force_matrix(tilts))[..., np.newaxis, :]
    torque = torque_matrix(tilts, vehicle)
    values = np.linalg.svd(np.concatenate([torque, lift], axis=-2), compute_uv=False)
    return (values[..., -1] / values[..., 0]).min(axis=-1)
