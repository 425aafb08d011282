"""Laws of the user's, of packages, and the loop that they share with the baselines."""

from __future__ import annotations

import importlib.metadata
import warnings
from importlib.metadata import EntryPoint
from typing import ClassVar, Literal

import numpy as np
import pytest
from pydantic import Field

import tiltsim
from tests.docs.pages import code
from tiltsim import xp
from tiltsim.scenario.controller import installed_controllers
from tiltsim_controllers.vehicle.actuators import held_gain

TARGET = {"type": "setpoint", "position": [0.3, 0.2, 0.5]}
PAGE = code("docs/controller_package.md", "python")[0]
ONES = xp.array([1.0, 1.0, 1.0, 1.0])


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
        "controller": {"law": "numpy", "function": f"{file}:hover"},
    }


@tiltsim.law
def climbing(observed):
    """Thrust grows with its own state, which grows with time."""
    weight = observed.vehicle.mass * observed.vehicle.gravity
    each = 0.25 * weight + 0.1 * observed.states[0]
    tilts = observed.reference.tilt_angles
    return tiltsim.Command(thrusts=each * ONES, tilt_angles=tilts, rates=[1.0])


def clocked(**simulation):
    return tiltsim.load_scenario(
        {"simulation": {"duration": 0.2, **simulation}},
        {"controller.states": {"state_clock": "s"}, "controller.tilts": "free"},
        controller=climbing,
    )


def test_a_users_law_flies_natively_with_its_own_states_and_tilts():
    python, native = (tiltsim.simulate(clocked(engine=e)) for e in ("python", "native"))
    np.testing.assert_array_equal(python.samples, native.samples)
    assert python["state_clock"][-1] == pytest.approx(0.2, abs=1e-12)
    assert python.units["state_clock"] == "s"
    assert (python["thrusts"][-1] > python["thrusts"][0]).all()
    assert not python["tilt_angles"].any()


def test_a_flown_law_flies_alike_on_both_plants_and_models(hover):
    first = tiltsim.simulate(document(hover, engine="python"))
    for other in ({"plant": "thesis"}, {"model": "quadrotor"}):
        flight = tiltsim.simulate(document(hover, engine="python", **other))
        # The plants differ by massless pods and the integrator only.
        assert np.abs(flight["position"] - first["position"]).max() < 1e-7, other


def test_the_page_shows_a_function_that_reaches_its_target(hover):
    flight = tiltsim.simulate(document(hover, 8.0, engine="python", plant="thesis", timestep=0.004))
    assert flight["position"][-1] == pytest.approx(TARGET["position"], abs=2e-3)


def test_a_marked_function_of_a_file_is_flown_as_a_law(hover):
    tables = document(hover, 0.1)
    other = {**tables, "controller": {"law": "attitude_altitude"}}
    given = tiltsim.simulate(other, controller=f"{hover}:hover")
    np.testing.assert_array_equal(given.samples, tiltsim.simulate(tables).samples)
    tables["controller"]["law"] = "python"
    with pytest.raises(tiltsim.InputError, match=r'law of arrays; .* controller.law = "numpy"'):
        tiltsim.simulate(tables)


def test_an_edited_file_is_another_compiled_law(hover, tmp_path):
    edited = tmp_path / "my_law.py"
    edited.write_text(hover.read_text().replace("* (body.gravity", "* 1.04 * (body.gravity"))
    first, second = (
        tiltsim.simulate(document(file, 0.1, engine="native")) for file in (hover, edited)
    )
    assert np.abs(first.samples[-1] - second.samples[-1]).max() > 1e-6


def test_a_python_function_is_a_law_as_it_is():
    """The first example of the page on Python functions, with rotors that lag by 2 ms."""
    names = {}
    exec(code("docs/own_controller.md", "python")[0].partition("\n\n\nscenario =")[0], names)
    law = tiltsim.law(lambda observed: names["hover"](observed))
    tables = {
        "gait": {"type": "fixed"},
        "reference": {"type": "setpoint", "position": [2.0, 0.0, 1.0]},
        "initial": {"rotor_speed": 361.4},
        "simulation": {"duration": 1.0},
    }
    called = tiltsim.simulate(tables, controller=names["hover"])
    fast = {"controller.rotor_bandwidth": 500.0}
    compiled = tiltsim.simulate(tiltsim.load_scenario(tables, fast, controller=law))
    assert compiled.scenario.simulation.engine == "auto"
    difference = np.abs(compiled["position"] - called["position"]).max()
    assert 1e-6 < difference < 0.01


