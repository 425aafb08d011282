"""Layout of figures at any size: panels in columns, headings, legends; the user's own words."""

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import groupby
from math import ceil
from typing import Any, Final, NamedTuple

from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.text import Text

from tiltsim.errors import InputError
from tiltsim.scenario.messages import did_you_mean
from tiltsim.scenario.metric_names import is_metric, metric_of
from tiltsim.views.figures import style

HEADING: Final = "heading"  # identifies the title of a figure
MIN_COLUMN: Final = 2.9  # width (inches) that a column of panels needs
ROW: Final = 1.75  # height (inches) of a panel over time, unless the height of the figure is given
_TRIES: Final = 5  # heights that are tried for a page of a given width
MAX_STACK: Final = 3
"""Panels over time in one column before a second one is begun, if there is room."""


MIN_PANEL: Final = 0.6  # height (inches) that a panel needs for its scale and label


class Page(NamedTuple):
    """A figure with axes for its panels, in their order, and the columns of those over time."""

    figure: Figure
    panels: list[Axes]
    columns: list[list[Axes]]


def new_page(over_time: Sequence[bool]) -> Page:
    """An empty page for panels over time and square ones, given as True and False in their order.

    Panels of one kind that follow each other are a block; the blocks are beside or below each
    other, in their order.
    """
    blocks = [(kind, len([*block])) for kind, block in groupby(over_time)]
    longest = max((number for kind, number in blocks if kind), default=0)
    many, square = longest > MAX_STACK, len(over_time) - sum(over_time)
    natural = 8.4 if many else 5.4 if longest else 0.0
    natural += 3.6 * max(0, sum(kind for kind, _ in blocks) - 1)
    natural += min(square, 3 if not longest else 1) * (3.0 if longest else 4.2)
    requested = style.requested_size()
    width = natural if requested is None else requested.width
    columns = 0 if not longest else 2 if many and width >= 2 * MIN_COLUMN else 1
    parts = [columns if kind else 1 for kind, _ in blocks]
    beside = len(blocks) > 1 and width >= sum(parts) * MIN_COLUMN
    across = 1 if beside else max(1, min(square, int(width / MIN_COLUMN)))
    side = width / sum(parts) if beside else min(width / across, 4.2)
    rows = [ceil(n / (columns if kind else across)) for kind, n in blocks]
    heights = [
        number * (ROW if kind else 0.92 * side)
        for number, (kind, _) in zip(rows, blocks, strict=True)
    ]
    figure = style.new_figure(width, (max(heights) if beside else sum(heights)) + 0.85)
    parents: Any = [figure]
    if beside:
        shares = [1.05 * n if kind else 1.0 for n, (kind, _) in zip(parts, blocks, strict=True)]
        parents = figure.subfigures(1, len(blocks), width_ratios=shares)
    elif len(blocks) > 1:
        parents = figure.subfigures(len(blocks), 1, height_ratios=heights)
    page = Page(figure, [], [])
    for parent, number, (kind, count) in zip(parents, rows, blocks, strict=True):
        if kind:  # separate columns, so that the shorter one leaves no hole
            lengths = [count - number * (columns - 1), *[number] * (columns - 1)]
            stacks = parent.subfigures(1, len(lengths), squeeze=False)[0]
            for stack, length in zip(stacks, lengths, strict=True):
                page.columns.append([*stack.subplots(length, 1, squeeze=False)[:, 0]])
                page.panels.extend(page.columns[-1])
        else:
            placed = [*parent.subplots(number, across, squeeze=False).flat]
            page.panels.extend(placed[:count])
            for axes in placed[count:]:
                axes.remove()
    return page


