"""Formats of other tools: MCAP of Foxglove and ROS 2, ULog of PX4, and CSV.

In MCAP a flight is the channel ``/tiltsim/sample`` with all columns as doubles in CDR, beside
channels of Foxglove's schemas for its 3D view: the moving frame ``vehicle``, its rotors, and the
reference. In ULog it is the topic ``tiltsim_sample`` with all columns as doubles, beside PX4's
topics of position, velocity, attitude and body rates in PX4's frames (world NED, body FRD).
"""

import json
from collections.abc import Iterator
from os import PathLike
from pathlib import Path
from struct import pack
from typing import Any, Final

import numpy as np

from tiltsim.errors import InputError
from tiltsim.flight.flight import Flight
from tiltsim.logs.log import Log
from tiltsim.system.files import prepare_file, replacing
from tiltsim.system.public import optional_package
from tiltsim.system.text import short_repr
from tiltsim_controllers.mathematics.attitude import FLIP
from tiltsim_controllers.mathematics.scalar import Floats

Signals = dict[str, tuple[Floats, Floats]]
"""Times (s) and values, shape (N,) each, by name: ``topic.field``, or the column of a CSV file."""

FORMATS: Final = {"mcap": ".mcap", "ulog": ".ulg", "csv": ".csv"}
"""Formats and the suffix of their files."""

MCAP_SAMPLE: Final = "/tiltsim/sample"
ULOG_SAMPLE: Final = "tiltsim_sample"
MCAP_ORIGIN: Final = "tiltsim"  # the metadata record with the origin of a flight
MCAP_UNITS: Final = "tiltsim units"
CDR_HEADER: Final = b"\x00\x01\x00\x00"  # little endian
NANO: Final = 1_000_000_000
ULOG_ORIGIN: Final = "tiltsim_"
"""Begins the names of information messages that hold the origin of a flight and its units."""

LONGEST: Final = 60_000  # bytes of one information message, whose length has 16 bits


def export(
    flight: Flight,
    path: str | PathLike[str],
    format: str | None = None,  # noqa: A002
) -> None:
    """Write all columns of a flight, every bit of them, into a file of another format.

    Args:
        flight: The flight.
        path: The file.
        format: mcap, ulog or csv; None takes the one of the file's suffix.

    Raises:
        InputError: If the format is unknown, its package is missing or the file cannot be written.
    """
    if not isinstance(flight, Flight):
        raise InputError(f"flight = {short_repr(flight)}: must be a tiltsim.Flight")
    if not isinstance(path, str | PathLike):
        raise InputError(f"path = {short_repr(path)}: must be the name of a file")
    file, by_suffix = Path(path), {suffix: name for name, suffix in FORMATS.items()}
    chosen = by_suffix.get(file.suffix.lower()) if format is None else format
    if chosen not in FORMATS:
        given = f"format = {short_repr(format)}" if format is not None else f"{file}"
        raise InputError(f"{given}: choose {', '.join(FORMATS)}")
    prepare_file("path", file)
    log = Log.of_flight(flight)
    if chosen != "csv" and flight.scenario.vehicle.is_planar:
        model = flight.scenario.vehicle.model
        raise InputError(f"{file}: the {model} moves in a plane; choose csv")
    with replacing(file) as temporary:
        if chosen == "csv":
            rows = np.stack([log[name] for name in log.units], axis=1).tolist()
            lines = [",".join(log.units), *(",".join(map(repr, row)) for row in rows)]
            temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
        elif chosen == "ulog":
            write_ulog(log, temporary)
        else:
            places = np.array([rotor.place for rotor in flight.scenario.any_rotorcraft.rotors])
            write_mcap(log, temporary, places)


def write_mcap(log: Log, file: Path, rotors: Floats) -> None:
    """Write the log of a rotorcraft's flight as MCAP.

    Args:
        log: The columns.
        file: The file.
        rotors: Places of the rotors at tilts of zero, body axes, m, shape (rotors, 3), drawn in
            the 3D view.

    Raises:
        InputError: If the package mcap is not installed.
    """
    mcap = optional_package("mcap.writer", "writing MCAP", "tiltsim[logs]")
    values = np.stack([log[name] for name in log.units], axis=1).astype("<f8")
    stamps = [round(time * NANO) for time in log["time"].tolist()]
    with file.open("wb") as stream:
        writer = mcap.Writer(stream)
        writer.start(profile="", library="tiltsim")
        writer.add_metadata(MCAP_UNITS, dict(log.units))
        writer.add_metadata(MCAP_ORIGIN, dict(log.origin))
        definition = "\n".join(f"float64 {name}" for name in log.units).encode()
        schema = writer.register_schema("tiltsim/msg/Sample", "ros2msg", definition)
        sample = writer.register_channel(MCAP_SAMPLE, "cdr", schema)
        channels: dict[str, int] = {}
        messages = _foxglove_messages(log, stamps, rotors)
        for stamp, row, drawn in zip(stamps, values, messages, strict=True):
            writer.add_message(sample, stamp, CDR_HEADER + row.tobytes(), stamp)
            for topic, (name, message) in drawn.items():
                if topic not in channels:
                    text = json.dumps({"title": name, **_schema(message)})
                    schema = writer.register_schema(name, "jsonschema", text.encode())
                    channels[topic] = writer.register_channel(topic, "json", schema)
                writer.add_message(channels[topic], stamp, json.dumps(message).encode(), stamp)
        writer.finish()


