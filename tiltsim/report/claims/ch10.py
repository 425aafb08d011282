"""Chapter 10: the tilt-car, and the state drift of its over-actuated control."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from math import asin, cos, inf, sin
from typing import Final

import numpy as np

from tiltsim.report.claim import AnalysisClaim, FlightClaim, Metrics
from tiltsim.report.statement import Origin, read_statements
from tiltsim_controllers.tilt_car.third_derivative import input_columns
from tiltsim_controllers.tilt_car.vehicle import (
    THESIS_CAR,
    acceleration,
    body_acceleration,
    counter_yaw_per_tilt,
    turn_per_tilt,
)

_EARLY: Final = "ch10_state_drift/third_derivative#ten_seconds"
_LATE: Final = "ch10_state_drift/third_derivative#two_thousand_seconds"
_PLANNED: Final = "ch10_state_drift/planned_direction"
_FAILURE: Final = "ch10_state_drift/fourth_derivative#failure"
_RADIUS, _OMEGA = 10.0, 1.0  # m, rad/s
_SMALL_ERROR: Final = 0.2  # m
_ALIGNED: Final = 0.05  # rad, a tenth of the thrusts' half angle


def _thrusts_can_be_inverted() -> bool:
    """Whether J_theta, times any rotation, is regular (Eqs. 4-6)."""
    theta, thrust = THESIS_CAR.half_angle, THESIS_CAR.thrust_coefficient
    matrix = np.diag([cos(theta), sin(theta)]) @ (thrust * np.array([[1.0, 1.0], [1.0, -1.0]]))
    return bool(abs(np.linalg.det(matrix)) > 1e-9)


def _rank(speed_1: float, speed_2: float, *, tilting: bool) -> int:
    columns = np.array(input_columns(speed_1, speed_2, THESIS_CAR)).reshape(3, 2).T
    return int(np.linalg.matrix_rank(columns if tilting else columns[:, :2]))


def _full_rank_needs_both(*, tilting: bool) -> bool:
    """Whether the rank is full where both rotors turn, and only there."""
    both = _rank(200.0, 150.0, tilting=tilting) == 2
    one = _rank(200.0, 0.0, tilting=tilting) == 2 or _rank(0.0, 200.0, tilting=tilting) == 2
    return both and not one


def _full_rank_unless_both_rest() -> bool:
    """Eq. (28): rank 2 of the two columns of the rotors when they are not both at rest."""
    return _rank(200.0, 0.0, tilting=False) == 2 and _rank(0.0, 200.0, tilting=False) == 2


def _thrust_points_to_the_center() -> bool:
    """Eq. (18), alpha = t / (1 - I_T / I_B): the thrusts turn with the circle, 1 rad/s."""
    tilt_rate = 1.0 / turn_per_tilt(THESIS_CAR)
    yaw_rate = -counter_yaw_per_tilt(THESIS_CAR) * tilt_rate
    return abs(tilt_rate + yaw_rate - _OMEGA) < 1e-12


def _printed_tilt_column_is_right() -> bool:
    """Whether Eq. (27) is the change of the acceleration with the tilt, yaw answering by Eq. (2).

    The column of the tilt's second derivative in the fourth derivative of the position is that of
    the tilt in the acceleration: no other term contains it.
    """
    tilt, step, squares = 0.7, 1e-6, (150.0**2, 120.0**2)

    def at(alpha: float) -> tuple[float, float]:
        return acceleration(turn_per_tilt(THESIS_CAR) * alpha, *squares, THESIS_CAR)

    ahead, behind, (x, y) = at(tilt + step), at(tilt - step), at(tilt)
    exact = np.subtract(ahead, behind) / (2.0 * step)
    return bool(np.abs(exact - (-y, x)).max() < 1e-6 * np.hypot(x, y))


def _lean(address: str, flights: Mapping[str, Metrics]) -> float:
    """Angle (rad) from the middle of the thrusts to the center, in steady motion."""
    split = float(flights[address]["final_input_split"])
    _, across = body_acceleration(split, 0.0, THESIS_CAR)
    return asin(across / (_RADIUS * _OMEGA**2))


def _inputs_diverge(flights: Mapping[str, Metrics]) -> bool:
    """Whether the inputs are ten times as far apart after 2000 s as after 10 s."""
    early, late = (abs(float(flights[name]["final_input_split"])) for name in (_EARLY, _LATE))
    return late > 10.0 * early


def _fails_after_a_rotor_stops(flights: Mapping[str, Metrics]) -> bool:
    metrics = flights[_FAILURE]
    error = float(metrics.get("sup_position_error_after_20s", inf))
    return metrics["min_rotor_speed"] == 0.0 and error > _SMALL_ERROR


THESIS: Final = read_statements("ch10", aligned=_ALIGNED, small_error=_SMALL_ERROR)

CLAIMS = (
    AnalysisClaim(
        THESIS["ch10-counter-yaw"],
        lambda: -counter_yaw_per_tilt(THESIS_CAR),
        case="I_B read as the inertia of the whole car",
        published="-0.5",
        fitted=True,
        note="The inertia of the bottom disc was chosen so that it holds.",
        origins=(Origin.PARAMETERS,),
    ),
    AnalysisClaim(
        THESIS["ch10-counter-yaw"],
        lambda: -counter_yaw_per_tilt(THESIS_CAR._replace(bottom_inertia=0.002)),
        case="I_B read as the bottom disc's own inertia, as the text says",
        published="-0.5",
        refuted="α is the top disc's angle on the bottom one, so that I_T (ψ' + α') + I_bottom ψ' "
        "= 0: -1/3. Eq. (2) holds where I_B is the inertia of the whole car.",
    ),
    AnalysisClaim(THESIS["ch10-invertible"], _thrusts_can_be_inverted),
    AnalysisClaim(
        THESIS["ch10-rank-both-turn"],
        partial(_full_rank_needs_both, tilting=False),
        case="columns of the rotors, Δ1",
    ),
    AnalysisClaim(
        THESIS["ch10-rank-both-turn"],
        partial(_full_rank_needs_both, tilting=True),
        case="with the column of the tilt, [Δ1 | Δ2]",
        refuted="With one rotor at rest the tilt turns the other one's thrust: still rank 2.",
    ),
    FlightClaim(
        THESIS["ch10-direction-10-s"],
        (_EARLY,),
        lambda flights: abs(_lean(_EARLY, flights)) < _ALIGNED,
    ),
    FlightClaim(THESIS["ch10-drift"], (_EARLY, _LATE), _inputs_diverge),
    FlightClaim(
        THESIS["ch10-direction-2000-s"],
        (_LATE,),
        lambda flights: abs(_lean(_LATE, flights)) > 0.5 * THESIS_CAR.half_angle,
    ),
    AnalysisClaim(THESIS["ch10-eq-18"], _thrust_points_to_the_center),
    FlightClaim(
        THESIS["ch10-planned-saturates"],
        (_PLANNED,),
        lambda flights: 0.0 < float(flights[_PLANNED]["saturated_fraction"]) < 1.0,
    ),
    AnalysisClaim(
        THESIS["ch10-eq-27"],
        _printed_tilt_column_is_right,
        refuted="The bottom disc turns back while the top disc tilts: the thrusts turn by "
        "1 - I_T/I_B of the tilt, and so does the column.",
    ),
    AnalysisClaim(
        THESIS["ch10-eq-28"],
        _full_rank_unless_both_rest,
        refuted="One rotor at rest leaves one column: rank 1. Both must turn.",
    ),
    FlightClaim(THESIS["ch10-fourth-fails"], (_FAILURE,), _fails_after_a_rotor_stops),
)
