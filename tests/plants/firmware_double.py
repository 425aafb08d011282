"""A double of a firmware that speaks ArduPilot's JSON interface: hovers 1 m above the start."""

from __future__ import annotations

import json
import socket
import struct
import threading
from contextlib import suppress

import numpy as np

from tiltsim_controllers.mathematics.attitude import FLIP

HEIGHT = 1.0  # m


class Firmware(threading.Thread):
    """Sends outputs and blocks until readings come, as the firmware does.

    Args:
        port: Port of the simulation.
        wrench_map: Force and torque, body axes, of each output at 1, shape (6, outputs).
        linear: Whether outputs are thrusts about 1500 us; else speeds from 1000 us.
        weight: N; inertia: kg m^2, shape (3,).
        exchanges: Their number, after which it is silent; then ``last``, if it is not empty.
        repeat: Whether it sends each output twice, as when an answer comes late.
    """

    def __init__(
        self, port, wrench_map, weight, inertia, *, linear, exchanges, last=b"", repeat=False
    ):
        super().__init__(daemon=True)
        self.port, self.linear, self.exchanges, self.last = port, linear, exchanges, last
        self.inverse, self.weight, self.inertia = np.linalg.pinv(wrench_map), weight, inertia
        self.width, self.repeat = wrench_map.shape[1], repeat
        self.readings = []

    def run(self):
        link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        link.settimeout(0.3)
        pulses = np.full(16, 1500.0 if self.linear else 1000.0)
        for count in range(self.exchanges):
            packet = struct.pack("<HHI16H", 18458, 400, count, *pulses.round().astype(int))
            text = b""
            for _ in range(20):  # the simulation may not listen yet
                for _ in range(1 + self.repeat):
                    link.sendto(packet, ("127.0.0.1", self.port))
                with suppress(TimeoutError):
                    text = link.recv(4096)
                    break
            if not text:
                break
            state = json.loads(text)
            self.readings.append(state)
            pulses[: self.width] = self.outputs(state)
        if self.last:
            link.sendto(self.last, ("127.0.0.1", self.port))
        link.close()

    def outputs(self, state):
        """Position and attitude feedback; thrusts grow during the first second."""
        position, velocity = (FLIP * state[key] for key in ("position", "velocity"))
        rates = FLIP * state["imu"]["gyro"]
        w, x, y, z = state["quaternion"]
        error = 2.0 * np.sign(w) * np.array([x, -y, -z])
        demanded = 2.0 * (np.array([0.0, 0.0, HEIGHT]) - position) - 2.5 * velocity
        lean = np.clip([-demanded[1] / 9.8, demanded[0] / 9.8, 0.0], -0.2, 0.2)
        torque = self.inertia * (60.0 * (lean - error) - 14.0 * rates)
        lift = self.weight * min(1.0 + demanded[2] / 9.8, 1.3 * state["timestamp"])
        shares = self.inverse @ np.array([0.0, 0.0, lift, *torque])
        if self.linear:
            return 1500.0 + 500.0 * np.clip(shares, -1.0, 1.0)
        return 1000.0 + 1000.0 * np.sqrt(np.clip(shares, 0.0, 1.0))
