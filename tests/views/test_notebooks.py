"""Figures and Rerun within a notebook."""

from __future__ import annotations

import os
import sys
from types import SimpleNamespace

import pytest
from matplotlib.text import Text

import tiltsim
from tests.flights import flight
from tiltsim.views.rerun import viewer


@pytest.fixture
def in_a_notebook(monkeypatch):
    kernel = SimpleNamespace(kernel=None)
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: kernel))


@pytest.fixture
def widgets(monkeypatch):
    """Arguments of Rerun's widget for notebooks, and the bytes that it gets."""
    made = []

    class Widget:
        def __init__(self, *, recording, blueprint, width):
            self.content, self.blueprint = recording.memory_recording(), blueprint
            made.append(self)

    monkeypatch.setitem(sys.modules, "rerun_notebook", SimpleNamespace())
    monkeypatch.setattr("rerun.notebook.Viewer", Widget)
    return made


def test_a_notebook_shows_the_viewer_in_the_cell(in_a_notebook, widgets, monkeypatch):
    monkeypatch.setattr(viewer, "view_flights", None)  # opens no window
    asset = "RERUN_NOTEBOOK_ASSET"
    monkeypatch.setenv(asset, "")
    monkeypatch.delenv(asset)
    assert flight("fixed").view() is widgets[0]
    assert os.environ[asset] == "serve-local", "no viewer from a website"
    assert tiltsim.view([flight("fixed"), flight("trot")]) is widgets[1]
    one, two = (len(widget.content.drain_as_bytes()) for widget in widgets)
    assert 10_000 < one < two


def test_an_address_names_an_open_viewer_even_in_a_notebook(in_a_notebook, monkeypatch):
    shown = []
    monkeypatch.setattr(viewer, "view_flights", lambda *given, **named: shown.append(given))
    assert flight("fixed").view(url="rerun+http://here:9876/proxy") is None
    assert shown == [([flight("fixed")], "rerun+http://here:9876/proxy")]


def test_without_rerun_s_widget_the_message_says_what_to_install(in_a_notebook, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun_notebook", None)
    with pytest.raises(tiltsim.TiltsimError, match=r"pip install 'rerun-sdk\[notebook\]'"):
        flight("fixed").view()


def test_a_figure_is_the_picture_below_its_cell():
    figure = flight("fixed").plot("z", size=(3, 2))
    assert figure._repr_png_().startswith(b"\x89PNG")
    assert figure.get_size_inches().tolist() == [3.0, 2.0]


def test_the_labels_of_several_flights_are_in_their_order():
    figure = tiltsim.plot([flight("fixed"), flight("trot")], panels="z", labels=["one", "two"])
    shown = [text.get_text() for text in figure.findobj(Text)]
    assert shown.index("one") < shown.index("two")
