"""Chapter 5, Secs. 5 to 7: cat gaits on a line and on a circle, all with fitted keyframes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from itertools import pairwise, product
from typing import Final

import numpy as np

from tiltsim.report.claim import FlightClaim, Metrics
from tiltsim.report.measures import every_flight_completed, falls, no_rotor_stops, tracking_error
from tiltsim.report.statement import Statement, read_statements

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


THESIS: Final = read_statements("ch05_flights")

CLAIMS = (
    *(
        FlightClaim(
            THESIS["ch5-flown"],
            _all(reference, (gait,), (decoupler,)),
            _flown,
            case=f"{reference}, {title}, {decoupler}",
            why=_REVERSED,
        )
        for reference, (gait, title), decoupler in product(_REFERENCES, _GAITS.items(), _DECOUPLERS)
    ),
    *(
        FlightClaim(
            THESIS["ch5-decreases"],
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
            THESIS["ch5-helps-most"],
            _all(reference),
            partial(_saves_most_where_the_error_is_largest, reference),
            where=f"ch. 5, {section}",
            case=reference,
        )
        for reference, section in _REFERENCES.items()
    ),
    *(
        FlightClaim(
            THESIS["ch5-period"],
            _all(reference, (gait,)),
            partial(_grows, reference, gait),
            where=f"ch. 5, {section}",
            case=f"{reference}, {title}",
        )
        for (reference, section), (gait, title) in product(_REFERENCES.items(), _GAITS.items())
    ),
    *(
        FlightClaim(
            THESIS["ch5-depends-on-period"],
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
    *_by_decoupler(THESIS["ch5-walk-least"], _walk_is_smallest, _GALLOPS_WIN),
    *_by_decoupler(THESIS["ch5-run-largest"], _run_is_largest),
    *_by_decoupler(THESIS["ch5-gallops-alike"], _gallops_are_alike),
    FlightClaim(
        THESIS["ch5-scale-speeds"],
        tuple(_address("line", f"walk_{n}", 3, "modified") for n in ("third", "sixth")),
        _scale_changes_the_speeds,
    ),
)
