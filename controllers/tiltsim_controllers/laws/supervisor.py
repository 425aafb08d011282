"""A supervisor that keeps a planned gait away from singular decoupling matrices.

It keeps two numbers above their thresholds: the singularity margin (rad, the distance of the
attitude from a singular one) and the determinant of the matrix, scaled to `UNTILTED`, its value for
the level untilted tiltrotor. Only the determinant shows that a gait approaches tilt angles at which
every attitude is singular. Both numbers depend on the kind of vehicle
(`tiltsim_controllers.laws.supervised_vehicles`). There are three
strategies.

* ``SCALE`` scales all tilt angles toward zero as little as satisfies both thresholds. A function
  of planned angles and attitude, without memory.
* ``HOLD`` looks ahead and slows the gait's clock until it stops where the thresholds would be
  violated; it continues when they would not. Its state is the delay (s) of the gait behind its
  plan.
* ``RETURN_TO_RED`` also looks ahead, and moves the tilts from the planned gait toward the nearest
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

from collections.abc import Callable
from math import inf, pi
from typing import Any, Final, NamedTuple

from tiltsim_controllers.code.arrays import branch, repeat, traceable, xp
from tiltsim_controllers.gaits.motion import NO_KNOTS, GaitParameters, planned_tilts
from tiltsim_controllers.mathematics.attitude import rotation_matrix
from tiltsim_controllers.mathematics.linear import cross

STRATEGIES: Final = {"scale": 0.0, "hold": 1.0, "return_to_red": 2.0}
"""Strategies by their name in a scenario."""

SCALE, HOLD, RETURN_TO_RED = STRATEGIES.values()

SCALE_GRID: Final = 16
"""Intervals of the scale that are checked, from the whole gait to none."""

BISECTIONS: Final = 20
"""Bisections of the last interval: the scale is exact to 1e-7."""

LOOKAHEAD_SAMPLES: Final = 8
"""Instants ahead at which the gait is checked, evenly spaced up to the horizon."""

FOLLOWED: Final = 0.0625
"""Time (s of the gait) by which the lean follows the tilts; less if samples are closer."""

BAND: Final = 0.1
"""Clearance above the thresholds from which the clock of ``HOLD`` slows down, to stop at zero.

``RETURN_TO_RED`` has full speed where the clearance is minus this: it undershoots a threshold by up
to this, times the share of the maximum tilt rate that the gait requires.
"""

LAG: Final = 0.025
"""Time constant of the supervisor's rate, s."""

UNTILTED: Final = 4.0
"""Determinant of the level untilted tiltrotor (ch. 3); other vehicles are scaled to it."""


class Supervisor(NamedTuple):
    """Thresholds, both 0 for no supervisor, and strategy."""

    min_margin: float = 0.0  # rad, below a right angle
    min_determinant: float = 0.0  # `UNTILTED` for a level untilted vehicle
    strategy: float = SCALE
    horizon: float = 0.0  # s of the gait to look ahead
    max_rate: float = 0.0  # rad/s, of the fastest tilt on the way to red and back
    clearance: float = 0.0  # rad, of red gaits from the curve L


@traceable
def gait_time(time: Any, motion: Any, supervisor: Supervisor) -> Any:
    """The time (s) of the gait's clock, which the strategy ``HOLD`` delays."""
    return time - motion[0] if supervisor.strategy == HOLD else time


def _up(roll: Any, pitch: Any) -> Any:
    """World up in body axes, shape (3,)."""
    return rotation_matrix(xp.array([roll, pitch, 0.0]))[2]


def _on_clock(planned: Any, motion: Any) -> Any:
    """Tilts on the gait's clock as functions of time: the clock runs at one minus the rate."""
    angles, rates, accelerations = planned.T
    speed = 1.0 - motion[1]
    slowed = accelerations * speed * speed - rates * motion[2]
    return xp.stack([angles, rates * speed, slowed], 1)


def _relative_clearance(margin: Any, determinant: Any, supervisor: Supervisor) -> Any:
    """Distance above the thresholds by the largest possible; negative below them."""
    return xp.minimum(
        (margin - supervisor.min_margin) / (0.5 * pi - supervisor.min_margin),
        (determinant - supervisor.min_determinant) / (UNTILTED - supervisor.min_determinant),
    )


