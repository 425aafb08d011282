"""MCAP, the container of Foxglove and ROS 2: written and read by its own library.

A flight becomes the channel ``/tiltsim/sample`` with all columns as doubles in CDR, and channels of
Foxglove's schemas for its 3D view: the moving frame ``vehicle``, its rotors, and the reference.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np

from tiltsim.errors import InputError
from tiltsim.logs.log import Log
from tiltsim.logs.signals import Signals
from tiltsim.system.public import optional_package
from tiltsim_controllers.mathematics.scalar import Floats

SAMPLE: Final = "/tiltsim/sample"
ORIGIN: Final = "tiltsim"  # the metadata record with the origin of a flight
UNITS: Final = "tiltsim units"
CDR_HEADER: Final = b"\x00\x01\x00\x00"  # little endian
NANO: Final = 1_000_000_000


def _numbers(names: str) -> dict[str, Any]:
    return {"type": "object", "properties": {name: {"type": "number"} for name in names}}


_TIME: Final = {
    "type": "object",
    "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}},
}
_TEXT: Final = {"type": "string"}
_POSE: Final = {
    "type": "object",
    "properties": {"position": _numbers("xyz"), "orientation": _numbers("xyzw")},
}
_SPHERE: Final = {
    "type": "object",
    "properties": {"pose": _POSE, "size": _numbers("xyz"), "color": _numbers("rgba")},
}
_ENTITY: Final = {
    "type": "object",
    "properties": {
        "timestamp": _TIME,
        "frame_id": _TEXT,
        "id": _TEXT,
        "lifetime": _TIME,
        "frame_locked": {"type": "boolean"},
        "spheres": {"type": "array", "items": _SPHERE},
    },
}
SCHEMAS: Final = {
    "foxglove.FrameTransform": {
        "timestamp": _TIME,
        "parent_frame_id": _TEXT,
        "child_frame_id": _TEXT,
        "translation": _numbers("xyz"),
        "rotation": _numbers("xyzw"),
    },
    "foxglove.PoseInFrame": {"timestamp": _TIME, "frame_id": _TEXT, "pose": _POSE},
    "foxglove.SceneUpdate": {"entities": {"type": "array", "items": _ENTITY}},
}
"""Properties of Foxglove's schemas, as far as they are written."""


def write_mcap(log: Log, file: Path, rotors: Floats) -> None:
    """Write a log as MCAP.

    Args:
        log: The columns, some of which place a vehicle: x, y, z, roll, pitch, yaw.
        file: The file.
        rotors: Places of the rotors, body axes, m, shape (rotors, 3), drawn in the 3D view.

    Raises:
        InputError: If the package mcap is not installed.
    """
    mcap = optional_package("mcap.writer", "writing MCAP", "tiltsim[logs]")
    names = list(log.units)
    values = np.stack([log[name] for name in names], axis=1).astype("<f8")
    stamps = [round(time * NANO) for time in log["time"].tolist()]
    with file.open("wb") as stream:
        writer = mcap.Writer(stream)
        writer.start(profile="", library="tiltsim")
        writer.add_metadata(UNITS, dict(log.units))
        if log.origin:
            writer.add_metadata(ORIGIN, dict(log.origin))
        definition = "\n".join(f"float64 {name}" for name in names).encode()
        schema = writer.register_schema("tiltsim/msg/Sample", "ros2msg", definition)
        sample = writer.register_channel(SAMPLE, "cdr", schema)
        channels = {}
        for topic, name in (
            ("/tf", "foxglove.FrameTransform"),
            ("/reference", "foxglove.PoseInFrame"),
            ("/vehicle", "foxglove.SceneUpdate"),
        ):
            text = json.dumps({"title": name, "type": "object", "properties": SCHEMAS[name]})
            schema = writer.register_schema(name, "jsonschema", text.encode())
            channels[topic] = writer.register_channel(topic, "json", schema)
        poses = [] if "yaw" not in log else [("/tf", *_poses(log, "position", "attitude"))]
        if "x_ref" in log and poses:
            poses.append(("/reference", *_poses(log, "reference_position", "reference_attitude")))
            drawing = json.dumps({"entities": [_drawing(rotors, stamps[0])]}).encode()
            writer.add_message(channels["/vehicle"], stamps[0], drawing, stamps[0])
        for number, stamp in enumerate(stamps):
            writer.add_message(sample, stamp, CDR_HEADER + values[number].tobytes(), stamp)
            for topic, places, turns in poses:
                content = _pose_message(topic, stamp, places[number], turns[number])
                writer.add_message(channels[topic], stamp, json.dumps(content).encode(), stamp)
        writer.finish()


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
                f"unit_{key}" if one.name == UNITS else key: text
                for one in opened.iter_metadata()
                if one.name in {UNITS, ORIGIN}
                for key, text in one.metadata.items()
            }
            for schema, channel, message in opened.iter_messages(log_time_order=True):
                if channel.topic == SAMPLE:
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
        raise InputError(
            f"{file}: not a readable MCAP file: {error or type(error).__name__}"
        ) from error
    signals: Signals = {}
    if samples:
        table = np.frombuffer(b"".join(samples), "<f8").reshape(len(samples), -1)
        for name, column in zip(names, table.T, strict=True):
            signals[f"{SAMPLE}.{name}"] = (table[:, names.index("time")], column)
    for topic, messages in rows.items():
        time = np.array(times[topic])
        for name in {key: None for message in messages for key in message}:
            column = np.array([message.get(name, np.nan) for message in messages])
            signals[f"{topic}.{name}"] = (time, column)
    return signals, metadata


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


def _poses(log: Log, position: str, attitude: str) -> tuple[list[Any], list[Any]]:
    """Positions (m) and quaternions w x y z, a list per sample."""
    return log[position].tolist(), log.quaternions(attitude).tolist()


def _pose_message(topic: str, stamp: int, place: list[float], turn: list[float]) -> dict[str, Any]:
    position = dict(zip("xyz", place, strict=True))
    rotation = dict(zip("wxyz", turn, strict=True))
    time = {"sec": stamp // NANO, "nsec": stamp % NANO}
    if topic == "/tf":
        frames = {"parent_frame_id": "world", "child_frame_id": "vehicle"}
        return {"timestamp": time, **frames, "translation": position, "rotation": rotation}
    pose = {"position": position, "orientation": rotation}
    return {"timestamp": time, "frame_id": "world", "pose": pose}


def _drawing(rotors: Floats, stamp: int) -> dict[str, Any]:
    """An entity that stays in the vehicle's frame: a flat disk for each rotor, red ahead."""
    size = 0.6 * float(np.linalg.norm(rotors, axis=1).max(initial=0.1))
    disks = [
        {
            "pose": {
                "position": dict(zip("xyz", place, strict=True)),
                "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
            },
            "size": {"x": size, "y": size, "z": 0.1 * size},
            "color": {"r": 0.8 if place[0] > 0.0 else 0.2, "g": 0.2, "b": 0.3, "a": 0.8},
        }
        for place in rotors.tolist()
    ]
    return {
        "timestamp": {"sec": stamp // NANO, "nsec": stamp % NANO},
        "frame_id": "vehicle",
        "id": "rotors",
        "lifetime": {"sec": 0, "nsec": 0},
        "frame_locked": True,
        "spheres": disks,
    }
