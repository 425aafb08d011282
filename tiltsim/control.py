"""The control step: from MuJoCo's state to MuJoCo's controls, as scalar code.

One step serves every engine. It is a pure function of time, `qpos`, `qvel`, `act` and the
parameters in `userdata`, so that a saved state restarts exactly and an integrator may call it at
every stage.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

from controllers.attitude_altitude import Parameters, State, rotor_accelerations
from controllers.gaits import tilt_reference
from controllers.rotation import euler_from_quaternion
from controllers.scalar import Quad, scalar
from tiltsim.loop import Loop, Sizes


class ControlParameters(NamedTuple):
    """The head of `userdata`: what the control step of a flight needs to know."""

    signature: float  # see `tiltsim.loop.Loop.signature`
    servo_lead: float  # s, rate feed-forward of the tilt servos, 2 zeta / omega_n
    law: Parameters


@scalar
def tiltrotor_state(qpos: Sequence[float], qvel: Sequence[float], act: Sequence[float]) -> State:
    """The law's state (`controllers.attitude_altitude.STATE_FIELDS`) from MuJoCo's.

    MuJoCo gives the body's position, its quaternion and the tilt angles in ``qpos``, the velocity
    in world axes, the body rates in body axes and the tilt rates in ``qvel``.
    """
    x, y, z, qw, qx, qy, qz, alpha_1, alpha_2, alpha_3, alpha_4 = qpos
    vx, vy, vz, p, q, r = qvel[0], qvel[1], qvel[2], qvel[3], qvel[4], qvel[5]
    speed_1, speed_2, speed_3, speed_4 = act
    roll, pitch, yaw = euler_from_quaternion(qw, qx, qy, qz)
    return (
        *(x, y, z, vx, vy, vz, roll, pitch, yaw, p, q, r),
        *(alpha_1, alpha_2, alpha_3, alpha_4, speed_1, speed_2, speed_3, speed_4),
    )


@scalar
def rotor_thrust_controls(act: Sequence[float]) -> Quad:
    """Controls of the thrust actuators, ``s_i varpi_i |varpi_i|`` with ``s = (-1, 1, -1, 1)``."""
    speed_1, speed_2, speed_3, speed_4 = act
    return (
        -speed_1 * abs(speed_1),
        speed_2 * abs(speed_2),
        -speed_3 * abs(speed_3),
        speed_4 * abs(speed_4),
    )


@scalar
def tiltrotor_controls(
    time: float,
    qpos: Sequence[float],
    qvel: Sequence[float],
    act: Sequence[float],
    parameters: ControlParameters,
    table: Sequence[float],
) -> tuple[float, ...]:
    """All twelve controls of the tiltrotor: tilt servos, thrusts, rotor accelerations.

    The servo commands lead the planned angles by the servo's own lag, so that a stiff servo
    follows a moving gait and not only a resting one.
    """
    law = parameters.law
    lead = parameters.servo_lead
    a1, a2, a3, a4, rate_1, rate_2, rate_3, rate_4 = tilt_reference(time, law.gait, table)
    return (
        *(a1 + lead * rate_1, a2 + lead * rate_2, a3 + lead * rate_3, a4 + lead * rate_4),
        *rotor_thrust_controls(act),
        *rotor_accelerations(time, tiltrotor_state(qpos, qvel, act), law),
    )


@scalar
def refreshed_controls(ctrl: Sequence[float], act: Sequence[float]) -> tuple[float, ...]:
    """Held controls with the thrusts that belong to the present rotor speeds."""
    return (
        *(ctrl[0], ctrl[1], ctrl[2], ctrl[3]),
        *rotor_thrust_controls(act),
        *(ctrl[8], ctrl[9], ctrl[10], ctrl[11]),
    )


TILTROTOR: Final = Loop(
    model="tiltrotor",
    sizes=Sizes(qpos=11, qvel=10, act=4, ctrl=12),
    parameters=ControlParameters,
    controls=tiltrotor_controls,
    refresh=refreshed_controls,
)
"""The attitude-altitude law around the tiltrotor."""
