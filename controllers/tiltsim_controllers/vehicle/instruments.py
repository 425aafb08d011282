"""Sensors and instruments on a vehicle: their readings and the errors of these.

Everything is a function of time, state and parameters, so that it can be evaluated at every
integrator stage and restarted anywhere. A reading has a number that counts from 0 at time zero. Its
noise and whether it is lost depend on this number and the seed alone, so that readings are the same
on every engine and after a restart.
"""

from typing import Any, NamedTuple

from tiltsim_controllers.code.arrays import branch, normal, traceable, uniform, xp
from tiltsim_controllers.mathematics.attitude import quaternion_product
from tiltsim_controllers.mathematics.linear import cross
from tiltsim_controllers.mathematics.records import Vector3, make_record_type, vector_of


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
    """A unit quaternion (4,) rotated by a small rotation vector (rad, body axes), to third order.

    The exact rotation has ``tan(angle / 2) = |vector| / 2``.
    """
    half = 0.5 * vector
    return quaternion_product(quaternion, xp.hstack([1.0, half])) / xp.sqrt(1.0 + half @ half)


def instrument_record(errors: int) -> Any:
    """The type of the parameters of an instrument with a number of independent errors."""
    size = vector_of(errors)
    return make_record_type(
        "Instrument",
        seed=float,
        channel=float,  # first channel of its draws
        period=float,  # s, between readings
        delay=float,  # s, until a reading is available
        dropout=float,  # probability that a reading is lost
        place=vector_of(3),  # from the center of mass, m, body axes
        axes=vector_of(9),  # of the instrument in body axes, as columns
        noise=size,  # standard deviation of a reading, white
        walk=size,  # standard deviation of the bias's step from reading to reading
        bias=size,  # constant
        resolution=size,  # readings are multiples of it; 0 for none
    )


@traceable
def specific_force(linear: Any, angular: Any, omega: Any, place: Any) -> Any:
    """The specific force (m/s^2, body axes) at a place of a rigid body, shape (3,).

    Args:
        linear: All forces but gravity by the mass, m/s^2, body axes.
        angular: Angular acceleration, rad/s^2, body axes.
        omega: Body rates, rad/s.
        place: From the center of mass, m, body axes.
    """
    return linear + cross(angular, place) + cross(omega, cross(omega, place))


@traceable
def draws(own: Any, number: Any, first: float, count: int) -> Any:
    """Standard normal draws, shape (count,).

    Args:
        own: Parameters, an `instrument_record`.
        number: The number of the reading.
        first: First channel among the instrument's.
        count: How many.
    """
    base = own.channel + first
    return xp.array([normal(own.seed, base + axis, number) for axis in range(count)])


@traceable
def is_new(own: Any, time: Any, timestep: Any) -> Any:
    """1 if a reading is taken at a control step, which the one before was too early for, else 0."""
    taken = reading_index(time, own.period) > reading_index(time - timestep, own.period)
    return xp.where(taken, 1.0, 0.0)


@traceable
def arrival(own: Any, time: Any, timestep: Any) -> tuple[Any, Any]:
    """The number of the latest reading that has its delay behind it, and 1 if it just arrived.

    At a time (s), given the time (s) between control steps; the parameters are an
    `instrument_record`.
    """
    number = reading_index(time - own.delay, own.period)
    just = number > reading_index(time - own.delay - timestep, own.period)
    kept = uniform(own.seed, 2.0 * own.channel - 1.0, number) >= own.dropout
    arrived = xp.where(just, xp.where(number >= 0.0, xp.where(kept, 1.0, 0.0), 0.0), 0.0)
    return number, arrived


@traceable
def quantized(values: Any, resolution: Any) -> Any:
    """Values as multiples of a resolution; unchanged where it is 0."""
    step = xp.where(resolution == 0.0, 1.0, resolution)
    return xp.where(resolution == 0.0, values, step * xp.floor(values / step + 0.5))


@traceable
def reading(own: Any, truth: Any, number: Any) -> Any:
    """A reading, by number, of the true values (n,) with the walk of their biases."""
    noise = own.noise * draws(own, number, 0.0, len(truth))
    return quantized(truth + own.bias + noise, own.resolution)


@traceable
def pose_reading(own: Any, truth: Any, number: Any) -> Any:
    """A reading, by number, of a position (m) and a quaternion, (7,); errors turn about body axes.

    The last three errors of the parameters are angles, rad.
    """
    error = own.bias + own.noise * draws(own, number, 0.0, 6)
    position = quantized(truth[:3] + error[:3], own.resolution[:3])
    return xp.hstack([position, rotate_by_small_angle(truth[3:], error[3:])])
