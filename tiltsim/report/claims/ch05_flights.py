"""Chapter 5, Secs. 5 to 7: cat gaits on a line and on a circle, all with fitted keyframes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from itertools import pairwise, product
from typing import Final

import numpy as np

from tiltsim.report.claim import FlightClaim, Metrics
from tiltsim.report.measures import every_flight_completed, falls, no_rotor_stops, tracking_error
from tiltsim.report.statement import Statement

_REFERENCES: Final = {"line": "Sec. 6, Fig. 12", "circle": "Sec. 6, Fig. 13"}
_PERIODS: Final = (1, 2, 3)
_DECOUPLERS: Final = ("conventional", "modified")
_GAITS: Final = {
    "walk_third": "walk at 1/3",
    "run_full": "run",
    "transverse_gallop_third": "transverse gallop at 1/3",
    "rotary_gallop_third": "rotary gallop at 1/3",
}
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
_RADARS: Final = "ch. 5, Sec. 6, Figs. 12-13"


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
    finding="gallops",
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
