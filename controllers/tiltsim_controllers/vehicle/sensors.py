"""Measurement errors of the sensors: noise, bias and sampling.

Everything is a function of time, state and parameters, so that it can be evaluated at every
integrator stage and restarted anywhere.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.code.blocks import branch, normal
from tiltsim_controllers.code.traceable import traceable
from tiltsim_controllers.mathematics.attitude import quaternion_product
from tiltsim_controllers.mathematics.records import Vector3


class Sensor(NamedTuple):
    """Error of a measured vector: zero-mean normal noise on each axis, and a constant bias."""

    noise: float = 0.0  # standard deviation of a reading
    bias: Vector3 = (0.0, 0.0, 0.0)


class Sensors(NamedTuple):
    """The measurements of the vehicle's motion that a controller receives."""

    active: float = 0.0  # 0: the true state
    seed: float = 0.0
    period: float = 1.0  # s between readings, each held until the next
    position: Sensor = Sensor()  # m, world
    velocity: Sensor = Sensor()  # m/s, world
    attitude: Sensor = Sensor()  # rad, a small rotation in body axes
    body_rates: Sensor = Sensor()  # rad/s, body


@traceable
def reading_error(sensor: Sensor, seed: float, channel: float, index: Any) -> Any:
    """The error that a reading adds to the true vector, shape (3,), in the units of the sensor.

    Args:
        sensor: Noise and bias.
        seed, channel, index: See `normal`; the sensor uses ``channel`` and the next two.
    """

    def noise() -> Any:
        draws = [normal(seed, channel + axis, index) for axis in range(3)]
        return sensor.bias + sensor.noise * xp.array(draws)

    return branch(sensor.noise > 0.0, noise, lambda: sensor.bias + sensor.noise * xp.zeros(3))


def reading_index(time: Any, period: Any) -> Any:
    """The number of the latest reading at ``time`` (s), with readings every ``period`` (s)."""
    return xp.floor(time / period + 1e-6)  # a time step's rounding must not delay one


@traceable
def rotate_by_small_angle(quaternion: Any, vector: Any) -> Any:
    """A unit quaternion rotated by a small rotation vector, to third order in the angle.

    The exact rotation has ``tan(angle / 2) = |vector| / 2``.

    Args:
        quaternion: Shape (4,), scalar first.
        vector: The rotation vector in body axes, rad, shape (3,).
    """
    half = 0.5 * vector
    return quaternion_product(quaternion, xp.hstack([1.0, half])) / xp.sqrt(1.0 + half @ half)
