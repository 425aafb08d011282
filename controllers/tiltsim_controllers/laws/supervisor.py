"""A supervisor that keeps a planned gait away from singular decoupling matrices.

The matrix is singular where ``n(alpha) . r3 = 0`` (`vehicle.decoupling_matrix`). The supervisor
keeps two numbers above their thresholds: the singularity margin (rad, the distance of the attitude
from a singular one) and the determinant ``n . r3`` itself (4 for a level untilted vehicle). Only
the determinant shows that a gait approaches the curve L of the Two Color Map, where ``n`` vanishes
whatever its direction. There are three strategies.

* ``SCALE`` scales all tilt angles towards zero, where ``n`` is vertical, as little as satisfies
  both thresholds. A function of planned angles and attitude, without memory.
* ``HOLD`` looks ahead and slows the gait's clock until it stops where the thresholds would be
  violated at the present attitude; it continues when they would not. Its state is the delay (s) of
  the gait behind its plan.
* ``RETURN_TO_RED`` looks ahead, too, and moves the tilts from the planned gait towards the nearest
  red one (`gaits.red_gait`), where ``n`` is vertical, at a rate that servos can follow, and back
  when the thresholds allow. Its state is the fraction of the path.

The last two have a state and its rate, which start at rest and stay exactly zero while the
thresholds are not approached: such a flight is bit-identical to the unsupervised one. Both are
states of the simulation, and everything else is a pure function of them, time and attitude, so that
a saved state restarts and the same source runs in every engine. The rate has a lag, so that the
tilts have accelerations for the controllers that use them.
"""

from __future__ import annotations

from math import asin, pi, sqrt
from typing import Final, NamedTuple

from tiltsim_controllers.gaits.parameters import GaitParameters, TiltsAndRates
from tiltsim_controllers.gaits.red_gait import nearest_red_angles
from tiltsim_controllers.gaits.tilts import planned_jets
from tiltsim_controllers.mathematics.jets import Jet, Jets4, jet_product, jet_scaled, jet_sum
from tiltsim_controllers.mathematics.rotation import world_up_in_body
from tiltsim_controllers.mathematics.scalar import Quad, Triple, Vector, scalar
from tiltsim_controllers.vehicle.decoupling_matrix import (
    sines_and_cosines,
    torque_entries,
    torque_free_force,
)
from tiltsim_controllers.vehicle.parameters import Vehicle, drag_ratio

SCALE: Final = 0.0
HOLD: Final = 1.0
RETURN_TO_RED: Final = 2.0

STRATEGIES: Final = {"scale": SCALE, "hold": HOLD, "return_to_red": RETURN_TO_RED}
"""Strategies by their name in a scenario."""

SCALE_GRID: Final = 16
"""Intervals of the scale that are checked, from zero to the whole gait."""

BISECTIONS: Final = 20
"""Bisections of the last interval: the scale is exact to 1e-7."""

LOOKAHEAD_SAMPLES: Final = 8
"""Instants ahead at which the gait is checked, evenly spaced up to the horizon."""

BAND: Final = 0.1
"""`threshold_clearance` from which the clock of ``HOLD`` slows down, to stop at zero.

As much below zero ``RETURN_TO_RED`` has full speed: it undershoots a threshold by up to this, times
the share of the maximum tilt rate that the gait requires.
"""

LAG: Final = 0.025
"""Time constant of the supervisor's rate, s."""

NEAR: Final = 0.05
"""rad: the distance from red, for the speed of the return, is at least this."""

SUPERVISOR_AT_REST: Final = (0.0, 0.0, 0.0)
"""State, rate and acceleration of a supervisor that does not act."""


class Supervisor(NamedTuple):
    """Thresholds, both 0 for no supervisor, and strategy."""

    min_margin: float = 0.0  # rad, below a right angle
    min_determinant: float = 0.0  # 4 for a level untilted vehicle
    strategy: float = SCALE
    horizon: float = 0.0  # s of the gait to look ahead
    max_rate: float = 0.0  # rad/s, of the fastest tilt on the way to red and back
    clearance: float = 0.0  # rad, of red gaits from the curve L


