"""The common style: sizes, fonts and colours that survive print and colour blindness."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from math import pi
from typing import TYPE_CHECKING, Any, Final

from tiltsim.system.files import replacing

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# After Okabe and Ito; each pair also differs in lightness, so that grey prints stay legible.
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
    "-",
    (0, (6, 2)),
    (0, (1, 1.2)),
    (0, (6, 2, 1, 2)),
    (0, (3, 1)),
    (0, (10, 3)),
    (0, (3, 1, 1, 1, 1, 1)),
)
MARKERS: Final = "os^DvPX"
"""Dashes and markers that accompany the colours of `CYCLE`, for prints without colour."""
SEQUENTIAL: Final = "cividis"

# Lines of equal angles and speeds would cover each other: later ones are thinner and dashed.
ROTOR_LINES: Final[tuple[dict[str, Any], ...]] = (
    {"color": AMBER, "ls": "-", "lw": 3.0},
    {"color": BLUE, "ls": "-", "lw": 1.8},
    {"color": INK, "ls": (0, (4, 2)), "lw": 1.2},
    {"color": SKY, "ls": (0, (1, 1.2)), "lw": 1.6},
)
"""Styles of the lines of rotors 1 to 4 in one panel."""

AXIS_LINES: Final[tuple[dict[str, Any], ...]] = (
    {"color": BLUE, "ls": "-", "lw": 1.4},
    {"color": RED, "ls": (0, (5, 1.2)), "lw": 1.4},
    {"color": GREEN, "ls": (0, (5, 1.2, 1, 1.2)), "lw": 1.4},
)
"""Styles of the lines of x, y, z, or roll, pitch, yaw, in one panel."""

FORMATS: Final = (".png", ".svg", ".pdf")
"""Suffixes of figure files."""

SINGULAR: Final = RED
"""Curves of singular attitudes and of singular tilt angles, in every figure."""
UNREACHABLE: Final = "#F3D3C3"
"""The shade of what lies beyond singular attitudes or is as good as singular, in every figure."""

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
    """Colour and dashes of the line with this number, from 0."""
    return {"color": CYCLE[number % len(CYCLE)], "ls": DASHES[number % len(DASHES)]}


@contextmanager
def paper_style() -> Iterator[None]:
    """Apply the common style within this context."""
    from cycler import cycler
    from matplotlib import rc_context

    with rc_context({**_SETTINGS, "axes.prop_cycle": cycler(color=CYCLE)}):
        yield


def verbatim(text: str) -> str:
    """A user's text with dollar signs escaped, so that matplotlib finds no formula in it."""
    return text.replace("$", r"\$")


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of the given size (inches) with constrained layout."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def angle_axis(axes: Axes, axis: str, limit: float) -> None:
    """Ticks at four fractions of ``limit`` (rad), up to pi, on axis "x" or "y"."""
    labels = {-4: "−π", -2: "−π/2", -1: "−π/4", 0: "0", 1: "π/4", 2: "π/2", 4: "π"}
    every = 2 if limit > 0.75 * pi else 1
    steps = [step for step in labels if abs(step) * pi / 4 <= limit + 1e-9 and step % every == 0]
    set_ticks: Any = getattr(axes, f"set_{axis}ticks")
    set_ticks([step * pi / 4 for step in steps], [labels[step] for step in steps])
    set_limits: Any = getattr(axes, f"set_{axis}lim")
    set_limits(-limit, limit)


def roll_pitch_axes(axes: Axes) -> None:
    """Axes of the roll-pitch plane up to pi/2 either way."""
    angle_axis(axes, "x", pi / 2)
    angle_axis(axes, "y", pi / 2)
    axes.set(xlabel="roll φ (rad)", ylabel="pitch θ (rad)", aspect="equal")


def zero_lines(axes: Axes, which: str = "xy") -> None:
    """Thin lines along the "x" and "y" axes."""
    if "x" in which:
        axes.axhline(0.0, color=GREY, lw=0.7)
    if "y" in which:
        axes.axvline(0.0, color=GREY, lw=0.7)


def time_axis(axes: Axes, end: float) -> None:
    """Limits from zero to the end of a flight (s), which may be zero."""
    axes.set_xlim(0.0, end if end > 0.0 else 1.0)


def save(figure: Figure, path: Path) -> None:
    """Write a figure atomically, without a date, in the format of the path's suffix.

    `tiltsim.system.files.prepare_file` checks a path beforehand.

    Raises:
        InputError: If the file cannot be written.
    """
    suffix = path.suffix.lower()
    undated = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}
    with paper_style(), replacing(path) as temporary, warnings.catch_warnings():
        # Text in scripts that the font lacks, such as Chinese, is drawn as boxes.
        warnings.filterwarnings("ignore", r"Glyph \d+ .* missing from font")
        figure.savefig(temporary, format=suffix[1:], metadata=undated.get(suffix))
