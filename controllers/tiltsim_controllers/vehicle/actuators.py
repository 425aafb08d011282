"""What stands between a control law and its vehicle: sensors, servos, motors, and what breaks.

Everything is a function of time, state and parameters, so that it can be evaluated at every
integrator stage and restarted anywhere.
"""

from __future__ import annotations

from math import floor, inf, sqrt
from typing import NamedTuple

from tiltsim_controllers.mathematics.noise import normal
from tiltsim_controllers.mathematics.scalar import Quad, scalar

# --- sensors -----------------------------------------------------------------------------------


class Sensor(NamedTuple):
    """Error of a measured vector: zero-mean normal noise on each axis, and a constant bias."""

    noise: float = 0.0  # standard deviation of a reading
    bias_x: float = 0.0
    bias_y: float = 0.0
    bias_z: float = 0.0


class Sensors(NamedTuple):
    """What a law is told of its vehicle's motion."""

    active: float = 0.0  # 0: the truth
    seed: float = 0.0
    period: float = 1.0  # s, for which a reading stands
    position: Sensor = Sensor()  # m, world
    velocity: Sensor = Sensor()  # m/s, world
    attitude: Sensor = Sensor()  # rad, a small rotation in body axes
    body_rates: Sensor = Sensor()  # rad/s, body


@scalar
def reading_error(
    sensor: Sensor, seed: float, channel: float, index: float
) -> tuple[float, float, float]:
    """What a reading adds to the truth; ``channel`` and the next two are the sensor's own."""
    x, y, z = sensor.bias_x, sensor.bias_y, sensor.bias_z
    noise = sensor.noise
    if noise > 0.0:
        x += noise * normal(seed, channel, index)
        y += noise * normal(seed, channel + 1.0, index)
        z += noise * normal(seed, channel + 2.0, index)
    return x, y, z


@scalar
def reading_index(time: float, period: float) -> float:
    """The number of the reading that stands at a time (s); readings begin at multiples."""
    return float(floor(time / period + 1e-6))  # a time step's rounding must not delay one


@scalar
def rotate_by_small_angle(
    qw: float, qx: float, qy: float, qz: float, x: float, y: float, z: float
) -> Quad:
    """A unit quaternion turned further by a small rotation vector (rad, body axes).

    The rotation of ``tan(angle / 2) = |vector| / 2``: to the third order that of the vector.
    """
    x, y, z = 0.5 * x, 0.5 * y, 0.5 * z
    scale = 1.0 / sqrt(1.0 + x * x + y * y + z * z)
    return (
        scale * (qw - qx * x - qy * y - qz * z),
        scale * (qx + qw * x + qy * z - qz * y),
        scale * (qy + qw * y + qz * x - qx * z),
        scale * (qz + qw * z + qx * y - qy * x),
    )


# --- servos and motors -------------------------------------------------------------------------


@scalar
def rate_limited_command(command: float, angle: float, reach: float) -> float:
    """The set point (rad) with which a servo turns to its command no faster than it can.

    The servo ``alpha'' = omega^2 (command - alpha) - 2 zeta omega alpha'`` is a velocity loop
    ``alpha'' = 2 zeta omega (wanted - alpha')`` inside a position loop ``wanted = omega / (2 zeta)
    (command - alpha)``. Limiting the wanted rate to ``max_rate`` keeps the set point within the
    ``reach`` ``2 zeta / omega max_rate`` of the present angle; within it nothing changes.
    """
    if command > angle + reach:
        return angle + reach
    if command < angle - reach:
        return angle - reach
    return command


@scalar
def limited_speed_command_rate(
    told: float, rate: float, spin: float, slowest: float, fastest: float
) -> float:
    """The rate (rad/s^2) of the speed that a motor is told, from the one that a law asks for.

    Beyond the rotor's limits (rad/s, along its spin) it goes no further: what no rotor can follow
    would have to be taken back before the rotor obeys again.
    """
    if spin * told >= fastest and spin * rate > 0.0:
        return 0.0
    if spin * told <= slowest and spin * rate < 0.0:
        return 0.0
    return rate


# --- faults ------------------------------------------------------------------------------------


class RotorFault(NamedTuple):
    """What breaks on one rotor, and when; never unless given."""

    thrust_time: float = inf  # s, from when on thrust and drag torque shrink
    thrust_factor: float = 1.0
    stuck_time: float = inf  # s, from when on the tilt servo holds one angle
    stuck_angle: float = 0.0  # rad


class Faults(NamedTuple):
    """What breaks on each rotor."""

    rotor_1: RotorFault = RotorFault()
    rotor_2: RotorFault = RotorFault()
    rotor_3: RotorFault = RotorFault()
    rotor_4: RotorFault = RotorFault()


@scalar
def thrust_factor(time: float, fault: RotorFault) -> float:
    """What is left of a rotor's thrust and drag torque at a time, 1 while it is sound."""
    return fault.thrust_factor if time >= fault.thrust_time else 1.0


@scalar
def servo_command(time: float, command: float, fault: RotorFault) -> float:
    """The angle (rad) that a tilt servo goes to: its command, or where it is stuck."""
    return fault.stuck_angle if time >= fault.stuck_time else command