def level(observed):
    return 0.25 * observed.vehicle.mass * observed.vehicle.gravity


@tiltsim.law
def by_thrusts(observed):
    return tiltsim.Command(thrusts=1.1 * level(observed) * ONES)


@tiltsim.law
def by_speeds(observed):
    speed = xp.sqrt(1.1 * level(observed) / observed.vehicle.thrust_coefficient)
    return tiltsim.Command(rotor_speeds=speed * ONES)


@tiltsim.law
def by_accelerations(observed):
    speed = xp.sqrt(1.1 * level(observed) / observed.vehicle.thrust_coefficient)
    return tiltsim.Command(rotor_accelerations=100.0 * (speed - observed.rotor_speeds))


def test_rotors_are_commanded_by_thrusts_speeds_or_accelerations():
    laws = by_thrusts, by_speeds, by_accelerations
    first, *others = (
        tiltsim.simulate({"simulation": {"duration": 0.1}}, controller=law) for law in laws
    )
    assert first["rotor_speed_2"][-1] > 301.0
    for other in others:
        np.testing.assert_allclose(other.samples, first.samples, rtol=1e-9, atol=1e-12)


@tiltsim.law
def counting(observed):
    """A flag, a counter and a queue of two times."""
    flag, count, newest, _ = observed.discrete
    flag = xp.where(count > 3.5, 1.0, flag)
    thrusts = level(observed) * (1.0 + 0.1 * flag) * ONES
    following = xp.array([flag, count + 1.0, observed.time, newest])
    return tiltsim.Command(thrusts=thrusts, discrete=following)


DISCRETE = {f"state_{name}": "1" for name in ("flag", "count", "newest", "older")}


def counted(step=0.01, **simulation):
    timing = {"duration": 0.1, "control_timestep": step, "record_timestep": 0.01, **simulation}
    return tiltsim.load_scenario(
        {"simulation": timing}, {"controller.discrete_states": DISCRETE}, controller=counting
    )


@pytest.mark.parametrize("plant", ["mujoco", "thesis"])
def test_discrete_states_change_at_control_samples(plant):
    python, native = (
        tiltsim.simulate(counted(engine=engine, plant=plant)) for engine in ("python", "native")
    )
    np.testing.assert_array_equal(python.samples, native.samples)
    samples = np.arange(11.0)
    np.testing.assert_allclose(python["state_count"], samples, atol=1e-9)
    np.testing.assert_allclose(python["state_flag"], samples > 4.5, atol=1e-9)
    np.testing.assert_allclose(python["state_newest"][1:], 0.01 * samples[:-1], atol=1e-9)
    np.testing.assert_allclose(python["state_older"][2:], 0.01 * samples[:-2], atol=1e-9)


def test_discrete_states_need_control_samples():
    with pytest.raises(tiltsim.InputError, match=r"simulation\.control_timestep = 0: must be"):
        tiltsim.simulate(counted(0.0))


class Climb(tiltsim.LawController):
    """Altitude only."""

    gains: tuple[float, float] = Field((4.0, 4.0), description="of the altitude [1/s^2, 1/s]")
    share: float = Field(1.0, gt=0.0, description="of the weight [-]")

    states: ClassVar = {"state_integral": "m s"}
    discrete_states: ClassVar = {"state_count": "1"}

    @staticmethod
    def control(observed, p):
        error = observed.reference.position[2] - observed.position[2]
        rise = p.gains[0] * error - p.gains[1] * observed.velocity[2]
        each = 0.25 * observed.vehicle.mass * (p.share * observed.vehicle.gravity + rise)
        return tiltsim.Command(
            thrusts=each * ONES, rates=[error], discrete=observed.discrete + p.share
        )


