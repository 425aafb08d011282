"""Yaw-position linearization of the quadrotor: symbols, derivatives, compiled code, flights."""

from __future__ import annotations

from math import cos, hypot, isnan, pi, sin

import numpy as np
import pytest
import sympy

from tests.controllers.flights import fly, quadrotor_rates, rk4_step
from tests.natively import compiled_law
from tiltsim_controllers.analysis.singularity import normalized_determinant, published_determinant
from tiltsim_controllers.analysis.stability import is_hurwitz
from tiltsim_controllers.laws.quadrotor import (
    POSITION_GAINS,
    YawPositionParameters,
    decoupling_matrix,
    drift,
    moments_of,
    yaw_position_inputs,
)
from tiltsim_controllers.references.trajectories import (
    REFERENCE_TYPES,
    ReferenceParameters,
    reference_motion,
)
from tiltsim_controllers.vehicle.body import EXTENDED_QUADROTOR_FIELDS
from tiltsim_controllers.vehicle.parameters import PRESETS

QUADROTOR = PRESETS["ar_drone_2_unrounded"]
WEIGHT = QUADROTOR.mass * QUADROTOR.gravity
CASES = 20

# x = 1 - cos(t/20), y = -sin(t/20) in ch. 2's axes; y has the other sign in ours.
CIRCLE = ReferenceParameters(
    REFERENCE_TYPES["circle"], (1.0, 0.0, 0.0), radius=-1.0, angular_frequency=-1 / 20
)
START = (*[0.0] * 6, 0.5, -0.5, 0.0, 0.0, 0.0, 0.0, WEIGHT, 0.0)  # (0.5, 0.5, 0) in ch. 2's axes

# Signs of ch. 2's state, outputs and inputs, whose z axis points down.
STATE_SIGNS = np.array([1, -1, -1, 1, -1, -1, 1, -1, -1, 1, -1, -1, 1, 1])
OUTPUT_SIGNS, INPUT_SIGNS = np.array([1, -1, -1, -1]), np.array([1, 1, -1, -1])


def random_state(random):
    return np.concatenate(
        [
            random.uniform(-2.0, 2.0, 6),
            random.uniform(-1.2, 1.2, 3),
            random.uniform(-3.0, 3.0, 3),
            [random.uniform(1.0, 9.0), random.uniform(-5.0, 5.0)],
        ]
    )


# --- symbols -----------------------------------------------------------------------------------

PHI, THETA, PSI, P, Q, R, ZETA, XI = sympy.symbols("phi theta psi p q r zeta xi", real=True)
M, G, D, IX, IY, IZ = sympy.symbols("m g d I_x I_y I_z", positive=True)
U = sympy.symbols("u1:5", real=True)
POSITION = sympy.symbols("x y z", real=True)
VELOCITY = sympy.symbols("vx vy vz", real=True)
SYMBOLS = (*POSITION, *VELOCITY, PHI, THETA, PSI, P, Q, R, ZETA, XI)
NUMBERS = {
    M: QUADROTOR.mass,
    G: QUADROTOR.gravity,
    D: QUADROTOR.arm_length,
    IX: QUADROTOR.inertia_xx,
    IY: QUADROTOR.inertia_yy,
    IZ: QUADROTOR.inertia_zz,
}


def along_the_flow(expression, inputs):
    """Time derivative of an expression along ch. 2, Eqs. (9)-(18), written out as printed."""
    s, c, t = sympy.sin, sympy.cos, sympy.tan
    flow = {
        **dict(zip(POSITION, VELOCITY)),
        VELOCITY[0]: -ZETA / M * (c(PHI) * c(PSI) * s(THETA) + s(PHI) * s(PSI)),
        VELOCITY[1]: -ZETA / M * (c(PHI) * s(PSI) * s(THETA) - s(PHI) * c(PSI)),
        VELOCITY[2]: -ZETA / M * c(THETA) * c(PHI) + G,
        PSI: s(PHI) / c(THETA) * Q + c(PHI) / c(THETA) * R,
        THETA: c(PHI) * Q - s(PHI) * R,
        PHI: P + s(PHI) * t(THETA) * Q + c(PHI) * t(THETA) * R,
        ZETA: XI,
        XI: inputs[0],
        P: (IY - IZ) / IX * Q * R + D / IX * inputs[1],
        Q: (IZ - IX) / IY * P * R + D / IY * inputs[2],
        R: (IX - IY) / IZ * P * Q + D / IZ * inputs[3],
    }
    return sum(sympy.diff(expression, symbol) * rate for symbol, rate in flow.items())


