"""Chapter 11: the penguin swing, its saturation, and the bound on the Lyapunov candidate."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import exp, pi
from typing import Final

import numpy as np

from tiltsim.report.claim import AnalysisClaim, FlightClaim
from tiltsim.report.draft import draft
from tiltsim_controllers.mathematics.scalar import Pair
from tiltsim_controllers.tilt_car.penguin_cycle import (
    LyapunovBound,
    Swing,
    half_period,
    limit_cycle,
    lyapunov,
    lyapunov_bound,
    lyapunov_growth,
    multipliers,
)
from tiltsim_controllers.tilt_car.planned_direction import GAIN_SETS

_GAINS: Final = GAIN_SETS["ch11"]
_SWING: Final = Swing(half_angle=pi / 6, half_period=1.0, gains=_GAINS)
_SMALL: Final = "ch11_penguin/straight_line#small"
_LARGE: Final = "ch11_penguin/straight_line#large"
_SERVO: Final = (
    "In MuJoCo the tilt servo needs some 20 ms for a swing of 4.2 rad, in which the thrusts point "
    "in other directions: e_x reaches 13 mm. In the thesis's equations the thrusts jump, and e_x "
    "stays 0."
)


def _can_push_straight_ahead(swing: float) -> bool:
    """Whether the reference's direction lies between the thrusts, pi/6 from their middle."""
    return abs(swing) <= _SWING.half_angle


@cache
def _zone() -> tuple[Pair, ...]:
    """States of Eq. (39): beyond the switching line, both components positive."""
    grid = np.linspace(0.0, 3.0, 31).tolist()
    return tuple((e, rate) for e in grid for rate in grid if _SWING.both_push((e, rate)))


def _for_all(holds: Callable[[Pair], bool]) -> bool:
    return all(holds(state) for state in _zone())


def _comes_back_mirrored(state: Pair) -> bool:
    """Lemma 7: half a period leads into the zone of Eq. (45)."""
    error, rate = half_period(_SWING, state).end
    return error <= 0.0 and rate <= 0.0 and _SWING.both_push((-error, -rate))


def _switches_within(state: Pair) -> bool:
    """Lemma 5: 0 < t_1 < 1 s."""
    return 0.0 < half_period(_SWING, state).free_time < 1.0


def _largest_at_the_ends(state: Pair) -> bool:
    """Proposition 6, along the motion in steps of 10 ms."""
    half = half_period(_SWING, state)
    between = _SWING.after_both_push(half.free_time, state)
    times = np.linspace(0.0, _SWING.half_period, 101)
    path = [
        _SWING.after_both_push(t, state)
        if t <= half.free_time
        else _SWING.after_one_push(t - half.free_time, between)
        for t in times.tolist()
    ]
    ends = max(lyapunov(_SWING, state), lyapunov(_SWING, half.end))
    return max(lyapunov(_SWING, at) for at in path) <= ends + 1e-12


def _eq_42_holds(state: Pair) -> bool:
    """The printed solution with both rotors pushing, after 0.3 s."""
    error, rate = state
    slow, fast = exp(-0.9), exp(-1.8)
    printed = (
        (2.0 * error + rate / 3.0) * slow + (-error - rate / 3.0) * fast,
        (-6.0 * error - rate) * slow + (6.0 * error + 2.0 * rate) * fast,
    )
    solved = _SWING.after_both_push(0.3, state)
    return all(abs(a - b) < 1e-9 for a, b in zip(printed, solved, strict=True))


def _first_half_period() -> bool:
    """Remark 8: from rest a single rotor pushes for half a period, mirrored, into the zone."""
    error, rate = _SWING.after_one_push(_SWING.half_period, (0.0, 0.0))
    return _SWING.both_push((-error, -rate))


def _switch_line() -> float:
    """K_Y1 e_y' + K_Y2 e_y at which a rotor stops (Prop. 4)."""
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (
            (low, middle) if _SWING.both_push((middle / _GAINS.y_position, 0.0)) else (middle, high)
        )
    return high


def _is_asymptotically_stable() -> bool:
    """Whether errors vanish: whether the limit cycle is the origin."""
    return max(map(abs, limit_cycle(_SWING))) < 1e-9


@cache
def _bound() -> LyapunovBound:
    return lyapunov_bound(_SWING, points=33)


