"""Chapter 1: hovering in a gust (Sec. 2)."""

from __future__ import annotations

from math import acos, hypot
from typing import Final

import numpy as np

from tiltsim.report.claim import AnalysisClaim, FlightClaim, Metrics
from tiltsim.report.draft import draft
from tiltsim.report.measures import planned_gait_tilts_less
from tiltsim_controllers.analysis.singularity import torque_free_direction
from tiltsim_controllers.vehicle.parameters import PRESETS

_PERFECT: Final = "ch01_gust/hover#perfect_gait"
_QUADROTOR: Final = "ch01_gust/hover#quadrotor"
_FLIGHTS: Final = (_PERFECT, "ch01_gust/hover#imperfect_gait", _QUADROTOR)
_TILTING: Final = ("ch03_gaits/over_actuated#gait_1", "ch03_gaits/over_actuated#gait_1_planned")
_GUST: Final = 1.0  # m/s^2 along +x


def _tilt(metrics: Metrics) -> float:
    return hypot(*(float(metrics[f"final_{angle}"]) for angle in ("roll", "pitch", "yaw")))


def _some_gait_tilts_more_than_the_quadrotor() -> bool:
    """Statics of the mirrored perfect gait, whose force at level attitude adds to the gust."""
    from tiltsim_controllers.analysis.balance import even_load_gait

    vehicle = PRESETS["ar_drone_2"]
    gait = even_load_gait((-_GUST, 0.0, 0.0), vehicle)
    direction = np.array([-_GUST, 0.0, vehicle.gravity]) / hypot(_GUST, vehicle.gravity)
    lean = acos(float(torque_free_direction(gait, vehicle) @ direction))
    return lean > acos(float(direction[2]))


def _map_enlarges_the_attitudes() -> bool:
    from tiltsim_controllers.analysis.published_gaits import robustness_table

    return all(row.claim_holds for row in robustness_table() if row.claim_holds is not None)


CLAIMS = (
    FlightClaim(
        draft(
            "ch. 1, Sec. 2, Figs. 2-4",
            "In a constant gust the perfect gait needs the smallest attitude of the three",
        ),
        _FLIGHTS,
        lambda flights: min(flights, key=lambda address: _tilt(flights[address])) == _PERFECT,
    ),
    FlightClaim(
        draft(
            "ch. 1, Sec. 2, Fig. 4",
            "A quadrotor leans more than the tiltrotor with the perfect gait",
        ),
        (_PERFECT, _QUADROTOR),
        lambda flights: _tilt(flights[_QUADROTOR]) > _tilt(flights[_PERFECT]),
    ),
    AnalysisClaim(
        draft(
            "ch. 1, Sec. 2, Fig. 3",
            "An imperfect gait may need a larger attitude than the quadrotor",
        ),
        _some_gait_tilts_more_than_the_quadrotor,
    ),
    FlightClaim(
        draft(
            "ch. 1, Abstract of the thesis; Sec. 3, Fig. 5",
            "Planned gaits avoid the over-intensive changes of the tilt angles that feedback "
            "linearization of all eight inputs requires",
        ),
        _TILTING,
        planned_gait_tilts_less,
    ),
    AnalysisClaim(
        draft(
            "ch. 1, Abstract of the thesis",
            "The Two Color Map enlarges the acceptable attitudes of all gaits compared",
        ),
        _map_enlarges_the_attitudes,
        refuted="It does so for every red gait but for no blue one: there every attitude is "
        "singular.",
    ),
)
