"""Chapter 4: tracking with the trot, and the two attitude-position decouplers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from itertools import product
from typing import Final

import numpy as np

from tiltsim.report.claim import AnalysisClaim, FlightClaim, Metrics
from tiltsim.report.measures import (
    every_flight_completed,
    falls,
    grows,
    no_rotor_stops,
    resting_error,
    routh_holds,
    tracking_error,
)
from tiltsim.report.statement import Origin, Statement
from tiltsim_controllers.analysis.singularity import residuals
from tiltsim_controllers.laws.decouplers import conventional_decoupler, modified_decoupler
from tiltsim_controllers.laws.gains import GAIN_SETS
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.decoupling_matrix import (
    sines_and_cosines,
    torque_entries,
    torque_free_force,
)
from tiltsim_controllers.vehicle.parameters import PRESETS, drag_ratio

_VEHICLE: Final = PRESETS["ar_drone_2"]
_FORMS: Final = {"instant": "instant switch", "continuous": "continuous switch"}
_PERIOD_FIGURES: Final = {
    "line": "ch. 4, Sec. 7.2, Figs. 8-9",
    "circle": "ch. 4, Sec. 7.3, Figs. 13-14",
}
_DECOUPLERS: Final = ("conventional", "modified")
_PERIODS: Final = (1, 2, 3)
_SHORT: Final = 0.25
"""Fraction of the larger error up to which a difference at T = 1 s is not significant."""
_MEASURED: Final = {("instant", 1, "modified"), ("instant", 3, "conventional")}
"""Trots on which it matters in MuJoCo whether the angular acceleration is the model's."""
_FEEDBACK: Final = (
    "Eq. (26) feeds back the second derivative of the output. In the instant trots of T = 1 s, "
    "modified, and T = 3 s, conventional, it is measured; elsewhere it is computed from the law's "
    "model, which makes no difference of 2 % there. With the model's, MuJoCo loses the latter "
    "(gyroscopic torque)."
)
_WORSE: Final = (
    "The modified decoupler is worse: it assumes tilt angles at rest and leans at every switch of "
    "the trot, which costs most where switches are most frequent."
)


def _address(reference: str, gait: str, decoupler: str) -> str:
    return f"ch04_tracking/{reference}#{gait}_{decoupler}"


def _trot(reference: str, form: str, period: int, decoupler: str) -> str:
    """The flight that feeds back the output's second derivative, as Eq. (26) is written."""
    if (form, period, decoupler) in _MEASURED:
        return f"ch04_tracking/measured_acceleration#{reference}_t{period}_{decoupler}"
    return _address(reference, f"{form}_t{period}", decoupler)


def _trots(reference: str, form: str) -> tuple[str, ...]:
    return tuple(_trot(reference, form, T, d) for T, d in product(_PERIODS, _DECOUPLERS))


def _short_periods_do_not_differ(reference: str, form: str, flights: Mapping[str, Metrics]) -> bool:
    errors = [tracking_error(flights[_trot(reference, form, 1, d)]) for d in _DECOUPLERS]
    return max(errors) - min(errors) < _SHORT * max(errors)


def _continuous_is_better(reference: str, decoupler: str, flights: Mapping[str, Metrics]) -> bool:
    return all(
        tracking_error(flights[_trot(reference, "continuous", T, decoupler)])
        < tracking_error(flights[_trot(reference, "instant", T, decoupler)])
        for T in _PERIODS
    )


def _trot_residuals() -> tuple[Floats, Floats]:
    """Angles rho up to the largest, and R of the trot at them."""
    rho = np.linspace(-0.65, 0.65, 131)
    return rho, residuals(np.stack([-rho, -rho, rho, rho], axis=-1), _VEHICLE).R


def _eq_25_holds() -> bool:
    rho, R = _trot_residuals()
    return bool(np.abs(R - 4.0 * np.cos(rho) ** 2).max() < 1e-9)


