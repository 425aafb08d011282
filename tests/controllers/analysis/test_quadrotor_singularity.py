"""The published determinant surface, its curve, and where it comes from."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

from tiltsim_controllers.analysis.singularity import (
    exact_determinant,
    normalized_determinant,
    published_determinant,
    published_singular_curve,
)
from tiltsim_controllers.laws.quadrotor import decoupling_matrix
from tiltsim_controllers.vehicle.parameters import PRESETS

QUADROTOR = PRESETS["ar_drone_2_unrounded"]
WEIGHT = QUADROTOR.mass * QUADROTOR.gravity

PHI, THETA, PSI = sympy.symbols("phi theta psi", real=True)
S_PHI, C_PHI = sympy.sin(PHI), sympy.cos(PHI)
S_THETA, C_THETA = sympy.sin(THETA), sympy.cos(THETA)
S_PSI, C_PSI = sympy.sin(PSI), sympy.cos(PSI)
SURFACE = -1 + C_THETA**2 * C_PHI**2 - C_THETA**2 * C_PHI * S_PHI
MISSING = -(C_THETA**2) * (C_PHI - S_PHI)


def printed_delta(slip):
    """Ch. 2, Eq. (42), with Eqs. (31) and (36) as printed or put right, in units of m, zeta, d, I.

    Those units drop out of ``P Delta Q``.
    """
    t_theta = S_THETA / C_THETA
    turned = S_PHI if slip else C_PHI
    a = (C_PHI * C_PSI * S_THETA + S_PHI * S_PSI, C_PHI * S_PSI * S_THETA - S_PHI * C_PSI)
    m = (C_PSI * S_PHI - S_PSI * S_THETA * turned, S_PSI * S_PHI + C_PSI * S_THETA * turned, 0)
    n = (
        S_PSI * C_PHI - C_PSI * S_THETA * S_PHI,
        -C_PSI * C_PHI - S_PSI * S_THETA * S_PHI,
        -C_THETA * S_PHI,
    )
    o = (C_PSI * C_THETA * C_PHI, S_PSI * C_THETA * C_PHI, -S_THETA * C_PHI)
    rows = [
        [
            -ai,
            -ni,
            -(mi * S_PHI / C_THETA + ni * S_PHI * t_theta + oi * C_PHI),
            -(mi * C_PHI / C_THETA + ni * C_PHI * t_theta - oi * S_PHI),
        ]
        for ai, mi, ni, oi in zip((*a, C_THETA * C_PHI), m, n, o)
    ]
    return sympy.Matrix([*rows, [0, 0, S_PHI / C_THETA, C_PHI / C_THETA]])


def printed_factors():
    """P and Q of Eq. (43), in the same units."""
    p2, p3, q2 = sympy.eye(4), sympy.eye(4), sympy.eye(4)
    p2[0, 3] = p2[1, 3] = S_PHI * S_PSI * C_THETA
    p2[2, 3] = -S_PHI * S_THETA
    p3[0, 3] = p3[1, 3] = p3[2, 3] = C_THETA
    p3[3, 3] = -C_THETA
    q2[3, 2] = -S_PHI / C_PHI
    q3 = sympy.Matrix(
        [
            [1, 0, 0, 0],
            [1, 1, 0, 0],
            [0, S_THETA * S_PHI / C_THETA, 1 / C_THETA, 0],
            [0, 0, 0, 1 / C_PHI],
        ]
    )
    return sympy.diag(1, 1, -C_THETA, 1) * p2 * p3, -sympy.eye(4) * q2 * q3


def printed_product():
    """The right side of Eq. (43)."""
    d11 = C_PSI * S_THETA * (C_PHI - S_PHI) + S_PSI * (S_PHI + C_PHI)
    d21 = S_PSI * S_THETA * (C_PHI - S_PHI) - C_PSI * (S_PHI + C_PHI)
    return sympy.Matrix(
        [
            [d11, S_PSI * C_PHI, C_PSI, 0],
            [d21, -C_PSI * C_PHI, S_PSI, 0],
            [0, S_PHI, S_THETA, 0],
            [0, 0, 0, 1],
        ]
    )


def test_the_surface_is_the_determinant_of_eq_43_as_printed():
    roll, pitch, yaw = np.random.default_rng(0).uniform(-1.5, 1.5, (3, 20))
    surface = sympy.lambdify((PHI, THETA), SURFACE)(roll, pitch)
    product = sympy.lambdify((PHI, THETA, PSI), printed_product())
    found = [np.linalg.det(product(*angles)) for angles in zip(roll, pitch, yaw, strict=True)]
    np.testing.assert_allclose(found, surface, rtol=0, atol=1e-13)
    np.testing.assert_allclose(published_determinant(roll, pitch), surface, rtol=0, atol=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize("slip", [True, False], ids=["as printed", "put right"])
def test_the_slip_in_eq_31_does_not_touch_the_determinant(slip):
    assert sympy.simplify(printed_delta(slip).det() + C_PHI / C_THETA) == 0


@pytest.mark.parametrize("slip", [True, False], ids=["as printed", "put right"])
def test_the_surface_comes_from_one_missing_entry_of_eq_43(slip):
    p, q = printed_factors()
    expected = printed_product()[:, :3]
    expected[2, 0] = MISSING
    difference = sympy.lambdify((PHI, THETA, PSI), (p * printed_delta(slip) * q)[:, :3] - expected)
    for attitude in np.random.default_rng(5).uniform(-1.4, 1.4, (20, 3)):
        np.testing.assert_allclose(difference(*attitude), 0.0, atol=1e-12)


def test_with_that_entry_the_determinant_is_minus_one_at_every_attitude():
    put_right = printed_product()
    put_right[2, 0] = MISSING
    matrix = sympy.lambdify((PHI, THETA, PSI), put_right)
    for attitude in np.random.default_rng(5).uniform(-1.4, 1.4, (20, 3)):
        assert np.linalg.det(matrix(*attitude)) == pytest.approx(-1.0, abs=1e-12)


def test_the_curve_lies_on_the_surface_and_passes_through_level():
    roll, pitch = published_singular_curve()
    np.testing.assert_allclose(published_determinant(roll, pitch), 0.0, atol=1e-14)
    assert (roll[0], pitch[0]) == pytest.approx((0.0, 0.0))
    assert roll.min() == pytest.approx(-np.pi / 4)
    assert pitch.max() == pytest.approx(0.427, abs=1e-3)  # where roll is -pi/8
    np.testing.assert_allclose(pitch[::-1], -pitch, atol=1e-15)
    # Both ends meet in level attitude: closed, without a jump.
    assert np.hypot(np.diff(roll), np.diff(pitch)).max() < 0.02


def test_the_exact_determinant_equals_the_determinant_of_the_law():
    random = np.random.default_rng(1)
    for _ in range(20):
        roll, pitch, yaw = random.uniform(-1.5, 1.5, 3)
        thrust = random.uniform(0.5, 9.0)
        state = np.array([*[0.0] * 6, roll, pitch, yaw, *random.uniform(-1, 1, 3), thrust, 0.3])
        matrix = decoupling_matrix(state, QUADROTOR)
        expected = exact_determinant(roll, pitch, thrust, QUADROTOR)
        # Three outputs and two inputs have the other sign in ch. 2's axes, z down.
        np.testing.assert_allclose(-np.linalg.det(matrix), expected, rtol=1e-10)


def test_the_exact_determinant_vanishes_nowhere_inside():
    grid = np.linspace(-1.57, 1.57, 101)
    roll, pitch = np.meshgrid(grid, grid)
    determinant = normalized_determinant(roll, pitch, WEIGHT, QUADROTOR)
    assert determinant.min() > 0.0
    assert normalized_determinant(0.0, 0.0, WEIGHT, QUADROTOR) == pytest.approx(1.0)
