"""The attitude-altitude law against the equations of ch. 3 and ch. 4, written out in NumPy."""

from __future__ import annotations

from math import asin, hypot, isnan

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.controllers.flat_laws import attitude_altitude_inputs
from tests.thesis import force_matrix, torque_matrix
from tiltsim_controllers.gaits.motion import FIXED, GaitParameters
from tiltsim_controllers.laws.allocation import RotorRange
from tiltsim_controllers.laws.attitude_altitude import DECOUPLINGS, Gains, Parameters
from tiltsim_controllers.laws.feedback import (
    DECOUPLERS,
    conventional_decoupler,
    exact_decoupler,
    modified_decoupler,
)
from tiltsim_controllers.laws.gains import GAIN_SETS
from tiltsim_controllers.laws.supervisor import Supervisor
from tiltsim_controllers.mathematics.records import flatten, unflatten
from tiltsim_controllers.references.trajectories import REFERENCE_TYPES, ReferenceParameters
from tiltsim_controllers.vehicle.cross import torque_free_force
from tiltsim_controllers.vehicle.parameters import PRESETS, SPIN, drag_ratio

AR_DRONE = PRESETS["ar_drone_2"]
STATES = 25  # random states for each combination
TIME = 3.7
POSITION_DECOUPLERS = ("conventional", "modified", "exact")


def inertia(vehicle):
    return np.diag([vehicle.inertia_xx, vehicle.inertia_yy, vehicle.inertia_zz])


def rotation(roll, pitch, yaw):
    """Ch. 3, Eq. (2), as Rz(yaw) Ry(pitch) Rx(roll)."""
    return Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()


