"""Writing the recording of a flight in a separate process, while it is simulated."""

import gc
from pathlib import Path
from typing import Self

from tiltsim.flight.flight import Flight
from tiltsim.laws.assembling import assemble
from tiltsim.scenario.scenario import Scenario
from tiltsim.system.processes import ProcessDiedError, answer, begin, give
from tiltsim.views.rerun import require_rerun


class RecordingProcess:
    """Prepares a recording during the simulation and writes it while other files are written.

    Importing Rerun and logging a vehicle take most of a second, which in a separate process does
    not slow the simulation down. Use it as a context manager: call `start` after the flight and
    `finish` after all other work.

    Raises:
        InputError: If the environment switches Rerun off.
    """

    def __init__(self, scenario: Scenario) -> None:
        require_rerun()
        self._process, self._connection = begin(_Writer())
        self._work: tuple[Flight, Path] | None = None
        give(self._connection, scenario)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        if self._work is None:
            self._process.kill()
        else:  # its answer is not needed, but the file is
            self._answers()
        self._connection.close()
        self._process.join()

    def start(self, flight: Flight, path: Path) -> None:
        """Start writing the flight to a file."""
        flight.columns  # noqa: B018  computed here, where the code is already compiled
        self._work = give(self._connection, (flight, path))

    def finish(self) -> None:
        """Wait until the file of `start` is written.

        Raises:
            InputError: If the file cannot be written.
        """
        assert self._work is not None
        (flight, path), errors = self._work, self._answers()
        self._work = None
        for error in errors:
            if not isinstance(error, ProcessDiedError):
                raise error
        if errors:  # the process was killed
            from tiltsim.views.rerun.recording import save_recording

            save_recording([flight], path)

    def _answers(self) -> list[BaseException]:
        """The errors of preparing and writing in the process."""
        found = [answer(self._connection, self._process).exception() for _ in range(2)]
        return [error for error in found if error is not None]


class _Writer:
    """The work of the process: it is called with the scenario, then with flight and path."""

    def __call__(self, item: Scenario | tuple[Flight, Path]) -> None:
        gc.disable()  # the process is too short-lived for garbage collection to pay off
        from tiltsim.views.rerun.recording import RecordingFile

        if isinstance(item, Scenario):
            self._file = RecordingFile([assemble(item, recorded=True)])
        else:
            self._file.save([item[0]], item[1])
