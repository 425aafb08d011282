"""The baselines against the claims of their sources, on every plant and engine."""

from __future__ import annotations

import numpy as np
import pytest

import tiltsim
from tests.laws.test_laws import GUST
from tests.laws.test_multirotor import TILTS, mjcf
from tiltsim_controllers.mathematics.rotation import rotation_from_euler

CIRCLE = {"type": "circle", "radius": 1.0, "angular_frequency": 0.5}
ON_CIRCLE = {"position": [1.0, 0.0, 0.0], "velocity": [0.0, 0.5, 0.0]}
TROT = {"type": "trot_continuous", "amplitude": 0.3, "period": 1.0}
FREE = {"law": "geometric", "tilts": "free"}
BASELINES = {
    "geometric": {"controller": {"law": "geometric"}, "gait": TROT, "disturbance": GUST},
    "geometric free": {"controller": FREE, "reference": {"type": "setpoint", "roll": 0.2}},
    "geometric quadrotor": {"controller": {"law": "geometric"}, "vehicle": {"model": "quadrotor"}},
    "geometric multirotor": {
        "controller": {"law": "geometric"},
        "vehicle": {"model": "multirotor", "mjcf": mjcf("tilt_hexarotor")},
        "gait": TILTS,
    },
}


def fly(tables, **simulation):
    simulation = {"duration": 0.3, "engine": "python", **simulation}
    flight = tiltsim.simulate(
        {"reference": CIRCLE, "initial": ON_CIRCLE, **tables, "simulation": simulation}
    )
    assert flight.end.kind == "completed", flight.end
    return flight


@pytest.mark.parametrize("name", BASELINES)
def test_the_plants_agree(name):
    mujoco, thesis = (fly(BASELINES[name], plant=plant) for plant in ("mujoco", "thesis"))
    # A servo that leads its command still lags by alpha'' / omega^2: for the gait 1.3e-4 rad, which
    # turns gravity for 0.3 s; for tilts that the law turns at once 2e-3 rad, for 0.05 s.
    bound = 3e-4 if "free" in name else 1e-4
    assert np.abs(mujoco["position"] - thesis["position"]).max() < bound


NATIVE = ("geometric", "geometric free")


@pytest.mark.slow
@pytest.mark.parametrize("name", NATIVE)
@pytest.mark.parametrize("plant", ["mujoco", "thesis"])
def test_native_flights_are_those_in_python(name, plant):
    for timing in ({}, {"control_timestep": 0.004}):
        python, native = (
            fly(BASELINES[name], plant=plant, engine=engine, **timing)
            for engine in ("python", "native")
        )
        np.testing.assert_array_equal(python.samples, native.samples)


INERTIA = np.array([2.24e-3, 2.99e-3, 4.80e-3])  # kg m^2, of the ar_drone_2


@pytest.fixture(scope="module")
def turned_over():
    """From 179 degrees of roll, with a position loop too slow to matter and fast rotors."""
    controller = {"law": "geometric", "position_bandwidth": 1e-3, "rotor_bandwidth": 2000.0}
    start = {"attitude": [np.radians(179.0), 0.0, 0.0], "position": [0.0, 0.0, 0.0]}
    tables = {"controller": controller, "reference": {"type": "setpoint"}, "initial": start}
    timing = {"duration": 2.0, "timestep": 5e-4, "record_timestep": 0.005, "plant": "thesis"}
    return fly({**tables, "vehicle": {"model": "quadrotor"}}, **timing)


def test_geometric_attitude_converges_exponentially_from_179_degrees(turned_over):
    """Lee et al. 2010, Proposition 1 and its proof: V(t) <= V(0) exp(-beta t)."""
    omega = turned_over["body_rates"]
    rotations = [np.reshape(rotation_from_euler(*a), (3, 3)) for a in turned_over["attitude"]]
    error = np.array([(r - r.T)[[2, 0, 1], [1, 2, 0]] for r in rotations]) / 2.0
    psi = np.array([1.5 - 0.5 * np.trace(r) for r in rotations])
    stiffness, damping = INERTIA.mean() * 100.0, 2.0 * INERTIA.mean() * 10.0
    low, high = INERTIA.min(), INERTIA.max()
    # c, below the bound of the proof.
    c = 0.5 * min(
        damping,
        4.0 * damping * stiffness * low**2 / (damping**2 * high + 4.0 * stiffness * low**2),
        np.sqrt(stiffness * low),
    )
    value = 0.5 * (INERTIA * omega**2).sum(1) + stiffness * psi + c * (error * omega).sum(1)
    across = -c * damping / (2.0 * low)
    decrease = np.array([[c * stiffness / high, across], [across, damping - c]])
    above = 0.5 * np.array([[2.0 * stiffness / (2.0 - psi[0]), c], [c, high]])
    beta = np.linalg.eigvalsh(decrease)[0] / np.linalg.eigvalsh(above)[-1]
    assert beta > 0.0
    assert psi[0] == pytest.approx(2.0, abs=1e-3)
    time = turned_over["time"]
    assert (value <= value[0] * np.exp(-beta * time) * (1.0 + 1e-3)).all()
    assert psi[-1] < 1e-4


def test_geometric_attitude_ends_at_the_slow_pole_of_its_linearization(turned_over):
    stiffness, damping = INERTIA.mean() * 100.0, 2.0 * INERTIA.mean() * 10.0
    slow = np.roots([INERTIA[0], damping, stiffness]).max()
    time, roll = turned_over["time"], np.abs(turned_over["attitude"][:, 0])
    last = (time > 1.6) & (roll > 1e-6)
    slope = np.polyfit(time[last], np.log(roll[last]), 1)[0]
    # The rotors' lag of 0.5 ms moves the pole by the order of its product with it.
    assert slope == pytest.approx(slow, rel=0.01)


def test_free_tilts_hold_a_pose_that_a_gait_cannot():
    tables = {
        "controller": FREE,
        "reference": {"type": "setpoint", "roll": 0.3, "pitch": -0.2},
        "initial": {},
    }
    flight = fly(tables, plant="thesis", duration=4.0, timestep=0.004)
    assert flight["attitude"][-1] == pytest.approx([0.3, -0.2, 0.0], abs=1e-4)
    assert np.abs(flight["position"][-1]).max() < 1e-3


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ({"controller": FREE, "vehicle": {"model": "quadrotor"}}, "do not tilt"),
        ({"controller": FREE, "gait": TROT}, "commands the tilts itself"),
        (
            {"controller": {"law": "geometric"}, "reference": {"type": "setpoint", "roll": 0.1}},
            "is an output of the law with controller.tilts = free only",
        ),
        (
            {"controller": {"law": "geometric", "tilt_bandwidth": 5.0}},
            "needs controller.tilts = free",
        ),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(tables, message):
    with pytest.raises(tiltsim.InputError, match=message):
        tiltsim.load_scenario(tables)
