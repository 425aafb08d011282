"""A rigid body with any number of rotors, as arrays: the vehicle that a plant simulates.

The cross of the thesis (ch. 3) is a table of rotors whose entries are mostly constants; a traced
program has no operation for an entry that is zero.

The thesis neglects the rotors' own spin inertia. A rotor of inertia ``J_r`` about its axis ``d_i``,
the thrust axis, has the angular momentum ``J_r varpi_i d_i`` beyond the part that turns with its
pod. Its rate acts on the vehicle with the torque ``-d/dt sum_i J_r varpi_i d_i - omega x sum_i J_r
varpi_i d_i``, and across the pod's hinge on its servo. All sums here are per unit of ``J_r``, in
body axes.
"""

from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from tiltsim_controllers.code.arrays import traceable, xp
from tiltsim_controllers.mathematics.linear import cross
from tiltsim_controllers.mathematics.records import make_record_type, vector_of
from tiltsim_controllers.mathematics.scalar import Values
from tiltsim_controllers.vehicle.body import (
    BODY_STATES,
    Body,
    RigidState,
    accelerations,
    joined,
    rigid_state,
    rotation_rate,
)
from tiltsim_controllers.vehicle.cross import ARMS, cross_table
from tiltsim_controllers.vehicle.parameters import Vehicle
from tiltsim_controllers.vehicle.rotors import (
    ROTOR_FLOATS,
    Rotor,
    Rotors,
    TiltOfRotor,
    of_rotors,
    of_tilts,
    rotors_in,
    turned,
    turning_parts,
    wrench_map,
)


class Craft(NamedTuple):
    """A rigid body with N rotors, on M tilting pods or fixed, in body axes."""

    body: Body  # mass and inertia
    rotors: Rotors  # their forces and torques
    places: Any
    """From the center of mass, m, constant, cosine and sine of the tilt angle: shape (3, 3, N)."""
    axes: Any  # thrust axes, as ``places``, dimensionless
    thrusts: Any  # coefficients K_f, N s^2/rad^2, shape (N,)
    along_hinges: Any
    """Components of the thrust axes along their hinges, equal at all tilts, shape (N,)."""
    hinge_loads: Any  # see `Rotor.hinge_load`, shape (N,)
    hinges: Any  # unit vectors along the hinges, shape (M, 3)


@cache
def craft_record(rotors: int, tilts: int) -> Any:
    """The type of the parameters of a `Craft` with a number of rotors and hinges."""
    return make_record_type(
        "CraftParameters",
        body=Body,
        effects=vector_of(ROTOR_FLOATS * rotors),  # see `effectiveness`
        places=vector_of(9 * rotors),
        axes=vector_of(9 * rotors),
        thrusts=vector_of(rotors),
        along_hinges=vector_of(rotors),
        hinge_loads=vector_of(rotors),
        hinges=vector_of(3 * tilts),
    )


def craft_parameters(body: Body, rotors: Sequence[Rotor]) -> Any:
    """The parameters of a vehicle, a `craft_record`."""
    hinges = {rotor.tilt: rotor.hinge_axis for rotor in rotors if rotor.tilt >= 0}
    axes = [turning_parts(rotor.axis, rotor.hinge_axis, rotor.tilt) for rotor in rotors]
    places = [
        turning_parts(np.subtract(rotor.place, rotor.hinge), rotor.hinge_axis, rotor.tilt)
        + np.array([rotor.hinge, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)])
        for rotor in rotors
    ]
    return craft_record(len(rotors), len(hinges))(
        body,
        tuple(entry for rotor in rotors for entry in rotor.entries),
        _flat(np.stack(places, axis=-1)),
        _flat(np.stack(axes, axis=-1)),
        tuple(rotor.thrust for rotor in rotors),
        tuple(rotor.along_hinge for rotor in rotors),
        tuple(rotor.hinge_load for rotor in rotors),
        _flat(np.array([hinges[tilt] for tilt in sorted(hinges)])),
    )


def _flat(array: Any) -> Values:
    return tuple(array.ravel().tolist())


def craft_of(parameters: Any, tilt_of_rotor: TiltOfRotor) -> Craft:
    """A vehicle from a `craft_record`, or from the `Vehicle` of a cross, given its layout."""
    rotors = len(tilt_of_rotor)
    if isinstance(parameters, Vehicle):
        return _on_cross(parameters, tilt_of_rotor)
    return Craft(
        parameters.body,
        rotors_in(parameters.effects, 0, tilt_of_rotor),
        parameters.places.reshape(3, 3, rotors),
        parameters.axes.reshape(3, 3, rotors),
        parameters.thrusts,
        parameters.along_hinges,
        parameters.hinge_loads,
        parameters.hinges.reshape(-1, 3),
    )


