"""Measures of one flight or several, from their metrics."""

from collections.abc import Sequence
from itertools import pairwise, product
from math import inf
from typing import TypeAlias

import numpy as np

from tiltsim.report.claim import Metrics
from tiltsim_controllers.analysis.published_gaits import DETERMINANT_CASES
from tiltsim_controllers.mathematics.scalar import Floats

Flown: TypeAlias = Sequence[Metrics]


def norm(*parts: Floats) -> Floats:
    """The Euclidean norm of components, one per flight, shape (N,)."""
    return np.asarray(np.linalg.norm(parts, axis=0))


def means(values: Floats, size: int) -> Floats:
    """The means of successive groups of ``size`` flights."""
    return np.asarray(np.reshape(values, (-1, size)).mean(axis=1))


def spread(values: Floats) -> float:
    """The spread of values, as a share of the largest one."""
    return float(np.ptp(values) / np.max(values))


def first_over_last(values: Floats) -> float:
    """The value of the first flight, as a multiple of the last one's."""
    return float(values[0] / values[-1])


def grows_until_lost(flights: Flown, metric: str) -> bool:
    """Whether it increases from each flight to the next, where a lost flight has the largest."""
    errors = [inf if metrics["diverged"] else float(metrics[metric]) for metrics in flights]
    return all(slower < faster for slower, faster in pairwise(errors))


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
            not metrics["diverged"]
            and metrics["min_rotor_speed"] > 0.0
            and all(abs(float(metrics[name])) < small for name in resting)
            for metrics in flights
        )
    )
