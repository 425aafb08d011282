"""Any rotorcraft as one rigid body with massless pods on servos, as in MuJoCo's model.

Gyroscopic torque, tilt servos of second order with stops, rotors with limits. The state is MuJoCo's
``qpos``, ``qvel`` and ``act``, so the controls are the same function of it.
"""

from tiltsim.equations.actuator_level import (
    QUATERNION,
    ActuatorPlant,
    PlantForm,
    as_in_mujoco,
    plant_of,
)
from tiltsim.scenario.scenario import Scenario
from tiltsim.vehicles.rotorcraft.layout import true_rotors


def rigid_body(scenario: Scenario) -> ActuatorPlant:
    """The rigid body of a scenario's rotorcraft."""
    vehicle = scenario.any_rotorcraft
    has_limits = vehicle.has_rotor_limits or vehicle.tilt_servo.max_angle is not None
    return plant_of(
        PlantForm(
            QUATERNION,
            as_in_mujoco(vehicle.tilt_count if scenario.vehicle.has_tilting_rotors else 0),
            tuple(map(vehicle.tilt_of_rotor, range(1, vehicle.rotor_count + 1))),
            vehicle.spins,
            type(true_rotors(scenario)),
            gyroscopic=1.0,
            has_limits=has_limits,
        )
    )