def _foxglove_messages(
    log: Log, stamps: list[int], rotors: Floats
) -> Iterator[dict[str, tuple[str, dict[str, Any]]]]:
    """For every sample, the name of Foxglove's schema and a message for each topic."""
    poses = log["position"], log.quaternions()
    references = log["reference_position"], log.quaternions("reference_attitude")
    vectors = [vector.tolist() for vector in (*poses, *references)]
    size = 0.6 * float(np.linalg.norm(rotors, axis=1).max(initial=0.1))
    disks = [  # flat, red ahead
        {
            "pose": {"position": _named("xyz", place), "orientation": _named("xyzw", [0, 0, 0, 1])},
            "size": _named("xyz", [size, size, 0.1 * size]),
            "color": _named("rgba", [0.8 if place[0] > 0.0 else 0.2, 0.2, 0.3, 0.8]),
        }
        for place in rotors.tolist()
    ]
    for number, (stamp, place, turn, target, direction) in enumerate(zip(stamps, *vectors)):
        time = {"sec": stamp // NANO, "nsec": stamp % NANO}
        frames = {"timestamp": time, "parent_frame_id": "world", "child_frame_id": "vehicle"}
        moved = {"translation": _named("xyz", place), "rotation": _named("wxyz", turn)}
        pose = {"position": _named("xyz", target), "orientation": _named("wxyz", direction)}
        reference = {"timestamp": time, "frame_id": "world", "pose": pose}
        drawn: dict[str, tuple[str, dict[str, Any]]] = {
            "/tf": ("foxglove.FrameTransform", frames | moved),
            "/reference": ("foxglove.PoseInFrame", reference),
        }
        if number == 0:  # it stays in the vehicle's frame
            entity: dict[str, Any] = {"timestamp": time, "frame_id": "vehicle", "id": "rotors"}
            entity |= {"lifetime": {"sec": 0, "nsec": 0}, "frame_locked": True, "spheres": disks}
            drawn["/vehicle"] = ("foxglove.SceneUpdate", {"entities": [entity]})
        yield drawn


def _named(names: str, values: list[float]) -> dict[str, float]:
    return dict(zip(names, map(float, values), strict=True))


def _schema(message: Any) -> dict[str, Any]:
    """The JSON schema of messages like this one."""
    if isinstance(message, dict):
        return {"type": "object", "properties": {k: _schema(one) for k, one in message.items()}}
    if isinstance(message, list):
        return {"type": "array", "items": _schema(message[0])}
    names = {bool: "boolean", int: "integer", float: "number", str: "string"}
    return {"type": names[type(message)]}


def read_mcap(file: Path) -> tuple[Signals, dict[str, str]]:
    """All numbers of the JSON and ROS 2 channels of a file, and the metadata of tiltsim.

    Raises `InputError` if mcap is missing or cannot read the file.
    """
    purpose = f"{file}: reading MCAP"
    reader = optional_package("mcap.reader", purpose, "tiltsim[logs]")
    decoder = optional_package("mcap_ros2.decoder", purpose, "tiltsim[logs]").DecoderFactory()
    rows: dict[str, list[dict[str, float]]] = {}
    times: dict[str, list[float]] = {}
    samples: list[bytes] = []
    names: list[str] = []
    decoders: dict[int, Any] = {}
    try:
        with file.open("rb") as stream:
            opened = reader.make_reader(stream)
            metadata = {
                f"unit_{key}" if one.name == MCAP_UNITS else key: text
                for one in opened.iter_metadata()
                if one.name in {MCAP_UNITS, MCAP_ORIGIN}
                for key, text in one.metadata.items()
            }
            for schema, channel, message in opened.iter_messages(log_time_order=True):
                if channel.topic == MCAP_SAMPLE:
                    samples.append(message.data[len(CDR_HEADER) :])
                    names = names or [line.split()[1] for line in schema.data.decode().splitlines()]
                    continue
                if channel.id not in decoders:
                    decoders[channel.id] = (
                        json.loads
                        if channel.message_encoding == "json"
                        else decoder.decoder_for(channel.message_encoding, schema)
                    )
                if (decode := decoders[channel.id]) is not None:
                    rows.setdefault(channel.topic, []).append(dict(_leaves(decode(message.data))))
                    times.setdefault(channel.topic, []).append(message.log_time / NANO)
    except InputError:
        raise
    except Exception as error:  # of a damaged file, any
        raise _unreadable(file, "MCAP", error) from error
    signals: Signals = {}
    if samples:
        table = np.frombuffer(b"".join(samples), "<f8").reshape(len(samples), -1)
        for name, column in zip(names, table.T, strict=True):
            signals[f"{MCAP_SAMPLE}.{name}"] = (table[:, names.index("time")], column)
    for topic, messages in rows.items():
        time = np.array(times[topic])
        for name in {key: None for message in messages for key in message}:
            column = np.array([message.get(name, np.nan) for message in messages])
            signals[f"{topic}.{name}"] = (time, column)
    return signals, metadata


def _unreadable(file: Path, kind: str, error: Exception) -> InputError:
    return InputError(f"{file}: not a readable {kind} file: {error or type(error).__name__}")


def _leaves(value: Any, name: str = "") -> Iterator[tuple[str, float]]:
    """The numbers of a decoded message by their path, as in ``pose.position.x`` and ``q[0]``."""
    if isinstance(value, bool | int | float):
        yield name, float(value)
    elif isinstance(value, dict):
        for key, one in value.items():
            yield from _leaves(one, f"{name}.{key}" if name else key)
    elif isinstance(value, list | tuple) and len(value) <= 64:
        for number, one in enumerate(value):
            yield from _leaves(one, f"{name}[{number}]")
    elif hasattr(value, "__slots__"):
        yield from _leaves({key: getattr(value, key) for key in value.__slots__}, name)


def write_ulog(log: Log, file: Path) -> None:
    """Write the log of a rotorcraft's flight as ULog.

    Times are in whole microseconds, and exact in the column ``time``.
    """
    stamps = np.round(log["time"] * 1e6).astype(np.uint64)
    position, velocity = log["position"] * FLIP, log["velocity"] * FLIP
    places = ["x", "y", "z", "vx", "vy", "vz"]
    turns = log.quaternions() * np.array([1.0, *FLIP])
    values = np.stack([log[name] for name in log.units], axis=1)
    topics: dict[str, tuple[str, list[str], Floats]] = {
        ULOG_SAMPLE: ("double", [*log.units], values),
        "vehicle_local_position": ("float", places, np.hstack([position, velocity])),
        "vehicle_attitude": ("float", ["q[4]"], turns),
        "vehicle_angular_velocity": ("float", ["xyz[3]"], log["body_rates"] * FLIP),
    }
    content = [b"ULog\x01\x12\x35\x01", pack("<Q", int(stamps[0])), _message("B", bytes(40))]
    texts = {"sys_name": "tiltsim"}
    texts |= {f"{ULOG_ORIGIN}unit_{name}": unit for name, unit in log.units.items()}
    content += [_message("I", _information(key, text)) for key, text in texts.items()]
    for key, text in log.origin.items():  # of any length, divided between characters
        for start in range(0, max(1, len(text)), LONGEST // 4):
            piece = text[start : start + LONGEST // 4]
            part = bytes([start > 0]) + _information(ULOG_ORIGIN + key, piece)
            content.append(_message("M", part))
    for name, (kind, fields, _) in topics.items():
        parts = [one.partition("[") for one in fields]
        declared = [f"{kind}{bracket}{size} {field}" for field, bracket, size in parts]
        content.append(
            _message("F", f"{name}:{';'.join(['uint64_t timestamp', *declared])};".encode())
        )
    for number, name in enumerate(topics):
        content.append(_message("A", pack("<BH", 0, number) + name.encode()))
    head = [("size", "<u2"), ("type", "u1"), ("number", "<u2"), ("stamp", "<u8")]
    for number, (kind, _, values) in enumerate(topics.values()):
        numbers = ("values", "<f8" if kind == "double" else "<f4", (values.shape[1],))
        rows = np.empty(len(log), np.dtype([*head, numbers]))
        rows["size"], rows["type"], rows["number"] = rows.itemsize - 3, ord("D"), number
        rows["stamp"], rows["values"] = stamps, values
        content.append(rows.tobytes())
    file.write_bytes(b"".join(content))


def _message(kind: str, content: bytes) -> bytes:
    return pack("<HB", len(content), ord(kind)) + content


def _information(key: str, text: str) -> bytes:
    value = text.encode()
    name = f"char[{len(value)}] {key}".encode()
    return bytes([len(name)]) + name + value


def read_ulog(file: Path) -> tuple[Signals, dict[str, str]]:
    """All numbers of a ULog file, and the information that tiltsim wrote.

    Raises `InputError` if pyulog is missing or cannot read the file.
    """
    pyulog = optional_package("pyulog", f"{file}: reading ULog", "tiltsim[logs]")
    try:
        with file.open("rb") as stream:
            content = pyulog.ULog(stream)
    except Exception as error:  # of a damaged file, any
        raise _unreadable(file, "ULog", error) from error
    signals: Signals = {}
    for data in content.data_list:
        topic = data.name if data.multi_id == 0 else f"{data.name}_{data.multi_id}"
        time = data.data["timestamp"] * 1e-6
        for name, values in data.data.items():
            signals[f"{topic}.{name}"] = (time, np.asarray(values, dtype=np.float64))
    information = {key: str(text) for key, text in content.msg_info_dict.items()}
    for key, parts in content.msg_info_multiple_dict.items():
        information[key] = "".join(str(one) for part in parts for one in part)
    begin = len(ULOG_ORIGIN)
    own = {key: text for key, text in information.items() if key.startswith(ULOG_ORIGIN)}
    return signals, {key[begin:]: text for key, text in own.items()}