def _on_cross(vehicle: Vehicle, tilt_of_rotor: TiltOfRotor) -> Craft:
    """Rotors 1 to 4 at the ends of the arms, about which their pods turn."""
    tilting, arms, none = tilt_of_rotor[0] >= 0, np.transpose(ARMS), np.zeros((3, 4))
    upright = np.outer((0.0, 0.0, 1.0), np.ones(4))
    axes = [none, upright, cross(arms, upright)] if tilting else [upright, none, none]
    table = cross_table(vehicle, tilting=tilting)
    return Craft(
        vehicle.body,
        rotors_in(table, 0, tilt_of_rotor),
        xp.array([vehicle.arm_length * arms, none, none]),
        np.array(axes),
        vehicle.thrust_coefficient * np.ones(4),
        np.zeros(4),
        np.zeros(4),
        np.array(ARMS if tilting else np.zeros((0, 3))),
    )


def places(craft: Craft, tilts: Any) -> Any:
    """Places of the rotors, m from the center of mass, shape (3, N), at tilts (rad, shape (M,))."""
    return turned(craft.rotors, craft.places, tilts)


def thrust_axes(craft: Craft, tilts: Any) -> Any:
    """Thrust axes of the rotors, shape (3, N), at tilts (rad, shape (M,))."""
    return turned(craft.rotors, craft.axes, tilts)


def axis_slopes(craft: Craft, tilts: Any) -> Any:
    """Derivatives of `thrust_axes` by the tilt of each rotor, 1/rad, shape (3, N)."""
    _, cosine, sine = craft.axes
    return turned(craft.rotors, (0.0, sine, -cosine), tilts)


def wrench_of_lift(craft: Craft, tilts: Any, lifts: Any) -> Any:
    """Force (N) and torque (N m), (6,), of additional thrusts (N, (N,)) without drag torque.

    The tilts are in rad, shape (M,).
    """
    axes = thrust_axes(craft, tilts)
    return xp.hstack([axes @ lifts, cross(places(craft, tilts), axes) @ lifts])


def spin_torque(
    craft: Craft, tilts: Any, tilt_rates: Any, speeds: Any, accelerations: Any, omega: Any
) -> Any:
    """The torque on the vehicle per unit of spin inertia, rad/s^2, shape (3,).

    Args:
        craft: N rotors on M pods.
        tilts, tilt_rates: rad and rad/s, shape (M,).
        speeds, accelerations: Signed, rad/s and rad/s^2, shape (N,).
        omega: Body rates, rad/s, shape (3,).
    """
    axes, slopes = thrust_axes(craft, tilts), axis_slopes(craft, tilts)
    tilting = slopes @ (of_rotors(craft.rotors, tilt_rates) * speeds)
    return -(axes @ accelerations) - tilting - cross(omega, axes @ speeds)


def hinge_torques(craft: Craft, tilts: Any, speeds: Any, accelerations: Any, omega: Any) -> Any:
    """The torques on the pods about their hinges per unit of spin inertia, rad/s^2, shape (M,).

    Each is the sum of ``varpi_i omega . d d_i / d alpha - varpi_i' a . d_i`` over the rotors of a
    pod, with its hinge along ``a``.

    Args:
        craft: N rotors on M pods.
        tilts: rad, shape (M,).
        speeds, accelerations: Signed, rad/s and rad/s^2, shape (N,).
        omega: Body rates, rad/s, shape (3,).
    """
    gyroscopic = speeds * (omega @ axis_slopes(craft, tilts))
    return of_tilts(craft.rotors, gyroscopic - craft.along_hinges * accelerations)


def accelerations_within_limits(
    spins: Any, speeds: Any, demanded: Any, min_speed: Any, max_speed: Any
) -> Any:
    """The accelerations (rad/s^2) that rotors have: none beyond a speed limit.

    Args:
        spins: Signs of the speeds, shape (N,).
        speeds, demanded: Signed, rad/s and rad/s^2, shape (N,).
        min_speed, max_speed: Limits along the spin, rad/s.
    """
    along, faster = spins * speeds, spins * demanded
    stops = ((along >= max_speed) & (faster > 0.0)) | ((along <= min_speed) & (faster < 0.0))
    return xp.where(stops, 0.0, demanded)


@traceable
def equations_of_motion(
    state: Any,
    tilts: Any,
    inputs: Any,
    body: Body,
    rotors: Rotors,
    disturbance: Any,
    gyroscopic: float,
) -> Any:
    """Derivative of a state of a vehicle with massless pods (ch. 3, Eqs. 1-7), (18 + N,).

    Args:
        state: `BODY_STATES` numbers and N rotor speeds, rad/s, shape (18 + N + any,).
        tilts: rad, shape (M,).
        inputs: Rotor accelerations, rad/s^2, shape (N + any,).
        body: Body of the vehicle.
        rotors: Its N rotors.
        disturbance: An acceleration unknown to the controller, m/s^2, world axes, shape (3,).
        gyroscopic: Factor of the gyroscopic torque, 1 or 0.
    """
    count = len(rotors.tilt_of_rotor)
    motion, speeds = rigid_state(state), state[BODY_STATES : BODY_STATES + count]
    wrench = wrench_map(rotors, tilts) @ (speeds * abs(speeds))
    _, velocity, rotation, omega = motion
    moved = accelerations(body, rotation, omega, wrench, disturbance, gyroscopic)
    rates = RigidState(velocity, moved[0], rotation_rate(rotation, omega), moved[1])
    return joined((*rates, inputs[:count]))
