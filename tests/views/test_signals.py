"""Panels from columns, and the ranges of their axes."""

from __future__ import annotations

import numpy as np
import pytest

from tests.flights import flight
from tiltsim.views.figures.plot import plot
from tiltsim.views.signals import FLOORS, scale, signals_of, stems

TIME = np.linspace(0.0, 1.0, 101)


def test_columns_that_differ_in_an_axis_or_number_share_a_panel():
    columns = ["time", "vx", "vy", "air_vx", "air_vy", "lift_1", "lift_2", "z", "z_ref", "mode"]
    assert stems(columns) == {
        "time": ["time"],
        "velocity": ["vx", "vy"],
        "air_v": ["air_vx", "air_vy"],
        "lift": ["lift_1", "lift_2"],
        "z": ["z"],  # drawn with its reference
        "mode": ["mode"],
    }


def test_a_column_of_a_control_law_has_a_panel_with_its_unit():
    """No code names it."""
    this = flight("tilt_car")
    panel = signals_of(this.assembly)["wanted_square"]
    assert [line.values for line in panel.lines] == ["wanted_square_1", "wanted_square_2"]
    assert panel.text.endswith(" square (rad²/s²)")
    (axes,) = plot(this, panels="wanted_square").axes
    np.testing.assert_array_equal(axes.lines[0].get_ydata(), this["wanted_square_1"])
    assert axes.get_ylabel() == "rad²/s²"


@pytest.mark.parametrize(
    ("values", "span"),
    [
        (1e-16 * np.sin(9.0 * TIME), 0.02),  # rounding around zero
        (1e5 + 1e-8 * np.sin(9.0 * TIME), 0.1),  # rounding of large numbers
        (3.0 * TIME, 3.3),
    ],
)
def test_equal_numbers_do_not_fill_an_axis(values, span):
    low, high, off = scale([values], [False], FLOORS["rad"])
    assert high - low == pytest.approx(span)
    assert low <= values.min()
    assert high >= values.max()
    assert not off


def test_the_end_of_a_diverged_flight_does_not_decide_the_scale():
    values = np.where(TIME > 0.99, 1e6, TIME)
    assert scale([values], [True], 0.02)[1:] == (pytest.approx(1.3, abs=0.05), True)
    assert scale([values], [False], 0.02)[1] > 1e6
