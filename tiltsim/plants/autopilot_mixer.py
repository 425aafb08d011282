"""Outputs of a firmware as speeds of rotors and angles of tilts."""

import re
from typing import Any

import numpy as np

from tiltsim.errors import InputError
from tiltsim.models.cross import as_multirotor
from tiltsim.plants.command import Command
from tiltsim.scenario.scenario import Scenario
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
