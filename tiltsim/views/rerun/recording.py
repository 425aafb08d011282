"""Whole flights into recordings, in bulk."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from tiltsim.errors import InputError
from tiltsim.system.files import replacing
from tiltsim.views.rerun import palette
from tiltsim.views.rerun.blueprint import flight_blueprint
from tiltsim.views.rerun.names import APPLICATION
from tiltsim.views.rerun.recorder import FlightRecorder
from tiltsim.views.rerun.requirements import require_rerun
from tiltsim.views.titles import common_title, flight_names

if TYPE_CHECKING:
    import rerun as rr

    from tiltsim.flight.flight import Flight
    from tiltsim.scenario.scenario import Scenario


UNHURRIED: Final = 3600.0
"""Seconds between flushes by the clock of a recording that is saved in one go."""


class RecordingFile:
    """A recording to be saved in one go.

    All that does not need the flights is made here, the imports of Rerun first of all, so that it
    can be done while they are flown.

    Parameters
    ----------
    scenarios
        What the recording will show.
    names
        Those of several flights, by default `flight_names`.
    """

    def __init__(self, scenarios: Sequence[Scenario], names: Sequence[str] = ()) -> None:
        import rerun as rr

        require_rerun()
        # Flushed by rows and bytes alone: a clock would cut the chunks elsewhere in every run.
        unhurried = rr.ChunkBatcherConfig(flush_tick=UNHURRIED)
        self._recording = new_recording(scenarios, names, batching=unhurried)
        self._recorders = make_recorders(self._recording, scenarios, names)
        for recorder in self._recorders:
            recorder.begin()
        blueprint = flight_blueprint([recorder.shown() for recorder in self._recorders])
        # Not into a file: Rerun would take no notice of a full disk.
        self._content = self._recording.memory_recording()
        self._recording.send_blueprint(blueprint, make_active=False, make_default=True)

    def save(self, flights: Sequence[Flight], path: Path) -> None:
        """Write the flights, one a scenario; the file appears whole or not at all.

        Equal flights give equal recordings. Raises `InputError` where the file cannot be written.
        """
        write_flights(self._recorders, flights)
        content = self._content.drain_as_bytes()
        self._recording.disconnect()
        try:
            with replacing(path) as temporary:
                temporary.write_bytes(content)
        except OSError as error:
            raise InputError(f"{path}: cannot be written: {error.strerror or error}") from error


def save_recording(flights: Sequence[Flight], path: Path, names: Sequence[str] = ()) -> None:
    """Write flights into one recording; see `RecordingFile.save`."""
    RecordingFile([flight.scenario for flight in flights], names).save(flights, path)


def new_recording(
    scenarios: Sequence[Scenario],
    names: Sequence[str] = (),
    *,
    salt: str = "",
    batching: rr.ChunkBatcherConfig | None = None,
) -> rr.RecordingStream:
    """An empty recording that is the same for the same scenarios and names, whenever it is made.

    Recordings of equal name are one to the viewer; ``salt`` tells them apart.
    """
    import rerun as rr

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
    if len(scenarios) > 1:
        compared = " / ".join(names or flight_names(scenarios))
        title = f"{title}: {compared}" if title else compared
    title = title or scenarios[0].address or "flight"
    recording.send_recording_name(title)
    return recording


def make_recorders(
    recording: rr.RecordingStream, scenarios: Sequence[Scenario], names: Sequence[str] = ()
) -> list[FlightRecorder]:
    """A recorder for each flight; several flights get names and colours of their own."""
    if len(scenarios) == 1:
        return [FlightRecorder(recording, scenarios[0])]
    names = names or flight_names(scenarios)
    return [
        FlightRecorder(
            recording,
            scenario,
            name=name,
            color=palette.FLIGHTS[index % len(palette.FLIGHTS)],
            first=index == 0,
        )
        for index, (scenario, name) in enumerate(zip(scenarios, names, strict=True))
    ]


def write_flights(recorders: Sequence[FlightRecorder], flights: Sequence[Flight]) -> None:
    """Write whole flights with recorders that have begun."""
    until = max(float(flight["time"][-1]) for flight in flights)
    for recorder, flight in zip(recorders, flights, strict=True):
        recorder.draw_references(until)
        recorder.append(flight)
        recorder.finish(flight.end)
