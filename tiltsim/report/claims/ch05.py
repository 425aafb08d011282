"""Chapter 5: walk, run and gallops, their scaling, and the singular attitudes.

The keyframes are reconstructed so that these claims hold (`tiltsim_controllers.gaits.cat.SWINGS`).
A claim that they were fitted to says so: it shows that some gaits behave as ch. 5 reports, not that
its gaits were these.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from itertools import pairwise, product
from typing import Final

import numpy as np

from tiltsim.report.claim import AnalysisClaim, FlightClaim, Metrics
from tiltsim.report.claims.ch03 import EQ_17, EQ_19
from tiltsim.report.draft import draft
from tiltsim.report.measures import (
    every_flight_completed,
    falls,
    routh_holds,
    terms,
    terms_hold,
    tracking_error,
)
from tiltsim_controllers.analysis.published_gaits import smallest_margin
from tiltsim_controllers.analysis.singularity import determinant
from tiltsim_controllers.gaits import plans
from tiltsim_controllers.gaits.cat import SWINGS
from tiltsim_controllers.vehicle.parameters import PRESETS

_VEHICLE: Final = PRESETS["ar_drone_2"]
_REFERENCES: Final = {"line": "Sec. 6, Fig. 12", "circle": "Sec. 6, Fig. 13"}
_PERIODS: Final = (1, 2, 3)
_DECOUPLERS: Final = ("conventional", "modified")
_GAITS: Final = {
    "walk_third": "walk at 1/3",
    "run_full": "run",
    "transverse_gallop_third": "transverse gallop at 1/3",
    "rotary_gallop_third": "rotary gallop at 1/3",
}
_SCALED: Final = ("walk", "transverse_gallop", "rotary_gallop")
_FITTED: Final = " (keyframes fitted)"

_WALK_AND_PERIOD: Final = (
    "With the conventional decoupler the walk's error grows by 6 % from T = 1 s to 3 s, as "
    "published; with the modified one it nearly doubles from 0.2 m at T = 1 s."
)

EQ_15: Final = EQ_17._replace(
    R_phi=terms(
        "1.000 ccsc - 1.000 sccc - 1.000 csss + 1.000 sssc + 2.880 ccss + 2.880 cssc "
        "- 2.880 scss - 2.880 sscc"
    )
)
"""The printed condition at any attitude, with its misprints in the terms with sin(roll)."""


def _margin(gait: str, scale: int) -> float:
    swing = SWINGS[gait]
    return smallest_margin(
        plans.cat(gait, swing.amplitude, 1.0, swing.lean).scaled(scale), _VEHICLE
    )


def _is_singular(gait: str) -> bool:
    return _margin(gait, 1) <= 0.0


def _scaling_enlarges(gait: str) -> bool:
    """Whether the margin grows from 1 over 1/2 to 1/3, where a gait whose R vanishes has none."""
    margins = [max(0.0, _margin(gait, scale)) for scale in (1, 2, 3)]
    return all(first < second for first, second in pairwise(margins))


def _some_scale_is_regular() -> bool:
    """Eq. (18): as a gait shrinks, the determinant goes to 4 cos(roll) cos(pitch)."""
    roll, pitch = np.meshgrid(np.linspace(-1.5, 1.5, 61), np.linspace(-1.5, 1.5, 61))
    limit = determinant(np.zeros(4), roll, pitch, _VEHICLE)
    agrees = bool(np.abs(limit - 4.0 * np.cos(roll) * np.cos(pitch)).max() < 1e-9)
    return agrees and all(any(_margin(gait, n) > 0.0 for n in range(2, 13)) for gait in _SCALED)


def _address(reference: str, gait: str, period: int, decoupler: str) -> str:
    return f"ch05_gaits/{reference}#{gait}_t{period}_{decoupler}"


def _error(
    flights: Mapping[str, Metrics], reference: str, gait: str, period: int, decoupler: str
) -> float:
    return tracking_error(flights[_address(reference, gait, period, decoupler)])


def _saves_most_where_the_error_is_largest(reference: str, flights: Mapping[str, Metrics]) -> bool:
    """Whether the case with the largest conventional error is the one that improves the most."""
    cases = list(product(_GAITS, _PERIODS))
    plain = [_error(flights, reference, *case, "conventional") for case in cases]
    saved = [a - _error(flights, reference, *case, "modified") for a, case in zip(plain, cases)]
    return int(np.argmax(plain)) == int(np.argmax(saved))


def _grows(reference: str, gait: str, flights: Mapping[str, Metrics]) -> bool:
    return all(
        _error(flights, reference, gait, shorter, d) < _error(flights, reference, gait, longer, d)
        for d in _DECOUPLERS
        for shorter, longer in pairwise(_PERIODS)
    )


def _depends_on_period(reference: str, gait: str, flights: Mapping[str, Metrics]) -> bool:
    """Whether a longer period makes the error 1.5 times as large, with either decoupler."""
    return any(
        _error(flights, reference, gait, 3, d) > 1.5 * _error(flights, reference, gait, 1, d)
        for d in _DECOUPLERS
    )


def _mean_error(reference: str, gait: str, flights: Mapping[str, Metrics]) -> float:
    errors = [_error(flights, reference, gait, *case) for case in product(_PERIODS, _DECOUPLERS)]
    return float(np.mean(errors))


def _walk_is_smallest(reference: str, flights: Mapping[str, Metrics]) -> bool:
    return min(_GAITS, key=lambda g: _mean_error(reference, g, flights)) == "walk_third"


def _run_is_largest(reference: str, flights: Mapping[str, Metrics]) -> bool:
    return max(_GAITS, key=lambda g: _mean_error(reference, g, flights)) == "run_full"


def _gallops_are_alike(reference: str, flights: Mapping[str, Metrics]) -> bool:
    first, second = (_mean_error(reference, g, flights) for g in list(_GAITS)[2:])
    return abs(first - second) < 0.1 * max(first, second)


def _scale_changes_the_speeds(flights: Mapping[str, Metrics]) -> bool:
    third, sixth = (
        metrics["max_rotor_speed"] - metrics["min_rotor_speed"] for metrics in flights.values()
    )
    return third > 1.1 * sixth


def _all(reference: str, gaits: tuple[str, ...] = tuple(_GAITS)) -> tuple[str, ...]:
    return tuple(_address(reference, *case) for case in product(gaits, _PERIODS, _DECOUPLERS))


def _of_references(
    statement: str, measure: Callable[..., bool], section: str = "", case: str = ""
) -> Iterator[FlightClaim]:
    """A claim about all flights of a reference, for each reference."""
    for reference, figure in _REFERENCES.items():
        yield FlightClaim(
            draft(f"ch. 5, {section or figure}", statement),
            _all(reference),
            partial(measure, reference),
            case=reference + case,
        )


def _of_one_gait(
    statement: str, measure: Callable[..., bool], gaits: tuple[str, ...] = tuple(_GAITS)
) -> Iterator[FlightClaim]:
    """A claim about all flights of a gait, for each reference and gait."""
    for (reference, figure), gait in product(_REFERENCES.items(), gaits):
        yield FlightClaim(
            draft(f"ch. 5, {figure}", statement),
            _all(reference, (gait,)),
            partial(measure, reference, gait),
            case=f"{reference}, {_GAITS[gait]}",
        )


CLAIMS = (
    AnalysisClaim(
        draft(
            "ch. 5, Sec. 3.1, Eq. (11)",
            "Eq. (11), term by term, is the determinant at level attitude",
        ),
        partial(terms_hold, "R", EQ_19, _VEHICLE),
    ),
    AnalysisClaim(
        draft(
            "ch. 5, Sec. 4, Eq. (15)", "Eq. (15), term by term, is the determinant at any attitude"
        ),
        lambda: all(
            terms_hold(part, printed, _VEHICLE) for part, printed in EQ_15._asdict().items()
        ),
        refuted="-2.880 s1 c2 s3 s4 sin φ cos θ should be s1 c2 c3 s4, and the last term, "
        "1.000 s1 s2 s3 c4 sin φ cos θ, should be s1 s2 c3 s4.",
    ),
    *(
        AnalysisClaim(
            draft(
                "ch. 5, Abstract and Sec. 4",
                "Unscaled, the gait meets a singular matrix at level attitude" + _FITTED,
            ),
            partial(_is_singular, gait),
            case=gait.replace("_", " "),
            published=gait != "run",
        )
        for gait in (*_SCALED, "run")
    ),
    AnalysisClaim(
        draft(
            "ch. 5, Sec. 4, Prop. 1, Eq. (18)", "Some integer n makes a gait scaled by 1/n regular"
        ),
        _some_scale_is_regular,
    ),
    *(
        AnalysisClaim(
            draft(
                f"ch. 5, Sec. 4, Fig. {figure}",
                "Scaled by 1/2 and 1/3 the singular attitudes move away from level" + _FITTED,
            ),
            partial(_scaling_enlarges, gait),
            case=gait.replace("_", " "),
        )
        for gait, figure in zip(_SCALED, (9, 10, 11), strict=True)
    ),
    AnalysisClaim(
        draft(
            "ch. 5, App. A, Eqs. (A1)-(A4)", "With the printed gains the attitude loops are stable"
        ),
        partial(routh_holds, ("roll", "pitch", "yaw")),
        refuted="K1 K2 > K3 fails as in ch. 4, Prop. 4: 10 against 50 for roll and pitch, 1 "
        "against 1 for yaw. The factor missing in the printed matrix makes the flights stable.",
    ),
    *_of_references(
        "The gaits track the reference with either decoupler and every period" + _FITTED,
        lambda reference, flights: every_flight_completed(flights),
        case=", walk and gallops at 1/3, run",
    ),
    *(
        FlightClaim(
            draft(
                f"ch. 5, {section}",
                "The modified decoupler decreases the error for all gaits" + _FITTED,
            ),
            tuple(_address(reference, gait, period, d) for d in _DECOUPLERS),
            partial(falls, tracking_error),
            case=f"{reference}, {title}, T = {period} s",
        )
        for (reference, section), (gait, title), period in product(
            _REFERENCES.items(), _GAITS.items(), _PERIODS
        )
    ),
    *_of_references(
        "The modified decoupler helps most where the error is largest",
        _saves_most_where_the_error_is_largest,
    ),
    *_of_one_gait("The error tends to grow with the period of the gait" + _FITTED, _grows),
    *(
        replace(
            claim,
            published="run" in claim.case,
            why="" if "run" in claim.case else _WALK_AND_PERIOD,
        )
        for claim in _of_one_gait(
            "The error depends strongly on the period (it grows by half from T = 1 s to 3 s)",
            _depends_on_period,
            ("walk_third", "run_full"),
        )
    ),
    *_of_references(
        "The walk has the smallest errors of the four gaits" + _FITTED, _walk_is_smallest, "Sec. 7"
    ),
    *_of_references(
        "The run has the largest errors of the four gaits" + _FITTED, _run_is_largest, "Sec. 7"
    ),
    *_of_references(
        "The two gallops have similar errors (within a tenth)" + _FITTED,
        _gallops_are_alike,
        "Sec. 7",
    ),
    FlightClaim(
        draft(
            "ch. 5, Sec. 7, Figs. 14-15",
            "The scale of the walk, 1/3 or 1/6, changes the rotor speeds "
            "(their range by at least a tenth)",
        ),
        tuple(_address("line", f"walk_{n}", 3, "modified") for n in ("third", "sixth")),
        _scale_changes_the_speeds,
    ),
)