@traceable
def turned_along(up: Any, start: Any, end: Any) -> Any:
    """A direction (3,) turned by the least rotation between two lines, if both have a length."""
    size = xp.sqrt((start @ start) * (end @ end))
    turns = size > 0.0
    along = start @ end / xp.where(turns, size, 1.0)
    length = xp.where(turns, xp.where(along < 0.0, -size, size), 1.0)
    along = abs(along)
    axis = cross(start, end) / length  # times the sine of the angle
    share = axis @ up / (1.0 + along)
    return xp.where(turns, along * up + cross(axis, up) + share * axis, up)


Look = Callable[[Any, Any], tuple[Any, Any]]
"""``(tilts, up)``: clearance, and the direction in which the vehicle hovers."""


def _largest_scale(tilts: Any, up: Any, look: Look) -> Any:
    """`Supervision.gait_scale` at an attitude."""

    def clearance_at(scale: Any) -> Any:
        return look(scale * tilts, up)[0]

    def lower(step: Any, scale: Any, left: Any, nearest: Any, most: Any) -> tuple[Any, ...]:
        better = left > most
        nearest, most = xp.where(better, scale, nearest), xp.where(better, left, most)
        scale = 1.0 - (step + 1.0) / SCALE_GRID
        return scale, clearance_at(scale), nearest, most

    def bisected(low: Any) -> Any:
        def halve(_turn: Any, low: Any, high: Any) -> tuple[Any, Any]:
            middle = 0.5 * (low + high)
            allowed = clearance_at(middle) >= 0.0
            return xp.where(allowed, middle, low), xp.where(allowed, high, middle)

        return repeat(BISECTIONS, halve, low, low + 1.0 / SCALE_GRID)[0]

    whole = clearance_at(1.0)

    def searched() -> Any:
        low, left, nearest, most = repeat(
            SCALE_GRID, lower, 1.0, whole, 1.0, -inf, until=lambda _, left, *__: left >= 0.0
        )
        nearest = xp.where(left > most, low, nearest)
        return branch(left < 0.0, lambda: nearest, lambda: bisected(low))

    return branch(whole >= 0.0, lambda: 1.0, searched)


def _smallest_ahead(
    clock: Any, up: Any, tilts_at: Callable[..., Any], horizon: Any, look: Look
) -> Any:
    """The smallest clearance up to the horizon at the supervisor's present state.

    The vehicle meets each sample's tilts with the lean of a moment before. In hover it leans with
    their direction; it stays as far away from that as it is now.
    """
    spacing = horizon / LOOKAHEAD_SAMPLES
    smallest, start = look(tilts_at(clock), up)

    def glance(sample: Any, smallest: Any, before: Any) -> tuple[Any, Any]:
        ahead = clock + spacing * (sample + 1.0)
        before = branch(
            spacing > FOLLOWED, lambda: look(tilts_at(ahead - FOLLOWED), up)[1], lambda: before
        )
        clearance, direction = look(tilts_at(ahead), turned_along(up, start, before))
        return xp.minimum(smallest, clearance), direction

    return repeat(LOOKAHEAD_SAMPLES, glance, xp.minimum(1.0, smallest), start)[0]


