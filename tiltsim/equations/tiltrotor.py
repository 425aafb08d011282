"""The tiltrotor as ch. 3 models it (Eqs. 1-7): massless pods, no gyroscopic torque.

The state begins with `tiltsim_controllers.vehicle.motion.RigidState`, followed by rotor speeds.
Tilt angles follow the gait exactly, or are further states where the controller moves them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.code.traceable import traceable
from tiltsim_controllers.mathematics.attitude import euler_of_rotation
from tiltsim_controllers.mathematics.rotation import rotation_from_euler
from tiltsim_controllers.mathematics.scalar import Values, Vector
from tiltsim_controllers.vehicle.body import principal_body
from tiltsim_controllers.vehicle.effectiveness import cross_table
from tiltsim_controllers.vehicle.motion import equations_of_motion_of, rigid_state
from tiltsim_controllers.vehicle.parameters import Vehicle

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import Scenario

_motion: Final = equations_of_motion_of((0, 1, 2, 3))


@traceable
def body_fields(state: Any) -> Any:
    """The rigid body's numbers, shape (12,), `tiltsim_controllers.vehicle.states.BODY_FIELDS`."""
    position, velocity, rotation, omega = rigid_state(state)
    return xp.hstack([position, velocity, euler_of_rotation(rotation), omega])


def per_thrust(vehicle: Vehicle) -> Vehicle:
    """A vehicle that accelerates alike, with forces in ``K_f`` and torques in ``L K_f`` (Eq. 12).

    Its table of rotors has ones instead of these coefficients.
    """
    force, torque = vehicle.thrust_coefficient, vehicle.arm_length * vehicle.thrust_coefficient
    return Vehicle(
        mass=vehicle.mass / force,
        inertia_xx=vehicle.inertia_xx / torque,
        inertia_yy=vehicle.inertia_yy / torque,
        inertia_zz=vehicle.inertia_zz / torque,
        arm_length=1.0,
        thrust_coefficient=1.0,
        drag_coefficient=vehicle.drag_coefficient / torque,
        gravity=vehicle.gravity,
    )


@traceable
def equations_of_motion(
    state: Any, tilts: Any, inputs: Any, vehicle: Vehicle, disturbance: Any
) -> Values:
    """Time derivative of the state, shape (22,).

    Args:
        state: Shape (22 + any,).
        tilts: rad, shape (4,).
        inputs: Rotor accelerations, rad/s^2, shape (4 + any,).
        vehicle: The vehicle that flies.
        disturbance: An acceleration unknown to the controller, m/s^2, world axes, shape (3,).
    """
    scaled = per_thrust(vehicle)
    table = xp.array(cross_table(scaled, tilting=True))
    return _motion(state, tilts, inputs, principal_body(scaled), table, 0, disturbance, 0.0)


def initial_state(scenario: Scenario, rotor_speeds: Vector) -> Values:
    """The state at time zero, with signed rotor speeds (rad/s)."""
    initial = scenario.initial
    rotation = rotation_from_euler(*initial.attitude)
    motion = (*initial.position, *initial.velocity)
    return (*motion, *rotation, *initial.angular_velocity, *rotor_speeds)
