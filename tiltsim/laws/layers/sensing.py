"""The sensors of a rotorcraft, between its state and its controller."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from tiltsim_controllers.mathematics.scalar import Values, Vector, scalar
from tiltsim_controllers.vehicle.sensors import (
    Sensor,
    Sensors,
    reading_error,
    reading_index,
    rotate_by_small_angle,
)

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import Scenario

DEFAULT_SAMPLE_TIME: Final = 0.01
"""s between readings of the sensors, if neither they nor a held controller define it."""


@scalar
def measured_qpos(time: float, qpos: Vector, sensors: Sensors) -> Values:
    """The vehicle's ``qpos`` as its sensors read them; tilts are exact."""
    x, y, z, qw, qx, qy, qz = qpos[:7]
    if sensors.active == 0.0:
        return (x, y, z, qw, qx, qy, qz, *qpos[7:])
    index = reading_index(time, sensors.period)
    ex, ey, ez = reading_error(sensors.position, sensors.seed, 0.0, index)
    roll, pitch, yaw = reading_error(sensors.attitude, sensors.seed, 6.0, index)
    qw, qx, qy, qz = rotate_by_small_angle(qw, qx, qy, qz, roll, pitch, yaw)
    return (x + ex, y + ey, z + ez, qw, qx, qy, qz, *qpos[7:])


@scalar
def measured_qvel(time: float, qvel: Vector, sensors: Sensors) -> Values:
    """The vehicle's ``qvel`` as its sensors read them.

    Tilt rates are exact, and so is an angular acceleration that follows them.
    """
    vx, vy, vz, p, q, r = qvel[:6]
    if sensors.active == 0.0:
        return (vx, vy, vz, p, q, r, *qvel[6:])
    index = reading_index(time, sensors.period)
    ex, ey, ez = reading_error(sensors.velocity, sensors.seed, 3.0, index)
    ep, eq, er = reading_error(sensors.body_rates, sensors.seed, 9.0, index)
    return (vx + ex, vy + ey, vz + ez, p + ep, q + eq, r + er, *qvel[6:])


def sensor_parameters(scenario: Scenario) -> Sensors:
    """The sensors of a scenario."""
    sensors, simulation = scenario.sensors, scenario.simulation
    vectors = {
        name: Sensor(getattr(sensors, f"{name}_noise"), *getattr(sensors, f"{name}_bias"))
        for name in ("position", "velocity", "attitude", "body_rates")
    }
    return Sensors(
        active=float(sensors.have_errors),
        seed=float(simulation.seed),
        period=sensors.sample_time or simulation.control_timestep or DEFAULT_SAMPLE_TIME,
        **vectors,
    )
