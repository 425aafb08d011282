"""Figures of multirotors."""

from __future__ import annotations

from itertools import product

import numpy as np

from tiltsim.views.figures.vehicles import _faces


def test_a_box_has_six_faces_with_their_corners_in_order() -> None:
    """Qhull's triangles are joined: no diagonals, and no edge that crosses a face."""
    size = np.array([1.0, 20.0, 0.3])
    faces = _faces(size * np.array(list(product((0.0, 1.0), repeat=3))))
    assert [len(face) for face in faces] == [4] * 6
    for face in faces:
        edges = (face - np.roll(face, 1, axis=0)) / size
        np.testing.assert_allclose(np.abs(edges).sum(axis=1), 1.0)
