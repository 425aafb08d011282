"""Writing a recording in a separate process.

Importing Rerun and logging a vehicle take most of a second of Python. In a separate process this
does not slow the simulation down if a second core is free.
"""

import gc
import os
import pickle
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Final, Self

from tiltsim.errors import InputError
from tiltsim.flight.flight import Flight
from tiltsim.scenario.scenario import Scenario
from tiltsim.views.rerun import require_rerun

_PROGRAM: Final = "from tiltsim.views.rerun.process import serve; serve()"


class RecordingProcess:
    """Prepares a recording during the simulation and writes it while other files are written.

    Use it as a context manager: call `start` after the flight and `finish` after all other work.
    The process receives no keyboard interrupt and ends with its parent.

    Raises:
        InputError: If the environment switches Rerun off.
    """

    def __init__(self, scenario: Scenario) -> None:
        require_rerun()
        # This process' module search path, without the current folder in front.
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", _PROGRAM],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
            start_new_session=True,
        )
        self._work: tuple[Flight, Path] | None = None
        self._send(scenario)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        if self._work is None:
            self._process.kill()
        with suppress(OSError):  # the process may have ended already
            self._process.stdin.close()  # type: ignore[union-attr]
        self._process.wait()
        self._process.stdout.close()  # type: ignore[union-attr]  # only after its answer

    def start(self, flight: Flight, path: Path) -> None:
        """Start writing the flight to a file."""
        flight.columns  # noqa: B018  computed here, where the code is already compiled
        self._work = flight, path
        self._send(self._work)

    def finish(self) -> None:
        """Wait until the file of `start` is written.

        Raises:
            InputError: If the file cannot be written.
        """
        assert self._work is not None
        try:
            error = pickle.load(self._process.stdout)  # type: ignore[arg-type]
        except EOFError:  # the process was killed
            from tiltsim.views.rerun.recording_file import save_recording

            flight, path = self._work
            save_recording([flight], path)
            error = None
        self._work = None
        if error is not None:
            raise error

    def _send(self, message: Scenario | tuple[Flight, Path]) -> None:
        with suppress(OSError):  # `finish` detects that the process has ended
            pickle.dump(message, self._process.stdin)  # type: ignore[arg-type]
            self._process.stdin.flush()  # type: ignore[union-attr]


def serve() -> None:
    """Run the process: read a scenario, then flight and path, and answer with an error or None."""
    gc.disable()  # the process is too short-lived for garbage collection to pay off
    # The pipe breaks if the parent process has ended; its answer is then not needed.
    with suppress(BrokenPipeError), os.fdopen(os.dup(1), "wb") as answer:
        os.dup2(2, 1)  # keep library output out of the answer
        from tiltsim.laws.assembling import assemble
        from tiltsim.views.rerun.recording_file import RecordingFile

        try:
            file = RecordingFile([assemble(pickle.load(sys.stdin.buffer), recorded=True)])
            flight, path = pickle.load(sys.stdin.buffer)
        except (EOFError, pickle.UnpicklingError):  # the latter for an incomplete message
            os._exit(0)
        error = None
        try:
            file.save([flight], path)
        except InputError as caught:
            error = caught
        pickle.dump(error, answer)
