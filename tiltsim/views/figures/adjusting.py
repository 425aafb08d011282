"""Titles and labels of finished figures, replaced by the user's."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from tiltsim.errors import InputError
from tiltsim.scenario.messages import did_you_mean
from tiltsim.scenario.metric_names import METRICS
from tiltsim.views.figures import style
from tiltsim.views.figures.layout import HEADING

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Text


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
        old = METRICS[name].label if name in METRICS else style.verbatim(name)
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
