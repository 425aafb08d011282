"""Chapter 10: the tilt-car, state drift and a planned direction of the thrusts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from controllers.tilt_car.third_derivative import input_columns
from controllers.tilt_car.vehicle import THESIS_CAR
from tiltsim.report.model import AnalysisClaim, FlightClaim, Metrics

_SHORT: Final = "ch10_state_drift/third_derivative#ten_seconds"
_LONG: Final = "ch10_state_drift/third_derivative#two_thousand_seconds"
_FOURTH: Final = "ch10_state_drift/fourth_derivative#failure"
_PLANNED: Final = "ch10_state_drift/planned_direction"
_SMALL: Final = 1e-3
"""An error (m) below this is none, on a circle of 10 m."""


def _errors_vanish(flights: Mapping[str, Metrics]) -> bool:
    return all(
        abs(float(metrics[f"final_position_error_{axis}"])) < _SMALL
        for metrics in flights.values()
        for axis in "xy"
    )


def _error_stays_small(flights: Mapping[str, Metrics]) -> bool:
    return all(
        float(metrics["sup_position_error_after_20s"]) < _SMALL for metrics in flights.values()
    )


def _inputs_part(flights: Mapping[str, Metrics]) -> bool:
    """Whether the split is larger at the end of the long flight than of the short one."""
    short, long = (abs(float(flights[address]["final_input_split"])) for address in (_SHORT, _LONG))
    return long > 10.0 * short


def _inputs_meet(flights: Mapping[str, Metrics]) -> bool:
    return abs(float(flights[_PLANNED]["final_input_split"])) < 1.0


def _saturates(flights: Mapping[str, Metrics]) -> bool:
    return float(flights[_PLANNED]["saturated_fraction"]) > 0.0


def _drift_costs_stability(flights: Mapping[str, Metrics]) -> bool:
    metrics = flights[_FOURTH]
    lost = float(metrics["min_rotor_speed"]) <= 0.0
    return lost and float(metrics["sup_position_error_after_20s"]) > 1.0


def _row_rank_is_full_where_rotors_turn() -> bool:
    """Ch. 10, Sec. 3.1: [Delta_1 | Delta_2] has full row rank for any two speeds above zero."""
    speeds = np.geomspace(0.1, 1000.0, 41)
    for first in speeds:
        for second in speeds:
            columns = np.array(input_columns(float(first), float(second), THESIS_CAR))
            if np.linalg.matrix_rank(columns.reshape(3, 2)) < 2:
                return False
    return True


CLAIMS = (
    AnalysisClaim(
        source="ch. 10, Sec. 3.1, Eqs. (10)-(12)",
        statement="With both rotors turning the decoupling matrix has full row rank",
        published=True,
        measure=_row_rank_is_full_where_rotors_turn,
    ),
    FlightClaim(
        source="ch. 10, Sec. 4.1, Fig. 8",
        statement="Under the third-derivative law the error vanishes within ten seconds",
        published=True,
        flights=(_SHORT,),
        measure=_errors_vanish,
    ),
    FlightClaim(
        source="ch. 10, Sec. 4.1, Fig. 13",
        statement="Over 2000 seconds the error stays near zero",
        published=True,
        flights=(_LONG,),
        measure=_error_stays_small,
    ),
    FlightClaim(
        source="ch. 10, Sec. 4.2, Figs. 9, 14",
        statement="State drift: the inputs part for good though the error is gone",
        published=True,
        flights=(_SHORT, _LONG),
        measure=_inputs_part,
    ),
    FlightClaim(
        source="ch. 10, Sec. 5, Figs. 20-21",
        statement="With the direction of the thrusts planned the vehicle follows the circle",
        published=True,
        flights=(_PLANNED,),
        measure=_errors_vanish,
    ),
    FlightClaim(
        source="ch. 10, Sec. 5, Fig. 22",
        statement="With the direction planned there is no drift: the inputs become identical",
        published=True,
        flights=(_PLANNED,),
        measure=_inputs_meet,
    ),
    FlightClaim(
        source="ch. 10, Sec. 5, Figs. 22-23",
        statement="With the direction planned the inputs saturate on the way",
        published=True,
        flights=(_PLANNED,),
        measure=_saturates,
    ),
    FlightClaim(
        source="ch. 10, Sec. 6.1, Figs. 24-25",
        statement="Under the fourth-derivative law drift stops a rotor and costs the tracking",
        published=True,
        flights=(_FOURTH,),
        measure=_drift_costs_stability,
    ),
)
