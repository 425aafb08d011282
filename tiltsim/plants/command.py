"""Observations and commands of a user's own controller, and of vehicles commanded from outside."""

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from math import isfinite, pi
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tiltsim.errors import TiltsimError
from tiltsim.models.rotor_table import Multirotor
from tiltsim.system.text import short_repr
from tiltsim.vehicles.rotorcraft.layout import Layout
from tiltsim_controllers.laws.observed import ROTOR_COMMANDS
from tiltsim_controllers.laws.observed import Command as Command
from tiltsim_controllers.mathematics.scalar import Floats, Values
from tiltsim_controllers.vehicle.parameters import Vehicle


@dataclass(frozen=True, slots=True)
class Reference:
    """The desired motion at the time of an observation; world axes."""

    position: Floats  # (3,), m
    velocity: Floats  # (3,), m/s
    acceleration: Floats  # (3,), m/s^2
    attitude: Floats  # (3,), roll, pitch, yaw, rad
    tilt_angles: Floats  # (M,), rad, of the planned gait; four zeros for the quadrotor
    tilt_rates: Floats  # (M,), rad/s
    force: Floats = field(default_factory=lambda: np.zeros(3))  # (3,), N, of a push on its object


@dataclass(frozen=True, slots=True)
class Observation:
    """The input of a controller: the vehicle's state, its reference and its parameters.

    The state is as measured by the scenario's sensors. The arrays are copies: a controller may keep
    or change them. Arrays of tilts (M) and rotors (N) have one entry for each tilt or rotor of the
    vehicle.
    """

    time: float  # s
    position: Floats  # (3,), m, world
    velocity: Floats  # (3,), m/s, world
    attitude: Floats  # (3,), roll, pitch, yaw, rad
    quaternion: Floats  # (4,), body to world, scalar first
    body_rates: Floats  # (3,), p, q, r, rad/s, body axes
    tilt_angles: Floats  # (M,), rad; four zeros for the quadrotor
    tilt_rates: Floats  # (M,), rad/s
    rotor_speeds: Floats  # (N,), rad/s, positive along each rotor's spin
    reference: Reference
    vehicle: Vehicle | Multirotor  # mass, inertia, gravity, and the rotors' coefficients
    contact_force: Floats = field(default_factory=lambda: np.zeros(3))
    """(3,), N, world: of the vehicle on all objects, over the last physics step."""
    swing: Floats = field(default_factory=lambda: np.zeros(2))
    """(2,), rad: of the cable of a load from straight down toward +x and +y, world."""
    reference_at: Callable[[float], Reference] | None = field(
        default=None, repr=False, compare=False
    )
    """The reference at a time, s; None in environments. `preview` uses it."""

    def preview(self, times: ArrayLike) -> Reference:
        """The reference and the planned gait at other times of the flight, such as future ones.

        Args:
            times: s, from the beginning of the flight, shape (K,).

        Returns:
            Entries of shape (K, 3), and (K, M) for the tilts.

        Raises:
            ControllerError: For an observation of an environment, which has no preview.
        """
        if self.reference_at is None:
            raise ControllerError("asked for a preview, which environments do not have")
        each = [self.reference_at(float(time)) for time in np.atleast_1d(times)]
        names = (entry.name for entry in fields(Reference))
        return Reference(*(np.array([getattr(one, name) for one in each]) for name in names))


Controller = Callable[[Observation], Command]
"""A function from observation to command; one with a memory may have ``reset(scenario)``."""


class ControllerError(TiltsimError):
    """A controller raised an exception or returned an invalid command."""


@dataclass(frozen=True, slots=True)
class CheckedCommand:
    """A valid command, from the controller to the rotors and servos."""

    kind: str  # of `ROTOR_COMMANDS`
    rotors: Values  # N, rad/s or rad/s^2, along each rotor's spin
    tilt_angles: Values | None  # rad; None follows the planned gait


def check_command(command: object, layout: Layout) -> CheckedCommand:
    """Check a controller's return value for a vehicle's numbers of rotors and tilt servos.

    Raises:
        ControllerError: If it is not a `Command`, does not give exactly one of `ROTOR_COMMANDS`,
            has an entry of the wrong shape or a non-finite one, gives tilt angles beyond a half
            turn, or any to a vehicle without servos.
    """
    if not isinstance(command, Command):
        raise ControllerError(
            f"returned {short_repr(command)}; expected a tiltsim.Command, as in "
            "tiltsim.Command(thrusts=...)"
        )
    for name in ("rates", "discrete"):
        if getattr(command, name) is not None:
            raise ControllerError(f"returned {name}; only a law, marked @tiltsim.law, has states")
    given = [name for name in ROTOR_COMMANDS if getattr(command, name) is not None]
    if len(given) != 1:
        what = " and ".join(given) if given else "nothing for the rotors"
        raise ControllerError(f"returned {what}; expected one of {', '.join(ROTOR_COMMANDS)}")
    tilts = None
    if command.tilt_angles is not None:
        if layout.tilts == 0:
            raise ControllerError("returned tilt_angles; this vehicle has no tilt servos")
        tilts = _checked("tilt_angles", command.tilt_angles, layout.tilts)
    for index, angle in enumerate(tilts or ()):
        if abs(angle) > pi:
            raise ControllerError(
                f"returned tilt_angles[{index}] = {angle:g}; angles are in rad, from {-pi:g} to "
                f"{pi:g}"
            )
    rotors = _checked(given[0], getattr(command, given[0]), layout.rotors)
    return CheckedCommand(given[0], rotors, tilts)


def _checked(name: str, value: Any, size: int) -> Values:
    """The numbers of a command."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        text = f"returned {name} = {short_repr(value)}; expected {size} numbers"
        raise ControllerError(text) from None
    if array.shape != (size,):
        raise ControllerError(f"returned {name} of shape {array.shape}; expected shape ({size},)")
    values = tuple(array.tolist())
    for index, number in enumerate(values):
        if not isfinite(number):
            raise ControllerError(f"returned {name}[{index}] = {number}; must be finite")
    return values
