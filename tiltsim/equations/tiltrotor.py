"""States of rotorcraft as ch. 3 models them: see `tiltsim_controllers.vehicle.motion`.

A state begins with `RigidState`, followed by rotor speeds. Tilt angles follow the gait exactly, or
are further states where the controller moves them.
"""

from typing import Any

from tiltsim.scenario.scenario import Scenario
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.code.traceable import traceable
from tiltsim_controllers.mathematics.attitude import euler_of_rotation, rotation_matrix
from tiltsim_controllers.mathematics.scalar import Values, Vector
from tiltsim_controllers.vehicle.body import Body, principal_body
from tiltsim_controllers.vehicle.effectiveness import TiltOfRotor, cross_table
from tiltsim_controllers.vehicle.motion import rigid_state
from tiltsim_controllers.vehicle.parameters import Vehicle
from tiltsim_controllers.vehicle.rotors import Rotors, airframe, rotors_in


@traceable
def body_fields(state: Any) -> Any:
    """The rigid body's numbers, shape (12,), `tiltsim_controllers.vehicle.states.BODY_FIELDS`."""
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
    return principal_body(scaled), rotors_in(xp.array(cross_table(scaled, tilting=True)), 0, layout)


def initial_state(scenario: Scenario, rotor_speeds: Vector) -> Values:
    """The state at time zero, with signed rotor speeds (rad/s)."""
    initial = scenario.initial
    rotation = rotation_matrix(initial.attitude).ravel()
    motion = (*initial.position, *initial.velocity)
    return (*motion, *rotation, *initial.angular_velocity, *rotor_speeds)
