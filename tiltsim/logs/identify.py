"""A vehicle's model on the rotor speeds and tilts of a log, window by window.

`replay` compares it with the log. `identify` finds its parameters by Gauss-Newton; the initial
state of each window is found with them (multiple shooting), and eliminated from the normal
equations.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any, Final

import numpy as np

from tiltsim.arrays.jax_programs import require_jax
from tiltsim.errors import InputError
from tiltsim.flight.flight import VECTORS
from tiltsim.logs.log import UNITS, Log
from tiltsim.logs.model import FACTORS, LoggedVehicle, Parameter
from tiltsim.logs.reading import read_log
from tiltsim.logs.windows import INITIAL, MEASURED, Problem, windows_of
from tiltsim.scenario.loading import load_scenario
from tiltsim.scenario.scenario import Scenario
from tiltsim.scenario.vehicle import VEHICLES
from tiltsim.system.arguments import is_finite
from tiltsim.system.text import html_table, short_repr
from tiltsim_controllers.mathematics.scalar import Floats

VAGUE: Final = 0.5
"""A combination of parameters with a larger deviation than this, in their scales, is refused."""

DEVIATIONS: Final = 4.0
"""Standard deviations from which chi2, or the correlation of neighboring residuals, warns."""

FLOORS: Final = {**dict.fromkeys(MEASURED, 1e-6), "rotor_speeds": 1e-3, "tilt_angles": 1e-3}
"""Smallest noise of vectors: below it, interpolation of the inputs limits the fit."""


@dataclass(frozen=True)
class Estimate:
    """Parameters found in a log."""

    values: dict[str, float]  # by key; entries of vectors as ``vehicle.inertia[0]``
    sigma: dict[str, float]
    """Their standard deviations, from the noise; from the residuals if these are larger."""
    units: dict[str, str]  # their units
    correlation: Floats  # correlation of the values, shape (n, n), in their order
    chi2: float  # squared residuals over their noise, per degree of freedom; 1 for a true model
    chi2_band: tuple[float, float]  # where chi2 of a true model lies with 95 % probability
    autocorrelation: float  # correlation of neighboring residuals; near 0 for a true model
    warnings: tuple[str, ...]  # one line each
    windows: int  # windows of the log that were used
    noise: dict[str, float]  # standard deviations of the measured vectors
    residuals: Floats
    """Measured minus predicted, in their noise, shape (windows, samples, channels)."""
    nominal: dict[str, float]  # their values in the scenario
    model: str  # ``vehicle.model`` of the scenario

    def report(self) -> dict[str, Any]:
        """Everything but the residuals, for JSON."""
        found = {name: value for name, value in vars(self).items() if name != "residuals"}
        return found | {"correlation": self.correlation.tolist(), "warnings": [*self.warnings]}

    def overrides(self) -> dict[str, Any]:
        """Keys for `Scenario.replace`, vectors as lists.

        The numbers of a vehicle from an MJCF file stand there; they become factors of model_error.
        """
        found: dict[str, Any] = {}
        keys = VEHICLES[self.model].model_fields
        for name, value in self.values.items():
            key, _, entry = name.partition("[")
            error = key.replace("vehicle.", "model_error.")
            if error in FACTORS and key.removeprefix("vehicle.") not in keys:
                key, value = error, value / self.nominal[name]
            if key != "vehicle.center_of_mass":  # no key of a scenario
                found[key] = [*found.get(key, []), value] if entry else value
        return found

    def _repr_html_(self) -> str:
        rows = [
            (name, f"{value:.6g}", f"{self.sigma[name]:.2g}", self.units[name])
            for name, value in self.values.items()
        ]
        lines = [f"chi2 {self.chi2:.3f} over {self.windows} windows", *self.warnings]
        return html_table("Estimate", lines, rows, ("parameter", "value", "sigma", "unit"))


@dataclass(frozen=True)
class Replay:
    """How far a model leaves a log within a window, from the measured state at its beginning."""

    channels: tuple[str, ...]
    """The measured columns; attitude stands for small turns about the body axes."""
    time: Floats  # times of the samples, s, shape (windows, samples)
    mismatch: Floats  # measured minus predicted, in units, shape (windows, samples, channels)

    @property
    def rms(self) -> dict[str, float]:
        """Root of the mean squared mismatch of each channel, in its unit."""
        sizes = np.sqrt(np.mean(self.mismatch**2, axis=(0, 1)))
        return dict(zip(self.channels, sizes.tolist(), strict=True))

    @property
    def worst(self) -> dict[str, tuple[float, float]]:
        """The largest mismatch of each channel in size, and the start of its window, s."""
        size = np.abs(self.mismatch).max(axis=1)
        where = size.argmax(axis=0)
        starts = self.time[:, 0][where]
        values = zip(size.max(axis=0).tolist(), starts.tolist(), strict=True)
        return dict(zip(self.channels, values, strict=True))

    def report(self) -> dict[str, Any]:
        """The mismatch by channel and by window, for JSON."""
        by_window = np.sqrt(np.mean(self.mismatch**2, axis=1))
        return {
            "rms": self.rms,
            "worst": self.worst,
            "units": {name: UNITS[name] for name in self.channels},
            "start": self.time[:, 0].tolist(),
            "by_window": dict(zip(self.channels, by_window.T.tolist(), strict=True)),
        }


def identify(
    log: Log | str | PathLike[str],
    scenario: Scenario | str | PathLike[str] | Mapping[str, Any],
    free: Sequence[str],
    *,
    window: float = 0.3,
    noise: Mapping[str, float] | None = None,
    map: str | PathLike[str] | None = None,  # noqa: A002
) -> Estimate:
    """Find parameters of a vehicle in a log of its flight.

    Args:
        log: A `Log`, or anything that `tiltsim.read_log` takes.
        scenario: The vehicle as assumed; anything that `tiltsim.load_scenario` takes.
        free: Keys to find, such as ``["vehicle.mass", "vehicle.inertia"]``.
        window: Seconds over which the model is flown from one initial state.
        noise: Standard deviations of position (m), velocity (m/s), attitude (rad) and body_rates
            (rad/s) in the log; by default estimated from the log.
        map: See `tiltsim.read_log`.

    Raises:
        InputError: If the log is not of this vehicle, has no whole window, or cannot tell the
            parameters, with the combination that it cannot tell.
    """
    jax = require_jax("tiltsim.identify")
    read = log if isinstance(log, Log) else read_log(log, map)
    loaded = load_scenario(scenario)
    vehicle = LoggedVehicle(loaded)
    chosen = vehicle.chosen(free)
    sigmas = _noise(read, noise or {})
    fields = {one.field for one in chosen.values()}
    for field, column in (("lag", "rotor_command"), ("frequency", "alpha_command")):
        if field in fields and f"{column}_1" not in read.columns:
            key = next(key for key, one in chosen.items() if one.field == field)
            raise InputError(f"free = {key!r}: needs columns {column}_1, ... of commands")
    cut = windows_of(read, window, len(vehicle.vehicle.rotors), vehicle.vehicle.tilts)
    if "lag" in fields and not np.isfinite(cut.speed_commands).all():
        raise InputError(f"{read.name}: rotor_command: has gaps")
    with jax.enable_x64(True):
        problem = Problem(vehicle, chosen, sigmas, cut)
        theta, residuals, information = problem.minimum(read.name)
    return _estimate(loaded.vehicle.model, chosen, theta, residuals, information, sigmas)


def _noise(log: Log, given: Mapping[str, float]) -> dict[str, float]:
    """Standard deviations of measured vectors and inputs, attitude as small angles.

    Unless given, from third differences, in which a smooth motion vanishes: their median size is
    0.6745 sqrt(20) times the deviation of white noise.
    """
    for name, value in given.items():
        if name not in MEASURED:
            raise InputError(f"noise: {short_repr(name)}: choose {', '.join(MEASURED)}")
        if not is_finite(value) or value <= 0.0:
            raise InputError(f"noise: {name} = {short_repr(value)}: must be a positive number")
    found = {"rotor_speeds": 1.0, "tilt_angles": 1.0, **given}
    for name, floor in FLOORS.items():
        if name in given or name not in log:
            continue
        values = np.unwrap(log[name], axis=0) if name == "attitude" else log[name]
        jumps = np.abs(np.diff(values, 3, axis=0))
        known = jumps[np.isfinite(jumps)]
        if known.size:
            found[name] = max(floor, float(np.median(known)) / (0.6745 * 20.0**0.5))
    return found


def _estimate(
    model: str,
    chosen: Mapping[str, Parameter],
    theta: Floats,
    residuals: Floats,
    information: Floats,
    noise: Mapping[str, float],
) -> Estimate:
    """The result of a minimum. Raises `InputError` where the log cannot tell the parameters."""
    names, units, starts, scales = [], [], [], []
    for key, one in chosen.items():
        size = len(one.nominal)
        names += [key] if size == 1 else [f"{key}[{entry}]" for entry in range(size)]
        units += [one.unit] * size
        starts += [*one.nominal]
        scales += [*one.scale]
    covariance = _covariance(names, information)
    spread = np.sqrt(np.diag(covariance))
    used = residuals[np.abs(residuals) > 0.0]
    freedom = len(used) - len(theta) - INITIAL * len(residuals)
    if freedom < 1:
        raise InputError("window: too few samples; give a longer one")
    chi2 = float(np.sum(used**2)) / freedom
    width = (2.0 / freedom) ** 0.5
    near, far = residuals[:, :-1], residuals[:, 1:]
    correlation = float(np.sum(near * far) / max(np.sum(residuals**2), 1e-300))
    warnings = []
    if chi2 > 1.0 + DEVIATIONS * width:
        warnings.append(
            f"chi2 = {chi2:.3g}: the residuals are larger than the noise; the model lacks something"
        )
    if correlation > DEVIATIONS / len(used) ** 0.5:
        warnings.append(
            f"neighboring residuals are correlated by {correlation:.2f}: the model lacks something"
        )
    values = np.array(starts) + np.array(scales) * theta
    sigma = np.array(scales) * spread * max(1.0, chi2) ** 0.5
    return Estimate(
        values=dict(zip(names, values.tolist(), strict=True)),
        sigma=dict(zip(names, sigma.tolist(), strict=True)),
        units=dict(zip(names, units, strict=True)),
        correlation=covariance / np.outer(spread, spread),
        chi2=chi2,
        chi2_band=(1.0 - 1.96 * width, 1.0 + 1.96 * width),
        autocorrelation=correlation,
        warnings=tuple(warnings),
        windows=len(residuals),
        noise={name: value for name, value in noise.items() if name in MEASURED},
        residuals=residuals,
        nominal=dict(zip(names, np.array(starts).tolist(), strict=True)),
        model=model,
    )


def _covariance(names: Sequence[str], information: Floats) -> Floats:
    """The covariance of the parameters in their scales, unless a combination is unknown."""
    lengths, directions = np.linalg.eigh(information)
    deviation = 1.0 / np.sqrt(np.maximum(lengths[0], 1e-300))
    if deviation > VAGUE:
        worst = directions[:, 0] * np.sign(directions[np.argmax(np.abs(directions[:, 0])), 0])
        terms = [
            f"{share:+.2f} {name}"
            for share, name in zip(worst, names, strict=True)
            if abs(share) > 0.1
        ]
        raise InputError(
            f"free: the log does not tell {' '.join(terms).removeprefix('+')} (relative to their "
            f"values, standard deviation {min(deviation, 1e9):.2g}); free fewer keys, or fly a "
            "richer motion"
        )
    return np.asarray(np.linalg.inv(information), float)


def replay(
    log: Log | str | PathLike[str],
    scenario: Scenario | str | PathLike[str] | Mapping[str, Any],
    *,
    window: float = 0.3,
    map: str | PathLike[str] | None = None,  # noqa: A002
) -> Replay:
    """Fly a vehicle's model on the rotor speeds and tilts of a log, and compare.

    Args:
        log: A `Log`, or anything that `tiltsim.read_log` takes.
        scenario: The vehicle; anything that `tiltsim.load_scenario` takes.
        window: Seconds from one measured state to the next, from which the model flies on alone.
        map: See `tiltsim.read_log`.

    Raises:
        InputError: If the log is not of this vehicle, or has no whole window.
    """
    jax = require_jax("tiltsim.replay")
    read = log if isinstance(log, Log) else read_log(log, map)
    vehicle = LoggedVehicle(load_scenario(scenario))
    cut = windows_of(read, window, len(vehicle.vehicle.rotors), vehicle.vehicle.tilts)
    with jax.enable_x64(True):
        problem = Problem(vehicle, {}, dict.fromkeys(MEASURED, 1.0), cut)
        mismatch, _ = problem.at(problem.start, problem.initial)
    columns = [column for name in MEASURED for column in VECTORS[name]]
    kept = [place for place, column in enumerate(columns) if column in read.columns]
    channels, mismatch = tuple(columns[place] for place in kept), mismatch[:, :, kept]
    steps = np.cumsum(np.pad(cut.step, ((0, 0), (1, 0))), axis=1)
    return Replay(channels, cut.start[:, None] + steps, mismatch)
