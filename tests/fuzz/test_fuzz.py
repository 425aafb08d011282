"""Random inputs, most of them slow; ``python -m tests.fuzz --count 20000 --seed N`` runs more."""

from __future__ import annotations

import time
from contextlib import suppress

import mujoco
import pytest

from tests.fuzz import running
from tests.fuzz.running import fuzz

FALLING = "<mujoco><worldbody><body><freejoint/><geom size='1'/></body></worldbody></mujoco>"


@pytest.mark.parametrize("seed", [1, *(pytest.param(n, marks=pytest.mark.slow) for n in (2, 3, 4))])
def test_no_input_leads_to_a_traceback_or_more_than_a_line(seed):
    assert fuzz(125, seed) == []


def test_prints_of_native_code_and_stray_files_are_mistakes(monkeypatch):
    def warns(_random, _folder):
        model = mujoco.MjModel.from_xml_string(FALLING)
        data = mujoco.MjData(model)
        data.qvel[:] = 1e30
        return lambda: mujoco.mj_step(model, data)

    def is_quiet(_random, _folder):
        return lambda: None

    monkeypatch.setattr(running, "KINDS", (warns, is_quiet))
    (mistake,) = fuzz(2, 0)
    assert "input 0 (warns): native code prints 'WARNING: Nan, Inf or huge value" in mistake
    assert mistake.endswith("; wrote MUJOCO_LOG.TXT")


def test_an_error_that_compiled_code_makes_of_an_interrupt_is_no_mistake(monkeypatch):
    """As NumPy's comparison of structured arrays does."""

    def fails():
        raise TypeError("Cannot compare structured arrays")

    def fails_when_interrupted():
        with suppress(KeyboardInterrupt):
            time.sleep(20.0)
        fails()

    def any_command(_random, folder):
        return fails_when_interrupted if folder.name == "0" else fails

    monkeypatch.setattr(running, "KINDS", (any_command,))
    monkeypatch.setattr(running, "ENOUGH", 0.05)
    (mistake,) = fuzz(2, 0)
    assert "input 1 (any_command)" in mistake
    assert mistake.endswith("TypeError: Cannot compare structured arrays\n")
