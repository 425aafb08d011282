"""Every kind of vehicle has its views."""

from __future__ import annotations

from tiltsim.laws.assembling import LOOPS
from tiltsim.laws.commanded import OTHER_LAYOUT_LOOPS
from tiltsim.views.rerun.display import VehicleDisplay
from tiltsim.views.vehicle_views import MULTIROTOR, VIEWS
from tiltsim.views.video import overlay


def test_every_kind_of_vehicle_has_views():
    assert VIEWS.keys() == {loop.kind for loop in (*LOOPS.values(), *OTHER_LAYOUT_LOOPS.values())}


def test_what_views_name_exists():
    for views in (*VIEWS.values(), MULTIROTOR):
        assert "position_error" in views.panels()
        assert overlay.Overlay in getattr(overlay, views.caption).__mro__
        assert isinstance(views.display(), VehicleDisplay)
