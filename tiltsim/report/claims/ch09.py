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
from tiltsim.report.measures import every_flight_completed, terms_hold, tracking_error
from tiltsim.report.statement import Statement
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
_LIMITS_NOTE: Final = (
    "The chapter gives the limits as total thrusts of 3 N and 5 N at zero tilt; rotor speeds "
    "follow from them."
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


EQ_8 = Statement(
    id="ch9-eq-8",
    source="ch. 9, Sec. 2, Eq. (8)",
    text="Eq. (8), term by term, is R on red",
    thesis="Eq. (8) prints R(α₁, α₂) with 15 terms.",
    criterion="Every product of sines and cosines has the printed coefficient, to 0.001, and none "
    "is missing",
)
WEIGHT = Statement(
    id="ch9-weight",
    source="ch. 9, Sec. 3.1",
    text="The weight of the vehicle",
    thesis="“… the total vertical thrust slightly lower (3 N) than the gravity (around 4.2 N).”",
    criterion="Mass times gravity of ch. 3's vehicle rounds to it",
)
SOLUTION = Statement(
    id="ch9-solution",
    source="ch. 9, Sec. 3.2",
    text="Without yaw torque there is a solution within the rotor limits",
    thesis="“With the constraints in Equation (11) and (20), Gait 1 and Gait 4 fail to receive a "
    "solution. … Gait 5 – 8 … receive valid solutions.”",
    criterion="The exact set of torques and thrusts under Eqs. (11) and (20) is not empty",
    note=_LIMITS_NOTE,
    pictures=("attainable",),
)
CARRIES = Statement(
    id="ch9-carries-weight",
    source="ch. 9, Sec. 3.3, Eq. (21)",
    text="The gait can carry 4.2 N, the weight",
    thesis="“F_Z = 4.2 N. The relevant torque can be found in one layer of the corresponding "
    "torque and thrust plots, e.g., Figure 2 – 7.”",
    criterion="The exact set under Eqs. (11) and (20) has a point with F_Z = 4.2 N",
    note=_LIMITS_NOTE,
    finding="limits",
)
COUPLED = Statement(
    id="ch9-coupled-torques",
    source="ch. 9, Sec. 3.2, Figs. 2-7",
    text="For a given thrust the torques about x and y are linearly coupled",
    thesis="“Notice that the relationship between torques for a given thrust is linearly coupled "
    "for these gaits rather than a plane” (Gaits 5 to 8, unlike 2 and 3).",
    criterion="At the middle of its thrusts the exact set of torques is a line or a point, not an "
    "area; blue gaits on the exact lines",
    finding="blue",
    pictures=("attainable",),
)
REGULAR = Statement(
    id="ch9-coupling-not-singular",
    source="ch. 9, Sec. 5",
    text="The coupling is not a singularity: τ has full rank",
    thesis="“One may believe that there can be singularities in the decoupling matrix. … In fact, "
    "the decoupling matrix on Two Color Map has been proved invertible.”",
    criterion="τ has rank 3 with the angles on the exact lines",
    finding="blue",
)
ACCELERATIONS = Statement(
    id="ch9-accelerations",
    source="ch. 9, Sec. 3.3, Figs. 8-9",
    text="Attainable accelerations in body axes: minimum along x and y, maximum along x and y",
    thesis="“… both gaits (Gait 2 and 3) receive the similar admissible accelerations ranging from "
    "-2 m/s² to 2 m/s² along either axis.”",
    criterion="The extremes of the exact set under Eqs. (11), (20) and (21) round to 2",
    note=_LIMITS_NOTE,
    finding="limits",
    pictures=("attainable",),
)
RECTANGLE = Statement(
    id="ch9-rectangle",
    source="ch. 9, Sec. 5",
    text="The region of accelerations is a rectangle",
    thesis="“The result demonstrates a rectangular region of these accelerations.”",
    criterion="The exact set has four corners, which have two values along each axis",
    note=_LIMITS_NOTE,
)
SIMILAR = Statement(
    id="ch9-similar-accelerations",
    source="ch. 9, Sec. 3.3",
    text="Gaits 2 and 3 reach similar accelerations",
    thesis="“It can be found that both gaits (Gait 2 and 3) receive the similar admissible "
    "accelerations.”",
    criterion="The extremes along both axes are equal to six digits",
)
CENTRIPETAL = Statement(
    id="ch9-centripetal",
    source="ch. 9, Sec. 4.1",
    text="Centripetal accelerations of the four circles",
    thesis="“The magnitudes of the corresponding accelerations of the references are "
    "0.05, 1.25, 5, 11.25 m/s².”",
    criterion="Radius times angular frequency squared rounds to each",
)
PERIODIC = Statement(
    id="ch9-periodic",
    source="ch. 9, Sec. 4.2, Fig. 10",
    text="All four references end in periodic trajectories: no flight is lost",
    thesis="“In general, all these four references result in periodical tracking trajectories.”",
    criterion="All four flights complete",
)
FASTER_WORSE = Statement(
    id="ch9-faster-is-worse",
    source="ch. 9, Sec. 5",
    text="The faster the circle, the larger the error; the fastest is lost",
    thesis="“A reference with smaller accelerations results a better tracking result, e.g., less "
    "state error. The tilt-rotor fails to track an aggressive reference.”",
    criterion="The largest error after 20 s grows from each speed to the next; at 2.0 rad/s the "
    "flight is lost",
)
ROUND = Statement(
    id="ch9-orbit-round",
    source="ch. 9, Sec. 4.2, Fig. 10",
    text="The orbit is a circle",
    thesis="“With the references with the accelerations close to 2 m/s², e.g., yellow and green "
    "curves, the tilt-rotor tracks the references in a larger circular orbit.”",
    criterion=f"After 20 s its largest radius is less than {_EQUAL} of its smallest",
)
CONSTANT = Statement(
    id="ch9-error-constant",
    source="ch. 9, Sec. 4.2, Fig. 10",
    text="Near 2 m/s² the error is constant",
    thesis="“… in a larger circular orbit with constant state error” (0.5 and 1.0 rad/s).",
    criterion=f"After 20 s the largest error is less than {_EQUAL} of the smallest",
)
ELLIPSE = Statement(
    id="ch9-orbit-ellipse",
    source="ch. 9, Sec. 4.2, Fig. 10",
    text="Far above 2 m/s² the orbit is an ellipse",
    thesis="“… the tilt-rotor tracks the references in an elliptical orbit with varying state "
    "error (periodic)” (1.5 rad/s).",
    criterion=f"After 20 s its largest radius is more than {_APART} of its smallest",
    pictures=("ellipse",),
)
VARYING = Statement(
    id="ch9-error-varies",
    source="ch. 9, Sec. 4.2, Fig. 10",
    text="Far above 2 m/s² the error varies",
    thesis="“… in an elliptical orbit with varying state error (periodic)” (1.5 rad/s).",
    criterion=f"After 20 s the largest error is more than {_APART} of the smallest",
    pictures=("ellipse",),
)

CLAIMS = (
    AnalysisClaim(EQ_8, partial(terms_hold, "R", EQ_19, _VEHICLE)),
    AnalysisClaim(WEIGHT, lambda: _VEHICLE.mass * _VEHICLE.gravity, published="4.2", unit="N"),
    *(
        AnalysisClaim(
            SOLUTION,
            partial(_has_solution, number),
            case=f"Gait {number}",
            published=number not in (1, 4),
        )
        for number in (*_RED, *_BLUE)
    ),
    *(
        AnalysisClaim(
            CARRIES,
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
            COUPLED,
            partial(_is_coupled, number),
            case=f"Gait {number}",
            where=f"ch. 9, Sec. 3.2, Fig. {number if number in _RED else number - 1}",
            published=number in _BLUE,
        )
        for number in (2, 3, *_BLUE)
    ),
    *(
        AnalysisClaim(REGULAR, partial(_has_full_rank, number), case=f"Gait {number}", refuted=RANK)
        for number in _BLUE
    ),
    *(
        AnalysisClaim(
            ACCELERATIONS,
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
        AnalysisClaim(RECTANGLE, partial(_is_rectangle, number), case=f"Gait {number}")
        for number in (2, 3)
    ),
    AnalysisClaim(
        SIMILAR, lambda: bool(np.allclose(_acceleration(2), _acceleration(3), rtol=1e-6))
    ),
    AnalysisClaim(
        CENTRIPETAL,
        lambda: tuple(5.0 * omega**2 for omega in (0.1, 0.5, 1.0, 1.5)),
        published=("0.05", "1.25", "5", "11.25"),
        unit="m/s^2",
    ),
    FlightClaim(PERIODIC, tuple(map(_circle, ("01", "05", "10", "15"))), every_flight_completed),
    FlightClaim(
        FASTER_WORSE, tuple(map(_circle, ("01", "05", "10", "15", "20"))), _faster_is_worse
    ),
    *(
        FlightClaim(statement, (_circle(name),), measure, case=case, why=why)
        for statement, measure in ((ROUND, _is_round), (CONSTANT, _error_is_constant))
        for name, case, why in (("05", "0.5 rad/s", ""), ("10", "1.0 rad/s", _BETWEEN))
    ),
    FlightClaim(ELLIPSE, (_circle("15"),), _is_elliptical),
    FlightClaim(VARYING, (_circle("15"),), _error_varies),
)