@scalar
def margin_and_determinant(tilts: Quad, up: Triple, drag_ratio: float) -> tuple[float, float]:
    """Singularity margin (rad) and determinant of ``tilts`` (rad); ``up`` is `world_up_in_body`."""
    trig = sines_and_cosines(tilts[0], tilts[1], tilts[2], tilts[3])
    nx, ny, nz = torque_free_force(trig, torque_entries(trig, drag_ratio), drag_ratio)
    along = nx * up[0] + ny * up[1] + nz * up[2]
    length = sqrt(nx * nx + ny * ny + nz * nz)
    if length == 0.0:
        return 0.0, 0.0
    return asin(min(1.0, max(-1.0, along / length))), along


# --- scale -------------------------------------------------------------------------------------


@scalar
def _is_allowed(
    scale: float, tilts: Quad, up: Triple, supervisor: Supervisor, drag_ratio: float
) -> bool:
    """Whether the tilts times ``scale`` satisfy the thresholds."""
    a1, a2, a3, a4 = tilts
    scaled = (scale * a1, scale * a2, scale * a3, scale * a4)
    margin, determinant = margin_and_determinant(scaled, up, drag_ratio)
    return margin >= supervisor.min_margin and determinant >= supervisor.min_determinant


@scalar
def allowed_scale(
    tilts: Quad, roll: float, pitch: float, supervisor: Supervisor, drag_ratio: float
) -> float:
    """The largest scale such that it and every smaller one satisfy the thresholds.

    0 where not even the untilted vehicle satisfies them, as it leans too far.

    Args:
        tilts: planned tilt angles, rad
        roll, pitch: rad
        supervisor: thresholds
        drag_ratio: ``r = K_m / (L K_f)``
    """
    up = world_up_in_body(roll, pitch)
    low, high = 0.0, 1.0
    for step in range(SCALE_GRID + 1):
        high = step / SCALE_GRID
        if not _is_allowed(high, tilts, up, supervisor, drag_ratio):
            break
        low = high
    if low == high or high == 0.0:
        return low
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if _is_allowed(middle, tilts, up, supervisor, drag_ratio):
            low = middle
        else:
            high = middle
    return low


@scalar
def supervised_gait_scale(
    planned: TiltsAndRates, roll: float, pitch: float, supervisor: Supervisor, vehicle: Vehicle
) -> float:
    """The factor of a planned gait at an attitude, 1 unless the strategy is ``SCALE``.

    Args:
        planned: `tiltsim_controllers.gaits.tilts.tilt_reference`
        roll, pitch: rad
        supervisor, vehicle: thresholds and drag ratio
    """
    if supervisor.strategy != SCALE:
        return 1.0
    if supervisor.min_margin <= 0.0 and supervisor.min_determinant <= 0.0:
        return 1.0
    tilts = planned[0], planned[1], planned[2], planned[3]
    return allowed_scale(tilts, roll, pitch, supervisor, drag_ratio(vehicle))


# --- hold and return -----------------------------------------------------------------------------


@scalar
def threshold_clearance(
    tilts: Quad, up: Triple, supervisor: Supervisor, drag_ratio: float
) -> float:
    """Distance above the thresholds relative to the largest possible; negative below them.

    Args:
        tilts: rad
        up: `world_up_in_body`
        supervisor: thresholds
        drag_ratio: ``r = K_m / (L K_f)``
    """
    margin, determinant = margin_and_determinant(tilts, up, drag_ratio)
    return min(
        (margin - supervisor.min_margin) / (0.5 * pi - supervisor.min_margin),
        (determinant - supervisor.min_determinant) / (4.0 - supervisor.min_determinant),
    )


@scalar
def gait_time(time: float, motion: Triple, supervisor: Supervisor) -> float:
    """The time (s) of the gait's clock, which the strategy ``HOLD`` delays."""
    return time - motion[0] if supervisor.strategy == HOLD else time


@scalar
def _on_clock(tilt: Jet, motion: Triple) -> Jet:
    """A tilt on the gait's clock as a function of time: the clock runs at one minus the rate."""
    speed = 1.0 - motion[1]
    return tilt[0], tilt[1] * speed, tilt[2] * speed * speed - tilt[1] * motion[2]


@scalar
def _blend(tilt: Jet, red: Jet, share: Jet) -> Jet:
    """A tilt moved by a fraction of the path to red."""
    return jet_sum(1.0, tilt, 1.0, jet_product(share, jet_sum(1.0, red, -1.0, tilt)))


