"""From a scenario's tables to what the control step reads: a parameter record and a table."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from controllers.attitude_altitude import DECOUPLINGS, Parameters
from controllers.decouplers import DECOUPLERS
from controllers.records import flatten
from controllers.references import REFERENCE_TYPES, ReferenceParameters
from tiltsim.control import TILTROTOR, ControlParameters
from tiltsim.scenario import (
    AttitudeAltitudeReference,
    CircleReference,
    LineReference,
    Reference,
    Scenario,
)


class ControlSetup(NamedTuple):
    """What the control step of one flight reads besides the state."""

    parameters: ControlParameters
    table: tuple[float, ...]  # keyframes of the gait

    @property
    def userdata(self) -> npt.NDArray[np.float64]:
        """Record and table as MuJoCo's `userdata` holds them."""
        return np.array([*flatten(self.parameters), *self.table])


def control_setup(scenario: Scenario) -> ControlSetup:
    """Everything the control step of a scenario needs to know."""
    controller = scenario.controller
    servo = scenario.vehicle.tilt_servo
    vehicle = scenario.vehicle.resolve()
    gait = scenario.gait.plan(vehicle)
    parameters = ControlParameters(
        signature=TILTROTOR.signature,
        servo_lead=2.0 * servo.damping_ratio / servo.natural_frequency,
        law=Parameters(
            vehicle=vehicle,
            gains=controller.resolve_gains(),
            gait=gait.parameters,
            reference=reference_parameters(scenario.reference),
            decoupler=DECOUPLERS[controller.decoupler],
            decoupling=DECOUPLINGS[controller.decoupling],
        ),
    )
    return ControlSetup(parameters, gait.table)


def reference_parameters(reference: Reference) -> ReferenceParameters:
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
