"""Chapter 7: robust gaits in a tracking experiment."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Final

import numpy as np

from tiltsim.report.claim import AnalysisClaim, FlightClaim, Metrics
from tiltsim.report.claims.ch06 import RANK
from tiltsim.report.measures import beats_its_biased_twin, margins_as_printed
from tiltsim.report.statement import read_statements
from tiltsim_controllers.analysis.published_gaits import PUBLISHED_GAITS, robustness
from tiltsim_controllers.analysis.two_color_map import delta, find_roots
from tiltsim_controllers.vehicle.parameters import PRESETS

_VEHICLE: Final = PRESETS["ar_drone_2"]
_BLUE_ROUNDED: Final = "ch07_robust_gaits/circle#gait_1_blue_rounded"
_GAITS: Final = {f"ch07_gait_{number}": f"Gait {number}" for number in (1, 2, 3)}
_FIGURES: Final = dict(zip(_GAITS, (5, 6, 7), strict=True))
_SENSITIVE: Final = 0.2  # rad


def _one_root_of_each_color() -> bool:
    """At 200 random (α₁, α₂) off the lines through P: the roots are one red, one blue."""
    rng, offset = np.random.default_rng(7), 2.0 * delta(_VEHICLE)
    for first, second in rng.uniform(-1.5, 1.5, (200, 2)).tolist():
        lines = [(first, second), (offset - first, -offset - second)]
        roots = [(r.alpha_3, r.alpha_4) for r in find_roots(first, second, _VEHICLE)]
        apart = np.array(roots)[:, np.newaxis] - np.array(lines)  # angles up to a multiple of pi
        same = np.abs(np.sin(apart)).max(axis=-1) < 1e-6
        if len(roots) != 2 or not same.any(axis=0).all():
            return False
    return True


def _red_is_more_robust() -> bool:
    """Whether both red gaits have a larger margin than Gait 1 with the printed offset."""
    blue, _ = margins_as_printed("ch07_gait_1")
    return all(robustness(PUBLISHED_GAITS[f"ch07_gait_{i}"]).margin > blue for i in (2, 3))


def _is_sensitive() -> bool:
    margin = robustness(PUBLISHED_GAITS["ch07_gait_2"]).margin_biased
    return margin is not None and margin < _SENSITIVE


def _rotors_keep_turning(flights: Mapping[str, Metrics]) -> bool:
    metrics = flights[_BLUE_ROUNDED]
    return not metrics["diverged"] and float(metrics["min_rotor_speed"]) > 0.0


THESIS: Final = read_statements("ch07", sensitive=_SENSITIVE)

CLAIMS = (
    AnalysisClaim(THESIS["ch7-two-roots"], _one_root_of_each_color),
    *(
        AnalysisClaim(
            THESIS["ch7-more-robust"],
            partial(beats_its_biased_twin, key),
            case=name + (", on the exact lines" if key == "ch07_gait_1" else ""),
            where=f"ch. 7, Sec. 3.2, Fig. {_FIGURES[key]}",
            refuted=RANK if key == "ch07_gait_1" else "",
            finding="blue" if key == "ch07_gait_1" else "red",
        )
        for key, name in _GAITS.items()
    ),
    AnalysisClaim(
        THESIS["ch7-more-robust"],
        lambda: margins_as_printed("ch07_gait_1")[0] > margins_as_printed("ch07_gait_1")[1],
        case="Gait 1, with the printed offset",
        where="ch. 7, Sec. 3.2, Fig. 5",
        note="The margin is that of a matrix singular up to the sixth digit of the offset.",
    ),
    AnalysisClaim(THESIS["ch7-red-especially"], _red_is_more_robust),
    AnalysisClaim(
        THESIS["ch7-biased-2-sensitive"],
        _is_sensitive,
        why="Our rectangle's biased twin keeps most of a right angle. A larger rectangle would "
        "leave it less.",
    ),
    FlightClaim(
        THESIS["ch7-no-saturation"],
        (_BLUE_ROUNDED,),
        _rotors_keep_turning,
        why="The flight is lost at the first attitude error: a matrix that the sixth digit of an "
        "angle keeps regular requires rotor speeds that no rotor has.",
    ),
)
