"""Chapter 11: the tilt-car with a penguin's swing, without and with saturation."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from math import pi
from typing import Final

from controllers.tilt_car.penguin_cycle import LyapunovBound, Swing, lyapunov_bound
from controllers.tilt_car.planned_direction import GAIN_SETS
from tiltsim.report.model import AnalysisClaim, FlightClaim, Metrics

_SMALL: Final = "ch11_penguin/straight_line#small"
_LARGE: Final = "ch11_penguin/straight_line#large"
_SERVO: Final = "In MuJoCo the servo needs some 20 ms for each swing; the thesis' thrusts jump."
_NEAR_ZERO: Final = 0.1  # m, "less than 10^-1 all the time"


def _swing() -> Swing:
    return Swing(half_angle=pi / 6, half_period=1.0, gains=GAIN_SETS["ch11"])


@cache
def _bound() -> LyapunovBound:
    return lyapunov_bound(_swing(), points=41)


def _error_is_small(flights: Mapping[str, Metrics]) -> bool:
    metrics = flights[_SMALL]
    return all(float(metrics[f"max_abs_error_{axis}"]) < _NEAR_ZERO for axis in "xy")


def _no_saturation(flights: Mapping[str, Metrics]) -> bool:
    return float(flights[_SMALL]["saturated_fraction"]) == 0.0


def _saturates_in_part(flights: Mapping[str, Metrics]) -> bool:
    return 0.0 < float(flights[_LARGE]["saturated_fraction"]) < 1.0


def _error_x_is_zero(flights: Mapping[str, Metrics]) -> bool:
    return float(flights[_LARGE]["max_abs_error_x"]) < 1e-6


def _error_y_remains(flights: Mapping[str, Metrics]) -> bool:
    metrics = flights[_LARGE]
    return not metrics["diverged"] and float(metrics["max_abs_error_y"]) > _NEAR_ZERO


def _candidate_is_bounded(flights: Mapping[str, Metrics]) -> bool:
    return float(flights[_LARGE]["max_lyapunov"]) <= _bound().published


CLAIMS = (
    FlightClaim(
        source="ch. 11, Sec. 4.4",
        statement="With the small swing the error stays below 0.1 m",
        published=True,
        flights=(_SMALL,),
        measure=_error_is_small,
    ),
    FlightClaim(
        source="ch. 11, Sec. 4.4, Fig. 10",
        statement="With the small swing no input saturates",
        published=True,
        flights=(_SMALL,),
        measure=_no_saturation,
    ),
    FlightClaim(
        source="ch. 11, Sec. 7, Fig. 25",
        statement="With the large swing the inputs saturate part of the time",
        published=True,
        flights=(_LARGE,),
        measure=_saturates_in_part,
    ),
    FlightClaim(
        source="ch. 11, Sec. 7, Fig. 24",
        statement="With the large swing the error along x remains zero",
        published=True,
        flights=(_LARGE,),
        why=_SERVO,
        measure=_error_x_is_zero,
    ),
    FlightClaim(
        source="ch. 11, Sec. 7, Fig. 24",
        statement="With the large swing the error along y is bounded and does not vanish",
        published=True,
        flights=(_LARGE,),
        measure=_error_y_remains,
    ),
    AnalysisClaim(
        source="ch. 11, Sec. 6, Eq. (71)",
        statement="The candidate grows by at most 3/4 over a half period",
        published=True,
        measure=lambda: _bound().largest_gain <= 0.75,
    ),
    FlightClaim(
        source="ch. 11, Sec. 8, Prop. 7",
        statement="The Lyapunov candidate stays below its critical value plus 3/4",
        published=True,
        flights=(_LARGE,),
        measure=_candidate_is_bounded,
    ),
)
