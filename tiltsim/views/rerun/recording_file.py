"""Writing complete flights into recordings."""

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import rerun as rr

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.flight.flight import Flight
from tiltsim.system.files import replacing
from tiltsim.views.rerun import require_rerun
from tiltsim.views.rerun.blueprint import flight_blueprint
from tiltsim.views.rerun.flight_recorder import FlightRecorder
from tiltsim.views.rerun.timeline import FLIGHTS
from tiltsim.views.titles import common_title, flight_names

APPLICATION: Final = "tiltsim"

FLUSH_INTERVAL: Final = 3600.0
"""Time (s) between timed flushes of a saved recording: in effect none."""


class RecordingFile:
    """A recording of complete flights.

    The constructor prepares everything that does not need the flights, so that it can run during
    the simulation. ``names`` name several flights, by default by `flight_names`.
    """

    def __init__(self, assemblies: Sequence[Assembly], names: Sequence[str] = ()) -> None:
        # Flushed by row and byte counts only: timed flushes would make no two files equal.
        batching = rr.ChunkBatcherConfig(flush_tick=FLUSH_INTERVAL)
        self._recording, self._recorders = new_recording(assemblies, names, batching=batching)
        # In memory first: Rerun does not report a full disk.
        self._content = self._recording.memory_recording()

    def save(self, flights: Sequence[Flight], path: Path) -> None:
        """Write the flights, one per assembly, atomically; equal flights give equal files.

        Raises:
            InputError: If the file cannot be written.
        """
        blueprint = flight_blueprint(self._recorders, flights)
        self._recording.send_blueprint(blueprint, make_active=False, make_default=True)
        write_flights(self._recorders, flights)
        content = self._content.drain_as_bytes()
        self._recording.disconnect()
        with replacing(path) as temporary:
            temporary.write_bytes(content)


def save_recording(flights: Sequence[Flight], path: Path, names: Sequence[str] = ()) -> None:
    """Write flights into one recording file; see `RecordingFile`."""
    RecordingFile([flight.assembly for flight in flights], names).save(flights, path)


def new_recording(
    assemblies: Sequence[Assembly],
    names: Sequence[str] = (),
    *,
    salt: str = "",
    batching: rr.ChunkBatcherConfig | None = None,
) -> tuple[rr.RecordingStream, list[FlightRecorder]]:
    """A recording without rows, whose identifier depends on the arguments only, and its recorders.

    Args:
        assemblies: One per flight.
        names: Names of several flights, by default `flight_names`.
        salt: Distinguishes recordings of equal scenarios, which the viewer would merge.
        batching: When Rerun flushes rows; None for its default.

    Raises:
        InputError: If the environment disables Rerun.
    """
    require_rerun()
    scenarios = [assembly.scenario for assembly in assemblies]
    content = "\n".join([*(scenario.model_dump_json() for scenario in scenarios), *names, salt])
    digest = hashlib.sha256(content.encode()).hexdigest()[:16]
    recording = rr.RecordingStream(
        APPLICATION,
        recording_id=f"{APPLICATION}-{digest}",
        send_properties=False,
        batcher_config=batching,
    )
    recording.set_log_time_enabled(False)
    title = common_title(scenarios)
    if len(scenarios) == 1:
        recording.send_recording_name(title or scenarios[0].address or "flight")
        return recording, [FlightRecorder(recording, assemblies[0])]
    names = names or flight_names(scenarios)
    compared = " / ".join(names)
    recording.send_recording_name(f"{title}: {compared}" if title else compared)
    recorders = [
        FlightRecorder(
            recording, assembly, name=name, color=FLIGHTS[index % len(FLIGHTS)], first=index == 0
        )
        for index, (assembly, name) in enumerate(zip(assemblies, names, strict=True))
    ]
    return recording, recorders


def write_flights(recorders: Sequence[FlightRecorder], flights: Sequence[Flight]) -> None:
    """Write complete flights."""
    end = max(float(flight["time"][-1]) for flight in flights)
    for recorder, flight in zip(recorders, flights, strict=True):
        recorder.draw_references(end)
        recorder.append(flight)
        recorder.finish(flight.end)
