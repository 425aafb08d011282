"""Chapter 7: robust gaits in a tracking experiment."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from tiltsim.report.claim import AnalysisClaim, FlightClaim, Metrics
from tiltsim.report.claims.ch06 import RANK
from tiltsim.report.draft import draft
from tiltsim.report.measures import no_rotor_stops, robustness_claim, tracking_error
from tiltsim_controllers.analysis.published_gaits import PUBLISHED_GAITS, robustness

_SHAPES: Final = "The figures are not available: place and color as described, size ours. "
_CIRCLE: Final = "ch07_robust_gaits/circle#"


def _is_sensitive() -> bool:
    """Whether less than 0.2 rad of roll or pitch make the biased gait singular."""
    margin = robustness(PUBLISHED_GAITS["ch07_gait_2"]).margin_biased
    return margin is not None and margin < 0.2


def _some_gait_tracks(flights: Mapping[str, Metrics]) -> bool:
    return any(
        not metrics["diverged"] and tracking_error(metrics) < 0.1 for metrics in flights.values()
    )


CLAIMS = (
    robustness_claim("ch. 7, Sec. 3.2, Fig. 5", "ch07_gait_1", "Gait 1", RANK),
    robustness_claim("ch. 7, Sec. 3.2, Fig. 6", "ch07_gait_2", "Gait 2"),
    robustness_claim("ch. 7, Sec. 3.2, Fig. 7", "ch07_gait_3", "Gait 3"),
    AnalysisClaim(
        draft(
            "ch. 7, Sec. 3.2, Fig. 6",
            "The biased Gait 2 is very sensitive to the attitude (margin below 0.2 rad)",
        ),
        _is_sensitive,
        why=_SHAPES
        + "The biased gait keeps 1.45 rad. A larger rectangle reduces it: 0.25 rad with a "
        "corner at (-1.40, 1.40) rad, beyond which the red gait itself is singular.",
    ),
    FlightClaim(
        draft(
            "ch. 7, Sec. 4.2, Figs. 10-11",
            "A gait on the map tracks the circle with little error (0.1 m)",
        ),
        tuple(_CIRCLE + name for name in ("gait_1_blue", "gait_2", "gait_3")),
        _some_gait_tracks,
    ),
    FlightClaim(
        draft(
            "ch. 7, Sec. 5, Fig. 9",
            "No rotor reaches zero speed while tracking (the red gaits, which track)",
        ),
        tuple(_CIRCLE + name for name in ("gait_2", "gait_3")),
        no_rotor_stops,
    ),
)
