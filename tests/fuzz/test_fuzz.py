"""Five hundred random inputs; ``python -m tests.fuzz --count 20000 --seed N`` runs more."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tests.fuzz import running
from tests.fuzz.running import fuzz


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_no_input_leads_to_a_traceback_or_more_than_a_line(seed):
    assert fuzz(125, seed) == []


def test_prints_of_native_code_and_stray_files_are_mistakes(monkeypatch):
    def prints(_random, _folder):
        return lambda: os.write(2, b"WARNING: no such luck\n")

    def writes(_random, _folder):
        return lambda: Path("MUJOCO_LOG.TXT").touch()

    monkeypatch.setattr(running, "KINDS", (prints, writes))
    assert fuzz(2, 0) == [
        "seed 0, input 0 (prints): native code prints 'WARNING: no such luck\\n'",
        "seed 0, input 1 (writes): wrote MUJOCO_LOG.TXT",
    ]
