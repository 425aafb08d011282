"""Windows of a log, over which its vehicle's model is flown, and least squares over them."""

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, Final, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from tiltsim.arrays.jax_programs import InJax
from tiltsim.errors import InputError
from tiltsim.logs.log import Log
from tiltsim.logs.model import LoggedMotion, LoggedVehicle, Parameter, numbers_of
from tiltsim.system.arguments import is_finite
from tiltsim.system.text import short_repr
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.rotors import TiltOfRotor, tilts_of

LONGEST_STEP: Final = 0.005  # longest step (s) of the integration between two samples

MEASURED: Final = ("position", "velocity", "attitude", "body_rates")
"""Vectors of a log that a model predicts, in the order of the residuals; attitude as an error."""


STAGE_INPUTS: Final = np.array([0, 1, 1, 2])
"""Half steps after the beginning of a step at which the stages of RK4 take their inputs."""

RUNGE_KUTTA: Final = (
    np.array([0.0, 0.5, 0.5, 1.0]),
    np.array([1.0, 2.0, 2.0, 1.0]) / 6.0,
    np.array([False, False, False, True]),
)
"""By stage: how far along the last slope, the weight of its slope, and whether it ends the step."""

INITIAL: Final = 12
"""Numbers of a window's initial state: position, velocity, small turn, body rates."""


MOST_STEPS: Final = 30  # Gauss-Newton steps; a log with enough motion needs five


class Windows(NamedTuple):
    """All windows of a log as arrays whose first axis is the window; NaN where nothing is known."""

    start: Floats  # s, shape (W,)
    step: Floats  # s, shape (W, K - 1): between samples
    speeds: Floats  # rad/s, at the stages of the integration, shape (W, K - 1, 2 S + 1, N)
    tilts: Floats  # rad, shape (W, K - 1, 2 S + 1, M)
    speed_commands: Floats  # rad/s, held between samples, shape (W, K, N); NaN if not in the log
    tilt_commands: Floats
    measured: Floats  # position, velocity, quaternion, body rates, 0 if unknown, (W, K, 13)
    is_measured: Floats  # of the twelve errors, shape (W, K, 12)


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
    starts: list[int] = []
    first = 0
    while first + samples <= len(time):
        span = slice(first, first + samples)
        bad = np.flatnonzero(~known[span])
        gaps = np.flatnonzero(np.diff(time[span]) > 1.5 * usual)
        if len(bad) or len(gaps):
            first += 1 + int(max([*bad, *gaps]))
        else:
            starts.append(first)
            first += samples - 1
    if not starts:
        raise InputError(
            f"{log.name}: no {seconds:g} s without gaps in attitude, rotor speeds and tilts; "
            "shorten the window"
        )
    places = np.array(starts)[:, None] + np.arange(samples)
    steps = np.diff(time[places], axis=1)
    fractions = np.arange(2 * substeps + 1) / (2 * substeps)
    stages = time[places][:, :-1, None] + steps[..., None] * fractions
    at_stages = [
        np.array([CubicSpline(time[at], inputs[at])(stage) for at, stage in zip(places, stages)])
        for inputs in (speeds, angles)
    ]
    found = [vectors[name][places] for name in MEASURED]
    measured = np.nan_to_num(np.concatenate(found, axis=-1))
    is_measured = np.concatenate([np.isfinite(vector[..., :3]) for vector in found], axis=-1)
    held = [inputs[places] for inputs in commands]
    return Windows(*[time[starts], steps, *at_stages, *held, measured, is_measured])


def _inputs(log: Log, name: str, count: int) -> Floats:
    """Columns of every rotor or tilt, shape (N, count); NaN where the log has none."""
    missing = np.full(len(log), np.nan)
    columns = [log.columns.get(f"{name}_{number}", missing) for number in range(1, count + 1)]
    return np.stack(columns, axis=1) if columns else np.zeros((len(log), 0))


