"""Random samples along the drawn axes of a sweep."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np

from tiltsim.sweeps.tables import NormalAxis, SampleTable, UniformAxis
from tiltsim_controllers.mathematics.scalar import Floats


def draw_samples(axes: Sequence[UniformAxis | NormalAxis], sample: SampleTable) -> Floats:
    """Values of drawn axes, shape (samples, axes); the same for the same seed."""
    unit = _unit_points(sample, len(axes))
    columns = []
    for axis, column in zip(axes, unit.T, strict=True):
        if isinstance(axis, UniformAxis):
            columns.append(axis.low + (axis.high - axis.low) * column)
        else:
            from scipy.special import ndtri

            inside = np.clip(column, 2.0**-54, 1.0 - 2.0**-53)
            columns.append(axis.mean + axis.standard_deviation * ndtri(inside))
    return cast(Floats, np.stack(columns, axis=-1))


def _unit_points(sample: SampleTable, dimensions: int) -> Floats:
    """Points in the unit cube, shape (samples, dimensions)."""
    generator = np.random.default_rng(sample.seed)
    if sample.method == "random":
        return generator.random((sample.count, dimensions))
    from scipy.stats import qmc

    if sample.method == "latin_hypercube":
        points = qmc.LatinHypercube(dimensions, seed=generator).random(sample.count)
    else:
        exponent = sample.count.bit_length() - 1
        points = qmc.Sobol(dimensions, seed=generator).random_base2(exponent)
    return np.asarray(points, dtype=np.float64)
