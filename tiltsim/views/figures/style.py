"""The common style: sizes, fonts and colors that survive print and color blindness."""

import logging
import re
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from io import BytesIO
from math import pi
from pathlib import Path
from typing import Any, Final, NamedTuple

import matplotlib
from matplotlib import rc_context, rcParams
from matplotlib import style as styles
from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from tiltsim.errors import InputError
from tiltsim.system.arguments import is_finite
from tiltsim.system.files import replacing
from tiltsim.system.text import short_repr, shortened
from tiltsim_controllers.mathematics.scalar import Floats

# After Okabe and Ito; each pair also differs in lightness, so that gray prints stay legible.
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
"""Dashes and markers that accompany the colors of `CYCLE`, for prints without color."""
SEQUENTIAL: Final = "cividis"

# Lines of equal angles and speeds would cover each other: later ones are thinner and dashed.
ROTOR_LINES: Final[tuple[dict[str, Any], ...]] = (
    {"color": AMBER, "ls": "-", "lw": 3.0},
    {"color": BLUE, "ls": "-", "lw": 1.8},
    {"color": INK, "ls": (0, (4, 2)), "lw": 1.2},
    {"color": SKY, "ls": (0, (1, 1.2)), "lw": 1.6},
)
"""Styles of the lines of rotors 1 to 4 in one panel."""

_ROTOR_DASHES: Final = ("-", (0, (6, 1.5)), (0, (2, 1)), (0, (5, 1, 1, 1)), (0, (1, 2)))
"""Dashes of further lines; with six hues they repeat after thirty."""
AXIS_LINES: Final[tuple[dict[str, Any], ...]] = (
    {"color": BLUE, "ls": "-", "lw": 1.4},
    {"color": RED, "ls": (0, (5, 1.2)), "lw": 1.4},
    {"color": GREEN, "ls": (0, (5, 1.2, 1, 1.2)), "lw": 1.4},
)
"""Styles of the lines of x, y, z, or roll, pitch, yaw, in one panel."""
WORLD_LINES: Final[tuple[dict[str, Any], ...]] = (
    {"color": INK, "ls": "-", "lw": 1.2},
    {"color": GREY, "ls": (0, (5, 1.2)), "lw": 1.4},
    *({"color": INK, "ls": dashes, "lw": 1.2} for dashes in DASHES[2:]),
)
"""Styles of lines that belong to no vehicle, beside lines in the colors of vehicles."""
FORMATS: Final = (".png", ".svg", ".pdf")  # suffixes of figure files
SINGULAR: Final = RED  # curves of singular attitudes and of singular tilt angles, in every figure
UNREACHABLE: Final = "#F3D3C3"
"""The shade of attitudes that are singular, nearly so or beyond a singularity, in all figures."""
_SETTINGS: Final = Path(__file__).with_name("paper.mplstyle")
_GLYPHS: Final = "DejaVu Sans"
"""The font, part of matplotlib, of letters that the chosen ones lack, such as subscripts."""
PRINT_DPI: Final = 300.0
"""Resolution of pixel formats of a figure whose size is given, unless the user sets another."""
_LENGTH: Final = r"(\d+(?:\.\d*)?|\.\d+)\s*(mm|cm|in)?"
_SIZE: Final = re.compile(rf"{_LENGTH}(?:\s*x\s*{_LENGTH})?")
_INCHES: Final = {"in": 1.0, "cm": 1.0 / 2.54, "mm": 1.0 / 25.4}
_ALLOWED: Final = (0.5, 80.0)  # smallest and largest width or height of a figure, inches
LONGEST_TEXT: Final = 300  # letters of a user's text that a figure has room for


def rotor_lines(count: int) -> list[dict[str, Any]]:
    """Styles of the lines of some rotors: `ROTOR_LINES`, then thin ones of all hues."""
    hues = (GREEN, RED, *(line["color"] for line in ROTOR_LINES))
    more = [
        {"color": hues[i % len(hues)], "ls": _ROTOR_DASHES[i % len(_ROTOR_DASHES)], "lw": 1.2}
        for i in range(count)
    ]
    return [*ROTOR_LINES, *more][:count]


class Size(NamedTuple):
    """Width and, unless the content decides, height of a figure, inches."""

    width: float
    height: float | None = None


_styled: ContextVar[bool] = ContextVar("styled", default=False)
_size: ContextVar[Size | None] = ContextVar("size", default=None)


def parse_size(name: str, size: str | tuple[float, float] | None) -> Size | None:
    """A size from a text such as "85mm x 60mm", "3.3x2.4in" or "85mm", or in inches.

    Raises:
        InputError: If ``size``, the value of ``name``, is neither.
    """
    if size is None:
        return None
    if isinstance(size, str):
        found = _SIZE.fullmatch(size.strip())
        if found is None:
            raise InputError(f"{name}: {size!r}: write such as 85mm, 85x60mm or 3.3x2.4in")
        width, unit, height, height_unit = found.groups()
        last = height_unit or unit
        if last is None:
            raise InputError(f"{name}: {size!r}: add mm, cm or in")
        scale = _INCHES[unit or last]
        inches = Size(float(width) * scale, float(height) * _INCHES[last] if height else None)
    elif isinstance(size, list | tuple) and len(size) == 2 and all(map(is_finite, size)):
        inches = Size(*size)
    else:
        raise InputError(f"{name} = {short_repr(size)}: must be two numbers, inches, or a text")
    low, high = _ALLOWED
    if not all(side is None or low <= side <= high for side in inches):
        raise InputError(f"{name}: {size!r}: must be from {low:g} to {high:g} inches")
    return inches


