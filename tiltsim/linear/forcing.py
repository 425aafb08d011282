"""The inputs from outside a closed loop: whether they are steady, periodic or neither."""

from collections.abc import Sequence
from fractions import Fraction
from math import gcd, lcm, pi
from typing import Final, NamedTuple

import numpy as np

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.errors import InputError
from tiltsim.scenario.scenario import Scenario
from tiltsim_controllers.gaits.motion import CUBIC
from tiltsim_controllers.mathematics.scalar import Floats, Triple
from tiltsim_controllers.references import trajectories

MOST_PERIODS: Final = 1000  # most periods of a gait or reference in their common period
CONTROLLER_EVENTS: Final = ("turn_time", "failure_known_from")
"""Keys of controllers: times (s) until which they change."""

_AT_REST: Final = (0.0, 0.0, 0.0)


class Forcing(NamedTuple):
    """The dependence of a closed loop on time.

    Attributes:
        period: s; None if only the motion of the frame depends on time.
        velocity, acceleration: Motion of a frame in which the reference repeats, at time zero, m/s
        and m/s^2, world axes.
        start: Time (s) from which this holds: faults have happened and are known, gusts and
            pushes have passed, the commanded attitude is reached.
    """

    period: float | None
    velocity: Triple
    acceleration: Triple
    start: float

    def motion(self, names: Sequence[str], start: float, end: float) -> Floats:
        """Motion of the frame from one time (s) to another, in coordinates of these names."""
        after, moved = end - start, dict.fromkeys(names, 0.0)
        for axis, velocity, acceleration in zip("xyz", self.velocity, self.acceleration):
            if axis in moved:
                moved[axis] = (velocity + acceleration * 0.5 * (start + end)) * after
                moved[f"v{axis}"] = acceleration * after
        return np.array(list(moved.values()))

    def rates(self, names: Sequence[str], time: float) -> Floats:
        """The rates of the frame's coordinates of these names at a time (s)."""
        return self.motion(names, time - 0.5, time + 0.5)


def forcing_of(assembly: Assembly) -> Forcing:
    """The forcing of a flight. Raises `InputError` where it is neither steady nor periodic."""
    scenario, gait = assembly.scenario, assembly.gait
    _check(scenario)
    address = scenario.address or "scenario"
    reference = assembly.reference
    periods = _periods(reference, scenario)
    velocity, acceleration = _AT_REST, _AT_REST
    if reference.type == trajectories.LINE:
        velocity, acceleration = reference.velocity, reference.acceleration
        _check_line(scenario, velocity, acceleration)
    if assembly.loop.uses_gait and gait.period is not None:
        kind = gait.parameters
        if kind.type == CUBIC and not kind.repeats:
            raise InputError(
                f"{address}: gait.repeat = false: a table that does not repeat ends; set it to true"
            )
        if scenario.gait.type == "rotating" and scenario.simulation.plant != "thesis":
            raise InputError(
                f'{address}: gait.type = "rotating": its tilt angles grow for ever; '
                'choose simulation.plant = "thesis"'
            )
        periods.append(gait.period)
    gust = None if scenario.air is None else scenario.air.gust
    passed = 0.0 if gust is None else gust.start + 2.0 * gust.rise + gust.duration
    events = [passed, *(fault.time for fault in scenario.fault)]
    events += [load.end or load.start for load in scenario.loads]
    events += [getattr(scenario.controller, key, 0.0) for key in CONTROLLER_EVENTS]
    return Forcing(_common(periods, scenario), velocity, acceleration, max(events))


def _check(scenario: Scenario) -> None:
    """Refuse what is random, and controllers whose states are unknown."""
    address = scenario.address or "scenario"
    if scenario.controller.is_external:
        raise InputError(
            f'{address}: controller.law = "{scenario.controller.law}": its states are unknown, so '
            "it has no linear analysis"
        )
    noisy = [name for name, value in scenario.sensors if name.endswith("_noise") and value]
    if noisy:
        raise InputError(f"{address}: sensors.{noisy[0]}: with noise nothing repeats; set it to 0")
    if scenario.air is not None and scenario.air.turbulence is not None:
        raise InputError(f"{address}: air.turbulence: in turbulence nothing repeats; leave it out")


def _check_line(scenario: Scenario, velocity: Triple, acceleration: Triple) -> None:
    """Refuse lines along which the air acts differently from place to place or time to time."""
    air, address = scenario.air, scenario.address or "scenario"
    if air is None:
        return
    if any(acceleration) and (any(air.drag.linear) or any(air.drag.area)):
        raise InputError(
            f"{address}: reference.acceleration = {list(acceleration)}: with air.drag the flight "
            "is neither at rest nor periodic, for its airspeed grows; leave out one of the two"
        )
    if air.ground_effect is not None and (velocity[2] or acceleration[2]):
        raise InputError(
            f"{address}: reference: the line climbs or descends: with air.ground_effect the flight "
            "is neither at rest nor periodic, for its height changes; leave out one of the two"
        )


def _periods(reference: trajectories.ReferenceParameters, scenario: Scenario) -> list[float]:
    """The periods (s) of a reference."""
    if reference.type in {trajectories.SETPOINT, trajectories.ATTITUDE_ALTITUDE, trajectories.LINE}:
        return []
    if reference.type == trajectories.CIRCLE:
        rates = [reference.angular_frequency]
    elif reference.type == trajectories.LISSAJOUS:
        rates = [w for w, size in zip(reference.frequency, reference.amplitude) if size]
    else:
        raise InputError(
            f'{scenario.address or "scenario"}: reference.type = "{scenario.reference.type}": the '
            "flight is neither at rest nor periodic; choose setpoint, line, circle or lissajous"
        )
    return [2.0 * pi / abs(rate) for rate in rates if rate]


def _common(periods: list[float], scenario: Scenario) -> float | None:
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
            f"{scenario.address or 'scenario'}: gait and reference have the periods {listed} s, "
            f"with no common multiple within {MOST_PERIODS} of them: the flight is not periodic"
        )
    return float(common) * first
