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
from tiltsim.report.statement import read_statements
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


def _better(
    where: str,
    case: str,
    flights: Iterable[str],
    error: Callable[[Metrics], float] = tracking_error,
) -> FlightClaim:
    flights = tuple(flights)
    return FlightClaim(
        THESIS["ch4-reduces"], flights, partial(falls, error), where=where, case=case
    )


def _axis_error(axis: str, metrics: Metrics) -> float:
    return abs(float(metrics[f"final_position_error_{axis}"]))


THESIS: Final = read_statements("ch04")

CLAIMS = (
    AnalysisClaim(THESIS["ch4-determinant"], _eq_25_holds),
    AnalysisClaim(THESIS["ch4-no-singularity"], lambda: bool((_trot_residuals()[1] > 0.0).all())),
    *(
        AnalysisClaim(
            THESIS["ch4-attitude-gains"],
            partial(routh_holds, case.split(" and ")),
            case=case,
            refuted=reason,
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
        THESIS["ch4-position-gains"],
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
            THESIS["ch4-period"],
            tuple(_trot(reference, form, T, decoupler) for T in _PERIODS),
            partial(grows, tracking_error),
            where=_PERIOD_FIGURES[reference],
            case=f"{reference}, {_FORMS[form]}, {decoupler}",
        )
        for reference, form, decoupler in product(_PERIOD_FIGURES, _FORMS, _DECOUPLERS)
    ),
    *(
        FlightClaim(
            THESIS["ch4-short-period"],
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
            THESIS["ch4-continuous"],
            tuple(_trot(reference, f, T, decoupler) for f in _FORMS for T in _PERIODS),
            partial(_continuous_is_better, reference, decoupler),
            where=_PERIOD_FIGURES[reference],
            case=f"{reference}, {decoupler}",
        )
        for reference, decoupler in product(_PERIOD_FIGURES, _DECOUPLERS)
    ),
    FlightClaim(THESIS["ch4-tracked"], _ALL_TROTS, every_flight_completed),
    FlightClaim(THESIS["ch4-constraints"], _ALL_TROTS, no_rotor_stops),
    *(
        FlightClaim(
            THESIS["ch4-per-axis"],
            tuple(_address("line", "fixed", decoupler) for decoupler in _DECOUPLERS),
            partial(falls, partial(_axis_error, axis)),
            case=f"along {axis}",
        )
        for axis in "xy"
    ),
    AnalysisClaim(THESIS["ch4-untilted"], _decouplers_agree_without_tilt),
    *(
        FlightClaim(
            THESIS["ch4-further"],
            (_address("setpoint", name, "modified"), f"beyond/setpoint_exact_decoupler#{name}"),
            partial(falls, resting_error),
            case=f"setpoint, {title}",
        )
        for name, title in _RHOS.items()
    ),
)
