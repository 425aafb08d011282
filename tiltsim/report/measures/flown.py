"""Measures of one flight or several, from their metrics."""

from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise, product
from math import hypot, inf
from typing import Final, TypeAlias

import numpy as np

from tiltsim.report.claim import Metrics
from tiltsim_controllers.analysis.published_gaits import DETERMINANT_CASES

Flown: TypeAlias = Sequence[Metrics]

_COMPUTED: Final[dict[str, Callable[[Metrics], float]]] = {
    "attitude": lambda m: hypot(*(float(m[f"final_{a}"]) for a in ("roll", "pitch", "yaw"))),
    "resting_error": lambda m: hypot(*(float(m[f"final_position_error_{a}"]) for a in "xy")),
    "rotor_speed_range": lambda m: float(m["max_rotor_speed"]) - float(m["min_rotor_speed"]),
}
"""Quantities that are no metric themselves."""


def _values(flights: Iterable[Metrics], quantity: str) -> list[float]:
    """A metric, one of `_COMPUTED`, or with a leading ``abs `` its absolute value, by flight."""
    name = quantity.removeprefix("abs ")
    of = _COMPUTED.get(name)
    values = [of(metrics) if of else float(metrics[name]) for metrics in flights]
    return values if name == quantity else [abs(value) for value in values]


def _means(flights: Flown, quantity: str, size: int) -> list[float]:
    """The means of successive groups of ``size`` flights."""
    return [float(mean) for mean in np.reshape(_values(flights, quantity), (-1, size)).mean(1)]


def least(flights: Flown, quantity: str) -> float:
    """The smallest value of all flights."""
    return min(_values(flights, quantity))


def largest(flights: Flown, quantity: str) -> float:
    """The largest value of all flights."""
    return max(_values(flights, quantity))


def first_over_last(flights: Flown, quantity: str) -> float:
    """The value of the first flight, as a multiple of the last one's."""
    values = _values(flights, quantity)
    return _over(values[0], values[-1])


def difference(flights: Flown, quantity: str) -> float:
    """Difference of the first two flights, as a share of the largest value of all."""
    values = _values(flights, quantity)
    return _over(abs(values[0] - values[1]), max(values))


def spread_of_means(flights: Flown, quantity: str, size: int) -> float:
    """Spread of the means of groups of ``size`` flights, as a share of the largest mean."""
    means = _means(flights, quantity, size)
    return _over(max(means) - min(means), max(means))


def ratio(flights: Flown, quantity: str, other: str) -> float:
    """The only flight's quantity as a multiple of another one."""
    return _over(_values(flights, quantity)[0], _values(flights, other)[0])


def _over(value: float, other: float) -> float:
    """A ratio; infinite, or NaN, over zero."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.divide(value, other))


def grows(flights: Flown, quantity: str) -> bool:
    """Whether it increases from each flight to the next."""
    return all(first < second for first, second in pairwise(_values(flights, quantity)))


def falls(flights: Flown, quantity: str) -> bool:
    """Whether it decreases from each flight to the next."""
    return grows(flights[::-1], quantity)


def grows_until_lost(flights: Flown, quantity: str) -> bool:
    """Whether it increases from each flight to the next, where a lost flight has the largest."""
    errors = [inf if m["diverged"] else _values([m], quantity)[0] for m in flights]
    return all(slower < faster for slower, faster in pairwise(errors))


def grows_in_both_decouplers(flights: Flown, quantity: str) -> bool:
    """Whether it increases along every second flight, from the first and from the second on."""
    return all(grows(flights[start::2], quantity) for start in (0, 1))


def stable_corners(small: float) -> float:
    """Number of `stable_flights` at the corners S, T, M of ch. 3's triangle, for its 20 pairs.

    Flown on the thesis's equations.
    """
    from tiltsim.scenario.loading import load_scenario
    from tiltsim.simulation.batch import fly

    keys = {"simulation.plant": "thesis", "simulation.engine": "native"}
    base = load_scenario("ch03_gaits/corners#equal_s", keys)
    pairs = [pair for case in DETERMINANT_CASES.values() for pair in case.pairs]
    corners = ((-1.3, 1.3), (1.3, -1.3), (1.0, 1.0))
    gaits = [[first, a, third, b] for (first, third), (a, b) in product(pairs, corners)]
    flights = fly([base.replace({"gait.angles": angles}) for angles in gaits])
    return stable_flights([flight.metrics for flight in flights], small)


def falls_along_both_axes(family: str) -> bool:
    """Whether the modified decoupler has the smaller errors after 20 s along x and along y.

    Flown on the thesis's equations; ``family`` is the address without the decoupler.
    """
    from tiltsim.scenario.loading import load_scenario
    from tiltsim.simulation.simulate import simulate_to_end

    keys = {"simulation.plant": "thesis", "simulation.engine": "native"}
    largest = []
    for decoupler in ("conventional", "modified"):
        flight = simulate_to_end(load_scenario(f"{family}_{decoupler}", keys))
        error = (flight["position"] - flight["reference_position"])[flight["time"] >= 20.0]
        largest.append(np.abs(error[:, :2]).max(axis=0).tolist())
    return all(modified < conventional for conventional, modified in zip(*largest))


def second_half_is_smaller(flights: Flown, quantity: str) -> bool:
    """Whether each flight of the second half has less than the one in its place in the first."""
    values = _values(flights, quantity)
    half = len(values) // 2
    return all(second < first for first, second in zip(values[:half], values[half:], strict=True))


def saves_most_where_largest(flights: Flown, quantity: str) -> bool:
    """Whether the pair with the largest first value is the pair that falls the most."""
    values = _values(flights, quantity)
    saved = np.subtract(values[::2], values[1::2])
    return int(np.argmax(values[::2])) == int(np.argmax(saved))


def least_mean_is_first(flights: Flown, quantity: str, size: int) -> bool:
    """Whether the first of the groups of ``size`` flights has the smallest mean."""
    return int(np.argmin(_means(flights, quantity, size))) == 0


def largest_mean_is_second(flights: Flown, quantity: str, size: int) -> bool:
    """Whether the second of the groups of ``size`` flights has the largest mean."""
    return int(np.argmax(_means(flights, quantity, size))) == 1


def all_complete(flights: Flown) -> bool:
    """Whether no flight is lost."""
    return not any(metrics["diverged"] for metrics in flights)


def is_lost(flights: Flown) -> bool:
    """Whether the only flight is lost."""
    return not all_complete(flights)


def all_complete_and_turn(flights: Flown) -> bool:
    """Whether no flight is lost and no rotor stops or reverses."""
    return all_complete(flights) and least(flights, "min_rotor_speed") > 0.0


def lost_at_the_published_curve(flights: Flown) -> bool:
    """Whether the flight that crosses S = 0 of ch. 2 is lost there."""
    [metrics] = flights
    crossed = metrics["min_published_determinant"] < 0.0 < metrics["max_published_determinant"]
    return bool(metrics["diverged"]) or not crossed


def stable_flights(flights: Flown, small: float) -> float:
    """Number of flights at rest at the end, without a reversed rotor (ch. 3, Sec. 4).

    ``small`` is the largest remaining angle (rad) and height (m).
    """
    resting = ("final_roll", "final_pitch", "final_yaw", "final_position_error_z")
    return float(
        sum(
            all_complete_and_turn([metrics])
            and all(abs(float(metrics[name])) < small for name in resting)
            for metrics in flights
        )
    )
