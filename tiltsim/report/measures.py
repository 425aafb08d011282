"""Measures that the claims of several chapters share."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise, product
from math import hypot
from typing import TYPE_CHECKING, Final, NamedTuple, TypeAlias

import numpy as np

from tiltsim.report.claim import AnalysisClaim, Metrics
from tiltsim.report.statement import Statement
from tiltsim_controllers.analysis.published_gaits import PUBLISHED_GAITS, robustness
from tiltsim_controllers.analysis.singularity import margin_over_gait, residuals
from tiltsim_controllers.analysis.stability import third_order_loop
from tiltsim_controllers.analysis.two_color_map import delta
from tiltsim_controllers.laws.gains import GAIN_SETS
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.parameters import PRESETS

if TYPE_CHECKING:
    from tiltsim_controllers.vehicle.parameters import Vehicle


PRINTED: Final = 1e-3
"""Accuracy to which the coefficients of the determinant are printed."""

EVERY_TERM: Final = (
    "Every product of sines and cosines has the printed coefficient, to 0.001, and none is missing"
)
"""The criterion of `terms_hold`."""

PRINTED_OFFSET: Final = 0.334198
"""α₁ + α₃ on blue as ch. 8 prints it (rad), 1e-5 beside the exact 2δ; twice α₁ of its point P."""

DIGITS: Final = (
    "Both equations for blue hold exactly where tan 2δ = 2 r / (1 - r²), r = K_m / (L K_f). The "
    "chapter's digits are those of the printed coefficients, tan 2δ = {}."
)
"""Note on an angle of the map; the chapter's printed ratio goes into it."""

Quantity: TypeAlias = "str | Callable[[Metrics], float]"
"""A metric by name, or a number computed from several."""


class Coefficients(NamedTuple):
    """Coefficients of the determinant (ch. 3, Eq. 17), by product: "csss" is c1 s2 s3 s4."""

    R: dict[str, float]  # of cos(roll) cos(pitch)
    R_phi: dict[str, float]  # of sin(roll) cos(pitch)
    R_theta: dict[str, float]  # of sin(pitch)


def terms(formula: str) -> dict[str, float]:
    """Read printed terms: "4.000 cccc - 5.592 ccsc" has the coefficient -5.592 of c1 c2 s3 c4."""
    coefficients: dict[str, float] = {}
    for sign, number, product_ in re.findall(r"([+-]?) ?([\d.]+) ([cs]{4})", formula):
        coefficients[product_] = coefficients.get(product_, 0.0) + float(sign + number)
    return coefficients


def determinant_coefficients(vehicle: Vehicle) -> Coefficients:
    """The determinant's coefficients: at tilt angles of 0 and 90 degrees only one product is 1."""
    names = ["".join(letters) for letters in product("cs", repeat=4)]
    angles = [[np.pi / 2 if letter == "s" else 0.0 for letter in name] for name in names]
    values = residuals(angles, vehicle)
    return Coefficients(*(dict(zip(names, part.tolist(), strict=True)) for part in values))


def coefficient(part: str, name: str, vehicle: Vehicle, scale: float = 1.0) -> float:
    """Absolute value of one coefficient of the determinant.

    Args:
        part, name, vehicle, scale: as in `terms_hold`
    """
    return scale * abs(float(getattr(determinant_coefficients(vehicle), part)[name]))


def terms_hold(
    part: str, printed: Mapping[str, float], vehicle: Vehicle, scale: float = 1.0
) -> bool:
    """Whether the printed terms of a part of the determinant are correct and complete.

    Args:
        part: ``R``, ``R_phi`` or ``R_theta``.
        printed: Printed coefficients by product; absent ones are 0.
        vehicle: The vehicle of the chapter.
        scale: Constant by which the chapter multiplies the determinant.
    """
    computed = getattr(determinant_coefficients(vehicle), part)
    return all(
        abs(scale * value - printed.get(name, 0.0)) < PRINTED for name, value in computed.items()
    )


