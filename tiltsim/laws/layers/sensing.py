"""The sensors of a rotorcraft, between its state and its controller."""

from typing import Any, Final

from tiltsim.scenario.scenario import Scenario
from tiltsim.vehicles.rotorcraft.layout import QW, TILT_1
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.code.traceable import traceable
from tiltsim_controllers.vehicle.sensors import (
    Sensor,
    Sensors,
    reading_error,
    reading_index,
    rotate_by_small_angle,
)

DEFAULT_SAMPLE_TIME: Final = 0.01
"""s between readings of the sensors, if neither they nor a held controller define it."""


@traceable
def measured(time: Any, qpos: Any, qvel: Any, sensors: Sensors) -> tuple[Any, Any]:
    """The vehicle's ``qpos`` and ``qvel`` as its sensors read them.

    Tilts and their rates are exact, and so is an angular acceleration that follows these.

    Args:
        time: s.
        qpos, qvel: Shapes (7 + tilts,) and (6 + tilts + any,).
        sensors: Errors of the measurements.
    """
    if sensors.active == 0.0:
        return qpos, qvel
    index = reading_index(time, sensors.period)

    def error(sensor: Sensor, channel: float) -> Any:
        return reading_error(sensor, sensors.seed, channel, index)

    position = qpos[:3] + error(sensors.position, 0.0)
    velocity = qvel[:3] + error(sensors.velocity, 3.0)
    quaternion = rotate_by_small_angle(qpos[QW:TILT_1], error(sensors.attitude, 6.0))
    body_rates = qvel[3:6] + error(sensors.body_rates, 9.0)
    return (
        xp.hstack([position, quaternion, qpos[TILT_1:]]),
        xp.hstack([velocity, body_rates, qvel[6:]]),
    )


def sensor_parameters(scenario: Scenario) -> Sensors:
    """The sensors of a scenario."""
    sensors, simulation = scenario.sensors, scenario.simulation
    vectors = {
        name: Sensor(getattr(sensors, f"{name}_noise"), getattr(sensors, f"{name}_bias"))
        for name in ("position", "velocity", "attitude", "body_rates")
    }
    return Sensors(
        active=float(sensors.have_errors),
        seed=float(simulation.seed),
        period=sensors.sample_time or simulation.control_timestep or DEFAULT_SAMPLE_TIME,
        **vectors,
    )
