"""Feedback linearization of tiltrotors and multirotors in closed loops (ch. 3 and 4).

Attitude and altitude, or attitude and force, under a planned gait; or the full pose, whose inputs
are the tilt angles as well (ch. 3, Sec. 6.3).
"""

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, Final

import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup
from tiltsim.engines.sample_evaluation import flights_in
from tiltsim.laws.law import INTEGRALS, Law, decouples_position, supervised, tilts_in_states
from tiltsim.laws.rotor_loop import (
    CONDITION,
    RotorLayout,
    margins_of,
    rotor_loop,
    rotor_stops,
    singular_attitude,
)
from tiltsim.scenario.linearizing_controllers import AttitudeForceController, upper_side
from tiltsim.scenario.scenario import FlightPlan
from tiltsim.vehicles.rotorcraft import EXTRA_COLUMNS, initial_tilts
from tiltsim_controllers.analysis.singularity import determinant, margin_over_gait
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.laws import attitude_altitude, full_pose, gait_feedforward
from tiltsim_controllers.laws.attitude_altitude import PUBLISHED_DECOUPLING
from tiltsim_controllers.laws.multirotor import NULL_PART, SIGNALS, independence, present_wrench
from tiltsim_controllers.laws.multirotor_keys import EULER_ANGLES, Form, Parameters
from tiltsim_controllers.laws.observed import UNHARMED, Seen, Step
from tiltsim_controllers.laws.supervised_vehicles import (
    SUPERVISION,
    Watched,
    multirotor_supervision_of,
    watched,
)
from tiltsim_controllers.laws.supervisor import Supervision
from tiltsim_controllers.mathematics.attitude import rotation_matrix
from tiltsim_controllers.mathematics.linear import kernel
from tiltsim_controllers.mathematics.records import changed_record
from tiltsim_controllers.mathematics.scalar import Floats, Values
from tiltsim_controllers.vehicle.body import TILT_FIELDS, state_of
from tiltsim_controllers.vehicle.parameters import SPIN, Vehicle
from tiltsim_controllers.vehicle.rotors import airframe, without_rotor, wrench_map

TILTROTOR: Final = RotorLayout((0, 1, 2, 3), SPIN, "tiltrotor")

REVERSING: Final = 'controller.norm = "thrust", with which rotors reverse'
"""The remedy where a rotor would have to reverse."""


def singularity_columns(samples: Mapping[str, Floats], vehicle: Vehicle) -> dict[str, Floats]:
    """Determinant of the attitude-altitude law, and the margin (rad) to a singular attitude."""
    tilts = np.stack([samples[name] for name in TILT_FIELDS], axis=-1)
    attitude = samples["roll"], samples["pitch"]
    return {
        "singularity_margin": margin_over_gait(
            tilts, vehicle, *attitude, flights=flights_in(samples["time"])
        ),
        "determinant": determinant(tilts, *attitude, vehicle),
    }


def _tracking_loop(
    layout: RotorLayout,
    step: Callable[..., Step],
    record: Any,
    supervision: Supervision,
    options: tuple[bool, str, bool],
    turning: int = 4,
    **parts: Any,
) -> ClosedLoop:
    """The loop of a law whose tilts follow a gait; ``turning`` rotors must not come to a stop."""
    measured, strategy, limited = options
    stops = rotor_stops(turning, "" if layout.cross else REVERSING)

    def causes(sample: Mapping[str, float], setup: ControlSetup) -> tuple[str, ...]:
        failure = getattr(setup.parameters.law, "failure", UNHARMED)
        attitude = singular_attitude(sample, layout.places.names("alpha"))
        if sample["time"] >= failure.known_from:
            attitude += f", without rotor {failure.rotor:g}"
        return (attitude, *stops)

    law = Law(
        gait_feedforward.prioritized(step, layout.tilt_of_rotor) if limited else step,
        record,
        causes=causes,
        measured=measured,
        follows_position=decouples_position,
        **parts,
    )
    return rotor_loop(layout, supervised(law, supervision, strategy))


# --- the tiltrotor -----------------------------------------------------------------------------


