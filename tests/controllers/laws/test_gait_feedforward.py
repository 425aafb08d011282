"""The law that counts its gait's rates in: chain rules, rigid-body motion, exactness."""

from __future__ import annotations

from math import cos, isnan, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tests.thesis import force_matrix, torque_matrix
from tiltsim_controllers.analysis.stability import feedforward_loops
from tiltsim_controllers.gaits.anticipation import anticipated_tilts, rounded_corner, rounded_ramp
from tiltsim_controllers.gaits.parameters import GAIT_TYPES, GaitParameters
from tiltsim_controllers.gaits.plans import continuous_trot, fixed, keyframes, two_color_circle
from tiltsim_controllers.gaits.tilts import tilt_acceleration, tilt_reference
from tiltsim_controllers.laws.attitude_altitude import Gains
from tiltsim_controllers.laws.decouplers import DECOUPLERS, exact_decoupler
from tiltsim_controllers.laws.feedback import attitude_jerk, integrator_rate, limited_acceleration
from tiltsim_controllers.laws.force_motion import (
    exact_decoupler_jet,
    jerk_along,
    torque_free_force_jet,
)
from tiltsim_controllers.laws.gains import (
    IntegralGains,
    Poles,
    gains_from_poles,
    second_order_gains,
    third_order_gains,
)
from tiltsim_controllers.laws.gait_feedforward import FeedforwardTerms, Parameters, tracking_inputs
from tiltsim_controllers.laws.rotor_spin import spin_momentum, spin_torques
from tiltsim_controllers.references.trajectories import REFERENCE_TYPES, ReferenceParameters
from tiltsim_controllers.vehicle.decoupling_matrix import (
    sines_and_cosines,
    torque_entries,
    torque_free_force,
)
from tiltsim_controllers.vehicle.parameters import PRESETS, SPIN, drag_ratio
from tiltsim_controllers.vehicle.rigid_body import angular_jerk, euler_derivatives

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


# --- chain rules -------------------------------------------------------------------------------


@pytest.mark.parametrize("vehicle", PRESETS.values(), ids=PRESETS)
def test_the_torque_free_force_moves_with_the_tilts(vehicle):
    random, ratio = np.random.default_rng(1), drag_ratio(vehicle)

    def force(alpha):
        trig = sines_and_cosines(*alpha)
        return torque_free_force(trig, torque_entries(trig, ratio), ratio)

    for _ in range(CASES):
        jets, paths = zip(*(path(random, 1.2, 3.0) for _ in range(4)))
        expected = differences(lambda t, paths=paths: force([p(t) for p in paths]))
        found = np.transpose(torque_free_force_jet(jets, ratio))
        for value, desired, tolerance in zip(found, expected, (1e-12, 1e-8, 1e-5)):
            np.testing.assert_allclose(value, desired, rtol=0, atol=tolerance * 100)


@pytest.mark.parametrize("side", [1.0, -1.0], ids=["along n", "against n"])
def test_the_exact_decouplers_attitude_moves_with_its_arguments(side):
    random, g = np.random.default_rng(2), VEHICLE.gravity
    for _ in range(CASES):
        jets, paths = zip(*(path(random, 0.6, 1.5) for _ in range(7)))
        ax, ay, az, yaw, nx, ny, nz = paths

        def attitude(t, ax=ax, ay=ay, az=az, yaw=yaw, nx=nx, ny=ny, nz=nz):
            n = (side * nx(t), side * ny(t), side * (2.0 + nz(t)))
            return exact_decoupler(ax(t), ay(t), az(t), yaw(t), g, n)

        n = [tuple(side * value for value in jet) for jet in jets[4:]]
        n[2] = (n[2][0] + side * 2.0, *n[2][1:])
        lift = (g + jets[2][0], *jets[2][1:])
        found = np.transpose(exact_decoupler_jet(jets[0], jets[1], lift, jets[3], n))
        for value, desired, tolerance in zip(found, differences(attitude), (1e-13, 1e-9, 1e-6)):
            np.testing.assert_allclose(value, desired, rtol=0, atol=tolerance)


@pytest.mark.parametrize("ay", [12.0, -12.0])
def test_out_of_reach_the_decoupler_rests_at_the_nearest_roll(ay):
    n = ((3.0, 0.1, -2.0), (0.2, 0.0, 0.0), (1.0, 0.0, 0.0))
    still = [(value, 0.0, 0.0) for value in (1.0, ay, VEHICLE.gravity, 0.4)]
    roll, _ = exact_decoupler_jet(*still, n)
    expected, _ = exact_decoupler(1.0, ay, 0.0, 0.4, VEHICLE.gravity, (3.0, 0.2, 1.0))
    assert roll == pytest.approx((expected, 0.0, 0.0), abs=1e-14)