def hat(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def second_derivatives(vehicle, alpha, turn, speeds):
    """Second derivatives of roll, pitch, yaw and altitude, ch. 3, Eqs. (4), (8) and (10)."""
    w = speeds * np.abs(speeds)
    angular = np.linalg.solve(inertia(vehicle), torque_matrix(vehicle, alpha) @ w)
    vertical = (turn @ force_matrix(vehicle, alpha) @ w)[2] / vehicle.mass - vehicle.gravity
    return np.array([*angular, vertical])


def side_forces(vehicle, alpha):
    """F_X, F_Y of ch. 4, Eq. (11), with K_f counted once."""
    force = force_matrix(vehicle, alpha)
    level = np.vstack(
        [np.linalg.inv(inertia(vehicle)) @ torque_matrix(vehicle, alpha), force[2] / vehicle.mass]
    )
    return force[:2] @ np.linalg.inv(level) @ [0, 0, 0, vehicle.gravity]


def attitude_for(parameters, alpha, ax, ay, az):
    """Roll and pitch to reach a horizontal acceleration, ch. 4, Eqs. (7)-(11), or exactly."""
    vehicle, yaw, g = parameters.vehicle, parameters.reference.yaw, parameters.vehicle.gravity
    sy, cy = np.sin(yaw), np.cos(yaw)
    conventional = np.array([(ax * sy - ay * cy) / g, (ax * cy + ay * sy) / g])
    if parameters.decoupler == DECOUPLERS["conventional"]:
        return conventional
    if parameters.decoupler == DECOUPLERS["modified"]:
        fx, fy = side_forces(vehicle, alpha)
        return conventional + np.array([fy, -fx]) / (vehicle.mass * g)
    # The force that hovers without torque, turned by some roll and pitch onto the desired one.
    n = force_matrix(vehicle, alpha) @ np.linalg.svd(torque_matrix(vehicle, alpha))[2][3]
    n *= np.sign(n[2]) / np.linalg.norm(n)
    desired = rotation(0, 0, -yaw) @ [ax, ay, g + az]
    desired /= np.linalg.norm(desired)
    # Rx(roll) n has the desired y; Ry(pitch) then turns its x and z onto the desired ones.
    across = hypot(n[1], n[2])
    roll = np.arctan2(n[1], n[2]) - asin(desired[1] / across)
    turned = rotation(roll, 0, 0) @ n
    pitch = np.arctan2(desired[0], desired[2]) - np.arctan2(turned[0], turned[2])
    return np.array([roll, pitch])


def random_case(seed, decoupling, decoupler):
    """Parameters and a state for which the law is well conditioned, drawn from a seed."""
    random = np.random.default_rng(seed)

    def spread(size, scale):
        return random.uniform(-scale, scale, size)

    vehicle = random.choice(list(PRESETS))
    kind = "attitude_altitude" if decoupler == "none" else random.choice(["line", "circle"])
    parameters = Parameters(
        vehicle=PRESETS[vehicle],
        gains=unflatten(Gains, random.uniform(0.2, 60.0, 14)),
        gait=GaitParameters(FIXED),
        reference=ReferenceParameters(
            REFERENCE_TYPES[kind],
            *map(tuple, (spread(3, 0.05), spread(3, 0.05), spread(3, 0.2))),
            *random.uniform(0.1, 0.3, 2),
            **dict(zip(("roll", "pitch", "yaw"), spread(3, 0.4))),
            acceleration_feedforward=float(random.integers(2)),
        ),
        supervisor=Supervisor(),
        limits=RotorRange(),
        decoupler=DECOUPLERS[decoupler],
        decoupling=DECOUPLINGS[decoupling],
    )
    # Position and velocity near the reference: some attitude gives the desired acceleration.
    position, velocity, _ = reference_motion(parameters.reference)
    return unflatten(Parameters, flatten(parameters)), (
        *(position + spread(3, 0.05)).tolist(),
        *(velocity + spread(3, 0.05)).tolist(),
        *spread(3, 0.4).tolist(),
        *spread(3, 2.0).tolist(),
        *spread(4, 0.35).tolist(),
        *(random.uniform(150, 500, 4) * SPIN).tolist(),
    )


def reference_motion(reference):
    """Position, velocity, acceleration to track: ch. 4, Eqs. (42)-(44)."""
    centre = np.array(reference.position)
    if reference.type == REFERENCE_TYPES["circle"]:
        rate, radius = reference.angular_frequency, reference.radius
        turn = rotation(0, 0, rate * TIME)
        out = turn @ [radius, 0, 0]
        passed_on = reference.acceleration_feedforward
        return centre + out, rate * turn @ [0, radius, 0], -passed_on * rate**2 * out
    velocity, steady = np.array(reference.velocity), np.array(reference.acceleration)
    position = centre + velocity * TIME + 0.5 * steady * TIME**2
    return position, velocity + steady * TIME, reference.acceleration_feedforward * steady


def demanded_third_derivatives(parameters, state):
    """Ch. 4, Eqs. (26)-(30)."""
    gains, reference = parameters.gains, parameters.reference
    position, velocity, attitude, rates, alpha, speeds = np.split(
        np.array(state), [3, 6, 9, 12, 16]
    )
    wanted_position, wanted_velocity, demanded_acceleration = reference_motion(reference)
    if parameters.decoupler == DECOUPLERS["none"]:
        lean = np.array([reference.roll, reference.pitch])
    else:
        ax, ay, _ = (
            demanded_acceleration
            + gains.position[0] * (wanted_velocity - velocity)
            + gains.position[1] * (wanted_position - position)
        )
        lean = attitude_for(parameters, alpha, ax, ay, demanded_acceleration[2])
    k1, k2, k3 = np.transpose([*gains.loops.values()])
    second = second_derivatives(parameters.vehicle, alpha, rotation(*attitude), speeds)
    return (
        k1 * ([0, 0, 0, demanded_acceleration[2]] - second)
        + k2 * ([0, 0, 0, wanted_velocity[2]] - np.array([*rates, velocity[2]]))
        + k3 * ([*lean, reference.yaw, wanted_position[2]] - np.array([*attitude, position[2]]))
    )


def expected_inputs(parameters, state):
    """Ch. 4, Eqs. (18)-(19)."""
    vehicle = parameters.vehicle
    attitude, rates, alpha, speeds = np.split(np.array(state[6:]), [3, 6, 10])
    force, turn = force_matrix(vehicle, alpha), rotation(*attitude)
    angular = np.linalg.inv(inertia(vehicle)) @ torque_matrix(vehicle, alpha)
    vertical = (turn @ force)[2] / vehicle.mass * 2 * np.abs(speeds)
    if parameters.decoupling == DECOUPLINGS["exact"]:
        angular = angular * 2 * np.abs(speeds)
    matrix = np.vstack([angular, vertical])
    turning = (turn @ hat(rates) @ force @ (speeds * np.abs(speeds)))[2] / vehicle.mass
    right = demanded_third_derivatives(parameters, state) - [0, 0, 0, turning]
    return np.linalg.solve(matrix, right)


@pytest.mark.parametrize("decoupler", DECOUPLERS)
@pytest.mark.parametrize("decoupling", DECOUPLINGS)
def test_rotor_accelerations_follow_the_equations(decoupling, decoupler):
    for seed in range(STATES):
        parameters, state = random_case(seed, decoupling, decoupler)
        expected = expected_inputs(parameters, state)
        inputs = attitude_altitude_inputs(TIME, state, parameters)[:4]
        np.testing.assert_allclose(
            inputs, expected, rtol=0, atol=1e-9 * np.abs(expected).max(), err_msg=f"seed {seed}"
        )


@pytest.mark.parametrize("decoupler", DECOUPLERS)
def test_third_derivatives_are_those_demanded_under_the_exact_matrix(decoupler):
    """The plant of ch. 3, Eqs. (1)-(7), moved a little along the law's answer."""
    step = 1e-6
    for seed in range(STATES):
        parameters, state = random_case(seed, "exact", decoupler)
        attitude, rates, alpha, speeds = np.split(np.array(state[6:]), [3, 6, 10])
        inputs = np.array(attitude_altitude_inputs(TIME, state, parameters)[:4])
        ahead, behind = (
            second_derivatives(
                parameters.vehicle,
                alpha,
                rotation(*attitude) @ Rotation.from_rotvec(h * rates).as_matrix(),
                speeds + h * inputs,
            )
            for h in (step, -step)
        )
        third = (ahead - behind) / (2 * step)
        demanded = demanded_third_derivatives(parameters, state)
        np.testing.assert_allclose(
            third, demanded, rtol=0, atol=1e-6 * np.abs(demanded).max(), err_msg=f"seed {seed}"
        )


@pytest.mark.parametrize("decoupling", DECOUPLINGS)
@pytest.mark.parametrize("decoupler", POSITION_DECOUPLERS)
def test_hover_at_the_setpoint_needs_no_rotor_acceleration(decoupling, decoupler):
    parameters = Parameters(
        vehicle=AR_DRONE,
        gains=GAIN_SETS["ch04"],
        gait=GaitParameters(FIXED),
        reference=ReferenceParameters(REFERENCE_TYPES["setpoint"], (1.0, 2.0, 3.0), yaw=0.3),
        supervisor=Supervisor(),
        limits=RotorRange(),
        decoupler=DECOUPLERS[decoupler],
        decoupling=DECOUPLINGS[decoupling],
    )
    speed = (AR_DRONE.mass * AR_DRONE.gravity / (4 * AR_DRONE.thrust_coefficient)) ** 0.5
    state = (1.0, 2.0, 3.0, *[0.0] * 5, 0.3, *[0.0] * 7, *(speed * sign for sign in SPIN))
    assert attitude_altitude_inputs(0.0, state, parameters)[:4] == pytest.approx(
        [0.0] * 4, abs=1e-9
    )


@pytest.mark.parametrize("decoupling", DECOUPLINGS)
def test_inputs_are_nan_where_a_rotor_at_rest_makes_the_matrix_singular(decoupling):
    parameters, state = random_case(0, decoupling, "modified")
    # The published matrix has the speeds in its last row alone: singular when all four vanish.
    stopped = {"published": 4, "exact": 1}[decoupling]
    state = (*state[: 20 - stopped], *[0.0] * stopped)
    assert any(isnan(value) for value in attitude_altitude_inputs(TIME, state, parameters)[:4])


@pytest.mark.parametrize("decoupler", DECOUPLERS)
def test_inputs_are_nan_where_the_tilt_angles_cost_the_torque_matrix_its_rank(decoupler):
    parameters, state = random_case(0, "published", decoupler)
    parameters = parameters._replace(vehicle=AR_DRONE)
    delta = np.arctan(drag_ratio(AR_DRONE))  # the point P of the two color map, on the blue plane
    state = (*state[:12], delta, -delta, delta, -delta, *state[16:])
    assert all(isnan(value) for value in attitude_altitude_inputs(TIME, state, parameters)[:4])


# --- decouplers --------------------------------------------------------------------------------

GRAVITY = 9.8


def leaning(alpha, vehicle=AR_DRONE):
    """The direction of the torque-free force, as the law gives it to its decouplers."""
    return torque_free_force(np.array(alpha), drag_ratio(vehicle))


def test_conventional_decoupler_is_eqs_7_and_8():
    ax, ay, yaw = 0.7, -1.1, 2.3
    roll, pitch = conventional_decoupler(ax, ay, yaw, GRAVITY)
    assert roll == pytest.approx((ax * np.sin(yaw) - ay * np.cos(yaw)) / GRAVITY, rel=1e-14)
    assert pitch == pytest.approx((ax * np.cos(yaw) + ay * np.sin(yaw)) / GRAVITY, rel=1e-14)


@pytest.mark.parametrize("vehicle", PRESETS.values(), ids=PRESETS)
def test_modified_decoupler_is_eq_11_with_its_inverse_written_out(vehicle):
    random = np.random.default_rng(11)
    for _ in range(STATES):
        alpha = random.uniform(-0.6, 0.6, 4)
        ax, ay, yaw = random.uniform(-2.0, 2.0, 3)
        modified = modified_decoupler(ax, ay, yaw, vehicle.gravity, leaning(alpha, vehicle))
        conventional = conventional_decoupler(ax, ay, yaw, vehicle.gravity)
        fx, fy = side_forces(vehicle, alpha)
        weight = vehicle.mass * vehicle.gravity
        expected = np.add(conventional, (fy / weight, -fx / weight))
        np.testing.assert_allclose(modified, expected, rtol=0, atol=1e-11, err_msg=f"{alpha}")


@pytest.mark.parametrize("side", [1.0, -1.0], ids=["thrust along n", "thrust against n"])
def test_exact_decoupler_points_the_torque_free_force_along_the_wanted_one(side):
    random = np.random.default_rng(9)
    for _ in range(4 * STATES):
        n = random.uniform(0.5, 5.0) * np.array([*random.uniform(-0.5, 0.5, 2), 1.0])
        ax, ay, az = random.uniform(-3.0, 3.0, 3)
        yaw = random.uniform(-np.pi, np.pi)
        roll, pitch = exact_decoupler(ax, ay, az, yaw, GRAVITY, tuple(side * n))
        force = rotation(roll, pitch, yaw) @ n / np.linalg.norm(n)
        desired = np.array([ax, ay, GRAVITY + az])
        np.testing.assert_allclose(force, desired / np.linalg.norm(desired), rtol=0, atol=1e-13)


def test_exact_decoupler_has_no_answer_in_free_fall():
    """Floats do not divide by zero, native code does and went on with an answer."""
    assert np.isnan(exact_decoupler(0.0, 0.0, -GRAVITY, 0.3, GRAVITY, (0.1, 0.2, 3.0))).all()


def test_exact_decoupler_gets_as_near_as_any_attitude_where_none_reaches_the_wanted_force():
    n = np.array([3.0, 0.2, 1.0])  # across the body lies at most a third of it
    ax, ay, az, yaw = 1.0, 12.0, 0.0, 0.4
    desired = np.array([ax, ay, GRAVITY + az])

    def along(roll, pitch):
        return desired @ rotation(roll, pitch, yaw) @ n

    reached = along(*exact_decoupler(ax, ay, az, yaw, GRAVITY, tuple(n)))
    grid = np.linspace(-np.pi, np.pi, 61)
    best = max(along(roll, pitch) for roll in grid for pitch in grid)
    assert reached >= best
    assert reached < np.linalg.norm(desired) * np.linalg.norm(n) * 0.99


def test_modified_decoupler_is_the_conventional_one_where_the_force_is_vertical():
    arguments = (0.7, -1.1, 0.4, GRAVITY)
    assert modified_decoupler(*arguments, (0.0, 0.0, 2.6)) == conventional_decoupler(*arguments)


@pytest.mark.parametrize("lean", [0.0, 1.0], ids=["vertical force", "leaning force"])
def test_exact_decoupler_is_the_modified_one_to_first_order(lean):
    """Their difference falls by four when acceleration and lean are halved."""
    random = np.random.default_rng(5)
    for _ in range(STATES):
        ax, ay = random.uniform(-GRAVITY, GRAVITY, 2)
        nx, ny, yaw = random.uniform(-1.0, 1.0, 3) * (lean, lean, np.pi)

        def difference(small, ax=ax, ay=ay, nx=nx, ny=ny, yaw=yaw):
            n = (small * nx, small * ny, 1.0)
            exact = exact_decoupler(small * ax, small * ay, 0.0, yaw, GRAVITY, n)
            modified = modified_decoupler(small * ax, small * ay, yaw, GRAVITY, n)
            return np.abs(np.subtract(exact, modified)).max()

        assert difference(1e-2) < 10 * 1e-4
        assert difference(5e-3) < difference(1e-2) / 3.5
