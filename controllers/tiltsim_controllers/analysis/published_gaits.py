"""The gaits of the thesis by chapter, and where its robustness claims hold.

Ch. 3, 6 and 9 print the tilt angles of their gaits; these are used digit for digit. The paths of
ch. 7 and 8 are in figures that are missing: the paths here have the described shape and color, but
sizes of our choice, and `PublishedGait.printed` is False.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi
from typing import Final, NamedTuple

from tiltsim_controllers.analysis.singularity import margin_over_gait, singular_values
from tiltsim_controllers.analysis.two_color_map import point_p
from tiltsim_controllers.analysis.two_color_planner import (
    Circle,
    Leg,
    Path,
    Polyline,
    four_angle_gait,
    polygon,
    rectangle,
)
from tiltsim_controllers.gaits import plans
from tiltsim_controllers.gaits.colors import colored_angles
from tiltsim_controllers.gaits.plans import Gait
from tiltsim_controllers.vehicle.parameters import PRESETS, Vehicle, drag_ratio

_AR_DRONE: Final = PRESETS["ar_drone_2"]
_P: Final = point_p(_AR_DRONE)
SINGULAR_MARGIN: Final = 1e-6
"""A gait with a smaller margin (rad) counts as singular."""

_PERIOD: Final = 1.0
"""Ch. 6 sets the period to 1 s; the margin over a period does not depend on it."""


class DeterminantCase(NamedTuple):
    """A restriction of ch. 3, Sec. 5.1, and the pairs of angles evaluated."""

    restriction: str
    pairs: tuple[tuple[float, float], ...]  # (alpha_1, alpha_3), rad


DETERMINANT_CASES: Final = {
    "equal": DeterminantCase("α₁ = α₃", tuple((a, a) for a in (-0.15, -0.075, 0.0, 0.075, 0.15))),
    "half": DeterminantCase("α₁ = α₃/2", tuple((a, 2.0 * a) for a in (-0.2, -0.1, 0.0, 0.1, 0.2))),
    "negative": DeterminantCase(
        "α₁ = −α₃", tuple((a, 0.0 - a) for a in (-1.4, -0.7, 0.0, 0.7, 1.4))
    ),
    "negative_half": DeterminantCase(
        "α₁ = −α₃/2", tuple((a, 0.0 - 2.0 * a) for a in (-0.3, -0.15, 0.0, 0.15, 0.3))
    ),
}
"""The four restrictions under which ch. 3 draws the determinant at level attitude."""

TRIANGLE: Final = ((-1.5, 1.5), (1.5, -1.5), (1.0, 1.0))
"""U, V, M of ch. 3, Eq. (22): the region of interest in ``(alpha_2, alpha_4)`` (rad)."""


@dataclass(frozen=True)
class PublishedGait:
    """A gait of the thesis, for its vehicle ``ar_drone_2``."""

    key: str
    gait: Gait
    color: str | None  # red, blue, "red and blue", or None off the map
    printed: bool  # whether the thesis prints the angles
    bias: float | None = None  # [eta] of the biased gait it is compared with
    exact: Gait | None = None  # the gait on the exact lines, where the printed angles are rounded

    @property
    def biased(self) -> Gait | None:
        """The biased gait (ch. 6, Eqs. 12-15; ch. 8, Eqs. 13-16)."""
        return None if self.bias is None else self.gait.biased(self.bias)


def _source(key: str) -> str:
    chapter, number = key.split("_gait_")
    return f"ch. {int(chapter[2:])}, Gait {number}"


def _printed(
    key: str,
    vertices: Sequence[Sequence[float]],
    color: str | None = None,
    bias: float | None = None,
) -> PublishedGait:
    """A gait through four printed vertices, or at one."""

    def through(rows: Sequence[Sequence[float]], name: str) -> Gait:
        if len(rows) == 1:
            return plans.fixed(rows[0], name=name, source=_source(key))
        frames = [(i / 4.0, *rows[i % 4]) for i in range(5)]
        return plans.keyframes(frames, _PERIOD, name=name, source=_source(key))

    exact = None
    if color == "blue":
        ratio = drag_ratio(_AR_DRONE)
        rows = [(a, b, *colored_angles(a, b, "blue", ratio)) for a, b, *_ in vertices]
        exact = through(rows, f"{key}, exact blue")
    return PublishedGait(key, through(vertices, key), color, True, bias, exact)


def _path(key: str, color: str, path: Path) -> PublishedGait:
    source = f"{_source(key)}; size of the path ours"
    gait = four_angle_gait(path, _PERIOD, _AR_DRONE, name=key, source=source)
    return PublishedGait(key, gait, color, printed=False, bias=0.8)


_TRIANGLE: Final = (_P, (0.7, -0.25), (0.25, -0.7), _P)

PATHS: Final[dict[str, Path]] = {
    # ch. 8, Fig. 7 (missing): its caption has the rule that each example follows or violates.
    "E1": polygon(((-0.8, 0.2), (-0.4, 0.8), (-0.75, 0.75)), "red"),
    "E2": polygon(((-0.6, -0.6), (0.7, -0.4), (0.2, 0.8)), "blue"),
    "E3": polygon(((0.3, -0.8), (0.8, -0.3), (0.7, -0.7)), "red"),
    "E4": polygon(((0.3, -0.8), (0.8, -0.3), (0.1, 0.6)), "red"),
}
"""The four examples of the generalized theorem; E4 leaves S_D in red and must be refused."""

PUBLISHED_GAITS: Final = {
    gait.key: gait
    for gait in (
        # ch. 3, Sec. 6.1
        _printed("ch03_gait_1", [(-0.1, 0.1, -0.2, 0.1)]),
        _printed("ch03_gait_2", [(-0.15, -0.1, 0.3, -0.1)]),
        # ch. 6, Sec. 5
        _printed(
            "ch06_gait_1",
            [
                (5 * pi / 16, pi / 8, -0.648, -0.727),
                (5 * pi / 16, 3 * pi / 8, -0.648, -1.512),
                (pi / 16, 3 * pi / 8, 0.138, -1.512),
                (pi / 16, pi / 8, 0.138, -0.727),
            ],
            "blue",
            0.8,
        ),
        _printed(
            "ch06_gait_2",
            [
                (3 * pi / 8, -3 * pi / 8, -0.844, 0.844),
                (3 * pi / 8, -pi / 8, -0.844, 0.059),
                (pi / 8, -pi / 8, -0.059, 0.059),
                (pi / 8, -3 * pi / 8, -0.059, 0.844),
            ],
            "blue",
            0.99,
        ),
        _printed(
            "ch06_gait_3",
            [
                (3 * pi / 8, -3 * pi / 8, 1.178, -1.178),
                (3 * pi / 8, -pi / 8, 1.178, -0.393),
                (pi / 8, -pi / 8, 0.393, -0.393),
                (pi / 8, -3 * pi / 8, 0.393, -1.178),
            ],
            "red",
            0.8,
        ),
        _printed(
            "ch06_gait_4",
            [
                (-pi / 8, pi / 8, -0.393, 0.393),
                (-pi / 8, 3 * pi / 8, -0.393, 1.178),
                (-3 * pi / 8, 3 * pi / 8, -1.178, 1.178),
                (-3 * pi / 8, pi / 8, -1.178, 0.393),
            ],
            "red",
            0.8,
        ),
        # ch. 7, Fig. 4 (missing): rectangles, gait 1 blue, gaits 2 and 3 red
        _path("ch07_gait_1", "blue", rectangle((0.2, 0.8), (-0.8, -0.2), "blue")),
        _path("ch07_gait_2", "red", rectangle((-0.8, -0.2), (0.2, 0.8), "red")),
        _path("ch07_gait_3", "red", rectangle((0.2, 0.8), (-0.8, -0.2), "red")),
        # ch. 8, Fig. 8 (missing): a triangle through P that changes its color there; two circles
        _path(
            "ch08_gait_1", "red and blue", Polyline((Leg("red", _TRIANGLE), Leg("blue", _TRIANGLE)))
        ),
        _path("ch08_gait_2", "red", Circle("red", (0.5, -0.5), 0.3)),
        _path("ch08_gait_3", "blue", Circle("blue", (0.5, -0.5), 0.3)),
        # ch. 9, Eqs. (12)-(19)
        _printed("ch09_gait_1", [(-0.5, -0.5, -0.5, -0.5)], "red"),
        _printed("ch09_gait_2", [(-0.5, 0.5, -0.5, 0.5)], "red"),
        _printed("ch09_gait_3", [(0.5, -0.5, 0.5, -0.5)], "red"),
        _printed("ch09_gait_4", [(0.5, 0.5, 0.5, 0.5)], "red"),
        _printed("ch09_gait_5", [(-0.5, -0.5, 0.834, 0.166)], "blue"),
        _printed("ch09_gait_6", [(-0.5, 0.5, 0.834, -0.834)], "blue"),
        _printed("ch09_gait_7", [(0.5, -0.5, -0.166, 0.166)], "blue"),
        _printed("ch09_gait_8", [(0.5, 0.5, -0.166, -0.834)], "blue"),
    )
}
"""Every gait of ch. 3 and 6 to 9 that the thesis names."""


@dataclass(frozen=True)
class Robustness:
    """Robustness of a published gait over one period at level attitude."""

    key: str
    color: str | None
    printed: bool
    margin: float  # rad, of the angles as printed
    margin_exact: float  # rad, on the exact lines of the map
    margin_biased: float | None  # rad, of the biased gait
    conditioning: float  # minimum of smallest over largest singular value of tau, exact lines
    claim_holds: bool | None  # "more robust than its biased gait"; None where not compared


def smallest_margin(gait: Gait, vehicle: Vehicle) -> float:
    """Minimum margin (rad) at level attitude over a period, negative after R changes sign."""
    return float(margin_over_gait(gait.angles(gait.sample_times(401)), vehicle).min())


def robustness(published: PublishedGait) -> Robustness:
    """Compare a published gait with its exact lines and its biased gait."""
    exact = published.exact or published.gait
    angles = exact.angles(exact.sample_times(401))
    values = singular_values(angles, _AR_DRONE)
    margin_exact = smallest_margin(exact, _AR_DRONE)
    biased = published.biased
    margin_biased = None if biased is None else smallest_margin(biased, _AR_DRONE)
    return Robustness(
        key=published.key,
        color=published.color,
        printed=published.printed,
        margin=smallest_margin(published.gait, _AR_DRONE),
        margin_exact=margin_exact,
        margin_biased=margin_biased,
        conditioning=float((values[:, 2] / values[:, 0]).min()),
        claim_holds=None
        if margin_biased is None
        else margin_exact > SINGULAR_MARGIN and margin_exact > margin_biased,
    )


def robustness_table() -> list[Robustness]:
    """`robustness` of every published gait, in the order of the thesis."""
    return [robustness(published) for published in PUBLISHED_GAITS.values()]