class Namesake(Climb):
    """Keys that are called like keys of tables of the library which this one has not."""

    observer: float = Field(2.0, description="factor on the gains [-]")
    tilts: float = Field(3.0, description="likewise [-]")
    mixer: Literal["halved", "whole"] = Field("whole", description="part of the thrust")


UP = {
    "reference": {"type": "setpoint", "position": [0.0, 0.0, 0.5]},
    "simulation": {"duration": 0.2, "control_timestep": 0.01},
}


def test_a_law_reads_keys_that_are_called_like_keys_of_other_tables():
    read = Namesake(law="numpy", share=1.5).law_parameters(None)
    assert read._asdict() == {
        "gains": (4.0, 4.0), "share": 1.5, "observer": 2.0, "tilts": 3.0, "mixer": 1.0
    }  # fmt: skip
    assert not {"rotor_bandwidth", "estimator", "allow_unstable"} & {*read._fields}


def test_a_class_has_keys_and_states():
    default, object_, file = (
        tiltsim.simulate(scenario)
        for scenario in (
            tiltsim.load_scenario(UP, controller=Climb),
            tiltsim.load_scenario(UP, controller=Climb(law="numpy", share=1.5)),
            tiltsim.load_scenario(UP, {"controller.parameters.share": 1.5}, controller=Climb),
        )
    )
    assert default["state_count"][-1] == pytest.approx(20.0)
    assert object_["state_count"][-1] == pytest.approx(30.0)
    assert object_["z"][-1] > default["z"][-1] + 0.01
    np.testing.assert_array_equal(file.samples, object_.samples)
    assert object_.scenario.controller.parameters == {"share": 1.5}
    one, other = default.assembly.loop, object_.assembly.loop
    assert one is other  # they share their compiled code


def test_keys_of_a_class_have_bounds():
    for keys, message in (
        ({"share": -1.0}, r"controller.parameters.share = -1.0: must be greater than 0"),
        ({"shares": 1.0}, r"controller.parameters.shares = 1.0: unknown key; did you mean share"),
    ):
        scenario = tiltsim.load_scenario(UP, {"controller.parameters": keys}, controller=Climb)
        with pytest.raises(tiltsim.InputError, match=message):
            tiltsim.simulate(scenario)


def test_a_function_has_no_parameters():
    scenario = tiltsim.load_scenario(
        UP, {"controller.parameters": {"k": 1.0}}, controller=by_speeds
    )
    with pytest.raises(tiltsim.InputError, match="by_speeds is a function, which has none"):
        tiltsim.simulate(scenario)


@tiltsim.law
def branching(observed):
    if observed.position[2] > 1.0:
        return tiltsim.Command(thrusts=ONES)
    return by_thrusts(observed)


@tiltsim.law
def solving(observed):
    gain = np.linalg.solve(np.eye(3), observed.position)
    return tiltsim.Command(thrusts=(1.1 + 0.0 * gain[0]) * level(observed) * ONES)


@pytest.mark.parametrize(
    ("law", "message"),
    [
        (branching, r"test_flown_law.py:\d+: `if observed.*write xp.where.*as plain Python"),
        (solving, r"test_flown_law.py:\d+: .*solve.*write tiltsim.xp.*as plain Python"),
    ],
)
@pytest.mark.parametrize("plant", ["mujoco", "thesis"])
def test_a_law_that_cannot_be_traced_flies_as_plain_python(law, message, plant):
    tables = {"simulation": {"duration": 0.05, "plant": plant, "engine": "native"}}
    with pytest.warns(RuntimeWarning, match=message) as shown:
        plain = tiltsim.simulate(tables, controller=law)
    assert [warning.filename for warning in shown] == [__file__]
    compiled = tiltsim.simulate(tables, controller=by_thrusts)
    np.testing.assert_allclose(plain.samples, compiled.samples, rtol=1e-9, atol=1e-12)


def test_arrays_refuse_a_law_that_cannot_be_traced():
    pytest.importorskip("jax")
    tables = {"simulation": {"duration": 0.05, "plant": "thesis", "engine": "jax"}}
    with pytest.raises(tiltsim.InputError, match=r'engine = "jax": the law .*branching cannot be'):
        tiltsim.simulate(tables, controller=branching)


