"""Chapter 6, Secs. 5 and 6: four gaits and their biased twins."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Final

import numpy as np

from tiltsim.report.claim import AnalysisClaim
from tiltsim.report.claims.ch03 import EQ_17, EQ_19
from tiltsim.report.claims.ch06 import EQ_4, RANK
from tiltsim.report.measures import PRINTED_OFFSET
from tiltsim.report.statement import read_statements
from tiltsim_controllers.analysis.published_gaits import (
    PUBLISHED_GAITS,
    Robustness,
    robustness,
    smallest_margin,
)
from tiltsim_controllers.analysis.singularity import residuals
from tiltsim_controllers.analysis.two_color_map import delta
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.parameters import PRESETS

_VEHICLE: Final = PRESETS["ar_drone_2"]
_ZERO: Final = 1e-9
_NEAR_RIGHT_ANGLE: Final = 1.55
"""rad: with such a margin the singular attitudes are within 0.02 rad of a right angle."""
_GAITS: Final = {f"ch06_gait_{i}": f"Gait {i}" for i in (1, 2, 3, 4)}
_FIGURES: Final = dict(zip(_GAITS, (21, 23, 25, 27), strict=True))
_SIGN: Final = dict(zip(_GAITS, (-1.0, -1.0, -1.0, 1.0), strict=True))
_BLUE: Final = ("ch06_gait_1", "ch06_gait_2")
_BLUE_PRINTED: Final = "as published: the printed coefficients and the offset 0.334198"
_BLUE_EXACT: Final = "on the exact lines"


def _signs(key: str) -> float:
    """1, -1, or 0 where R is zero or changes sign over the gait on the exact lines."""
    published = PUBLISHED_GAITS[key]
    gait = published.exact or published.gait
    R = residuals(gait.angles(gait.sample_times(401)), _VEHICLE).R
    if np.abs(R).min() < _ZERO:
        return 0.0
    return float(np.sign(R[0])) if np.ptp(np.sign(R)) == 0.0 else 0.0


def _robustness(key: str) -> Robustness:
    return robustness(PUBLISHED_GAITS[key])


def _nearly_all(key: str) -> bool:
    return _robustness(key).margin > _NEAR_RIGHT_ANGLE


def _as_published(key: str, bias: float = 1.0) -> tuple[float, float]:
    """Smallest margin of a blue gait, and the sign of its R (0 if it changes), as ch. 6 has them.

    The offset is the printed 0.334198, the coefficients are those of Eqs. (4)-(6). A margin is
    negative where R has another sign than at the start.
    """
    gait = PUBLISHED_GAITS[key].gait
    angles = gait.angles(gait.sample_times(401))
    angles[:, 2], angles[:, 3] = PRINTED_OFFSET - angles[:, 0], -PRINTED_OFFSET - angles[:, 1]
    angles[:, 2:] *= bias
    sines, cosines = np.sin(angles), np.cos(angles)

    def part(printed: Mapping[str, float]) -> Floats:
        factors = {"s": sines, "c": cosines}
        return sum(
            (
                value * np.prod([factors[f][:, i] for i, f in enumerate(name)], axis=0)
                for name, value in printed.items()
            ),
            np.zeros(len(angles)),
        )

    R, R_phi, R_theta = part(EQ_19), part(EQ_4), part(EQ_17.R_theta)
    margin = np.arcsin(R / np.sqrt(R**2 + R_phi**2 + R_theta**2)) * np.sign(R[0])
    sign = float(np.sign(R[0])) if np.ptp(np.sign(R)) == 0.0 else 0.0
    return float(margin.min()), sign


def _is_more_robust_as_published(key: str) -> bool:
    return _as_published(key)[0] > _as_published(key, PUBLISHED_GAITS[key].bias or 1.0)[0]


def _greater_advantage_over_99(margin: Callable[[float], float]) -> bool:
    """Whether Gait 2 exceeds the 99 % gait by more than the 80 % gait."""
    own, near, far = (margin(eta) for eta in (1.0, 0.99, 0.8))
    return own > near and own - near > own - far


def _margin_on_exact_lines(bias: float) -> float:
    exact = PUBLISHED_GAITS["ch06_gait_2"].exact
    assert exact is not None
    return max(0.0, smallest_margin(exact.biased(bias), _VEHICLE))


def _red_beats_blue() -> bool:
    margins = {key: _robustness(key).margin_exact for key in ("ch06_gait_2", "ch06_gait_3")}
    return margins["ch06_gait_3"] > margins["ch06_gait_2"]


def _partial_scaling_can_harm() -> bool:
    return any(
        (row := _robustness(key)).margin_biased is not None and row.margin_biased < row.margin
        for key in ("ch06_gait_3", "ch06_gait_4")
    )


def _angles_on_lines(key: str) -> bool:
    """Whether the printed angles lie on the lines of their color, to half their last digit."""
    published = PUBLISHED_GAITS[key]
    first, second, third, fourth = published.gait.angles(np.arange(4) / 4.0).T
    if published.color == "blue":
        offset = 2.0 * delta(_VEHICLE)
        first, second = offset - first, -offset - second
    return bool(np.abs(np.stack([third - first, fourth - second])).max() < 0.0005)


THESIS: Final = read_statements("ch06_gaits")

CLAIMS = (
    *(
        AnalysisClaim(THESIS["ch6-angles"], partial(_angles_on_lines, key), case=name)
        for key, name in _GAITS.items()
    ),
    *(
        AnalysisClaim(
            THESIS["ch6-sign"],
            partial(lambda gait: _as_published(gait)[1], key),
            case=f"{_GAITS[key]}, {_BLUE_PRINTED}",
            key=f"{key[5:].replace('_', '-')}-as-published",
            published=_SIGN[key],
        )
        for key in _BLUE
    ),
    *(
        AnalysisClaim(
            THESIS["ch6-sign"],
            partial(_signs, key),
            case=f"{name}, {_BLUE_EXACT}",
            key=key[5:].replace("_", "-"),
            published=_SIGN[key],
            refuted=RANK + " R is 0." if key in _BLUE else "",
            finding="blue" if key in _BLUE else "",
        )
        for key, name in _GAITS.items()
    ),
    *(
        AnalysisClaim(
            THESIS["ch6-robust"],
            partial(_is_more_robust_as_published, key),
            case=f"{_GAITS[key]}, {_BLUE_PRINTED}",
            key=f"{key[5:].replace('_', '-')}-as-published",
            where=f"ch. 6, Sec. 5, Fig. {_FIGURES[key]}",
        )
        for key in _BLUE
    ),
    *(
        AnalysisClaim(
            THESIS["ch6-robust"],
            partial(lambda gait: bool(_robustness(gait).claim_holds), key),
            case=f"{name}, {_BLUE_EXACT}",
            key=key[5:].replace("_", "-"),
            where=f"ch. 6, Sec. 5, Fig. {_FIGURES[key]}",
            refuted=RANK if key in _BLUE else "",
            finding="blue" if key in _BLUE else "",
        )
        for key, name in _GAITS.items()
    ),
    *(
        AnalysisClaim(
            THESIS["ch6-nearly-all"],
            partial(_nearly_all, key),
            case=_GAITS[key],
            where=f"ch. 6, Sec. 5, Fig. {_FIGURES[key]}",
        )
        for key in ("ch06_gait_3", "ch06_gait_4")
    ),
    AnalysisClaim(
        THESIS["ch6-advantage"],
        partial(_greater_advantage_over_99, lambda bias: _as_published("ch06_gait_2", bias)[0]),
        case=_BLUE_PRINTED,
        key="as-published",
    ),
    AnalysisClaim(
        THESIS["ch6-advantage"],
        partial(_greater_advantage_over_99, _margin_on_exact_lines),
        case=_BLUE_EXACT,
        key="exact",
        refuted="Gait 2 has no margin at all. " + RANK,
    ),
    AnalysisClaim(THESIS["ch6-red-beats-blue"], _red_beats_blue),
    AnalysisClaim(THESIS["ch6-partial-scaling"], _partial_scaling_can_harm),
)