def _determinant_and_speeds(seen: Seen, p: Any, knots: Any) -> Any:
    """Determinant of the decoupling matrix by its scale, and the rotor speeds (rad/s), shape (5,).

    ``det [tau; r3^T F] = 2 L^2 K_f^3 K_m (n . r3)`` with ``n . r3 = 4`` for a level untilted
    vehicle, here in units of ``K_f``. The factors ``2 |varpi|`` of the exact matrix vanish with a
    speed; as published they are in one row only, and a rotor at rest is harmless.
    """
    layout, vehicle = TILTROTOR.tilt_of_rotor, p.vehicle
    now, (_, rotors) = state_of(seen.state, layout), airframe(p, knots, layout)
    wrench = wrench_map(rotors, now.tilts)
    arm, drag = vehicle.arm_length, vehicle.drag_coefficient / vehicle.thrust_coefficient
    scale = 2.0 * arm * arm * drag
    determinant = -(rotation_matrix(now.attitude)[2] @ wrench[:3] @ kernel(wrench[3:]))
    speeds = xp.ones(4) if p.decoupling == PUBLISHED_DECOUPLING else now.speeds
    return xp.hstack([determinant / scale, speeds])


def _feedforward(plan: FlightPlan) -> dict[str, Any]:
    """Parameters of the tiltrotor's law that are keys of a multirotor's."""
    controller: Any = plan.scenario.controller
    inertia = plan.scenario.rotorcraft.rotor_inertia
    return {
        "rotor_inertia": inertia if controller.rotor_inertia_feedforward else 0.0,
        "attitude_error": EULER_ANGLES,
        "slowest_rotor": 0.0,
        "turn_time": 0.0,
    }


@cache
def tiltrotor_loop(name: str, measured: bool, strategy: str, limited: bool) -> ClosedLoop:
    """The closed loop of the attitude-altitude controller of the tiltrotor.

    Args:
        name: "attitude_altitude", or "gait_feedforward" with tilt-rate feed-forward.
        measured: Whether it feeds back the angular acceleration of the plant, which
            `tiltsim.laws.layers.instruments` measures, in place of the model's.
        strategy: The supervisor's, or empty; see `supervised`.
        limited: Whether it keeps the rotors within limits, see `gait_feedforward.prioritized`.
    """
    step: Callable[..., Step] = attitude_altitude.attitude_altitude
    parts: dict[str, Any] = {}
    record = attitude_altitude.Parameters
    if name == "gait_feedforward":
        form = gait_feedforward.FORM._replace(supervised=bool(strategy))
        step, record = gait_feedforward.tiltrotor_law_of(form), gait_feedforward.Parameters
        parts = {"own": _feedforward, "states": INTEGRALS}
    return _tracking_loop(
        TILTROTOR,
        step,
        record,
        SUPERVISION,
        (measured, strategy, limited),
        signals=SIGNALS[:3],
        columns=(*EXTRA_COLUMNS,),
        margins=lambda samples, setup: singularity_columns(samples, setup.parameters.law.vehicle),
        signs=_determinant_and_speeds,
        **parts,
    )


# --- multirotors -------------------------------------------------------------------------------


def _attitude_force(plan: FlightPlan) -> dict[str, Any]:
    """Parameters of the law of attitude and force."""
    gait, vehicle = plan.gait, plan.scenario.any_rotorcraft.multirotor
    controller = plan.scenario.controller
    assert isinstance(controller, AttitudeForceController)
    dimension = controller.resolve_force(vehicle, gait).dimension
    side, lost = upper_side(vehicle, gait), controller.failed_rotor
    side_without = side if lost is None else upper_side(vehicle, gait, lost)
    whole = rest = Watched()
    if controller.supervision is not None:
        whole = watched(vehicle.table, len(plan.knots), side)
        if lost is not None:
            first = whole.rotors + len(vehicle.table)
            rest = whole._replace(rotors=first, side=side_without)
    return {
        "side_integral": 0.0,
        "restoring": controller.resolve_restoring(len(vehicle.spins), dimension, gait),
        "watched": whole,
        "watched_without": rest,
        "upper_side": side,
        "upper_side_without": side_without,
    }


