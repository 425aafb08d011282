"""Layered loops on the thesis's equations, an independent integration to check MuJoCo's by."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import tiltsim
from tests.laws.restarting import assert_restarts
from tiltsim.equations.actuator_level import actuator_plant
from tiltsim.errors import InputError
from tiltsim.laws import assembling
from tiltsim.laws.assembling import LOOPS, assemble, loop_of
from tiltsim.scenario.loading import merge
from tiltsim.simulation.simulate import make_plant
from tiltsim_controllers.code.arrays import traceable, xp
from tiltsim_controllers.laws.quadrotor import gyroscopic_acceleration

MOTION = ("x", "y", "z", "roll", "pitch", "yaw")
TILTROTOR = {
    "simulation": {"duration": 0.28, "timestep": 0.002, "engine": "python"},
    "controller": {"decoupling": "exact", "decoupler": "exact", "gains": "exact"},
    "gait": {"type": "fixed", "angles": [-0.2, -0.2, 0.2, 0.2]},
    "initial": {"rotor_speed": 361.0, "attitude": [0.1, -0.06, 0.04]},
}
QUADROTOR = {
    "simulation": {"duration": 0.28, "timestep": 0.002, "engine": "python"},
    "vehicle": {"model": "quadrotor"},
    "controller": {"law": "yaw_position"},
    "initial": {"attitude": [0.1, -0.06, 0.04]},
}
GAINS = {"position": [40.0, 600.0, 4000.0], "attitude": [40.0, 600.0, 4000.0]}
FULL_POSE = TILTROTOR | {"controller": {"law": "full_pose", "gains": GAINS}}
TROT = {"gait": {"type": "trot_continuous", "amplitude": 0.4, "period": 1.0}}
LATE = {"simulation": {"control_timestep": 0.004, "control_latency": 0.012}}
LIMITS = {"vehicle": {"min_rotor_speed": 200.0, "max_rotor_speed": 390.0}}
STORM = {
    "air": {
        "drag": {"linear": [0.2, 0.2, 0.1], "area": [0.01, 0.01, 0.02]},
        "wind": [4.0, 1.0, 0.0],
        "gust": {"velocity": [3.0, 0.0, 1.0], "start": 0.1, "rise": 0.2},
        "ground_effect": {"height": -0.15},
    }
}
SENSORS = {
    "sensors": {
        **{"attitude_noise": 0.005, "body_rates_noise": 0.01, "position_noise": 0.01},
        **{"velocity_noise": 0.01, "position_bias": [0.1, 0.0, 0.0]},
    }
}
SLOW = {
    "vehicle": {
        "rotor_time_constant": 0.02,
        "tilt_servo": {"natural_frequency": 30.0, "damping_ratio": 0.5, "max_rate": 1.0},
    }
}
WEAK = {"fault": [{"type": "partial_thrust", "rotor": 1, "time": 0.1, "factor": 0.97}]}
WRONG = {"model_error": {"mass": 1.05, "inertia": [1.1, 0.9, 1.0]}}
CLIMB = {"controller": {"allocation": "prioritized"}, "initial": {"velocity": [0.0, 0.0, -2.0]}}
SPINNING = {"vehicle": {"rotor_inertia": 1e-5, "tilt_servo": {"natural_frequency": 150.0}}}
WATCHED = {"controller": {"supervisor": {"min_margin": 0.3, "min_determinant": 3.5}}}


def scenario(*changes, **more):
    tables = {}
    for change in (*changes, more):
        tables = merge(tables, change)
    return tiltsim.parse_scenario(tables)


def fly(*changes, plant="thesis", **more):
    return tiltsim.simulate(scenario(*changes, {"simulation": {"plant": plant}}, more))


def with_gyroscopic_torque(loop):
    """A loop on the thesis's equations with the torque that chapter 3 leaves out."""
    rates = loop.equations.rates

    @traceable
    def turning(time, state, inputs, parameters, table, disturbance):
        found = rates(time, state, inputs, parameters, table, disturbance)
        vehicle = parameters.layer.vehicle
        moved = found[15:18] + gyroscopic_acceleration(state[15:18], vehicle)
        return xp.hstack([found[:15], moved, found[18:]])

    return replace(loop, equations=replace(loop.equations, rates=turning))


