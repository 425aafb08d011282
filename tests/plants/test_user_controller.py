"""A custom controller: its observations, its commands, and messages when it fails."""

from __future__ import annotations

import json
import sys
import tomllib

import mujoco
import numpy as np
import pyarrow.parquet as pq
import pytest

import tiltsim
from tests.docs.pages import code
from tests.refusals import refusal
from tiltsim.cli import main
from tiltsim.closed_loop.userdata import evaluation_time
from tiltsim.errors import InputError
from tiltsim.flight.reading import load_flight
from tiltsim.laws.assembling import assemble, loop_of
from tiltsim.plants.built_in import BuiltInController
from tiltsim.plants.command import Command, check_command
from tiltsim.plants.commanded_plant import CommandedPlant
from tiltsim.studies.multirotor_analysis import fleet_file
from tiltsim.vehicles.rotorcraft import CROSS
from tiltsim_controllers.laws.attitude_altitude import Parameters, attitude_altitude
from tiltsim_controllers.laws.observed import Seen
from tiltsim_controllers.mathematics.attitude import euler_angles
from tiltsim_controllers.references.trajectories import reference_derivatives
from tiltsim_controllers.vehicle.parameters import PRESETS, SPIN

HOVER = """
import numpy as np
import tiltsim

def law(observation):
    vehicle, error = observation.vehicle, observation.reference.position - observation.position
    acceleration = 1.0 * error + 1.6 * (observation.reference.velocity - observation.velocity)
    lean = np.array([-acceleration[1], acceleration[0], 0.0]) / vehicle.gravity
    error = 64 * (lean - observation.attitude) - 16 * observation.body_rates
    moment = np.array(vehicle[1:4]) * error
    lift = vehicle.mass * (vehicle.gravity + acceleration[2])
    roll, pitch, yaw = moment
    drag = vehicle.drag_coefficient / vehicle.thrust_coefficient
    thrusts = lift / 4 + np.array([-pitch, roll, pitch, -roll]) / (2 * vehicle.arm_length)
    return tiltsim.Command(thrusts=thrusts + yaw / (4 * drag) * np.array([1, -1, 1, -1]))

class Slow:
    "Counts its calls, and fails if it is called twice for one time."
    def __init__(self):
        self.times = []
    def reset(self, scenario):
        self.times.clear()
        self.step = scenario.simulation.control_timestep
    def __call__(self, observation):
        assert not self.times or observation.time > self.times[-1]
        self.times.append(observation.time)
        return law(observation)

not_callable = 3.0
"""
MODELS = ("tiltrotor", "quadrotor")
STILL = Command(thrusts=[1.05105] * 4)  # a quarter of the weight each, nearly

each_model = pytest.mark.parametrize("model", MODELS)