class Supervision(NamedTuple):
    """A supervisor of vehicles with M tilts.

    ``vehicle`` holds the parameters that ``assess`` needs beside the ``knots``. Tilt angles, shape
    (M,), roll and pitch are in rad.
    """

    tilt_count: int  # M
    watched: Callable[..., Any]
    """``(time, parameters)``: the ``vehicle``, from the parameters of a law."""
    assess: Callable[..., tuple[Any, Any, Any]]
    """``(tilts, up, vehicle, knots)``: margin (rad), determinant (`UNTILTED` at best), and the
    direction (body axes, of any length and sense) that keeps its attitude in hover; ``up`` is
    world up in body axes."""
    towards_red: Any = None
    """``(planned, motion, supervisor, vehicle)``: planned tilts, (M, 3), moved by a fraction toward
    the gait to which they can return; None for vehicles without `RETURN_TO_RED`."""
    return_speed: Any = None
    """``(planned, supervisor, vehicle)``: rate (1/s) along the way at the maximum tilt rate."""

    def look(self, supervisor: Supervisor, vehicle: Any, knots: Any) -> Look:
        """How far a vehicle is from the thresholds of its supervisor."""

        def look(tilts: Any, up: Any) -> tuple[Any, Any]:
            margin, determinant, direction = self.assess(tilts, up, vehicle, knots)
            return _relative_clearance(margin, determinant, supervisor), direction

        return look

    @traceable
    def gait_scale(
        self, tilts: Any, roll: Any, pitch: Any, supervisor: Supervisor, vehicle: Any,
        knots: Any = NO_KNOTS,
    ) -> Any:  # fmt: skip
        """The largest scale in [0, 1] that satisfies the thresholds, or the nearest of the grid.

        A range of scales between two of the grid may pass unseen. 1 unless the strategy is `SCALE`.

        Args:
            tilts, roll, pitch, vehicle, knots: See this class.
            supervisor: Thresholds and strategy.
        """
        if supervisor.strategy != SCALE:
            return 1.0
        look = self.look(supervisor, vehicle, knots)
        return branch(
            (supervisor.min_margin > 0.0) | (supervisor.min_determinant > 0.0),
            lambda: _largest_scale(tilts, _up(roll, pitch), look),
            lambda: 1.0,
        )

    @traceable
    def tilts(
        self, planned: Any, scale: Any, motion: Any, supervisor: Supervisor, vehicle: Any
    ) -> Any:
        """The supervised tilts with rates and accelerations (rad, s), shape (M, 3).

        Args:
            planned: Tilts of the gait at its `gait_time`, likewise.
            scale: `gait_scale`.
            motion: The supervisor's state with its rate and acceleration, shape (3,).
            supervisor, vehicle: See this class.
        """
        if supervisor.strategy == HOLD:
            return _on_clock(planned, motion)
        if supervisor.strategy == RETURN_TO_RED:
            return self.towards_red(planned, motion, supervisor, vehicle)
        return scale * planned

    @traceable
    def derivative(
        self, time: Any, roll: Any, pitch: Any, state: Any, rate: Any, gait: GaitParameters,
        knots: Any, supervisor: Supervisor, vehicle: Any,
    ) -> Any:  # fmt: skip
        """The supervisor's state (s or a fraction), its rate and its acceleration, shape (3,).

        ``HOLD``: the clock runs (rate 0) with sufficient clearance and stops (rate 1) without.
        ``RETURN_TO_RED``: toward red where the thresholds would be violated, back where they
        allow it, slowing down toward both ends.

        Args:
            time: s.
            roll, pitch, vehicle, knots: See this class.
            state, rate: The supervisor's state and its rate.
            gait: The gait.
            supervisor: Thresholds and strategy.
        """
        still = xp.array([state, 0.0, 0.0])

        def tilts_at(clock: Any) -> Any:
            planned = planned_tilts(clock, gait, knots, self.tilt_count)
            return self.tilts(planned, 1.0, still, supervisor, vehicle)[:, 0]

        clock = gait_time(time, still, supervisor)
        look, up = self.look(supervisor, vehicle, knots), _up(roll, pitch)
        share = _smallest_ahead(clock, up, tilts_at, supervisor.horizon, look) / BAND
        if supervisor.strategy == HOLD:
            desired = 1.0 - xp.minimum(1.0, xp.maximum(0.0, share))
        else:
            planned = planned_tilts(time, gait, knots, self.tilt_count)
            speed = self.return_speed(planned, supervisor, vehicle)
            desired = -speed * xp.minimum(1.0, xp.maximum(-1.0, share))
            # Four lags: the motion to either end is critically damped.
            desired = xp.maximum(-state / (4.0 * LAG), desired)
            desired = xp.minimum((1.0 - state) / (4.0 * LAG), desired)
        return xp.array([state, rate, (desired - rate) / LAG])
