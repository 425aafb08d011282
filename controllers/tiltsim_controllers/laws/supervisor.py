"""A supervisor that keeps a planned gait away from singular decoupling matrices.

It keeps two numbers above their thresholds: the singularity margin (rad, the distance of the
attitude from a singular one) and the determinant of the matrix, scaled to that of the level
untilted tiltrotor, `UNTILTED`. Only the determinant shows that a gait approaches tilt angles at
which every attitude is singular. What they are is the vehicle's
(`tiltsim_controllers.laws.tiltrotor_supervisor`, ``multirotor_supervisor``). There are three
strategies.

* ``SCALE`` scales all tilt angles towards zero as little as satisfies both thresholds. A function
  of planned angles and attitude, without memory.
* ``HOLD`` looks ahead and slows the gait's clock until it stops where the thresholds would be
  violated; it continues when they would not. Its state is the delay (s) of the gait behind its
  plan.
* ``RETURN_TO_RED`` looks ahead, too, and moves the tilts from the planned gait towards the nearest
  red one (`gaits.red_gait`), at a rate that servos can follow, and back when the thresholds allow.
  Its state is the fraction of the path. Only the tiltrotor has red gaits.

The last two have a state and its rate, which start at rest and stay exactly zero while the
thresholds are not approached: such a flight is bit-identical to the unsupervised one. They look at
tilts ahead at the attitude that the vehicle will have there: it leans with the direction of its
force as the tilts move, but not within a jump, which it meets as it leans before. Both are
states of the simulation, and everything else is a pure function of them, time and attitude, so that
a saved state restarts and the same source runs in every engine. The rate has a lag, so that the
tilts have accelerations for the controllers that use them.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, pi, sqrt
from typing import Any, Final, NamedTuple

from tiltsim_controllers.gaits.motion import Jets, tilt_motion_of
from tiltsim_controllers.gaits.parameters import NO_KNOTS, GaitParameters
from tiltsim_controllers.mathematics.jets import Jet, jet_scaled
from tiltsim_controllers.mathematics.rotation import world_up_in_body
from tiltsim_controllers.mathematics.scalar import Triple, Values, Vector, scalar
from tiltsim_controllers.mathematics.vectors import componentwise, vectors_of
from tiltsim_controllers.vehicle.rigid_body import cross

SCALE: Final = 0.0
HOLD: Final = 1.0
RETURN_TO_RED: Final = 2.0

STRATEGIES: Final = {"scale": SCALE, "hold": HOLD, "return_to_red": RETURN_TO_RED}
"""Strategies by their name in a scenario."""

SCALE_GRID: Final = 16
"""Intervals of the scale that are checked, from the whole gait to none."""

BISECTIONS: Final = 20
"""Bisections of the last interval: the scale is exact to 1e-7."""

LOOKAHEAD_SAMPLES: Final = 8
"""Instants ahead at which the gait is checked, evenly spaced up to the horizon."""

FOLLOWED: Final = 0.0625
"""Time (s of the gait) by which the lean follows the tilts; less if samples are closer."""

BAND: Final = 0.1
"""`threshold_clearance` from which the clock of ``HOLD`` slows down, to stop at zero.

As much below zero ``RETURN_TO_RED`` has full speed: it undershoots a threshold by up to this, times
the share of the maximum tilt rate that the gait requires.
"""

LAG: Final = 0.025
"""Time constant of the supervisor's rate, s."""

UNTILTED: Final = 4.0
"""The determinant of the level untilted tiltrotor (ch. 3), and with it that of other vehicles."""

SUPERVISOR_AT_REST: Final = (0.0, 0.0, 0.0)
"""State, rate and acceleration of a supervisor that does not act."""


class Supervisor(NamedTuple):
    """Thresholds, both 0 for no supervisor, and strategy."""

    min_margin: float = 0.0  # rad, below a right angle
    min_determinant: float = 0.0  # `UNTILTED` for a level untilted vehicle
    strategy: float = SCALE
    horizon: float = 0.0  # s of the gait to look ahead
    max_rate: float = 0.0  # rad/s, of the fastest tilt on the way to red and back
    clearance: float = 0.0  # rad, of red gaits from the curve L


Assessment = tuple[float, float, Triple]
"""Margin (rad), determinant (`UNTILTED` at best), and the direction (body axes, of any length and
sense) that keeps its attitude in hover."""


class WayBack(NamedTuple):
    """Scalar code of the gait to which a vehicle's tilts can return."""

    tilts: Callable[..., Jets]
    """``(planned, motion, supervisor, vehicle)``: the planned tilts, moved by a fraction."""
    speed: Callable[..., float]
    """``(planned, supervisor, vehicle)``: rate (1/s) along the way at the maximum tilt rate."""


@scalar
def _as_planned(planned: Jets, motion: Triple, supervisor: Supervisor, vehicle: Any) -> Jets:
    return planned


