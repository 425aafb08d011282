"""ULog, the format of PX4's logs: written here, read by pyulog.

A flight becomes the topic ``tiltsim_sample`` with all columns as doubles, and PX4's topics of
position, velocity, attitude and body rates, in PX4's frames (world NED, body FRD) and precision.
"""

from __future__ import annotations

from pathlib import Path
from struct import pack
from typing import Final

import numpy as np

from tiltsim.errors import InputError
from tiltsim.logs.log import Log
from tiltsim.logs.signals import Signals
from tiltsim.system.public import optional_package
from tiltsim_controllers.mathematics.attitude import FLIP

SAMPLE: Final = "tiltsim_sample"
ORIGIN: Final = "tiltsim_"
"""Begins the names of information messages that hold the origin of a flight and its units."""

LONGEST: Final = 60_000  # bytes of one information message, whose length has 16 bits


def write_ulog(log: Log, file: Path) -> None:
    """Write a log as ULog; times in whole microseconds, and exactly in the column ``time``."""
    stamps = np.round(log["time"] * 1e6).astype(np.uint64)
    names = list(log.units)
    topics = {SAMPLE: ("double", names, np.stack([log[name] for name in names], axis=1))}
    position, velocity = log["position"] * FLIP, log["velocity"] * FLIP
    topics["vehicle_local_position"] = (
        "float",
        ["x", "y", "z", "vx", "vy", "vz"],
        np.hstack([position, velocity]),
    )
    if "yaw" in log:
        turns = log.quaternions() * np.array([1.0, *FLIP])
        topics["vehicle_attitude"] = ("float", ["q[4]"], turns)
        topics["vehicle_angular_velocity"] = ("float", ["xyz[3]"], log["body_rates"] * FLIP)
    content = [b"ULog\x01\x12\x35\x01", pack("<Q", int(stamps[0])), _message("B", bytes(40))]
    content += [_information("sys_name", "tiltsim")]
    content += [_information(f"{ORIGIN}unit_{name}", unit) for name, unit in log.units.items()]
    content += [
        part for key, text in log.origin.items() for part in _long_information(ORIGIN + key, text)
    ]
    for name, (kind, fields, _) in topics.items():
        texts = ["uint64_t timestamp"]
        for one in fields:
            field, _, size = one.partition("[")
            texts.append(f"{kind}[{size} {field}" if size else f"{kind} {field}")
        content.append(_message("F", f"{name}:{';'.join(texts)};".encode()))
    content += [
        _message("A", pack("<BH", 0, number) + name.encode()) for number, name in enumerate(topics)
    ]
    for number, (kind, _, values) in enumerate(topics.values()):
        width = values.shape[1]
        row = np.dtype(
            [
                ("size", "<u2"),
                ("type", "u1"),
                ("number", "<u2"),
                ("stamp", "<u8"),
                ("values", "<f8" if kind == "double" else "<f4", (width,)),
            ]
        )
        rows = np.empty(len(log), row)
        rows["size"], rows["type"], rows["number"] = row.itemsize - 3, ord("D"), number
        rows["stamp"], rows["values"] = stamps, values
        content.append(rows.tobytes())
    file.write_bytes(b"".join(content))


def read_ulog(file: Path) -> tuple[Signals, dict[str, str]]:
    """All numbers of a ULog file, and the information that tiltsim wrote.

    Raises `InputError` if pyulog is missing or cannot read the file.
    """
    pyulog = optional_package("pyulog", f"{file}: reading ULog", "tiltsim[logs]")
    try:
        with file.open("rb") as stream:
            content = pyulog.ULog(stream)
    except Exception as error:  # of a damaged file, any
        raise InputError(
            f"{file}: not a readable ULog file: {error or type(error).__name__}"
        ) from error
    signals: Signals = {}
    for data in content.data_list:
        topic = data.name if data.multi_id == 0 else f"{data.name}_{data.multi_id}"
        time = data.data["timestamp"] * 1e-6
        for name, values in data.data.items():
            signals[f"{topic}.{name}"] = (time, np.asarray(values, dtype=np.float64))
    information = {key: str(text) for key, text in content.msg_info_dict.items()}
    for key, parts in content.msg_info_multiple_dict.items():
        information[key] = "".join(str(one) for part in parts for one in part)
    return signals, {
        key.removeprefix(ORIGIN): text
        for key, text in information.items()
        if key.startswith(ORIGIN)
    }


def _message(kind: str, content: bytes) -> bytes:
    return pack("<HB", len(content), ord(kind)) + content


def _information(key: str, text: str) -> bytes:
    """An information message of a text that fits in one."""
    value = text.encode()
    name = f"char[{len(value)}] {key}".encode()
    return _message("I", bytes([len(name)]) + name + value)


def _long_information(key: str, text: str) -> list[bytes]:
    """A text of any length in messages of limited size, divided between characters."""
    pieces = [
        text[start : start + LONGEST // 4] for start in range(0, max(1, len(text)), LONGEST // 4)
    ]
    messages = []
    for number, piece in enumerate(pieces):
        value = piece.encode()
        name = f"char[{len(value)}] {key}".encode()
        continued = bytes([number > 0, len(name)])
        messages.append(_message("M", continued + name + value))
    return messages
