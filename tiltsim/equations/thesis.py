"""Equations of motion and states of rotorcraft as the thesis models them.

Ch. 3: a state begins with `RigidState`, followed by rotor speeds. Tilt angles follow the gait
exactly, or are further states where the controller moves them. Ch. 2 (Eq. 15): a rigid body in
Euler angles under thrust and torques; the inputs begin with these, and two states of the controller
and their rates may follow.
"""

from typing import Any

from tiltsim.scenario.scenario import Scenario
from tiltsim_controllers.code.arrays import traceable, xp
from tiltsim_controllers.mathematics.attitude import euler_of_rotation, euler_rates, rotation_matrix
from tiltsim_controllers.mathematics.scalar import Values, Vector
from tiltsim_controllers.vehicle.body import Body, accelerations, rigid_state
from tiltsim_controllers.vehicle.cross import cross_table
from tiltsim_controllers.vehicle.parameters import Vehicle
from tiltsim_controllers.vehicle.rotors import Rotors, TiltOfRotor, airframe, rotors_in


@traceable
def body_fields(state: Any) -> Any:
    """The rigid body's numbers, shape (12,), `tiltsim_controllers.vehicle.body.BODY_FIELDS`."""
    position, velocity, rotation, omega = rigid_state(state)
    return xp.hstack([position, velocity, euler_of_rotation(rotation), omega])


def airframe_of(law: Any, knots: Any, layout: TiltOfRotor) -> tuple[Body, Rotors]:
    """The body and rotors of a vehicle that flies as a law knows it.

    A `Vehicle` accelerates alike with forces in ``K_f`` and torques in ``L K_f`` (Eq. 12): its
    table of rotors then has ones instead of these coefficients.

    Args:
        law: Parameters of the law.
        knots: Table data of the flight.
        layout: Tilts of the rotors.
    """
    vehicle = law.vehicle
    if isinstance(vehicle, Body):
        return airframe(law, knots, layout)
    force, torque = vehicle.thrust_coefficient, vehicle.arm_length * vehicle.thrust_coefficient
    scaled = Vehicle(
        mass=vehicle.mass / force,
        inertia_xx=vehicle.inertia_xx / torque,
        inertia_yy=vehicle.inertia_yy / torque,
        inertia_zz=vehicle.inertia_zz / torque,
        arm_length=1.0,
        thrust_coefficient=1.0,
        drag_coefficient=vehicle.drag_coefficient / torque,
        gravity=vehicle.gravity,
    )
    return scaled.body, rotors_in(xp.array(cross_table(scaled, tilting=True)), 0, layout)


def initial_state(scenario: Scenario, rotor_speeds: Vector) -> Values:
    """The state at time zero, with signed rotor speeds (rad/s)."""
    initial = scenario.initial
    rotation = rotation_matrix(initial.attitude).ravel()
    motion = (*initial.position, *initial.velocity)
    return (*motion, *rotation, *initial.angular_velocity, *rotor_speeds)


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
        vehicle.body, rotation_matrix(attitude), omega, wrench, disturbance, 1.0
    )
    return xp.hstack([velocity, acceleration, euler_rates(attitude, omega), turning])


def initial_extended_state(scenario: Scenario) -> Values:
    """The rigid body's states at time zero."""
    initial = scenario.initial
    return (*initial.position, *initial.velocity, *initial.attitude, *initial.angular_velocity)