@pytest.fixture(scope="module")
def hover_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("laws") / "my_law.py"
    path.write_text(HOVER, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def law(hover_file):
    namespace = {}
    exec(compile(HOVER, str(hover_file), "exec"), namespace)
    return namespace["law"]


def scenario(simulation=None, **tables):
    simulation = {"duration": 0.3, "control_timestep": 0.01, **(simulation or {})}
    tables.setdefault("controller", {"law": "python", "function": "test"})
    return tiltsim.parse_scenario({**tables, "simulation": simulation})


# --- flying ------------------------------------------------------------------------------------


@each_model
def test_a_function_hovers_either_vehicle_at_its_setpoint(law, model):
    flight = tiltsim.simulate(
        scenario(
            {"duration": 12.0, "timestep": 0.002},
            vehicle={"model": model},
            initial={"attitude": [0.1, -0.1, 0.3]},
            reference={"type": "setpoint", "position": [0.5, -0.5, 0.5]},
        ),
        controller=law,
    )
    metrics = flight.metrics()
    assert flight.end.kind == "completed"
    for axis in "xyz":
        assert abs(metrics[f"final_position_error_{axis}"]) < 1e-3
    hover = PRESETS["ar_drone_2"].hover_rotor_speed
    np.testing.assert_allclose(
        [flight[f"rotor_speed_{i}"][-1] for i in (1, 2, 3, 4)], hover * np.array(SPIN), rtol=1e-3
    )


def test_the_untilted_tiltrotor_flies_as_the_quadrotor_does(law):
    both = [
        tiltsim.simulate(
            scenario(vehicle={"model": model}, initial={"attitude": [0.2, 0.1, -0.3]}),
            controller=law,
        )
        for model in MODELS
    ]
    for column in ("x", "z", "roll", "r", "rotor_speed_2", "thrust_3"):
        np.testing.assert_allclose(both[0][column], both[1][column], atol=1e-9)


LATE = {"simulation": {"control_latency": 0.006}}
LAG = {"vehicle": {"rotor_time_constant": 0.02}}
SLOW = {"vehicle": {"tilt_servo": {"natural_frequency": 30.0, "max_rate": 0.5}}}
NOISE = {
    "sensors": {
        **{"position_noise": 0.01, "velocity_noise": 0.02, "attitude_noise": 0.005},
        **{"body_rates_noise": 0.01, "position_bias": [0.1, 0.0, 0.0], "sample_time": 0.004},
    }
}
FAULTS = {
    "fault": [
        {"type": "partial_thrust", "rotor": 1, "time": 0.1, "factor": 0.97},
        {"type": "stuck_servo", "rotor": 2, "time": 0.2},
    ]
}
WIND = {
    "air": {
        "drag": {"linear": [0.2, 0.2, 0.1]},
        "wind": [3.0, 1.0, 0.0],
        "turbulence": {"wind_at_6m": 4.0},
    }
}
LIMITS = {"vehicle": {"min_rotor_speed": 280.0, "max_rotor_speed": 390.0}}
LAYERS = {
    "ideal": [],
    "late": [LATE],
    "lag": [LAG],
    "slow servos": [SLOW],
    "noise": [NOISE],
    "faults": [FAULTS],
    "wind": [WIND],
    "wrong model": [{"model_error": {"mass": 1.05, "thrust_coefficient": 0.98}}],
    "everything": [LATE, LAG, SLOW, NOISE, FAULTS, WIND, LIMITS],
}


def merged(base, *layers):
    """Tables of a scenario with tables of layers; the keys of each table side by side."""
    tables = dict(base)
    for layer in layers:
        for name, table in layer.items():
            tables[name] = tables.get(name, {}) | table if isinstance(table, dict) else table
    return tables


@pytest.mark.slow
@pytest.mark.parametrize("layers", LAYERS)
def test_a_shipped_law_flown_as_a_users_own_flies_the_same_flight(layers):
    """Sampled rotor accelerations and the planned gait are just what a held law of ours does.

    NumPy adds the products of a matrix in another order than the traced law; late commands of ours
    are handed on by integration, which rounds more.
    """
    tables = {
        "simulation": {"duration": 0.4, "control_timestep": 0.002, "engine": "python"},
        "gait": {"type": "trot_continuous", "amplitude": 0.3, "period": 2.0},
        "controller": {"decoupling": "exact", "gains": "exact"},
    }
    ideal = tiltsim.parse_scenario(tables)
    shipped = tiltsim.parse_scenario(merged(tables, *LAYERS[layers]))
    parameters, timestep = assemble(shipped).setup.parameters, shipped.simulation.timestep
    while not isinstance(parameters, Parameters):
        parameters = getattr(parameters, "inner", None) or parameters.law

    def own(observation):
        seen = observation
        body = seen.position, seen.velocity, euler_angles(seen.quaternion), seen.body_rates
        state = np.hstack([*body, seen.tilt_angles, SPIN * seen.rotor_speeds])
        # A shipped law sees the instant just after the one that it is given.
        time = evaluation_time(round(observation.time / timestep), 1.0, timestep)
        step = attitude_altitude(Seen(time, state), parameters, np.zeros(5))
        return Command(rotor_accelerations=np.array(SPIN) * step.inputs)

    ours, theirs = tiltsim.simulate(shipped), tiltsim.simulate(shipped, controller=own)
    assert theirs.scenario.controller.law == "python"
    rounding = 1e-9 if shipped.simulation.latency_steps else 1e-11
    # The samples under the own controller also have the commands of the servos.
    common = loop_of(shipped).sample_fields
    places = [loop_of(theirs.scenario).sample_fields.index(field) for field in common]
    np.testing.assert_allclose(
        theirs.samples[:, places], ours.samples, rtol=rounding, atol=rounding
    )
    if layers != "ideal":
        apart = np.abs(tiltsim.simulate(ideal)["z"] - theirs["z"]).max()
        assert apart > 1e-6


def multirotor(name, **tables):
    vehicle = {"model": "multirotor", "mjcf": str(fleet_file(name))}
    simulation = {"duration": 0.05, "control_timestep": 0.002, "engine": "python"}
    tables.setdefault("controller", {"law": "attitude_force"})
    return merged({"vehicle": vehicle, "simulation": simulation}, tables)


@pytest.mark.parametrize("layers", [[], [LAG, NOISE, FAULTS]], ids=["ideal", "real"])
def test_a_multirotors_law_flown_as_a_users_own_flies_the_same_flight(layers):
    gait = {"type": "waypoints", "angles": [[0.2, -0.2] * 3, [0.3, -0.3] * 3], "period": 2.0}
    initial = {"position": [0.01, 0.02, -0.01], "attitude": [0.01, 0.0, 0.02]}
    tables = multirotor("tilt_hexarotor", gait=gait, initial=initial)
    shipped = tiltsim.parse_scenario(merged(tables, *layers))
    own = BuiltInController(shipped)
    ours, theirs = tiltsim.simulate(shipped), tiltsim.simulate(shipped, controller=own)
    assert ours.end.kind == theirs.end.kind == "completed"
    for column in ("position", "attitude", "tilt_angles", "rotor_speeds", "singularity_margin"):
        # NumPy adds the products of a matrix in another order than the compiled law.
        np.testing.assert_allclose(ours[column], theirs[column], 1e-10, 1e-14, err_msg=column)


def test_a_multirotors_commands_are_for_each_of_its_rotors():
    seen = []

    def hover(observation):
        seen.append(observation)
        weight = observation.vehicle.mass * observation.vehicle.gravity
        return Command(thrusts=[weight / 6] * 5 + [1e3])

    document = multirotor("hexarotor", vehicle={"max_rotor_speed": 838.0})
    flight = tiltsim.simulate(document, controller=hover)
    assert seen[0].rotor_speeds.shape == (6,)
    assert seen[0].tilt_angles.shape == (0,)
    speeds = flight["rotor_speeds"][-1] * seen[0].vehicle.spins
    lift = seen[0].vehicle.thrust_coefficients[0] * speeds[0] ** 2
    assert lift == pytest.approx(seen[0].vehicle.mass * seen[0].vehicle.gravity / 6)
    assert speeds[5] == 838.0

    def failure(command):
        with pytest.warns(RuntimeWarning):
            return tiltsim.simulate(document, controller=lambda _: command).end.message

    few, tilted = Command(thrusts=[1.0] * 4), Command(thrusts=[1.0] * 6, tilt_angles=[0.0] * 6)
    assert "thrusts of shape (4,); expected shape (6,)" in failure(few)
    assert "no tilt servos" in failure(tilted)


@pytest.mark.parametrize("command", ["thrusts", "rotor_speeds"])
def test_lagging_rotors_approach_a_commanded_speed(command):
    start, commanded, lag, late = 300.0, 350.0, 0.05, 0.02
    value = (
        commanded
        if command == "rotor_speeds"
        else PRESETS["ar_drone_2"].thrust_coefficient * commanded**2
    )
    flight = tiltsim.simulate(
        scenario({"duration": 0.2, "control_latency": late}, vehicle={"rotor_time_constant": lag}),
        controller=lambda _: Command(**{command: [value] * 4}),
    )
    time = flight["time"]
    approach = commanded + (start - commanded) * np.exp(-(time - late) / lag)
    for rotor, spin in enumerate(SPIN, start=1):
        expected = spin * np.where(time <= late, start, approach)
        np.testing.assert_allclose(flight[f"rotor_speed_{rotor}"], expected, rtol=1e-7)


def test_late_speeds_are_taken_at_once_when_they_arrive():
    def law(observation):
        return Command(
            rotor_speeds=[300.0 + 1e3 * observation.time] * 4, tilt_angles=[observation.time] * 4
        )

    flight = tiltsim.simulate(
        scenario({"duration": 0.1, "control_latency": 0.03, "record_timestep": 0.005}),
        controller=law,
    )
    time = flight["time"]
    sampled = 0.01 * np.floor((time - 0.005) / 0.01 + 1e-6)  # the sample in force just before
    arrived = np.maximum(sampled - 0.03, 0.0)
    np.testing.assert_allclose(flight["rotor_speed_2"], 300.0 + 1e3 * arrived, atol=1e-6)
    np.testing.assert_allclose(flight["alpha_ref_3"], arrived, atol=1e-9)


def test_sensors_affect_the_observation_and_not_the_log():
    observations = []

    def look(observation):
        observations.append(observation)
        return STILL

    errors = merged(NOISE, {"sensors": {"position_noise": 0.0}})
    flight = tiltsim.simulate(scenario({"record_timestep": 0.01}, **errors), controller=look)
    x, roll, p = (
        [getattr(s, name)[0] for s in observations]
        for name in ("position", "attitude", "body_rates")
    )
    np.testing.assert_allclose(x - flight["x"][:-1], 0.1, atol=1e-12)
    assert 0.002 < np.std(roll - flight["roll"][:-1]) < 0.01
    assert 0.004 < np.std(p - flight["p"][:-1]) < 0.02
    np.testing.assert_array_equal(observations[3].tilt_angles, 0.0)


def test_both_vehicles_fly_in_the_wind(law):
    both = [
        tiltsim.simulate(
            scenario({"duration": 1.0}, vehicle={"model": model}, **WIND), controller=law
        )
        for model in MODELS
    ]
    assert both[0]["air_vx"].mean() == pytest.approx(3.0, abs=1.0)
    assert both[0]["x"][-1] > 0.05
    for column in ("x", "z", "roll", "air_vx"):
        np.testing.assert_allclose(both[0][column], both[1][column], atol=1e-9)


def test_the_observation_is_the_state_the_reference_and_the_gait():
    observations = []

    def look(observation):
        observations.append(observation)
        return STILL

    flown = tiltsim.simulate(
        scenario(
            {"duration": 0.01, "control_timestep": 0.005, "record_timestep": 0.005},
            initial={
                "position": [1.0, 2.0, 3.0],
                "velocity": [0.1, 0.2, 0.3],
                "attitude": [0.1, 0.2, 0.3],
                "angular_velocity": [0.01, 0.02, 0.03],
                "rotor_speed": [310.0, 320.0, 330.0, 340.0],
            },
            gait={"type": "trot_continuous", "amplitude": 0.3, "period": 1.0},
            reference={"type": "circle", "radius": 2.0, "angular_frequency": 0.5, "yaw": 0.2},
        ),
        controller=look,
    )
    first, second = observations
    assert (first.time, second.time) == (0.0, 0.005)
    np.testing.assert_array_equal(first.position, [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(first.velocity, [0.1, 0.2, 0.3])
    np.testing.assert_allclose(first.attitude, [0.1, 0.2, 0.3])
    np.testing.assert_array_equal(first.body_rates, [0.01, 0.02, 0.03])
    np.testing.assert_array_equal(first.rotor_speeds, [310.0, 320.0, 330.0, 340.0])
    rotated = np.zeros(3)
    mujoco.mju_rotVecQuat(rotated, np.array([0.0, 0.0, 1.0]), first.quaternion)
    assert rotated[2] == pytest.approx(np.cos(0.1) * np.cos(0.2))
    sample = dict(zip(flown.assembly.loop.sample_fields, flown.samples[1], strict=True))
    assert sample["time"] == pytest.approx(second.time)
    np.testing.assert_array_equal(second.position, [sample[axis] for axis in "xyz"])
    np.testing.assert_array_equal(second.body_rates, [sample[axis] for axis in "pqr"])
    np.testing.assert_array_equal(second.tilt_angles, [sample[f"alpha_{i}"] for i in (1, 2, 3, 4)])
    instant = evaluation_time(5.0, 1.0, 0.001)  # just after the time that is observed
    expected = reference_derivatives(instant, flown.scenario.reference.parameters)
    np.testing.assert_array_equal(second.reference.position, expected[:3])
    np.testing.assert_array_equal(second.reference.velocity, expected[3:6])
    np.testing.assert_array_equal(second.reference.acceleration, expected[6:9])
    np.testing.assert_array_equal(second.reference.attitude, [0.0, 0.0, 0.2])
    gait = flown.scenario.gait.plan(flown.scenario.vehicle.resolve())
    planned, rates = gait.angles(instant), gait.rates(instant)
    np.testing.assert_array_equal(second.reference.tilt_angles, planned)
    np.testing.assert_array_equal(second.reference.tilt_rates, rates)
    # The servos keep to the plan, for the command left the tilt angles out.
    np.testing.assert_allclose(second.tilt_angles, planned, atol=0.01)
    assert second.vehicle == flown.scenario.vehicle.resolve()


def test_a_preview_shows_the_later_references():
    seen, shown = [], []

    def look(observation):
        seen.append(observation.reference)
        shown.append(observation.preview([0.005, 0.01]))
        return STILL

    circle = {"type": "circle", "radius": 2.0, "angular_frequency": 0.5, "yaw": 0.2}
    trot = {"type": "trot_continuous", "amplitude": 0.3, "period": 1.0}
    times = {"duration": 0.015, "control_timestep": 0.005}
    tiltsim.simulate(scenario(times, gait=trot, reference=circle), controller=look)
    assert shown[0].position.shape == (2, 3)
    assert shown[0].tilt_rates.shape == (2, 4)
    for name in ("position", "velocity", "acceleration", "attitude", "tilt_angles", "tilt_rates"):
        later = [getattr(reference, name) for reference in seen[1:]]
        # The reference of an observation is that just after its time.
        np.testing.assert_allclose(getattr(shown[0], name), later, atol=1e-6)
        np.testing.assert_array_equal(getattr(shown[0], name), getattr(shown[1], name))


def test_changing_an_observation_changes_nothing_else():
    def meddle(observation):
        observation.position[:] = 1e6
        observation.quaternion[:] = 0.0
        return STILL

    calm = tiltsim.simulate(scenario(), controller=lambda _: STILL)
    meddled = tiltsim.simulate(scenario(), controller=meddle)
    np.testing.assert_array_equal(calm.samples, meddled.samples)


@pytest.mark.parametrize(
    ("command", "expected"),
    [
        (Command(rotor_speeds=[300.0, 310.0, 320.0, 330.0]), [300.0, 310.0, 320.0, 330.0]),
        (Command(thrusts=[8.048e-6 * 9e4] * 4), [300.0] * 4),
        (Command(thrusts=[-8.048e-6 * 9e4] * 4), [-300.0] * 4),
        (Command(rotor_accelerations=[10.0, -20.0, 0.0, 5.0]), [301.0, 298.0, 300.0, 300.5]),
    ],
)
@each_model
def test_rotors_follow_their_commands(command, expected, model):
    flight = tiltsim.simulate(
        scenario({"duration": 0.1}, vehicle={"model": model}), controller=lambda _: command
    )
    speeds = [flight[f"rotor_speed_{i}"][-1] for i in (1, 2, 3, 4)]
    np.testing.assert_allclose(speeds, np.array(SPIN) * expected, rtol=1e-12)
    thrusts = [flight[f"thrust_{i}"][-1] for i in (1, 2, 3, 4)]
    np.testing.assert_allclose(thrusts, 8.048e-6 * np.array(expected) * np.abs(expected))


@each_model
def test_commanded_thrust_lifts_the_vehicle(model):
    vehicle = PRESETS["ar_drone_2"]
    thrust = 1.2 * vehicle.mass * vehicle.gravity / 4.0
    flight = tiltsim.simulate(
        scenario({"duration": 1.0}, vehicle={"model": model}),
        controller=lambda _: Command(thrusts=[thrust] * 4),
    )
    assert flight["z"][-1] == pytest.approx(0.5 * 0.2 * vehicle.gravity, rel=1e-9)


def test_tilt_angles_reach_the_servos_and_the_log():
    angles = [0.3, -0.2, 0.1, 0.4]
    flight = tiltsim.simulate(
        scenario(), controller=lambda _: Command(thrusts=[1.0] * 4, tilt_angles=angles)
    )
    for i, angle in enumerate(angles, start=1):
        assert flight[f"alpha_{i}"][-1] == pytest.approx(angle, abs=1e-6)
        np.testing.assert_array_equal(flight[f"alpha_ref_{i}"][1:], angle)
    assert flight["alpha_ref_1"][0] == 0.0


@each_model
def test_rotor_limits_hold(model):
    def law(observation):
        return Command(rotor_speeds=[1e3, 1e3, 0.0, -50.0])

    limits = {"model": model, "min_rotor_speed": 100.0, "max_rotor_speed": 500.0}
    flight = tiltsim.simulate(scenario(vehicle=limits), controller=law)
    speeds = [spin * flight[f"rotor_speed_{i}"][-1] for i, spin in enumerate(SPIN, start=1)]
    assert speeds == [500.0, 500.0, 100.0, 100.0]


@each_model
def test_rotors_whose_least_speed_is_0_stop_and_do_not_reverse(model):
    def law(observation):
        return Command(rotor_accelerations=[-4e4, 0.0, -4e4, 0.0])

    for limits, stopped in (({"min_rotor_speed": 0.0}, True), ({}, False)):
        flight = tiltsim.simulate(scenario(vehicle={"model": model, **limits}), controller=law)
        metrics = flight.metrics()
        assert (metrics["min_rotor_speed"] == 0.0) == stopped
        assert (metrics["saturated_fraction"] > 0.5) == stopped


@pytest.mark.parametrize(("control_timestep", "calls"), [(0.0, 30), (0.001, 30), (0.005, 6)])
def test_a_controller_is_called_at_every_control_sample(control_timestep, calls):
    times = []

    def law(observation):
        times.append(observation.time)
        return STILL

    tiltsim.simulate(
        scenario({"duration": 0.03, "control_timestep": control_timestep}), controller=law
    )
    step = control_timestep or 0.001
    np.testing.assert_allclose(times, step * np.arange(calls), atol=1e-12)


# --- memory and repetition -----------------------------------------------------------------------


def test_a_class_is_created_again_and_an_object_is_reset(hover_file):
    class Integral:
        made = 0

        def __init__(self):
            Integral.made += 1
            self.sum = 0.0

        def reset(self, scenario):
            self.sum = 0.1 * scenario.simulation.control_timestep

        def __call__(self, observation):
            self.sum += 0.01
            return Command(thrusts=[1.0 + self.sum] * 4)

    law = Integral()
    flights = [tiltsim.simulate(scenario(), controller=law) for _ in range(2)]
    flights += [tiltsim.simulate(scenario(), controller=Integral)]
    assert Integral.made == 2
    for flight in flights[1:]:
        np.testing.assert_array_equal(flight.samples, flights[0].samples)


@pytest.mark.parametrize("latency", [0.0, 0.006])
def test_the_controller_is_called_once_per_time_even_if_the_flight_ends_early(latency):
    times = []

    def law(observation):
        assert not times or observation.time > times[-1], "called twice"
        times.append(observation.time)
        return Command(rotor_accelerations=[1e6] * 4)  # 1e5 rad/s after 0.1 s

    flight = tiltsim.simulate(
        scenario(
            {
                **{"duration": 1.0, "record_timestep": 0.05, "control_timestep": 0.003},
                "control_latency": latency,
            }
        ),
        controller=law,
    )
    assert flight.end.kind == "diverged"
    assert flight.end.time == pytest.approx(0.1 + latency, abs=2e-3)
    assert "beyond 1e10" in flight.end.cause  # thrust controls are squares of speeds


@pytest.mark.parametrize("layers", ["ideal", "everything"])
def test_a_saved_state_restarts_under_held_accelerations(layers):
    tables = merged({"simulation": {"control_timestep": 0.002}}, *LAYERS[layers])
    plant = CommandedPlant(assemble(scenario(**tables)))

    def tell(speed):
        sent = Command(rotor_speeds=[speed] * 4, tilt_angles=[0.1, 0.0, 0.0, speed / 1e4])
        plant.apply(check_command(sent, CROSS))
        plant.advance(2)
        plant.apply(check_command(Command(rotor_accelerations=[5.0, -5.0, 3.0, 1.0]), CROSS))
        plant.advance(1)

    for speed in (300.0, 310.0, 320.0):
        tell(speed)
    state, sample = plant.state, plant.observe()
    ends = []
    for _ in range(2):
        plant.state = state
        assert plant.observe() == sample
        for speed in (330.0, 340.0, 350.0):
            tell(speed)
        ends.append(plant.observe())
    assert ends[0] == ends[1]
    assert ends[0] != sample


# --- mistakes ------------------------------------------------------------------------------------


def raises(observation):
    return 1.0 / (0.0 if observation.time > 0.0349 else 1.0) and STILL


class MuteError(Exception):
    def __str__(self):
        raise ValueError

    __repr__ = __str__


def raises_unspeakably(observation):
    if observation.time > 0.0349:
        raise MuteError
    return STILL


def leaves(observation):
    if observation.time > 0.0349:
        sys.exit(5)
    return STILL


def returning(value):
    return lambda observation: value if observation.time > 0.0349 else STILL


@pytest.mark.parametrize(
    ("law", "words"),
    [
        (raises, ["raises raised ZeroDivisionError: float division by zero", "line "]),
        (returning(None), ["returned None; expected a tiltsim.Command"]),
        (returning([1, 2, 3, 4]), ["returned [1, 2, 3, 4]; expected a tiltsim.Command"]),
        (returning(Command()), ["nothing for the rotors; expected one of thrusts, rotor_speeds"]),
        (
            returning(Command(thrusts=[1] * 4, rotor_speeds=[1] * 4)),
            ["returned thrusts and rotor_speeds; expected one of"],
        ),
        (returning(Command(thrusts=[1.0] * 3)), ["thrusts of shape (3,); expected shape (4,)"]),
        (returning(Command(thrusts=1.0)), ["thrusts of shape ()"]),
        (
            returning(Command(thrusts=["a"] * 4)),
            ["thrusts = ['a', 'a', 'a', 'a']; expected 4 numbers"],
        ),
        (returning(Command(rotor_speeds=[1, 2, np.nan, 4])), ["rotor_speeds[2] = nan; must be"]),
        (
            returning(Command(thrusts=[1] * 4, tilt_angles=[0, 0, 0, np.inf])),
            ["tilt_angles[3] = inf"],
        ),
        (
            returning(Command(thrusts=[1] * 4, tilt_angles=[0, 0, 3.2, 10])),
            ["returned tilt_angles[2] = 3.2; angles are in rad, from -3.14159 to 3.14159"],
        ),
        (returning(Command(thrusts=[10**400] * 4)), ["; expected 4 numbers"]),
        (returning(MuteError()), ["returned a MuteError; expected a tiltsim.Command"]),
        (leaves, ["leaves raised SystemExit: 5"]),
        (raises_unspeakably, ["raises_unspeakably raised MuteError (test_user_controller.py"]),
    ],
)
def test_a_failing_controller_ends_the_flight_with_one_line_and_a_log(law, words):
    with pytest.warns(RuntimeWarning, match=r"t = 0\.035 s \(failed\)") as shown:
        flight = tiltsim.simulate(scenario({"control_timestep": 0.005}), controller=law)
    (warning,) = shown
    assert (str(warning.message), warning.filename) == (flight.end.message, __file__)
    assert (flight.end.kind, flight.end.time) == ("failed", pytest.approx(0.035))
    assert flight.end.cause.startswith("the controller ")
    assert "\n" not in flight.end.cause
    for word in words:
        assert word in flight.end.cause
    np.testing.assert_allclose(flight["time"], [0.0, 0.01, 0.02, 0.03, 0.035])
    assert flight.metrics()["diverged"] is True


def test_failing_at_a_recorded_sample_does_not_record_it_twice():
    def law(observation):
        raise RuntimeError

    with pytest.warns(RuntimeWarning):
        flight = tiltsim.simulate(scenario(), controller=law)
    assert flight.end.cause.partition(" (")[0].endswith("law raised RuntimeError")
    assert len(flight) == 1
    assert flight.metrics()["duration"] == 0.0


def test_a_failing_reset_is_reported_like_a_failing_controller():
    class Law:
        def reset(self, scenario):
            raise KeyError("gain")

        def __call__(self, observation):
            return STILL

    with pytest.warns(RuntimeWarning, match="raised KeyError: 'gain'"):
        tiltsim.simulate(scenario(), controller=Law())


def test_the_first_failing_flight_of_many_is_reported():
    fails = scenario().replace({"simulation.duration": 0.05})
    fails = tiltsim.load_scenario(fails, controller=returning(None))
    flies = tiltsim.load_scenario(fails, controller=lambda _: STILL)
    with pytest.warns(RuntimeWarning, match="flight 2: .*expected a tiltsim.Command") as shown:
        ends = [result.end.kind for result in tiltsim.fly([flies, fails, fails])]
    assert ends == ["completed", "failed", "failed"]
    assert [warning.filename for warning in shown] == [__file__]


def test_the_quadrotor_has_no_tilt_servos():
    with pytest.warns(RuntimeWarning, match="tilt_angles; this vehicle has no tilt servos"):
        tiltsim.simulate(
            scenario(vehicle={"model": "quadrotor"}),
            controller=lambda _: Command(thrusts=[1.0] * 4, tilt_angles=[0.0] * 4),
        )


def test_an_interrupt_within_the_controller_interrupts_the_flight():
    def law(observation):
        if observation.time > 0.1:
            raise KeyboardInterrupt
        return STILL

    assert tiltsim.simulate(scenario(), controller=law).end.kind == "interrupted"


def test_a_controller_must_be_callable():
    with pytest.raises(InputError, match="controller = 3: must be callable"):
        tiltsim.simulate(scenario(), controller=3)


@pytest.mark.parametrize(
    ("tables", "words"),
    [
        ({"simulation": {"plant": "thesis"}}, ["simulation.plant", "mujoco plant only"]),
        ({"simulation": {"engine": "native"}}, ["simulation.engine", "python engine only"]),
        (
            {"controller": {"law": "python"}},
            ["needs controller.function = FILE.py:NAME", "controller="],
        ),
        (
            {
                "vehicle": {"model": "quadrotor"},
                "simulation": {"control_timestep": 0.01, "control_latency": 0.02},
            },
            ["control_latency", "not supported for the quadrotor"],
        ),
        (
            {"vehicle": {"model": "quadrotor"}, "gait": {"type": "fixed", "angles": [0.1] * 4}},
            ["gait", "not supported for the quadrotor"],
        ),
    ],
)
def test_scenarios_that_cannot_be_flown_are_refused(tables, words):
    document = {"controller": {"law": "python", "function": "a.py:b"}, **tables}
    line = refusal(tiltsim.parse_scenario, document)
    for word in words:
        assert word in line


# --- files and the command line -----------------------------------------------------------------


def test_the_command_line_flies_a_file_and_keeps_its_text(hover_file, tmp_path, capsys):
    law = tmp_path / "edited.py"
    law.write_text(hover_file.read_text(), encoding="utf-8")
    options = ["--set", "simulation.duration=0.3", "--set", "expect=[]"]
    command = ["run", "ch04_tracking/setpoint#rho_065_modified", *options]
    out, again = tmp_path / "out", tmp_path / "again"
    assert main([*command, "--controller", f"{law}:law", "--out", str(out)]) == 0
    assert "final_position_error_x" in capsys.readouterr().out
    assert (out / "edited.py").read_text() == HOVER
    resolved = tomllib.loads((out / "scenario.toml").read_text())
    assert resolved["controller"]["function"] == "edited.py:law"
    law.write_text("law = None", encoding="utf-8")
    assert main(["run", str(out / "scenario.toml"), "--quiet", "--out", str(again)]) == 0
    tables = [pq.read_table(folder / "flight.parquet") for folder in (out, again)]
    assert tables[0].equals(tables[1])
    assert load_flight(out).scenario.controller.function == f"{law}:law"


def test_a_class_in_a_file_beside_the_scenario(hover_file, monkeypatch, tmp_path):
    scenario_file = hover_file.parent / "scenario.toml"
    scenario_file.write_text(
        "[simulation]\nduration = 0.05\ncontrol_timestep = 0.01\n"
        '[controller]\nlaw = "python"\nfunction = "my_law.py:Slow"\n',
        encoding="utf-8",
    )
    monkeypatch.chdir(tmp_path)
    assert main(["run", str(scenario_file), "--quiet"]) == 0
    assert main(["check", "--trust", str(scenario_file)]) == 0


def test_a_failing_controller_exits_3_and_leaves_its_log(tmp_path, capsys):
    law = tmp_path / "bad.py"
    law.write_text(
        "import tiltsim\n\n\ndef law(observation):\n"
        "    thrusts = [1.0] * (4 if observation.time < 0.1 else 3)\n"
        "    return tiltsim.Command(thrusts=thrusts)\n",
        encoding="utf-8",
    )
    out = tmp_path / "out"
    command = ["run", "beyond/setpoint_exact_decoupler", "--set", "simulation.duration=1.0"]
    command += ["--controller", f"{law}:law", "--quiet", "--out", str(out)]
    assert main(command) == 3
    error = capsys.readouterr().err
    assert error == (
        "tiltsim: flight terminated early at t = 0.100 s (failed): the controller bad.py:law "
        "returned thrusts of shape (3,); expected shape (4,)\n"
    )
    assert json.loads((out / "metrics.json").read_text())["duration"] == pytest.approx(0.1)
    assert load_flight(out).end.kind == "failed"


@pytest.mark.parametrize(
    ("text", "name", "words"),
    [
        (None, "law", ["no such file"]),
        (HOVER, "lwa", ["lwa is not in the file; it has law, Slow"]),
        (HOVER, "not_callable", ["not_callable is not callable; it has law, Slow"]),
        ("import tiltsim\nlaw = (\n", "law", ["was never closed", "broken.py, line 2"]),
        ("import nonexistent_module", "law", ["ModuleNotFoundError", "broken.py, line 1"]),
        (
            "class Law:\n    def __init__(self, gain): pass",
            "Law",
            ["TypeError", "when it was made"],
        ),
        ("import sys; sys.exit(3)", "law", ["raised SystemExit: 3", "broken.py, line 1"]),
        ("\0", "law", ["null bytes", "broken.py:law"]),
        (
            "import tiltsim\n@tiltsim.law\ndef law(seen): return None",
            "law",
            ["the law returned None; expected a tiltsim.Command"],
        ),
    ],
)
def test_files_that_hold_no_controller_exit_2(tmp_path, capsys, text, name, words):
    file = tmp_path / "broken.py"
    if text is not None:
        file.write_text(text, encoding="utf-8")
    command = ["run", "beyond/setpoint_exact_decoupler", "--set", "simulation.duration=0.01"]
    assert main([*command, "--controller", f"{file}:{name}"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    for word in words:
        assert word in error


def test_a_name_without_a_file_exits_2(capsys):
    command = ["run", "beyond/setpoint_exact_decoupler", "--controller", "my_law"]
    assert main(command) == 2
    assert "FILE.py:NAME" in capsys.readouterr().err


@each_model
def test_flights_of_a_users_own_read_back(law, model, tmp_path):
    flight = tiltsim.simulate(scenario(vehicle={"model": model}), controller=law)
    flight.save(tmp_path)
    back = load_flight(tmp_path)
    np.testing.assert_array_equal(back.samples, flight.samples)
    assert back.metrics() == flight.metrics()
    assert main(["plot", str(tmp_path), "--panels", "rotor_speeds,path"]) == 0


# --- documentation -------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_documented_examples_fly(capsys):
    names = {}
    for block in code("docs/own_controller.md", "python"):
        exec(compile(block, "own_controller.md", "exec"), names)
    plain, integral = capsys.readouterr().out.splitlines()
    end, x, z = plain.split()
    assert end == "completed"
    assert (float(x), float(z)) == pytest.approx((2.0, 1.0), abs=1e-3)
    assert abs(float(integral)) < 1e-3
    # Without the integral, the wind leaves an error of 0.3 m/s^2 over the gain of 1 / s^2.
    bare = tiltsim.simulate(names["flight"].scenario, controller=names["hover"])
    assert bare.metrics()["final_position_error_x"] == pytest.approx(-0.3, abs=0.01)


def test_the_documented_law_is_short():
    law, _, flight = code("docs/own_controller.md", "python")[0].partition("\n\n\nscenario = ")
    assert len([line for line in law.splitlines() if line.strip()]) <= 12
    assert "controller=hover" in flight