@pytest.fixture
def gyroscopic_torque(monkeypatch):
    """Give the tiltrotor on the thesis plant the gyroscopic torque that MuJoCo's body has."""

    def found(desired, *more, **options):
        loop = loop_of(desired, *more, **options)
        turns = desired.simulation.plant == "thesis" and desired.vehicle.model == "tiltrotor"
        return with_gyroscopic_torque(loop) if turns else loop

    monkeypatch.setattr(assembling, "loop_of", found)


def furthest(flights, names):
    """The largest difference between two flights in any of the columns."""
    one, other = flights
    assert len(one) == len(other)
    return max(np.abs(one[name] - other[name]).max() for name in names)


def on_both(*changes):
    return [fly(*changes, plant=plant) for plant in ("mujoco", "thesis")]


# --- both plants -------------------------------------------------------------------------------

# An event within a step costs an integrator one step: first order. A kink costs it one order, and
# where all is smooth ode3's third order is left.
FLIGHTS = {
    "rotor lag": (3, (TILTROTOR, {"vehicle": {"rotor_time_constant": 0.02}})),
    "late": (3, (TILTROTOR, LATE)),
    "noise": (1, (TILTROTOR, SENSORS)),
    "noise, late": (3, (TILTROTOR, SENSORS, LATE)),
    "slow servos": (3, (TILTROTOR, TROT, {"vehicle": {"tilt_servo": {"natural_frequency": 20.0}}})),
    "slow, limited": (3, (TILTROTOR, TROT, SLOW)),
    "supervised": (2, (TILTROTOR, TROT, WATCHED)),
    "wrong model": (3, (TILTROTOR, WRONG)),
    "storm": (3, (TILTROTOR, STORM)),
    "storm, late, noise": (3, (TILTROTOR, STORM, LATE, SENSORS, SLOW)),
    "full pose, storm": (3, (FULL_POSE, STORM)),
    "full pose, lag": (3, (FULL_POSE, {"vehicle": {"rotor_time_constant": 0.005}})),
    "quadrotor, storm": (3, (QUADROTOR, STORM)),
    "spinning rotors": (3, (TILTROTOR, TROT, SPINNING)),
    "spinning, lagging": (3, (TILTROTOR, SPINNING, {"vehicle": {"rotor_time_constant": 0.02}})),
    "weak rotor": (3, (TILTROTOR, WEAK)),
    "allocation": (2, (TILTROTOR, LIMITS, CLIMB)),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FLIGHTS)
def test_the_plants_differ_by_the_error_of_the_solver(name, gyroscopic_torque):
    """Half the step, and the difference falls by two to the order; with one solver none is left."""
    order, changes = FLIGHTS[name]
    coarse, fine = (
        on_both(*changes, {"simulation": {"timestep": step, "record_timestep": 0.02}})
        for step in (0.002, 0.001)
    )
    assert furthest(coarse, MOTION) < (1e-4 if order == 1 else 2e-6)
    ratio = furthest(coarse, MOTION) / furthest(fine, MOTION)
    assert 0.85 * 2.0**order < ratio < 1.5 * 2.0**order
    assert max(np.ptp(coarse[0][axis]) for axis in MOTION) > 0.01
    step = {"simulation": {"timestep": 0.002, "record_timestep": 0.02}}
    assert furthest((coarse[0], fly(*changes, step, plant="rigid_body")), MOTION) < 1e-8


def test_without_the_gyroscopic_torque_they_part_where_the_body_turns():
    mujoco, thesis = on_both(TILTROTOR, STORM)
    assert 1e-6 < furthest((mujoco, thesis), MOTION) < 2e-3


def test_the_same_noise_and_turbulence_is_drawn():
    blowing = merge(STORM, {"air": {"turbulence": {"wind_at_6m": 4.0}}})
    flights = on_both(TILTROTOR, blowing)
    states = [f"dryden_{index}" for index in range(1, 6)]
    assert furthest(flights, states) < 0.01  # RK4's last stage sees the next draw, ode3's does not
    assert np.ptp(flights[0]["dryden_1"]) > 0.03
    other = fly(TILTROTOR, blowing, simulation={"seed": 7})
    assert furthest((flights[1], other), states) > 0.03


# --- restarts ----------------------------------------------------------------------------------

LAYERED = {
    "tiltrotor": (TILTROTOR, TROT, STORM, LATE, SENSORS, SLOW, LIMITS),
    "quadrotor": (QUADROTOR, STORM),
}


@pytest.mark.parametrize("name", LAYERED)
def test_a_saved_state_restarts_bit_identically(name):
    assert_restarts(scenario(*LAYERED[name], {"simulation": {"plant": "thesis"}}), 51, 40)


