"""A picture of the Rerun viewer without a screen.

The viewer draws with Vulkan; on a machine without a graphics card Mesa's software driver will do:
``apt-get install mesa-vulkan-drivers``. As a script::

    python tests/viewer_shot.py flight.rrd picture.png [SECONDS] [WIDTHxHEIGHT]
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

TIMELINE = "sim_time"
DRIVERS = "/usr/share/vulkan/icd.d"
START_UP = 120.0  # s to wait for the viewer, the data, a still picture
GREETING = 4.5  # s during which the viewer shows a message over the views
STEP = 0.2  # s between looks


@dataclass(frozen=True)
class Shot:
    """A picture (PNG), the titles of the views in it, and their reported errors."""

    png: bytes
    views: list[str]
    reports: list[str]


def missing_driver() -> str:
    """Why the viewer cannot draw here; empty where it can."""
    if sys.platform == "linux" and not any(Path(DRIVERS).glob("*.json")):
        return f"no Vulkan driver in {DRIVERS}; Debian's package is mesa-vulkan-drivers"
    return ""


def shoot(recording: Path, seconds: float | None = None, size: str = "1600x1000") -> Shot:
    """The viewer's window with a recording open, stopped at a time (s) or as it opens."""
    with viewer(size) as client:
        client.open(str(recording.absolute()))
        wait_for(lambda: is_loaded(client.get_state()), "the recording to load")
        if seconds is not None:
            client.set_time(TIMELINE, duration=seconds, play_state="paused")
        png = still_picture(client)
        views = client.get_state().views
        reports = [f"{view.name}: {r.severity} {r.summary}" for view in views for r in view.reports]
        return Shot(png, [view.name for view in views], reports)


@contextmanager
def viewer(size: str, port: int | None = None) -> Iterator[Any]:
    """A viewer without a window, as a client that controls it; ended with the block."""
    port = port or free_port()
    with viewer_process(port, size) as process:
        yield client_of(process, port)


def client_of(process: subprocess.Popen[bytes], port: int) -> Any:
    """A client of a viewer's process, once it listens."""
    from rerun.experimental import ViewerClient

    def connect() -> Any:
        if process.poll() is not None:
            raise RuntimeError(process.stderr.read().decode()[-2000:])
        try:
            client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
            client.get_state()
        except Exception:  # any error until the viewer listens
            return None
        return client

    return wait_for(connect, "the viewer to start")


@contextmanager
def viewer_process(port: int, size: str = "800x600") -> Iterator[subprocess.Popen[bytes]]:
    """The process of a viewer without a window that listens on a port."""
    import rerun_cli

    # The program itself: the script of that name is a Python wrapper that would outlive its end.
    program = str(Path(rerun_cli.__file__).with_name("rerun"))
    options = ["--headless", "--bind", "127.0.0.1", "--port", str(port), "--window-size", size]
    environment = {
        "XDG_RUNTIME_DIR": "/tmp",
        **os.environ,
        "RERUN_APP_ONLY": "true",
        "RUST_LOG": "error",
    }
    process = subprocess.Popen(
        [program, *options, "--hide-welcome-screen"],
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    )
    try:
        yield process
    finally:
        process.kill()  # a frozen process ignores other signals
        process.wait(10)
        process.stderr.close()


def free_port() -> int:
    """A free port."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        port: int = listener.getsockname()[1]
        return port


def is_loaded(state: Any) -> bool:
    """Whether the viewer has all of a recording."""
    return bool(state.recordings and state.recordings[0].timelines and not state.loading)


def still_picture(client: Any) -> bytes:
    """The window once two pictures in a row are the same: data and animations have settled."""
    began = time.monotonic()
    pictures = [b"", client.take_screenshot()]

    def settled() -> bool:
        pictures[:] = [pictures[1], client.take_screenshot()]
        return pictures[0] == pictures[1] and time.monotonic() - began > GREETING

    wait_for(settled, "the picture to settle")
    return pictures[1]


def wait_for(condition: Callable[[], Any], what: str) -> Any:
    """The first true value of a condition. Raises `TimeoutError` after `START_UP`."""
    deadline = time.monotonic() + START_UP
    while time.monotonic() < deadline:
        value = condition()
        if value:
            return value
        time.sleep(STEP)
    raise TimeoutError(f"waited {START_UP:g} s for {what}")


def main() -> None:
    """Take one picture."""
    recording, picture, *rest = sys.argv[1:]
    seconds = float(rest[0]) if rest else None
    shot = shoot(Path(recording), seconds, *rest[1:])
    Path(picture).write_bytes(shot.png)
    print(f"views: {', '.join(shot.views)}\nreports: {shot.reports or 'none'}")  # noqa: T201


if __name__ == "__main__":
    main()
