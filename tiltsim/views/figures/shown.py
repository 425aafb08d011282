"""Figures that a notebook shows."""

from __future__ import annotations

from io import BytesIO

from matplotlib.backend_bases import RendererBase
from matplotlib.figure import Figure

from tiltsim.views.figures.glyphs import missing_glyphs_as_boxes


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
