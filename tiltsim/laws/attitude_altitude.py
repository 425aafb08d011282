"""The attitude-altitude controller in a closed loop with the tiltrotor (ch. 3 and 4)."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from tiltsim.closed_loop.loop import Monitoring
from tiltsim.laws.rotor_loop import RotorLaw
from tiltsim.laws.tiltrotor import (
    TILTROTOR_LAYOUT,
    determinant_and_speed_causes,
    determinant_and_speeds,
    four,
    singularity_margins,
    tiltrotor_motion,
    watched_vehicle,
)
from tiltsim.laws.tracking import supervised_loop
from tiltsim.scenario.tiltrotor_controllers import AttitudeAltitudeController
from tiltsim.vehicles.rotorcraft import ROTORCRAFT
from tiltsim_controllers.laws.attitude_altitude import (
    DECOUPLINGS,
    EXACT_DECOUPLING,
    Parameters,
    attitude_reference,
    rotor_accelerations,
)
from tiltsim_controllers.laws.decouplers import DECOUPLERS
from tiltsim_controllers.laws.supervisor import SUPERVISOR_AT_REST
from tiltsim_controllers.laws.tiltrotor_supervisor import SUPERVISION
from tiltsim_controllers.mathematics.scalar import Quad, Triple, Values, Vector, scalar
from tiltsim_controllers.references.trajectories import position_reference
from tiltsim_controllers.vehicle.decoupling_matrix import sines_and_cosines, torque_entries
from tiltsim_controllers.vehicle.parameters import drag_ratio
from tiltsim_controllers.vehicle.states import ALPHA_1

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan


@scalar
def _inputs(
    time: float,
    state: Values,
    moving: Values,
    states: Values,
    parameters: Any,
    knots: Vector,
    motion: Triple = SUPERVISOR_AT_REST,
) -> Quad:
    """Rotor accelerations (rad/s^2); see `tiltsim.closed_loop.loop.SupervisedLaw`."""
    return rotor_accelerations(time, state, parameters.law, knots)


@scalar
def _measured_inputs(
    time: float,
    state: Values,
    moving: Values,
    states: Values,
    parameters: Any,
    knots: Vector,
    motion: Triple = SUPERVISOR_AT_REST,
) -> Quad:
    """The same by the measured angular acceleration, which comes after the four tilt rates."""
    measured = moving[4], moving[5], moving[6]
    return rotor_accelerations(time, state, parameters.law, knots, measured)


def _setup(plan: FlightPlan) -> tuple[Parameters, Values]:
    controller, rotorcraft = plan.scenario.controller, plan.scenario.rotorcraft
    assert isinstance(controller, AttitudeAltitudeController)
    law = Parameters(
        vehicle=rotorcraft.resolve(),
        gains=controller.resolve_gains(),
        gait=plan.gait.parameters,
        reference=plan.reference,
        decoupler=DECOUPLERS[controller.decoupler],
        decoupling=DECOUPLINGS[controller.decoupling],
    )
    return law, ()


@scalar
def _references(
    time: float, state: Values, parameters: Any, knots: Vector, motion: Triple = SUPERVISOR_AT_REST
) -> Values:
    """Position and attitude; see `tiltsim.closed_loop.loop.SupervisedLaw`."""
    law = parameters.law
    ratio = drag_ratio(law.vehicle)
    a1, a2, a3, a4 = four(state, ALPHA_1)
    trig = sines_and_cosines(a1, a2, a3, a4)
    torque = torque_entries(trig, ratio)
    x, y, z, _, _, _, _, _, _ = position_reference(time, law.reference, knots)
    roll, pitch, yaw, _, _, _ = attitude_reference(time, state, trig, torque, law, knots)
    return x, y, z, roll, pitch, yaw


@scalar
def sign_check_values(time: float, values: Vector, parameters: Any, knots: Vector) -> Values:
    """The determinant of the decoupling matrix, and the rotor speeds where it vanishes with them.

    As published, the factor ``2 |varpi|`` is in one row only, and a rotor at rest is harmless.
    """
    numbers = determinant_and_speeds(time, values, parameters, knots)
    if parameters.law.decoupling == EXACT_DECOUPLING:
        return numbers
    return numbers[0], 1.0, 1.0, 1.0, 1.0


TILTROTOR, MEASURED_TILTROTOR = (
    replace(
        supervised_loop(
            TILTROTOR_LAYOUT,
            RotorLaw(
                "attitude_altitude",
                inputs,
                Parameters,
                _setup,
                references=_references,
                margins=singularity_margins,
                measured=measured,
                motion=tiltrotor_motion,
            ),
            SUPERVISION,
            watched_vehicle,
        ),
        kind=ROTORCRAFT,
        monitoring=Monitoring(sign_check_values, determinant_and_speed_causes),
    )
    for inputs, measured in ((_inputs, False), (_measured_inputs, True))
)
"""The attitude-altitude controller of the tiltrotor; the second with the angular acceleration of
the plant in place of the model's."""
