"""Chapter 10: the tilt-car, and the state drift of its over-actuated control."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from math import cos, inf, sin
from typing import Final

import numpy as np

from tiltsim.report.claim import AnalysisClaim, FlightClaim, Metrics
from tiltsim.report.draft import draft
from tiltsim_controllers.tilt_car.state_drift import drift_rate, orbit
from tiltsim_controllers.tilt_car.third_derivative import input_columns
from tiltsim_controllers.tilt_car.vehicle import THESIS_CAR, counter_yaw_per_tilt, turn_per_tilt

_THIRD: Final = "ch10_state_drift/third_derivative#"
_PLANNED: Final = "ch10_state_drift/planned_direction"
_FAILURE: Final = "ch10_state_drift/fourth_derivative#failure"
_RADIUS, _OMEGA = 10.0, 1.0  # m, rad/s


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


def _drift_has_a_cause() -> bool:
    """Whether the minimum-norm control law moves the lean in steady tracking."""
    return drift_rate(0.0, orbit(_RADIUS, _OMEGA), THESIS_CAR) > 0.0


def _small(address: str, metric: str, bound: float, flights: Mapping[str, Metrics]) -> bool:
    return abs(float(flights[address].get(metric, inf))) < bound


def _both_small(flights: Mapping[str, Metrics]) -> bool:
    address = _THIRD + "ten_seconds"
    return all(_small(address, f"final_position_error_{axis}", 0.01, flights) for axis in "xy")


def _inputs_diverge(flights: Mapping[str, Metrics]) -> bool:
    """Whether the inputs are ten times as far apart after 2000 s as after 10 s."""
    early, late = (
        abs(float(flights[_THIRD + name]["final_input_split"]))
        for name in ("ten_seconds", "two_thousand_seconds")
    )
    return late > 10.0 * early


def _fails_after_a_rotor_stops(flights: Mapping[str, Metrics]) -> bool:
    metrics = flights[_FAILURE]
    error = float(metrics.get("sup_position_error_after_20s", inf))
    return metrics["min_rotor_speed"] == 0.0 and error > 0.2


CLAIMS = (
    AnalysisClaim(
        draft(
            "ch. 10, Sec. 2, Eq. (2)",
            "Bottom disc over top disc: ψ over α, with I_T = 0.001 and I_B = 0.002",
        ),
        lambda: -counter_yaw_per_tilt(THESIS_CAR),
        published="-0.5",
    ),
    AnalysisClaim(
        draft(
            "ch. 10, Sec. 2, Eq. (2)",
            "Bottom disc over top disc: ψ over α, with I_T = 0.001 and I_B = 0.002",
        ),
        lambda: -counter_yaw_per_tilt(THESIS_CAR._replace(bottom_inertia=0.002)),
        case="I_B read as the bottom disc's own inertia, as the text says",
        published="-0.5",
        refuted="α is the top disc's angle on the bottom one, so that I_T (ψ' + α') + I_bottom ψ' "
        "= 0: -1/3. Eq. (2) holds where I_B is the inertia of the whole car.",
    ),
    AnalysisClaim(
        draft(
            "ch. 10, Sec. 2, Eq. (6)",
            "The matrix from squared speeds to acceleration can be inverted",
        ),
        _thrusts_can_be_inverted,
    ),
    AnalysisClaim(
        draft("ch. 10, Sec. 3.1, Eqs. (10)-(12)", "Rank 2 if and only if both rotors turn"),
        partial(_full_rank_needs_both, tilting=False),
        case="columns of the rotors, Δ1",
    ),
    AnalysisClaim(
        draft("ch. 10, Sec. 3.1, Eqs. (10)-(12)", "Rank 2 if and only if both rotors turn"),
        partial(_full_rank_needs_both, tilting=True),
        case="with the column of the tilt, [Δ1 | Δ2]",
        refuted="With one rotor at rest the tilt turns the other one's thrust: still rank 2.",
    ),
    AnalysisClaim(
        draft(
            "ch. 10, Sec. 6.1, Eq. (28)",
            "The columns of the rotors have rank 2 unless both rotors are at rest",
        ),
        _full_rank_unless_both_rest,
        refuted="One rotor at rest leaves one column: rank 1. Both must turn.",
    ),
    FlightClaim(
        draft(
            "ch. 10, Sec. 4.1, Figs. 7-8",
            "The third-derivative controller makes the error vanish in ten seconds (0.01 m)",
        ),
        (_THIRD + "ten_seconds",),
        _both_small,
    ),
    FlightClaim(
        draft(
            "ch. 10, Sec. 4.1, Figs. 12-13",
            "The error stays at zero for 2000 s (0.01 m after 20 s)",
        ),
        (_THIRD + "two_thousand_seconds",),
        partial(_small, _THIRD + "two_thousand_seconds", "sup_position_error_after_20s", 0.01),
    ),
    FlightClaim(
        draft(
            "ch. 10, Sec. 4.1, Figs. 9, 14",
            "State drift: the inputs diverge after the error has vanished",
        ),
        (_THIRD + "ten_seconds", _THIRD + "two_thousand_seconds"),
        _inputs_diverge,
    ),
    AnalysisClaim(
        draft(
            "ch. 10, Sec. 6.2", "The cause of the drift from one equilibrium to another is known"
        ),
        _drift_has_a_cause,
        published=False,
        refuted="It is: the minimum-norm distribution is not integrable, and the lean advances by "
        "a holonomy, β' = Ω / (1 + κ² W(β)) on a circle.",
    ),
    FlightClaim(
        draft(
            "ch. 10, Sec. 5, Figs. 20-21",
            "With the tilt planned the error also vanishes (0.01 m at 10 s)",
        ),
        (_PLANNED,),
        partial(_small, _PLANNED, "final_position_error_x", 0.01),
    ),
    FlightClaim(
        draft(
            "ch. 10, Sec. 5, Fig. 22",
            "With the tilt planned the inputs become identical: no state drift",
        ),
        (_PLANNED,),
        partial(_small, _PLANNED, "final_input_split", 1.0),
    ),
    FlightClaim(
        draft("ch. 10, Sec. 5, Fig. 23", "With the tilt planned the inputs saturate for a while"),
        (_PLANNED,),
        lambda flights: float(flights[_PLANNED]["saturated_fraction"]) > 0.0,
    ),
    AnalysisClaim(
        draft(
            "ch. 10, Sec. 5, Eq. (18)",
            "α = t / (1 - I_T / I_B) keeps the thrusts pointed at the center",
        ),
        _thrust_points_to_the_center,
    ),
    FlightClaim(
        draft(
            "ch. 10, Sec. 6.1, Figs. 24-25",
            "With the fourth-derivative controller the inputs drift until a rotor stops, "
            "and then it fails",
        ),
        (_FAILURE,),
        _fails_after_a_rotor_stops,
    ),
)
