"""Settings of all tests."""

from __future__ import annotations

from hypothesis import settings

# A busy machine may take long for an example; nothing that is tested depends on it.
settings.register_profile("tiltsim", deadline=None)
settings.load_profile("tiltsim")
