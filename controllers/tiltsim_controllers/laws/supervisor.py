"""A supervisor that keeps a planned gait away from singular decoupling matrices.

The matrix is singular where ``n(alpha) . r3 = 0``
(`tiltsim_controllers.vehicle.decoupling_matrix`). The supervisor keeps two numbers above their
thresholds: the singularity margin (rad, how far the attitude is from a singular one) and the
determinant ``n . r3`` itself (4 for a level untilted vehicle), which alone sees a gait come to the
curve L of the Two Color Map, where ``n`` vanishes whatever its direction. There are three ways to
do it.

* ``SCALE`` lets as much of the gait pass as keeps both: all tilt angles are scaled towards zero,
  where ``n`` is vertical. A function of planned angles and attitude, without memory.
* ``HOLD`` looks at the gait ahead and slows the gait's clock down until it stands where the
  thresholds would be missed at the present attitude; it goes on when they would not. Its state is
  the delay (s) of the gait behind its plan.
* ``RETURN_TO_RED`` looks ahead, too, and moves the tilts from the planned gait towards the nearest
  red one (`tiltsim_controllers.gaits.red_gait`), where ``n`` is vertical, at a rate that servos can
  follow, and back when there is room. Its state is the share of the way.

The last two have a state and its rate, which start at rest and stay at zero as long as there is
room: such a flight is the unsupervised one, bit for bit. Both are states of the simulation, and
everything else is a pure function of them, time and attitude, so that a saved state restarts and
the same source runs in every engine. The rate has a lag, so that the tilts have accelerations for
the laws that count them in.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import asin, pi, sqrt
from typing import Final, NamedTuple

from tiltsim_controllers.gaits.parameters import GaitParameters, TiltsAndRates
from tiltsim_controllers.gaits.red_gait import Jets4, nearest_red_angles
from tiltsim_controllers.gaits.tilts import tilt_acceleration, tilt_reference
from tiltsim_controllers.mathematics.jets import Jet, jet_product, jet_scaled, jet_sum
from tiltsim_controllers.mathematics.rotation import world_up_in_body
from tiltsim_controllers.mathematics.scalar import Quad, Triple, scalar
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
"""What a supervisor can do, by the name a scenario gives it."""

STEPS: Final = 16
"""Scales that are looked at, from nothing of the gait to all of it."""

HALVINGS: Final = 20
"""How often the last step is halved: the scale is exact to 1e-7."""

GLANCES: Final = 8
"""Instants of the gait ahead that are looked at, evenly spaced up to the horizon."""

BAND: Final = 0.1
"""Share of the room above a threshold within which the supervisor begins to act."""

LAG: Final = 0.025
"""s, with which the supervisor's rate follows what it wants."""

NEAR: Final = 0.05
"""rad: a planned gait nearer to red than this goes there as if it were this far away."""

SUPERVISOR_AT_REST: Final = (0.0, 0.0, 0.0)
"""A supervisor that does nothing: its state, rate and acceleration."""


class Supervisor(NamedTuple):
    """What the supervisor keeps, both 0 to leave it out, and how."""

    min_margin: float = 0.0  # rad, below a right angle
    min_determinant: float = 0.0  # 4 for a level untilted vehicle
    strategy: float = SCALE
    horizon: float = 0.0  # s of the gait to look ahead
    max_rate: float = 0.0  # rad/s, of the fastest tilt on the way to red and back
    clearance: float = 0.0  # rad, of red gaits from the curve L


@scalar
def margin_and_determinant(tilts: Quad, up: Triple, drag_ratio: float) -> tuple[float, float]:
    """Singularity margin (rad) and determinant of tilts; ``up`` is `world_up_in_body`."""
    trig = sines_and_cosines(tilts[0], tilts[1], tilts[2], tilts[3])
    nx, ny, nz = torque_free_force(trig, torque_entries(trig, drag_ratio), drag_ratio)
    along = nx * up[0] + ny * up[1] + nz * up[2]
    length = sqrt(nx * nx + ny * ny + nz * nz)
    if length == 0.0:
        return 0.0, 0.0
    return asin(min(1.0, max(-1.0, along / length))), along


# --- scale -------------------------------------------------------------------------------------


@scalar
def is_allowed(
    scale: float, tilts: Quad, up: Triple, supervisor: Supervisor, drag_ratio: float
) -> bool:
    """Whether the tilts times ``scale`` are regular enough; ``up`` is `world_up_in_body`."""
    a1, a2, a3, a4 = tilts
    scaled = (scale * a1, scale * a2, scale * a3, scale * a4)
    margin, determinant = margin_and_determinant(scaled, up, drag_ratio)
    return margin >= supervisor.min_margin and determinant >= supervisor.min_determinant


@scalar
def allowed_scale(
    tilts: Quad, roll: float, pitch: float, supervisor: Supervisor, drag_ratio: float
) -> float:
    """The largest scale up to which the gait is allowed all the way from zero.

    Where not even the untilted vehicle meets the thresholds, as it leans too far, 0: the best that
    a gait can do.
    """
    up = world_up_in_body(roll, pitch)
    low, high = 0.0, 1.0
    for step in range(STEPS + 1):
        high = step / STEPS
        if not is_allowed(high, tilts, up, supervisor, drag_ratio):
            break
        low = high
    if low == high or high == 0.0:
        return low
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if is_allowed(middle, tilts, up, supervisor, drag_ratio):
            low = middle
        else:
            high = middle
    return low