def output_derivatives():
    """The fourth derivatives of x, y, z and the second of yaw, with the inputs in them."""
    still = (0, 0, 0, 0)
    for output, order in [*((symbol, 4) for symbol in POSITION), (PSI, 2)]:
        expression = output
        for _ in range(order - 1):
            expression = along_the_flow(expression, still)
        yield sympy.expand(along_the_flow(expression, U))


@pytest.fixture(scope="module")
def derivatives():
    return list(output_derivatives())


def test_delta_and_ma_are_the_derivatives_of_the_outputs(derivatives):
    """Ma is the fourth derivative (second of yaw) without input, Delta its change by the inputs."""
    expressions = [expression.subs(NUMBERS) for expression in derivatives]
    jacobian = sympy.Matrix(expressions).jacobian(U)
    printed = sympy.lambdify((SYMBOLS, U), (sympy.Matrix(expressions), jacobian))
    random = np.random.default_rng(2)
    for _ in range(CASES):
        state = random_state(random)
        ma, delta = printed((state * STATE_SIGNS).tolist(), (0.0,) * 4)
        ma, found = np.ravel(ma) * OUTPUT_SIGNS, decoupling_matrix(state, QUADROTOR)
        np.testing.assert_allclose(drift(state, QUADROTOR), ma, rtol=1e-10, atol=1e-10)
        delta = OUTPUT_SIGNS[:, None] * np.array(delta) * INPUT_SIGNS
        np.testing.assert_allclose(found, delta, rtol=1e-10, atol=1e-10)


def test_the_determinant_is_the_exact_one():
    random, ix_iy_iz = np.random.default_rng(5), np.prod(moments_of(QUADROTOR))
    for _ in range(CASES):
        state = random_state(random)
        exact = QUADROTOR.arm_length**3 * state[12] ** 2 * cos(state[6])
        exact /= ix_iy_iz * QUADROTOR.mass**3 * cos(state[7])
        found = np.linalg.det(decoupling_matrix(state, QUADROTOR))
        assert found == pytest.approx(exact, rel=1e-9)


# --- derivatives -------------------------------------------------------------------------------


def third_derivatives(state):
    """Jerk and yaw rate, z-up, from the plant by hand."""
    rates = quadrotor_rates(state, (state[12], 0.0, 0.0, 0.0, state[13], 0.0), QUADROTOR)
    return np.array([*rates[3:6], rates[8]])


def numerical_derivatives(state, inputs):
    """Fourth derivatives of the position and second of yaw, by differences along the flight."""

    def rates(_, state):
        return quadrotor_rates(state, (state[12], *inputs[1:4], state[13], inputs[5]), QUADROTOR)

    h = 2e-3
    points = {k: third_derivatives(rk4_step(rates, 0.0, state, k * h)) for k in range(-3, 4)}
    second = (
        2 * (points[3] + points[-3])
        - 27 * (points[2] + points[-2])
        + 270 * (points[1] + points[-1])
    ) / 180 - 490 * points[0] / 180
    first = ((points[3] - points[-3]) - 9 * (points[2] - points[-2])) / 60 + 0.75 * (
        points[1] - points[-1]
    )
    return np.array([*(second[:3] / h**2), first[3] / h])


def test_ma_is_the_plants_derivative_at_zero_input():
    random = np.random.default_rng(3)
    for _ in range(CASES):
        state = random_state(random)
        numerical = numerical_derivatives(state, (state[12], 0.0, 0.0, 0.0, state[13], 0.0))
        ma = drift(state, QUADROTOR)
        np.testing.assert_allclose(ma, numerical, rtol=0, atol=1e-6 * (1 + np.abs(ma).max()))


