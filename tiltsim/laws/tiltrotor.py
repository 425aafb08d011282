"""Attitude-altitude control of the tiltrotor in closed loops (ch. 3 and 4)."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from math import inf
from typing import Any, Final

import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup
from tiltsim.engines.sample_evaluation import flights_in
from tiltsim.laws.law import (
    INTEGRALS,
    Law,
    decouples_position,
    integrals_at_rest,
    parameters_of,
    supervised,
    tracking_parameters,
)
from tiltsim.laws.rotor_loop import RotorLayout, rotor_loop, rotor_stops, singular_attitude
from tiltsim.scenario.scenario import FlightPlan
from tiltsim.scenario.tiltrotor_controllers import AttitudeAltitudeController
from tiltsim.vehicles.rotorcraft import ROTORCRAFT
from tiltsim_controllers.analysis.singularity import determinant, margin_over_gait
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.laws import attitude_altitude, gait_feedforward
from tiltsim_controllers.laws.allocation import RotorRange
from tiltsim_controllers.laws.attitude_altitude import PUBLISHED_DECOUPLING
from tiltsim_controllers.laws.multirotor import SIGNALS
from tiltsim_controllers.laws.multirotor_steps import EULER_ANGLES
from tiltsim_controllers.laws.observed import Seen, Step
from tiltsim_controllers.laws.supervised_vehicles import SUPERVISION
from tiltsim_controllers.mathematics.attitude import rotation_matrix
from tiltsim_controllers.mathematics.linear import kernel
from tiltsim_controllers.mathematics.scalar import Floats, Values
from tiltsim_controllers.vehicle.parameters import SPIN, Vehicle
from tiltsim_controllers.vehicle.rotors import airframe, wrench_map
from tiltsim_controllers.vehicle.states import TILT_FIELDS, state_of

LAYOUT: Final = RotorLayout((0, 1, 2, 3), SPIN, "tiltrotor")


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


def _margins(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
    return singularity_columns(samples, setup.parameters.law.vehicle)


def _determinant_and_speeds(seen: Seen, p: Any, knots: Any) -> Any:
    """Determinant of the decoupling matrix by its scale, and the rotor speeds (rad/s), shape (5,).

    ``det [tau; r3^T F] = 2 L^2 K_f^3 K_m (n . r3)`` with ``n . r3 = 4`` for a level untilted
    vehicle, here in units of ``K_f``. The factors ``2 |varpi|`` of the exact matrix vanish with a
    speed; as published they are in one row only, and a rotor at rest is harmless.
    """
    layout, vehicle = LAYOUT.tilt_of_rotor, p.vehicle
    now, (_, rotors) = state_of(seen.state, layout), airframe(p, knots, layout)
    wrench = wrench_map(rotors, now.tilts)
    arm, drag = vehicle.arm_length, vehicle.drag_coefficient / vehicle.thrust_coefficient
    scale = 2.0 * arm * arm * drag
    determinant = -(rotation_matrix(now.attitude)[2] @ wrench[:3] @ kernel(wrench[3:]))
    speeds = xp.ones(4) if p.decoupling == PUBLISHED_DECOUPLING else now.speeds
    return xp.hstack([determinant / scale, speeds])


def _causes(sample: Mapping[str, float], _setup: ControlSetup) -> tuple[str, ...]:
    return (singular_attitude(sample, TILT_FIELDS), *rotor_stops(4))


def _limits(plan: FlightPlan) -> RotorRange:
    controller, vehicle = plan.scenario.controller, plan.scenario.rotorcraft
    assert isinstance(controller, AttitudeAltitudeController)
    low, high = vehicle.min_rotor_speed, vehicle.max_rotor_speed
    return RotorRange(
        0.0 if low is None else low, inf if high is None else high, controller.allocation_horizon
    )


def _setup(plan: FlightPlan) -> tuple[Any, Values]:
    controller, vehicle = plan.scenario.controller, plan.scenario.rotorcraft.resolve()
    assert isinstance(controller, AttitudeAltitudeController)
    gains, supervisor = controller.resolve_gains(), controller.resolve_supervisor(vehicle)
    limits = _limits(plan)
    known = {"vehicle": vehicle, "gains": gains, "supervisor": supervisor, "limits": limits}
    return parameters_of(plan, attitude_altitude.Parameters, **known), ()


def _feedforward_setup(plan: FlightPlan) -> tuple[Any, Values]:
    controller, rotorcraft = plan.scenario.controller, plan.scenario.rotorcraft
    assert isinstance(controller, AttitudeAltitudeController)
    vehicle, is_fed_forward = rotorcraft.resolve(), controller.rotor_inertia_feedforward
    law = tracking_parameters(
        plan,
        gait_feedforward.Parameters,
        vehicle=vehicle,
        supervisor=controller.resolve_supervisor(vehicle),
        limits=_limits(plan),
        rotor_inertia=rotorcraft.rotor_inertia if is_fed_forward else 0.0,
        attitude_error=EULER_ANGLES,
        slowest_rotor=0.0,
        turn_time=0.0,
    )
    return law, ()


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
    common: dict[str, Any] = {
        "margins": _margins,
        "signs": _determinant_and_speeds,
        "causes": _causes,
        "measured": measured,
        "follows_position": decouples_position,
    }

    def flown(step: Callable[..., Step]) -> Callable[..., Step]:
        return gait_feedforward.prioritized(step, LAYOUT.tilt_of_rotor) if limited else step

    if name == "gait_feedforward":
        form = gait_feedforward.FORM._replace(supervised=bool(strategy))
        law = Law(
            flown(gait_feedforward.tiltrotor_law_of(form)),
            gait_feedforward.Parameters,
            _feedforward_setup,
            states=INTEGRALS,
            initial=integrals_at_rest,
            signals=SIGNALS[:3],
            **common,
        )
    else:
        law = Law(
            flown(attitude_altitude.attitude_altitude),
            attitude_altitude.Parameters,
            _setup,
            signals=SIGNALS[:3],
            **common,
        )
    return replace(rotor_loop(LAYOUT, supervised(law, SUPERVISION, strategy)), kind=ROTORCRAFT)
