"""What several chapters' claims measure."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from controllers.singularity import residuals
from tiltsim.report.model import Metrics

if TYPE_CHECKING:
    from controllers.vehicle import Vehicle


class Coefficients(NamedTuple):
    """Coefficients of the determinant (ch. 3, Eq. 17), by product: "csss" is c1 s2 s3 s4."""

    R: dict[str, float]  # of cos(roll) cos(pitch)
    R_phi: dict[str, float]  # of sin(roll) cos(pitch)
    R_theta: dict[str, float]  # of sin(pitch)


def determinant_coefficients(vehicle: Vehicle) -> Coefficients:
    """The determinant's coefficients: at tilt angles of 0 and 90 degrees one product is 1 alone."""
    names = ["".join(letters) for letters in product("cs", repeat=4)]
    angles = [[np.pi / 2 if letter == "s" else 0.0 for letter in name] for name in names]
    values = residuals(angles, vehicle)
    return Coefficients(*(dict(zip(names, part.tolist(), strict=True)) for part in values))


def worst_coefficient(printed: Coefficients, vehicle: Vehicle) -> float:
    """Largest distance of a printed coefficient from the computed one; absent ones are 0."""
    computed = determinant_coefficients(vehicle)
    return max(
        abs(own.get(name, 0.0) - table.get(name, 0.0))
        for own, table in zip(computed, printed, strict=True)
        for name in own.keys() | table.keys()
    )


def metric_of(address: str, metric: str) -> Callable[[Mapping[str, Metrics]], float]:
    """A measure: one metric of one flight."""
    return lambda flights: float(flights[address][metric])


def every_flight_completed(flights: Mapping[str, Metrics]) -> bool:
    """A measure: no flight was lost."""
    return not any(metrics["diverged"] for metrics in flights.values())
