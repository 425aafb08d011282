"""Laws of vehicles whose tilts follow a gait: references and planned tilts around `attitude_force`.

The tiltrotor's law with feed-forward is the one of attitude and one component of force, with Euler
angles; its parameters and its supervisor are its own.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, Final

from tiltsim_controllers.code.arrays import traceable
from tiltsim_controllers.gaits.motion import FIXED, NO_KNOTS, anticipated_tilts, planned_tilts
from tiltsim_controllers.laws.allocation import limited_accelerations
from tiltsim_controllers.laws.attitude_altitude import LAYOUT, OPTIONS, AttitudeAltitude
from tiltsim_controllers.laws.feedback import NO_DECOUPLER
from tiltsim_controllers.laws.keys import record_of
from tiltsim_controllers.laws.multirotor import attitude_force, present_wrench
from tiltsim_controllers.laws.multirotor_keys import WITH_GAIT, Form
from tiltsim_controllers.laws.observed import Seen, Step
from tiltsim_controllers.laws.supervised_vehicles import SUPERVISION, multirotor_supervision_of
from tiltsim_controllers.laws.supervisor import Supervision, gait_time
from tiltsim_controllers.vehicle.body import PITCH, ROLL, state_of
from tiltsim_controllers.vehicle.parameters import Vehicle
from tiltsim_controllers.vehicle.rotors import TiltOfRotor, airframe, tilts_of

Parameters = record_of(
    AttitudeAltitude,
    OPTIONS,
    vehicle=Vehicle,
    **WITH_GAIT,
    rotor_inertia=float,  # kg m^2, of a rotor about its axis, as far as it is known
    attitude_error=float,  # `EULER_ANGLES`
    slowest_rotor=float,  # rad/s, 0: a rotor at rest has no acceleration that helps
    turn_time=float,  # s, 0
)
"""Parameters of the tiltrotor's controller."""

FORM: Final = Form(1, "thrust", own_yaw=True, spin=True)
"""Its form of the law; four equations in four unknowns have one solution in every norm."""


def supervised_gait(
    seen: Seen, p: Any, knots: Any, supervision: Supervision, half: Any = None
) -> tuple[Any, Any]:
    """Tilt angles (rad) of a gait under a supervisor with two derivatives, (M, 3), and their scale.

    Args:
        seen: By the law; the supervisor's state is part of it.
        p: Parameters of the law.
        knots: Table data of the flight.
        supervision: The supervisor's functions.
        half: Time (s) by which corners are anticipated; None for the gait as the pods follow it.
    """
    supervisor, vehicle = p.supervisor, supervision.watched(seen.time, p)
    clock, tilts = gait_time(seen.time, seen.supervisor, supervisor), supervision.tilt_count
    planned = planned_tilts(clock, p.gait, knots, tilts)
    angles, roll, pitch = planned[:, 0], seen.state[ROLL], seen.state[PITCH]
    scale = supervision.gait_scale(angles, roll, pitch, supervisor, vehicle, knots)
    if half is not None:
        planned = anticipated_tilts(clock, p.gait, knots, tilts, half)
    return supervision.tilts(planned, scale, seen.supervisor, supervisor, vehicle), scale


@cache
def gait_law_of(layout: TiltOfRotor, form: Form, supervision: Supervision) -> Callable[..., Step]:
    """The control law of vehicles of a layout, `attitude_force` with the tilts of the gait.

    Its parameters are `Parameters`, or `multirotor_keys.Parameters` with the table of the rotors
    in the knots. The supervisor's functions are used where the form is supervised.
    """
    leans_with_gait = form.dimension < 3 and not form.forward and tilts_of(layout) > 0

    @traceable
    def law(seen: Seen, p: Any, knots: Any = NO_KNOTS) -> Step:
        plan = None
        moves = (p.gait.type != FIXED or form.supervised) and p.terms.attitude_rates != 0.0
        if leans_with_gait and (moves or form.own_yaw) and p.decoupler != NO_DECOUPLER:
            if form.supervised:
                plan, _ = supervised_gait(seen, p, knots, supervision, p.anticipation)
            else:
                tilts = tilts_of(layout)
                plan = anticipated_tilts(seen.time, p.gait, knots, tilts, p.anticipation)
        return attitude_force(seen, plan, p, knots, layout, form)

    return law


@cache
def prioritized(law: Callable[..., Step], layout: TiltOfRotor) -> Callable[..., Step]:
    """A law by plain inversion, kept within ``limits`` of its parameters: see `allocation`."""

    @traceable
    def limited(seen: Seen, p: Any, knots: Any = NO_KNOTS) -> Step:
        step, (wrench, up) = law(seen, p, knots), present_wrench(seen, p, knots, layout)
        speeds, (_, rotors) = state_of(seen.state, layout).speeds, airframe(p, knots, layout)
        inputs = limited_accelerations(step.inputs, wrench, up, speeds, rotors.spins, p.limits)
        return step._replace(inputs=inputs)

    return limited


def multirotor_law_of(layout: TiltOfRotor, form: Form) -> Callable[..., Step]:
    """The `gait_law_of` multirotors of a layout."""
    supervision = multirotor_supervision_of(layout, form.dimension, form.forward)
    return gait_law_of(layout, form, supervision)


def tiltrotor_law_of(form: Form = FORM) -> Callable[..., Step]:
    """The `gait_law_of` the tiltrotor."""
    return gait_law_of(LAYOUT, form, SUPERVISION)