def _decouplers_agree_without_tilt() -> bool:
    trig = sines_and_cosines(0.0, 0.0, 0.0, 0.0)
    ratio = drag_ratio(_VEHICLE)
    n = torque_free_force(trig, torque_entries(trig, ratio), ratio)
    desired = (1.3, -0.7, 0.4, _VEHICLE.gravity)  # m/s^2, m/s^2, rad, m/s^2
    pair = zip(modified_decoupler(*desired, n), conventional_decoupler(*desired), strict=True)
    return max(abs(modified - conventional) for modified, conventional in pair) < 1e-12


_RHOS: Final = {
    "rho_065": "ρ = 0.65",
    "rho_0325": "ρ = 0.325",
    "rho_minus_0325": "ρ = -0.325",
    "rho_minus_065": "ρ = -0.65",
}
_ALL_TROTS: Final = tuple(
    address for r, form in product(_PERIOD_FIGURES, _FORMS) for address in _trots(r, form)
)


DETERMINANT = Statement(
    id="ch4-determinant",
    source="ch. 4, Sec. 3.3, Eq. (25)",
    text="For the trot the determinant at level attitude is 4 cos² ρ",
    thesis="“Substituting (21) – (24) into the left side of (20) yields 4 cos²(ρ)” (Eq. 25).",
    criterion="R and 4 cos² ρ differ by less than 1e-9 for |ρ| up to 0.65",
)
NO_SINGULARITY = Statement(
    id="ch4-no-singularity",
    source="ch. 4, Sec. 3.3, Prop. 3",
    text="The trot meets no singularity at level attitude for |ρ| <= 0.65",
    thesis="“When the roll angle and pitch angle of the tilt-rotor are close to zero, the "
    "cat-trot gait introduces no singular problem.”",
    criterion="R is positive for all |ρ| up to 0.65",
)
ATTITUDE_GAINS = Statement(
    id="ch4-attitude-gains",
    source="ch. 4, Sec. 5.1, Prop. 4",
    text="The gains satisfy Eqs. (35)-(38), so that attitude and altitude are stable",
    thesis="“Thus, all degrees of freedom have been proved exponentially stable”, by Prop. 4 with "
    "the gains of Sec. 3.4.",
    criterion="All three gains of the loop are positive and K_P1 K_P2 > K_P3",
    finding="gains",
)
POSITION_GAINS = Statement(
    id="ch4-position-gains",
    source="ch. 4, Sec. 5.1, Prop. 5",
    text="The gains of the position loop satisfy Eqs. (39)-(40)",
    thesis="“The position (X, Y) is exponentially stable if” both gains are positive.",
    criterion="Both gains are positive",
)
REDUCES = Statement(
    id="ch4-reduces",
    source="ch. 4, Secs. 7.1-7.3",
    text="The modified decoupler reduces the remaining error",
    thesis="“… the modified attitude-position decoupler notably reduces the steady state error in "
    "the same gait” (7.1); “… significantly reduces the dynamic state error (supremum), "
    "especially for the gait with long period” (7.2, 7.3).",
    criterion="The error at rest, or the largest one after 20 s, is smaller than with the "
    "conventional decoupler; periods of 2 s and 3 s, since Secs. 7.2 and 7.3 except short ones "
    "(ch4-short-period)",
    pictures=("setpoint-errors", "trot-errors"),
    note=_FEEDBACK,
)
PER_AXIS = Statement(
    id="ch4-per-axis",
    source="ch. 4, Sec. 7.2, Fig. 5",
    text="With ρ fixed, the modified decoupler reduces the error along each axis of the line",
    thesis="“… the yellow curve, e_x (with), and the purple curve, e_y (with), are closer to zero "
    "comparing with the blue curve, e_x (without), and the red curve, e_y (without), respectively, "
    "after sufficient time.”",
    criterion="The absolute error along the axis, as a mean over the last second, is smaller",
)
GROWS = Statement(
    id="ch4-period",
    source="ch. 4, Secs. 7.2-7.3",
    text="The error grows with the period of the trot (T = 1, 2, 3 s)",
    thesis="“Clearly, with the increase of the period, the gait receives larger dynamic state "
    "error (supremum) for both cat-trot gaits with instant switch and with continuous switch.”",
    criterion="The largest error after 20 s grows from T = 1 s to 2 s and from 2 s to 3 s",
    pictures=("trot-errors",),
    note=_FEEDBACK,
)
SHORT_PERIOD = Statement(
    id="ch4-short-period",
    source="ch. 4, Secs. 7.2-7.3",
    text="At the short period, T = 1 s, the decouplers do not differ significantly",
    thesis="“While no significant differences in the dynamic state error (supremum) are reported "
    "for the gaits whose period is short for both cat-trot gaits with instant switch and with "
    "continuous switch.”",
    criterion="The largest errors after 20 s differ by less than a quarter of the larger one",
    note="At T = 1 s the modified decoupler is the worse one in all four cases.",
    finding="short-period",
    pictures=("trot-errors",),
)
CONTINUOUS = Statement(
    id="ch4-continuous",
    source="ch. 4, Secs. 7.2-7.3",
    text="The continuous trot tracks better than the instant one, period by period",
    thesis="“… the dynamic state error (supremum) received by the cat-trot gait with continuous "
    "switch (Figure 9) is smaller than the corresponding dynamic state error (supremum) received "
    "by the cat-trot gait with instant switch (Figure 8).”",
    criterion="The largest error after 20 s is smaller for each of T = 1, 2, 3 s",
    pictures=("trot-errors",),
    note=_FEEDBACK,
)
TRACKED = Statement(
    id="ch4-tracked",
    source="ch. 4, Sec. 8",
    text="The trot tracks line and circle, with either decoupler and every period",
    thesis="“All the references considered in this research (setpoint, uniform rectilinear "
    "motion, uniform circular motion) are successfully tracked with acceptable steady state error "
    "by cat-trot gait.”",
    criterion="None of the 24 flights is lost",
    note=_FEEDBACK,
)
NOT_ACTIVATED = Statement(
    id="ch4-constraints",
    source="ch. 4, Sec. 5.1",
    text="No rotor reaches the limit of zero speed",
    thesis="“In this research, these constraints are not activated, which simplifies our "
    "discussion on the stability.”",
    criterion="The smallest rotor speed along its spin stays above zero in all 24 flights",
    note=_FEEDBACK,
)
UNTILTED = Statement(
    id="ch4-untilted",
    source="ch. 4, Sec. 3.2, Remark 2",
    text="Without tilt the modified decoupler is the conventional one",
    thesis="“… the attitude-position decoupler for the conventional quadrotor is a special case "
    "of the modified attitude-position decoupler for the tilt-rotor.”",
    criterion="Roll and pitch of both agree to 1e-12 for the untilted vehicle",
)
FURTHER = Statement(
    id="ch4-further",
    source="ch. 4, Sec. 8",
    text="Without neglecting higher-order terms the error decreases further",
    thesis="“… further reduction of the dynamic state error may be possible by not ignoring the "
    "high-order infinitesimal terms while deducing the modified attitude-position decoupler.”",
    criterion="With the exact decoupler, ours, the error at rest is smaller than with the "
    "modified one",
    origins=(Origin.FLIGHT,),
    finding="statics",
)


