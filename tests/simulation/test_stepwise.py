"""Flights that are stepped by their caller."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import tiltsim
from tests.flights import TILT_CAR
from tiltsim.laws.assembling import assemble
from tiltsim.vehicles.rotorcraft import layout_of

TROT = {
    "simulation": {"duration": 0.02, "control_timestep": 0.002, "record_timestep": 0.01},
    "gait": {"type": "trot_continuous", "amplitude": 0.3, "period": 2.0},
    "controller": {"decoupling": "exact", "gains": "exact"},
    "initial": {"attitude": [0.05, -0.05, 0.1]},
}
DRAG = {"wind": [3.0, 0.0, 0.0], "drag": {"linear": [0.1, 0.1, 0.1]}}
LAYERS = {
    "ideal": TROT,
    "noisy": {**TROT, "sensors": {"attitude_noise": 0.01}},
    "windy": {**TROT, "air": DRAG},
    "measured": {
        **TROT,
        "controller": {**TROT["controller"], "angular_acceleration": "measured"},
        "sensors": {"body_rates_bias": [0.01, 0.0, 0.0]},
    },
    "supervised": {
        **TROT,
        "controller": {
            **TROT["controller"],
            "supervisor": {"strategy": "scale", "min_margin": 1.4},
        },
        "air": DRAG,
    },
}


def test_steps_equal_a_flight():
    flight, simulation = tiltsim.simulate(TROT), tiltsim.Simulation(TROT)
    for _ in range(2):
        for _ in range(2):
            simulation.step(10)
        np.testing.assert_array_equal(simulation.flight().samples, flight.samples)
        simulation.reset()
        assert simulation.time == 0.0


def test_steps_follow_a_custom_motion_and_gait():
    own = {
        "reference": lambda time: (0.1 * np.sin(time), 0.0, 0.0),
        "gait": lambda time: (0.1 * time, 0.0, -0.1 * time, 0.0),
    }
    flight, simulation = tiltsim.simulate(TROT, **own), tiltsim.Simulation(TROT, **own)
    simulation.step(10)
    simulation.step(10)
    np.testing.assert_array_equal(simulation.flight().samples, flight.samples)
    assert flight["x_ref"][-1] == pytest.approx(0.1 * np.sin(0.02), abs=1e-9)


def test_a_simulation_is_complete_at_its_duration_and_goes_on_as_far_as_its_functions():
    simulation = tiltsim.Simulation(TROT, reference=lambda time: (0.1 * time, 0.0, 0.0))
    simulation.step(19)
    assert simulation.flight().end.kind == "interrupted"
    simulation.step()
    assert simulation.flight().end == tiltsim.simulate(TROT).end
    simulation.step(80)  # functions are sampled for 0.1 s at least
    assert simulation.flight().end.kind == "completed"
    with pytest.raises(tiltsim.InputError, match=r"reference ends at 0\.1 s; make"):
        simulation.step()


def test_a_state_that_is_not_finite_is_not_blamed_on_the_control_law():
    simulation = tiltsim.Simulation(TROT)
    simulation.data.qpos[:] = np.nan
    simulation.step(10)
    assert simulation.end.cause == "positions are NaN or beyond 1e10"


def assert_same(ours, others):
    """NumPy may add the products of a matrix in another order than the compiled law."""
    np.testing.assert_allclose(ours, others, rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize("layers", LAYERS)
def test_the_built_in_command_as_a_custom_controller_flies_the_same_flight(layers):
    shipped = tiltsim.load_scenario(LAYERS[layers])
    steps = shipped.simulation.control_steps

    class Shadow:
        def reset(self, _scenario):
            self.simulation = tiltsim.Simulation(shipped)

        def __call__(self, observation):
            if observation.time > 0.0:
                self.simulation.step(steps)
            seen = self.simulation.observation()
            assert_same(observation.position, seen.position)
            assert_same(observation.attitude, seen.attitude)
            return self.simulation.command()

    ours, own = tiltsim.simulate(shipped), tiltsim.simulate(shipped, controller=Shadow())
    assert own.end.kind == "completed", own.end.cause
    for name in ("position", "attitude", "tilt_angles", "rotor_speeds"):
        assert_same(own[name], ours[name])


def test_the_built_in_command_on_an_estimate_is_the_loops():
    estimated = tiltsim.load_scenario("beyond/estimator", {"simulation.engine": "python"})
    simulation = tiltsim.Simulation(estimated)
    simulation.step(4)
    command = simulation.command()
    simulation.step()  # with controls from the same sample
    layout = layout_of(assemble(estimated).loop)
    ctrl = simulation.data.ctrl[layout.acceleration_1 : layout.further_rates]
    assert_same(command.rotor_accelerations, np.multiply(estimated.vehicle.spins, ctrl))


def test_the_quadrotors_command_is_its_thrusts():
    simulation = tiltsim.Simulation(
        {"vehicle": {"model": "quadrotor"}, "controller": {"law": "yaw_position"}}
    )
    simulation.step(5)
    thrusts = simulation.flight()["thrusts"]
    np.testing.assert_allclose(simulation.command().thrusts, thrusts[-1], rtol=1e-12)
    assert (thrusts > 0.5).all()


def test_mujoco_s_own_model_and_data_are_those_that_fly():
    simulation = tiltsim.Simulation(TROT)
    model, data = simulation.model, simulation.data
    assert isinstance(model, mujoco.MjModel)
    assert model.ngeom > 10
    assert data.sensor("gyro").data.shape == (3,)
    data.qpos[2] = 5.0
    simulation.step()
    assert simulation.observation().position[2] == pytest.approx(5.0, abs=1e-3)
    simulation.reset()
    assert simulation.data is data
    assert data.qpos[2] == 0.0


def test_a_custom_controller_starts_again_after_a_reset():
    made = []

    class Counting:
        def __init__(self):
            made.append(0)

        def __call__(self, observation):
            made[-1] += 1
            return tiltsim.Command(thrusts=[1.05] * 4)

    simulation = tiltsim.Simulation({"simulation": TROT["simulation"]}, controller=Counting)
    simulation.step(4)
    simulation.reset()
    simulation.step(10)
    assert made == [2, 5]
    with pytest.raises(tiltsim.TiltsimError, match="the controller is your own"):
        simulation.command()


def test_a_failing_controller_raises_at_once():
    simulation = tiltsim.Simulation(
        {"simulation": TROT["simulation"]}, controller=lambda observation: None
    )
    with pytest.raises(tiltsim.TiltsimError, match=r"expected a tiltsim\.Command"):
        simulation.step()


def test_a_simulation_ends_where_its_controller_fails_as_a_flight_does():
    def failing(observation):
        assert observation.time < 0.011, "too late"
        return tiltsim.Command(thrusts=[1.05] * 4)

    tables = {"simulation": TROT["simulation"]}
    simulation = tiltsim.Simulation(tables, controller=failing)
    simulation.step(10)
    with pytest.raises(tiltsim.TiltsimError, match="too late"):
        simulation.step(10)
    with pytest.warns(RuntimeWarning, match="too late"):
        alone = tiltsim.simulate(tables, controller=failing)
    assert simulation.end == alone.end
    np.testing.assert_array_equal(simulation.flight().samples, alone.samples)
    with pytest.raises(tiltsim.TiltsimError, match=r"too late.*begin again with reset"):
        simulation.step()
    simulation.reset()
    assert simulation.end is None


def test_a_simulation_ends_where_the_flight_does_and_says_so():
    simulation = tiltsim.Simulation({"initial": {"angular_velocity": [0.0, 0.0, 1001.0]}})
    assert simulation.end is not None
    with pytest.raises(tiltsim.TiltsimError, match=r"diverged.*begin again with reset"):
        simulation.step()


def test_a_tilt_car_steps_without_observations():
    simulation = tiltsim.Simulation(TILT_CAR)
    simulation.step(10)
    assert len(simulation.flight()) == 2
    for method in (simulation.observation, simulation.command):
        with pytest.raises(tiltsim.TiltsimError, match="takes rotorcraft only"):
            method()
