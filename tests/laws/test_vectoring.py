"""The law `vectoring`: disturbances, limits, latency, lag, faults, plants and engines."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

import tiltsim
from tests.laws.test_multirotor import mjcf
from tiltsim.laws.assembling import assemble
from tiltsim.studies.benchmark import compiled_time_per_call
from tiltsim_controllers.analysis.vectoring_design import TRACKING
from tiltsim_controllers.analysis.vectoring_limits import Craft, side_slope
from tiltsim_controllers.laws.vectoring_state import following, predicted, servo_doubts
from tiltsim_controllers.laws.vectoring_steps import (
    Frame,
    Motion,
    braked,
    demanded,
    moved,
    turn_by,
    turning,
)
from tiltsim_controllers.mathematics.moving import Moving
from tiltsim_controllers.vehicle.rotors import force_and_torque, table_per_newton

LAG = {"rotor_time_constant": 0.03, "min_rotor_speed": 60.0, "max_rotor_speed": 838.0}
LATE = {"timestep": 0.002, "control_timestep": 0.004, "control_latency": 0.008}
CIRCLE = {
    "reference": {"type": "circle", "radius": 1.7, "angular_frequency": 0.9},
    "initial": {"position": [1.7, 0.0, 0.0], "velocity": [0.0, 1.53, 0.0]},
}


def tables(vehicle, duration, late=LATE, **changes):
    """A vehicle of the fleet in the world of these tests."""
    free = {"tilts": "free"} if vehicle.startswith("tilt") else {}
    return {
        "vehicle": {"model": "multirotor", "mjcf": mjcf(vehicle), **LAG},
        "controller": {"law": "vectoring", **free},
        "model_error": {"mass": 1.1, "thrust_coefficient": 0.9},
        "simulation": {"duration": duration, "engine": "native", **late},
        **changes,
    }


def fly(vehicle, duration, **changes):
    flight = tiltsim.simulate(tables(vehicle, duration, **changes))
    assert flight.end.kind == "completed", flight.end
    return flight


def position_error(flight):
    return np.linalg.norm(flight["reference_position"] - flight["position"], axis=1)


def test_observers_remove_a_constant_force_and_a_weak_rotor():
    flight = fly(
        "quadrotor",
        4.0,
        disturbance=[{"type": "acceleration", "value": [1.5, -1.0, 0.8]}],
        fault=[{"type": "partial_thrust", "rotor": 1, "time": 1.0, "factor": 0.85}],
    )
    error = position_error(flight)
    assert error.max() < 0.1
    assert error[-10:].max() < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", ["hexarotor", "cant_hexarotor", "tilt_octorotor"])
def test_a_circle_is_followed_with_rotors_that_lag(vehicle):
    flight = fly(vehicle, 4.0, **CIRCLE)
    assert position_error(flight)[flight["time"] > 2.0].max() < 0.012


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", ["quadrotor", "tilt_octorotor"])
def test_native_flights_are_those_in_python(vehicle):
    turning = {"reference": {"type": "table", "rows": [*turning_rows(0.3)]}}
    moves = turning if vehicle.startswith("tilt") else CIRCLE
    for late in (LATE, {"timestep": 0.002}):
        python, native = (
            tiltsim.simulate(tables(vehicle, 0.2, late={**late, "engine": engine}, **moves))
            for engine in ("python", "native")
        )
        np.testing.assert_array_equal(python.samples, native.samples)


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", ["hexarotor", "tilt_octorotor"])
def test_the_rigid_body_flies_as_in_mujoco(vehicle):
    mujoco, equations = (
        fly(vehicle, 1.0, late={**LATE, "plant": plant}, **CIRCLE)
        for plant in ("mujoco", "rigid_body")
    )
    assert np.abs(mujoco["position"] - equations["position"]).max() < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize(
    "late", [LATE, {"timestep": 0.002, "control_timestep": 0.01, "control_latency": 0.02}]
)
@pytest.mark.parametrize("vehicle", ["quadrotor", "tilt_hexarotor"])
def test_a_step_is_flown_at_the_limits_of_the_rotors(vehicle, late):
    target = {"type": "setpoint", "position": [1.3, -0.7, 0.5]}
    flight = fly(vehicle, 4.0, late=late, reference=target)
    speeds = np.abs(flight["rotor_speeds"])
    assert speeds.max() <= 838.0
    assert speeds.min() >= 60.0
    assert position_error(flight)[-1] < 0.02


@pytest.mark.slow
def test_a_stuck_servo_is_left_out():
    stuck = [{"type": "stuck_servo", "rotor": 2, "time": 1.0, "angle": 0.4}]
    flight = fly("tilt_hexarotor", 6.0, fault=stuck, **CIRCLE)
    error = position_error(flight)
    assert error.max() < 0.12
    assert error[-1] < 0.01


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", ["tricopter", "bicopter"])
def test_two_and_three_rotors_fly_with_their_tilts(vehicle):
    changed = tables(vehicle, 4.0, **CIRCLE)
    changed["controller"]["tilts"] = "free"
    flight = tiltsim.simulate(changed)
    assert flight.end.kind == "completed", flight.end
    assert position_error(flight)[flight["time"] > 2.0].max() < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("known", [{}, {"failed_rotor": 1, "failure_known_from": 2.05}])
@pytest.mark.parametrize("vehicle", ["hexarotor", "tilt_hexarotor"])
def test_a_lost_rotor_is_survived(vehicle, known):
    changed = tables(vehicle, 6.0, **CIRCLE)
    changed["controller"].update(known)
    changed["fault"] = [{"type": "rotor_loss", "rotor": 1, "time": 2.0}]
    flight = tiltsim.simulate(changed)
    assert flight.end.kind == "completed", flight.end
    assert position_error(flight).max() < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("rotor", [1, 2])
def test_five_canted_rotors_fly_a_circle(rotor):
    """Their torques push sideways, which bounds the bandwidth, and saturate: yaw gives way."""
    changed = tables("cant_hexarotor", 6.0, late={"timestep": 0.002}, **CIRCLE)
    del changed["model_error"], changed["vehicle"]["rotor_time_constant"]
    changed["controller"].update(failed_rotor=rotor, failure_known_from=2.02)
    changed["fault"] = [{"type": "rotor_loss", "rotor": rotor, "time": 2.0}]
    flight = tiltsim.simulate(changed)
    error = position_error(flight)
    assert error.max() < 0.16
    assert error[-1] < 2e-3


@pytest.mark.slow
def test_a_landing_on_a_moving_platform_is_no_disturbance():
    """Observers that took the push of the deck for a disturbance tipped the vehicle over."""
    scenario = tiltsim.load_scenario("interaction/platform")
    free = {"law": "vectoring", "tilts": "free"}
    flight = tiltsim.simulate(scenario.replace({"controller": free}))
    metrics = flight.metrics()
    assert flight.end.kind == "completed", flight.end
    assert metrics["time_in_contact"] > 2.5
    assert metrics["max_abs_pitch"] < 0.01
    assert abs(metrics["final_position_error_z"] + 0.02) < 1e-3


@pytest.mark.slow
def test_a_call_for_eight_rotors_with_eight_tilts_takes_microseconds():
    changed = tables("tilt_octorotor", 1.0)
    del changed["simulation"]["engine"]
    scenario = tiltsim.load_scenario(changed)
    assert min(compiled_time_per_call(scenario) for _ in range(3)) < 10e-6


WORLDS = {
    "quick rotors": {"vehicle.rotor_time_constant": 0.02},
    "slow rotors": {"vehicle.rotor_time_constant": 0.05},
    "late": {"simulation.control_latency": 0.02},
    "slow samples": {"simulation.control_timestep": 0.01, "simulation.control_latency": 0.02},
    "heavy": {"model_error.mass": 1.4},
    "weak": {"model_error.thrust_coefficient": 0.75},
}


@pytest.mark.slow
@pytest.mark.parametrize("world", WORLDS)
def test_a_step_is_flown_in_every_world(world):
    target = {"type": "setpoint", "position": [1.3, -0.7, 0.5]}
    for vehicle in ("cant_hexarotor", "tilt_octorotor"):
        scenario = tiltsim.load_scenario(tables(vehicle, 4.0, reference=target), WORLDS[world])
        flight = tiltsim.simulate(scenario)
        assert flight.end.kind == "completed", flight.end
        assert position_error(flight)[-1] < 0.05


@pytest.mark.slow
def test_sensor_noise_costs_little():
    noise = {"attitude_noise": 0.01, "body_rates_noise": 0.05, "velocity_noise": 0.02}
    flight = fly("quadrotor", 4.0, sensors={**noise, "position_noise": 0.01}, **CIRCLE)
    changes = np.diff(flight["rotor_speeds"], axis=0) / np.diff(flight["time"])[:, np.newaxis]
    assert np.sqrt(np.mean(changes**2)) < 900.0
    assert position_error(flight)[flight["time"] > 2.0].max() < 0.03


def test_yaw_holds_while_a_step_takes_all_torque():
    """Yaw rates of a lean to come turned the nose by 0.25 rad here."""
    target = {"type": "setpoint", "position": [1.3, -0.7, 0.5]}
    flight = fly("hexarotor", 2.5, reference=target)
    assert np.abs(flight["yaw"]).max() < 0.15


def test_a_motion_away_is_stopped_by_all_that_leans_back_in_time():
    """The push of the feedback grows with the speed away, and not with the speed back."""
    numbers = {"acceleration": 6.0, "direct": 6.0, "lean_time": 0.2, "greatest": 20.0}
    known = design_of("quadrotor", PLAIN)._replace(**numbers)
    frame = Frame(1.0, 9.81, np.eye(3), 1.0, np.zeros(3), np.zeros(3))

    def push(speed):
        error = Moving(np.array([9.0, 0.0, 0.0]), np.array([speed, 0.0, 0.0]), np.zeros(3))
        ahead = Moving(np.zeros(3), np.zeros(3), np.zeros(3))
        return demanded(error, np.zeros(3), ahead, frame, known).value[0]

    assert (
        push(0.0) == pytest.approx(push(0.6)) == pytest.approx(6.0)
    )  # 0.6 m/s is half of the lean's time
    assert 6.0 < push(0.8) < push(1.0) < push(9.0) == pytest.approx(12.0)


@pytest.mark.slow
@pytest.mark.parametrize(("vehicle", "fastest"), [("tiltrotor", 500.0), ("tilt_octorotor", 647.0)])
def test_a_weak_tilting_vehicle_keeps_its_height(vehicle, fastest):
    """Level tilts lift with all thrust, of which hover needs 0.82 here."""
    target = {"type": "setpoint", "position": [0.2, -0.1, 0.1]}
    changed = tables(vehicle, 4.0, reference=target)
    changed["vehicle"]["max_rotor_speed"] = fastest
    changed["model_error"] = {"mass": 1.19, "thrust_coefficient": 0.76}
    assert position_error(tiltsim.simulate(changed))[-1] < 0.01


# --- poses -------------------------------------------------------------------------------------


def pose(**angles):
    return {"type": "setpoint", "position": [0.4, -0.3, 0.2], **angles}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("vehicle", "roll", "pitch"),
    [("omni_octorotor", 1.2, -0.5), ("tilt_hexarotor", 0.3, 0.2), ("cant_hexarotor", 0.05, 0.0)],
)
def test_a_vehicle_with_side_force_takes_a_pose(vehicle, roll, pitch):
    changed = tables(vehicle, 4.0, reference=pose(roll=roll, pitch=pitch, yaw=0.4))
    if vehicle.startswith("omni"):
        del changed["vehicle"]["min_rotor_speed"]  # reversing, within the limits of its file
    flight = tiltsim.simulate(changed)
    np.testing.assert_allclose(flight["attitude"][-1], [roll, pitch, 0.4], atol=1e-3)
    assert position_error(flight)[-1] < 2e-3


def turning_rows(lean):
    """A motion from rest whose yaw turns by a revolution, and whose roll and pitch sway."""
    for time in np.linspace(0.0, 4.0, 41):
        sway, turn = lean * np.sin(np.pi * time / 2.0) ** 3, time - np.sin(np.pi * time) / np.pi
        yield [time, *(0.3 * turn * np.ones(3)), sway, -sway, np.pi / 2.0 * turn]


@pytest.mark.slow
@pytest.mark.parametrize(("vehicle", "lean"), [("tilt_hexarotor", 0.3), ("cant_hexarotor", 0.0)])
def test_a_moving_attitude_is_led(vehicle, lean):
    """With its rates and their rates ahead, the error is far below the one of a lag."""
    moving = {"type": "table", "rows": [*turning_rows(lean)]}
    flight = fly(vehicle, 4.0, reference=moving)
    off = flight["attitude"] - flight["reference_attitude"]
    led = slice(0, 3) if lean else slice(2, 3)  # else roll and pitch lean to move
    assert np.abs(np.angle(np.exp(1j * off[:, led]))).max() < 0.005
    assert position_error(flight).max() < 0.04


@pytest.mark.parametrize(
    ("vehicle", "angles", "words"),
    [
        ("hexarotor", {"pitch": 0.1}, "reference.pitch = 0.1: .* no outputs of a vehicle that"),
        ("cant_hexarotor", {"roll": 0.2}, "reference.roll = 0.2: .* hovers at up to 0.07"),
        ("tilt_octorotor", {"roll": 0.6}, "hovers at up to 0.54"),
    ],
)
def test_a_pose_beyond_the_side_force_is_refused(vehicle, angles, words):
    with pytest.raises(tiltsim.InputError, match=words):
        tiltsim.simulate(tables(vehicle, 1.0, reference=pose(**angles)))


# --- limit cases -------------------------------------------------------------------------------


TURNING_PODS = {"type": "table", "rows": [[time, *[0.2 * time] * 6] for time in (0.0, 0.5, 1.0)]}
"""All pods turn alike, at a constant rate, so that the axis of the vehicle stays."""


def assembly_of(vehicle, controller, timestep=0.002, **gait):
    """A flight that begins off every reference but roll and pitch."""
    return assemble(
        tiltsim.load_scenario(
            {
                "vehicle": {"model": "multirotor", "mjcf": mjcf(vehicle)},
                "controller": controller,
                "reference": {"type": "setpoint", "position": [0.0, 0.0, 0.02], "yaw": 0.02},
                "initial": {"velocity": [0.0, 0.0, 0.1], "rotor_speed": SPEEDS[vehicle]},
                "simulation": {"timestep": timestep, "duration": 1.0},
                **gait,
            }
        )
    )


def design_of(vehicle, controller, **gait):
    """Parameters of the law."""
    return assembly_of(vehicle, controller, **gait).setup.parameters.law.own


def first_accelerations(vehicle, controller, timestep=0.002, own=None, **tables):
    """Rotor accelerations (rad/s^2) at time zero, with changed parameters of the law."""
    assembly = assembly_of(vehicle, controller, timestep, **tables)
    loop, setup = assembly.loop, assembly.setup
    state = (*loop.kind.initial_motion(assembly), loop.initial_activations(assembly, setup))
    known = setup.parameters
    if own:
        known = known._replace(law=known.law._replace(own=known.law.own._replace(**own)))
    controls = loop.controls(0.0, *state, known, setup.knots)
    rotors = len(SPEEDS[vehicle])
    first = rotors + max(loop.tilt_of_rotor) + 1  # tilts come before
    return np.array(controls[first : first + rotors])


def limit_of_periods(vehicle, **tables):
    """Rotor accelerations (rad/s^2) of the plain law as its period goes to zero."""
    periods = np.array([1.0, 2.0, 4.0, 8.0])
    found = [first_accelerations(vehicle, PLAIN, 1e-6 * each, **tables) for each in periods]
    return np.linalg.solve(np.vander(periods, increasing=True), found)[0]


SPEEDS = {
    "quadrotor": [300.0, 310.0, 330.0, 305.0],
    "tilt_hexarotor": [540.0, 550.0, 530.0, 545.0, 535.0, 552.0],
    "omni_octorotor": [310.0, 320.0, 300.0, 330.0, 305.0, 315.0, 325.0, 308.0],
}
PLAIN = {
    **{"law": "vectoring", "observer": 0.0, "prediction": False, "restoring": 0.0},
    **{"position_bandwidth": 2.0, "attitude_bandwidth": 9.0},
}
C, A = TRACKING, 9.0


@pytest.mark.parametrize(
    ("vehicle", "gait"), [("quadrotor", {}), ("tilt_hexarotor", {"gait": TURNING_PODS})]
)
def test_without_limits_and_observers_the_law_is_feedback_linearization(vehicle, gait):
    """With period to zero, observers off, and errors below the braking curves: poles placed.

    The pods of the hexarotor move, whose rates the thrusts make good.
    """
    limit = limit_of_periods(vehicle, **gait)
    known = design_of(vehicle, PLAIN, **gait)
    yaw = known.yaw
    height = [C, C * 2.0 * known.rise_damping * known.rise, C * known.rise**2]
    rows = np.array([[C, C, C], [C * 1.8 * A, C * 1.8 * A, C * 1.8 * yaw], [C * A * A] * 3])
    rows[2, 2] = C * yaw * yaw
    exact = {
        "law": "attitude_force",
        "gains": {"attitude": rows.tolist(), "altitude": height},
        "attitude_error": "euler_angles",
        "max_angular_acceleration": 1e6,
        **{"dimension": 1, "norm": "thrust", "restoring": 0.0},
    }
    expected = first_accelerations(vehicle, exact, **gait)
    np.testing.assert_allclose(limit, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("rates", [[0.0, 0.0, 0.0], [0.2, -0.3, 0.1]])
def test_with_hard_side_force_the_law_is_full_pose_but_for_the_turning_force(rates):
    """Its force turns with the body, where `full_pose` adds ``-omega x F`` to hold it in space.

    Side force is made hard, height and yaw get the gains of the other axes, and the body points
    where it shall: of an attitude error the one law takes the angle, the other one a sine.
    """
    vehicle = "omni_octorotor"
    moving = {
        "reference": {"type": "setpoint", "position": [0.02, -0.01, 0.015]},
        "initial": {
            **{"velocity": [0.02, 0.03, -0.02], "angular_velocity": rates},
            "rotor_speed": SPEEDS[vehicle],
        },
    }
    alike = {"damping": 1.0, "rise": 2.0, "rise_damping": 1.0, "yaw": A, "side_softness": 1e-12}
    limit = limit_of_periods(vehicle, own=alike, **moving)
    gains = {"position": [C, C * 4.0, C * 4.0], "attitude": [C, C * 1.8 * A, C * A * A]}
    pose = {"law": "full_pose", "gains": gains}
    expected = first_accelerations(vehicle, pose, **moving)
    airframe = tiltsim.airframe(tables(vehicle, 1.0)).vehicle
    rows = np.vstack(force_and_torque(airframe.table))
    speeds = airframe.spins * np.array(SPEEDS[vehicle])
    turning = np.cross(rates, rows[:3] @ (speeds * abs(speeds)))
    change = np.linalg.pinv(rows) @ [*turning, 0.0, 0.0, 0.0]
    expected = expected + airframe.spins * change / (2.0 * abs(speeds))
    np.testing.assert_allclose(limit, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())


def test_hover_has_the_poles_that_are_placed():
    """Held over a period, the wrench follows at ``(1 - exp(-rate period)) / period``."""
    step = 1e-4
    hover = {
        "vehicle": {"model": "multirotor", "mjcf": mjcf("quadrotor")},
        "controller": PLAIN,
        "simulation": {"timestep": step},
    }
    found = tiltsim.stability(hover)
    assert found.stable
    rate = (1.0 - np.exp(-C * step)) / step
    known = design_of("quadrotor", PLAIN)
    for damping, frequency in ((known.rise_damping, known.rise), (0.9, 9.0)):  # altitude and yaw
        cubic = np.array([1.0, 1.0, 2.0 * damping * frequency, frequency**2])
        for pole in np.roots(cubic * [1.0, rate, rate, rate]):
            assert np.abs(found.poles - pole).min() < 1e-6 * abs(pole)


# --- steps -------------------------------------------------------------------------------------


def test_rotation_vectors_turn():
    vector = np.array([0.3, -0.2, 0.9])
    turn = turn_by(vector)
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(turn @ vector, vector, atol=1e-15)
    assert np.trace(turn) == pytest.approx(1.0 + 2.0 * np.cos(np.linalg.norm(vector)), rel=1e-14)
    np.testing.assert_allclose(turn_by(np.zeros(3)), np.eye(3), atol=1e-20)


def test_a_braking_curve_ends_at_rest():
    """From any distance, at the demanded speed, the limit stops the error after the delay."""
    for error in (0.5, 2.0, 10.0):
        speed = braked(error, 1e3, 4.0, 0.1)
        assert speed * 0.1 + speed**2 / (2.0 * 4.0) == pytest.approx(error, rel=1e-12)
    assert braked(1e-3, 2.0, 4.0, 0.1) == 2e-3


def craft(vehicle, **changes):
    loaded = tiltsim.airframe(tables(vehicle, 1.0)).vehicle
    speeds = np.full(len(loaded.spins), 838.0)
    numbers = {
        "table": table_per_newton(loaded.table, loaded.thrust_coefficients),
        "mass": loaded.mass,
        "gravity": loaded.gravity,
        "inertia": np.reshape(loaded.inertia, (3, 3)),
        "thrust": np.array(loaded.thrust_coefficients),
        "slowest": 0.0 * speeds,
        "fastest": speeds,
        "tilts": np.zeros(loaded.tilts),
        "commanded": False,
        "tilt_range": 0.7,
        "moving": False,
        "levers": np.ones(len(speeds)),
        "works": np.ones(len(speeds)),
    }
    return Craft(**{**numbers, **changes})


def test_only_canted_rotors_have_side_force_without_leaning():
    flat, canted = craft("hexarotor"), craft("cant_hexarotor")
    assert side_slope(flat) == 0.0
    slope = side_slope(canted)
    assert 0.02 < slope < 1.0
    stronger = craft("cant_hexarotor", fastest=1.2 * canted.fastest)
    assert side_slope(stronger) >= slope
    assert side_slope(craft("cant_hexarotor", moving=True)) == 0.0


def test_attitude_is_no_faster_than_its_servos():
    """No prediction knows their greatest rate: with 8 rad/s, heavy vehicles wandered on curves."""
    found = []
    for fastest in (5.0, 50.0, None):
        changed = tables("tilt_octorotor", 1.0)
        changed["vehicle"]["tilt_servo"] = {"max_rate": fastest} if fastest else {}
        law = tiltsim.load_scenario(changed).controller
        found.append(law.law_parameters(tiltsim.airframe(changed)).attitude)
    assert found[0] == pytest.approx(1.6 * 5.0)
    assert found[0] < found[1] == found[2]


def test_side_force_of_tilts_stays_within_their_range():
    """No more than all rotors have at the tilts that it may take."""
    slopes = []
    for most in (0.3, 0.7):
        tilting = craft("tilt_octorotor", tilts=np.zeros(8), commanded=True, tilt_range=most)
        slopes.append(side_slope(tilting))
        assert 0.5 * np.tan(0.9 * most) < slopes[-1] / 0.8 < np.tan(0.9 * most)
    assert slopes[0] < slopes[1]


def designed(vehicle):
    """Parameters of the law in the world of these tests."""
    changed = tables(vehicle, 1.0)
    law = tiltsim.load_scenario(changed).controller
    return law.law_parameters(tiltsim.airframe(changed))


def test_the_model_of_rotors_is_their_lag():
    """Commands ramp over a period of 4 ms, and speeds follow them with a lag of 30 ms."""
    p, steps, (before, first, last) = designed("quadrotor"), 1000, (300.0, 400.0, 650.0)
    speed = before
    for step in range(steps):
        command = first + (last - first) * (step + 0.5) / steps
        speed += (command - speed) * (1.0 - np.exp(-0.004 / steps / 0.03))
    found = following(SimpleNamespace(p=p), before, (first, last))
    assert found == pytest.approx(speed, rel=1e-8)  # of the sum
    assert p.begun == pytest.approx(1.0 - np.exp(-0.002 / 0.03))
    assert p.gone == pytest.approx(1.0 - np.exp(-0.004 / 0.03))


@pytest.mark.parametrize("vehicle", SPEEDS)
def test_every_demand_is_soft(vehicle):
    """A softness of zero or less would make the allocation's system singular."""
    p = designed(vehicle)
    for able in (p, p.after):
        assert min(able.side_softness, able.lean_softness, able.yaw_softness) > 0.0


