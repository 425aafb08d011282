"""The attitude-altitude controller in a closed loop with the tiltrotor (ch. 3 and 4)."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

from tiltsim.closed_loop.loop import Monitoring, SupervisedLaw
from tiltsim.laws.rotor_loop import RotorLaw, rotor_loop, with_measured_inputs
from tiltsim.laws.rotorcraft import REFERENCE_COLUMNS
from tiltsim.laws.tiltrotor import (
    TILTROTOR_LAYOUT,
    determinant_and_speed_causes,
    determinant_and_speeds,
    four,
    measured_acceleration,
    singularity_margins,
    tiltrotor_motion,
    tiltrotor_state,
    watched_vehicle,
)
from tiltsim.laws.tracking import follows_position
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
from tiltsim_controllers.vehicle.states import ALPHA_1, TILTROTOR_FIELDS

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan


@scalar
def _inputs(
    time: float, state: Values, tilt_rates: Values, states: Values, parameters: Any, knots: Vector
) -> Quad:
    """Rotor accelerations (rad/s^2); see `RotorLaw.inputs`."""
    return rotor_accelerations(time, state, parameters.law, knots)


@scalar
def _supervised_controls(
    time: float,
    state: Values,
    qvel: Vector,
    act: Vector,
    motion: Triple,
    parameters: Any,
    knots: Vector,
) -> Quad:
    """Rotor accelerations (rad/s^2); see `tiltsim.closed_loop.loop.SupervisedLaw`."""
    return rotor_accelerations(time, state, parameters.law, knots)


@scalar
def _measured_inputs(
    time: float,
    state: Values,
    qvel: Vector,
    act: Vector,
    motion: Triple,
    parameters: Any,
    knots: Vector,
) -> Quad:
    """`_supervised_controls` by the measured angular acceleration."""
    return rotor_accelerations(time, state, parameters.law, knots, measured_acceleration(qvel))


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
def _supervised_references(
    time: float, state: Values, motion: Triple, parameters: Any, knots: Vector
) -> Values:
    """`REFERENCE_COLUMNS`; see `tiltsim.closed_loop.loop.SupervisedLaw`."""
    law = parameters.law
    ratio = drag_ratio(law.vehicle)
    a1, a2, a3, a4 = four(state, ALPHA_1)
    trig = sines_and_cosines(a1, a2, a3, a4)
    torque = torque_entries(trig, ratio)
    x, y, z, _, _, _, _, _, _ = position_reference(time, law.reference, knots)
    roll, pitch, yaw, _, _, _ = attitude_reference(time, state, trig, torque, law, knots)
    return x, y, z, roll, pitch, yaw


@scalar
def _references(time: float, state: Values, parameters: Any, knots: Vector) -> Values:
    """The same without a supervisor."""
    return _supervised_references(time, state, SUPERVISOR_AT_REST, parameters, knots)


@scalar
def sign_check_values(time: float, values: Vector, parameters: Any, knots: Vector) -> Values:
    """The determinant of the decoupling matrix, and the rotor speeds where it vanishes with them.

    As published, the factor ``2 |varpi|`` is in one row only, and a rotor at rest is harmless.
    """
    numbers = determinant_and_speeds(time, values, parameters, knots)
    if parameters.law.decoupling == EXACT_DECOUPLING:
        return numbers
    return numbers[0], 1.0, 1.0, 1.0, 1.0


TILTROTOR: Final = replace(
    rotor_loop(
        TILTROTOR_LAYOUT,
        RotorLaw(
            "attitude_altitude",
            _inputs,
            Parameters,
            _setup,
            references=_references,
            margins=singularity_margins,
            motion=tiltrotor_motion,
        ),
    ),
    kind=ROTORCRAFT,
    monitoring=Monitoring(sign_check_values, determinant_and_speed_causes),
    supervised=SupervisedLaw(
        SUPERVISION,
        watched_vehicle,
        tiltrotor_state,
        _supervised_controls,
        _supervised_references,
        REFERENCE_COLUMNS,
        TILTROTOR_FIELDS,
        singularity_margins,
    ),
    follows_position=follows_position,
)
"""The attitude-altitude controller of the tiltrotor."""

MEASURED_TILTROTOR: Final = with_measured_inputs(TILTROTOR, _measured_inputs)
"""The same with the angular acceleration of the plant in place of the model's."""
