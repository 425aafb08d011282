"""Scalar laws of the user's, of packages, and the loop that they share with the baselines."""

from __future__ import annotations

import importlib.metadata
import warnings
from importlib.metadata import EntryPoint
from typing import Literal

import numpy as np
import pytest

import tiltsim
from tests.docs.pages import code
from tiltsim.arrays.values import LiftError
from tiltsim.scenario.controller_packages import installed_controllers
from tiltsim_controllers.vehicle.actuators import held_gain

TARGET = {"type": "setpoint", "position": [0.3, 0.2, 0.5]}
PAGE = code("docs/controller_package.md", "python")[0]


@pytest.fixture(scope="module")
def hover(tmp_path_factory):
    """The page's function, in a file."""
    file = tmp_path_factory.mktemp("own") / "my_law.py"
    file.write_text(PAGE.partition("\n\n\nflight =")[0] + "\n", encoding="utf-8")
    return file


def document(file, duration=0.3, model="tiltrotor", **simulation):
    return {
        "vehicle": {"model": model},
        "reference": TARGET,
        "simulation": {"duration": duration, **simulation},
        "controller": {"law": "scalar", "function": f"{file}:hover"},
    }


@tiltsim.scalar
def helper(value):
    return 2.0 * value


@tiltsim.scalar
def climbing(observed):
    """Thrust grows with its own state, which grows with time."""
    each = 0.125 * observed.vehicle.mass * observed.vehicle.gravity + 0.05 * observed.states[0]
    each = helper(each)
    return (each, each, each, each), observed.reference.tilt_angles, (1.0,)


def clocked(**simulation):
    return tiltsim.load_scenario(
        {"simulation": {"duration": 0.2, **simulation}},
        {"controller.states": {"state_clock": "s"}, "controller.tilts": "free"},
        controller=climbing,
    )


def test_a_users_scalar_function_flies_natively_with_its_own_states_and_tilts():
    python, native = (tiltsim.simulate(clocked(engine=e)) for e in ("python", "native"))
    np.testing.assert_array_equal(python.samples, native.samples)
    assert python["state_clock"][-1] == pytest.approx(0.2, abs=1e-12)
    assert python.units["state_clock"] == "s"
    assert (python["thrusts"][-1] > python["thrusts"][0]).all()
    assert not python["tilt_angles"].any()


def test_it_flies_alike_on_both_plants_and_models(hover):
    first = tiltsim.simulate(document(hover, engine="python"))
    for other in ({"plant": "thesis"}, {"model": "quadrotor"}):
        flight = tiltsim.simulate(document(hover, engine="python", **other))
        # The plants differ by massless pods and the integrator only.
        assert np.abs(flight["position"] - first["position"]).max() < 1e-7, other


def test_the_page_shows_a_function_that_reaches_its_target(hover):
    flight = tiltsim.simulate(document(hover, 8.0, engine="python", plant="thesis", timestep=0.004))
    assert flight["position"][-1] == pytest.approx(TARGET["position"], abs=2e-3)


def test_an_edited_file_is_another_compiled_law(hover, tmp_path):
    edited = tmp_path / "my_law.py"
    edited.write_text(hover.read_text().replace("0.25 * lift", "0.26 * lift"))
    first, second = (
        tiltsim.simulate(document(file, 0.1, engine="native")) for file in (hover, edited)
    )
    assert np.abs(first.samples[-1] - second.samples[-1]).max() > 1e-6


@tiltsim.scalar
def three_thrusts(observed):
    return (1.0, 1.0, 1.0), (), ()


@tiltsim.scalar
def no_floats(observed):
    return (1.0, 1.0, 1.0, "1"), (), ()


@tiltsim.scalar
def of_two(observed, parameters):
    return (1.0, 1.0, 1.0, 1.0), (), ()


@tiltsim.scalar
def tilting(observed):
    return (1.0, 1.0, 1.0, 1.0), (0.1, 0.1, 0.1, 0.1), ()


@tiltsim.scalar
def misspelt(observed):
    return observed.nothing


@pytest.mark.parametrize(
    ("law", "message"),
    [
        (three_thrusts, "must return 4 thrusts"),
        (no_floats, "must return 4 thrusts"),
        (of_two, "must return 4 thrusts.*TypeError: .*missing 1 required positional argument"),
        (tilting, "the tilts .* if it commands them.* they make 16 controls"),
        (misspelt, r"AttributeError: .* \(test_scalar_law.py, line \d+\)"),
    ],
)
def test_a_law_that_returns_something_else_is_refused_before_the_flight(law, message):
    with pytest.raises(tiltsim.InputError, match=message):
        tiltsim.simulate({"reference": TARGET}, controller=law)


def test_a_function_that_is_no_scalar_code_is_refused(tmp_path):
    (tmp_path / "plain.py").write_text("def hover(observed):\n    return observed\n")
    with pytest.raises(tiltsim.InputError, match="is not marked with @tiltsim"):
        tiltsim.simulate(document(tmp_path / "plain.py"))


def test_a_held_rate_ends_where_the_lag_would_be():
    gain, step, bandwidth = held_gain(100.0, 0.01), 0.01, 100.0
    assert 1.0 - gain * step == pytest.approx(np.exp(-bandwidth * step), rel=1e-12)
    assert held_gain(bandwidth, 0.0) == bandwidth


class Lawless(tiltsim.ScalarController):
    """Of a package whose author forgot the method."""

    law: Literal["lawless"]


def entries(monkeypatch, *found):
    monkeypatch.setattr(
        importlib.metadata,
        "entry_points",
        lambda group: [EntryPoint(name, value, group) for name, value in found],
    )
    monkeypatch.setattr(
        "tiltsim.scenario.controller_packages.entry_points", importlib.metadata.entry_points
    )


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        (("gone", "no_such_package:Table"), "ModuleNotFoundError"),
        (("other", "json:JSONDecoder"), "is no subclass of tiltsim.ScalarController"),
        (("geometric", "tiltsim:ScalarController"), "has a law of this name"),
        (("lawless", f"{__name__}:Lawless"), r"Lawless has no method scalar_law"),
        (
            ("renamed", "tiltsim.scenario.baseline_controllers:GeometricController"),
            'needs the field law: Literal\\["renamed"\\]',
        ),
    ],
)
def test_a_package_that_cannot_be_used_is_left_out_with_a_warning(entry, message, monkeypatch):
    entries(monkeypatch, entry)
    with pytest.warns(RuntimeWarning, match=message):
        assert installed_controllers({"geometric"}) == {}


def test_a_controller_without_a_law_cannot_be_made():
    with pytest.raises(TypeError, match=r"abstract method '?scalar_law"):
        Lawless(law="lawless")  # type: ignore[abstract]


def test_a_package_is_found(monkeypatch):
    table = "tiltsim.scenario.baseline_controllers:GeometricController"
    entries(monkeypatch, ("geometric", table))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert [*installed_controllers(())] == ["geometric"]


def test_a_function_without_source_is_refused():
    text = """
@tiltsim.scalar
def hover(observed):
    each = 0.25 * observed.vehicle.mass * observed.vehicle.gravity
    return (each, each, each, each), (), ()
"""
    names = {"__name__": "shell", "tiltsim": tiltsim}
    exec(text, names)
    short = {"reference": TARGET, "simulation": {"duration": 0.01}}
    with pytest.raises(LiftError, match="hover: its source is not in <string>"):
        tiltsim.simulate(short, controller=names["hover"])