def test_a_lean_is_corrected_about_its_axis():
    still = Motion(np.zeros(3), np.zeros(3), np.eye(3), np.zeros(3))
    p, error = designed("quadrotor"), np.array([2e-3, 5e-3, 0.0])
    found = turning(still, turn_by(error), np.zeros(3), np.zeros(3), p)
    np.testing.assert_allclose(found, p.attitude**2 * error, rtol=1e-4, atol=1e-9)


def test_a_servo_that_does_not_move_is_doubted():
    """A second servo that moves is not, nor one that has arrived."""
    p, doubt = SimpleNamespace(patience=0.05, period=0.004), np.zeros(3)
    seen = SimpleNamespace(
        tilt_commands=np.array([0.3, 0.3, 0.1]),
        tilt_angles=np.array([0.0, 0.0, 0.1]),
        tilt_rates=np.array([0.0, 6.0, 0.0]),
    )
    for call in range(1, 30):
        known = SimpleNamespace(seen=seen, p=p, memory=SimpleNamespace(doubt=doubt))
        rates, usable = servo_doubts(known)
        doubt = doubt + p.period * rates
        np.testing.assert_allclose(doubt, [min(call * 0.004, 0.1), 0.0, 0.0], atol=1e-15)
        assert usable.tolist() == [float(call < 13), 1.0, 1.0]


