"""The duration of a flight in which its slowest mode decays."""

from __future__ import annotations

from math import ceil, exp, log
from typing import Final, NamedTuple

from tiltsim.errors import InputError
from tiltsim.laws.assembling import assemble
from tiltsim.linear.forcing import forcing_of
from tiltsim.linear.modes import KINDS
from tiltsim.linear.stability import stability
from tiltsim.scenario.scenario import Scenario

MOST_STEPS: Final = 5_000
"""Longest orbit that is sought for its modes alone: some seconds of compiled steps."""


class SlowestMode(NamedTuple):
    """The mode of attitude and position that decays most slowly."""

    name: str
    decay_rate: float  # 1/s

    def left_after(self, time: float) -> float:
        """The share of a disturbance that is left after a time (s)."""
        return exp(-self.decay_rate * time)

    def time_until(self, left: float) -> float:
        """When this share of a disturbance is left, s."""
        return -log(left) / self.decay_rate


def slowest_mode(scenario: Scenario) -> SlowestMode | None:
    """The slowest mode of a flight, as `tiltsim.linear.stability` has it.

    Horizontal motion counts if the law follows the reference's. None without a decaying mode, and
    for flights that are neither at rest nor periodic or that take more than `MOST_STEPS` a period.
    """
    assembly = assemble(scenario)
    without = {*KINDS.values()} if assembly.follows_position else {*KINDS.values(), "x", "y"}
    try:
        period = forcing_of(assembly).period or 0.0
        if period > MOST_STEPS * scenario.simulation.timestep:
            return None
        modes = stability(scenario).modes
    except InputError:
        return None
    named = [(mode.growth_rate, mode.name) for mode in modes if mode.frequency > 0.0]
    decaying = [(r, name) for r, name in named if r < 0.0 and not {*name.split(", ")} <= without]
    if not decaying:
        return None
    rate, name = max(decaying)
    return SlowestMode(name, -rate)


def advice_on_duration(slowest: SlowestMode, duration: float, near: float, mean: float) -> str:
    """One line if a flight is too short to tell what comes back; empty if it is long enough.

    Args:
        slowest: Its slowest mode.
        duration: Duration of the flight, s.
        near: Admissible remainder of a disturbance of 1 m or rad.
        mean: Seconds at the end over which the mean is taken.
    """
    left = slowest.left_after(max(0.0, duration - mean))
    if left <= near:
        return ""
    enough = ceil(slowest.time_until(near) + mean)
    return (
        f"simulation.duration = {duration:g} s is short: the slowest mode, {slowest.name}, decays "
        f"as exp(-{slowest.decay_rate:.3g} t) and leaves {100.0 * left:.2g} % of a disturbance, "
        f"more than the {100.0 * near:g} % that count as back; take {enough} s"
    )
