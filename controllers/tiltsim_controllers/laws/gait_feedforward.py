"""Laws with feed-forward of the gait: references and planned tilts around `attitude_force`.

The tiltrotor's law is the one of attitude and one component of force, with Euler angles; its
parameters and its supervisor are its own.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, Final

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.code.traceable import traceable
from tiltsim_controllers.gaits.motion import tilt_motion_of
from tiltsim_controllers.gaits.parameters import FIXED, NO_KNOTS, GaitParameters
from tiltsim_controllers.laws.allocation import limited_accelerations
from tiltsim_controllers.laws.attitude_altitude import OPTIONS, AttitudeAltitude
from tiltsim_controllers.laws.decouplers import NONE
from tiltsim_controllers.laws.gains import Gains, IntegralGains
from tiltsim_controllers.laws.keys import record_of
from tiltsim_controllers.laws.multirotor import attitude_force, present_wrench
from tiltsim_controllers.laws.multirotor_steps import FeedforwardTerms, Form
from tiltsim_controllers.laws.multirotor_supervisor import multirotor_supervision_of, watched_at
from tiltsim_controllers.laws.supervisor import SUPERVISOR_AT_REST, Supervisor, gait_time
from tiltsim_controllers.laws.tiltrotor_supervisor import SUPERVISION
from tiltsim_controllers.references.trajectories import ReferenceParameters, reference_derivatives
from tiltsim_controllers.vehicle.effectiveness import TiltOfRotor, tilts_of
from tiltsim_controllers.vehicle.parameters import Vehicle, drag_ratio
from tiltsim_controllers.vehicle.rotors import spins_in
from tiltsim_controllers.vehicle.states import PITCH, ROLL

Parameters = record_of(
    AttitudeAltitude,
    OPTIONS,
    vehicle=Vehicle,
    gains=Gains,
    integral=IntegralGains,
    max_acceleration=float,  # m/s^2 of the feedback, horizontally; integrators stop there
    max_angular_acceleration=float,  # rad/s^2, desired, per axis
    anticipation=float,  # s before and after a corner of the gait in which the body turns
    terms=FeedforwardTerms,
    gait=GaitParameters,
    reference=ReferenceParameters,
    supervisor=Supervisor,
    rotor_inertia=float,  # kg m^2, of a rotor about its axis, as far as it is known
    attitude_error=float,  # `EULER_ANGLES`
    slowest_rotor=float,  # rad/s, 0: a rotor at rest has no acceleration that helps
    turn_time=float,  # s, 0
)
"""Parameters of the tiltrotor's controller."""

TILTROTOR: Final = (0, 1, 2, 3)
"""Every rotor of the tiltrotor has its own tilt."""

FORM: Final = Form(1, "thrust", own_yaw=True, spin=True)
"""Its form of the law; four equations in four unknowns have one solution in every norm."""

_TILTS: Final = tilt_motion_of(4)
_gait_scale, _supervised_tilts = SUPERVISION.gait_scale, SUPERVISION.tilts


@traceable
def tracking_inputs(
    time: Any,
    state: Any,
    tilt_rates: Any,
    integrals: Any,
    parameters: Any,
    knots: Any = NO_KNOTS,
    supervisor_motion: Any = SUPERVISOR_AT_REST,
    measured: Any = None,
) -> Any:
    """Rotor accelerations (rad/s^2, singular: NaN), integrator rates (m), attitude to track (rad).

    Args:
        time: s.
        state: `tiltsim_controllers.vehicle.states.TILTROTOR_FIELDS`.
        tilt_rates: Rates of its tilt angles, rad/s.
        integrals: `tiltsim_controllers.laws.multirotor_steps.INTEGRAL_FIELDS`.
        parameters: Any of the controller.
        knots: Table data of gait and reference.
        supervisor_motion: The supervisor's state with its rate and acceleration.
        measured: The angular acceleration (rad/s^2, body axes); None takes the model's.
    """
    reference = reference_derivatives(time, parameters.reference, knots)
    plan = None
    if parameters.decoupler != NONE:
        supervisor, ratio = parameters.supervisor, drag_ratio(parameters.vehicle)
        clock = gait_time(time, supervisor_motion, supervisor)
        planned, _ = _TILTS.moving(clock, parameters.gait, knots)
        scale = _gait_scale(planned, state[ROLL], state[PITCH], supervisor, ratio, knots)
        tilts = _TILTS.anticipated(clock, parameters.gait, knots, parameters.anticipation)
        plan = _supervised_tilts(tilts, scale, supervisor_motion, supervisor, ratio)
    found = attitude_force(
        time, state, tilt_rates, integrals, reference, plan, parameters, (), TILTROTOR, FORM,
        measured,
    )  # fmt: skip
    return found[0:10]


