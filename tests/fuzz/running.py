"""Run random inputs one after the other and report what is not refused as it should be."""

from __future__ import annotations

import ctypes
import io
import os
import re
import resource
import shutil
import signal
import sys
import warnings
from contextlib import ExitStack, chdir, contextmanager, redirect_stderr, redirect_stdout
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages
from random import Random
from tempfile import TemporaryFile, mkdtemp
from time import perf_counter
from traceback import format_exception

import mujoco

import tiltsim
from tests.fuzz.inputs import KINDS
from tiltsim.errors import TiltsimError
from tiltsim.system.interrupts import terminations_as_interrupts, was_interrupted

TIME_LIMIT = 30
"""Seconds per input."""

MEMORY_LIMIT = 2**30  # bytes beyond the largest that the process had before
"""Bytes of the process."""


ENOUGH = 1.0
"""Seconds after which calls and commands are interrupted, some of which fly for minutes."""


PROGRESS = re.compile(r"tiltsim: (interrupted|[a-z ]+(: .*)?, \d+:\d\d.*)")
"""A line every few seconds of a command that takes long, and the last one of an interrupted one."""


class HangError(Exception):
    """An input that takes longer than `TIME_LIMIT`."""


def fuzz(count, seed, report=lambda done, mistake: None):
    """Run ``count`` inputs of a seed; return the mistakes, a text each.

    Input number n of a seed is always the same, however many are run.
    """
    mistakes = []
    for module in walk_packages(tiltsim.__path__, "tiltsim."):
        import_module(module.name)  # half a module would remain of an import that is interrupted
    import_module("matplotlib.backends.backend_agg")
    with ExitStack() as stack:
        # An interrupt within a tracer of coverage would leave its lock locked for ever.
        sys.settrace(None)
        folder = Path(mkdtemp(prefix="fuzz"))
        stack.callback(shutil.rmtree, folder)
        working = folder / "working"
        working.mkdir()
        stack.enter_context(chdir(working))
        stack.callback(mujoco.set_mju_user_warning, mujoco.get_mju_user_warning())
        stack.callback(signal.signal, signal.SIGALRM, signal.signal(signal.SIGALRM, _hang))
        for number in range(count):
            found = run_one(number, seed, folder), _remove_what_is_in(working)
            mistake = "; ".join(filter(None, found))
            if mistake:
                mistake = f"seed {seed}, input {number} ({_kind(number)}): {mistake}"
                mistakes.append(mistake)
            report(number + 1, mistake)
    return mistakes


def _remove_what_is_in(working):
    """Files written where no option points, such as MuJoCo's MUJOCO_LOG.TXT; or nothing."""
    written = sorted(working.iterdir())
    for path in written:
        shutil.rmtree(path) if path.is_dir() else path.unlink()
    return f"wrote {', '.join(path.name for path in written)}" if written else ""


def _kind(number):
    return KINDS[number % len(KINDS)].__name__


def _hang(_number, _frame):
    raise HangError


def _interrupt(number, _frame):
    signal.signal(number, _hang)
    signal.alarm(TIME_LIMIT)
    signal.raise_signal(signal.SIGTERM)  # an interrupt, also where the keyboard is ignored


def run_one(number, seed, folder):
    """Run one input; the mistake, or an empty text."""
    random = Random(f"{seed}:{number}")
    place = folder / str(number)
    place.mkdir()
    run = KINDS[number % len(KINDS)](random, place)
    out, err, native = io.StringIO(), io.StringIO(), []
    start, before = perf_counter(), _peak_memory()
    try:
        with (
            terminations_as_interrupts(),
            _native_output(native),
            redirect_stdout(out),
            redirect_stderr(err),
            warnings.catch_warnings(),
        ):
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", ResourceWarning)  # of files that an interrupt left open
            for documented in ("flight terminated early", ".*simulation.duration = .* is short"):
                warnings.filterwarnings("ignore", documented, RuntimeWarning)
            is_long = _kind(number) in {"any_command", "python_call"}
            signal.signal(signal.SIGALRM, _interrupt if is_long else _hang)
            signal.setitimer(signal.ITIMER_REAL, ENOUGH if is_long else TIME_LIMIT)
            try:
                run()
            finally:
                signal.setitimer(signal.ITIMER_REAL, 0.0)
    except SystemExit:
        pass
    except KeyboardInterrupt:
        if not is_long:
            raise
    except TiltsimError as error:  # as `tiltsim.cli` prints it
        from tiltsim.cli import _one_line

        print(_one_line(error), file=err)
    except HangError:
        return f"takes longer than {TIME_LIMIT} s"
    except BaseException as error:
        if not (is_long and was_interrupted()):  # compiled code may make it another error
            return "".join(format_exception(error))
    finally:
        shutil.rmtree(place)
    if any(native):
        return f"native code prints {native[0][:500]!r}"
    grown = _peak_memory() - before
    return _wrong_output(out.getvalue(), err.getvalue(), perf_counter() - start, grown)


@contextmanager
def _native_output(found):
    """Append what compiled code, such as MuJoCo's, prints past Python in the block."""
    flush = ctypes.CDLL(None).fflush
    mujoco.set_mju_user_warning(None)  # dm_control's handler would pass warnings to Python's log
    with TemporaryFile() as file:
        sys.stdout.flush()
        sys.stderr.flush()
        saved = [(number, os.dup(number)) for number in (1, 2)]
        try:
            for number, _ in saved:
                os.dup2(file.fileno(), number)
            yield
        finally:
            flush(None)
            for number, copy in saved:
                os.dup2(copy, number)
                os.close(copy)
            file.seek(0)
            found.append(file.read().decode(errors="replace"))


def _peak_memory():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def _wrong_output(out, err, seconds, memory):
    if memory > MEMORY_LIMIT:
        return f"{memory / 2**20:.0f} MiB of memory"
    lines = [line for line in err.splitlines() if not PROGRESS.fullmatch(line)]
    if len(lines) > 1:
        return f"{len(lines)} lines: {err[:2000]!r}"
    raw = {c for c in (out + err) if not (c.isprintable() or c in "\n\u00a0")}
    if raw:
        return f"control characters {raw!r} in {(out + err)[:500]!r}"
    return f"{seconds:.0f} s" if seconds > TIME_LIMIT else ""
