"""The common style: sizes, fonts and colours that survive print and colour blindness."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Final

from tiltsim.errors import InputError
from tiltsim.system.files import replacing

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# After Okabe and Ito; each pair differs in lightness too, so that grey prints stay legible.
BLUE: Final = "#0072B2"
RED: Final = "#D55E00"
GREEN: Final = "#009E73"
AMBER: Final = "#E69F00"
PURPLE: Final = "#CC79A7"
SKY: Final = "#56B4E9"
INK: Final = "#222222"
GREY: Final = "#8A8A8A"
PALE: Final = "#D6E6EF"
CYCLE: Final = (BLUE, RED, GREEN, PURPLE, AMBER, SKY, INK)
DASHES: Final[tuple[Any, ...]] = (
    *("-", (0, (6, 2)), (0, (1, 1.2)), (0, (6, 2, 1, 2))),
    *((0, (3, 1)), (0, (10, 3)), (0, (3, 1, 1, 1, 1, 1))),
)
MARKERS: Final = "os^DvPX"
"""Dashes and markers that go with the colours of `CYCLE`, for prints without colour."""
SEQUENTIAL: Final = "cividis"

# Equal angles and speeds would hide each other: later lines are thinner and broken.
ROTOR_LINES: Final[tuple[dict[str, Any], ...]] = (
    {"color": AMBER, "ls": "-", "lw": 3.0},
    {"color": BLUE, "ls": "-", "lw": 1.8},
    {"color": INK, "ls": (0, (4, 2)), "lw": 1.2},
    {"color": SKY, "ls": (0, (1, 1.2)), "lw": 1.6},
)
"""How the lines of rotors 1 to 4 are drawn in one panel, in this order."""

AXIS_LINES: Final[tuple[dict[str, Any], ...]] = (
    {"color": BLUE, "ls": "-", "lw": 1.4},
    {"color": RED, "ls": (0, (5, 1.2)), "lw": 1.4},
    {"color": GREEN, "ls": (0, (5, 1.2, 1, 1.2)), "lw": 1.4},
)
"""How the lines of x, y, z, or roll, pitch, yaw, are drawn in one panel: as for rotors."""

FORMATS: Final = (".png", ".svg", ".pdf")
"""File formats of a figure, by the ending of the file."""

_SETTINGS: Final = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9,
    "axes.titlesize": 9.5,
    "axes.labelsize": 9,
    "axes.edgecolor": INK,
    "axes.linewidth": 0.7,
    "axes.labelcolor": INK,
    "axes.titlelocation": "left",
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#D9D9D9",
    "grid.linewidth": 0.5,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "lines.linewidth": 1.4,
    "figure.dpi": 100,
    "savefig.dpi": 160,
    "svg.hashsalt": "tiltsim",
    "pdf.fonttype": 42,
}


def line_style(number: int) -> dict[str, Any]:
    """Colour and dashes of a line among others, by its number."""
    return {"color": CYCLE[number % len(CYCLE)], "ls": DASHES[number % len(DASHES)]}


@contextmanager
def paper_style() -> Iterator[None]:
    """Draw within this context to have the common style, and leave no trace of it."""
    from cycler import cycler
    from matplotlib import rc_context

    with rc_context({**_SETTINGS, "axes.prop_cycle": cycler(color=CYCLE)}):
        yield


def verbatim(text: str) -> str:
    """A user's text for a figure, in which dollars are dollars and no formula begins."""
    return text.replace("$", r"\$")


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of the given size (inches) with constrained layout."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def angle_axis(axes: Axes, axis: str, limit: float) -> None:
    """Ticks at multiples of pi/4 up to ``limit`` (rad) on axis "x" or "y"."""
    from math import pi

    labels = {-2: "−π/2", -1: "−π/4", 0: "0", 1: "π/4", 2: "π/2"}
    steps = [step for step in labels if abs(step) * pi / 4 <= limit + 1e-9]
    set_ticks: Any = getattr(axes, f"set_{axis}ticks")
    set_ticks([step * pi / 4 for step in steps], [labels[step] for step in steps])
    set_limits: Any = getattr(axes, f"set_{axis}lim")
    set_limits(-limit, limit)


def time_axis(axes: Axes, end: float) -> None:
    """Limits from zero to the end of a flight (s), which may have ended where it began."""
    axes.set_xlim(0.0, end if end > 0.0 else 1.0)


def save(figure: Figure, path: Path) -> None:
    """Write a figure whole or not at all; the ending of ``path`` chooses the format.

    Equal figures give equal files: no date is written. Callers have asked
    `tiltsim.system.files.prepare_file` whether the file can be written.

    Raises
    ------
    InputError
        If writing fails.
    """
    ending = path.suffix.lower()
    undated = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}
    try:
        with paper_style(), replacing(path) as temporary:
            figure.savefig(temporary, format=ending[1:], metadata=undated.get(ending))
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from error
