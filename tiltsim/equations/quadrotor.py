"""The quadrotor as ch. 2 models it (Eq. 15): a rigid body in Euler angles under thrust and torques.

The state begins with position, velocity, roll, pitch, yaw and body rates, the inputs with the total
thrust and the three torques. Two states of the controller and their rates may follow.
"""

from typing import Any

from tiltsim.scenario.scenario import Scenario
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.code.traceable import traceable
from tiltsim_controllers.mathematics.attitude import euler_rates, rotation_matrix
from tiltsim_controllers.mathematics.scalar import Values
from tiltsim_controllers.vehicle.body import principal_body
from tiltsim_controllers.vehicle.motion import accelerations
from tiltsim_controllers.vehicle.parameters import Vehicle


def rigid_body(state: Any) -> Any:
    """The twelve states of the rigid body."""
    return state[:12]


@traceable
def equations_of_motion(state: Any, inputs: Any, vehicle: Vehicle, disturbance: Any) -> Values:
    """Time derivative of the rigid body's twelve states, shape (12,).

    Args:
        state: Begins with the rigid body's, shape (12 + any,).
        inputs: Thrust (N) and torques (N m, body axes), and any more, shape (4 + any,).
        vehicle: The vehicle that flies.
        disturbance: An acceleration unknown to the controller, m/s^2, world axes, shape (3,).
    """
    velocity, attitude, omega = state[3:6], state[6:9], state[9:12]
    wrench = xp.hstack([0.0, 0.0, inputs[:4]])
    acceleration, turning = accelerations(
        principal_body(vehicle), rotation_matrix(attitude), omega, wrench, disturbance, 1.0
    )
    rates: Values = xp.hstack([velocity, acceleration, euler_rates(attitude, omega), turning])
    return rates


def initial_state(scenario: Scenario) -> Values:
    """The rigid body's states at time zero."""
    initial = scenario.initial
    return (*initial.position, *initial.velocity, *initial.attitude, *initial.angular_velocity)
