"""Links to a firmware in lockstep: readings out, outputs in.

A link turns `Readings`, which are in the firmware's frames already, into its messages, and its
outputs into shares from -1 to 1 (signed ones) or from 0 to 1.
"""

import json
import socket
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from struct import Struct
from typing import Any, Final, NamedTuple

import numpy as np

from tiltsim.errors import InputError
from tiltsim.plants.command import ControllerError
from tiltsim.scenario.simulation_table import AutopilotTable
from tiltsim.system.public import optional_package
from tiltsim_controllers.mathematics.attitude import rotation_of_quaternion
from tiltsim_controllers.mathematics.scalar import Floats

LOOPBACK: Final = "127.0.0.1"


class Readings(NamedTuple):
    """One exchange's readings; world north, east, down, body forward, right, down."""

    time: float  # s, since the link began
    position: Floats  # (3,), m, world
    velocity: Floats  # (3,), m/s, world
    quaternion: Floats  # (4,), body to world, scalar first
    body_rates: Floats  # (3,), rad/s, body
    specific_force: Floats  # (3,), m/s^2, body
    sticks: tuple[float, ...]  # pulse widths of the channels, us; () for none


class Link(ABC):
    """A socket on loopback, and the messages of a firmware in `exchange`.

    Args:
        table: The scenario's ``[autopilot]``.
        signed: Which outputs take both signs, shape (outputs,).
        address: The scenario's, for messages.
        kind: The socket's.

    Raises:
        InputError: If the port is in use.
    """

    def __init__(
        self, table: AutopilotTable, signed: Any, address: str, kind: socket.SocketKind
    ) -> None:
        self._table, self._signed = table, signed
        self._socket = socket.socket(socket.AF_INET, kind)
        try:
            if kind == socket.SOCK_STREAM:
                self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._socket.bind((LOOPBACK, table.port))
        except OSError as error:
            raise InputError(
                f"{address}: autopilot.port = {table.port}: {error.strerror}; is another flight "
                "running? choose another port"
            ) from error

    def __del__(self) -> None:
        """Close the port."""
        if hasattr(self, "_socket"):
            self._socket.close()

    @abstractmethod
    def exchange(self, readings: Readings | None) -> Floats:
        """Send readings, or none at first, and wait for the outputs that answer them, as shares.

        Raises:
            ControllerError: If the link is lost, or a message is not the firmware's.
        """

    def _lost(self) -> ControllerError:
        return ControllerError(
            f"the link to the firmware is lost: nothing on port {self._table.port} for "
            f"{self._table.wait:g} s"
        )

    def _wrong(self, text: str) -> ControllerError:
        return ControllerError(f"{text} on port {self._table.port}")

    def _used(self, outputs: Floats) -> Floats:
        """The outputs that the vehicle has."""
        if len(outputs) < len(self._signed):
            raise self._wrong(f"{len(outputs)} outputs instead of {len(self._signed)}")
        return outputs[: len(self._signed)]


class ArduPilotLink(Link):
    """ArduPilot's JSON interface: outputs over UDP, and it blocks until one line answers."""

    PACKETS: Final = {18458: Struct("<HHI16H"), 29569: Struct("<HHI32H")}
    """Outputs by their first number: magic, rate (Hz), count, pulse widths (us)."""

    def __init__(self, table: AutopilotTable, signed: Any, address: str) -> None:
        super().__init__(table, signed, address, socket.SOCK_DGRAM)
        self._count: int | None = None
        self._peer: Any = None

    def exchange(self, readings: Readings | None) -> Floats:
        """Answer the outputs, and wait for the next; repeated ones are dropped."""
        if readings is not None:
            state: dict[str, Any] = {
                "timestamp": readings.time,
                "imu": {
                    "gyro": readings.body_rates.tolist(),
                    "accel_body": readings.specific_force.tolist(),
                },
                "position": readings.position.tolist(),
                "quaternion": readings.quaternion.tolist(),
                "velocity": readings.velocity.tolist(),
                "no_time_sync": 1,  # no waiting for the wall clock
            }
            if readings.sticks:
                state["rc"] = {f"rc_{i}": one for i, one in enumerate(readings.sticks, start=1)}
            # Its parser wants the value right after the colon.
            text = json.dumps(state, separators=(",", ":"))
            self._socket.sendto(f"\n{text}\n".encode(), self._peer)
        end = time.monotonic() + self._table.wait
        while True:
            self._socket.settimeout(max(1e-3, end - time.monotonic()))
            try:
                content, peer = self._socket.recvfrom(2048)
            except TimeoutError:
                raise self._lost() from None
            magic = int.from_bytes(content[:2], "little")
            packet = self.PACKETS.get(magic)
            if packet is None or len(content) != packet.size:
                raise self._wrong(
                    f"a message of {len(content)} bytes that begins with {magic}, not ArduPilot's,"
                )
            _, _, count, *pulses = packet.unpack(content)
            if count != self._count:  # else repeated, as the firmware had to wait
                self._count, self._peer = count, peer
                return self._shares(self._used(np.array(pulses, dtype=float)))

    def _shares(self, pulses: Floats) -> Floats:
        low = np.where(self._signed, 1500.0, 1000.0)  # us
        shares = np.clip((pulses - low) / (2000.0 - low), np.where(self._signed, -1.0, 0.0), 1.0)
        return np.where(pulses < 900.0, 0.0, shares)  # no pulse: at rest


