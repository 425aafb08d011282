"""Work on several processes: all answers, and nothing left over however it ends."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from multiprocessing import resource_tracker, util

import pytest

from tiltsim.errors import InputError
from tiltsim.system.interrupts import terminations_as_interrupts
from tiltsim.system.processes import ProcessDiedError, in_order, in_processes

MEGABYTES = 1 << 24


def work_on(item):
    if item == "dies":
        os.kill(os.getpid(), signal.SIGKILL)
    if item == "raises":
        raise InputError("no such luck")
    return item.upper()


def much_of(item):
    return bytes(MEGABYTES)


def test_each_item_is_answered_regardless_of_the_others():
    items = ["a", "dies", "b", "raises", "c", "d"]
    found = dict(in_processes(work_on, items, 2))
    assert sorted(found) == sorted(items)
    assert {found[item].result() for item in "abcd"} == set("ABCD")
    with pytest.raises(ProcessDiedError, match="exit code -9"):
        found["dies"].result()
    with pytest.raises(InputError, match="no such luck"):
        found["raises"].result()
    assert not multiprocessing.active_children()


def test_results_come_in_order_as_soon_as_they_can():
    found = iter([(1, "b"), (0, "a"), (3, "d"), (2, "c")])
    results = in_order(found)
    assert [next(results), next(results)] == ["a", "b"]
    assert next(found) == (3, "d")
    assert list(results) == ["c"]


def interrupts_blocked(_item):
    return signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ())


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_processes_receive_no_interrupt_while_they_start():
    """They would print a traceback: the keyboard's go to all processes of a terminal's job."""
    found = dict(in_processes(interrupts_blocked, "ab", 2))
    assert [found[item].result() for item in "ab"] == [True, True]
    assert not interrupts_blocked(None)


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_process_gets_its_work_although_a_signal_comes_meanwhile(number, monkeypatch, capfd):
    """Else it reads nothing where it expects its work, and prints a traceback."""
    resource_tracker.ensure_running()  # is also a process
    start = util.spawnv_passfds

    def start_then_signal(*arguments):
        started = start(*arguments)
        os.kill(os.getpid(), number)
        return started

    monkeypatch.setattr(util, "spawnv_passfds", start_then_signal)
    with pytest.raises(KeyboardInterrupt), terminations_as_interrupts():
        list(in_processes(work_on, "ab", 2))
    assert not multiprocessing.active_children()
    assert capfd.readouterr().err == ""


def test_leaving_the_loop_ends_processes_that_are_answering():
    """More than a pipe holds: the other process is halfway through its answer."""
    for _item, future in in_processes(much_of, range(6), 2):
        assert len(future.result()) == MEGABYTES
        break
    assert not multiprocessing.active_children()


def work_for_long(_item):
    os.write(sys.stdout.fileno(), b"working\n")
    time.sleep(60.0)


IN_A_PROCESS = """
from tests.system.test_processes import in_processes, work_for_long
next(in_processes(work_for_long, [0], 1))
"""


def test_a_process_ends_with_its_parent_in_the_middle_of_its_work():
    """As long as it lives, it holds the output that it has from its parent."""
    command = [sys.executable, "-c", IN_A_PROCESS]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as parent:
        assert parent.stdout.readline() == b"working\n"
        parent.kill()
        assert parent.communicate(timeout=40.0) == (b"", None)
