"""Observations and commands of a user's own controller."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.errors import TiltsimError
from tiltsim_controllers.mathematics.scalar import Floats, Quad
from tiltsim_controllers.vehicle.parameters import Vehicle

if TYPE_CHECKING:
    import numpy.typing as npt


ROTOR_COMMANDS: Final = ("thrusts", "rotor_speeds", "rotor_accelerations")
"""What the rotors can be told; a command gives one of them."""


@dataclass(frozen=True, slots=True)
class Reference:
    """Where the vehicle should be at the time of an observation; world axes."""

    position: Floats  # (3,), m
    velocity: Floats  # (3,), m/s
    acceleration: Floats  # (3,), m/s^2
    attitude: Floats  # (3,), roll, pitch, yaw, rad
    tilt_angles: Floats  # (4,), rad, of the planned gait; zeros for the quadrotor
    tilt_rates: Floats  # (4,), rad/s


@dataclass(frozen=True, slots=True)
class Observation:
    """What a controller sees: the vehicle's state as arrays, its reference, its parameters.

    The state is what the scenario's sensors say of it. The arrays are copies: a controller may keep
    or change them.
    """

    time: float  # s
    position: Floats  # (3,), m, world
    velocity: Floats  # (3,), m/s, world
    attitude: Floats  # (3,), roll, pitch, yaw, rad
    quaternion: Floats  # (4,), body to world, scalar first
    body_rates: Floats  # (3,), p, q, r, rad/s, body axes
    tilt_angles: Floats  # (4,), rad; zeros for the quadrotor
    tilt_rates: Floats  # (4,), rad/s
    rotor_speeds: Floats  # (4,), rad/s, positive along each rotor's spin
    reference: Reference
    vehicle: Vehicle  # mass, inertia, arm length, rotor coefficients, gravity


@dataclass(frozen=True, slots=True, kw_only=True)
class Command:
    """What a controller tells the vehicle: one of the three for the rotors, and tilt angles.

    It takes effect after the scenario's latency; speeds then at once, or with the rotors' lag.

    Attributes
    ----------
    thrusts
        (4,), N, along each rotor's axis, as speeds.
    rotor_speeds
        (4,), rad/s, positive along each rotor's spin.
    rotor_accelerations
        (4,), rad/s^2, likewise; the speeds grow evenly until the next sample.
    tilt_angles
        (4,), rad, for the tilt servos. Left out, the servos follow the planned gait. The quadrotor
        has none.
    """

    thrusts: npt.ArrayLike | None = None
    rotor_speeds: npt.ArrayLike | None = None
    rotor_accelerations: npt.ArrayLike | None = None
    tilt_angles: npt.ArrayLike | None = None


Controller = Callable[[Observation], Command]
"""A function from what is seen to what is done; one with a memory may have ``reset(scenario)``."""


class ControllerError(TiltsimError):
    """A controller raised, or returned what is no command; the message says what was wrong."""


@dataclass(frozen=True, slots=True)
class CheckedCommand:
    """A command found valid: floats, and which of `ROTOR_COMMANDS` the four rotor values are."""

    kind: str
    rotors: Quad
    tilt_angles: Quad | None


def checked(command: object, *, tilting: bool) -> CheckedCommand:
    """The numbers of a command.

    Raises
    ------
    ControllerError
        If it is no `Command`, gives not exactly one of `ROTOR_COMMANDS`, or has an entry of the
        wrong shape or one that is no finite number; tilt angles need a vehicle that tilts.
    """
    if not isinstance(command, Command):
        raise ControllerError(f"returned {_short(command)}; a tiltsim.Command is wanted")
    given = [name for name in ROTOR_COMMANDS if getattr(command, name) is not None]
    if len(given) != 1:
        what = " and ".join(given) if given else "nothing for the rotors"
        raise ControllerError(f"returned {what}; one of {', '.join(ROTOR_COMMANDS)} is wanted")
    if command.tilt_angles is not None and not tilting:
        raise ControllerError("returned tilt_angles; this vehicle has no tilt servos")
    tilts = None if command.tilt_angles is None else _four("tilt_angles", command.tilt_angles)
    return CheckedCommand(given[0], _four(given[0], getattr(command, given[0])), tilts)


def _four(name: str, value: Any) -> Quad:
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise ControllerError(f"returned {name} = {_short(value)}; 4 numbers are wanted") from None
    if array.shape != (4,):
        raise ControllerError(f"returned {name} of shape {array.shape}; (4,) is wanted")
    first, second, third, fourth = values = array.tolist()
    for index, number in enumerate(values):
        if not isfinite(number):
            raise ControllerError(f"returned {name}[{index}] = {number}; it must be finite")
    return first, second, third, fourth


def _short(value: object) -> str:
    try:
        text = " ".join(repr(value).split())
    except Exception:
        text = f"a {type(value).__name__}"
    return text if len(text) <= 60 else text[:57] + "..."


def observation(
    time: float,
    qpos: Floats,
    qvel: Floats,
    speeds_along_spin: Sequence[float],
    attitude: Sequence[float],
    reference: Reference,
    vehicle: Vehicle,
) -> Observation:
    """An observation from MuJoCo's state; without hinges, tilt angles and rates are zeros."""
    tilts, rates = qpos[7:11], qvel[6:10]
    return Observation(
        time=time,
        position=qpos[:3].copy(),
        velocity=qvel[:3].copy(),
        attitude=np.array(attitude),
        quaternion=qpos[3:7].copy(),
        body_rates=qvel[3:6].copy(),
        tilt_angles=tilts.copy() if len(tilts) else np.zeros(4),
        tilt_rates=rates.copy() if len(rates) else np.zeros(4),
        rotor_speeds=np.array(speeds_along_spin),
        reference=reference,
        vehicle=vehicle,
    )