def test_without_a_force_the_decoupler_has_no_answer():
    still = [(value, 0.0, 0.0) for value in (1.0, 0.0, VEHICLE.gravity, 0.0)]
    zero = (0.0, 0.0, 0.0)
    assert isnan(exact_decoupler_jet(*still, ((1.0, 0.0, 0.0), zero, zero))[0][0])


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
        roll, pitch = coefficients[:2, 0]
        found = euler_derivatives(roll, pitch, tuple(omega), tuple(omega_rate))
        expected = [*coefficients[:, 1], *coefficients[:, 2]]
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6)


def test_body_jerk_is_the_second_derivative_of_the_body_rates():
    random = np.random.default_rng(4)
    for _ in range(CASES):
        coefficients, body_rates = attitude_path(random)
        jets = [tuple(row[:3]) for row in coefficients]
        found = angular_jerk(*jets, tuple(coefficients[:, 3]))
        np.testing.assert_allclose(found, differences(body_rates, 1e-2)[2], rtol=0, atol=1e-4)


# --- exactness of the linearization --------------------------------------------------------------

GAINS, INTEGRAL = gains_from_poles(
    Poles(20.0, 0.8), Poles(10.0), Poles(8.0, 1.0, 0.5), Poles(1.5, 0.9, 0.4)
)
HOVER = ReferenceParameters(REFERENCE_TYPES["attitude_altitude"], z=0.1, roll=0.05, yaw=-0.1)


