"""Identification: parameters of a vehicle from a log, by Gauss-Newton over windows.

The rotor speeds and tilts of the log drive the model; the initial state of each window is found
with the parameters (multiple shooting), and eliminated from the normal equations.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from os import PathLike
from typing import Any, Final

import numpy as np
from scipy.spatial.transform import Rotation

from tiltsim.arrays.jax_programs import require_jax
from tiltsim.errors import InputError
from tiltsim.logs.log import Log
from tiltsim.logs.model import FACTORS, INITIAL, LoggedVehicle, Parameter, residuals_of
from tiltsim.logs.reading import read_log
from tiltsim.logs.windows import MEASURED, Windows, noise_of, windows_of
from tiltsim.scenario.loading import load_scenario
from tiltsim.scenario.scenario import Scenario
from tiltsim.system.numbers import is_finite
from tiltsim.system.text import html_table, short_repr
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.effectiveness import TiltOfRotor

MOST_STEPS: Final = 30
"""Gauss-Newton steps; a log with enough motion needs five."""

VAGUE: Final = 0.5
"""A combination of parameters with a larger deviation than this, in their scales, is refused."""

DEVIATIONS: Final = 4.0
"""Standard deviations from which chi2, or the correlation of neighboring residuals, warns."""


@dataclass(frozen=True)
class Estimate:
    """Parameters found in a log.

    Attributes:
        values: By key; entries of vectors as ``vehicle.inertia[0]``.
        sigma: Their standard deviations, from the noise; from the residuals if these are larger.
        units: Their units.
        correlation: Correlation of the values, shape (n, n), in their order.
        chi2: Squared residuals over their noise, per degree of freedom; 1 for a true model.
        chi2_band: Where chi2 of a true model lies with 95 % probability.
        autocorrelation: Correlation of neighboring residuals; near 0 for a true model.
        warnings: One line each.
        windows: Windows of the log that were used.
        noise: Standard deviations of the measured vectors.
        residuals: Measured minus predicted, in their noise, shape (windows, samples, channels).
        nominal: Their values in the scenario.
        model: ``vehicle.model`` of the scenario.
    """

    values: dict[str, float]
    sigma: dict[str, float]
    units: dict[str, str]
    correlation: Floats
    chi2: float
    chi2_band: tuple[float, float]
    autocorrelation: float
    warnings: tuple[str, ...]
    windows: int
    noise: dict[str, float]
    residuals: Floats
    nominal: dict[str, float]
    model: str

    def report(self) -> dict[str, Any]:
        """Everything but the residuals, for JSON."""
        found = {name: value for name, value in vars(self).items() if name != "residuals"}
        return found | {"correlation": self.correlation.tolist(), "warnings": [*self.warnings]}

    def overrides(self) -> dict[str, Any]:
        """Keys for `Scenario.replace`, vectors as lists.

        The numbers of a vehicle from an MJCF file stand there; they become factors of model_error.
        """
        found: dict[str, Any] = {}
        for name, value in self.values.items():
            key, _, entry = name.partition("[")
            error = key.replace("vehicle.", "model_error.")
            if self.model == "multirotor" and error in FACTORS:
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
    sigmas |= {name: _input_noise(read, name) for name in ("rotor_speeds", "tilt_angles")}
    with jax.enable_x64(True):
        problem = Problem(vehicle, chosen, sigmas, cut)
        theta, residuals, information = problem.minimum(read.name)
    return _estimate(loaded.vehicle.model, chosen, theta, residuals, information, sigmas)


def _noise(log: Log, given: Mapping[str, float]) -> dict[str, float]:
    for name, value in given.items():
        if name not in MEASURED:
            raise InputError(f"noise: {short_repr(name)}: choose {', '.join(MEASURED)}")
        if not is_finite(value) or value <= 0.0:
            raise InputError(f"noise: {name} = {short_repr(value)}: must be a positive number")
    found = noise_of(log, given)
    return {name: found[name] for name in MEASURED if name in found}


def _input_noise(log: Log, name: str) -> float:
    if name not in log:
        return 1.0
    jumps = np.abs(np.diff(log[name], 3, axis=0))
    found = float(np.nanmedian(jumps)) / (0.6745 * 20.0**0.5)
    return max(1e-3, found)


@cache
def _normal_equations(layout: TiltOfRotor, free: tuple[tuple[str, str], ...]) -> Any:
    """The compiled residuals and normal equations of all windows."""
    import jax

    residuals = residuals_of(layout, free)

    def normal(theta: Any, initial: Any, *given: Any) -> Any:
        def both(theta: Any, initial: Any) -> Any:
            found = residuals(theta, initial, *given)
            return found.ravel(), found

        slopes, found = jax.jacfwd(both, (0, 1), has_aux=True)(theta, initial)
        (by_theta, by_initial), flat = slopes, found.ravel()
        return (
            found,
            by_theta.T @ by_theta,
            by_theta.T @ by_initial,
            by_initial.T @ by_initial,
            by_theta.T @ flat,
            by_initial.T @ flat,
        )

    return jax.jit(jax.vmap(normal, (None, 0, 0, 0, None, None)))


class Problem:
    """Least squares over the windows of a log."""

    def __init__(
        self,
        vehicle: LoggedVehicle,
        chosen: Mapping[str, Parameter],
        noise: Mapping[str, float],
        windows: Windows,
    ) -> None:
        free = tuple((key, one.field) for key, one in chosen.items())
        self._normal = _normal_equations(vehicle.vehicle.tilt_of_rotor, free)
        numbers = vehicle.numbers | {
            "starts": {key: one.nominal for key, one in chosen.items()},
            "scales": {key: one.scale for key, one in chosen.items()},
        }
        self._given = (_guess(windows), windows, dict(noise), numbers)
        self.start = np.zeros(sum(len(one.nominal) for one in chosen.values()))
        self.initial = np.zeros((len(windows.start), INITIAL))

    def at(self, theta: Floats, initial: Floats) -> tuple[Floats, list[Floats]]:
        """Residuals and normal equations of each window."""
        found, *parts = map(np.asarray, self._normal(theta, initial, *self._given))
        return found, parts

    def minimum(self, name: str) -> tuple[Floats, Floats, Floats]:
        """Changes of the parameters, residuals, and the information matrix of the parameters.

        Raises `InputError` if no minimum is found.
        """
        theta, initial, damping = self.start, self.initial, 1e-6
        residuals, parts = self.at(theta, initial)
        cost = float(np.sum(residuals**2))
        if not np.isfinite(cost):
            raise InputError(f"{name}: the model diverges from this log at once")
        for _ in range(MOST_STEPS):
            step, changes = _step(parts, damping)
            tried, further = self.at(theta + step, initial + changes)
            after = float(np.sum(tried**2))
            if not after <= cost:
                damping *= 10.0
                if damping > 1e6:  # rounding is all that is left
                    return theta, residuals, _reduced(parts, 0.0)[0]
                continue
            gain, cost, residuals, parts = cost - after, after, tried, further
            theta, initial, damping = theta + step, initial + changes, max(1e-9, 0.1 * damping)
            if gain < 1e-6 * max(cost, 1.0):
                return theta, residuals, _reduced(parts, 0.0)[0]
        raise InputError(f"{name}: no fit after {MOST_STEPS} steps: is it a log of this vehicle?")


def _guess(windows: Windows) -> Floats:
    """The measured states at the beginning of each window; derivatives where none is measured."""
    first = windows.step[:, :1]
    place = np.nan_to_num(windows.position)
    velocity = (place[:, 1] - place[:, 0]) / first
    measured = windows.velocity[:, 0]
    velocity = np.where(np.isfinite(measured), measured, velocity)
    turned = Rotation.from_quat(windows.attitude[:, :2, [1, 2, 3, 0]].reshape(-1, 4))
    before, after = turned[::2], turned[1::2]
    rates = (before.inv() * after).as_rotvec() / first
    measured = windows.body_rates[:, 0]
    rates = np.where(np.isfinite(measured), measured, rates)
    return np.hstack([place[:, 0], velocity, windows.attitude[:, 0], rates])


def _reduced(parts: list[Floats], damping: float) -> tuple[Floats, Floats, Floats, Floats]:
    """Normal equations of the parameters alone, and how the initial states follow."""
    both, mixed, own, slope, own_slope = parts
    # A part of the initial state that nothing measures stays as it is guessed.
    sizes = np.einsum("wii->wi", own)
    floor = 1e-12 * sizes.max(axis=1, keepdims=True)
    own = own + (damping * sizes + floor)[:, :, None] * np.eye(INITIAL)
    back = np.linalg.solve(own, np.swapaxes(mixed, 1, 2))  # (W, 12, P)
    moved = np.linalg.solve(own, own_slope[..., None])[..., 0]
    matrix = np.sum(both - mixed @ back, axis=0)
    right = np.sum(slope - (mixed @ moved[..., None])[..., 0], axis=0)
    return matrix, right, back, moved


def _step(parts: list[Floats], damping: float) -> tuple[Floats, Floats]:
    """A damped step of the parameters and of the initial states."""
    matrix, right, back, moved = _reduced(parts, damping)
    size = np.diag(matrix) + 1e-12 * max(1.0, float(np.diag(matrix).max()))
    step = -np.asarray(np.linalg.solve(matrix + np.diag(damping * size + 1e-300), right), float)
    return step, -moved - back @ step


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
