"""The inputs from outside a closed loop: whether they are steady, periodic or neither."""

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from math import gcd, lcm, pi
from typing import Final, NamedTuple

import numpy as np

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.errors import InputError
from tiltsim_controllers.gaits.motion import CUBIC
from tiltsim_controllers.mathematics.scalar import Floats, Triple
from tiltsim_controllers.references import trajectories

MOST_PERIODS: Final = 1000  # most periods of a gait or reference in their common period
CONTROLLER_EVENTS: Final = ("turn_time", "failure_known_from")
"""Keys of controllers: times (s) until which they change."""


PAST: Final = 1e-6  # s, behind the last knot of a path, where its rounding ends


class Frame(NamedTuple):
    """A frame in which a reference repeats, at time zero."""

    velocity: Triple = (0.0, 0.0, 0.0)  # m/s, world axes
    acceleration: Triple = (0.0, 0.0, 0.0)  # m/s^2


class Forcing(NamedTuple):
    """The dependence of a closed loop on time."""

    period: float | None  # s; None if only the motion of the frames depends on time
    frames: Mapping[str, Frame]
    """One for each vehicle, by the beginning of its names."""
    start: float
    """Time (s) from which this holds: faults have happened and are known, gusts and pushes have
    passed, the commanded attitude is reached, paths have ended and cables hold."""

    def motion(self, names: Sequence[str], start: float, end: float) -> Floats:
        """Motion of the frames from one time (s) to another, in coordinates of these names."""
        after, moved = end - start, dict.fromkeys(names, 0.0)
        for prefix, frame in self.frames.items():
            for axis, velocity, acceleration in zip("xyz", *frame, strict=True):
                if prefix + axis in moved:
                    mean = velocity + acceleration * 0.5 * (start + end)
                    moved[prefix + axis] = mean * after
                    moved[f"{prefix}v{axis}"] = acceleration * after
        return np.array(list(moved.values()))

    def rates(self, names: Sequence[str], time: float) -> Floats:
        """The rates of the frames' coordinates of these names at a time (s)."""
        return self.motion(names, time - 0.5, time + 0.5)


def forcing_of(vehicles: Mapping[str, Assembly]) -> Forcing:
    """The forcing of a flight. Raises `InputError` where it is neither steady nor periodic.

    Args:
        vehicles: See `tiltsim.linear.coordinates.vehicles_of`.
    """
    world = vehicles[""].scenario
    address = world.address or "scenario"
    periods, events, frames = [], [0.0], {}
    for prefix, each in vehicles.items():
        for reason in _refusals(each):
            of = f"companion {prefix[:-1]}: " if prefix else ""
            raise InputError(f"{address}: {of}{reason}")
        scenario, reference = each.scenario, each.reference
        periods += _periods(reference)
        if each.loop.uses_gait and each.gait.period is not None:
            periods.append(each.gait.period)
        frames[prefix] = Frame(reference.velocity, reference.acceleration)
        if scenario.air is not None and (gust := scenario.air.gust) is not None:
            events.append(gust.start + 2.0 * gust.rise + gust.duration)
        events += [fault.time for fault in scenario.fault]
        events += [load.end or load.start for load in scenario.loads]
        events += [getattr(scenario.controller, key, 0.0) for key in CONTROLLER_EVENTS]
        if reference.segments:
            path = each.knots[int(reference.offset) :]
            end = np.reshape(path, (int(reference.segments), -1))[-1, 0]
            events.append(end + getattr(scenario.reference, "ramp", 0.0) + PAST)
    events += [time for cable in world.cable for time in (cable.start, cable.end or 0.0)]
    return Forcing(_common(periods, address), frames, float(max(events)))


def _refusals(assembly: Assembly) -> Iterator[str]:
    """Why a flight is neither steady nor periodic, or unknown."""
    scenario, air = assembly.scenario, assembly.scenario.air
    if scenario.controller.is_external:
        law = scenario.controller.law
        yield f'controller.law = "{law}": its states are unknown, so it has no linear analysis'
    for name, value in scenario.sensors:
        if name.endswith("_noise") and value:
            yield f"sensors.{name}: with noise nothing repeats; set it to 0"
    if air is not None and air.turbulence is not None:
        yield "air.turbulence: in turbulence nothing repeats; leave it out"
    velocity, acceleration = assembly.reference.velocity, assembly.reference.acceleration
    if air is not None and any(acceleration) and (any(air.drag.linear) or any(air.drag.area)):
        yield (
            f"reference.acceleration = {list(acceleration)}: with air.drag the flight is neither "
            "at rest nor periodic, for its airspeed grows; leave out one of the two"
        )
    if air is not None and air.ground_effect is not None and (velocity[2] or acceleration[2]):
        yield (
            "reference: the line climbs or descends: with air.ground_effect the flight is neither "
            "at rest nor periodic, for its height changes; leave out one of the two"
        )
    if not assembly.loop.uses_gait or assembly.gait.period is None:
        return
    kind = assembly.gait.parameters
    if kind.type == CUBIC and not kind.repeats:
        yield "gait.repeat = false: a table that does not repeat ends; set it to true"
    if scenario.gait.type == "rotating" and scenario.simulation.plant != "thesis":
        yield (
            'gait.type = "rotating": its tilt angles grow for ever; choose simulation.plant = '
            '"thesis"'
        )


def _periods(reference: trajectories.ReferenceParameters) -> list[float]:
    """The periods (s) of a reference."""
    rates = [reference.angular_frequency] if reference.type == trajectories.CIRCLE else []
    if reference.type == trajectories.LISSAJOUS:
        rates = [w for w, size in zip(reference.frequency, reference.amplitude) if size]
    return [2.0 * pi / abs(rate) for rate in rates if rate]


def _common(periods: list[float], address: str) -> float | None:
    """The shortest common multiple of periods."""
    if not periods:
        return None
    first = periods[0]
    ratios = [Fraction(period / first).limit_denominator(MOST_PERIODS) for period in periods]
    # That of fractions in lowest terms.
    common = Fraction(
        lcm(*(ratio.numerator for ratio in ratios)), gcd(*(ratio.denominator for ratio in ratios))
    )
    counts = [common / ratio for ratio in ratios]
    meets = all(
        abs(float(ratio) * first / period - 1.0) < 1e-9 and count <= MOST_PERIODS
        for ratio, period, count in zip(ratios, periods, counts, strict=True)
    )
    if not meets:
        listed = ", ".join(f"{period:g}" for period in periods)
        raise InputError(
            f"{address}: gaits and references have the periods {listed} s, "
            f"with no common multiple within {MOST_PERIODS} of them: the flight is not periodic"
        )
    return float(common) * first
