"""Figures that a notebook shows, with letters that their fonts lack."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO

from matplotlib.backend_bases import RendererBase
from matplotlib.figure import Figure


@contextmanager
def missing_glyphs_as_boxes() -> Iterator[None]:
    """Let matplotlib draw letters without a glyph, such as Chinese ones, without a warning."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"Glyph \d+ .* missing from font")
        yield


class ShownFigure(Figure):
    """A figure that is the picture below a notebook's cell that ends with it.

    Without pyplot, which would keep every figure, notebooks know no picture of matplotlib's own.
    """

    def draw(self, renderer: RendererBase) -> None:
        """Draw on a renderer."""
        with missing_glyphs_as_boxes():
            super().draw(renderer)

    def _repr_png_(self) -> bytes:
        picture = BytesIO()
        self.savefig(picture, format="png", dpi=self.dpi)
        return picture.getvalue()