def parameters(**changed):
    base = Parameters(
        vehicle=VEHICLE,
        gains=GAINS,
        integral=INTEGRAL,
        max_acceleration=3.0,
        max_angular_acceleration=1e6,
        anticipation=0.1,
        terms=FeedforwardTerms(),
        gait=GaitParameters(GAIT_TYPES["fixed"]),
        reference=HOVER,
        decoupler=DECOUPLERS["none"],
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
    """What the linear laws ask for, from the state alone."""
    gains = law.gains
    now = outputs_second_derivatives(0.0, state, [0.0] * 4, [0.0] * 4)
    roll, pitch = state[6:8]
    p, q, r = state[9:12]
    yaw_rate = (sin(roll) * q + cos(roll) * r) / cos(pitch)
    rates = (p + sin(pitch) * yaw_rate, cos(roll) * q - sin(roll) * r, yaw_rate)
    desired = (law.reference.roll, law.reference.pitch, law.reference.yaw)
    attitude = [
        k3 * (desired[i] - state[6 + i]) - k2 * rates[i] - k1 * now[i]
        for i, (k1, k2, k3) in enumerate((gains[0:3], gains[3:6], gains[6:9]))
    ]
    k1, k2, k3 = gains[9:12]
    climb = (
        k3 * (law.reference.z - state[2])
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
    law = parameters(reference=ReferenceParameters(REFERENCE_TYPES["setpoint"], 1.0, 2.0, 3.0))
    law = law._replace(decoupler=DECOUPLERS["exact"])
    speeds = [VEHICLE.hover_rotor_speed * sign for sign in SPIN]
    state = (1.0, 2.0, 3.0, *[0.0] * 13, *speeds)
    found = tracking_inputs(0.0, state, (0.0,) * 4, (0.0,) * 3, law)
    assert found == pytest.approx([0.0] * 10, abs=1e-8)


def test_a_rotor_at_rest_is_singular():
    state = (*random_state(np.random.default_rng(7))[:19], 0.0)
    found = tracking_inputs(0.0, state, (0.0,) * 4, (0.0,) * 3, parameters())
    assert all(isnan(value) for value in found[:4])


def test_the_attitude_asked_for_points_the_gaits_force_along_the_wanted_acceleration():
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
    roll, pitch, _ = tracking_inputs(time, state, (0.0,) * 4, (0.0,) * 3, law)[7:]
    trig = sines_and_cosines(*alpha)
    n = np.array(torque_free_force(trig, torque_entries(trig, drag_ratio(VEHICLE)), 1.0))
    force = Rotation.from_euler("ZYX", [yaw, pitch, roll]).apply(n)
    desired = np.array([-0.5 * cos(0.5 * time), -0.5 * sin(0.5 * time), VEHICLE.gravity])
    unit = [v / np.linalg.norm(v) for v in (force, desired)]
    np.testing.assert_allclose(unit[0], unit[1], atol=1e-12)


# --- limits and integrals ------------------------------------------------------------------------


@quick
@given(small, small, small, small)
def test_within_its_limit_the_attitude_law_is_linear(angle, rate, acceleration, desired):
    found = attitude_jerk(
        (desired, 0.1, -0.2), (angle, rate, acceleration), (30.0, 300.0, 1e3), 1e4
    )
    expected = 30 * (-0.2 - acceleration) + 300 * (0.1 - rate) + 1e3 * (desired - angle)
    assert found == pytest.approx(expected, abs=1e-9)


@quick
@given(st.floats(-50, 50), st.floats(-50, 50), st.floats(-50, 50))
def test_no_error_asks_for_more_than_the_limit(angle, rate, ahead):
    found = attitude_jerk((angle, rate, ahead), (0.0, 0.0, 0.0), (30.0, 300.0, 1e3), 8.0)
    assert abs(found) <= 30.0 * 8.0 * (1 + 1e-12)


@quick
@given(st.floats(-9, 9), st.floats(-9, 9))
def test_a_wanted_acceleration_keeps_its_direction_and_no_more_than_the_limit(x, y):
    (ax, _, _), (ay, _, _) = limited_acceleration((x, 1.0, 0.0), (y, 2.0, 0.0), 3.0)
    assert np.hypot(ax, ay) <= 3.0 * (1 + 1e-12)
    assert ax * y == pytest.approx(ay * x, abs=1e-9)
    if np.hypot(x, y) <= 3.0:
        assert (ax, ay) == (x, y)


def test_integrators_stop_where_they_would_wind_up():
    assert integrator_rate(0.4, 2.9, 3.0) == 0.4
    assert integrator_rate(0.4, 3.1, 3.0) == 0.0
    assert integrator_rate(-0.4, 3.1, 3.0) == -0.4  # back from the limit


# --- corners of the gait -------------------------------------------------------------------------


@quick
@given(st.floats(-0.3, 0.3))
def test_the_rounded_ramp_has_its_derivatives_and_the_ramp_outside(x):
    half = 0.2
    value, first, second = rounded_ramp(x, half)
    if abs(x) >= half:
        assert (value, first, second) == (max(x, 0.0), float(x > 0), 0.0)
    if min(abs(x - half), abs(x + half)) < 1e-3:
        return
    h = 1e-4
    found = differences(lambda t: [rounded_ramp(x + t, half)[0]], h)
    assert (first, second) == pytest.approx((found[1][0], found[2][0]), abs=1e-5)


def test_the_kernel_of_the_ramp_is_even_so_that_what_is_missed_before_is_made_up_after():
    x = np.linspace(-0.2, 0.2, 2001)
    first = np.array([rounded_ramp(v, 0.2)[1] for v in x])
    np.testing.assert_allclose(first + first[::-1], 1.0, atol=1e-14)


@quick
@given(st.floats(-2, 2), st.floats(-3, 3), st.floats(-3, 3), st.floats(0.0, 0.4))
def test_a_corner_is_found_from_the_ends_of_its_window(start, before, after, at):
    half = 0.2
    stop = start + before * at + after * (2 * half - at)
    found = rounded_corner(start, before, stop, after, half)
    smooth = rounded_ramp(half - at, half)
    line = start + before * half
    expected = (line + (after - before) * smooth[0], before + (after - before) * smooth[1])
    assert found[:2] == pytest.approx(expected, abs=1e-8)


WALK = keyframes(
    [(0.0, 0.1, 0.2, 0.0, 0.3), (0.4, 0.5, -0.2, 0.1, 0.3), (1.0, 0.1, 0.2, 0.0, 0.3)], 2.0
)


@pytest.mark.parametrize("gait", [continuous_trot(0.6, 1.0), WALK], ids=["trot", "keyframes"])
def test_anticipated_tilts_are_smooth_and_the_gait_itself_away_from_corners(gait):
    half = min(0.1, 0.5 * gait.min_segment_time)
    for time in np.linspace(0.003, 1.99, 97):
        jets = anticipated_tilts(float(time), gait.parameters, gait.knots, half)
        expected = differences(
            lambda t, time=time: [
                jet[0] for jet in anticipated_tilts(time + t, gait.parameters, gait.knots, half)
            ]
        )
        np.testing.assert_allclose([jet[1] for jet in jets], expected[1], atol=1e-4)
        np.testing.assert_allclose([jet[2] for jet in jets], expected[2], atol=0.2)
    straight = 0.5 * (WALK.sample_times(2)[0] + 0.8) if gait is WALK else 0.25
    jets = anticipated_tilts(straight, gait.parameters, gait.knots, half)
    np.testing.assert_allclose([jet[0] for jet in jets], gait.angles(straight), atol=1e-14)


def test_jumps_and_smooth_gaits_are_left_alone():
    circle = two_color_circle((0.1, -0.2), 0.3, "blue", 2.0, VEHICLE).biased(0.9).scaled(1.5)
    for time in (0.0, 0.3, 1.7):
        jets = anticipated_tilts(time, circle.parameters, circle.knots, 0.1)
        found = differences(lambda t, time=time: circle.angles(time + t), 1e-3)
        for order, tolerance in enumerate((1e-14, 1e-8, 1e-6)):
            got = [jet[order] for jet in jets]
            np.testing.assert_allclose(got, found[order], atol=tolerance)
        acceleration = tilt_acceleration(time, circle.parameters)
        np.testing.assert_array_equal([jet[2] for jet in jets], acceleration)
    assert fixed([0.1] * 4).min_segment_time == float("inf")
    plain = anticipated_tilts(0.3, circle.parameters, circle.knots, 0.0)
    expected = tilt_reference(0.3, circle.parameters, circle.knots)
    assert tuple(jet[0] for jet in plain) + tuple(jet[1] for jet in plain) == expected


# --- gains by pole placement ---------------------------------------------------------------------


@quick
@given(st.floats(0.5, 50), st.floats(0.3, 2), st.floats(0.05, 5))
def test_the_poles_are_where_they_were_asked_for(bandwidth, damping, integral):
    poles = Poles(bandwidth, damping, integral)
    pair = np.array([1.0, 2 * damping * bandwidth, bandwidth**2])
    second = np.polymul(pair, [1.0, integral])
    third = np.polymul(np.polymul(pair, [1.0, bandwidth]), [1.0, integral])
    np.testing.assert_allclose((1.0, *second_order_gains(poles)), second, rtol=1e-12)
    np.testing.assert_allclose((1.0, *third_order_gains(poles)), third, rtol=1e-12)


def test_the_closed_loops_are_those_of_the_poles():
    loops = {loop.name: loop.polynomial for loop in feedforward_loops(GAINS, INTEGRAL)}
    assert len(loops["position"]) == 4
    assert len(loops["altitude"]) == 5
    np.testing.assert_allclose(sorted(np.roots(loops["altitude"]).real)[-1], -0.5, rtol=1e-9)
    without = {loop.name: loop for loop in feedforward_loops(GAINS, IntegralGains())}
    assert len(without["position"].polynomial) == 3
    unstable = feedforward_loops(Gains(*[1.0] * 14), IntegralGains(5.0))
    assert not unstable[-1].stable


@pytest.mark.parametrize("place", [0, 1, 2])
def test_a_reference_that_is_no_number_asks_for_no_number(place):
    desired = [0.1, 0.2, 0.3]
    desired[place] = float("nan")
    assert isnan(attitude_jerk(tuple(desired), (0.0, 0.0, 0.0), (40.0, 600.0, 4000.0), 50.0))


def test_in_free_fall_the_decoupler_has_no_answer():
    zero = (0.0, 0.0, 0.0)
    force = ((0.1, 0.0, 0.0), (0.2, 0.0, 0.0), (3.0, 0.0, 0.0))
    for jet in exact_decoupler_jet(zero, zero, zero, (0.3, 0.0, 0.0), force):
        assert all(map(isnan, jet))


def test_a_force_without_vertical_part_counts_as_along_its_direction():
    turning = ((1.0, 0.0, 0.0), (0.0, 2.0, 0.0), (0.0, 0.0, 0.0))
    assert jerk_along(turning, (10.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0) == (0.0, 20.0, 0.0)


@pytest.mark.parametrize("counted", [0.0, 0.5, 1.0])
def test_the_jerk_is_that_of_a_force_that_turns_with_the_body_and_with_its_direction(counted):
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
        for side in (1.0, -1.0):  # a direction that points down is that of a force against it
            turned = [tuple(side * value for value in jet) for jet in jets]
            found = jerk_along(tuple(turned), tuple(now.tolist()), tuple(omega.tolist()), counted)
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

    trig = sines_and_cosines(*alpha)
    spin = spin_momentum(trig, tuple(rates), tuple(speeds), inertia)
    found = spin_torques(spin, tuple(omega), tuple(omega_rate))
    np.testing.assert_allclose(found[0], torque(0.0), rtol=1e-7, atol=1e-12)
    np.testing.assert_allclose(found[1], differences(torque)[1], rtol=1e-5, atol=1e-7)
    unknown = spin_momentum(trig, tuple(rates), tuple(speeds), 0.0)
    assert not np.any(spin_torques(unknown, tuple(omega), tuple(omega_rate)))