def _rotor_tables(plan: FlightPlan) -> Values:
    """The table of the rotors, and for a supervisor the one without a failed rotor."""
    controller: Any = plan.scenario.controller
    table, lost = plan.scenario.any_rotorcraft.multirotor.table, controller.failed_rotor
    if controller.supervision is None or lost is None:
        return table
    return (*table, *without_rotor(table, lost))


@cache
def multirotor_loop(
    layout: RotorLayout, form: Form, measured: bool, strategy: str, limited: bool
) -> ClosedLoop:
    """The closed loop of attitude and force control of all multirotors of a layout.

    Args:
        layout: Layout of the vehicles.
        form: Options of the law.
        measured, strategy, limited: See `tiltrotor_loop`.
    """
    rotors, places = layout.tilt_of_rotor, layout.places
    turning = places.rotors if form.norm == "speed" else 0  # else they may stop

    def signs(seen: Seen, p: Any, knots: Any) -> Any:
        """Independence of the outputs and, in the norm of the speeds, the rotors' speeds."""
        rows, up = present_wrench(seen, p, knots, rotors)
        side = xp.where(seen.time >= p.failure.known_from, p.upper_side_without, p.upper_side)
        speeds = state_of(seen.state, rotors).speeds[:turning]
        if p.decoupling == PUBLISHED_DECOUPLING:  # the factor 2 |varpi| is in rows of force only
            speeds = xp.ones(turning)
        return xp.hstack([independence(rows, up, side, form), speeds])

    return _tracking_loop(
        layout,
        gait_feedforward.multirotor_law_of(rotors, form),
        Parameters,
        multirotor_supervision_of(rotors, form.dimension, form.forward),
        (measured, strategy, limited),
        turning,
        own=_attitude_force,
        tables=_rotor_tables,
        states=INTEGRALS,
        signals=SIGNALS,
        units={NULL_PART: "1", CONDITION: "1"},
        margins=margins_of(layout, form.dimension),
        signs=signs,
    )


# --- full pose ---------------------------------------------------------------------------------


def _tiltrotor_margins(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
    """`singularity_columns`; three rotors do not span torque and lift: singular at any attitude."""
    law = setup.parameters.law
    intact = samples["time"] < law.failure.known_from
    columns = singularity_columns(samples, law.vehicle)
    return {name: np.where(intact, column, 0.0) for name, column in columns.items()}


def _tilt_weight(plan: FlightPlan) -> dict[str, Any]:
    controller: Any = plan.scenario.controller
    vehicle, even = plan.scenario.any_rotorcraft.resolve(), controller.tilt_weight == "even"
    weigh = full_pose.force_balanced_tilt_weight
    return {"tilt_weight": weigh(vehicle) if even else full_pose.PUBLISHED_TILT_WEIGHT}


@cache
def full_pose_loop(layout: RotorLayout) -> ClosedLoop:
    """Full-pose control of all vehicles of a layout."""
    rotors, places = layout.tilt_of_rotor, layout.places
    stops = rotor_stops(places.rotors)
    parts: dict[str, Any] = {"margins": margins_of(layout), "tables": _rotor_tables}
    record = full_pose.Parameters
    if layout.cross:
        parts = {"margins": _tiltrotor_margins, "columns": (*EXTRA_COLUMNS,)}
        record = changed_record(record, vehicle=Vehicle)
    law = Law(
        lambda seen, p, knots: full_pose.full_pose(seen, p, knots, rotors),
        record,
        own=_tilt_weight,
        states=dict.fromkeys(places.names("tilt_command"), "rad"),
        initial=lambda plan: initial_tilts(plan)[0],
        tilts=tilts_in_states(0, places.tilts),
        # A pod that turns across its thrust spans one plane with it at any angle: the rank of such
        # rotors' matrix changes only where one of them stops, whichever of them are lost.
        signs=lambda seen, _p, _knots: state_of(seen.state, rotors).speeds,
        causes=lambda _sample, _setup: stops,
        **parts,
    )
    return rotor_loop(layout, law)
