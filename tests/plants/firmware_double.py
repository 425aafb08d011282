"""Doubles of firmwares, with ArduPilot's JSON and PX4's MAVLink: hover 1 m above the start."""

from __future__ import annotations

import json
import socket
import struct
import threading
import time
from contextlib import suppress

import numpy as np

from tiltsim_controllers.mathematics.attitude import (
    FLIP,
    quaternion_product,
    rotation_of_quaternion,
)

HEIGHT = 1.0  # m


class Firmware(threading.Thread):
    """Sends outputs and blocks until readings come, as the firmware does.

    Args:
        port: Port of the simulation.
        wrench_map: Force and torque, body axes, of each output at 1, shape (6, outputs).
        signed: Whether outputs are speeds about 1500 us; else from 1000 us.
        weight: N; inertia: kg m^2, shape (3,).
        exchanges: Their number, after which it is silent; then ``last``, if it is not empty.
        late: Time after which that comes, or the link closes, s.
        repeat: Whether it sends each output twice, as when an answer comes late.
    """

    def __init__(self, port, wrench_map, weight, inertia, *, signed, exchanges, **options):
        super().__init__(daemon=True)
        self.port, self.signed, self.exchanges = port, signed, exchanges
        self.last, self.late = options.get("last", b""), options.get("late", 0.0)
        self.inverse, self.weight, self.inertia = np.linalg.pinv(wrench_map), weight, inertia
        self.width, self.repeat = wrench_map.shape[1], options.get("repeat", False)
        self.readings = []

    def run(self):
        link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        link.settimeout(0.3)
        pulses = np.full(16, 1500.0 if self.signed else 1000.0)
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
            assert b": " not in text  # the firmware's parser takes no space after a colon
            shares = self.outputs(state)
            pulses[: self.width] = (
                (1500.0 + 500.0 * shares) if self.signed else 1000.0 * (1 + shares)
            )
        time.sleep(self.late)
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
        shares = np.clip(shares, -1.0 if self.signed else 0.0, 1.0)
        return np.sign(shares) * np.sqrt(np.abs(shares))


class Px4Firmware(Firmware):
    """Knows its state by inertial navigation alone; answers after some readings, as PX4 does.

    Args:
        shift: Added to the times of its answers, us.
    """

    def __init__(self, *args, shift=0, **options):
        super().__init__(*args, **options)
        self.shift = shift

    def run(self):
        from pymavlink.dialects.v20 import common

        mavlink = common.MAVLink(None)
        for _ in range(500):  # the simulation may not listen yet
            with suppress(ConnectionRefusedError):
                link = socket.create_connection(("127.0.0.1", self.port), timeout=2.0)
                break
            time.sleep(0.01)
        position, velocity, turn = np.zeros(3), np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
        before = 0
        while len(self.readings) < self.exchanges:
            content = link.recv(65536)
            if not content:
                break
            for one in mavlink.parse_buffer(content) or ():
                if one.get_type() != "HIL_SENSOR":
                    continue
                step = 1e-6 * (one.time_usec - before)
                before = one.time_usec
                rates = np.array([one.xgyro, one.ygyro, one.zgyro])
                turn = turn + quaternion_product(turn, np.array([0.0, *(0.5 * step * rates)]))
                turn /= np.linalg.norm(turn)
                force = np.array([one.xacc, one.yacc, one.zacc])
                velocity = velocity + step * (
                    rotation_of_quaternion(turn) @ force + [0.0, 0.0, 9.8]
                )
                position = position + step * velocity
                self.readings.append(one)
                if len(self.readings) <= 5:
                    position, velocity = np.zeros(3), np.zeros(3)
                    continue
                shares = self.outputs(
                    {
                        "position": position,
                        "velocity": velocity,
                        "quaternion": turn,
                        "imu": {"gyro": rates},
                        "timestamp": 1e-6 * one.time_usec,
                    }
                )
                controls = np.pad(shares, (0, 16 - len(shares)))
                stamp = one.time_usec + self.shift
                link.sendall(
                    mavlink.hil_actuator_controls_encode(stamp, controls, 129, 1).pack(mavlink)
                )
        time.sleep(self.late)
        if self.last:
            link.sendall(self.last)
        time.sleep(0.01)
        link.close()
