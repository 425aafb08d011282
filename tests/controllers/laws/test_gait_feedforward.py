"""The law that counts its gait's rates in: chain rules, rigid-body motion, exactness."""

from __future__ import annotations

from math import cos, isnan, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tests.controllers.flat_laws import tracking_inputs
from tests.thesis import force_matrix, torque_matrix
from tiltsim_controllers.analysis.stability import feedforward_loops
from tiltsim_controllers.gaits.motion import FIXED, GaitParameters
from tiltsim_controllers.gaits.plans import continuous_trot, fixed
from tiltsim_controllers.laws.allocation import RotorRange
from tiltsim_controllers.laws.attitude_altitude import EXACT_DECOUPLING, Gains
from tiltsim_controllers.laws.feedback import (
    DECOUPLERS,
    angular_jerk,
    attitude_jerk,
    attitude_motion,
    exact_decoupler,
    integrator_rate,
    limited_acceleration,
    swept,
)
from tiltsim_controllers.laws.force_directions import jerk_along
from tiltsim_controllers.laws.gains import (
    IntegralGains,
    Poles,
    gains_from_poles,
    second_order_gains,
    third_order_gains,
)
from tiltsim_controllers.laws.gait_feedforward import Parameters
from tiltsim_controllers.laws.multirotor_keys import EULER_ANGLES, FeedforwardTerms
from tiltsim_controllers.laws.supervisor import Supervisor
from tiltsim_controllers.mathematics.moving import Moving
from tiltsim_controllers.references.trajectories import REFERENCE_TYPES, ReferenceParameters
from tiltsim_controllers.vehicle.cross import cross_table, torque_free_force
from tiltsim_controllers.vehicle.parameters import PRESETS, SPIN, drag_ratio
from tiltsim_controllers.vehicle.rotors import moving_wrench_map, rotors_in

VEHICLE = PRESETS["ar_drone_2"]
INERTIA = np.diag([VEHICLE.inertia_xx, VEHICLE.inertia_yy, VEHICLE.inertia_zz])
CASES = 20
quick = settings(deadline=None, max_examples=60)
small = st.floats(-0.6, 0.6)


def path(random, value_scale, rate_scale):
    """A random parabola, as a jet at zero and as a function of time."""
    a, b, c = random.uniform(-1, 1, 3) * (value_scale, rate_scale, rate_scale)
    return (a, b, c), lambda t: a + b * t + 0.5 * c * t * t


def differences(function, step=1e-4):
    """First and second derivatives at zero of an array-valued function, fourth-order accurate."""
    f = {k: np.array(function(k * step)) for k in (-2, -1, 0, 1, 2)}
    first = (f[-2] - 8 * f[-1] + 8 * f[1] - f[2]) / (12 * step)
    second = (-f[-2] + 16 * f[-1] - 30 * f[0] + 16 * f[1] - f[2]) / (12 * step**2)
    return f[0], first, second


def moving(jets):
    """A vector from the derivatives of its entries."""
    return Moving(*np.transpose(jets))


def derivatives(*quantities):
    """Values, rates and accelerations of quantities."""
    return np.transpose([(q.value, q.rate, q.acceleration) for q in quantities])


# --- chain rules -------------------------------------------------------------------------------


@pytest.mark.parametrize("side", [1.0, -1.0], ids=["along n", "against n"])
def test_the_exact_decouplers_attitude_moves_with_its_arguments(side):
    random, g = np.random.default_rng(2), VEHICLE.gravity
    for _ in range(CASES):
        jets, paths = zip(*(path(random, 0.6, 1.5) for _ in range(7)))
        ax, ay, az, yaw, nx, ny, nz = paths

        def attitude(t, ax=ax, ay=ay, az=az, yaw=yaw, nx=nx, ny=ny, nz=nz):
            n = (side * nx(t), side * ny(t), side * (2.0 + nz(t)))
            return exact_decoupler(ax(t), ay(t), az(t), yaw(t), g, n)

        n = moving(jets[4:])
        n = (n + np.array([0.0, 0.0, 2.0])) * side
        found = derivatives(*exact_decoupler(*(Moving(*jet) for jet in jets[:4]), g, n))
        for value, desired, tolerance in zip(found, differences(attitude), (1e-13, 1e-9, 1e-6)):
            np.testing.assert_allclose(value, desired, rtol=0, atol=tolerance)


