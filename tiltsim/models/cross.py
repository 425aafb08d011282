"""The tiltrotor and the quadrotor of the thesis as multirotors."""

from math import inf

from tiltsim.models.rotor_table import Multirotor
from tiltsim_controllers.vehicle.cross import ARMS
from tiltsim_controllers.vehicle.parameters import SPIN, Vehicle
from tiltsim_controllers.vehicle.rotors import Rotor


def as_multirotor(
    vehicle: Vehicle | Multirotor, *, tilting: bool, reverses: bool = True
) -> Multirotor:
    """A vehicle with four equal arms at right angles, by its rotors; a multirotor as it is.

    They may tilt about the arms, and reverse, that is turn against their spins.
    """
    if isinstance(vehicle, Multirotor):
        return vehicle
    coefficients = vehicle.thrust_coefficient, vehicle.drag_coefficient
    rotors = []
    for tilt, (arm, spin) in enumerate(zip(ARMS, SPIN, strict=True)):
        x, y, z = arm
        place = (vehicle.arm_length * x, vehicle.arm_length * y, vehicle.arm_length * z)
        rotor = Rotor(place, (0.0, 0.0, 1.0), *coefficients, spin)
        hinged = rotor._replace(tilt=tilt, hinge=place, hinge_axis=arm)
        rotors.append(hinged if tilting else rotor)
    return Multirotor(
        mass=vehicle.mass,
        gravity=vehicle.gravity,
        inertia=vehicle.body.inertia,
        rotors=tuple(rotors),
        speed_ranges=tuple(
            (-inf if reverses or spin < 0.0 else 0.0, inf if reverses or spin > 0.0 else 0.0)
            for spin in SPIN
        ),
        tilts=len(ARMS) if tilting else 0,
    )
