"""Observations and commands of a user's own controller, and of vehicles commanded from outside."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields
from math import isfinite, pi
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.engines.base import vectors_of
from tiltsim.errors import TiltsimError
from tiltsim.laws.layers.actuation import measured, sensor_parameters
from tiltsim.laws.layers.contact import commanded_force, felt_among, push_of
from tiltsim.models.rotor_table import Multirotor
from tiltsim.plants.mujoco_plant import MujocoPlant
from tiltsim.system.text import short_repr
from tiltsim.vehicles.rotorcraft import Layout
from tiltsim.vehicles.rotorcraft.others import FELT, others_of
from tiltsim_controllers.code.arrays import as_arrays
from tiltsim_controllers.laws.observed import ROTOR_COMMANDS
from tiltsim_controllers.laws.observed import Command as Command
from tiltsim_controllers.mathematics.attitude import euler_angles
from tiltsim_controllers.mathematics.scalar import Floats, Values
from tiltsim_controllers.references.trajectories import attitude_reference, reference_derivatives
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


class Observer:
    """Makes the observations of one flight. Raises TypeError for a vehicle that is no rotorcraft.

    Args:
        assembly: The flight.
    """

    def __init__(self, assembly: Assembly) -> None:
        vehicle = assembly.scenario.any_rotorcraft
        self._vehicle, self._tilting = vehicle.resolve(), vehicle.has_tilting_rotors
        self._tilts, self._spins = self._vehicle.tilts, np.array(vehicle.spins)
        scenario = assembly.scenario
        self._felt = felt_among(others_of(scenario)) if scenario.has_objects else None
        self._push = push_of(scenario)
        self._attachment = scenario.payload.attachment if scenario.payload else (0.0, 0.0, 0.0)
        self._assembly, self._sensors = assembly, as_arrays(sensor_parameters(assembly.scenario))

    def observe(self, plant: MujocoPlant, rotor_speeds: Sequence[float]) -> Observation:
        """The plant's present state as a controller sees it, through the scenario's sensors.

        ``rotor_speeds`` are signed, one for each rotor, rad/s.
        """
        time, data = plant.evaluation_time, plant.data
        qpos, qvel = measured(time, data.qpos, data.qvel, self._sensors)
        tilts, tilt_rates = qpos[7 : 7 + self._tilts], qvel[6 : 6 + self._tilts]
        return Observation(
            time=plant.time,
            position=qpos[:3].copy(),
            velocity=qvel[:3].copy(),
            attitude=euler_angles(qpos[3:7]),
            quaternion=qpos[3:7].copy(),
            body_rates=qvel[3:6].copy(),
            tilt_angles=tilts.copy() if self._tilting else np.zeros(self._tilts),
            tilt_rates=tilt_rates.copy() if self._tilting else np.zeros(self._tilts),
            rotor_speeds=self._spins * rotor_speeds,
            reference=self._reference(time),
            vehicle=self._vehicle,
            reference_at=self._reference,
            **self._felt_by(plant),
        )

    def _felt_by(self, plant: MujocoPlant) -> dict[str, Floats]:
        """Force of contacts and swing of a load."""
        if self._felt is None:
            return {}
        qpos, _, act = vectors_of(self._assembly.loop, plant.data).joined()
        felt = np.array(self._felt(qpos, act, self._attachment))
        return {"contact_force": felt[FELT.contact_force], "swing": felt[FELT.swing]}

    def _reference(self, time: float) -> Reference:
        knots, reference = self._assembly.knots, self._assembly.reference
        motion = np.array(reference_derivatives(time, reference, knots)[:9])
        angles, rates = np.zeros((2, self._tilts))
        if self._tilting:
            angles, rates, _ = np.array(self._assembly.gait.jets(time)).T
        return Reference(
            position=motion[:3],
            velocity=motion[3:6],
            acceleration=motion[6:],
            attitude=np.array(attitude_reference(time, reference, knots)),
            tilt_angles=angles.copy(),
            tilt_rates=rates.copy(),
            force=commanded_force(time, self._push) * np.array(self._push.direction),
        )


def flip_by_spin(values: Sequence[float], spins: Sequence[float]) -> Values:
    """Speeds along the spin from signed ones, and back."""
    return tuple(spin * value for spin, value in zip(spins, values, strict=True))