@pytest.mark.parametrize("ay", [12.0, -12.0])
def test_out_of_reach_the_decoupler_rests_at_the_nearest_roll(ay):
    n = moving([(3.0, 0.1, -2.0), (0.2, 0.0, 0.0), (1.0, 0.0, 0.0)])
    still = [Moving(value, 0.0, 0.0) for value in (1.0, ay, 0.0, 0.4)]
    roll, _ = exact_decoupler(*still, VEHICLE.gravity, n)
    expected, _ = exact_decoupler(1.0, ay, 0.0, 0.4, VEHICLE.gravity, (3.0, 0.2, 1.0))
    assert derivatives(roll)[:, 0] == pytest.approx([expected, 0.0, 0.0], abs=1e-14)


def test_without_a_force_the_decoupler_has_no_answer():
    still = [Moving(value, 0.0, 0.0) for value in (1.0, 0.0, 0.0, 0.0)]
    force = moving([(1.0, 0.0, 0.0), (0.0,) * 3, (0.0,) * 3])
    with np.errstate(invalid="ignore"):
        assert isnan(exact_decoupler(*still, VEHICLE.gravity, force)[0].value)


# --- rigid-body motion -------------------------------------------------------------------------


def attitude_path(random):
    """Roll, pitch and yaw as random cubics, and body rates from the rotation itself."""
    coefficients = random.uniform(-1, 1, (3, 4)) * (0.6, 1.0, 2.0, 3.0)

    def angles(t):
        return coefficients @ [1.0, t, t**2 / 2, t**3 / 6]

    def turn(t):
        return Rotation.from_euler("ZYX", angles(t)[::-1])

    def body_rates(t, h=1e-4):
        near = (turn(t - h).inv() * turn(t + h)).as_rotvec() / (2 * h)
        far = (turn(t - 2 * h).inv() * turn(t + 2 * h)).as_rotvec() / (4 * h)
        return (4 * near - far) / 3

    return coefficients, body_rates


def test_euler_motion_inverts_the_body_rates():
    random = np.random.default_rng(3)
    for _ in range(CASES):
        coefficients, body_rates = attitude_path(random)
        omega, omega_rate, _ = differences(body_rates, 1e-2)
        motion = attitude_motion(coefficients[:, 0], omega, omega_rate, exact=True)
        found = [*motion.rate, *motion.acceleration]
        expected = [*coefficients[:, 1], *coefficients[:, 2]]
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6)


def test_body_jerk_is_the_second_derivative_of_the_body_rates():
    random = np.random.default_rng(4)
    for _ in range(CASES):
        coefficients, body_rates = attitude_path(random)
        found = angular_jerk(moving(coefficients[:, :3]), coefficients[:, 3])
        np.testing.assert_allclose(found, differences(body_rates, 1e-2)[2], rtol=0, atol=1e-4)


# --- exactness of the linearization --------------------------------------------------------------

GAINS, INTEGRAL = gains_from_poles(
    Poles(20.0, 0.8), Poles(10.0), Poles(8.0, 1.0, 0.5), Poles(1.5, 0.9, 0.4)
)
HOVER = ReferenceParameters(
    REFERENCE_TYPES["attitude_altitude"], (0.0, 0.0, 0.1), roll=0.05, yaw=-0.1
)


def parameters(**changed):
    base = Parameters(
        vehicle=VEHICLE,
        gains=GAINS,
        integral=INTEGRAL,
        max_acceleration=3.0,
        max_angular_acceleration=1e6,
        anticipation=0.1,
        terms=FeedforwardTerms(),
        gait=GaitParameters(FIXED),
        reference=HOVER,
        decoupler=DECOUPLERS["none"],
        decoupling=EXACT_DECOUPLING,
        supervisor=Supervisor(),
        limits=RotorRange(),
        rotor_inertia=0.0,
        attitude_error=EULER_ANGLES,
        slowest_rotor=0.0,
        turn_time=0.0,
    )
    return base._replace(**changed)


def random_state(random):
    return (
        *random.uniform(-0.1, 0.1, 6).tolist(),
        *random.uniform(-0.4, 0.4, 3).tolist(),
        *random.uniform(-2.0, 2.0, 3).tolist(),
        *random.uniform(-0.5, 0.5, 4).tolist(),
        *(random.uniform(200, 450, 4) * SPIN).tolist(),
    )


