"""Scalar products with the inertia matrix, for laws that are not written for arrays yet."""

from __future__ import annotations

from tiltsim_controllers.mathematics.scalar import Triple, scalar
from tiltsim_controllers.vehicle.body import Body


@scalar
def inertia_times(body: Body, vector: Triple) -> Triple:
    """The inertia matrix times a vector."""
    x, y, z = vector
    return (
        body.inertia_xx * x + body.inertia_xy * y + body.inertia_xz * z,
        body.inertia_xy * x + body.inertia_yy * y + body.inertia_yz * z,
        body.inertia_xz * x + body.inertia_yz * y + body.inertia_zz * z,
    )
