"""Chapter 9: torques, thrusts and accelerations under rotor limits."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from itertools import pairwise
from typing import Final

import numpy as np

from tiltsim.report.claim import AnalysisClaim, FlightClaim, Metrics
from tiltsim.report.claims.ch03 import EQ_19
from tiltsim.report.claims.ch06 import RANK
from tiltsim.report.measures import EVERY_TERM, every_flight_completed, terms_hold, tracking_error
from tiltsim.report.statement import read_statements
from tiltsim_controllers.analysis.attainable import (
    AttainableSet,
    attainable_accelerations,
    attainable_torque_thrust,
    published_speed_limits,
)
from tiltsim_controllers.analysis.published_gaits import PUBLISHED_GAITS
from tiltsim_controllers.analysis.singularity import rank
from tiltsim_controllers.vehicle.parameters import PRESETS

_VEHICLE: Final = PRESETS["ar_drone_2"]
_LIMITS: Final = published_speed_limits(_VEHICLE)
_RED: Final = (1, 2, 3, 4)
_BLUE: Final = (5, 6, 7, 8)
_EQUAL: Final = 1.05
_APART: Final = 1.2
_BETWEEN: Final = (
    "At 1.0 rad/s, 5 m/s², the flight is between the circle of 0.5 rad/s and the ellipse of 1.5: "
    "radius and error vary by more than a tenth over a lap."
)
_LESS: Final = (
    "With rotors from 305.27 to 394.10 rad/s, F_Z = 4.2 N and no yaw torque, the side forces of a "
    "red gait come from differences between opposite rotors, which have little room left."
)


def _angles(number: int, *, exact: bool = False) -> list[float]:
    published = PUBLISHED_GAITS[f"ch09_gait_{number}"]
    gait = (published.exact or published.gait) if exact else published.gait
    return [float(angle) for angle in gait.angles(np.array([0.0]))[0]]


def _torques(number: int, thrust: float | None = None, *, exact: bool = False) -> AttainableSet:
    angles = _angles(number, exact=exact)
    return attainable_torque_thrust(angles, _VEHICLE, _LIMITS, vertical_thrust=thrust)


def _has_solution(number: int, thrust: float | None = None) -> bool:
    return not _torques(number, thrust).is_empty


def _is_coupled(number: int) -> bool:
    """Whether for one thrust in the middle the torques on the exact lines are on a line."""
    thrusts = _torques(number, exact=True)
    middle = 0.5 * float(thrusts.lower[2] + thrusts.upper[2])
    return _torques(number, middle, exact=True).dimension <= 1


def _has_full_rank(number: int) -> bool:
    return bool(rank(_angles(number, exact=True), _VEHICLE) == 3)


def _acceleration(number: int) -> tuple[float, ...]:
    reached = attainable_accelerations(_angles(number), _VEHICLE, _LIMITS)
    return (*reached.lower.tolist(), *reached.upper.tolist())


def _is_rectangle(number: int) -> bool:
    corners = attainable_accelerations(_angles(number), _VEHICLE, _LIMITS).vertices
    spans = [np.unique(np.round(axis, 9)) for axis in corners.T]
    return len(corners) == 4 and all(len(span) == 2 for span in spans)


def _faster_is_worse(flights: Mapping[str, Metrics]) -> bool:
    errors = [
        np.inf if metrics["diverged"] else tracking_error(metrics) for metrics in flights.values()
    ]
    return all(slower < faster for slower, faster in pairwise(errors))


def _spread(largest: str, smallest: str, flights: Mapping[str, Metrics]) -> float:
    """The ratio of two metrics of the only flight."""
    [metrics] = flights.values()
    return float(metrics[largest]) / float(metrics[smallest])


_orbit_spread = partial(_spread, "max_orbit_radius_after_20s", "min_orbit_radius_after_20s")
_error_spread = partial(_spread, "sup_position_error_after_20s", "least_position_error_after_20s")


def _is_round(flights: Mapping[str, Metrics]) -> bool:
    return _orbit_spread(flights) < _EQUAL


def _is_elliptical(flights: Mapping[str, Metrics]) -> bool:
    return _orbit_spread(flights) > _APART


def _error_is_constant(flights: Mapping[str, Metrics]) -> bool:
    return _error_spread(flights) < _EQUAL


def _error_varies(flights: Mapping[str, Metrics]) -> bool:
    return _error_spread(flights) > _APART


def _circle(name: str) -> str:
    return f"ch09_input_limits/circle#omega_{name}"


THESIS: Final = read_statements("ch09", every_term=EVERY_TERM, equal=_EQUAL, apart=_APART)

CLAIMS = (
    AnalysisClaim(THESIS["ch9-eq-8"], partial(terms_hold, "R", EQ_19, _VEHICLE)),
    AnalysisClaim(
        THESIS["ch9-weight"], lambda: _VEHICLE.mass * _VEHICLE.gravity, published="4.2", unit="N"
    ),
    *(
        AnalysisClaim(
            THESIS["ch9-solution"],
            partial(_has_solution, number),
            case=f"Gait {number}",
            published=number not in (1, 4),
        )
        for number in (*_RED, *_BLUE)
    ),
    *(
        AnalysisClaim(
            THESIS["ch9-carries-weight"],
            partial(_has_solution, number, 4.2),
            case=f"Gait {number}",
            refuted="Under Eq. (11) a rotor produces at most 1.25 N; two tilted by 0.5 rad and two "
            "by 0.834 rad lift 3.87 N."
            if number == 6
            else "",
        )
        for number in (2, 3, *_BLUE)
    ),
    *(
        AnalysisClaim(
            THESIS["ch9-coupled-torques"],
            partial(_is_coupled, number),
            case=f"Gait {number}",
            where=f"ch. 9, Sec. 3.2, Fig. {number if number in _RED else number - 1}",
            published=number in _BLUE,
        )
        for number in (2, 3, *_BLUE)
    ),
    *(
        AnalysisClaim(
            THESIS["ch9-coupling-not-singular"],
            partial(_has_full_rank, number),
            case=f"Gait {number}",
            refuted=RANK,
        )
        for number in _BLUE
    ),
    *(
        AnalysisClaim(
            THESIS["ch9-accelerations"],
            partial(_acceleration, number),
            case=f"Gait {number}",
            where=f"ch. 9, Sec. 3.3, Fig. {figure}",
            published=("-2", "-2", "2", "2"),
            unit="m/s^2",
            refuted=_LESS + " To lift 4.2 N, tilted by 0.5 rad, the four produce 4.79 N of the 5 N "
            "that Eq. (11) allows: opposite ones differ by at most 0.21 N, which is 0.24 m/s² "
            "sideways, and half of it without yaw torque.",
        )
        for number, figure in ((2, 8), (3, 9))
    ),
    *(
        AnalysisClaim(
            THESIS["ch9-rectangle"], partial(_is_rectangle, number), case=f"Gait {number}"
        )
        for number in (2, 3)
    ),
    AnalysisClaim(
        THESIS["ch9-similar-accelerations"],
        lambda: bool(np.allclose(_acceleration(2), _acceleration(3), rtol=1e-6)),
    ),
    AnalysisClaim(
        THESIS["ch9-centripetal"],
        lambda: tuple(5.0 * omega**2 for omega in (0.1, 0.5, 1.0, 1.5)),
        published=("0.05", "1.25", "5", "11.25"),
        unit="m/s^2",
    ),
    FlightClaim(
        THESIS["ch9-periodic"],
        tuple(map(_circle, ("01", "05", "10", "15"))),
        every_flight_completed,
    ),
    FlightClaim(
        THESIS["ch9-faster-is-worse"],
        tuple(map(_circle, ("01", "05", "10", "15", "20"))),
        _faster_is_worse,
    ),
    *(
        FlightClaim(statement, (_circle(name),), measure, case=case, why=why)
        for statement, measure in (
            (THESIS["ch9-orbit-round"], _is_round),
            (THESIS["ch9-error-constant"], _error_is_constant),
        )
        for name, case, why in (("05", "0.5 rad/s", ""), ("10", "1.0 rad/s", _BETWEEN))
    ),
    FlightClaim(THESIS["ch9-orbit-ellipse"], (_circle("15"),), _is_elliptical),
    FlightClaim(THESIS["ch9-error-varies"], (_circle("15"),), _error_varies),
)
