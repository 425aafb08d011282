"""The tiltrotor in closed loops: common parts, and attitude-altitude control (ch. 3 and 4)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup, Monitoring
from tiltsim.engines.sample_evaluation import flights_in
from tiltsim.equations.tiltrotor import equations_of_motion
from tiltsim.laws.parameters import parameters_of
from tiltsim.laws.rotor_loop import RotorLaw, RotorLayout
from tiltsim.laws.rotorcraft import rotor_stops, singular_attitude
from tiltsim.laws.tracking import INTEGRALS, integrals_at_rest, tracking_loop, tracking_parameters
from tiltsim.scenario.tiltrotor_controllers import AttitudeAltitudeController
from tiltsim.vehicles.rotorcraft import ROTORCRAFT
from tiltsim_controllers.analysis.singularity import determinant, margin_over_gait
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.code.traceable import traceable
from tiltsim_controllers.laws import attitude_altitude, gait_feedforward
from tiltsim_controllers.laws.attitude_altitude import PUBLISHED_DECOUPLING
from tiltsim_controllers.laws.multirotor_steps import EULER_ANGLES
from tiltsim_controllers.laws.tiltrotor_supervisor import SUPERVISION
from tiltsim_controllers.mathematics.attitude import rotation_matrix
from tiltsim_controllers.mathematics.linear import kernel
from tiltsim_controllers.mathematics.scalar import Floats, Values
from tiltsim_controllers.vehicle.parameters import SPIN, Vehicle, drag_ratio
from tiltsim_controllers.vehicle.rotors import airframe, wrench_map
from tiltsim_controllers.vehicle.states import ROTORS, TILT_FIELDS, TILTROTOR_FIELDS, state_of

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan

TILT_REFERENCE_COLUMNS: Final = tuple(f"alpha_ref_{rotor}" for rotor in ROTORS)


TILTROTOR_LAYOUT: Final = RotorLayout((0, 1, 2, 3), SPIN, "tiltrotor")


CROSS: Final = TILTROTOR_LAYOUT.tilt_of_rotor


def tiltrotor_motion(
    state: Any, tilts: Any, inputs: Any, parameters: Any, knots: Any, disturbance: Any
) -> Any:
    """The thesis's equations.

    Args:
        state, tilts, inputs, parameters, knots, disturbance: See `RotorLaw.motion`.
    """
    return equations_of_motion(state, tilts, inputs[:4], parameters.law.vehicle, disturbance)


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


def watched_vehicle(time: Any, parameters: Any) -> Any:
    """The vehicle parameter that the tiltrotor's supervisor reads."""
    return drag_ratio(parameters.law.vehicle)


def singularity_margins(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
    """`singularity_columns` of a flight; see `RotorLaw.margins`."""
    return singularity_columns(samples, setup.parameters.law.vehicle)


def _determinant_and_speeds(values: Any, law: Any) -> Any:
    """Determinant of the decoupling matrix by its scale, and the rotor speeds (rad/s), shape (5,).

    ``det [tau; r3^T F] = 2 L^2 K_f^3 K_m (n . r3)`` with ``n . r3 = 4`` for a level untilted
    vehicle, here in units of ``K_f``. The factors ``2 |varpi|`` of the exact matrix vanish with a
    speed; as published they are in one row only, and a rotor at rest is harmless.
    """
    now, (_, rotors) = state_of(values, CROSS), airframe(law, (), CROSS)
    wrench, vehicle = wrench_map(rotors, now.tilts), law.vehicle
    arm, drag = vehicle.arm_length, vehicle.drag_coefficient / vehicle.thrust_coefficient
    scale = 2.0 * arm * arm * drag
    determinant = -(rotation_matrix(now.attitude)[2] @ wrench[:3] @ kernel(wrench[3:]))
    speeds = xp.ones(4) if law.decoupling == PUBLISHED_DECOUPLING else now.speeds
    return xp.hstack([determinant / scale, speeds])


@traceable
def _sign_check_values(time: Any, values: Any, parameters: Any, knots: Any) -> Any:
    return _determinant_and_speeds(values[: len(TILTROTOR_FIELDS)], parameters.law)


def _causes(sample: Mapping[str, float], _setup: ControlSetup) -> tuple[str, ...]:
    return (singular_attitude(sample, TILT_FIELDS), *rotor_stops(4))


def tiltrotor_loops(law: RotorLaw) -> tuple[ClosedLoop, ClosedLoop]:
    """The closed loops of a law that follows a gait, whose vehicle is the tiltrotor.

    The second feeds back the angular acceleration of the plant in place of the model's.

    Args:
        law: The law for `tiltsim.laws.tracking`, without margins and motion.
    """
    own = law._replace(margins=singularity_margins, motion=tiltrotor_motion)

    def loop(*, measured: bool) -> ClosedLoop:
        measuring = own._replace(measured=measured)
        return replace(
            tracking_loop(TILTROTOR_LAYOUT, measuring, SUPERVISION, watched_vehicle),
            kind=ROTORCRAFT,
            monitoring=Monitoring(_sign_check_values, _causes),
        )

    return loop(measured=False), loop(measured=True)


def _without_gait(
    time: Any,
    state: Any,
    tilt_rates: Any,
    states: Any,
    parameters: Any,
    knots: Any,
    motion: Any,
    measured: Any = None,
) -> Any:
    """The law without feed-forward as `tiltsim.laws.tracking` takes it; it has no states."""
    return attitude_altitude.attitude_altitude_inputs(time, state, parameters, knots, measured)


def _setup(plan: FlightPlan) -> tuple[Any, Values]:
    controller, rotorcraft = plan.scenario.controller, plan.scenario.rotorcraft
    assert isinstance(controller, AttitudeAltitudeController)
    known = {"vehicle": rotorcraft.resolve(), "gains": controller.resolve_gains()}
    return parameters_of(plan, attitude_altitude.Parameters, **known), ()


TILTROTOR, MEASURED_TILTROTOR = tiltrotor_loops(
    RotorLaw("attitude_altitude", _without_gait, attitude_altitude.Parameters, _setup)
)
"""The attitude-altitude controller of the tiltrotor; the second with the angular acceleration of
the plant in place of the model's."""


def _feedforward_setup(plan: FlightPlan) -> tuple[Any, Values]:
    controller, rotorcraft = plan.scenario.controller, plan.scenario.rotorcraft
    assert isinstance(controller, AttitudeAltitudeController)
    vehicle, is_fed_forward = rotorcraft.resolve(), controller.rotor_inertia_feedforward
    law = tracking_parameters(
        plan,
        gait_feedforward.Parameters,
        vehicle=vehicle,
        supervisor=controller.resolve_supervisor(vehicle),
        rotor_inertia=rotorcraft.rotor_inertia if is_fed_forward else 0.0,
        attitude_error=EULER_ANGLES,
        slowest_rotor=0.0,
        turn_time=0.0,
    )
    return law, ()


GAIT_FEEDFORWARD, MEASURED_GAIT_FEEDFORWARD = tiltrotor_loops(
    RotorLaw(
        "gait_feedforward",
        gait_feedforward.tracking_inputs,
        gait_feedforward.Parameters,
        _feedforward_setup,
        states=INTEGRALS,
        initial=integrals_at_rest,
    )
)
"""The attitude-altitude controller with tilt-rate feed-forward, of the tiltrotor; the second with
the angular acceleration of the plant in place of the model's."""