CLAIMS = (
    AnalysisClaim(
        draft("ch. 11, Sec. 3, Figs. 5-8", "The thrusts can keep the acceleration along y at zero"),
        lambda: _can_push_straight_ahead(pi / 8),
        case="small swing, π/8",
    ),
    AnalysisClaim(
        draft("ch. 11, Sec. 3, Figs. 5-8", "The thrusts can keep the acceleration along y at zero"),
        lambda: _can_push_straight_ahead(pi / 3),
        case="large swing, π/3",
        published=False,
    ),
    FlightClaim(
        draft("ch. 11, Sec. 4.4", "With the small swing the errors stay below 0.1 m"),
        (_SMALL,),
        lambda flights: all(float(flights[_SMALL][f"max_abs_error_{axis}"]) < 0.1 for axis in "xy"),
    ),
    FlightClaim(
        draft(
            "ch. 11, Sec. 4.4, Fig. 10",
            "With the small swing no input saturates (fraction of samples)",
        ),
        (_SMALL,),
        lambda flights: float(flights[_SMALL]["saturated_fraction"]),
        published="0.00",
    ),
    FlightClaim(
        draft(
            "ch. 11, Sec. 6, Prop. 3; Sec. 7, Fig. 24",
            "With the large swing the error along x is zero all the time",
        ),
        (_LARGE,),
        lambda flights: float(flights[_LARGE]["max_abs_error_x"]),
        published="0.000",
        unit="m",
        in_kind=(0.0, 0.02),
        why=_SERVO,
    ),
    AnalysisClaim(
        draft("ch. 11, Sec. 6, Prop. 4", "K_Y1 e_y' + K_Y2 e_y where a rotor stops: 1/√3"),
        _switch_line,
        published="0.57735",
        unit="m/s^2",
    ),
    AnalysisClaim(
        draft(
            "ch. 11, Sec. 6, Lemma 5, Eq. (42)",
            "The printed solution with both rotors pushing is correct",
        ),
        lambda: _for_all(_eq_42_holds),
    ),
    AnalysisClaim(
        draft(
            "ch. 11, Sec. 6, Lemmas 5 and 6",
            "From the zone of Eq. (39) a rotor stops within 0 < t < 1 s",
        ),
        lambda: _for_all(_switches_within),
    ),
    AnalysisClaim(
        draft(
            "ch. 11, Sec. 6, Lemmas 7 and 8, Prop. 5",
            "Half a period leads from the zone into its mirror image",
        ),
        lambda: _for_all(_comes_back_mirrored),
    ),
    AnalysisClaim(
        draft("ch. 11, Sec. 6, Remark 8", "The first half period, from rest, ends in the zone"),
        _first_half_period,
    ),
    AnalysisClaim(
        draft(
            "ch. 11, Sec. 6, Prop. 6",
            "In between, the Lyapunov candidate does not exceed its values at half periods",
        ),
        lambda: _for_all(_largest_at_the_ends),
    ),
    AnalysisClaim(
        draft(
            "ch. 11, Sec. 6, Remark 10, Eq. (71)",
            "The candidate grows by at most 3/4 over half a period",
        ),
        lambda: _bound().largest_gain,
        published="0.75",
    ),
    AnalysisClaim(
        draft("ch. 11, Sec. 6, Remark 10", "It grows by more nowhere in the zone"),
        lambda: _for_all(lambda state: lyapunov_growth(_SWING, state) <= 0.75 + 1e-12),
    ),
    AnalysisClaim(
        draft(
            "ch. 11, Sec. 6, Remark 9; Sec. 7",
            "With the large swing the error along y goes to zero",
        ),
        _is_asymptotically_stable,
        published=False,
    ),
    AnalysisClaim(
        draft(
            "ch. 11, Secs. 6-7, Prop. 2, Figs. 24, 31",
            "The error along y stays bounded: the oscillation is stable",
        ),
        lambda: bool(np.abs(multipliers(_SWING, limit_cycle(_SWING))).max() < 1.0),
    ),
    FlightClaim(
        draft(
            "ch. 11, Sec. 7, Figs. 25-26",
            "With the large swing inputs saturate from time to time, not always",
        ),
        (_LARGE,),
        lambda flights: 0.0 < float(flights[_LARGE]["saturated_fraction"]) < 1.0,
    ),
    FlightClaim(
        draft(
            "ch. 11, Sec. 8, Prop. 7, Eq. (77)",
            "The candidate stays below L_critical + 3/4 (here 2.56 m²/s²)",
        ),
        (_LARGE,),
        lambda flights: float(flights[_LARGE]["max_lyapunov"]) <= _bound().published,
    ),
)
