"""Gaits planned on the Two Color Map: check a path, then give its four angles (ch. 6 and 8).

A path is a closed curve in the alpha_1-alpha_2 plane with a color on every part. Two published
theorems give conditions:

* the Two Color Map Theorem (ch. 6, Theorem 1): ``alpha_1`` and ``alpha_2`` move one at a time and
  the color stays;
* the generalized theorem (ch. 8, Sec. 3): any continuous path within ``|alpha| <= 1``; red stays on
  its side of the curve L; the color changes only at P.

Both accept blue anywhere. An accepted path can still be singular, a warning of `PathReport`: blue
has rank 2 at every attitude (`tiltsim_controllers.analysis.two_color_map`), and P lies on L.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from math import hypot, isfinite, pi
from typing import Final, Literal, NamedTuple, TypeAlias

import numpy as np

from tiltsim_controllers.analysis.two_color_map import point_p, red_residual
from tiltsim_controllers.code.arrays import is_known, xp
from tiltsim_controllers.gaits import plans
from tiltsim_controllers.gaits.colors import colored_angles, require_color
from tiltsim_controllers.gaits.plans import Gait
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.parameters import Vehicle, drag_ratio

Point: TypeAlias = tuple[float, float]
Theorem = Literal["two_color", "generalized"]

GENERALIZED_LIMIT: Final = 1.0
"""The generalized theorem holds for ``|alpha_1|, |alpha_2|`` up to this (rad; ch. 8, Eq. 3)."""

BLUE_WARNING: Final = "blue: tau has rank 2, the decoupling matrix is singular at every attitude"
SWITCH_WARNING: Final = (
    "color switch at P: P lies on the curve L, the decoupling matrix is singular there"
)

_SAMPLES: Final = 257
_SAME_POINT: Final = 1e-9


class Leg(NamedTuple):
    """A part of a path in one color: straight lines through vertices (rad)."""

    color: str
    vertices: tuple[Point, ...]


@dataclass(frozen=True)
class Polyline:
    """A closed path of legs; each starts at the end of the previous one."""

    legs: tuple[Leg, ...]


@dataclass(frozen=True)
class Circle:
    """A circular path in one color (ch. 8, Sec. 4), counterclockwise; rad."""

    color: str
    centre: Point
    radius: float


Path: TypeAlias = Polyline | Circle


@dataclass(frozen=True)
class PathReport:
    """The result of checking a path."""

    theorem: Theorem | None  # the narrower published theorem that accepts it; None: refused
    reasons: tuple[str, ...]  # for refusing it
    crossings: tuple[Point, ...]  # where red crosses L (rad)
    warnings: tuple[str, ...]  # singularities that the theorems do not consider

    @property
    def accepted(self) -> bool:
        """Whether a published theorem calls the path robust."""
        return self.theorem is not None

    @property
    def sound(self) -> bool:
        """Whether a published theorem accepts the path and it is nowhere singular."""
        return self.accepted and not self.warnings


def rectangle(alpha_1: Point, alpha_2: Point, color: str) -> Polyline:
    """The rectangle between two values of ``alpha_1`` and two of ``alpha_2`` (rad; ch. 6, 7)."""
    (left, right), (lower, upper) = alpha_1, alpha_2
    corners = ((left, lower), (right, lower), (right, upper), (left, upper), (left, lower))
    return Polyline((Leg(color, corners),))


def polygon(vertices: tuple[Point, ...], color: str) -> Polyline:
    """A closed path through the vertices (rad) in one color."""
    return Polyline((Leg(color, (*vertices, vertices[0])),))


def check_path(path: Path, vehicle: Vehicle) -> PathReport:
    """Check a path by both published theorems, and for singularities they do not consider.

    Raises:
        ValueError: If the path has no extent, a number is not finite, or a color is unknown.
    """
    pieces = _pieces(path)
    joints = _joints(path)
    p = point_p(vehicle)
    reasons: list[str] = []
    for end, start, before, after in joints:
        if not _coincide(end, start):
            reasons.append(f"broken at {_text(end)}: the next part starts at {_text(start)}")
        elif before != after and not _coincide(start, p):
            reasons.append(
                f"color changes at {_text(start)}: the colors meet at P = {_text(p)} alone"
            )
    crossings = _distinct(
        [
            crossing
            for color, point in pieces
            if color == "red"
            for crossing in _crossings(point, p, vehicle)
        ]
    )
    if crossings:
        places = ", ".join(map(_text, crossings))
        reasons.append(f"red crosses the curve L (R = 0) at {places}")

    points = np.concatenate([point(np.linspace(0.0, 1.0, _SAMPLES)) for _, point in pieces])
    reach = float(np.abs(points).max())
    if reach >= pi / 2:
        reasons.append(f"reaches |alpha| = {reach:.3f}: must stay below pi/2")
    switches = any(before != after for _, _, before, after in joints)
    theorem: Theorem | None = None
    if not reasons:
        if _moves_one_at_a_time(path) and not switches:
            theorem = "two_color"
        elif reach <= GENERALIZED_LIMIT:
            theorem = "generalized"
        else:
            reasons.append(
                f"reaches |alpha| = {reach:.3f}: the generalized theorem holds up to "
                f"{GENERALIZED_LIMIT:g}, beyond it alpha_1 and alpha_2 must move one at a time"
            )
    warnings = [BLUE_WARNING] if any(color == "blue" for color, _ in pieces) else []
    if switches:
        warnings.append(SWITCH_WARNING)
    return PathReport(theorem, tuple(reasons), crossings, tuple(warnings))


def four_angle_gait(
    path: Path, period: float, vehicle: Vehicle, *, name: str = "two_color", source: str = ""
) -> Gait:
    """The four-angle gait that follows a path, which is not checked, at constant speed.

    Args:
        path: in the alpha_1-alpha_2 plane
        period: s
        vehicle: its drag ratio sets the offset of the blue lines
        name, source: name and origin of the gait

    Raises:
        ValueError: If a color is unknown, the path has no length, or the period is not positive.
    """
    ratio = drag_ratio(vehicle)
    if isinstance(path, Circle):
        (first, second), radius = path.centre, path.radius
        third, fourth = colored_angles(first, second, path.color, ratio)
        along = radius if path.color == "red" else -radius
        return plans.harmonic(
            (first, radius, 0.0, second, 0.0, radius, third, along, 0.0, fourth, 0.0, along),
            *(period, name, source),
        )
    lengths = [
        xp.hypot(end[0] - start[0], end[1] - start[1])
        for leg in path.legs
        for start, end in pairwise(leg.vertices)
    ]
    total = sum(lengths)
    if is_known(total) and not total > 0.0:
        raise ValueError("the path has no length: use a fixed gait")
    covered = 0.0
    rows: list[tuple[float, ...]] = []
    steps = iter(lengths)
    for leg in path.legs:
        require_color(leg.color)
        for index, (first, second) in enumerate(leg.vertices):
            if index:
                covered += next(steps)
            elif rows:
                continue  # the end of the previous leg, with the same four angles
            back = colored_angles(first, second, leg.color, ratio)
            rows.append((covered / total, first, second, *back))
    rows[-1] = (1.0, *rows[-1][1:])
    return plans.keyframes(rows, period, name=name, source=source)


class _Piece(NamedTuple):
    color: str
    point: Callable[[Floats], Floats]  # shares of the piece (N,) to points (N, 2), rad


def _pieces(path: Path) -> list[_Piece]:
    """The path as smooth pieces; raises ValueError for an invalid path."""
    if isinstance(path, Circle):
        require_color(path.color)
        if not (all(map(isfinite, (*path.centre, path.radius))) and path.radius > 0.0):
            raise ValueError(
                f"circle at {path.centre}, radius {path.radius}: the radius must be positive, all "
                "finite"
            )

        def around(share: Floats) -> Floats:
            turn = 2.0 * pi * share[:, np.newaxis]
            offset = np.concatenate([np.cos(turn), np.sin(turn)], axis=1)
            return np.asarray(path.centre + path.radius * offset)

        return [_Piece(path.color, around)]

    pieces = []
    for leg in path.legs:
        require_color(leg.color)
        if len(leg.vertices) < 2 or not np.isfinite(leg.vertices).all():
            raise ValueError(f"{leg.color} leg {list(leg.vertices)}: needs two finite points")
        for start, end in pairwise(leg.vertices):

            def along(share: Floats, start: Point = start, end: Point = end) -> Floats:
                share = share[:, np.newaxis]
                return np.asarray((1.0 - share) * np.array(start) + share * np.array(end))

            pieces.append(_Piece(leg.color, along))
    if not pieces:
        raise ValueError("the path has no legs")
    return pieces


def _joints(path: Path) -> list[tuple[Point, Point, str, str]]:
    """``(end, next start, color, next color)`` of successive legs, the last one to the first."""
    if isinstance(path, Circle):
        return []
    following = (*path.legs[1:], path.legs[0])
    return [
        (leg.vertices[-1], after.vertices[0], leg.color, after.color)
        for leg, after in zip(path.legs, following, strict=True)
    ]


def _moves_one_at_a_time(path: Path) -> bool:
    return isinstance(path, Polyline) and all(
        start[0] == end[0] or start[1] == end[1]
        for leg in path.legs
        for start, end in pairwise(leg.vertices)
    )


def _crossings(point: Callable[[Floats], Floats], p: Point, vehicle: Vehicle) -> list[Point]:
    """Where ``R`` on red changes sign or touches zero along a piece, P excepted."""
    from scipy.optimize import brentq, minimize_scalar

    def residual(share: float) -> float:
        first, second = point(np.array([share]))[0]
        return float(red_residual(first, second, vehicle))

    shares = np.linspace(0.0, 1.0, _SAMPLES)
    points = point(shares)
    values = red_residual(points[:, 0], points[:, 1], vehicle)
    # Close to zero without a change of sign: the path may cross twice between two samples.
    side = np.sign(values[np.abs(values).argmax()])
    depth = side * values
    dips = np.flatnonzero((depth[1:-1] <= depth[:-2]) & (depth[1:-1] <= depth[2:])) + 1
    for dip in dips:
        bounds = (shares[dip - 1], shares[dip + 1])
        lowest = minimize_scalar(
            lambda share: side * residual(share), bounds=bounds, options={"xatol": 1e-10}
        )
        shares = np.append(shares, float(lowest.x))
    shares = np.unique(shares)
    values = np.array([residual(share) for share in shares])

    zero = 1e-9 / drag_ratio(vehicle)
    found = shares[np.abs(values) < zero].tolist()
    for index in np.flatnonzero(values[1:] * values[:-1] < 0.0):
        if min(abs(values[index]), abs(values[index + 1])) >= zero:
            found.append(float(brentq(residual, shares[index], shares[index + 1], xtol=1e-14)))
    places: list[Point] = []
    for share in sorted(found):
        first, second = map(float, point(np.array([share]))[0])
        # ch. 8 considers P a point below L and allows red there.
        if not _coincide((first, second), p):
            places.append((first, second))
    return places


def _distinct(places: list[Point]) -> tuple[Point, ...]:
    """Without duplicates: a crossing at a vertex belongs to both of its lines."""
    distinct: list[Point] = []
    for place in places:
        if not any(hypot(place[0] - k[0], place[1] - k[1]) < 1e-6 for k in distinct):
            distinct.append(place)
    return tuple(distinct)


def _coincide(first: Point, second: Point) -> bool:
    return hypot(first[0] - second[0], first[1] - second[1]) < _SAME_POINT


def _text(point: Point) -> str:
    return f"({point[0]:.6f}, {point[1]:.6f})"
