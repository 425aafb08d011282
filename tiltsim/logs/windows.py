"""Windows of a log: stretches without gaps over which a vehicle's model is flown on its inputs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from tiltsim.errors import InputError
from tiltsim.logs.log import Log
from tiltsim.system.numbers import is_finite
from tiltsim.system.text import short_repr
from tiltsim_controllers.mathematics.scalar import Floats

LONGEST_STEP: Final = 0.005
"""Longest step (s) of the integration between two samples."""

MEASURED: Final = ("position", "velocity", "attitude", "body_rates")
"""Vectors of a log that a model predicts, in the order of the residuals; attitude as an error."""

FLOOR: Final = 1e-6
"""Smallest noise of a channel in its unit: below it, interpolation of the inputs limits the fit."""


class Windows(NamedTuple):
    """All windows of a log as arrays whose first axis is the window; NaN where nothing is known."""

    start: Floats  # s, shape (W,)
    step: Floats  # s, shape (W, K - 1): between samples
    position: Floats  # m, shape (W, K, 3)
    velocity: Floats
    attitude: Floats  # quaternions w x y z, shape (W, K, 4)
    body_rates: Floats
    speeds: Floats  # rad/s, at the stages of the integration, shape (W, K - 1, 2 S + 1, N)
    tilts: Floats  # rad, shape (W, K - 1, 2 S + 1, M)
    speed_commands: Floats  # rad/s, held between samples, shape (W, K, N); NaN if not in the log
    tilt_commands: Floats

    measured: Floats  # position, velocity, quaternion, body rates, 0 if unknown, (W, K, 13)
    is_measured: Floats  # of the twelve errors, shape (W, K, 12)

    @property
    def samples(self) -> int:
        """Samples of a window."""
        return self.position.shape[1]


def windows_of(log: Log, seconds: float, rotors: int, tilts: int) -> Windows:
    """Cut a log into windows.

    Args:
        log: Position or attitude, speeds of all rotors and angles of all tilts.
        seconds: Length of a window, s.
        rotors, tilts: Numbers of the vehicle.

    Raises:
        InputError: If the log lacks inputs, has the inputs of another vehicle or no whole window.
    """
    if not is_finite(seconds) or not 0.02 <= seconds <= 60.0:
        raise InputError(f"window = {short_repr(seconds)}: must be from 0.02 to 60 s")
    for name, count, part in (("rotor_speed", rotors, "rotors"), ("alpha", tilts, "tilting pods")):
        for number in range(1, count + 1):
            if f"{name}_{number}" not in log.columns:
                raise InputError(
                    f"{log.name}: no column {name}_{number}; the scenario's vehicle has {count} "
                    f"{part}: give the scenario of the vehicle that was logged, or map the column"
                )
        further = log.columns.get(f"{name}_{count + 1}", np.zeros(1))
        if (further != 0.0).any():  # a quadrotor's flight has tilts that stay at zero
            raise InputError(
                f"{log.name}: has column {name}_{count + 1}, but the scenario's vehicle has "
                f"{count} {part}: it is the log of another vehicle"
            )
    if "attitude" not in log:
        raise InputError(f"{log.name}: no attitude (roll, pitch, yaw); map it")
    time = log["time"]
    usual = float(np.median(np.diff(time)))
    samples = max(4, round(seconds / usual) + 1)
    if samples > len(time):
        raise InputError(f"window = {seconds:g}: longer than the log, {log.duration:g} s")
    substeps = max(1, int(np.ceil(usual / LONGEST_STEP)))
    missing = np.full((len(time), 3), np.nan)
    vectors = {name: log[name] if name in log else missing for name in MEASURED}  # noqa: SIM401
    vectors["attitude"] = log.quaternions()
    speeds, angles = _inputs(log, "rotor_speed", rotors), _inputs(log, "alpha", tilts)
    commands = [_inputs(log, "rotor_command", rotors), _inputs(log, "alpha_command", tilts)]
    known: Any = np.isfinite(vectors["attitude"]).all(axis=1) & np.isfinite(speeds).all(axis=1)
    known &= np.isfinite(angles).all(axis=1)
    parts: dict[str, list[Any]] = {name: [] for name in Windows._fields}
    first = 0
    while first + samples <= len(time):
        span = slice(first, first + samples)
        bad = np.flatnonzero(~known[span])
        steps = np.diff(time[span])
        gaps = np.flatnonzero(steps > 1.5 * usual)
        if len(bad) or len(gaps):
            first += 1 + int(max([*bad, *gaps]))
            continue
        fractions = np.arange(2 * substeps + 1) / (2 * substeps)
        stages = time[span][:-1, None] + steps[:, None] * fractions
        parts["start"].append(time[first])
        parts["step"].append(steps)
        for name in MEASURED:
            parts[name].append(vectors[name][span])
        for name, inputs in (("speeds", speeds), ("tilts", angles)):
            parts[name].append(CubicSpline(time[span], inputs[span])(stages))
        for name, held in zip(("speed_commands", "tilt_commands"), commands, strict=True):
            parts[name].append(held[span])
        first += samples - 1
    if not parts["start"]:
        raise InputError(
            f"{log.name}: no {seconds:g} s without gaps in attitude, rotor speeds and tilts; "
            "shorten the window"
        )
    found = {name: np.array(values) for name, values in parts.items() if values}
    known = np.concatenate([np.isfinite(found[name][..., :3]) for name in MEASURED], axis=-1)
    measured = np.nan_to_num(np.concatenate([found[name] for name in MEASURED], axis=-1))
    return Windows(**found, measured=measured, is_measured=known)


def _inputs(log: Log, name: str, count: int) -> Floats:
    """Columns of every rotor or tilt, shape (N, count); NaN where the log has none."""
    missing = np.full(len(log), np.nan)
    columns = [log.columns.get(f"{name}_{number}", missing) for number in range(1, count + 1)]
    return np.stack(columns, axis=1) if columns else np.zeros((len(log), 0))


def noise_of(log: Log, given: Mapping[str, float]) -> dict[str, float]:
    """Standard deviations of the measured vectors, in their units, attitude as small angles.

    The default comes from third differences, in which a smooth motion vanishes: their median size
    is 0.6745 sqrt(20) times the deviation of white noise.

    Args:
        log: The log.
        given: Known deviations by vector.
    """
    found = dict(given)
    for name in MEASURED:
        if name in found or name not in log:
            continue
        values = np.unwrap(log[name], axis=0) if name == "attitude" else log[name]
        jumps = np.abs(np.diff(values, 3, axis=0))
        finite = np.isfinite(jumps)
        if finite.any():
            found[name] = max(FLOOR, float(np.median(jumps[finite]) / (0.6745 * 20.0**0.5)))
    return found
