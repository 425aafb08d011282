"""Switching between yaw-position and attitude-altitude control of the quadrotor (ch. 2, Sec. 5).

Ch. 2 takes its determinant surface for singular near level attitude and hands the vehicle over to
the attitude-altitude law there. The choice is a function of the attitude alone, without memory.

Only the yaw-position law has states of its own, the thrust ``zeta`` and its rate ``xi``. What they
do while the other law flies is not printed; `EXTENSIONS` lists what they may do. Bumpless, they
follow the thrust and thrust rate that the attitude-altitude law makes, so that thrust and thrust
rate go on without a step when the yaw-position law takes over again.
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

RUNNING: Final = 0.0
HELD: Final = 1.0
BUMPLESS: Final = 2.0

EXTENSIONS: Final = {"running": RUNNING, "held": HELD, "bumpless": BUMPLESS}
"""What the extension's states do while the attitude-altitude law flies, by name.

``running``: they go on under the yaw-position law, unheard. ``held``: they keep their values.
``bumpless``: they follow the thrust that is flown.
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
    """All that the law needs to know besides time and state."""

    yaw_position: yaw_position.Parameters  # vehicle and reference are those of both laws
    attitude_altitude: attitude_altitude.Gains
    zone: Zone
    extension: float
    extension_rate: float = 100.0  # 1/s, how fast bumpless states reach the flown thrust


@scalar
def in_attitude_zone(roll: float, pitch: float, zone: Zone) -> bool:
    """Whether the attitude-altitude law flies at this attitude (ch. 2, Eq. 47)."""
    return zone.roll_min <= roll <= zone.roll_max and zone.pitch_min <= pitch <= zone.pitch_max


@scalar
def attitude_altitude_thrust_rate(
    time: float,
    state: Values,
    thrust: float,
    parameters: Parameters,
    knots: Vector = NO_KNOTS,
) -> float:
    """Rate (N/s) of the thrust that the attitude-altitude law makes, ``thrust`` in N."""
    vz, roll, pitch = state[5], state[6], state[7]
    vehicle, gains = parameters.yaw_position.vehicle, parameters.attitude_altitude
    reference = reference_derivatives(time, parameters.yaw_position.reference, knots)
    vz_ref, az_ref = reference[5], reference[8]
    upright = cos(roll) * cos(pitch)
    if upright == 0.0:
        return nan
    az = thrust * upright / vehicle.mass - vehicle.gravity
    lift_rate = gains.altitude_1 * (az_ref - az) + gains.altitude_2 * (vz_ref - vz)
    roll_rate, pitch_rate, _ = euler_rates(roll, pitch, state[9], state[10], state[11])
    return vehicle.mass * lift_rate / upright + thrust * (
        tan(roll) * roll_rate + tan(pitch) * pitch_rate
    )


@scalar
def switching_inputs(
    time: float, state: Values, parameters: Parameters, knots: Vector = NO_KNOTS
) -> Inputs:
    """Thrust, torques and the rates of the extension's states (`INPUT_FIELDS`), world z up."""
    law = parameters.yaw_position
    if not in_attitude_zone(state[6], state[7], parameters.zone):
        return yaw_position_inputs(time, state, law, knots)
    thrust, roll_torque, pitch_torque, yaw_torque = attitude_altitude_inputs(
        time, state, law.vehicle, parameters.attitude_altitude, law.reference, knots
    )
    zeta, xi = state[12], state[13]
    zeta_rate, xi_rate = 0.0, 0.0
    if parameters.extension == RUNNING:
        _, _, _, _, zeta_rate, xi_rate = yaw_position_inputs(time, state, law, knots)
    elif parameters.extension == BUMPLESS:
        thrust_rate = attitude_altitude_thrust_rate(time, state, thrust, parameters, knots)
        zeta_rate = thrust_rate + parameters.extension_rate * (thrust - zeta)
        xi_rate = parameters.extension_rate * (thrust_rate - xi)
    return thrust, roll_torque, pitch_torque, yaw_torque, zeta_rate, xi_rate
