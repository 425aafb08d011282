"""Switching between yaw-position and attitude-altitude control of the quadrotor (ch. 2, Sec. 5).

Ch. 2 considers its determinant surface singular near level attitude and switches to the
attitude-altitude controller there. The choice is a function of the attitude only, without memory.

Only the yaw-position controller has states of its own, the thrust ``zeta`` and its rate ``xi``. The
chapter does not state how they evolve while the other controller is active; `EXTENSIONS` lists the
options. With ``bumpless`` they follow the thrust and thrust rate of the attitude-altitude
controller, so that both are continuous when the yaw-position controller takes over again.
"""

from __future__ import annotations

from math import cos, nan, tan
from typing import Final, NamedTuple

import tiltsim_controllers.laws.quadrotor_attitude_altitude as attitude_altitude
import tiltsim_controllers.laws.yaw_position as yaw_position
from tiltsim_controllers.gaits.parameters import NO_KNOTS
from tiltsim_controllers.laws.quadrotor_attitude_altitude import attitude_altitude_inputs
from tiltsim_controllers.laws.yaw_position import Inputs, euler_rates, yaw_position_inputs
from tiltsim_controllers.mathematics.scalar import Values, Vector, scalar
from tiltsim_controllers.references.trajectories import reference_derivatives
from tiltsim_controllers.vehicle.states import PITCH, ROLL, THRUST, THRUST_RATE

RUNNING: Final = 0.0
HELD: Final = 1.0
BUMPLESS: Final = 2.0

EXTENSIONS: Final = {"running": RUNNING, "held": HELD, "bumpless": BUMPLESS}
"""Behaviour of the extension's states while the attitude-altitude controller is active, by name.

``running``: they evolve under the inactive yaw-position controller. ``held``: they are constant.
``bumpless``: they follow the active controller's thrust.
"""


class Zone(NamedTuple):
    """A rectangle of roll and pitch (rad), edges included; world z up."""

    roll_min: float
    roll_max: float
    pitch_min: float
    pitch_max: float


# Eq. (47); its pitch is ch. 2's, but the interval is symmetric. The lower bound of roll, -pi/2, is
# the edge of the attitudes that ch. 2 considers.
PUBLISHED_ZONE: Final = Zone(-1.5707963267948966, 0.2, -0.5, 0.5)


class Parameters(NamedTuple):
    """Parameters of both controllers and of the switching."""

    yaw_position: yaw_position.Parameters  # with vehicle and reference of both controllers
    attitude_altitude: attitude_altitude.Gains
    zone: Zone
    extension: float
    extension_rate: float = 100.0  # 1/s, at which bumpless states approach the active thrust


@scalar
def in_attitude_zone(roll: float, pitch: float, zone: Zone) -> bool:
    """Whether the attitude-altitude controller is active at an attitude (rad; ch. 2, Eq. 47)."""
    return zone.roll_min <= roll <= zone.roll_max and zone.pitch_min <= pitch <= zone.pitch_max


@scalar
def attitude_altitude_thrust_rate(
    time: float, state: Values, thrust: float, parameters: Parameters, knots: Vector = NO_KNOTS
) -> float:
    """Rate (N/s) of the attitude-altitude controller's thrust.

    Args:
        time: s
        state: `tiltsim_controllers.vehicle.states.BODY_FIELDS`; what follows is not read
        thrust: N
        parameters, knots: of the controller and of the reference
    """
    _, _, _, _, _, vz, roll, pitch, _, p, q, r = state[:12]
    vehicle, gains = parameters.yaw_position.vehicle, parameters.attitude_altitude
    _, _, _, _, _, vz_ref, _, _, az_ref, _, _, _, _, _, _ = reference_derivatives(
        time, parameters.yaw_position.reference, knots
    )
    upright = cos(roll) * cos(pitch)
    if upright == 0.0:
        return nan
    az = thrust * upright / vehicle.mass - vehicle.gravity
    lift_rate = gains.altitude_1 * (az_ref - az) + gains.altitude_2 * (vz_ref - vz)
    roll_rate, pitch_rate, _ = euler_rates(roll, pitch, p, q, r)
    return vehicle.mass * lift_rate / upright + thrust * (
        tan(roll) * roll_rate + tan(pitch) * pitch_rate
    )


@scalar
def switching_inputs(
    time: float, state: Values, parameters: Parameters, knots: Vector = NO_KNOTS
) -> Inputs:
    """`INPUT_FIELDS`: thrust, torques and rates of the extension's states, world z up.

    Args:
        time: s
        state: `tiltsim_controllers.vehicle.states.EXTENDED_QUADROTOR_FIELDS`
        parameters, knots: of the controllers and of the reference
    """
    law = parameters.yaw_position
    if not in_attitude_zone(state[ROLL], state[PITCH], parameters.zone):
        return yaw_position_inputs(time, state, law, knots)
    thrust, roll_torque, pitch_torque, yaw_torque = attitude_altitude_inputs(
        time, state, law.vehicle, parameters.attitude_altitude, law.reference, knots
    )
    zeta, xi = state[THRUST], state[THRUST_RATE]
    zeta_rate, xi_rate = 0.0, 0.0
    if parameters.extension == RUNNING:
        _, _, _, _, zeta_rate, xi_rate = yaw_position_inputs(time, state, law, knots)
    elif parameters.extension == BUMPLESS:
        thrust_rate = attitude_altitude_thrust_rate(time, state, thrust, parameters, knots)
        zeta_rate = thrust_rate + parameters.extension_rate * (thrust - zeta)
        xi_rate = parameters.extension_rate * (thrust_rate - xi)
    return thrust, roll_torque, pitch_torque, yaw_torque, zeta_rate, xi_rate