@pytest.mark.parametrize("gains", POSITION_GAINS)
def test_the_outputs_move_as_appendix_b_demands(gains):
    random = np.random.default_rng(4)
    parameters = YawPositionParameters(QUADROTOR, CIRCLE._replace(yaw=0.3), POSITION_GAINS[gains])
    k = POSITION_GAINS[gains]
    time = 2.0
    reference = reference_motion(time, parameters.reference)
    for _ in range(CASES):
        state = random_state(random)
        rates = quadrotor_rates(state, (state[12], 0, 0, 0, 0, 0), QUADROTOR)
        ahead = rk4_step(
            lambda _, s: quadrotor_rates(s, (s[12], 0, 0, 0, s[13], 0), QUADROTOR), 0, state, 1e-5
        )
        behind = rk4_step(
            lambda _, s: quadrotor_rates(s, (s[12], 0, 0, 0, s[13], 0), QUADROTOR), 0, state, -1e-5
        )
        jerk = (third_derivatives(ahead) - third_derivatives(behind))[:3] / 2e-5
        errors = reference[:4] - [state[:3], state[3:6], rates[3:6], jerk]
        desired = reference[4] + np.array(k.position[::-1]) @ errors
        desired_yaw = k.yaw[1] * (0.3 - state[8]) - k.yaw[0] * rates[8]
        inputs = yaw_position_inputs(time, state, parameters)
        found = numerical_derivatives(state, inputs)
        desired = np.array([*desired, desired_yaw])
        # Seven-point differences of an angular acceleration that may exceed 1e3 rad/s^2.
        np.testing.assert_allclose(found, desired, rtol=0, atol=2e-5 * np.abs(desired).max())


@pytest.mark.parametrize(
    "change", [{"thrust": 0.0}, {"thrust": float("nan")}], ids=["no thrust", "unknown thrust"]
)
def test_inputs_are_nan_where_the_matrix_is_singular(change):
    state = dict(zip(EXTENDED_QUADROTOR_FIELDS, START)) | change
    inputs = yaw_position_inputs(0.0, np.array([*state.values()]), PARAMETERS["stable"])
    assert all(isnan(value) for value in inputs[1:4])


def test_the_reference_derivatives_are_derivatives():
    for kind in ("circle", "line", "setpoint"):
        reference = ReferenceParameters(
            *(REFERENCE_TYPES[kind], (0.3, -0.2, 1.0), (0.5, 0.1, -0.3)),
            radius=2.0,
            angular_frequency=0.7,
        )
        h = 1e-4
        before, now, after = (reference_motion(1.3 + k * h, reference) for k in (-1, 0, 1))
        np.testing.assert_allclose(now[1:], (after - before)[:-1] / (2 * h), rtol=0, atol=1e-7)


# --- flights -----------------------------------------------------------------------------------

PARAMETERS = {
    name: YawPositionParameters(QUADROTOR, CIRCLE, gains) for name, gains in POSITION_GAINS.items()
}


def flight(gains, duration, step):
    return fly(
        compiled_law(yaw_position_inputs, len(START), PARAMETERS[gains]),
        quadrotor_rates,
        QUADROTOR,
        START,
        duration,
        step,
    )


def position_polynomial(gains):
    return (1.0, *gains.position)


def test_the_published_gains_are_unstable_by_themselves_and_ours_are_not():
    published = position_polynomial(POSITION_GAINS["ch02"])
    assert not is_hurwitz(published)
    np.testing.assert_allclose(max(np.roots(published).real), 1.30, atol=5e-3)
    stable = position_polynomial(POSITION_GAINS["stable"])
    assert is_hurwitz(stable)
    np.testing.assert_allclose(np.roots(stable), [-2.5] * 4, atol=2e-3)


def test_published_gains_leave_the_attitude_region():
    times, states = flight("ch02", 5.0, 0.002)
    assert times[-1] == pytest.approx(1.64, abs=0.004)
    assert np.abs(states[-1, 6:8]).max() > pi / 2
    determinant = normalized_determinant(states[:-1, 6], states[:-1, 7], states[:-1, 12], QUADROTOR)
    assert determinant.min() > 0.3


def test_stable_gains_fly_the_circle_through_the_published_curve():
    times, states = flight("stable", 30.0, 0.01)
    assert times[-1] == pytest.approx(30.0)
    surface = published_determinant(states[:, 6], states[:, 7])
    assert surface.min() < -0.5
    assert surface.max() > 1e-3  # inside of the curve for a while: crossed, and crossed back
    determinant = normalized_determinant(states[:, 6], states[:, 7], states[:, 12], QUADROTOR)
    assert determinant.min() > 0.8
    error = [
        hypot(x - (1 - cos(t / 20)), y - sin(t / 20)) for t, (x, y) in zip(times, states[:, :2])
    ]
    assert max(e for t, e in zip(times, error) if t >= 20.0) < 1e-3
    assert error[-1] < 3e-5
    assert abs(states[-1, 2]) < 3e-5
