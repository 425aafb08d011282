"""Letters that the fonts of a figure lack."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def missing_glyphs_as_boxes() -> Iterator[None]:
    """Let matplotlib draw letters without a glyph, such as Chinese ones, without a warning."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"Glyph \d+ .* missing from font")
        yield