def test_the_state_ahead_is_reached_by_the_commands_on_their_way():
    p = SimpleNamespace(
        predicts=1.0, late=0.003, begun=0.2, period=0.004, keep=0.8, old=0.12, new=0.08
    )
    frame = Frame(1.3, 9.81, np.diag([0.01, 0.012, 0.02]), 1.0, np.zeros(3), np.zeros(3))
    rate = np.array([0.4, -0.7, 0.3])
    body, speeds = Motion(np.ones(3), 2.0 * rate, turn_by(rate), rate), np.full(4, 300.0)
    asked = np.array([[300.0, 320.0, 310.0, 305.0], [350.0, 340.0, 300.0, 390.0], [400.0] * 4])

    def wrench(speeds, tilts):
        return np.hstack([0.1, 0.2, 4e-5 * speeds @ speeds, 1e-7 * speeds[:3] ** 2])

    none = np.zeros(0)
    seen = SimpleNamespace(
        thrusts=speeds,
        tilt_commands=none,
        tilt_angles=none,
        tilt_rates=none,
        rotor_speeds=speeds,
        reference=SimpleNamespace(tilt_rates=none),
    )
    known = SimpleNamespace(seen=seen, p=p, asked=asked, now=body, frame=frame, wrench=wrench)
    known.memory = SimpleNamespace(points=none)
    found = predicted(known, none)
    for before, after in pairwise(asked):
        then = 0.8 * speeds + 0.12 * before + 0.08 * after
        body, speeds = moved(body, wrench(0.5 * (speeds + then), none), frame, 0.004), then
    speeds = speeds + 0.2 * (asked[-1] - speeds)
    for part, expected in zip(found.now, moved(body, wrench(speeds, none), frame, 0.003)):
        np.testing.assert_allclose(part, expected, rtol=1e-13)
    np.testing.assert_allclose(found.speeds, speeds, rtol=1e-13)
    assert found.time == pytest.approx(0.011)
