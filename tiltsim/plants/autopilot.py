"""Vehicles flown by a firmware in the loop: its controller, mixers and ArduPilot files."""

import re
from typing import Any, Final

import numpy as np

from tiltsim.errors import InputError
from tiltsim.plants.autopilot_links import LINKS, Link, Readings
from tiltsim.plants.command import Command, ControllerError, Observation
from tiltsim.scenario.scenario import Scenario
from tiltsim.scenario.simulation_table import AutopilotTable
from tiltsim_controllers.mathematics.attitude import FLIP, rotation_of_quaternion
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.rotors import force_and_torque


class Mixer:
    """The vehicle's rotors and tilts as outputs of a firmware.

    `signed`: whether an output takes both signs: of reversible rotors, and pairs of tilting ones.

    Args:
        scenario: The scenario with its autopilot.

    Raises:
        InputError: If an output does not fit the vehicle, or a rotor has no top speed.
    """

    def __init__(self, scenario: Scenario) -> None:
        vehicle = scenario.any_rotorcraft
        self.vehicle = vehicle.multirotor
        rotors, tilts = len(self.vehicle.rotors), self.vehicle.tilts
        table: Any = scenario.autopilot
        names = table.outputs or tuple(f"rotor_{i}" for i in range(1, rotors + 1))
        self._coefficients = np.array(self.vehicle.thrust_coefficients)
        ranges = zip(self.vehicle.speed_ranges, self.vehicle.spins, strict=True)
        along = np.array([sorted((spin * low, spin * high)) for (low, high), spin in ranges])
        low, high = vehicle.min_rotor_speed, vehicle.max_rotor_speed
        self._low = along[:, 0] if low is None else np.full(rotors, float(low))
        self._low[~np.isfinite(self._low)] = 0.0  # without a lowest speed rotors do not reverse
        self._top = along[:, 1] if high is None else np.full(rotors, float(high))
        if not np.isfinite(self._top).all():
            raise InputError(
                f"{scenario.address}: autopilot: needs vehicle.max_rotor_speed, the speed at the "
                "widest pulse"
            )
        self.places: dict[str, dict[int, int]] = {"rotor": {}, "along": {}, "across": {}}
        for channel, name in enumerate(names):
            if name:
                kind, number = re.fullmatch(r"([a-z]+)_(\d+)", name).groups()  # type: ignore[union-attr]
                rotor = int(number) - 1
                if rotor >= rotors:
                    raise InputError(
                        f"{scenario.address}: autopilot.outputs = {name!r}: the vehicle has "
                        f"{rotors} rotors"
                    )
                if kind != "rotor" and self.vehicle.tilt_of_rotor[rotor] < 0:
                    raise InputError(
                        f"{scenario.address}: autopilot.outputs = {name!r}: this rotor has no tilt"
                    )
                self.places[kind][rotor] = channel
        for rotor in range(rotors):
            kinds = {kind for kind, found in self.places.items() if rotor in found}
            if kinds not in ({"rotor"}, {"along", "across"}):
                raise InputError(
                    f"{scenario.address}: autopilot.outputs: rotor {rotor + 1} needs one output "
                    f'"rotor_{rotor + 1}", or "along_{rotor + 1}" and "across_{rotor + 1}"'
                )
        self._tilts = np.zeros(tilts)
        self.signed = np.ones(len(names), dtype=bool)
        for rotor, channel in self.places["rotor"].items():
            self.signed[channel] = self._low[rotor] < 0.0

    def command(self, shares: Floats) -> Command:
        """Rotor speeds (rad/s, along the spin) and tilt angles (rad) of outputs.

        Args:
            shares: Outputs, shape (outputs,), linear in rotor speed: from -1 to 1 of a
                signed one, else from 0 to 1.
        """
        speeds = np.zeros(len(self._top))
        for rotor, channel in self.places["rotor"].items():
            speeds[rotor] = max(self._low[rotor], shares[channel] * self._top[rotor])
        for rotor, channel in self.places["along"].items():
            pair = shares[[channel, self.places["across"][rotor]]]
            along, across = pair * abs(pair)
            size = self._top[rotor] * np.sqrt(np.hypot(along, across))
            speeds[rotor] = np.clip(size, self._low[rotor], self._top[rotor])
            if size > 0.0:
                self._tilts[self.vehicle.tilt_of_rotor[rotor]] = np.arctan2(across, along)
        tilts = self._tilts.copy() if self.places["along"] else None
        return Command(rotor_speeds=speeds, tilt_angles=tilts)

    def lift(self, command: Command) -> float:
        """Force along body z, N, of a command at rest."""
        speeds = np.asarray(command.rotor_speeds)
        tilts = self._tilts if command.tilt_angles is None else command.tilt_angles
        force, _ = force_and_torque(self.vehicle.table, tilts)
        spins = np.array(self.vehicle.spins)
        return float(force[2] @ (spins * speeds * abs(speeds)))

    def factors(self) -> Floats:
        """How much each output gives of force (N) and torque (N m), body axes, shape (6, outputs).

        Outputs are here shares of the full thrust: the firmware takes their root.
        """
        full = self._coefficients * self._top**2
        channels = {c: (kind, r) for kind, by in self.places.items() for r, c in by.items()}
        found = np.zeros((6, max(channels) + 1))
        tilts = self.vehicle.tilts
        by_kind = {
            kind: np.vstack(force_and_torque(self.vehicle.table, np.full(tilts, angle)))
            for kind, angle in (("rotor", 0.0), ("along", 0.0), ("across", np.pi / 2.0))
        }
        for channel, (kind, rotor) in channels.items():
            signed = self.vehicle.spins[rotor] / self._coefficients[rotor] * full[rotor]
            found[:, channel] = by_kind[kind][:, rotor] * signed
        return found


