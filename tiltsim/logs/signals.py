"""Signals of a log as its format names them, each with its own times."""

from __future__ import annotations

from tiltsim_controllers.mathematics.scalar import Floats

Signals = dict[str, tuple[Floats, Floats]]
"""Times (s) and values, shape (N,) each, by name: ``topic.field``, or the column of a CSV file."""