@scalar
def _standing(planned: Jets, supervisor: Supervisor, vehicle: Any) -> float:
    return 0.0


NO_WAY_BACK: Final = WayBack(_as_planned, _standing)
"""For vehicles without `RETURN_TO_RED`, which is refused for them."""


class Supervision(NamedTuple):
    """Scalar code of a supervisor of vehicles with the same tilts.

    ``vehicle`` is what ``assess`` reads of a vehicle besides the ``knots``; tilt angles, roll and
    pitch are in rad.
    """

    assess: Callable[..., Assessment]
    """``(tilts, up, vehicle, knots)``; ``up`` as `world_up_in_body` returns it."""
    clearance: Callable[..., float]
    """``(tilts, up, supervisor, vehicle, knots)``: distance above the thresholds relative to the
    largest possible; negative below them."""
    allowed_scale: Callable[..., float]
    """``(tilts, roll, pitch, supervisor, vehicle, knots)``: the largest scale in [0, 1] that
    satisfies the thresholds, or that of the grid which comes nearest where none does. A range of
    scales between two of the grid may pass unseen."""
    gait_scale: Callable[..., float]
    """As ``allowed_scale``, and 1 unless the strategy is `SCALE`."""
    tilts: Callable[..., Jets]
    """``(planned, scale, motion, supervisor, vehicle)``: the supervised tilts with rates and
    accelerations (rad, s): of the gait at its `gait_time`, the ``gait_scale``, and the supervisor's
    state with its rate and acceleration."""
    derivative: Callable[..., Triple]
    """``(time, roll, pitch, state, rate, gait, knots, supervisor, vehicle)``: the supervisor's
    state (s or a fraction), its rate and the resulting acceleration."""


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
def _relative_clearance(margin: float, determinant: float, supervisor: Supervisor) -> float:
    """The distance above the thresholds, as `Supervision.clearance`."""
    return min(
        (margin - supervisor.min_margin) / (0.5 * pi - supervisor.min_margin),
        (determinant - supervisor.min_determinant) / (UNTILTED - supervisor.min_determinant),
    )


@scalar
def turned_along(up: Triple, start: Triple, end: Triple) -> Triple:
    """A direction turned by the least rotation between two lines, if both have a length."""
    size = sqrt(
        (start[0] * start[0] + start[1] * start[1] + start[2] * start[2])
        * (end[0] * end[0] + end[1] * end[1] + end[2] * end[2])
    )
    if not size > 0.0:
        return up
    along = (start[0] * end[0] + start[1] * end[1] + start[2] * end[2]) / size
    if along < 0.0:
        along, size = -along, -size
    x, y, z = cross(start, end)
    axis = x / size, y / size, z / size  # times the sine of the angle
    turned = cross(axis, up)
    share = (axis[0] * up[0] + axis[1] * up[1] + axis[2] * up[2]) / (1.0 + along)
    return (
        along * up[0] + turned[0] + share * axis[0],
        along * up[1] + turned[1] + share * axis[1],
        along * up[2] + turned[2] + share * axis[2],
    )


def _clearance_of(assess: Callable[..., Assessment]) -> Any:
    @scalar
    def clearance(
        tilts: Values, up: Triple, supervisor: Supervisor, vehicle: Any, knots: Vector = NO_KNOTS
    ) -> float:
        margin, determinant, _ = assess(tilts, up, vehicle, knots)
        return _relative_clearance(margin, determinant, supervisor)

    return clearance


def _scales_of(
    tilts: int, clearance: Callable[..., float]
) -> tuple[Callable[..., float], Callable[..., float]]:
    """``allowed_scale`` and ``gait_scale``."""
    scaled = vectors_of(tilts).scaled

    @scalar
    def allowed_scale(
        tilts: Values,
        roll: float,
        pitch: float,
        supervisor: Supervisor,
        vehicle: Any,
        knots: Vector = NO_KNOTS,
    ) -> float:
        up = world_up_in_body(roll, pitch)
        low = high = nearest = 1.0
        left, most = 0.0, -inf
        for step in range(SCALE_GRID + 1):
            low = 1.0 - step / SCALE_GRID
            left = clearance(scaled(low, tilts), up, supervisor, vehicle, knots)
            if left >= 0.0:
                break
            if left > most:
                most, nearest = left, low
            high = low
        if left < 0.0:
            return nearest
        if low == 1.0:
            return low
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            if clearance(scaled(middle, tilts), up, supervisor, vehicle, knots) >= 0.0:
                low = middle
            else:
                high = middle
        return low

    @scalar
    def gait_scale(
        tilts: Values,
        roll: float,
        pitch: float,
        supervisor: Supervisor,
        vehicle: Any,
        knots: Vector = NO_KNOTS,
    ) -> float:
        if supervisor.strategy != SCALE:
            return 1.0
        if supervisor.min_margin <= 0.0 and supervisor.min_determinant <= 0.0:
            return 1.0
        return allowed_scale(tilts, roll, pitch, supervisor, vehicle, knots)

    return allowed_scale, gait_scale


