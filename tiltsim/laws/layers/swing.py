"""A law of position that damps the swing of a load on a cable."""

from __future__ import annotations

from functools import cache
from math import sqrt
from typing import Any, Final, NamedTuple

from tiltsim.closed_loop.loop import ClosedLoop
from tiltsim.laws.layers.layer import Layer, PlantState, wrap_loop
from tiltsim.scenario.scenario import FlightPlan
from tiltsim.vehicles.rotorcraft.others import FELT
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.references.trajectories import ReferenceParameters, reference_motion

SHIFTS: Final = ("swing_shift_x", "swing_shift_y")
"""How far the vehicle goes after its load, away from its reference, m."""

FILTER: Final = 60.0  # rad/s, bandwidth in which it sees the swing

STATES: Final = ("filtered_swing_x", "filtered_swing_y")

RETURN: Final = 0.25  # rate at which it comes back, over the frequency of the swing


class SwingDamping(NamedTuple):
    """Parameters of the layer."""

    reference: ReferenceParameters
    length: float  # m, of the cable
    gravity: float  # m/s^2
    gain: float  # 1/s, from the load's displacement to the speed of the shift
    decay: float  # 1/s, of the shift


def shift_gains(frequency: float, damping: float) -> tuple[float, float]:
    """Gain and decay (1/s) of a shift that gives a pendulum a damping ratio.

    A load at the displacement s from below a place that shifts by d obeys ``s'' = -w^2 s - d''``.
    With ``d' = gain s - decay d`` its poles are a pair of the damping ratio, of the frequency v,
    and a real one at ``RETURN v``.

    Args:
        frequency: w of the pendulum, rad/s.
        damping: Its damping ratio to be.
    """
    slower = frequency / sqrt(1.0 + 2.0 * damping * RETURN)
    decay = RETURN * slower**3 / frequency**2
    return slower * (RETURN + 2.0 * damping) - decay, decay


def _swing_damping(plan: FlightPlan) -> SwingDamping:
    load, gravity = plan.scenario.payload, plan.scenario.any_rotorcraft.resolve().gravity
    assert load is not None  # else there is no such layer
    gains = shift_gains(sqrt(gravity / load.length), load.swing_damping)
    return SwingDamping(plan.reference, load.length, gravity, *gains)


@cache
def with_swing_damping(loop: ClosedLoop) -> ClosedLoop:
    """A law of position whose reference goes after the swinging load.

    Only the part of the swing counts that the reference's own acceleration does not explain: a load
    hangs back by that acceleration over gravity's. A law that does not read `Felt` sees the vehicle
    displaced in place of its reference.
    """
    sizes, first = loop.sizes, loop.sizes.act

    def controls(within: Any, time: Any, state: PlantState, own: Any, knots: Any) -> Any:
        qpos, qvel, act = state
        shift, filtered = act[first : first + 2], act[first + 2 : first + 4]
        hanging_back = reference_motion(time, own.reference, knots)[2][:2] / own.gravity
        displacement = own.length * (act[FELT.swing] + hanging_back)
        following = FILTER * (displacement - filtered)
        rate = own.gain * filtered - own.decay * shift
        if sizes.history:
            seen = xp.hstack([act[:-6], shift, rate, own.gain * following - own.decay * rate])
        else:
            seen = act
            qpos = xp.hstack([qpos[:2] - shift, qpos[2:]])
            qvel = xp.hstack([qvel[:2] - rate, qvel[2:]])
        return xp.hstack([within(PlantState(qpos, qvel, seen)), rate, following])

    layer = Layer(
        SwingDamping,
        _swing_damping,
        controls=controls,
        fields=dict.fromkeys((*SHIFTS, *STATES), "m"),
        of_controller=True,
    )
    return wrap_loop(loop, layer)