def outputs_second_derivatives(t, state, tilt_rates, inputs, gyroscopic=1.0):
    """Second derivatives of roll, pitch, yaw and altitude of a rigid body, ``t`` later.

    To first order in ``t``, which is all that their derivative at zero needs.
    """
    state = np.array(state)
    attitude, omega, alpha, speeds = np.split(state[6:], [3, 6, 10])
    torque = torque_matrix(VEHICLE, alpha) @ (speeds * np.abs(speeds))
    omega_rate = np.linalg.solve(INERTIA, torque - gyroscopic * np.cross(omega, INERTIA @ omega))
    turn = Rotation.from_euler("ZYX", attitude[::-1]) * Rotation.from_rotvec(t * omega)
    omega = omega + t * omega_rate
    alpha = alpha + t * np.array(tilt_rates)
    speeds = speeds + t * np.array(inputs)
    w = speeds * np.abs(speeds)
    torque = torque_matrix(VEHICLE, alpha) @ w
    omega_rate = np.linalg.solve(INERTIA, torque - gyroscopic * np.cross(omega, INERTIA @ omega))
    lift = (turn.as_matrix() @ force_matrix(VEHICLE, alpha) @ w)[2] / VEHICLE.mass

    def euler_rates(h):
        """Rates of the Euler angles a little further along the same motion."""
        along = turn * Rotation.from_rotvec(h * omega + 0.5 * h * h * omega_rate)
        _, pitch, roll = along.as_euler("ZYX")
        matrix = [
            [1, 0, -sin(pitch)],
            [0, cos(roll), sin(roll) * cos(pitch)],
            [0, -sin(roll), cos(roll) * cos(pitch)],
        ]
        return np.linalg.solve(matrix, omega + h * omega_rate)

    return np.array([*differences(euler_rates, 1e-3)[1], lift - VEHICLE.gravity])


def third_derivatives(state, tilt_rates, inputs):
    return differences(
        lambda t: outputs_second_derivatives(t, state, tilt_rates, inputs), step=1e-5
    )[1]


def demanded(state, law, integral_z):
    """The demands of the linear laws, from the state alone."""
    gains = law.gains
    now = outputs_second_derivatives(0.0, state, [0.0] * 4, [0.0] * 4)
    roll, pitch = state[6:8]
    p, q, r = state[9:12]
    yaw_rate = (sin(roll) * q + cos(roll) * r) / cos(pitch)
    rates = (p + sin(pitch) * yaw_rate, cos(roll) * q - sin(roll) * r, yaw_rate)
    desired = (law.reference.roll, law.reference.pitch, law.reference.yaw)
    attitude = [
        k3 * (desired[i] - state[6 + i]) - k2 * rates[i] - k1 * now[i]
        for i, (k1, k2, k3) in enumerate(gains.attitude.T)
    ]
    k1, k2, k3 = gains.altitude
    climb = (
        k3 * (law.reference.position[2] - state[2])
        - k2 * state[5]
        - k1 * now[3]
        + law.integral.altitude * integral_z
    )
    return np.array([*attitude, climb])


def test_roll_pitch_yaw_and_altitude_get_the_third_derivatives_that_the_gains_ask_for():
    random = np.random.default_rng(5)
    for seed in range(CASES):
        state, tilt_rates = random_state(random), tuple(random.uniform(-4.0, 4.0, 4).tolist())
        inputs = tracking_inputs(0.3, state, tilt_rates, (0.0, 0.0, 0.02), parameters())[:4]
        desired = demanded(state, parameters(), 0.02)
        found = third_derivatives(state, tilt_rates, inputs)
        scale = np.abs(desired).max()
        np.testing.assert_allclose(found, desired, rtol=0, atol=1e-5 * scale, err_msg=f"{seed}")


@pytest.mark.parametrize("term", ["gait_rates", "euler_rates", "gyroscopic_torque"])
def test_each_term_of_the_linearization_is_needed_for_that(term):
    random = np.random.default_rng(6)
    law = parameters(terms=FeedforwardTerms()._replace(**{term: 0.0}))
    state, tilt_rates = random_state(random), (3.0, -2.0, 1.0, 4.0)
    inputs = tracking_inputs(0.3, state, tilt_rates, (0.0, 0.0, 0.0), law)[:4]
    desired = demanded(state, parameters(), 0.0)
    off = np.abs(third_derivatives(state, tilt_rates, inputs) - desired).max()
    assert off > 1e-3 * np.abs(desired).max()


def test_hover_on_the_reference_needs_nothing():
    law = parameters(reference=ReferenceParameters(REFERENCE_TYPES["setpoint"], (1.0, 2.0, 3.0)))
    law = law._replace(decoupler=DECOUPLERS["exact"])
    speeds = [VEHICLE.hover_rotor_speed * sign for sign in SPIN]
    state = (1.0, 2.0, 3.0, *[0.0] * 13, *speeds)
    found = tracking_inputs(0.0, state, (0.0,) * 4, (0.0,) * 3, law, fixed([0.0] * 4).knots)
    assert found == pytest.approx([0.0] * 10, abs=1e-8)