def residuals_of(layout: TiltOfRotor, free: tuple[tuple[str, str], ...]) -> Callable[..., Any]:
    """The residuals of one window in JAX: ``(theta, initial, guess, window, noise, numbers)``.

    ``initial`` are changes of the initial state ``guess``; the result has a row per sample and a
    column per channel, (measured - predicted) over its noise, 0 where nothing is measured.

    Args:
        layout: The tilt of each rotor.
        free: Key and field of each free parameter.
    """
    import jax
    import jax.numpy as jnp

    fields = frozenset(field for _, field in free)
    motion, in_jax = LoggedMotion(layout, fields), InJax("float64")

    def in_array(function: Callable[..., Any]) -> Callable[..., Any]:
        traced = in_jax(function)
        return lambda *given: jnp.stack(traced(*given))

    start, rate, errors = in_array(motion.start), in_array(motion.rate), in_array(motion.errors)
    rotors, tilts = len(layout), tilts_of(layout)

    def residuals(
        theta: Any, initial: Any, guess: Any, window: Windows, noise: Any, numbers: Any
    ) -> Any:
        p = numbers_of(free, numbers, theta)
        commands = jnp.concatenate(
            [
                window.speed_commands[:-1] if "lag" in fields else window.speeds[:, 0],
                window.tilt_commands[:-1] if "frequency" in fields else window.tilts[:, 0],
            ],
            axis=1,
        )
        first = start(guess, initial, window.speeds[0, 0], window.tilts[0, 0], p["center"])
        advance = _runge_kutta(lambda *given: rate(*given, p))
        inputs = (window.step, window.speeds, window.tilts, commands)
        _, path = jax.lax.scan(advance, first, inputs)
        path = jnp.concatenate([first[None], path])
        found = jax.vmap(errors, (0, 0, None))(path, window.measured, p)
        sizes = [noise.get(name, 1.0) for name in MEASURED for _ in range(3)]
        parts = [jnp.where(window.is_measured, found / jnp.array(sizes), 0.0)]
        if "lag" in fields:
            error = at_samples(window.speeds) - path[:, 13 : 13 + rotors]
            parts.append(error / noise["rotor_speeds"])
        if "frequency" in fields:
            error = at_samples(window.tilts) - path[:, 13 + rotors : 13 + rotors + tilts]
            parts.append(error / noise["tilt_angles"])
        return jnp.concatenate(parts, axis=1)

    def at_samples(stages: Any) -> Any:
        return jnp.concatenate([stages[:, 0], stages[-1:, -1]])

    return residuals


def _runge_kutta(rate: Callable[..., Any]) -> Callable[..., Any]:
    """The fourth-order method from one sample to the next: ``(state, inputs) -> (state, state)``.

    Args:
        rate: ``(state, speeds, tilts, commands)``: the derivative of a state.
    """
    import jax
    import jax.numpy as jnp

    def stage(carried: Any, given: Any) -> tuple[Any, None]:
        # One stage for all four of RK4: the program is compiled once, not four times.
        base, slope, total, size, commands = carried
        speeds, tilts, (reach, weight, is_last) = given
        slope = rate(base + reach * size * slope, speeds, tilts, commands)
        total = total + weight * size * slope
        return (jnp.where(is_last, total, base), slope, total, size, commands), None

    def advance(state: Any, given: Any) -> tuple[Any, Any]:
        step, speeds, tilts, commands = given
        substeps = (len(speeds) - 1) // 2
        at = (2 * np.arange(substeps)[:, None] + STAGE_INPUTS).ravel()
        schedule = tuple(np.tile(one, substeps) for one in RUNGE_KUTTA)
        carried = (state, jnp.zeros_like(state), state, step / substeps, commands)
        carried, _ = jax.lax.scan(stage, carried, (speeds[at], tilts[at], schedule))
        return carried[0], carried[0]

    return advance


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
    first, begin = windows.step[:, :1], windows.measured[:, :2]
    is_measured = windows.is_measured[:, 0]
    place, velocity, attitude, rates = np.split(begin, [3, 6, 10], axis=-1)
    moved = (place[:, 1] - place[:, 0]) / first
    velocity = np.where(is_measured[:, 3:6], velocity[:, 0], moved)
    turned = Rotation.from_quat(attitude[..., [1, 2, 3, 0]].reshape(-1, 4))
    moved = (turned[::2].inv() * turned[1::2]).as_rotvec() / first
    rates = np.where(is_measured[:, 9:], rates[:, 0], moved)
    return np.hstack([place[:, 0], velocity, attitude[:, 0], rates])


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
