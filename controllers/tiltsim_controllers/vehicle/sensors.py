"""Measurement errors of the sensors: noise, bias and sampling.

Everything is a function of time, state and parameters, so that it can be evaluated at every
integrator stage and restarted anywhere.
"""

from __future__ import annotations

from math import floor, sqrt
from typing import NamedTuple

from tiltsim_controllers.mathematics.noise import normal
from tiltsim_controllers.mathematics.scalar import Quad, Triple, scalar


class Sensor(NamedTuple):
    """Error of a measured vector: zero-mean normal noise on each axis, and a constant bias."""

    noise: float = 0.0  # standard deviation of a reading
    bias_x: float = 0.0
    bias_y: float = 0.0
    bias_z: float = 0.0


class Sensors(NamedTuple):
    """The measurements of the vehicle's motion that a controller receives."""

    active: float = 0.0  # 0: the true state
    seed: float = 0.0
    period: float = 1.0  # s between readings, each held until the next
    position: Sensor = Sensor()  # m, world
    velocity: Sensor = Sensor()  # m/s, world
    attitude: Sensor = Sensor()  # rad, a small rotation in body axes
    body_rates: Sensor = Sensor()  # rad/s, body


@scalar
def reading_error(sensor: Sensor, seed: float, channel: float, index: float) -> Triple:
    """The error that a reading adds to the true vector, in the units of the sensor.

    Args:
        sensor: noise and bias
        seed, channel, index: as for `normal`; the sensor uses ``channel`` and the next two
    """
    x, y, z = sensor.bias_x, sensor.bias_y, sensor.bias_z
    noise = sensor.noise
    if noise > 0.0:
        x += noise * normal(seed, channel, index)
        y += noise * normal(seed, channel + 1.0, index)
        z += noise * normal(seed, channel + 2.0, index)
    return x, y, z


@scalar
def reading_index(time: float, period: float) -> float:
    """The number of the latest reading at ``time`` (s), with readings every ``period`` (s)."""
    return float(floor(time / period + 1e-6))  # a time step's rounding must not delay one


@scalar
def rotate_by_small_angle(
    qw: float, qx: float, qy: float, qz: float, x: float, y: float, z: float
) -> Quad:
    """A unit quaternion rotated by a small rotation vector, to third order in the angle.

    The exact rotation has ``tan(angle / 2) = |vector| / 2``.

    Args:
        qw, qx, qy, qz: the quaternion, scalar first
        x, y, z: the rotation vector in body axes, rad
    """
    x, y, z = 0.5 * x, 0.5 * y, 0.5 * z
    scale = 1.0 / sqrt(1.0 + x * x + y * y + z * z)
    return (
        scale * (qw - qx * x - qy * y - qz * z),
        scale * (qx + qw * x + qy * z - qz * y),
        scale * (qy + qw * y + qz * x - qx * z),
        scale * (qz + qw * z + qx * y - qy * x),
    )
