"""Switching between yaw-position and attitude-altitude control of the quadrotor (ch. 2, Sec. 5).

Ch. 2 considers its determinant surface singular near level attitude and switches to the
attitude-altitude controller there. The choice is a function of the attitude only, without memory.

Only the yaw-position controller has states of its own, the thrust ``zeta`` and its rate ``xi``. The
chapter does not state how they evolve while the other controller is active; `EXTENSIONS` lists the
options. With ``bumpless`` they follow the thrust and thrust rate of the attitude-altitude
controller, so that both are continuous when the yaw-position controller takes over again.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import tiltsim_controllers.laws.quadrotor_attitude_altitude as attitude_altitude
import tiltsim_controllers.laws.yaw_position as yaw_position
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.code.blocks import branch
from tiltsim_controllers.gaits.parameters import NO_KNOTS
from tiltsim_controllers.laws.quadrotor_attitude_altitude import attitude_altitude_inputs
from tiltsim_controllers.laws.yaw_position import yaw_position_inputs
from tiltsim_controllers.mathematics.attitude import euler_rates
from tiltsim_controllers.references.trajectories import reference_motion

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


def in_attitude_zone(roll: Any, pitch: Any, zone: Zone) -> Any:
    """Whether the attitude-altitude controller is active at an attitude (rad; ch. 2, Eq. 47)."""
    rolled = (zone.roll_min <= roll) & (roll <= zone.roll_max)
    return rolled & (zone.pitch_min <= pitch) & (pitch <= zone.pitch_max)


def attitude_altitude_thrust_rate(
    time: Any, state: Any, thrust: Any, parameters: Parameters, knots: Any = NO_KNOTS
) -> Any:
    """Rate (N/s) of the attitude-altitude controller's thrust.

    Args:
        time: s
        state: Begins with `tiltsim_controllers.vehicle.states.BODY_FIELDS`, shape (12,).
        thrust: N
        parameters: Of the controller.
        knots: Table data of the reference.
    """
    attitude, vz = state[6:9], state[5]
    vehicle, gains = parameters.yaw_position.vehicle, parameters.attitude_altitude
    motion = reference_motion(time, parameters.yaw_position.reference, knots)
    upright = xp.cos(attitude[0]) * xp.cos(attitude[1])
    upright = xp.where(upright == 0.0, xp.nan, upright)
    az = thrust * upright / vehicle.mass - vehicle.gravity
    lift_rate = gains.altitude_1 * (motion[2, 2] - az) + gains.altitude_2 * (motion[1, 2] - vz)
    leaning = xp.tan(attitude[:2]) @ euler_rates(attitude, state[9:12])[:2]
    return vehicle.mass * lift_rate / upright + thrust * leaning


def switching_inputs(time: Any, state: Any, parameters: Parameters, knots: Any = NO_KNOTS) -> Any:
    """`INPUT_FIELDS`: thrust, torques and rates of the extension's states, shape (6,).

    Args:
        time: s
        state: `tiltsim_controllers.vehicle.states.EXTENDED_QUADROTOR_FIELDS`, shape (14,).
        parameters: Of the controllers.
        knots: Table data of the reference.
    """
    law = parameters.yaw_position

    def outside() -> Any:
        return yaw_position_inputs(time, state, law, knots)

    def inside() -> Any:
        wrench = attitude_altitude_inputs(
            time, state, law.vehicle, parameters.attitude_altitude, law.reference, knots
        )
        extension = xp.zeros(2)
        if parameters.extension == RUNNING:
            extension = outside()[4:]
        elif parameters.extension == BUMPLESS:
            thrust = wrench[0]
            thrust_rate = attitude_altitude_thrust_rate(time, state, thrust, parameters, knots)
            flown = xp.array([thrust, thrust_rate])
            follow = parameters.extension_rate * (flown - state[12:14])
            extension = xp.array([thrust_rate, 0.0]) + follow
        return xp.hstack([wrench, extension])

    return branch(in_attitude_zone(state[6], state[7], parameters.zone), inside, outside)
