"""Arguments of the Python API: a scenario and a controller that fit, and values that never do."""

from __future__ import annotations

import tiltsim

ADDRESS = "ch04_tracking/setpoint#rho_065_modified"


def hover(_observation):
    """A controller of thrusts, N."""
    return tiltsim.Command(thrusts=[1.05] * 4)


class Speechless:
    """Has no text."""

    def __repr__(self):
        raise RuntimeError("no repr")


class Unreadable:
    """Is no array, for a reason of several lines."""

    def __array__(self, *_args, **_options):
        raise ValueError("two\nlines")
