"""Recordings of complete flights."""

import hashlib
from collections.abc import Sequence
from itertools import cycle
from pathlib import Path
from typing import Final

import rerun as rr
import rerun.blueprint as rrb

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.flight.flight import Flight, vehicle_assemblies, vehicles_named
from tiltsim.flight.metrics import End
from tiltsim.system.files import replacing
from tiltsim.views.rerun import require_rerun
from tiltsim.views.rerun.blueprint import flight_blueprint
from tiltsim.views.rerun.flight_recorder import FlightRecorder
from tiltsim.views.rerun.timeline import FLIGHTS
from tiltsim.views.titles import common_title, flight_names

APPLICATION: Final = "tiltsim"

FLUSH_INTERVAL: Final = 3600.0
"""Time (s) between timed flushes of a saved recording: in effect none."""


class Recording:
    """A recording of one flight or several, without rows at first.

    The constructor prepares everything that does not need the flights, so that it can run during
    the simulation. The identifier depends on its arguments only.

    Args:
        assemblies: One per flight.
        names: Names of several flights, by default `flight_names`.
        vehicle: The one that the flights are of, if others flew with it.
        salt: Distinguishes recordings of equal scenarios, which the viewer would merge.
        batching: When Rerun flushes rows; None for its default.

    Raises:
        InputError: If the environment disables Rerun.
    """

    def __init__(
        self,
        assemblies: Sequence[Assembly],
        names: Sequence[str] = (),
        vehicle: str = "",
        *,
        salt: str = "",
        batching: rr.ChunkBatcherConfig | None = None,
    ) -> None:
        require_rerun()
        scenarios = [assembly.scenario for assembly in assemblies]
        texts = (scenario.model_dump_json() for scenario in scenarios)
        content = "\n".join([*texts, *names, *filter(None, [vehicle]), salt])
        name = f"{APPLICATION}-{hashlib.sha256(content.encode()).hexdigest()[:16]}"
        options = {"send_properties": False, "batcher_config": batching}
        self.stream = rr.RecordingStream(APPLICATION, recording_id=name, **options)
        self.stream.set_log_time_enabled(False)
        names = (names or flight_names(scenarios)) if len(scenarios) > 1 else [""]
        title = ": ".join(filter(None, (common_title(scenarios), " / ".join(names), vehicle)))
        self.stream.send_recording_name(title or scenarios[0].address or "flight")
        several = [*zip(names, assemblies, strict=True)]
        self._together = len(several) == 1 and bool(scenarios[0].companion) and not vehicle
        if self._together:
            several = [*vehicle_assemblies(assemblies[0]).items()]
        self.recorders = []
        for number, (name, assembly) in enumerate(several):
            count = 1 + len(assembly.scenario.companion)
            colors = [FLIGHTS[(number + i * self._together) % len(FLIGHTS)] for i in range(count)]
            about = (self.stream, assembly, name, colors, number == 0)
            self.recorders.append(FlightRecorder(*about, together=self._together))

    def _of_recorders(self, flights: Sequence[Flight]) -> Sequence[Flight]:
        """The flight of each recorder: these, or the vehicles' of a single one."""
        return [*flights[0].vehicles.values()] if self._together and flights else flights

    def blueprint(self, flights: Sequence[Flight] = (), *, live: bool = False) -> rrb.Blueprint:
        """The views of the viewer; see `flight_blueprint`.

        Args:
            flights: One per assembly.
            live: See there.
        """
        return flight_blueprint(self.recorders, self._of_recorders(flights), live=live)

    def draw_references(self, end: float) -> None:
        """Log the references of all flights up to a time (s)."""
        for recorder in self.recorders:
            recorder.draw_references(end)

    def append(self, pieces: Sequence[Flight]) -> None:
        """Log the next piece of every flight."""
        for recorder, piece in zip(self.recorders, self._of_recorders(pieces), strict=True):
            recorder.append(piece)

    def finish(self, ends: Sequence[End]) -> None:
        """Log how the flights ended."""
        for recorder, end in zip(self.recorders, cycle(ends), strict=False):
            recorder.finish(end)

    def write(self, flights: Sequence[Flight]) -> None:
        """Write complete flights, one per assembly."""
        self.draw_references(max(float(flight["time"][-1]) for flight in flights))
        self.append(flights)
        self.finish([flight.end for flight in flights])


class RecordingFile(Recording):
    """A recording of complete flights for a file; equal flights give equal files."""

    def __init__(
        self, assemblies: Sequence[Assembly], names: Sequence[str] = (), vehicle: str = ""
    ) -> None:
        # Flushed by row and byte counts only: timed flushes would make no two files equal.
        batching = rr.ChunkBatcherConfig(flush_tick=FLUSH_INTERVAL)
        super().__init__(assemblies, names, vehicle, batching=batching)
        self._content = self.stream.memory_recording()  # as Rerun does not report a full disk

    def save(self, flights: Sequence[Flight], path: Path) -> None:
        """Write the flights, one per assembly, atomically.

        Raises:
            InputError: If the file cannot be written.
        """
        self.stream.send_blueprint(self.blueprint(flights), make_active=False, make_default=True)
        self.write(flights)
        content = self._content.drain_as_bytes()
        self.stream.disconnect()
        with replacing(path) as temporary:
            temporary.write_bytes(content)


def save_recording(
    flights: Sequence[Flight], path: Path, names: Sequence[str] = (), vehicle: str = ""
) -> None:
    """Write flights into one file; see `RecordingFile`.

    Args:
        flights: One or several.
        path: The file.
        names: Names of several, by default `flight_names`.
        vehicle: The only one that is shown; empty for all.
    """
    flights = vehicles_named(vehicle, flights)
    assemblies = [flight.assembly for flight in flights]
    RecordingFile(assemblies, names, vehicle).save(flights, path)
