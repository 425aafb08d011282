"""Strict Rerun for all tests of the views."""

from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def strict(monkeypatch):
    """Let Rerun raise where it would only warn."""
    monkeypatch.setenv("RERUN_STRICT", "1")