def test_a_rotor_at_rest_is_singular():
    state = (*random_state(np.random.default_rng(7))[:19], 0.0)
    found = tracking_inputs(0.0, state, (0.0,) * 4, (0.0,) * 3, parameters())
    assert [isnan(value) for value in found[:4]] == [False, False, False, True]


def test_the_requested_attitude_points_the_gaits_force_along_the_wanted_acceleration():
    gait = continuous_trot(0.5, 2.0)
    circle = ReferenceParameters(REFERENCE_TYPES["circle"], radius=2.0, angular_frequency=0.5)
    law = parameters(gait=gait.parameters, reference=circle, decoupler=DECOUPLERS["exact"])
    time, yaw = 0.3, 0.4
    on_track = (
        *(2 * cos(0.5 * time), 2 * sin(0.5 * time), 0.0),
        *(-sin(0.5 * time), cos(0.5 * time), 0.0),
    )
    alpha = gait.angles(time)
    speeds = [VEHICLE.hover_rotor_speed * sign for sign in SPIN]
    state = (*on_track, 0.0, 0.0, yaw, 0.0, 0.0, 0.0, *alpha, *speeds)
    roll, pitch, _ = tracking_inputs(time, state, (0.0,) * 4, (0.0,) * 3, law, gait.knots)[7:]
    n = torque_free_force(np.array(alpha), drag_ratio(VEHICLE))
    force = Rotation.from_euler("ZYX", [yaw, pitch, roll]).apply(n)
    desired = np.array([-0.5 * cos(0.5 * time), -0.5 * sin(0.5 * time), VEHICLE.gravity])
    unit = [v / np.linalg.norm(v) for v in (force, desired)]
    np.testing.assert_allclose(unit[0], unit[1], atol=1e-12)


# --- limits and integrals ------------------------------------------------------------------------


@quick
@given(small, small, small, small)
def test_within_its_limit_the_attitude_law_is_linear(angle, rate, acceleration, desired):
    found = attitude_jerk(
        Moving(desired, 0.1, -0.2), Moving(angle, rate, acceleration), (30.0, 300.0, 1e3), 1e4
    )
    expected = 30 * (-0.2 - acceleration) + 300 * (0.1 - rate) + 1e3 * (desired - angle)
    assert found == pytest.approx(expected, abs=1e-9)


@quick
@given(st.floats(-50, 50), st.floats(-50, 50), st.floats(-50, 50))
def test_no_error_asks_for_more_than_the_limit(angle, rate, ahead):
    found = attitude_jerk(
        Moving(angle, rate, ahead), Moving(0.0, 0.0, 0.0), (30.0, 300.0, 1e3), 8.0
    )
    assert abs(found) <= 30.0 * 8.0 * (1 + 1e-12)


@quick
@given(st.floats(-9, 9), st.floats(-9, 9))
def test_a_wanted_acceleration_keeps_its_direction_and_no_more_than_the_limit(x, y):
    ax, ay = limited_acceleration(moving([(x, 1.0, 0.0), (y, 2.0, 0.0)]), 3.0).value
    assert np.hypot(ax, ay) <= 3.0 * (1 + 1e-12)
    assert ax * y == pytest.approx(ay * x, abs=1e-9)
    if np.hypot(x, y) <= 3.0:
        assert (ax, ay) == (x, y)


def test_integrators_stop_where_they_would_wind_up():
    assert integrator_rate(0.4, 2.9, 3.0) == 0.4
    assert integrator_rate(0.4, 3.1, 3.0) == 0.0
    assert integrator_rate(-0.4, 3.1, 3.0) == -0.4  # back from the limit


# --- gains by pole placement ---------------------------------------------------------------------


@quick
@given(st.floats(0.5, 50), st.floats(0.3, 2), st.floats(0.05, 5))
def test_the_poles_are_where_they_were_requested(bandwidth, damping, integral):
    poles = Poles(bandwidth, damping, integral)
    pair = np.array([1.0, 2 * damping * bandwidth, bandwidth**2])
    second = np.polymul(pair, [1.0, integral])
    third = np.polymul(np.polymul(pair, [1.0, bandwidth]), [1.0, integral])
    np.testing.assert_allclose((1.0, *second_order_gains(poles)), second, rtol=1e-12)
    np.testing.assert_allclose((1.0, *third_order_gains(poles)), third, rtol=1e-12)