@cache
def _plan_of(layout: TiltOfRotor, form: Form) -> Callable[..., Any]:
    """The gait's tilts with derivatives.

    ``(time, state, motion, parameters, knots)``: they are the anticipated ones of the plan or,
    under a supervisor whose state is ``motion``, the supervised ones.
    """
    motion_of = tilt_motion_of(tilts_of(layout))
    moving, anticipated = motion_of.moving, motion_of.anticipated

    def planned(time: Any, state: Any, motion: Any, parameters: Any, knots: Any) -> Any:
        return anticipated(time, parameters.gait, knots, parameters.anticipation)

    if not form.supervised:
        return planned
    supervision = multirotor_supervision_of(layout, form.dimension, form.forward)
    gait_scale, supervised_tilts = supervision.gait_scale, supervision.tilts

    def supervised(time: Any, state: Any, motion: Any, parameters: Any, knots: Any) -> Any:
        supervisor, vehicle = parameters.supervisor, watched_at(time, parameters)
        clock = gait_time(time, motion, supervisor)
        now, _ = moving(clock, parameters.gait, knots)
        scale = gait_scale(now, state[ROLL], state[PITCH], supervisor, vehicle, knots)
        ahead = planned(clock, state, motion, parameters, knots)
        return supervised_tilts(ahead, scale, motion, supervisor, vehicle)

    return supervised


@cache
def multirotor_law_of(layout: TiltOfRotor, form: Form) -> Callable[..., Any]:
    """The control law of multirotors of a layout, a function as `tracking_inputs`.

    Its parameters are `tiltsim_controllers.laws.multirotor_steps.Parameters`, the table of the
    rotors is in the knots, and it also returns the null part.
    """
    count, plan_of, prioritized = len(layout), _plan_of(layout, form), form.prioritized
    speeds = slice(12 + tilts_of(layout), 12 + tilts_of(layout) + count)
    leans_with_gait = form.dimension < 3 and not form.forward and tilts_of(layout) > 0
    supervised = form.supervised

    @traceable
    def inputs(
        time: Any,
        state: Any,
        tilt_rates: Any,
        integrals: Any,
        parameters: Any,
        knots: Any = NO_KNOTS,
        supervisor_motion: Any = SUPERVISOR_AT_REST,
        measured: Any = None,
    ) -> Any:
        reference = reference_derivatives(time, parameters.reference, knots)
        plan = None
        moves = parameters.gait.type != FIXED or supervised
        if leans_with_gait and moves and parameters.terms.attitude_rates != 0.0:
            plan = plan_of(time, state, supervisor_motion, parameters, knots)
        found = attitude_force(
            time, state, tilt_rates, integrals, reference, plan, parameters, knots, layout, form,
            measured,
        )  # fmt: skip
        if not prioritized:
            return found
        wrench, up = present_wrench(time, state, parameters, knots, layout)
        spins = spins_in(knots, parameters.rotors, layout)
        accelerations = limited_accelerations(
            found[:count], wrench, up, state[speeds], spins, parameters.limits
        )
        return xp.hstack([accelerations, found[count:]])

    return inputs
