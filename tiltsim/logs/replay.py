"""Replay: a log's rotor speeds and tilts drive its vehicle's model, open loop, window by window."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np

from tiltsim.arrays.jax_programs import require_jax
from tiltsim.flight.vectors import VECTORS
from tiltsim.logs.identify import Problem
from tiltsim.logs.log import UNITS, Log
from tiltsim.logs.model import LoggedVehicle
from tiltsim.logs.reading import read_log
from tiltsim.logs.windows import MEASURED, windows_of
from tiltsim.scenario.loading import load_scenario
from tiltsim.scenario.scenario import Scenario
from tiltsim_controllers.mathematics.scalar import Floats


@dataclass(frozen=True)
class Replay:
    """How far a model leaves a log within a window, from the measured state at its beginning.

    Attributes:
        channels: The measured columns; attitude stands for small turns about the body axes.
        time: Times of the samples, s, shape (windows, samples).
        mismatch: Measured minus predicted, in units, shape (windows, samples, channels).
    """

    channels: tuple[str, ...]
    time: Floats
    mismatch: Floats

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
