"""Small pieces of the page: text, marks, links and the addresses of figures."""

from __future__ import annotations

import re
from base64 import b64encode
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING, Final

from PIL import Image

from tiltsim.report.claim import ClaimVerdict
from tiltsim.report.statement import Origin

if TYPE_CHECKING:
    from tiltsim.report.drawing import Drawing

CLASSES: Final = {
    ClaimVerdict.REPRODUCED: "reproduced",
    ClaimVerdict.QUALITATIVE: "qualitative",
    ClaimVerdict.FITTED: "fitted",
    ClaimVerdict.NOT_REPRODUCED: "not-reproduced",
    ClaimVerdict.WRONG: "wrong",
}
"""Names in the style sheet."""

THUMBNAIL: Final = (240, 150)
"""Largest width and height, pixels."""


def prose(text: str) -> str:
    """Text with `code` between backticks."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", escape(text, quote=False))


def mark(verdict: ClaimVerdict) -> str:
    """A verdict with its sign."""
    return f'<span class="mark {CLASSES[verdict]}">{escape(verdict.value)}</span>'


def tag(origin: Origin) -> str:
    """What is ours in a row."""
    return f'<span class="tag" title="{escape(origin.meaning)}">{escape(origin.value)}</span>'


def anchor(name: str) -> str:
    """The link of a heading or row to itself."""
    return f'<a class="anchor" href="#{name}" aria-label="link to {name}">#</a>'


def png_data(png: bytes) -> str:
    """An image as an address."""
    return f"data:image/png;base64,{b64encode(png).decode()}"


def thumbnail_styles(drawings: list[Drawing]) -> str:
    """Style rules with small versions of the figures, each in the page once."""
    rules = []
    for drawing in drawings:
        with Image.open(BytesIO(drawing.png)) as image:
            small = image.convert("RGB")
        small.thumbnail(THUMBNAIL, Image.Resampling.LANCZOS)
        packed = BytesIO()
        small.quantize(64).save(packed, format="PNG", optimize=True)
        width, height = (round(size / 2) for size in small.size)
        rules.append(
            f".thumb-{drawing.picture.name} {{ width: {width}px; height: {height}px; "
            f"background-image: url({png_data(packed.getvalue())}); }}"
        )
    return "\n".join(rules)


def thumbnail(drawing: Drawing) -> str:
    """A link to a figure with its small version."""
    name = drawing.picture.name
    return (
        f'<a class="thumb thumb-{name}" href="#figure-{name}" '
        f'aria-label="{escape(drawing.picture.caption)}"></a>'
    )