@tiltsim.law
def three_thrusts(observed):
    return tiltsim.Command(thrusts=[1.0, 1.0, 1.0])


@tiltsim.law
def no_numbers(observed):
    return tiltsim.Command(thrusts=[1.0, 1.0, 1.0, "a"])


@tiltsim.law
def no_command(observed):
    return ONES


@tiltsim.law
def nothing_for_rotors(observed):
    return tiltsim.Command(rates=[1.0])


@tiltsim.law
def of_two(observed, parameters):
    return tiltsim.Command(thrusts=ONES)


@tiltsim.law
def tilting(observed):
    return tiltsim.Command(thrusts=ONES, tilt_angles=0.1 * ONES)


@tiltsim.law
def with_state(observed):
    return tiltsim.Command(thrusts=ONES, rates=[1.0])


@tiltsim.law
def with_flag(observed):
    return tiltsim.Command(thrusts=ONES, discrete=[1.0])


@tiltsim.law
def misspelt(observed):
    return observed.nothing


@pytest.mark.parametrize(
    ("law", "message"),
    [
        (three_thrusts, r"the law returned thrusts of shape \(3,\); expected shape \(4,\)"),
        (no_numbers, "returned thrusts = .*; expected 4 numbers"),
        (no_command, r"returned array\(.*; expected .*, as in tiltsim.Command\(thrusts="),
        (nothing_for_rotors, "returned nothing for the rotors; expected one of thrusts"),
        (of_two, "TypeError: .*missing 1 required positional argument"),
        (tilting, "returned tilt_angles; needs controller.tilts = free"),
        (with_state, r"returned rates of shape \(1,\); expected shape \(0,\)"),
        (with_flag, "returned discrete; name these states in controller.discrete_states"),
        (misspelt, r"AttributeError: .* \(.*test_flown_law.py:\d+\)"),
    ],
)
def test_a_law_that_returns_something_else_is_refused_before_the_flight(law, message):
    with pytest.raises(tiltsim.InputError, match=message):
        tiltsim.simulate({"reference": TARGET}, controller=law)


def test_a_held_rate_ends_where_the_lag_would_be():
    gain, step, bandwidth = held_gain(100.0, 0.01), 0.01, 100.0
    assert 1.0 - gain * step == pytest.approx(np.exp(-bandwidth * step), rel=1e-12)
    assert held_gain(bandwidth, 0.0) == bandwidth


class Lawless(tiltsim.LawController):
    """For a package whose author forgot the method."""

    law: Literal["lawless"]


def entries(monkeypatch, *found):
    monkeypatch.setattr(
        importlib.metadata,
        "entry_points",
        lambda group: [EntryPoint(name, value, group) for name, value in found],
    )
    monkeypatch.setattr("tiltsim.scenario.controller.entry_points", importlib.metadata.entry_points)


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        (("gone", "no_such_package:Table"), "ModuleNotFoundError"),
        (("other", "json:JSONDecoder"), "is no subclass of tiltsim.LawController"),
        (("geometric", "tiltsim:LawController"), "has a law of this name"),
        (("lawless", f"{__name__}:Lawless"), r"Lawless has no method control"),
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
    with pytest.raises(TypeError, match=r"abstract method '?control"):
        Lawless(law="lawless")  # type: ignore[abstract]


def test_a_package_is_found(monkeypatch):
    table = "tiltsim.scenario.baseline_controllers:GeometricController"
    entries(monkeypatch, ("geometric", table))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert [*installed_controllers(())] == ["geometric"]


def test_a_law_needs_no_file():
    text = """
@tiltsim.law
def hover(observed):
    each = 0.25 * observed.vehicle.mass * observed.vehicle.gravity
    return tiltsim.Command(thrusts=[each, each, each, each])
"""
    names = {"__name__": "shell", "tiltsim": tiltsim}
    exec(text, names)
    short = {"reference": TARGET, "simulation": {"duration": 0.01, "engine": "native"}}
    assert tiltsim.simulate(short, controller=names["hover"]).end.kind == "completed"
