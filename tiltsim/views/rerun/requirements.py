"""Whether Rerun is installed and of a version that works."""

from __future__ import annotations

import os

from tiltsim.errors import InputError


def require_rerun() -> None:
    """Raise `InputError` where the environment switches Rerun off: it would record nothing."""
    value = os.environ.get("RERUN", "")
    if value.strip().lower() in {"0", "false", "off"}:
        raise InputError(f"RERUN={value} in the environment switches Rerun off; unset it")