class Px4Link(Link):
    """PX4's simulator interface: MAVLink over TCP, answers known by the time of their readings.

    A firmware that starts does not answer: until its first answer, each exchange waits `START`.
    """

    START: Final = 0.02  # s of the wall clock
    HOME: Final = 47.397742, 8.545594, 488.0  # latitude and longitude (deg), height (m)
    FIELD: Final = np.array([0.2172, 0.0121, 0.4325])  # gauss, north, east, down, there
    RADIUS: Final = 6_371_000.0  # m, of the Earth
    FIELDS: Final = 0x1BFF  # all readings of HIL_SENSOR but of an airspeed
    NOISE: Final = np.repeat([2e-2, 1e-3, 5e-4, 1e-2], [3, 3, 3, 1])
    """For forces (m/s^2), rates (rad/s), field (gauss), pressure (hPa): constants seem defects."""

    def __init__(self, table: AutopilotTable, signed: Any, address: str) -> None:
        self._dialect = optional_package(
            "pymavlink.dialects.v20.common", 'autopilot.type = "px4"', "tiltsim[autopilot]"
        )
        self._mavlink = self._dialect.MAVLink(None, srcSystem=1, srcComponent=51)
        self._random = np.random.default_rng(0)
        self._peer: Any = None
        self._answered = False
        self._sent = 0
        super().__init__(table, signed, address, socket.SOCK_STREAM)
        self._socket.listen(1)

    def __del__(self) -> None:
        """Close the connection and the port."""
        if getattr(self, "_peer", None) is not None:
            self._peer.close()
        super().__del__()

    def exchange(self, readings: Readings | None) -> Floats:
        """Send readings and wait for the outputs of their time; earlier ones are dropped."""
        if readings is None:
            self._socket.settimeout(self._table.wait)
            try:
                self._peer, _ = self._socket.accept()
            except TimeoutError:
                raise self._lost() from None
            self._peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            return np.zeros(len(self._signed))
        stamp = round(readings.time * 1e6)
        try:
            self._peer.sendall(b"".join(one.pack(self._mavlink) for one in self._news(readings)))
            return self._answer(stamp)
        except (ConnectionError, self._dialect.MAVError) as error:
            raise self._wrong(f"the firmware's link broke: {error}") from None

    def _news(self, readings: Readings) -> list[Any]:
        """The messages of one exchange: inertial ones at each, position and sticks at 10 Hz."""
        stamp, make = round(readings.time * 1e6), self._mavlink
        north, east, down = readings.position
        latitude, longitude, height = self.HOME
        rotation = rotation_of_quaternion(readings.quaternion)
        exact = [*readings.specific_force, *readings.body_rates, *(rotation.T @ self.FIELD)]
        above = height - down
        exact.append(1013.25 * (1.0 - 2.25577e-5 * above) ** 5.25588)  # standard atmosphere, hPa
        *inertial, pressure = exact + self.NOISE * self._random.standard_normal(10)
        news = [make.hil_sensor_encode(stamp, *inertial, pressure, 0.0, above, 15.0, self.FIELDS)]
        if self._sent % max(1, round(0.1 * self._table.rate)) == 0:
            degrees = np.rad2deg(1.0 / self.RADIUS)
            place = (
                latitude + north * degrees,
                longitude + east * degrees / np.cos(np.deg2rad(latitude)),
            )
            cm = [round(100.0 * float(one)) for one in readings.velocity]
            speed = round(100.0 * float(np.hypot(*readings.velocity[:2])))
            course = round(100.0 * float(np.rad2deg(np.arctan2(cm[1], cm[0])) % 360.0))
            lat_lon = (round(1e7 * float(one)) for one in place)
            news.append(
                make.hil_gps_encode(
                    stamp, 3, *lat_lon, round(1e3 * above), 30, 40, speed, *cm, course, 10
                )
            )
            if readings.sticks:
                sticks = [round(one) for one in readings.sticks]
                channels = (sticks + [65535] * 18)[:18]
                news.append(make.rc_channels_encode(stamp // 1000, len(sticks), *channels, 255))
        self._sent += 1
        return news

    def _answer(self, stamp: int) -> Floats:
        patience = self._table.wait if self._answered else self.START
        end = time.monotonic() + patience
        while True:
            self._peer.settimeout(max(1e-3, end - time.monotonic()))
            try:
                content = self._peer.recv(65536)
            except TimeoutError:
                if self._answered:
                    raise self._lost() from None
                return np.zeros(len(self._signed))
            if not content:
                raise ConnectionError("closed")
            for message in self._mavlink.parse_buffer(content) or ():
                if message.get_type() != "HIL_ACTUATOR_CONTROLS" or message.time_usec < stamp:
                    continue
                if message.time_usec > stamp:
                    raise self._wrong(f"outputs of {message.time_usec} us, after {stamp} us,")
                self._answered = True
                shares = np.nan_to_num(np.array(message.controls, dtype=float))
                return np.clip(self._used(shares), np.where(self._signed, -1.0, 0.0), 1.0)


LINKS: Final[dict[str, Callable[..., Link]]] = {"ardupilot": ArduPilotLink, "px4": Px4Link}