class FirmwareController:
    """The controller of a scenario with ``[autopilot]``: called once per exchange.

    Args:
        scenario: The scenario.

    Raises:
        InputError: If its outputs do not fit the vehicle, or the port is in use.
    """

    def __init__(self, scenario: Scenario) -> None:
        assert scenario.autopilot is not None
        self._table: AutopilotTable = scenario.autopilot
        self._mixer = Mixer(scenario)
        self._step = self._table.control_timestep
        self._weight = self._mixer.vehicle.mass * self._mixer.vehicle.gravity
        self._gravity = np.array([0.0, 0.0, self._mixer.vehicle.gravity])
        self._velocity: Floats | None = None
        self._exchanges = 0
        self._link: Link = LINKS[self._table.type](
            self._table, self._mixer.signed, scenario.address
        )

    def reset(self, _scenario: Scenario) -> None:
        """Hold the vehicle at rest until the firmware lifts it."""
        command = self._mixer.command(self._link.exchange(None))
        zero, upright = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
        while self._mixer.lift(command) <= self._weight:
            if self._exchanges * self._step > self._table.hold:
                raise ControllerError(
                    f"autopilot.hold: {self._table.hold:g} s of simulated time without lift-off"
                )
            command = self._exchange(zero, zero, upright, zero, self._gravity)

    def __call__(self, observation: Observation) -> Command:
        """Send the sensors' readings, and wait for outputs."""
        rotation = rotation_of_quaternion(observation.quaternion)
        before = observation.velocity if self._velocity is None else self._velocity
        accelerated = (observation.velocity - before) / self._step + self._gravity
        self._velocity = observation.velocity
        return self._exchange(
            observation.position,
            observation.velocity,
            observation.quaternion,
            observation.body_rates,
            rotation.T @ accelerated,  # the mean specific force since the last exchange
        )

    def _exchange(
        self, position: Floats, velocity: Floats, turn: Floats, rates: Floats, force: Floats
    ) -> Command:
        """Turn readings into the firmware's frames, send them and receive its outputs."""
        self._exchanges += 1
        now = self._exchanges * self._step
        rows = [row for row in self._table.rc if row[0] <= now]
        sticks = rows[-1][1:] if rows else ()
        vectors = (
            FLIP * position,
            FLIP * velocity,
            turn * [1.0, *FLIP],
            FLIP * rates,
            FLIP * force,
        )
        return self._mixer.command(self._link.exchange(Readings(now, *vectors, sticks)))


