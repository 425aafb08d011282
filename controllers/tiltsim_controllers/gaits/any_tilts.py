"""Gaits of any number of tilts: fixed angles, waypoints and tables, all in the knots.

Four tilts have every gait of `tiltsim_controllers.gaits.tilts`, with fixed angles in the record.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import floor
from typing import Final, NamedTuple

from tiltsim_controllers.gaits.anticipation import anticipated_tilts, rounded_corner
from tiltsim_controllers.gaits.keyframes import keyframe_segment
from tiltsim_controllers.gaits.parameters import FIXED, KEYFRAMES, TABLE, GaitParameters
from tiltsim_controllers.gaits.tabulated import COEFFICIENTS, segment_jet
from tiltsim_controllers.gaits.tilts import moving_tilts, planned_jets
from tiltsim_controllers.mathematics.jets import Jet, jet_scaled
from tiltsim_controllers.mathematics.scalar import Values, Vector, scalar
from tiltsim_controllers.mathematics.splines import row_at
from tiltsim_controllers.mathematics.vectors import componentwise

Jets = tuple[Jet, ...]


class TiltMotion(NamedTuple):
    """Scalar functions of a gait: jets of the tilt angles, rad and s."""

    planned: Callable[..., Jets]  # (time, gait, knots)
    anticipated: Callable[..., Jets]
    """``(time, gait, knots, half)``, with corners rounded as in `anticipated_tilts`."""
    moving: Callable[..., tuple[Values, Values]]  # (time, gait, knots): planned angles and rates


CLOSED_FORMS: Final = {4: TiltMotion(planned_jets, anticipated_tilts, moving_tilts)}
"""By the number of tilts: those with the gaits of the thesis."""


@scalar
def _fixed_jet(tilt: int, scale: float, knots: Vector) -> Jet:
    return scale * knots[tilt], 0.0, 0.0


@scalar
def _keyframe_jet(
    tilt: int, start: int, stop: int, part: float, per_second: float, scale: float, knots: Vector
) -> Jet:
    """Between the keyframes that begin at two indices."""
    first = knots[start + 1 + tilt]
    step = knots[stop + 1 + tilt] - first
    return scale * (first + part * step), scale * (per_second * step), 0.0


@scalar
def _table_jet(tilt: int, since: float, start: int, scale: float, knots: Vector) -> Jet:
    return jet_scaled(scale, segment_jet(since, start + 1 + COEFFICIENTS * tilt, knots))


@scalar
def _rounded(before: Jet, after: Jet, half: float) -> Jet:
    return rounded_corner(before[0], before[1], after[0], after[1], half)


@cache
def tilt_motion_of(tilts: int) -> TiltMotion:
    """The functions of gaits of a number of tilts, 0 or more."""
    if tilts in CLOSED_FORMS:
        return CLOSED_FORMS[tilts]
    keyframe_size, table_size = 1 + tilts, 1 + COEFFICIENTS * tilts

    def each(name: str, arguments: str, jet: Callable[..., Jet]) -> Callable[..., Jets]:
        return componentwise(name, arguments, f"jet(@, {arguments})", tilts, jet=jet)

    fixed_jets = each("fixed_jets", "scale, knots", _fixed_jet)
    keyframe_jets = each(
        "keyframe_jets", "start, stop, part, per_second, scale, knots", _keyframe_jet
    )
    table_jets = each("table_jets", "since, start, scale, knots", _table_jet)
    rounded_jets: Callable[..., Jets] = componentwise(
        "rounded_jets", "before, after, half", "rounded(before#, after#, half)", tilts,
        rounded=_rounded,
    )  # fmt: skip
    angles_of = componentwise("angles_of_jets", "jets", "jets#[0]", tilts)
    rates_of = componentwise("rates_of_jets", "jets", "jets#[1]", tilts)

    @scalar
    def planned(time: float, gait: GaitParameters, knots: Vector) -> Jets:
        if gait.type == KEYFRAMES:
            start, part, per_second = keyframe_segment(
                time, gait.period, gait.keyframes, keyframe_size, knots
            )
            stop = start + keyframe_size
            return keyframe_jets(start, stop, part, per_second, gait.scale, knots)
        if gait.type == TABLE:
            if gait.repeats != 0.0:
                time -= floor(time / gait.period) * gait.period
            row = table_size * row_at(time, int(gait.keyframes), 0, table_size, knots)
            return table_jets(max(0.0, time - knots[row]), row, gait.scale, knots)
        return fixed_jets(gait.scale, knots)

    @scalar
    def anticipated(time: float, gait: GaitParameters, knots: Vector, half: float) -> Jets:
        if half <= 0.0 or gait.type == FIXED or gait.type == TABLE:
            return planned(time, gait, knots)
        before, after = planned(time - half, gait, knots), planned(time + half, gait, knots)
        return rounded_jets(before, after, half)

    @scalar
    def moving(time: float, gait: GaitParameters, knots: Vector) -> tuple[Values, Values]:
        jets = planned(time, gait, knots)
        return angles_of(jets), rates_of(jets)

    return TiltMotion(planned, anticipated, moving)
