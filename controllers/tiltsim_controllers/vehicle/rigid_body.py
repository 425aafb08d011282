"""Products of vectors as scalar code."""

from __future__ import annotations

from tiltsim_controllers.mathematics.scalar import Triple, scalar


@scalar
def cross(a: Triple, b: Triple) -> Triple:
    """The vector product ``a x b``."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
