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
from tiltsim.report.measures import routh_holds, terms, terms_hold
from tiltsim.report.statement import Origin, Statement
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


_EVERY_TERM: Final = (
    "Every product of sines and cosines has the printed coefficient, to 0.001, and none is missing"
)
_KEYFRAMES: Final = (Origin.KEYFRAMES,)

EQ_11 = Statement(
    id="ch5-eq-11",
    source="ch. 5, Sec. 3.1, Eq. (11)",
    text="Eq. (11), term by term, is the determinant at level attitude",
    thesis="“Once the gait … satisfies (11), the decoupling matrix in feedback linearization is "
    "asserted to be invertible in our case, given φ ≈ 0, θ ≈ 0.”",
    criterion=_EVERY_TERM,
)
EQ_15_HOLDS = Statement(
    id="ch5-eq-15",
    source="ch. 5, Sec. 4, Eq. (15)",
    text="Eq. (15), term by term, is the determinant at any attitude",
    thesis="“The exact necessary and sufficient condition [18] to receive an invertible decoupling "
    "matrix is” Eq. (15).",
    criterion=_EVERY_TERM,
    finding="slips",
)
UNSCALED = Statement(
    id="ch5-unscaled",
    source="ch. 5, Abstract and Sec. 4",
    text="Unscaled, the gait meets a singular matrix at level attitude",
    thesis="“It is found that the singular decoupling matrix exists in walk gait, transverse "
    "gallop gait, and rotary gallop gait”; the run “remains identical to the original cat-run "
    "gait”.",
    criterion="R vanishes or changes its sign within a period",
    origins=_KEYFRAMES,
    fitted=True,
)
SOME_SCALE = Statement(
    id="ch5-some-scale",
    source="ch. 5, Sec. 4, Prop. 1, Eq. (18)",
    text="Some integer n makes a gait scaled by 1/n regular",
    thesis="“There will always be a positive integer n such that the modified gait by scaling by "
    "1/n produces an invertible decoupling matrix”, since the determinant tends to 4.000 cφ cθ.",
    criterion="At zero tilt the determinant is 4 cos φ cos θ to 1e-9 and positive within 1.5 rad; "
    "it is continuous, so small gaits are regular, too",
)
SCALING = Statement(
    id="ch5-scaling",
    source="ch. 5, Sec. 4, Figs. 9-11",
    text="Scaled by 1/2 and 1/3 the singular attitudes move away from level",
    thesis="“It can be found that the acceptable attitude region is enlarging while evenly "
    "shrinking the scale of the walk gait. A similar result can also be notably observed in” both "
    "gallops.",
    criterion="The smallest rotation from level to a singular attitude grows from scale 1 to 1/2 "
    "and from 1/2 to 1/3",
    origins=_KEYFRAMES,
    fitted=True,
)
GAINS = Statement(
    id="ch5-gains",
    source="ch. 5, App. A, Eqs. (A1)-(A4)",
    text="With the printed gains the attitude loops are stable",
    thesis="App. A prints the gains of ch. 4, whose Prop. 4 is the stability condition.",
    criterion="All three gains of each loop are positive and K1 K2 > K3",
    finding="gains",
)

CLAIMS = (
    AnalysisClaim(EQ_11, partial(terms_hold, "R", EQ_19, _VEHICLE)),
    AnalysisClaim(
        EQ_15_HOLDS,
        lambda: all(
            terms_hold(part, printed, _VEHICLE) for part, printed in EQ_15._asdict().items()
        ),
        refuted="-2.880 s1 c2 s3 s4 sin φ cos θ should be s1 c2 c3 s4, and the last term, "
        "1.000 s1 s2 s3 c4 sin φ cos θ, should be s1 s2 c3 s4.",
    ),
    *(
        AnalysisClaim(
            UNSCALED,
            partial(_is_singular, gait),
            case=gait.replace("_", " "),
            published=gait != "run",
        )
        for gait in (*_SCALED, "run")
    ),
    AnalysisClaim(SOME_SCALE, _shrunk_gaits_are_regular),
    *(
        AnalysisClaim(
            SCALING,
            partial(_scaling_enlarges, gait),
            case=gait.replace("_", " "),
            where=f"ch. 5, Sec. 4, Fig. {figure}",
        )
        for gait, figure in zip(_SCALED, (9, 10, 11), strict=True)
    ),
    AnalysisClaim(
        GAINS,
        partial(routh_holds, ("roll", "pitch", "yaw")),
        refuted="K1 K2 > K3 fails as in ch. 4, Prop. 4: 10 against 50 for roll and pitch, 1 "
        "against 1 for yaw. The factor missing in the printed matrix makes the flights stable.",
    ),
)