def fitting(draw: Callable[[], Page]) -> Figure:
    """A page of the size in use whose panels are high enough to be read.

    If only its width is given, it is drawn as high as they need.

    Raises:
        InputError: If the width is too small, or the height is given and too low.
    """
    page, requested = draw(), style.requested_size()
    if requested is None:
        return page.figure
    first, (width, height) = page, page.figure.get_size_inches()

    def redrawn(height: float | None) -> tuple[Page, float, int]:
        with style.paper_style(size=style.Size(width, height)):
            page = draw()
        return page, *_heights(page)

    lowest, rows = _heights(page)
    if rows == 0:
        page, lowest, rows = redrawn(None)
        height = page.figure.get_size_inches()[1] - rows * (lowest - MIN_PANEL)
        lowest = 0.0
    for _ in range(_TRIES):
        if rows == 0 or lowest >= MIN_PANEL:
            break
        height = ceil(25.4 * (height + rows * max(0.0, MIN_PANEL - lowest))) / 25.4
        page, lowest, rows = redrawn(height)
    if rows == 0:
        raise InputError(style.too_small(first.figure))
    if page is first:
        return page.figure
    if requested.height is not None:
        number = f"{len(page.panels)} panel{'s' * (len(page.panels) > 1)}"
        least = f"at least {25.4 * height:.0f} mm"
        raise InputError(f"{25.4 * requested.height:.0f} mm is too low for {number}; {least}")
    return page.figure


def _heights(page: Page) -> tuple[float, int]:
    """Height (inches) of the lowest panel, and the rows of panels; zeros if they do not fit."""
    layout: Any = page.figure.get_layout_engine()
    with warnings.catch_warnings():
        warnings.filterwarnings("error", "constrained_layout not applied")
        try:
            layout.execute(page.figure)  # as drawing does first
        except UserWarning:
            return 0.0, 0
    parents: Any = [axes.figure for axes in page.panels]
    boxes = [
        axes.get_position(original=True).transformed(parent.transSubfigure)
        for axes, parent in zip(page.panels, parents, strict=True)
    ]
    return min(box.height for box in boxes) / page.figure.dpi, len({round(b.y0) for b in boxes})


def add_heading(figure: Figure, title: str, more: str = "", legend: Sequence[Any] = ()) -> None:
    """Write the title, facts and legend above the panels, wrapped to the width.

    Args:
        figure: Without a title or legend.
        title: Its title.
        more: A line of facts, in gray.
        legend: Handles of a legend.
    """
    width, height = figure.get_size_inches() * figure.dpi
    gap = 0.07 * figure.dpi
    top = height - gap
    bold: dict[str, Any] = {"gid": HEADING, "size": rcParams["figure.titlesize"]}
    bold["weight"] = rcParams["figure.titleweight"]
    for text, look in ((title, bold), (more, {"color": "#555555"})):
        if text:
            written = figure.text(2.0 * gap / width, top / height, text, va="top", **look)
            wrap(written, width - 4.0 * gap)
            top -= written.get_window_extent().height + gap
    if legend:
        place: dict[str, Any] = {"bbox_to_anchor": (2.0 * gap / width, top / height)}
        place |= {"loc": "upper left", "borderaxespad": 0.0, "borderpad": 0.0}
        drawn = add_legend(figure, legend, **place)
        top -= drawn.get_window_extent().height + gap
    layout: Any = figure.get_layout_engine()
    layout.set(rect=(0.0, 0.0, 1.0, top / height))


def add_legend(figure: Figure, handles: Sequence[Any], columns: int = 9, **look: Any) -> Legend:
    """A legend of the whole figure, below it by default, in the most columns that fit."""
    inches = figure.get_size_inches()[0]
    # Letters are a little wider in the resolution of print.
    width = min(0.96 * inches, 0.97 * (inches - 0.28)) * figure.dpi
    look = {"loc": "outside lower center", **look}
    for number in range(min(columns, len(handles)), 0, -1):
        legend = figure.legend(handles=handles, ncols=number, **look)
        if legend.get_window_extent().width <= width:
            return legend
        if number > 1:
            legend.remove()
    for text in legend.get_texts():
        wrap(text, width - 3.0 * float(text.get_fontsize()) * figure.dpi / 72.0)
    return legend


def wrap(text: Text, width: float) -> None:
    """Break a text, level or upright, into lines of at most a width (pixels), between words."""
    lines: list[str] = []
    for word in text.get_text().split(" "):
        longer = f"{lines[-1]} {word}" if lines else word
        text.set_text(longer)
        box = text.get_window_extent()
        if lines and (box.height if text.get_rotation() == 90.0 else box.width) > width:
            lines.append(word)
        else:
            lines[-1:] = [longer]
    text.set_text("\n".join(lines))


CLOSE: Final = 0.93  # share of a panel's width that title and legend may fill side by side