def _better(
    where: str,
    case: str,
    flights: Iterable[str],
    error: Callable[[Metrics], float] = tracking_error,
) -> FlightClaim:
    flights = tuple(flights)
    return FlightClaim(REDUCES, flights, partial(falls, error), where=where, case=case)


def _axis_error(axis: str, metrics: Metrics) -> float:
    return abs(float(metrics[f"final_position_error_{axis}"]))


CLAIMS = (
    AnalysisClaim(DETERMINANT, _eq_25_holds),
    AnalysisClaim(NO_SINGULARITY, lambda: bool((_trot_residuals()[1] > 0.0).all())),
    *(
        AnalysisClaim(
            ATTITUDE_GAINS, partial(routh_holds, case.split(" and ")), case=case, refuted=reason
        )
        for case, reason in (
            (
                "roll and pitch",
                "K_P1 K_P2 = 10 does not exceed K_P3 = 50. The flights are stable nevertheless: "
                "the matrix is printed, and used, without the factor 2|ϖ| in its first three rows, "
                "which multiplies the gains of these loops by about 720.",
            ),
            (
                "yaw",
                "K_P1 K_P2 = 1 does not exceed K_P3 = 1: on the boundary. The missing factor 2|ϖ| "
                "makes it stable, as above.",
            ),
            ("altitude", ""),
        )
    ),
    AnalysisClaim(
        POSITION_GAINS,
        lambda: min(GAIN_SETS["ch04"].position_1, GAIN_SETS["ch04"].position_2) > 0.0,
    ),
    *(
        _better(
            "ch. 4, Sec. 7.1, Fig. 4",
            f"setpoint, {title}",
            (_address("setpoint", name, decoupler) for decoupler in _DECOUPLERS),
            resting_error,
        )
        for name, title in _RHOS.items()
    ),
    *(
        _better(
            f"ch. 4, Sec. {section}, Fig. {figure}",
            f"{reference}, fixed, ρ = 0.65",
            (_address(reference, "fixed", decoupler) for decoupler in _DECOUPLERS),
        )
        for reference, section, figure in (("line", "7.2", 5), ("circle", "7.3", 10))
    ),
    *(
        _better(
            f"ch. 4, Sec. {section}, Figs. {figures}",
            f"{reference}, {_FORMS[form]}, T = {period} s",
            (_trot(reference, form, period, decoupler) for decoupler in _DECOUPLERS),
        )
        for (reference, section, form, figures) in (
            ("line", "7.2", "instant", "6, 8"),
            ("line", "7.2", "continuous", "7, 9"),
            ("circle", "7.3", "instant", "11, 13"),
            ("circle", "7.3", "continuous", "12, 14"),
        )
        for period in (2, 3)
    ),
    *(
        FlightClaim(
            GROWS,
            tuple(_trot(reference, form, T, decoupler) for T in _PERIODS),
            partial(grows, tracking_error),
            where=_PERIOD_FIGURES[reference],
            case=f"{reference}, {_FORMS[form]}, {decoupler}",
        )
        for reference, form, decoupler in product(_PERIOD_FIGURES, _FORMS, _DECOUPLERS)
    ),
    *(
        FlightClaim(
            SHORT_PERIOD,
            _trots(reference, form),
            partial(_short_periods_do_not_differ, reference, form),
            where=_PERIOD_FIGURES[reference],
            case=f"{reference}, {_FORMS[form]}",
            why=_WORSE if form == "instant" else "",
        )
        for reference, form in product(_PERIOD_FIGURES, _FORMS)
    ),
    *(
        FlightClaim(
            CONTINUOUS,
            tuple(_trot(reference, f, T, decoupler) for f in _FORMS for T in _PERIODS),
            partial(_continuous_is_better, reference, decoupler),
            where=_PERIOD_FIGURES[reference],
            case=f"{reference}, {decoupler}",
        )
        for reference, decoupler in product(_PERIOD_FIGURES, _DECOUPLERS)
    ),
    FlightClaim(TRACKED, _ALL_TROTS, every_flight_completed),
    FlightClaim(NOT_ACTIVATED, _ALL_TROTS, no_rotor_stops),
    *(
        FlightClaim(
            PER_AXIS,
            tuple(_address("line", "fixed", decoupler) for decoupler in _DECOUPLERS),
            partial(falls, partial(_axis_error, axis)),
            case=f"along {axis}",
        )
        for axis in "xy"
    ),
    AnalysisClaim(UNTILTED, _decouplers_agree_without_tilt),
    *(
        FlightClaim(
            FURTHER,
            (_address("setpoint", name, "modified"), f"beyond/setpoint_exact_decoupler#{name}"),
            partial(falls, resting_error),
            case=f"setpoint, {title}",
        )
        for name, title in _RHOS.items()
    ),
)
