"""Arguments and results of control laws of rotorcraft with N rotors and M tilts.

A law is a function of small NumPy arrays: ``(observed, parameters) -> Command``, or, for rotor
accelerations, ``(seen, parameters, knots) -> Step``.
"""

from dataclasses import dataclass
from math import inf
from typing import Any, Final, NamedTuple

import numpy as np

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.vehicle.body import Body
from tiltsim_controllers.vehicle.parameters import Vehicle
from tiltsim_controllers.vehicle.rotors import Rotors

ROTOR_COMMANDS: Final = ("thrusts", "rotor_speeds", "rotor_accelerations")
"""Commands for the rotors; a `Command` gives one of them."""


class Seen(NamedTuple):
    """The measured state of a vehicle, and the states of its controller."""

    time: Any  # s
    state: Any  # `tiltsim_controllers.vehicle.body.RotorcraftState` in one vector
    tilt_rates: Any = np.zeros(0)  # (M,), rad/s
    states: Any = np.zeros(0)  # (S,), of the controller
    measured: Any = None  # (3,), angular acceleration, rad/s^2, body axes; None: by the law's model
    supervisor: Any = np.zeros(3)  # (3,), its state with rate and acceleration; zero at rest
    contact_force: Any = np.zeros(3)  # (3,), N, of the vehicle on all objects, world axes
    swing: Any = np.zeros(2)  # (2,), rad, of the cable of a load toward +x and +y
    readings: Any = np.zeros(0)  # of the vehicle's instruments, see `Observed`
    shift: Any = np.zeros((3, 3))  # of the reference: position, velocity, acceleration, m and s
    recorded: bool = False  # whether it is a sample of a flight, of which signals alone are needed


class Step(NamedTuple):
    """The output of a law at an instant."""

    inputs: Any  # (N,), rotor accelerations, rad/s^2
    rates: Any = np.zeros(0)  # (S,), of the controller's states, per second
    signals: Any = np.zeros(0)  # further numbers, columns of a flight


class Desired(NamedTuple):
    """The reference: motion in world axes, roll, pitch and yaw, and the planned gait."""

    position: Any  # (3,), m
    velocity: Any  # (3,), m/s
    acceleration: Any  # (3,), m/s^2
    jerk: Any  # (3,), m/s^3
    attitude: Any  # (3,), roll, pitch, yaw, rad
    tilt_angles: Any  # (M,), rad
    tilt_rates: Any  # (M,), rad/s
    attitude_rates: Any = np.zeros(3)  # (3,), of roll, pitch and yaw, rad/s
    attitude_accelerations: Any = np.zeros(3)  # (3,), likewise, rad/s^2


class Observed(NamedTuple):
    """The state of a vehicle as its sensors measure it, its reference and its parameters."""

    time: Any  # s
    position: Any  # (3,), m, world axes
    velocity: Any  # (3,), m/s, world axes
    attitude: Any  # (3,), roll, pitch, yaw, rad
    rotation: Any  # (3, 3), body to world
    body_rates: Any  # (3,), rad/s, body axes
    tilt_angles: Any  # (M,), rad
    tilt_rates: Any  # (M,), rad/s
    rotor_speeds: Any  # (N,), rad/s, along the spin
    thrusts: Any  # (N,), N, of the rotors at these speeds
    states: Any  # (S,), of the law
    discrete: Any  # (D,), discrete states of the law
    reference: Desired
    vehicle: Vehicle | Body  # mass (kg), gravity (m/s^2), moments of inertia (kg m^2)
    inertia: Any  # (3, 3), kg m^2
    gyroscopic: Any  # 1 where the plant has gyroscopic torque, else 0
    force: Any  # (3, N), body axes, of each rotor per newton of its thrust
    torque: Any  # (3, N), N m per newton, likewise
    rotors: Rotors  # force and torque per newton at any tilts
    table: Any  # further numbers of the law, such as gains over time
    tilt_commands: Any  # (M,), rad, of a law that commands the tilts; otherwise none
    contact_force: Any = np.zeros(3)  # (3,), N, of the vehicle on all objects, world axes
    swing: Any = np.zeros(2)  # (2,), rad, of a load's cable from straight down toward +x and +y
    readings: Any = np.zeros(0)  # of each instrument its values, then 1 if they are new, else 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Command:
    """The output of a controller: one of three commands for the rotors, and tilt angles.

    A controller in plain Python is called at the control samples; its command takes effect after
    the scenario's latency, speeds then at once, or with the rotors' lag. The speeds commanded by a
    law are approached with the lag ``controller.rotor_bandwidth``.
    """

    thrusts: Any = None  # (N,), N, along each rotor's axis; they set its speed
    rotor_speeds: Any = None  # (N,), rad/s, positive along each rotor's spin
    rotor_accelerations: Any = None  # (N,), rad/s^2, likewise, held until the next sample
    tilt_angles: Any = None
    """(M,), rad, from -pi to pi, for the tilt servos; default: the planned gait. A vehicle whose
    rotors are fixed has none."""
    rates: Any = None  # (S,), of a law's states, per second; plain Python has none
    discrete: Any = None  # (D,), a law's discrete states from this control sample on


class Failure(NamedTuple):
    """A failed rotor and when it is known: from then on the controller uses the others."""

    rotor: float = 0.0  # from 1, 0 for none
    known_from: float = inf  # s


UNHARMED: Final = Failure()
"""All rotors work, as far as is known."""


def working(time: Any, failure: Failure, rotors: int) -> Any:
    """1 for a rotor that works as far as is known at a time (s), 0 for one that failed, (N,)."""
    known = time >= failure.known_from
    return xp.array(
        [xp.where(known & (failure.rotor == i), 0.0, 1.0) for i in range(1, rotors + 1)]
    )
