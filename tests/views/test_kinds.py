"""Every kind of vehicle has all views."""

from __future__ import annotations

import pytest
from tiltsim.views.figures.flight import FIGURES

from tiltsim.laws.assembling import LOOPS
from tiltsim.views.rerun.flight_recorder import DISPLAYS
from tiltsim.views.video.overlay import OVERLAYS


@pytest.mark.parametrize("views", [FIGURES, DISPLAYS, OVERLAYS])
def test_every_kind_of_vehicle_has_every_view(views):
    assert views.keys() == {loop.kind.name for loop in LOOPS.values()}
