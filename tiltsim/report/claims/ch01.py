"""Chapter 1: hovering in a gust (Sec. 2)."""

from __future__ import annotations

from math import hypot
from typing import Final

from tiltsim.report.claim import AnalysisClaim, FlightClaim, Metrics
from tiltsim.report.measures import planned_gait_tilts_less
from tiltsim.report.statement import Statement

_PERFECT: Final = "ch01_gust/hover#perfect_gait"
_QUADROTOR: Final = "ch01_gust/hover#quadrotor"
_FLIGHTS: Final = (_PERFECT, "ch01_gust/hover#imperfect_gait", _QUADROTOR)
_TILTING: Final = ("ch03_gaits/over_actuated#gait_1", "ch03_gaits/over_actuated#gait_1_planned")
_GUST: Final = 1.0  # m/s^2 along +x


def _tilt(metrics: Metrics) -> float:
    return hypot(*(float(metrics[f"final_{angle}"]) for angle in ("roll", "pitch", "yaw")))


def _map_enlarges_the_attitudes() -> bool:
    from tiltsim_controllers.analysis.published_gaits import robustness_table

    return all(row.claim_holds for row in robustness_table() if row.claim_holds is not None)


LEAST = Statement(
    id="ch1-least-attitude",
    source="ch. 1, Sec. 2, Figs. 2-4",
    text="In a constant gust the perfect gait needs the smallest attitude of the three",
    thesis="“… the tiltrotor adopting the 'perfect' combination of the tilting angles … receives "
    "the least Euler angles in attitude (Figure 2).”",
    criterion="The root of the sum of the squared Euler angles at rest is smaller than with the "
    "imperfect gait and than the quadrotor's",
)
QUADROTOR = Statement(
    id="ch1-quadrotor-larger",
    source="ch. 1, Sec. 2, Fig. 4",
    text="A quadrotor leans more than the tiltrotor with the perfect gait",
    thesis="“… the Euler angles in attitude of the conventional quadrotor (Figure 4) are larger "
    "than the tiltrotor's.”",
    criterion="The root of the sum of the squared Euler angles at rest is larger",
)
PLANNED = Statement(
    id="ch1-planned-gaits",
    source="ch. 1, Abstract of the thesis; Sec. 3, Fig. 5",
    text="Planned gaits avoid the over-intensive changes of the tilt angles that feedback "
    "linearization of all eight inputs requires",
    thesis="“The tilting angles are supposed to change in high frequencies and on a large scale at "
    "the beginning” (over-actuated); with planned gaits “notable improvements in the control "
    "signals were witnessed”.",
    criterion="In the task of ch. 3, Sec. 6.3, the planned gait's largest tilt rate is below a "
    "hundredth of the over-actuated controller's",
)
ENLARGED = Statement(
    id="ch1-map-enlarges",
    source="ch. 1, Abstract of the thesis",
    text="The Two Color Map enlarges the acceptable attitudes of all gaits compared",
    thesis="“The Two Color Map Theorem was subsequently established to enlarge the supported "
    "attitude for the tiltrotor.”",
    criterion="Every gait of ch. 6 to 8, set on the exact lines of its color, has a larger "
    "singularity margin at level attitude than its biased twin",
    finding="blue",
    pictures=("red-and-biased", "blue-and-biased"),
)

CLAIMS = (
    FlightClaim(
        LEAST,
        _FLIGHTS,
        lambda flights: min(flights, key=lambda address: _tilt(flights[address])) == _PERFECT,
    ),
    FlightClaim(
        QUADROTOR,
        (_PERFECT, _QUADROTOR),
        lambda flights: _tilt(flights[_QUADROTOR]) > _tilt(flights[_PERFECT]),
    ),
    FlightClaim(PLANNED, _TILTING, planned_gait_tilts_less),
    AnalysisClaim(
        ENLARGED,
        _map_enlarges_the_attitudes,
        refuted="It does so for every red gait but for no blue one: there every attitude is "
        "singular.",
    ),
)
