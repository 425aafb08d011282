"""From a scenario's tables to the parameter records that the control step reads."""

from __future__ import annotations

from controllers.attitude_altitude import DECOUPLINGS, Parameters
from controllers.decouplers import DECOUPLERS
from controllers.gaits import GAIT_TYPES, GaitParameters
from controllers.references import REFERENCE_TYPES, ReferenceParameters
from tiltsim.control import ControlParameters
from tiltsim.engine import SIGNATURE
from tiltsim.scenario import (
    AttitudeAltitudeReference,
    CircleReference,
    FixedGait,
    LineReference,
    Scenario,
    SetpointReference,
    TrotGait,
)


def control_parameters(scenario: Scenario) -> ControlParameters:
    """Everything the control step of a scenario needs, as one record of floats."""
    controller = scenario.controller
    servo = scenario.vehicle.tilt_servo
    return ControlParameters(
        signature=SIGNATURE,
        servo_lead=2.0 * servo.damping_ratio / servo.natural_frequency,
        law=Parameters(
            vehicle=scenario.vehicle.resolve(),
            gains=controller.resolve_gains(),
            gait=gait_parameters(scenario.gait),
            reference=reference_parameters(scenario.reference),
            decoupler=DECOUPLERS[controller.decoupler],
            decoupling=DECOUPLINGS[controller.decoupling],
        ),
    )


def gait_parameters(gait: FixedGait | TrotGait) -> GaitParameters:
    """The record of a ``[gait]`` table."""
    code = GAIT_TYPES[gait.type]
    if isinstance(gait, FixedGait):
        return GaitParameters(code, *gait.angles)
    return GaitParameters(code, amplitude=gait.amplitude, period=gait.period)


def reference_parameters(
    reference: SetpointReference | LineReference | CircleReference | AttitudeAltitudeReference,
) -> ReferenceParameters:
    """The record of a ``[reference]`` table."""
    code = REFERENCE_TYPES[reference.type]
    if isinstance(reference, AttitudeAltitudeReference):
        return ReferenceParameters(
            code,
            z=reference.altitude,
            roll=reference.roll,
            pitch=reference.pitch,
            yaw=reference.yaw,
        )
    common = ReferenceParameters(
        code,
        *reference.position,
        yaw=reference.yaw,
        acceleration_feedforward=float(reference.acceleration_feedforward),
    )
    if isinstance(reference, LineReference):
        vx, vy, vz = reference.velocity
        return common._replace(velocity_x=vx, velocity_y=vy, velocity_z=vz)
    if isinstance(reference, CircleReference):
        return common._replace(
            radius=reference.radius, angular_frequency=reference.angular_frequency
        )
    return common
