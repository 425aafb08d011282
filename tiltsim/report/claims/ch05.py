"""Chapter 5: walk, run and gallops, their scaling, and the singular attitudes.

The keyframes are reconstructed so that these claims hold (`tiltsim_controllers.gaits.cat.SWINGS`).
What is flown with them and holds is consistent with a fit: it shows that some gaits behave as ch. 5
reports, not that its gaits were these.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from itertools import pairwise, product
from typing import Final

import numpy as np

from tiltsim.report.claim import AnalysisClaim, FlightClaim, Metrics
from tiltsim.report.claims.ch03 import EQ_17, EQ_19
from tiltsim.report.measures import (
    every_flight_completed,
    falls,
    no_rotor_stops,
    routh_holds,
    terms,
    terms_hold,
    tracking_error,
)
from tiltsim.report.statement import Origin, Statement
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

_REVERSED: Final = (
    "All flights complete, but a rotor reverses. By ch. 3, Remark 1, “hitting the non-negative "
    "angular velocity bound … can result in instability”, and its Sec. 6 counts no such flight as "
    "stable."
)
_GALLOPS_WIN: Final = (
    "With the modified decoupler both gallops have the smaller errors at every period. Averaged "
    "over both decouplers, the metres of the conventional one hide it."
)
_NEARLY_DOUBLES: Final = (
    "With the modified decoupler the walk's error nearly doubles from T = 1 s to 3 s; with the "
    "conventional one it grows by a twentieth, as published."
)
_RUN_HARDLY: Final = (
    "With the conventional decoupler the run's error grows by less than half; with the modified "
    "one it grows by more."
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


def _shrunk_gaits_are_regular() -> bool:
    """Eq. (18): as a gait shrinks, the determinant goes to 4 cos(roll) cos(pitch)."""
    roll, pitch = np.meshgrid(np.linspace(-1.5, 1.5, 61), np.linspace(-1.5, 1.5, 61))
    limit = determinant(np.zeros(4), roll, pitch, _VEHICLE)
    agrees = bool(np.abs(limit - 4.0 * np.cos(roll) * np.cos(pitch)).max() < 1e-9)
    return agrees and bool((limit > 0.0).all())


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


def _depends_on_period(
    reference: str, gait: str, decoupler: str, flights: Mapping[str, Metrics]
) -> bool:
    """Whether a longer period makes the error 1.5 times as large."""
    short, long = (_error(flights, reference, gait, period, decoupler) for period in (1, 3))
    return long > 1.5 * short


def _mean_error(reference: str, gait: str, decoupler: str, flights: Mapping[str, Metrics]) -> float:
    return float(np.mean([_error(flights, reference, gait, T, decoupler) for T in _PERIODS]))


def _walk_is_smallest(reference: str, decoupler: str, flights: Mapping[str, Metrics]) -> bool:
    return min(_GAITS, key=lambda g: _mean_error(reference, g, decoupler, flights)) == "walk_third"


def _run_is_largest(reference: str, decoupler: str, flights: Mapping[str, Metrics]) -> bool:
    return max(_GAITS, key=lambda g: _mean_error(reference, g, decoupler, flights)) == "run_full"


def _gallops_are_alike(reference: str, decoupler: str, flights: Mapping[str, Metrics]) -> bool:
    first, second = (_mean_error(reference, g, decoupler, flights) for g in list(_GAITS)[2:])
    return abs(first - second) < 0.1 * max(first, second)


def _flown(flights: Mapping[str, Metrics]) -> bool:
    return every_flight_completed(flights) and no_rotor_stops(flights)


def _scale_changes_the_speeds(flights: Mapping[str, Metrics]) -> bool:
    third, sixth = (
        metrics["max_rotor_speed"] - metrics["min_rotor_speed"] for metrics in flights.values()
    )
    return third > 1.1 * sixth


def _all(
    reference: str, gaits: Iterable[str] = _GAITS, decouplers: Iterable[str] = _DECOUPLERS
) -> tuple[str, ...]:
    return tuple(_address(reference, *case) for case in product(gaits, _PERIODS, decouplers))


def _by_decoupler(
    statement: Statement, measure: Callable[[str, str, Mapping[str, Metrics]], bool], why: str = ""
) -> Iterator[FlightClaim]:
    """A row per reference and decoupler, all gaits and periods; ``why`` is for the modified one."""
    for reference, decoupler in product(_REFERENCES, _DECOUPLERS):
        yield FlightClaim(
            statement,
            _all(reference, decouplers=(decoupler,)),
            partial(measure, reference, decoupler),
            case=f"{reference}, {decoupler}",
            why=why if decoupler == "modified" else "",
        )


_EVERY_TERM: Final = (
    "Every product of sines and cosines has the printed coefficient, to 0.001, and none is missing"
)
_RADARS: Final = "ch. 5, Sec. 6, Figs. 12-13"
_KEYFRAMES: Final = (Origin.KEYFRAMES,)

EQ_11 = Statement(
    id="ch5-eq-11",
    source="ch. 5, Sec. 3.1, Eq. (11)",
    text="Eq. (11), term by term, is the determinant at level attitude",
    thesis="“Once the gait … satisfies (11), the decoupling matrix in feedback linearization is "
    "asserted to be invertible in our case, given φ ≈ 0, θ ≈ 0.”",
    criterion=_EVERY_TERM,
)
EQ_15_HOLDS = Statement(
    id="ch5-eq-15",
    source="ch. 5, Sec. 4, Eq. (15)",
    text="Eq. (15), term by term, is the determinant at any attitude",
    thesis="“The exact necessary and sufficient condition [18] to receive an invertible decoupling "
    "matrix is” Eq. (15).",
    criterion=_EVERY_TERM,
    finding="slips",
)
UNSCALED = Statement(
    id="ch5-unscaled",
    source="ch. 5, Abstract and Sec. 4",
    text="Unscaled, the gait meets a singular matrix at level attitude",
    thesis="“It is found that the singular decoupling matrix exists in walk gait, transverse "
    "gallop gait, and rotary gallop gait”; the run “remains identical to the original cat-run "
    "gait”.",
    criterion="R vanishes or changes its sign within a period",
    origins=_KEYFRAMES,
    fitted=True,
)
SOME_SCALE = Statement(
    id="ch5-some-scale",
    source="ch. 5, Sec. 4, Prop. 1, Eq. (18)",
    text="Some integer n makes a gait scaled by 1/n regular",
    thesis="“There will always be a positive integer n such that the modified gait by scaling by "
    "1/n produces an invertible decoupling matrix”, since the determinant tends to 4.000 cφ cθ.",
    criterion="At zero tilt the determinant is 4 cos φ cos θ to 1e-9 and positive within 1.5 rad; "
    "it is continuous, so small gaits are regular, too",
)
SCALING = Statement(
    id="ch5-scaling",
    source="ch. 5, Sec. 4, Figs. 9-11",
    text="Scaled by 1/2 and 1/3 the singular attitudes move away from level",
    thesis="“It can be found that the acceptable attitude region is enlarging while evenly "
    "shrinking the scale of the walk gait. A similar result can also be notably observed in” both "
    "gallops.",
    criterion="The smallest rotation from level to a singular attitude grows from scale 1 to 1/2 "
    "and from 1/2 to 1/3",
    origins=_KEYFRAMES,
    fitted=True,
)
GAINS = Statement(
    id="ch5-gains",
    source="ch. 5, App. A, Eqs. (A1)-(A4)",
    text="With the printed gains the attitude loops are stable",
    thesis="App. A prints the gains of ch. 4, whose Prop. 4 is the stability condition.",
    criterion="All three gains of each loop are positive and K1 K2 > K3",
    finding="gains",
)
FLOWN = Statement(
    id="ch5-flown",
    source=_RADARS,
    text="The gait tracks the reference at every period",
    thesis="“The result shows that these gaits, after modifications, are feasible in tracking "
    "references, especially for the cases equipped with the modified attitude-position decoupler.”",
    criterion="With T = 1, 2 and 3 s the flight completes and no rotor reverses",
    fitted=True,
    pictures=("walk",),
)
DECREASES = Statement(
    id="ch5-decreases",
    source=_RADARS,
    text="The modified decoupler decreases the error for all gaits",
    thesis="“… the inner purple quadrilateral is much smaller than the outer blue quadrilateral, "
    "which demonstrates that our modified attitude-position decoupler significantly decreases the "
    "dynamic state error for all the gaits discussed.”",
    criterion="The largest error after 20 s is smaller than with the conventional decoupler",
    fitted=True,
)
HELPS_MOST = Statement(
    id="ch5-helps-most",
    source=_RADARS,
    text="The modified decoupler helps most where the error is largest",
    thesis="“This novel attitude-position decoupler is particularly effective for the case "
    "suffering from a large dynamic state error equipped with the conventional attitude-position "
    "decoupler.”",
    criterion="Of the twelve gaits and periods, the one with the largest conventional error is "
    "the one whose error decreases most",
    fitted=True,
)
GROWS = Statement(
    id="ch5-period",
    source=_RADARS,
    text="The error tends to grow with the period of the gait",
    thesis="“The longer the period is, the larger dynamic state error there tends to be in walk "
    "gait, run gait, transverse gallop gait, and rotary gallop gait.”",
    criterion="The largest error after 20 s grows from T = 1 s to 2 s and from 2 s to 3 s, with "
    "either decoupler",
    fitted=True,
)
DEPENDS = Statement(
    id="ch5-depends-on-period",
    source=_RADARS,
    text="The error depends strongly on the period",
    thesis="“The result of the walk gaits is insignificantly influenced by the period settings, "
    "while the result in the run gait highly relies on the period settings.”",
    criterion="The error grows by more than half from T = 1 s to 3 s",
    fitted=True,
)
WALK_LEAST = Statement(
    id="ch5-walk-least",
    source="ch. 5, Sec. 7, Figs. 12-13",
    text="The walk has the smallest errors of the four gaits",
    thesis="“… the modified walk-inspired gait in this research receives the least suprema of the "
    "dynamic state error after sufficient time.”",
    criterion="With the decoupler of the row, the mean over T = 1, 2, 3 s is the smallest of the "
    "four",
    note="The scale and the lean of our gaits are fitted, and “the dynamic state error may also be "
    "influenced by the maximum tilting angle of each gait” (Sec. 7).",
    fitted=True,
)
RUN_LARGEST = Statement(
    id="ch5-run-largest",
    source="ch. 5, Sec. 7, Figs. 12-13",
    text="The run has the largest errors of the four gaits",
    thesis="“… the run-inspired gait receives the largest suprema of the dynamic state error after "
    "sufficient time.”",
    criterion="With the decoupler of the row, the mean over T = 1, 2, 3 s is the largest of the "
    "four",
    fitted=True,
)
GALLOPS_ALIKE = Statement(
    id="ch5-gallops-alike",
    source="ch. 5, Sec. 7, Figs. 12-13",
    text="The two gallops have similar errors",
    thesis="“… the modified transverse gallop gait and rotary gallop gait receive similar suprema "
    "of the dynamic state error after sufficient time.”",
    criterion="With the decoupler of the row, the means over T = 1, 2, 3 s differ by less than a "
    "tenth",
    fitted=True,
)
SCALE_SPEEDS = Statement(
    id="ch5-scale-speeds",
    source="ch. 5, Sec. 7, Figs. 14-15",
    text="The scale of the walk, 1/3 or 1/6, changes the rotor speeds",
    thesis="“… the scale of the tilting angles influences the resulting angular velocities of the "
    "propellers of the tilt-rotor.”",
    criterion="The range of rotor speeds on the line at T = 3 s differs by at least a tenth",
    fitted=True,
)

CLAIMS = (
    AnalysisClaim(EQ_11, partial(terms_hold, "R", EQ_19, _VEHICLE)),
    AnalysisClaim(
        EQ_15_HOLDS,
        lambda: all(
            terms_hold(part, printed, _VEHICLE) for part, printed in EQ_15._asdict().items()
        ),
        refuted="-2.880 s1 c2 s3 s4 sin φ cos θ should be s1 c2 c3 s4, and the last term, "
        "1.000 s1 s2 s3 c4 sin φ cos θ, should be s1 s2 c3 s4.",
    ),
    *(
        AnalysisClaim(
            UNSCALED,
            partial(_is_singular, gait),
            case=gait.replace("_", " "),
            published=gait != "run",
        )
        for gait in (*_SCALED, "run")
    ),
    AnalysisClaim(SOME_SCALE, _shrunk_gaits_are_regular),
    *(
        AnalysisClaim(
            SCALING,
            partial(_scaling_enlarges, gait),
            case=gait.replace("_", " "),
            where=f"ch. 5, Sec. 4, Fig. {figure}",
        )
        for gait, figure in zip(_SCALED, (9, 10, 11), strict=True)
    ),
    AnalysisClaim(
        GAINS,
        partial(routh_holds, ("roll", "pitch", "yaw")),
        refuted="K1 K2 > K3 fails as in ch. 4, Prop. 4: 10 against 50 for roll and pitch, 1 "
        "against 1 for yaw. The factor missing in the printed matrix makes the flights stable.",
    ),
    *(
        FlightClaim(
            FLOWN,
            _all(reference, (gait,), (decoupler,)),
            _flown,
            case=f"{reference}, {title}, {decoupler}",
            why=_REVERSED,
        )
        for reference, (gait, title), decoupler in product(_REFERENCES, _GAITS.items(), _DECOUPLERS)
    ),
    *(
        FlightClaim(
            DECREASES,
            tuple(_address(reference, gait, period, d) for d in _DECOUPLERS),
            partial(falls, tracking_error),
            where=f"ch. 5, {section}",
            case=f"{reference}, {title}, T = {period} s",
        )
        for (reference, section), (gait, title), period in product(
            _REFERENCES.items(), _GAITS.items(), _PERIODS
        )
    ),
    *(
        FlightClaim(
            HELPS_MOST,
            _all(reference),
            partial(_saves_most_where_the_error_is_largest, reference),
            where=f"ch. 5, {section}",
            case=reference,
        )
        for reference, section in _REFERENCES.items()
    ),
    *(
        FlightClaim(
            GROWS,
            _all(reference, (gait,)),
            partial(_grows, reference, gait),
            where=f"ch. 5, {section}",
            case=f"{reference}, {title}",
        )
        for (reference, section), (gait, title) in product(_REFERENCES.items(), _GAITS.items())
    ),
    *(
        FlightClaim(
            DEPENDS,
            _all(reference, (gait,), (decoupler,)),
            partial(_depends_on_period, reference, gait, decoupler),
            case=f"{reference}, {_GAITS[gait]}, {decoupler}",
            published=gait == "run_full",
            why={
                ("walk_third", "modified"): _NEARLY_DOUBLES,
                ("run_full", "conventional"): _RUN_HARDLY,
            }.get((gait, decoupler), ""),
        )
        for reference, gait, decoupler in product(
            _REFERENCES, ("walk_third", "run_full"), _DECOUPLERS
        )
    ),
    *_by_decoupler(WALK_LEAST, _walk_is_smallest, _GALLOPS_WIN),
    *_by_decoupler(RUN_LARGEST, _run_is_largest),
    *_by_decoupler(GALLOPS_ALIKE, _gallops_are_alike),
    FlightClaim(
        SCALE_SPEEDS,
        tuple(_address("line", f"walk_{n}", 3, "modified") for n in ("third", "sixth")),
        _scale_changes_the_speeds,
    ),
)