@scalar
def supervised_gait_scale(
    planned: TiltsAndRates, roll: float, pitch: float, supervisor: Supervisor, vehicle: Vehicle
) -> float:
    """How much of a planned gait passes at an attitude: 1 where nothing is scaled."""
    if supervisor.strategy != SCALE:
        return 1.0
    if supervisor.min_margin <= 0.0 and supervisor.min_determinant <= 0.0:
        return 1.0
    tilts = planned[0], planned[1], planned[2], planned[3]
    return allowed_scale(tilts, roll, pitch, supervisor, drag_ratio(vehicle))


# --- hold and return -----------------------------------------------------------------------------


@scalar
def room(tilts: Quad, up: Triple, supervisor: Supervisor, drag_ratio: float) -> float:
    """What is left above the thresholds, as a share of the most there could be; negative below."""
    margin, determinant = margin_and_determinant(tilts, up, drag_ratio)
    return min(
        (margin - supervisor.min_margin) / (0.5 * pi - supervisor.min_margin),
        (determinant - supervisor.min_determinant) / (4.0 - supervisor.min_determinant),
    )


@scalar
def planned_tilts(time: float, gait: GaitParameters, table: Sequence[float]) -> Jets4:
    """The planned tilt angles with their rates and accelerations."""
    a1, a2, a3, a4, v1, v2, v3, v4 = tilt_reference(time, gait, table)
    b1, b2, b3, b4 = tilt_acceleration(time, gait)
    return (a1, v1, b1), (a2, v2, b2), (a3, v3, b3), (a4, v4, b4)


@scalar
def gait_time(time: float, supervisor_motion: Triple, supervisor: Supervisor) -> float:
    """The time of the gait's clock, which may have been held."""
    return time - supervisor_motion[0] if supervisor.strategy == HOLD else time


@scalar
def slowed(tilt: Jet, supervisor_motion: Triple) -> Jet:
    """A tilt that moves with the gait's clock, by time: the clock runs at one less the rate."""
    speed = 1.0 - supervisor_motion[1]
    return tilt[0], tilt[1] * speed, tilt[2] * speed * speed - tilt[1] * supervisor_motion[2]


@scalar
def moved(tilt: Jet, red: Jet, share: Jet) -> Jet:
    """A tilt on its way to red."""
    return jet_sum(1.0, tilt, 1.0, jet_product(share, jet_sum(1.0, red, -1.0, tilt)))


@scalar
def supervised_tilts(
    planned: Jets4,
    share: float,
    supervisor_motion: Triple,
    supervisor: Supervisor,
    drag_ratio: float,
) -> Jets4:
    """The tilts that the supervisor commands, with rates and accelerations.

    ``planned`` is the gait at its `gait_time`, ``share`` the `supervised_gait_scale`, and
    ``supervisor_motion`` the supervisor's state with its rate and acceleration.
    """
    a1, a2, a3, a4 = planned
    if supervisor.strategy == HOLD:
        return (
            slowed(a1, supervisor_motion),
            slowed(a2, supervisor_motion),
            slowed(a3, supervisor_motion),
            slowed(a4, supervisor_motion),
        )
    if supervisor.strategy == RETURN_TO_RED:
        red_1, red_2 = nearest_red_angles(planned, drag_ratio, supervisor.clearance)
        return (
            moved(a1, red_1, supervisor_motion),
            moved(a2, red_2, supervisor_motion),
            moved(a3, red_1, supervisor_motion),
            moved(a4, red_2, supervisor_motion),
        )
    return (
        jet_scaled(share, a1),
        jet_scaled(share, a2),
        jet_scaled(share, a3),
        jet_scaled(share, a4),
    )


@scalar
def least_room_ahead(
    time: float,
    up: Triple,
    state: float,
    gait: GaitParameters,
    table: Sequence[float],
    supervisor: Supervisor,
    drag_ratio: float,
) -> float:
    """The least `room` from now to the horizon, with the supervisor's state as it is."""
    least = 1.0
    frozen = (state, 0.0, 0.0)
    start = gait_time(time, frozen, supervisor)
    for glance in range(GLANCES + 1):
        ahead = start + supervisor.horizon * glance / GLANCES
        a1, a2, a3, a4 = supervised_tilts(
            planned_tilts(ahead, gait, table), 1.0, frozen, supervisor, drag_ratio
        )
        least = min(least, room((a1[0], a2[0], a3[0], a4[0]), up, supervisor, drag_ratio))
    return least


@scalar
def return_speed(
    time: float,
    gait: GaitParameters,
    table: Sequence[float],
    supervisor: Supervisor,
    drag_ratio: float,
) -> float:
    """Share of the way to red (1/s) that keeps the fastest tilt at its greatest rate."""
    a1, a2, a3, a4 = planned = planned_tilts(time, gait, table)
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
    table: Sequence[float],
    supervisor: Supervisor,
    drag_ratio: float,
) -> Triple:
    """The supervisor's state, its rate, and the acceleration that they and the gait ahead ask for.

    Held: with room to spare the clock runs (rate 0), without it stands (rate 1). On the way to red:
    to it where the thresholds are missed, back where there is room, gently towards both ends.
    """
    up = world_up_in_body(roll, pitch)
    least = least_room_ahead(time, up, state, gait, table, supervisor, drag_ratio)
    if supervisor.strategy == HOLD:
        wanted = 1.0 - min(1.0, max(0.0, least / BAND))
    else:
        speed = return_speed(time, gait, table, supervisor, drag_ratio)
        wanted = -speed * min(1.0, max(-1.0, least / BAND))
        # Four lags: the motion to either end is critically damped.
        wanted = min((1.0 - state) / (4.0 * LAG), max(-state / (4.0 * LAG), wanted))
    return state, rate, (wanted - rate) / LAG
