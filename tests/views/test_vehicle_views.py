"""Every kind of vehicle has its views."""

from __future__ import annotations

from tiltsim.laws.assembling import LOOPS
from tiltsim.laws.commanded import OTHER_LAYOUT_LOOPS
from tiltsim.views.vehicle_views import VIEWS


def test_every_kind_of_vehicle_has_views():
    assert VIEWS.keys() == {loop.kind for loop in (*LOOPS.values(), *OTHER_LAYOUT_LOOPS.values())}