@contextmanager
def paper_style(file: Path | None = None, size: Size | None = None) -> Iterator[None]:
    """Apply the common style within this context, below the user's own settings.

    The user's settings are a matplotlib style ``file``, rcParams that differ from matplotlib's
    defaults, and the user's matplotlibrc. Contexts within this one only change the ``size`` of
    figures.

    Raises:
        InputError: If the file cannot be read or is no style.
    """
    outer = _size.set(size if size is not None else _size.get())
    try:
        if _styled.get():
            yield
            return
        own = {} if file is None else _style_of(file)
        common = dict(matplotlib.rc_params_from_file(_SETTINGS, use_default_template=False))
        common |= {} if size is None else {"savefig.dpi": PRINT_DPI}
        for key in _users_settings(common):
            del common[key]
        inner = _styled.set(True)
        try:
            with rc_context({**common, **own}), missing_glyphs_as_boxes():
                families = dict.fromkeys([*rcParams["font.family"], _GLYPHS])
                rcParams["font.family"] = list(families)
                yield
        finally:
            _styled.reset(inner)
    finally:
        _size.reset(outer)


def _users_settings(keys: Iterable[str]) -> set[str]:
    """The settings among ``keys`` that the user has changed or named in a matplotlibrc."""
    # All of `rcParams` cannot be read without choosing a backend.
    changed = {key for key in keys if matplotlib.rcParams[key] != matplotlib.rcParamsDefault[key]}
    file = Path(matplotlib.matplotlib_fname())
    if not file.is_relative_to(matplotlib.get_data_path()):
        named = matplotlib.rc_params_from_file(file, use_default_template=False)
        changed |= set(keys) & set(named)
    return changed


def _style_of(file: Path) -> dict[str, Any]:
    """The settings of a matplotlib style, given as a file or by its name."""
    if str(file) in styles.library:
        return dict(styles.library[str(file)])
    settings: dict[str, Any] = {}
    with _complaints() as complaints:
        try:
            settings = dict(matplotlib.rc_params_from_file(file, use_default_template=False))
        except (OSError, UnicodeDecodeError, Warning) as error:
            unreadable = isinstance(error, UnicodeDecodeError)
            reason = "is no text" if unreadable else getattr(error, "strerror", None) or str(error)
            complaints.insert(0, reason)
    if complaints:
        first = complaints[0].strip().partition("\n")[0]
        raise InputError(
            f"--style {file}: {shortened(first, 160)}; give a matplotlib style file, or one of "
            f"{', '.join(sorted(name for name in styles.available if name[0] != '_'))}"
        )
    return settings


@contextmanager
def _complaints() -> Iterator[list[str]]:
    """Collect matplotlib's log of errors within this context; warnings are raised."""
    logged: list[str] = []

    def keep(record: logging.LogRecord) -> bool:
        if record.levelno >= logging.WARNING:
            logged.append(record.getMessage())
        return False

    logger = logging.getLogger("matplotlib")
    logger.addFilter(keep)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            yield logged
    finally:
        logger.removeFilter(keep)


def line_style(number: int) -> dict[str, Any]:
    """Color and dashes of the line with this number, from 0."""
    return {"color": cycle_color(number), "ls": DASHES[number % len(DASHES)]}


def marked_line(number: int, samples: int) -> dict[str, Any]:
    """Color and markers of the line with this number, from 0, and number of samples.

    Dashes would vanish in dense oscillations; the few markers of each line have their own places.
    """
    every = max(1, samples // 8)
    look = {"color": cycle_color(number), "marker": MARKERS[number % len(MARKERS)], "ms": 4.5}
    return {**look, "mfc": "white", "markevery": (every * (number + 1) // 8, every)}


def cycle_color(number: int) -> str:
    """The color of the line with this number, from 0: `CYCLE`, unless the user has another."""
    colors = rcParams["axes.prop_cycle"].by_key().get("color", CYCLE)
    return str(colors[number % len(colors)])


def verbatim(text: str) -> str:
    """A user's text, not too long, with dollar signs escaped: matplotlib finds no formula in it."""
    return shortened(text, LONGEST_TEXT).replace("$", r"\$")


def new_figure(width: float, height: float) -> Any:
    """An empty `ShownFigure` with constrained layout.

    It has the size of the context or, without one, this size (inches); with the width alone given,
    the same proportions.
    """
    requested = _size.get()
    if requested is not None:
        height = requested.height or height * requested.width / width
        width = requested.width
    return ShownFigure(figsize=(width, height), layout="constrained")


def requested_size() -> Size | None:
    """The size of the context."""
    return _size.get()


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


def shade_share(axes: Axes, edges: Floats, share: Floats) -> None:
    """Shade a plane by the share (0 to 1) of the time at which its points are unreachable."""
    shades = LinearSegmentedColormap.from_list("unreachable", ["#FFFFFF", UNREACHABLE])
    axes.grid(visible=False)
    axes.pcolormesh(edges, edges, share, cmap=shades, vmin=0.0, vmax=1.0, rasterized=True)


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
        InputError: If the file cannot be written, or the figure is too small for its content.
    """
    suffix = path.suffix.lower()
    undated = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}
    with paper_style(), replacing(path) as temporary, warnings.catch_warnings():
        warnings.filterwarnings("error", "constrained_layout not applied")
        try:
            figure.savefig(temporary, format=suffix[1:], metadata=undated.get(suffix))
        except UserWarning as warning:
            raise InputError(f"{path}: {too_small(figure)}") from warning


def too_small(figure: Figure) -> str:
    """The error message for a figure into which its panels do not fit."""
    width, height = figure.get_size_inches() * 25.4
    size = f"{width:.0f} mm x {height:.0f} mm"
    return f"{size} are too small for these panels; choose fewer panels or a larger size"


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