PARAMETERS = {
    "FRAME_CLASS": 16,  # motors with six degrees of freedom, from a script
    "SCR_ENABLE": 1,
    "MOT_THST_EXPO": 1,  # pulses are linear in rotor speed
    "MOT_SPIN_MIN": 0,
    "MOT_SPIN_MAX": 1,
    "MOT_PWM_MIN": 1000,
    "MOT_PWM_MAX": 2000,
    "MOT_SPIN_ARM": 0,
    "MOT_YAW_HEADROOM": 0,  # here a dead zone in which outputs keep their sign
    "LOG_BACKEND_TYPE": 0,  # repeated flights differ while its logger runs
}
"""Parameters of every frame; the user's own file of parameters comes after them."""

RATES: Final = {"RLL": (20.0, 1.0, 0.02), "PIT": (20.0, 1.0, 0.02), "YAW": (10.0, 0.1, 0.0)}
"""Rate loops: bandwidth (rad/s), integral and derivative gains per proportional gain."""


def motor_offset(motor: int) -> int:
    """The function of a servo output for a motor, less the motor's number."""
    return 32 if motor <= 8 else 73 if motor <= 12 else 147


def ardupilot_files(scenario: Scenario) -> dict[str, str]:
    """The contents of ``parameters.parm`` and ``frame.lua``, by name.

    Each output has a factor for roll, pitch, yaw, up, forward and right: the least outputs that
    give one unit of it alone, the largest factor of up and the largest of the torques 1: at full
    throttle the first rotor has its full thrust.

    Args:
        scenario: A scenario with ``[autopilot]``.

    Raises:
        InputError: If it has none, or its outputs do not give every force and torque.
    """
    if scenario.autopilot is None:
        raise InputError(f"{scenario.address}: autopilot: this scenario has no [autopilot] table")
    mixer = Mixer(scenario)
    factors = mixer.factors()
    sizes = np.maximum(np.abs(factors).max(axis=1, keepdims=True), 1e-300)
    if np.linalg.matrix_rank(factors / sizes) < 6:
        raise InputError(
            f"{scenario.address}: autopilot.outputs: they do not give every force and torque; fly "
            "one of the firmware's own frames"
        )
    least = np.linalg.pinv(factors)  # (outputs, 6): x forward, y left, z up
    pushes = least[:, :3] * [1.0, -1.0, 1.0] / np.abs(least[:, 2]).max()  # forward, right, up
    forces = pushes[:, [2, 0, 1]]
    turns = least[:, 3:] * FLIP / np.abs(least[:, 3:]).max()
    lines = [
        "Motors_6DoF:add_motor({}, {}, {}, {})".format(
            channel,
            ", ".join(f"{value:.5f}" for value in (*turn, *force)),
            str(bool(mixer.signed[channel])).lower(),
            channel + 1,
        )
        for channel, (turn, force) in enumerate(zip(turns, forces, strict=True))
    ]
    lines.append(f"assert(Motors_6DoF:init({len(lines)}), 'frame')")
    lines.append("motors:set_frame_string('tiltsim')")
    parameters = [f"{name} {value}" for name, value in PARAMETERS.items()]
    inertia = np.diag(np.reshape(mixer.vehicle.inertia, (3, 3)))
    for size, (axis, (bandwidth, *shares)) in zip(inertia, RATES.items(), strict=True):
        gain = bandwidth * size * np.abs(least[:, 3:]).max()  # per unit of the firmware's torque
        for name, share in zip("PID", (1.0, *shares), strict=True):
            parameters.append(f"ATC_RAT_{axis}_{name} {gain * share:.5g}")
    for motor in range(1, len(least) + 1):
        parameters.append(f"SERVO{motor}_FUNCTION {motor + motor_offset(motor)}")
    return {"parameters.parm": "\n".join(parameters) + "\n", "frame.lua": "\n".join(lines) + "\n"}