def test_the_closed_loops_have_the_requested_poles():
    loops = {loop.name: loop.polynomial for loop in feedforward_loops(GAINS, INTEGRAL)}
    assert len(loops["position"]) == 4
    assert len(loops["altitude"]) == 5
    np.testing.assert_allclose(sorted(np.roots(loops["altitude"]).real)[-1], -0.5, rtol=1e-9)
    without = {loop.name: loop for loop in feedforward_loops(GAINS, IntegralGains())}
    assert len(without["position"].polynomial) == 3
    unstable = feedforward_loops(Gains(*[(1.0,) * 3] * 4, (1.0, 1.0)), IntegralGains(5.0))
    assert not unstable[-1].stable


@pytest.mark.parametrize("place", [0, 1, 2])
def test_a_reference_that_is_no_number_asks_for_no_number(place):
    desired = [0.1, 0.2, 0.3]
    desired[place] = float("nan")
    assert isnan(
        attitude_jerk(Moving(*desired), Moving(0.0, 0.0, 0.0), (40.0, 600.0, 4000.0), 50.0)
    )


def test_in_free_fall_the_decoupler_has_no_answer():
    still = [Moving(value, 0.0, 0.0) for value in (0.0, 0.0, -VEHICLE.gravity, 0.3)]
    force = moving([(0.1, 0.0, 0.0), (0.2, 0.0, 0.0), (3.0, 0.0, 0.0)])
    with np.errstate(invalid="ignore"):
        assert all(isnan(a.value) for a in exact_decoupler(*still, VEHICLE.gravity, force))


def test_a_force_without_vertical_part_counts_as_along_its_direction():
    turning = moving([(1.0, 0.0, 0.0), (0.0, 2.0, 0.0), (0.0, 0.0, 0.0)])
    found = jerk_along(turning, np.array([10.0, 0.0, 0.0]), np.zeros(3), 1.0)
    assert found.tolist() == [0.0, 20.0, 0.0]


@pytest.mark.parametrize("counted", [0.0, 0.5, 1.0])
def test_the_jerk_includes_the_turn_of_the_body_and_of_the_force_in_it(counted):
    random = np.random.default_rng(12)
    for _ in range(CASES):
        jets, paths = zip(*(path(random, 0.5, 2.0) for _ in range(3)))
        jets = (*jets[:2], (jets[2][0] + 2.0, *jets[2][1:]))
        omega = random.uniform(-2.0, 2.0, 3)
        size = random.uniform(5.0, 15.0)

        def force(t, counted=counted, paths=paths, omega=omega, size=size):
            n = np.add([p(counted * t) for p in paths], [0.0, 0.0, 2.0])
            return Rotation.from_rotvec(t * omega).apply(size * n / np.linalg.norm(n))

        now, rate, _ = differences(force)
        for side in (1.0, -1.0):  # a direction that points down stands for a force against it
            found = jerk_along(moving(jets) * side, now, omega, counted)
            np.testing.assert_allclose(found, rate, rtol=0, atol=1e-8)


@pytest.mark.parametrize("seed", range(3))
def test_torques_of_the_rotors_spin_are_rates_of_its_momentum(seed):
    """While pods turn at constant rates, the body at a constant angular acceleration."""
    random = np.random.default_rng(seed)
    alpha, rates = random.uniform(-0.6, 0.6, 4), random.uniform(-2.0, 2.0, 4)
    omega, omega_rate = random.uniform(-2.0, 2.0, 3), random.uniform(-5.0, 5.0, 3)
    speeds, inertia = SPIN * random.uniform(200.0, 450.0, 4), 1e-5

    def momentum(t):
        s, c = np.sin(alpha + rates * t), np.cos(alpha + rates * t)
        axes = [[0, -s[0], c[0]], [s[1], 0, c[1]], [0, s[2], c[2]], [-s[3], 0, c[3]]]
        return inertia * speeds @ axes

    def torque(t):
        _, first, _ = differences(lambda s: momentum(t + s))
        return first + np.cross(omega + omega_rate * t, momentum(t))

    rotors = rotors_in(cross_table(VEHICLE, tilting=True), 0, (0, 1, 2, 3))
    force = moving_wrench_map(rotors, Moving(alpha, rates, 0.0))[:3]
    spin = force @ (inertia / VEHICLE.thrust_coefficient * rotors.spins * speeds)
    found = swept(spin, omega, omega_rate)
    np.testing.assert_allclose(found.value, torque(0.0), rtol=1e-7, atol=1e-12)
    np.testing.assert_allclose(found.rate, differences(torque)[1], rtol=1e-5, atol=1e-7)
