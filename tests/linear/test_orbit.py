"""Periodic orbits and their multipliers."""

from __future__ import annotations

import os
from types import SimpleNamespace

import numpy as np
import pytest

import tiltsim
from tests.linear.test_rest import SETPOINT, distance
from tiltsim.commands.stability import stability_text
from tiltsim.laws.assembling import assemble
from tiltsim.linear.coordinates import vehicles_of
from tiltsim.linear.equilibrium import equilibrium_of
from tiltsim.linear.forcing import forcing_of
from tiltsim.linear.mujoco_motion import make_motion
from tiltsim.linear.newton import derivative_at
from tiltsim.linear.stability import Point, crossings, stability_at, sweep_stability
from tiltsim_controllers.tilt_car.cycles import Swing, limit_cycle, multipliers
from tiltsim_controllers.tilt_car.laws import PLANNED_GAINS

QUICK = {"simulation.engine": "python", "simulation.duration": 1.0}
"""A short flight that needs nothing compiled."""


def gait(kind, plant="thesis", **keys):
    """The published controller at a set point with a quick gait."""
    shape = {"gait.amplitude": 0.5}
    if kind == "two_color":  # a circle on the red surface
        shape = {"gait.centre": [0.3, -0.3], "gait.radius": 0.1}
    gait = {"gait.type": kind, "gait.period": 0.1, **shape, **keys}
    return tiltsim.load_scenario(
        SETPOINT, {"simulation.plant": plant, "simulation.timestep": 0.0025, **QUICK, **gait}
    )


@pytest.fixture(scope="module")
def continuous():
    """The orbit of a continuous trot on the thesis's equations."""
    return equilibrium_of(gait("trot_continuous"))


def test_the_multipliers_agree_with_the_product_of_exact_steps(continuous):
    """Symbolic Jacobians of ode3's steps along the orbit, one after the other."""
    casadi = pytest.importorskip("casadi")
    motion, state = continuous.motion, continuous.root.state
    closed_loop = tiltsim.symbolic(motion.scenario).closed_loop
    at, time = casadi.SX.sym("at", len(state)), casadi.SX.sym("time")
    step = motion.scenario.simulation.timestep
    k1 = closed_loop(time, at)
    k2 = closed_loop(time + 0.5 * step, at + 0.5 * step * k1)
    k3 = closed_loop(time + 0.75 * step, at + 0.75 * step * k2)
    after = at + step * (2.0 * k1 + 3.0 * k2 + 4.0 * k3) / 9.0
    exact = casadi.Function("step", [time, at], [after, casadi.jacobian(after, at)])
    product = derivative_at(lambda moved: moved, motion.coordinates, state)
    for index in range(continuous.steps):
        state, jacobian = (value.full() for value in exact(index * step, state))
        product = jacobian @ product
    end = state.ravel()
    columns = [motion.coordinates.rates(end, column) for column in product.T]
    expected = np.linalg.eigvals(np.array(columns).T)
    assert distance(stability_at(continuous).multipliers, expected) < 1e-7


def test_modes_lost_in_the_rounding_of_a_period_are_not_listed():
    """Servos of 300 rad/s, seen from a period of 2 s, are no modes of 14 rad/s."""
    orbit = SimpleNamespace(
        matrix=np.diag([0.5, -1e-12]),
        timestep=2.0,
        minimal=SimpleNamespace(names=("z", "alpha_1")),
        is_orbit=True,
        root=SimpleNamespace(residual=0.0),
        motion=SimpleNamespace(prefixes=()),
        left_out=(),
        corners=(),
    )
    found = stability_at(orbit)
    assert [mode.name for mode in found.modes] == ["altitude"]
    assert len(found.multipliers) == 2
    assert "not listed" in stability_text(found)


@pytest.mark.slow
@pytest.mark.parametrize("plant", ["thesis", "mujoco"])
@pytest.mark.parametrize("kind", ["trot_continuous", "trot_instant", "walk", "two_color"])
def test_the_multipliers_agree_with_native_flights_over_a_period(kind, plant):
    """Simple differences of second order, with the step at which they are best, near 1e-5."""
    scale = 0.5 if kind == "walk" else 1.0  # scaled up, MuJoCo's servos do not follow it
    keys = {"gait.period": 0.05, "gait.scale": scale}
    found = equilibrium_of(gait(kind, plant, **keys))  # by the Python engine
    motion, start = make_motion(found.motion.scenario, "native"), found.root.state
    coordinates, columns = motion.coordinates, []
    for moved in 1e-5 * np.eye(coordinates.size)[found.kept]:
        ends = (coordinates.moved(start, by) for by in (moved, -moved))
        after, before = (
            coordinates.between(start, motion.flown(found.step, end, found.steps)) for end in ends
        )
        columns.append((after - before)[found.kept] / 2e-5)
    flown = np.linalg.eigvals(np.array(columns).T)
    assert distance(stability_at(found).multipliers, flown) < 1e-4


