"""A firmware in lockstep: its outputs command the rotors, and it waits for the sensors' readings.

ArduPilot's JSON interface: the firmware sends its outputs over UDP and blocks until one line of
JSON answers; simulated time advances by the times in the answers. Its world is north, east, down,
its body forward, right, down: half a turn about x from z up and forward, left, up.
"""

import json
import re
import socket
import time
from struct import Struct
from typing import Any, Final

import numpy as np

from tiltsim.errors import InputError
from tiltsim.models.cross import as_multirotor
from tiltsim.plants.command import Command, ControllerError, Observation
from tiltsim.scenario.autopilot import AutopilotTable
from tiltsim.scenario.scenario import Scenario
from tiltsim_controllers.mathematics.attitude import FLIP, rotation_of_quaternion
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.effectiveness import force_and_torque

PACKETS: Final = {18458: Struct("<HHI16H"), 29569: Struct("<HHI32H")}
"""Outputs of the firmware, by their first number: magic, rate (Hz), count, pulse widths (us)."""

LOOPBACK: Final = "127.0.0.1"

LOW, MIDDLE, HIGH = 1000.0, 1500.0, 2000.0  # us


class Mixer:
    """The vehicle's rotors and tilts as outputs of a firmware.

    Args:
        scenario: The scenario with its autopilot.

    Raises:
        InputError: If an output does not fit the vehicle, or a rotor has no top speed.
    """

    def __init__(self, scenario: Scenario) -> None:
        vehicle = scenario.any_rotorcraft
        self.vehicle = as_multirotor(vehicle.resolve(), tilting=vehicle.has_tilting_rotors)
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

    def command(self, pulses: Floats) -> Command:
        """Rotor speeds (rad/s, along the spin) and tilt angles (rad) of pulse widths (us)."""
        speeds = np.zeros(len(self._top))
        full = self._coefficients * self._top**2
        for rotor, channel in self.places["rotor"].items():
            if self._low[rotor] < 0.0:
                thrust = full[rotor] * self._about_middle(pulses[channel])
                size = np.sqrt(abs(thrust) / self._coefficients[rotor])
                speeds[rotor] = max(self._low[rotor], np.sign(thrust) * size)
            else:
                share = np.clip((pulses[channel] - LOW) / (HIGH - LOW), 0.0, 1.0)
                speeds[rotor] = max(self._low[rotor], share * self._top[rotor])
        for rotor, channel in self.places["along"].items():
            along = full[rotor] * self._about_middle(pulses[channel])
            across = full[rotor] * self._about_middle(pulses[self.places["across"][rotor]])
            size = np.sqrt(np.hypot(along, across) / self._coefficients[rotor])
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

        Outputs are shares of the full thrust, in which rotors that do not reverse are also linear,
        since the firmware takes the root of theirs.
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

    @staticmethod
    def _about_middle(pulse: float) -> float:
        """A pulse about the middle as a share from -1 to 1; 0 for no pulse."""
        share = np.clip((pulse - MIDDLE) / (HIGH - MIDDLE), -1.0, 1.0)
        return float(share) if pulse >= 900.0 else 0.0


class ArduPilot:
    """The controller of a scenario with ``[autopilot]``: called once per exchange.

    Args:
        scenario: The scenario.
    """

    def __init__(self, scenario: Scenario) -> None:
        assert scenario.autopilot is not None
        self._table: AutopilotTable = scenario.autopilot
        self._mixer = Mixer(scenario)
        self._step = self._table.control_timestep
        self._weight = self._mixer.vehicle.mass * self._mixer.vehicle.gravity
        self._gravity = np.array([0.0, 0.0, self._mixer.vehicle.gravity])
        self._count: int | None = None
        self._velocity: Floats | None = None
        self._exchanges = 0
        self._peer: Any = None
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((LOOPBACK, self._table.port))
        except OSError as error:
            raise InputError(
                f"{scenario.address}: autopilot.port = {self._table.port}: {error.strerror}; is "
                "another flight running? choose another port"
            ) from error

    def __del__(self) -> None:
        """Close the port."""
        if hasattr(self, "_socket"):
            self._socket.close()

    def reset(self, _scenario: Scenario) -> None:
        """Hold the vehicle at rest until the firmware lifts it."""
        self._receive()
        rest = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
        while self._mixer.lift(self._command) <= self._weight:
            if self._exchanges * self._step > self._table.hold:
                raise ControllerError(
                    f"autopilot.hold: {self._table.hold:g} s of simulated time without lift-off"
                )
            self._exchange(rest[0], rest[0], rest[1], rest[0], self._gravity)

    def __call__(self, observation: Observation) -> Command:
        """Send the sensors' readings, and wait for outputs."""
        rotation = rotation_of_quaternion(observation.quaternion)
        before = observation.velocity if self._velocity is None else self._velocity
        accelerated = (observation.velocity - before) / self._step + self._gravity
        self._velocity = observation.velocity
        self._exchange(
            observation.position,
            observation.velocity,
            observation.quaternion,
            observation.body_rates,
            rotation.T @ accelerated,  # the mean specific force since the last exchange
        )
        return self._command

    def _exchange(
        self, position: Floats, velocity: Floats, turn: Floats, rates: Floats, force: Floats
    ) -> None:
        """Answer the firmware's outputs with a state, and receive its next outputs."""
        self._exchanges += 1
        now = self._exchanges * self._step
        w, x, y, z = turn.tolist()
        state: dict[str, Any] = {
            "timestamp": now,
            "imu": {"gyro": (rates * FLIP).tolist(), "accel_body": (force * FLIP).tolist()},
            "position": (position * FLIP).tolist(),
            "quaternion": [w, x, -y, -z],
            "velocity": (velocity * FLIP).tolist(),
        }
        rows = [row for row in self._table.rc if row[0] <= now]
        if rows:
            state["rc"] = {f"rc_{i}": value for i, value in enumerate(rows[-1][1:], start=1)}
        self._socket.sendto(b"\n" + json.dumps(state).encode() + b"\n", self._peer)
        self._receive()

    def _receive(self) -> None:
        """Wait for the next outputs. Raises `ControllerError` if the link is lost or not ours."""
        end = time.monotonic() + self._table.wait
        while True:
            self._socket.settimeout(max(1e-3, end - time.monotonic()))
            try:
                content, peer = self._socket.recvfrom(2048)
            except TimeoutError:
                raise ControllerError(
                    f"the link to the firmware is lost: nothing on port {self._table.port} for "
                    f"{self._table.wait:g} s"
                ) from None
            magic = int.from_bytes(content[:2], "little")
            packet = PACKETS.get(magic)
            if packet is None or len(content) != packet.size:
                raise ControllerError(
                    f"a message of {len(content)} bytes that begins with {magic} on port "
                    f"{self._table.port}: these are not ArduPilot's outputs"
                )
            _, _, count, *pulses = packet.unpack(content)
            if count != self._count:  # else repeated, as the firmware had to wait
                self._count, self._peer = count, peer
                self._command = self._mixer.command(np.array(pulses, dtype=float))
                return