def place_legends(page: Page) -> None:
    """The legends of the panels: over those over time, at the right, and below the squares.

    The layout is made first, so that legends know the room that they have.
    """
    layout: Any = page.figure.get_layout_engine()
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "constrained_layout not applied")
        layout.execute(page.figure)
    over_time = [axes for column in page.columns for axes in column]
    for axes in page.panels:
        labels = axes.get_legend_handles_labels()[1]
        if labels:
            _place_legend(axes, len(labels), below=axes not in over_time)


def _place_legend(axes: Axes, entries: int, *, below: bool) -> None:
    box, points = axes.get_window_extent(), 72.0 / axes.figure.dpi
    look: dict[str, Any] = {"handlelength": 1.4, "columnspacing": 0.9, "handletextpad": 0.4}
    if below:
        low = -4.2 * rcParams["font.size"] / points / box.height
        look |= {"loc": "upper center", "bbox_to_anchor": (0.5, low)}
    else:
        look |= {"loc": "lower right", "bbox_to_anchor": (1.0, 0.985), "borderaxespad": 0.0}
    title = axes.get_title(loc="left")
    for columns in range(min(entries, 4 if below else 8), 0, -1):
        drawn = axes.legend(ncols=columns, **look).get_window_extent()
        if drawn.width <= (1.15 if below else 1.0) * box.width:
            break
    together = drawn.width + axes.set_title(title).get_window_extent().width
    if not below and together > CLOSE * box.width:
        axes.set_title(title, pad=drawn.height * points)


def retitle(figure: Figure, title: str | None) -> None:
    """Replace the title of a figure, or of its only panel; empty for none, None for no change."""
    if title is None:
        return
    headings = [text for text in figure.texts if text.get_gid() == HEADING]
    if headings:
        headings[0].set_text(style.verbatim(title))
        return
    single = [axes for axes in figure.axes if axes.get_title(loc="left")]
    if len(figure.axes) == 1 and single:
        figure.axes[0].set_title(style.verbatim(title))
    else:
        figure.suptitle(style.verbatim(title), x=0.01, ha="left", wrap=True)


def relabel(
    figure: Figure, labels: Mapping[str, str], panels: Mapping[str, Axes] | None = None
) -> None:
    """Replace labels of axes, panels and legends; a unit in brackets behind them stays.

    Args:
        figure: A finished figure.
        labels: New texts by present text, or by the name of a metric or panel.
        panels: Its panels by their names, if they have some.

    Raises:
        InputError: If the figure does not have the text.
    """
    if not labels:
        return
    texts = [text for text in _texts(figure) if text.get_text()]
    for name, new in labels.items():
        old = metric_of(name).label if is_metric(name) else style.verbatim(name)
        if panels and name in panels and not any(_says(text, old) for text in texts):
            axes = panels[name]
            old = _said(axes._left_title) or _said(axes.yaxis.label)  # type: ignore[attr-defined]
            old = old.partition(" (")[0]
        found = False
        for text in texts:
            said = _said(text)
            _, bracket, unit = said.partition(" (")
            if _says(text, old):
                text.set_text(style.verbatim(new) + ("" if said == old else bracket + unit))
                found = True
        if not found:
            said_now = [_said(text).partition(" (")[0] for text in texts]
            known = [*dict.fromkeys([*said_now, *(panels or ())])]
            says = ", ".join(map(repr, known))
            raise InputError(f"label {name!r}: {did_you_mean(name, known)}the figure says {says}")


def _said(text: Text) -> str:
    return text.get_text().replace("\n", " ")


def _says(text: Text, label: str) -> bool:
    """Whether a text is this label, with or without a unit."""
    return label in {_said(text), _said(text).partition(" (")[0]}


def _texts(figure: Figure) -> Iterator[Text]:
    """The labels, titles and legends of a figure."""
    for axes in figure.axes:
        yield from (axes.xaxis.label, axes.yaxis.label)
        legend = axes.get_legend()
        yield from (axes.title, axes._left_title)  # type: ignore[attr-defined]
        yield from [] if legend is None else [*legend.get_texts(), legend.get_title()]
    for legend in figure.legends:
        yield from [*legend.get_texts(), legend.get_title()]