SLOW_ROTORS = {
    "vehicle.rotor_time_constant": 0.06,
    "gait.amplitude": 0.3,
    "controller.decoupling": "exact",
    "controller.decoupler": "exact",
    "controller.gains": "exact",
    "controller.allow_unstable": True,
}
"""Too slow for the gains: the vehicle swings ever more."""


@pytest.mark.parametrize(
    ("kind", "plant", "keys", "stable"),
    [
        ("trot_instant", "thesis", {}, True),
        pytest.param("trot_instant", "mujoco", {}, True, marks=pytest.mark.slow),
        pytest.param("trot_continuous", "mujoco", SLOW_ROTORS, False, marks=pytest.mark.slow),
    ],
)
def test_a_disturbance_grows_or_decays_by_the_largest_multiplier(kind, plant, keys, stable):
    """Measured over two periods, to a thousandth."""
    found = equilibrium_of(gait(kind, plant, **keys))
    largest, growth = growth_in_flight(found, 2)
    assert growth == pytest.approx(largest, rel=1e-3)
    assert (largest < 1.0) == stability_at(found).stable == stable
    assert found.root.residual < 1e-9


def growth_in_flight(found, periods):
    """Size of the largest multiplier, and growth of a disturbance per period as flown.

    A left eigenvector gives the distance of a state along the mode.
    """
    motion, start = found.motion, found.root.state
    values, left = np.linalg.eig(found.matrix.T)
    largest = int(np.argmax(np.abs(values)))
    along = left[:, largest]
    direction = np.zeros(motion.coordinates.size)
    direction[found.kept] = 1e-4 * (along / np.abs(along).max()).real
    disturbed = motion.coordinates.moved(start, direction)
    before = abs(along @ direction[found.kept])
    end = motion.flown(0, disturbed, periods * found.steps)
    after = abs(along @ motion.coordinates.between(start, end)[found.kept])
    return abs(values[largest]), (after / before) ** (1.0 / periods)


def test_the_penguin_gait_agrees_with_the_map_of_half_a_period():
    """Its mirrored map has 0.2199 +- 0.1942i.

    Steps of 5 ms do not end where a rotor stops: an error of first order in the step.
    """
    scenario = tiltsim.load_scenario(
        "ch11_penguin/straight_line#large",
        {"simulation.plant": "thesis", "simulation.timestep": 0.005, **QUICK},
    )
    flights = []
    found = tiltsim.stability(scenario, progress=flights.append)
    swing = Swing(half_angle=np.pi / 6.0, half_period=1.0, gains=PLANNED_GAINS["ch11"])
    half = multipliers(swing, limit_cycle(swing))
    assert found.period == pytest.approx(2.0)
    assert distance(np.sqrt(found.multipliers), half) < 2e-3
    assert found.report()["kind"] == "orbit"
    assert flights == list(range(1, len(flights) + 1))
    assert len(flights) > 6 * len(found.states)  # for the derivative alone


def test_a_flight_repeats_when_gait_and_circle_share_a_period():
    """Three trots of 0.1 s on a circle of 0.3 s; with an irrational ratio nothing repeats."""
    circle = {"reference.type": "circle", "reference.radius": 0.1}
    turning = {"reference.angular_frequency": 2.0 * np.pi / 0.3}
    scenario = gait("trot_continuous", **circle, **turning)
    assert forcing_of(vehicles_of(assemble(scenario))).period == pytest.approx(0.3)
    with pytest.raises(tiltsim.InputError, match="no common multiple"):
        tiltsim.stability(scenario.replace({"gait.period": 0.1 * 2.0**0.5}))


def with_altitude_gain(gain):
    """The stability at rest with another third gain of the altitude loop, s^3 + 2 s^2 + 1.5 s."""
    gains = {
        "attitude": [[1, 1, 1], [10, 10, 1], [50, 50, 1]],
        "altitude": [2.0, 1.5, gain],
        "position": [1, 1],
    }
    changes = {"simulation.plant": "thesis", "controller.gains": gains}
    scenario = tiltsim.load_scenario(SETPOINT, {**changes, "controller.allow_unstable": True})
    return Point(gain, tiltsim.stability(scenario))