def _tilts_of(tilts: int, way_back: WayBack) -> Callable[..., Jets]:
    moved_back = way_back.tilts
    on_clock: Callable[..., Jets] = componentwise(
        "on_clock", "planned, motion", "clock(planned#, motion)", tilts, clock=_on_clock
    )
    scaled: Callable[..., Jets] = componentwise(
        "scaled_jets", "scale, planned", "scaled(scale, planned#)", tilts, scaled=jet_scaled
    )

    @scalar
    def supervised_tilts(
        planned: Jets, scale: float, motion: Triple, supervisor: Supervisor, vehicle: Any
    ) -> Jets:
        if supervisor.strategy == HOLD:
            return on_clock(planned, motion)
        if supervisor.strategy == RETURN_TO_RED:
            return moved_back(planned, motion, supervisor, vehicle)
        return scaled(scale, planned)

    return supervised_tilts


def _lookahead_of(
    tilts: int, assess: Callable[..., Assessment], supervised_tilts: Callable[..., Jets]
) -> Callable[..., float]:
    """``min_clearance_ahead``."""
    planned_of = tilt_motion_of(tilts).planned
    angles: Callable[..., Values] = componentwise("angles_of_jets", "jets", "jets#[0]", tilts)

    @scalar
    def tilts_at(
        clock: float,
        state: float,
        gait: GaitParameters,
        knots: Vector,
        supervisor: Supervisor,
        vehicle: Any,
    ) -> Values:
        """The tilts at a time of the gait's clock in the supervisor's present state."""
        planned, motion = planned_of(clock, gait, knots), (state, 0.0, 0.0)
        return angles(supervised_tilts(planned, 1.0, motion, supervisor, vehicle))

    @scalar
    def min_clearance_ahead(
        time: float,
        up: Triple,
        state: float,
        gait: GaitParameters,
        knots: Vector,
        supervisor: Supervisor,
        vehicle: Any,
    ) -> float:
        """The smallest clearance up to the horizon at the supervisor's present state.

        The vehicle meets each sample's tilts with the lean of a moment before. In hover it leans
        with their direction; it stays as far away from that as it is now.
        """
        smallest, start, before = 1.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        clock = gait_time(time, (state, 0.0, 0.0), supervisor)
        spacing = supervisor.horizon / LOOKAHEAD_SAMPLES
        for sample in range(LOOKAHEAD_SAMPLES + 1):
            ahead = clock + spacing * sample
            if sample > 0 and spacing > FOLLOWED:
                tilts = tilts_at(ahead - FOLLOWED, state, gait, knots, supervisor, vehicle)
                before = assess(tilts, up, vehicle, knots)[2]
            lean = turned_along(up, start, before)
            tilts = tilts_at(ahead, state, gait, knots, supervisor, vehicle)
            margin, determinant, before = assess(tilts, lean, vehicle, knots)
            smallest = min(smallest, _relative_clearance(margin, determinant, supervisor))
            if sample == 0:
                start = before
        return smallest

    return min_clearance_ahead


def supervision_of(
    tilts: int, assess: Callable[..., Assessment], way_back: WayBack = NO_WAY_BACK
) -> Supervision:
    """The supervisor of vehicles with so many tilts; see `Supervision`."""
    planned_of, return_speed = tilt_motion_of(tilts).planned, way_back.speed
    clearance = _clearance_of(assess)
    supervised_tilts = _tilts_of(tilts, way_back)
    min_clearance_ahead = _lookahead_of(tilts, assess, supervised_tilts)

    @scalar
    def derivative(
        time: float,
        roll: float,
        pitch: float,
        state: float,
        rate: float,
        gait: GaitParameters,
        knots: Vector,
        supervisor: Supervisor,
        vehicle: Any,
    ) -> Triple:
        """``HOLD``: the clock runs (rate 0) with sufficient clearance and stops (rate 1) without.

        ``RETURN_TO_RED``: towards red where the thresholds would be violated, back where they
        allow it, slowing down towards both ends.
        """
        up = world_up_in_body(roll, pitch)
        smallest = min_clearance_ahead(time, up, state, gait, knots, supervisor, vehicle)
        if supervisor.strategy == HOLD:
            desired = 1.0 - min(1.0, max(0.0, smallest / BAND))
        else:
            speed = return_speed(planned_of(time, gait, knots), supervisor, vehicle)
            desired = -speed * min(1.0, max(-1.0, smallest / BAND))
            # Four lags: the motion to either end is critically damped.
            desired = min((1.0 - state) / (4.0 * LAG), max(-state / (4.0 * LAG), desired))
        return state, rate, (desired - rate) / LAG

    return Supervision(
        assess, clearance, *_scales_of(tilts, clearance), supervised_tilts, derivative
    )
