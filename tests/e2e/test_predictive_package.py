"""The example of nonlinear model predictive control: its iteration, and its installed wheel."""

from __future__ import annotations

import json
import runpy

import numpy as np
import pytest

from tests.docs.pages import ROOT
from tests.e2e.test_controller_package import installed, run

casadi = pytest.importorskip("casadi")

FLIGHTS = """
import json, warnings
import tiltsim
from tiltsim.studies.arena import vehicles
warnings.simplefilter("ignore")
found = {}
for name, keys in (("hexarotor", {}), ("tilt_hexarotor", {"tilts": "free"})):
    place = vehicles("limited")[name].overrides
    changes = {"simulation.duration": 1.0, "controller": {"law": "predictive", **keys}}
    flight = tiltsim.simulate(tiltsim.load_scenario("arena/limited#step", {**place, **changes}))
    off = flight["position"][-1] - flight["reference_position"][-1]
    tilts = abs(flight["tilt_angles"] - flight["tilt_angles"][0]).max() if keys else 0.0
    most = abs(flight["rotor_speeds"]).max()
    found[name] = [flight.end.kind, float((off @ off) ** 0.5), float(most), float(tilts)]
continuous = {"simulation.control_timestep": 0.0, "simulation.control_latency": 0.0}
try:
    tiltsim.load_scenario("arena/limited#step", continuous | changes)
except tiltsim.InputError as refused:
    found["refused"] = str(refused)
print(json.dumps(found))
"""


@pytest.fixture(scope="module")
def package():
    return runpy.run_path(str(ROOT / "examples/predictive_package/tiltsim_predictive.py"))


def hovering(package, tilts):
    """Arguments of an iteration of two rotors that push up, turned by one tilt or fixed."""
    count, size = 2 + tilts, len(package["GRID"])
    up = np.zeros((3, 6, 2))
    up[0, 2] = 1.0
    if tilts:  # along x by the sine of the tilt
        up[1:, :, :] = 0.0
        up[0, 2], up[1, 2], up[2, 0] = 0.0, 1.0, 1.0
    frame = [1.0, 9.81, 0.0, *np.eye(3).ravel(), *np.zeros(6)]
    known = np.hstack([0.0, 0.03, 0.03, frame, [1e-4] * 2, up.ravel()])
    hover = np.hstack([[np.sqrt(9.81 / 2e-4) / 100.0] * 2, np.zeros(tilts)])
    state = np.hstack([np.zeros(6), np.eye(3).ravel(), np.zeros(3), 100.0 * hover[:2], hover[2:]])
    aims = np.zeros((9 + count, size))
    aims[7], aims[8], aims[9:] = 6.0, 1.0, hover[:, None]
    plan = np.tile(hover[:, None], size)
    return state, plan, aims, known, np.full_like(plan, -0.6), np.full_like(plan, 2.6)


@pytest.mark.parametrize("layout", [(-1, -1), (0, 0)])
def test_a_plan_at_its_aim_stays(package, layout):
    arguments = hovering(package, max(layout) + 1)
    better = np.array(package["iteration_of"](layout)(*arguments))
    assert np.abs(better - arguments[1]).max() < 1e-6


def test_rotors_climb_within_limits_and_tilts_push_aside(package):
    state, plan, aims, *rest = hovering(package, 1)
    aims[0], aims[2] = 0.2, 1.0
    better = np.array(package["iteration_of"]((0, 0))(state, plan, aims, *rest))
    assert better[:2, 0] == pytest.approx([2.6, 2.6])  # at once as fast as allowed
    assert better[2, 0] > 0.02
    assert better.max() <= 2.6 + 1e-9
    assert better[0, -1] < 2.5  # and brakes before the end of the plan


def test_the_farther_the_nose_is_turned_away_the_more_it_costs(package):
    """Its sine alone cost nothing at half a turn, so that yaw steps ended there."""
    state, plan, aims, known, *_ = hovering(package, 0)
    known[0], found = 0.05, []
    for angle in (0.5, 1.5, 3.0):
        turned = [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
        state[6:15] = np.ravel(turned)
        costs = package["interval_of"]((-1, -1))(state, plan[:, 0], aims[:, 0], known)[1]
        found.append(float(costs[6]) / 2.0 / 0.05**0.5)
    assert found == pytest.approx([0.5, 1.5, 3.0])


@pytest.mark.slow
def test_the_installed_wheel_flies_a_step_within_the_limits(tmp_path):
    """From rest to 0.99 m away; with a plan that is not improved, the vehicles would stay."""
    installed("predictive_package", tmp_path)
    done = run(tmp_path, "-c", FLIGHTS)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert "controller.law" in (refused := found.pop("refused"))
    assert "needs simulation.control_timestep > 0" in refused
    assert "\n" not in refused
    for name, (end, off, speed, _) in found.items():
        assert end == "completed", name
        assert off < 0.15, name
        assert 700.0 < speed <= 838.0, name
    assert 0.1 < found["tilt_hexarotor"][3] < 0.8