@scalar
def supervised_tilts(
    planned: Jets4, scale: float, motion: Triple, supervisor: Supervisor, drag_ratio: float
) -> Jets4:
    """The supervised tilts with rates and accelerations, rad and s.

    Args:
        planned: the gait at its `gait_time`
        scale: `supervised_gait_scale`
        motion: the supervisor's state with its rate and acceleration
        supervisor: strategy and clearance
        drag_ratio: ``r = K_m / (L K_f)``
    """
    a1, a2, a3, a4 = planned
    if supervisor.strategy == HOLD:
        m = motion
        return _on_clock(a1, m), _on_clock(a2, m), _on_clock(a3, m), _on_clock(a4, m)
    if supervisor.strategy == RETURN_TO_RED:
        r1, r2 = nearest_red_angles(planned, drag_ratio, supervisor.clearance)
        m = motion
        return _blend(a1, r1, m), _blend(a2, r2, m), _blend(a3, r1, m), _blend(a4, r2, m)
    k = scale
    return jet_scaled(k, a1), jet_scaled(k, a2), jet_scaled(k, a3), jet_scaled(k, a4)


@scalar
def _min_clearance_ahead(
    time: float,
    up: Triple,
    state: float,
    gait: GaitParameters,
    knots: Vector,
    supervisor: Supervisor,
    drag_ratio: float,
) -> float:
    """The smallest `threshold_clearance` up to the horizon at the supervisor's present state."""
    smallest = 1.0
    frozen = (state, 0.0, 0.0)
    start = gait_time(time, frozen, supervisor)
    for sample in range(LOOKAHEAD_SAMPLES + 1):
        ahead = start + supervisor.horizon * sample / LOOKAHEAD_SAMPLES
        a1, a2, a3, a4 = supervised_tilts(
            planned_jets(ahead, gait, knots), 1.0, frozen, supervisor, drag_ratio
        )
        tilts = (a1[0], a2[0], a3[0], a4[0])
        smallest = min(smallest, threshold_clearance(tilts, up, supervisor, drag_ratio))
    return smallest


@scalar
def _return_speed(
    time: float, gait: GaitParameters, knots: Vector, supervisor: Supervisor, drag_ratio: float
) -> float:
    """Rate (1/s) along the path to red at which the fastest tilt has its maximum rate."""
    a1, a2, a3, a4 = planned = planned_jets(time, gait, knots)
    red_1, red_2 = nearest_red_angles(planned, drag_ratio, supervisor.clearance)
    front = max(abs(red_1[0] - a1[0]), abs(red_2[0] - a2[0]))
    rear = max(abs(red_1[0] - a3[0]), abs(red_2[0] - a4[0]))
    return supervisor.max_rate / max(front, rear, NEAR)


@scalar
def supervised_derivative(
    time: float,
    roll: float,
    pitch: float,
    state: float,
    rate: float,
    gait: GaitParameters,
    knots: Vector,
    supervisor: Supervisor,
    drag_ratio: float,
) -> Triple:
    """The supervisor's state, its rate and the resulting acceleration.

    ``HOLD``: the clock runs (rate 0) with sufficient clearance and stops (rate 1) without any.
    ``RETURN_TO_RED``: towards red where the thresholds would be violated, back where they allow it,
    slowing down towards both ends.

    Args:
        time: s
        roll, pitch: rad
        state, rate: of the supervisor, s or a fraction
        gait, knots: as for `tilt_reference`
        supervisor: thresholds and strategy
        drag_ratio: ``r = K_m / (L K_f)``
    """
    up = world_up_in_body(roll, pitch)
    smallest = _min_clearance_ahead(time, up, state, gait, knots, supervisor, drag_ratio)
    if supervisor.strategy == HOLD:
        desired = 1.0 - min(1.0, max(0.0, smallest / BAND))
    else:
        speed = _return_speed(time, gait, knots, supervisor, drag_ratio)
        desired = -speed * min(1.0, max(-1.0, smallest / BAND))
        # Four lags: the motion to either end is critically damped.
        desired = min((1.0 - state) / (4.0 * LAG), max(-state / (4.0 * LAG), desired))
    return state, rate, (desired - rate) / LAG