def exact_and_printed(
    statement: Statement, exact: float, rounded: float, published: str
) -> tuple[AnalysisClaim, AnalysisClaim]:
    """Rows of an angle of the map: in closed form, and with the printed coefficients (rad).

    Args:
        statement: Whose rows.
        exact: In closed form.
        rounded: With the printed coefficients.
        published: As printed, to six digits.
    """
    near = (float(published) - 1e-4, float(published) + 1e-4)
    return (
        AnalysisClaim(
            statement,
            lambda: exact,
            case="in closed form",
            published=published,
            unit="rad",
            in_kind=near,
            why="The printed digits are those of rounded coefficients.",
        ),
        AnalysisClaim(
            statement,
            lambda: rounded,
            case="with the printed coefficients of R_φ and R_θ",
            published=published,
            unit="rad",
        ),
    )


def beats_its_biased_twin(key: str) -> bool:
    """Whether a published gait, on the exact lines, is more robust than its biased twin.

    ``key`` of the gait in `PUBLISHED_GAITS`.
    """
    return bool(robustness(PUBLISHED_GAITS[key]).claim_holds)


def angles_as_printed(key: str) -> Floats:
    """A gait of `PUBLISHED_GAITS` with the printed P and offset, over a period, shape (N, 4)."""
    vehicle = PRESETS["ar_drone_2"]
    gait = PUBLISHED_GAITS[key].gait
    first, second, third, _ = gait.angles(gait.sample_times(401)).T
    blue = np.abs(third - first) > 1e-12
    aside = 0.5 * PRINTED_OFFSET - delta(vehicle)  # so that a path through P passes the printed one
    first, second = first + aside, second - aside
    return np.stack(
        [
            first,
            second,
            np.where(blue, PRINTED_OFFSET - first, first),
            np.where(blue, -PRINTED_OFFSET - second, second),
        ],
        axis=-1,
    )


def margins_as_printed(key: str) -> tuple[float, float]:
    """Smallest margins (rad) of `angles_as_printed` and of its twin with a bias of 80 %."""
    angles = angles_as_printed(key)
    biased = angles * (1.0, 1.0, 0.8, 0.8)
    own, twin = (margin_over_gait(a, PRESETS["ar_drone_2"]).min() for a in (angles, biased))
    return float(own), float(twin)


def routh_holds(rows: Sequence[str]) -> bool:
    """Whether ch. 4's gains satisfy Routh's condition as printed, without another loop gain."""
    gains = GAIN_SETS["ch04"]._asdict()
    triples = [tuple(gains[f"{row}_{i}"] for i in (1, 2, 3)) for row in rows]
    return all(third_order_loop("", triple, 1.0).stable for triple in triples)


def tracking_error(metrics: Metrics) -> float:
    """Largest horizontal error from 20 s on, m."""
    return float(metrics["sup_position_error_after_20s"])


def resting_error(metrics: Metrics) -> float:
    """Horizontal error at the end, m."""
    return hypot(*(float(metrics[f"final_position_error_{axis}"]) for axis in "xy"))


def grows(value: Quantity, flights: Mapping[str, Metrics]) -> bool:
    """Whether a metric increases from each flight of the claim to the next."""
    of = (lambda metrics: float(metrics[value])) if isinstance(value, str) else value
    return all(first < second for first, second in pairwise(map(of, flights.values())))


def falls(value: Quantity, flights: Mapping[str, Metrics]) -> bool:
    """Whether a metric decreases from each flight of the claim to the next."""
    return grows(value, dict(reversed(list(flights.items()))))


def planned_gait_tilts_less(flights: Mapping[str, Metrics]) -> bool:
    """Whether the second flight, with the planned gait, tilts a hundred times more slowly."""
    own, planned = (float(metrics["max_tilt_rate"]) for metrics in flights.values())
    return planned < 0.01 * own


def no_rotor_stops(flights: Mapping[str, Metrics]) -> bool:
    """Whether all rotors keep turning in all flights."""
    return all(float(metrics["min_rotor_speed"]) > 0.0 for metrics in flights.values())


def every_flight_completed(flights: Mapping[str, Metrics]) -> bool:
    """Whether all flights complete."""
    return not any(metrics["diverged"] for metrics in flights.values())
