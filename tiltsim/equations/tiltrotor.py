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
from tiltsim_controllers.vehicle.motion import rigid_state


@traceable
def body_fields(state: Any) -> Any:
    """The rigid body's numbers, shape (12,), `tiltsim_controllers.vehicle.states.BODY_FIELDS`."""
    position, velocity, rotation, omega = rigid_state(state)
    return xp.hstack([position, velocity, euler_of_rotation(rotation), omega])


def initial_state(scenario: Scenario, rotor_speeds: Vector) -> Values:
    """The state at time zero, with signed rotor speeds (rad/s)."""
    initial = scenario.initial
    rotation = rotation_matrix(initial.attitude).ravel()
    motion = (*initial.position, *initial.velocity)
    return (*motion, *rotation, *initial.angular_velocity, *rotor_speeds)
