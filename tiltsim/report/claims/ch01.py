"""Chapter 1: hovering in a gust (Sec. 2)."""

from __future__ import annotations

from math import hypot
from typing import Final

from tiltsim.report.claim import AnalysisClaim, FlightClaim, Metrics
from tiltsim.report.measures import planned_gait_tilts_less
from tiltsim.report.statement import read_statements

_PERFECT: Final = "ch01_gust/hover#perfect_gait"
_QUADROTOR: Final = "ch01_gust/hover#quadrotor"
_FLIGHTS: Final = (_PERFECT, "ch01_gust/hover#imperfect_gait", _QUADROTOR)
_TILTING: Final = ("ch03_gaits/over_actuated#gait_1", "ch03_gaits/over_actuated#gait_1_planned")


def _tilt(metrics: Metrics) -> float:
    return hypot(*(float(metrics[f"final_{angle}"]) for angle in ("roll", "pitch", "yaw")))


def _map_enlarges_the_attitudes() -> bool:
    from tiltsim_controllers.analysis.published_gaits import robustness_table

    return all(row.claim_holds for row in robustness_table() if row.claim_holds is not None)


THESIS: Final = read_statements("ch01")

CLAIMS = (
    FlightClaim(
        THESIS["ch1-least-attitude"],
        _FLIGHTS,
        lambda flights: min(flights, key=lambda address: _tilt(flights[address])) == _PERFECT,
    ),
    FlightClaim(
        THESIS["ch1-quadrotor-larger"],
        (_PERFECT, _QUADROTOR),
        lambda flights: _tilt(flights[_QUADROTOR]) > _tilt(flights[_PERFECT]),
    ),
    FlightClaim(THESIS["ch1-planned-gaits"], _TILTING, planned_gait_tilts_less),
    AnalysisClaim(
        THESIS["ch1-map-enlarges"],
        _map_enlarges_the_attitudes,
        refuted="It does so for every red gait but for no blue one: there every attitude is "
        "singular.",
    ),
)
