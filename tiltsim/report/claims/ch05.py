"""Chapter 5: walk, run and gallops, their scaling, and the singular attitudes.

The keyframes are reconstructed so that these claims hold (`tiltsim_controllers.gaits.cat.SWINGS`).
What is flown with them and holds is consistent with a fit: it shows that some gaits behave as ch. 5
reports, not that its gaits were these.
"""

from __future__ import annotations

from functools import partial
from itertools import pairwise
from typing import Final

import numpy as np

from tiltsim.report.claim import AnalysisClaim
from tiltsim.report.claims.ch03 import EQ_17, EQ_19
from tiltsim.report.measures import EVERY_TERM, routh_holds, terms, terms_hold
from tiltsim.report.statement import read_statements
from tiltsim_controllers.analysis.published_gaits import smallest_margin
from tiltsim_controllers.analysis.singularity import determinant
from tiltsim_controllers.gaits import plans
from tiltsim_controllers.gaits.cat import SWINGS
from tiltsim_controllers.vehicle.parameters import PRESETS

_VEHICLE: Final = PRESETS["ar_drone_2"]
_SCALED: Final = ("walk", "transverse_gallop", "rotary_gallop")

EQ_15: Final = EQ_17._replace(
    R_phi=terms(
        "1.000 ccsc - 1.000 sccc - 1.000 csss + 1.000 sssc + 2.880 ccss + 2.880 cssc "
        "- 2.880 scss - 2.880 sscc"
    )
)
"""The printed condition at any attitude, with its misprints in the terms with sin(roll)."""


def _margin(gait: str, scale: int) -> float:
    swing = SWINGS[gait]
    return smallest_margin(
        plans.cat(gait, swing.amplitude, 1.0, swing.lean).scaled(scale), _VEHICLE
    )


def _is_singular(gait: str) -> bool:
    return _margin(gait, 1) <= 0.0


def _scaling_enlarges(gait: str) -> bool:
    """Whether the margin grows from 1 over 1/2 to 1/3, where a gait whose R vanishes has none."""
    margins = [max(0.0, _margin(gait, scale)) for scale in (1, 2, 3)]
    return all(first < second for first, second in pairwise(margins))


def _shrunk_gaits_are_regular() -> bool:
    """Eq. (18): as a gait shrinks, the determinant goes to 4 cos(roll) cos(pitch)."""
    roll, pitch = np.meshgrid(np.linspace(-1.5, 1.5, 61), np.linspace(-1.5, 1.5, 61))
    limit = determinant(np.zeros(4), roll, pitch, _VEHICLE)
    agrees = bool(np.abs(limit - 4.0 * np.cos(roll) * np.cos(pitch)).max() < 1e-9)
    return agrees and bool((limit > 0.0).all())


THESIS: Final = read_statements("ch05", every_term=EVERY_TERM)

CLAIMS = (
    AnalysisClaim(THESIS["ch5-eq-11"], partial(terms_hold, "R", EQ_19, _VEHICLE)),
    AnalysisClaim(
        THESIS["ch5-eq-15"],
        lambda: all(
            terms_hold(part, printed, _VEHICLE) for part, printed in EQ_15._asdict().items()
        ),
        refuted="-2.880 s1 c2 s3 s4 sin φ cos θ should be s1 c2 c3 s4, and the last term, "
        "1.000 s1 s2 s3 c4 sin φ cos θ, should be s1 s2 c3 s4.",
    ),
    *(
        AnalysisClaim(
            THESIS["ch5-unscaled"],
            partial(_is_singular, gait),
            case=gait.replace("_", " "),
            published=gait != "run",
        )
        for gait in (*_SCALED, "run")
    ),
    AnalysisClaim(THESIS["ch5-some-scale"], _shrunk_gaits_are_regular),
    *(
        AnalysisClaim(
            THESIS["ch5-scaling"],
            partial(_scaling_enlarges, gait),
            case=gait.replace("_", " "),
            where=f"ch. 5, Sec. 4, Fig. {figure}",
        )
        for gait, figure in zip(_SCALED, (9, 10, 11), strict=True)
    ),
    AnalysisClaim(
        THESIS["ch5-gains"],
        partial(routh_holds, ("roll", "pitch", "yaw")),
        refuted="K1 K2 > K3 fails as in ch. 4, Prop. 4: 10 against 50 for roll and pitch, 1 "
        "against 1 for yaw. The factor missing in the printed matrix makes the flights stable.",
    ),
)
