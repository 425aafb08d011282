"""A recording that is written by a process of its own.

To load Rerun and to draw a vehicle takes most of a second of Python, of which a process runs one
line at a time. In a process of its own it costs the flight nothing while there is a core.
"""

from __future__ import annotations

import gc
import os
import pickle
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Self

from tiltsim.errors import InputError
from tiltsim.views.rerun.requirements import require_rerun

if TYPE_CHECKING:
    from tiltsim.flight.flight import Flight
    from tiltsim.scenario.scenario import Scenario

_PROGRAM: Final = "from tiltsim.views.rerun.process import serve; serve()"


class RecordingProcess:
    """Makes a recording ready while its flight is flown, and writes it while other files are.

    Use it as a context manager: `start` once the flight is over, `finish` when all else is done.
    No interrupt from the keyboard reaches the process, and it ends with the one that it serves.

    Parameters
    ----------
    scenario
        What is flown.

    Raises
    ------
    InputError
        If the environment switches Rerun off.
    """

    def __init__(self, scenario: Scenario) -> None:
        require_rerun()
        # Modules are looked for where this process found them, not in the current folder first.
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", _PROGRAM],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
            start_new_session=True,
        )
        self._work: tuple[Flight, Path] | None = None
        self._say(scenario)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        if self._work is None:
            self._process.kill()
        with suppress(OSError):  # it may have ended by itself
            self._process.stdin.close()  # type: ignore[union-attr]
        self._process.wait()
        self._process.stdout.close()  # type: ignore[union-attr]  # not before it has answered

    def start(self, flight: Flight, path: Path) -> None:
        """Begin to write the flight."""
        flight.columns  # noqa: B018  derived here, where the code for it is loaded
        self._work = flight, path
        self._say(self._work)

    def finish(self) -> None:
        """Wait for the file that was begun.

        Raises `InputError` where it cannot be written.
        """
        assert self._work is not None
        try:
            error = pickle.load(self._process.stdout)  # type: ignore[arg-type]
        except EOFError:  # something has ended the process
            from tiltsim.views.rerun.recording import save_recording

            flight, path = self._work
            save_recording([flight], path)
            error = None
        self._work = None
        if error is not None:
            raise error

    def _say(self, what: Any) -> None:
        with suppress(OSError):  # `finish` notices that nobody answers
            pickle.dump(what, self._process.stdin)  # type: ignore[arg-type]
            self._process.stdin.flush()  # type: ignore[union-attr]


def serve() -> None:
    """What the process does: a scenario in, its flight and a path in, out what went wrong."""
    gc.disable()  # it does not live long enough to make garbage
    # Nobody wants an answer, or what is ready, where the flight's process has ended.
    with suppress(BrokenPipeError), os.fdopen(os.dup(1), "wb") as answer:
        os.dup2(2, 1)  # what libraries print is no answer
        from tiltsim.views.rerun.recording import RecordingFile

        try:
            file = RecordingFile([pickle.load(sys.stdin.buffer)])
            flight, path = pickle.load(sys.stdin.buffer)
        except (EOFError, pickle.UnpicklingError):  # the latter if it ended while it spoke
            os._exit(0)
        error = None
        try:
            file.save([flight], path)
        except InputError as caught:
            error = caught
        pickle.dump(error, answer)