def test_crossings_tell_where_stability_is_lost():
    """By Routh's criterion where the third gain is the product of the others."""
    (crossing,) = crossings([with_altitude_gain(gain) for gain in (2.0, 2.9, 3.1)])
    assert crossing.leaves
    assert crossing.value == pytest.approx(3.0, abs=0.01)


def test_a_sweep_keeps_what_is_found_and_why_nothing_is():
    scenario = tiltsim.load_scenario(SETPOINT, {"simulation.plant": "thesis"})
    noisy = scenario.replace({"sensors.velocity_noise": 0.1})
    (found,) = sweep_stability(scenario, "vehicle.mass", [0.5])
    (refused,) = sweep_stability(noisy, "vehicle.mass", [0.5])
    assert found.report()["stable"]
    assert 0.0 < found.largest < 1.0
    assert (refused.largest, refused.report()["stable"]) == (None, None)
    assert "noise" in refused.reason


def test_an_orbit_is_sought_near_the_neighboring_orbit_first(continuous):
    """From the orbit itself there is nothing left to do but the derivative, of six evaluations."""
    flights = []
    near = equilibrium_of(
        gait("trot_continuous"), near=continuous.root.state, progress=flights.append
    )
    assert near.root.state == pytest.approx(continuous.root.state, abs=1e-9)
    assert len(flights) < 6 * len(continuous.minimal.names) + 10  # periods in which it would settle


def test_an_orbit_of_too_many_steps_is_refused_at_once():
    endless = gait("trot_continuous").replace({"gait.period": 1000.0})
    with pytest.raises(tiltsim.InputError, match="an orbit has at most 200000"):
        tiltsim.stability(endless)


@pytest.mark.slow
@pytest.mark.parametrize("plant", ["thesis", "mujoco"])
def test_flights_on_all_cores_end_as_single_ones(plant, monkeypatch):
    """More of them than a batch has rows; the lost one is lost alone."""
    monkeypatch.setattr("tiltsim.linear.motion.LONG", 10)
    motion = make_motion(gait("trot_continuous", plant), "native")
    offsets = np.linspace(-0.1, 0.1, 4 * os.cpu_count() + 3)
    states = [motion.initial + offset * np.eye(len(motion.initial))[0] for offset in offsets]
    states[1][-1] = 1e11  # a rotor's speed: MuJoCo resets the state
    together = list(motion.flown_each(4, states, 20))
    alone = [motion.flown(4, state, 20) for state in states]
    np.testing.assert_array_equal(together, alone)
    assert np.isnan(together[1]).all()
    assert np.isfinite(np.delete(together, 1, axis=0)).all()


@pytest.mark.slow
def test_a_long_orbit_takes_one_derivative():
    """12,567 steps: the flight settles within ten periods, so Newton has little left to do."""
    circle = {"reference.type": "circle", "reference.radius": 1.0}
    changes = {**circle, "reference.angular_frequency": 0.5, "simulation.engine": "native"}
    scenario = tiltsim.load_scenario(SETPOINT, {"simulation.plant": "thesis", **changes})
    flights = []
    found = tiltsim.stability(scenario, progress=flights.append)
    assert found.equilibrium.steps == 12_567
    assert len(flights) < 2 * 2 * len(found.states)  # one has two for each state
    altitude = tiltsim.stability(scenario.replace({"reference.type": "setpoint"})).poles[0].real
    assert abs(found.multipliers[0]) == pytest.approx(np.exp(altitude * found.period), rel=1e-4)


@pytest.mark.slow
def test_scenarios_that_do_not_return_are_refused():
    """A gait that reaches singular attitudes."""
    lost = gait("trot_continuous").replace({"gait.amplitude": 1.5})
    with pytest.raises(tiltsim.InputError, match="found no periodic orbit near its flight"):
        tiltsim.stability(lost)


def test_an_orbit_at_the_edge_of_a_dead_zone_says_so():
    """A tilt-car that follows its line needs no thrust: its rotors push, and cannot pull."""
    car = {
        "vehicle": {"model": "tilt_car"},
        "controller": {"law": "tilt_car_planned_direction"},
        "gait": {"type": "penguin_small", "period": 0.5},
        "reference": {"type": "line", "velocity": [0.5, 0.0, 0.0]},
        "simulation": {"plant": "thesis"},
    }
    found = tiltsim.stability(car)
    assert found.corners == ("x", "y", "vx", "vy")
    assert "a limit or dead zone" in stability_text(found)