# --- the thesis's vehicle -----------------------------------------------------------------------


@pytest.mark.parametrize("base", [TILTROTOR, QUADROTOR])
def test_a_state_that_has_overflowed_is_seen_as_no_number(base):
    """The last addition of a step may give infinity, of which floats have no sine."""
    assembly = assemble(scenario(base, STORM, {"simulation": {"plant": "thesis"}}))
    plant = make_plant(assembly)
    state, motion = plant.state, actuator_plant(assembly.loop).motion
    for index in range(motion):
        overflowed = state.copy()
        overflowed[1 + index] = np.inf
        plant.state = overflowed
        assert not np.isfinite(plant.observe()).all()


def test_an_ideal_vehicle_flies_the_printed_equations():
    desired = scenario(TILTROTOR, {"simulation": {"plant": "thesis"}})
    assert loop_of(desired) is LOOPS["attitude_altitude"]


def test_layered_equations_equal_the_printed_ones():
    """A layer that does nothing leaves how far the solver lets a rotation lose its length."""
    never = {"fault": [{"type": "rotor_loss", "rotor": 1, "time": 1e6}]}
    printed, driven = fly(TILTROTOR), fly(TILTROTOR, never)
    assert furthest((printed, driven), MOTION) < 1e-8


# --- servos and limits -------------------------------------------------------------------------


def test_a_pod_follows_the_equation_of_its_servo():
    omega, damping, angle = 25.0, 0.4, 0.05
    servo = {"natural_frequency": omega, "damping_ratio": damping}
    stuck = {"fault": [{"type": "stuck_servo", "rotor": 1, "time": 0.0, "angle": angle}]}
    level = {"gait": {"angles": [0.0, 0.0, 0.0, 0.0]}, "vehicle": {"tilt_servo": servo}}
    flight = fly(TILTROTOR, level, stuck)
    time, ringing = flight["time"], omega * np.sqrt(1.0 - damping**2)
    swing = np.cos(ringing * time) + damping * omega / ringing * np.sin(ringing * time)
    desired = angle * (1.0 - np.exp(-damping * omega * time) * swing)
    np.testing.assert_allclose(flight["alpha_1"], desired, atol=1e-6)


def test_a_pod_stops_where_its_servo_does():
    servo = {"natural_frequency": 25.0, "damping_ratio": 0.3, "max_angle": 0.11}
    stuck = {"fault": [{"type": "stuck_servo", "rotor": 1, "time": 0.0, "angle": 0.1}]}
    flight = fly(
        TILTROTOR,
        {"gait": {"angles": [0.0, 0.0, 0.0, 0.0]}, "vehicle": {"tilt_servo": servo}},
        stuck,
        simulation={"record_timestep": 0.002},
    )
    assert flight["alpha_1"].max() == 0.11
    assert flight["alpha_1"][-1] < 0.11


@pytest.mark.parametrize("plant", ["mujoco", "thesis"])
def test_rotors_hold_their_limits_within_a_step(plant):
    """Else thrust outruns them by one step's change, and a longer step flies another flight."""
    changes = {"simulation.plant": plant, "simulation.engine": "python"}
    coarse, fine = (
        tiltsim.simulate(
            tiltsim.load_scenario(
                "beyond/allocation#inversion", {**changes, "simulation.timestep": step}
            )
        )
        for step in (0.004, 0.001)
    )
    assert {coarse.end.kind, fine.end.kind} == {"singular"}
    assert coarse.end.time == pytest.approx(fine.end.time, abs=0.01)
    speeds = np.abs([fine[f"rotor_speed_{rotor}"] for rotor in (1, 2, 3, 4)])
    assert speeds.max() == 390.0


# --- mistakes ----------------------------------------------------------------------------------


def test_a_step_too_long_for_a_servo_is_refused_where_a_servo_flies():
    long = {"simulation": {"timestep": 0.007, "plant": "thesis"}}
    scenario(TILTROTOR, long)
    with pytest.raises(InputError, match=r"simulation.timestep.*tilt servo at 300 rad/s"):
        scenario(TILTROTOR, long, STORM)
    hard = {"vehicle": {"tilt_servo": {"damping_ratio": 0.1}}}
    bearable = {"simulation": {"timestep": 0.007}}
    scenario(TILTROTOR, hard, bearable)
    with pytest.raises(InputError, match=r"at most 0.00567 s"):
        scenario(TILTROTOR, hard, bearable, {"simulation": {"plant": "thesis"}})
