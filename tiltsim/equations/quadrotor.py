"""The quadrotor as ch. 2 models it (Eq. 15): a rigid body in Euler angles under thrust and torques.

The state begins with position, velocity, roll, pitch, yaw and body rates, the inputs with the total
thrust and the three torques. Two states of the controller and their rates may follow.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from tiltsim_controllers.laws.yaw_position import euler_rates, gyroscopic_acceleration
from tiltsim_controllers.mathematics.rotation import rotation_from_euler
from tiltsim_controllers.mathematics.scalar import Triple, Values, Vector, scalar
from tiltsim_controllers.vehicle.parameters import Vehicle

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import Scenario


@scalar
def rigid_body(state: Vector) -> Values:
    """The twelve states of the rigid body."""
    x, y, z, vx, vy, vz = state[0], state[1], state[2], state[3], state[4], state[5]
    return x, y, z, vx, vy, vz, state[6], state[7], state[8], state[9], state[10], state[11]


@scalar
def equations_of_motion(
    state: Vector, inputs: Vector, vehicle: Vehicle, disturbance: Triple
) -> Values:
    """Time derivative of the rigid body's twelve states.

    Args:
        state: Begins with the rigid body's.
        inputs: Thrust (N) and torques (N m, body axes), and any more.
        vehicle: The vehicle that flies.
        disturbance: An acceleration unknown to the controller, m/s^2, world axes.
    """
    _, _, _, vx, vy, vz, roll, pitch, yaw, p, q, r = rigid_body(state)
    gust_x, gust_y, gust_z = disturbance
    _, _, up_x, _, _, up_y, _, _, up_z = rotation_from_euler(roll, pitch, yaw)
    lift = inputs[0] / vehicle.mass
    roll_rate, pitch_rate, yaw_rate = euler_rates(roll, pitch, p, q, r)
    p_drift, q_drift, r_drift = gyroscopic_acceleration(p, q, r, vehicle)
    return (
        vx,
        vy,
        vz,
        lift * up_x + gust_x,
        lift * up_y + gust_y,
        lift * up_z - vehicle.gravity + gust_z,
        roll_rate,
        pitch_rate,
        yaw_rate,
        p_drift + inputs[1] / vehicle.inertia_xx,
        q_drift + inputs[2] / vehicle.inertia_yy,
        r_drift + inputs[3] / vehicle.inertia_zz,
    )


def initial_state(scenario: Scenario) -> Values:
    """The rigid body's states at time zero."""
    initial = scenario.initial
    return (*initial.position, *initial.velocity, *initial.attitude, *initial.angular_velocity)
