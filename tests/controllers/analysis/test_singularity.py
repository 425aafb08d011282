"""Singularity analysis against brute force and against the printed coefficients."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tiltsim_controllers.analysis.singularity import (
    decoupling_matrix,
    determinant,
    force_matrix,
    margin_over_gait,
    rank,
    residuals,
    singular_values,
    singularity_margin,
    torque_free_direction,
    torque_matrix,
    world_up,
)
from tiltsim_controllers.vehicle.cross import cross_torque, torque_free_inputs
from tiltsim_controllers.vehicle.parameters import PRESETS, Vehicle, drag_ratio

AR_DRONE = PRESETS["ar_drone_2"]
LUUKKONEN = PRESETS["luukkonen"]

tilt = st.floats(-1.5, 1.5)
gaits = st.tuples(tilt, tilt, tilt, tilt)


def determinant_unit(vehicle):
    """``2 L^2 K_f^3 K_m``: the SI value of one unit of `determinant`."""
    return 2.0 * vehicle.arm_length**2 * vehicle.thrust_coefficient**3 * vehicle.drag_coefficient


def vehicle_with(arm_length: float, thrust: float, drag: float) -> Vehicle:
    return AR_DRONE._replace(
        arm_length=arm_length, thrust_coefficient=thrust, drag_coefficient=drag
    )


def test_determinant_matches_lapack_for_any_vehicle() -> None:
    """10,000 random cases, relative to the Hadamard bound (the product of the row norms).

    That is the fair scale: it bounds any determinant from above, and the error of LAPACK's own
    result is proportional to it.
    """
    generator = np.random.default_rng(20240601)
    worst = 0.0
    for _ in range(100):
        vehicle = vehicle_with(*10.0 ** generator.uniform([-1.5, -7, -8], [0.5, -4, -5]))
        angles = generator.uniform(-np.pi, np.pi, (100, 4))
        roll, pitch = generator.uniform(-np.pi / 2, np.pi / 2, (2, 100))
        matrix = decoupling_matrix(angles, roll, pitch, vehicle)
        closed = determinant(angles, roll, pitch, vehicle) * determinant_unit(vehicle)
        scale = np.linalg.norm(matrix, axis=-1).prod(axis=-1)
        worst = max(worst, np.max(np.abs(closed - np.linalg.det(matrix)) / scale))
    assert worst < 1e-9


def test_determinant_matches_lapack_relative_to_itself() -> None:
    generator = np.random.default_rng(7)
    angles = generator.uniform(-1.5, 1.5, (10_000, 4))
    roll, pitch = generator.uniform(-1.5, 1.5, (2, 10_000))
    matrix = decoupling_matrix(angles, roll, pitch, AR_DRONE)
    closed = determinant(angles, roll, pitch, AR_DRONE) * determinant_unit(AR_DRONE)
    reference = np.linalg.det(matrix)
    regular = np.abs(reference) > 1e-5 * np.linalg.norm(matrix, axis=-1).prod(axis=-1)
    assert regular.mean() > 0.99
    np.testing.assert_allclose(closed[regular], reference[regular], rtol=1e-9)


def test_torque_and_force_matrices_are_the_published_ones() -> None:
    """Ch. 3, Eqs. (3) and (5), written out once more."""
    angles = np.array([0.3, -0.4, 0.5, 0.7])
    s, c = np.sin(angles), np.cos(angles)
    arm, drag = AR_DRONE.arm_length * AR_DRONE.thrust_coefficient, AR_DRONE.drag_coefficient
    torque = [
        [0, arm * c[1] - drag * s[1], 0, -arm * c[3] + drag * s[3]],
        [arm * c[0] + drag * s[0], 0, -arm * c[2] - drag * s[2], 0],
        [
            arm * s[0] - drag * c[0],
            -arm * s[1] - drag * c[1],
            arm * s[2] - drag * c[2],
            -arm * s[3] - drag * c[3],
        ],
    ]
    force = [[0, s[1], 0, -s[3]], [s[0], 0, -s[2], 0], [-c[0], c[1], -c[2], c[3]]]
    np.testing.assert_allclose(torque_matrix(angles, AR_DRONE) * arm, torque, rtol=1e-14)
    np.testing.assert_allclose(force_matrix(angles), force, rtol=1e-14)


@given(gaits)
def test_torque_free_inputs_are_the_minors_of_tau(angles) -> None:
    """Their norm is the product of the singular values, which spares looking for these."""
    inputs = torque_free_inputs(cross_torque(np.array(angles), drag_ratio(AR_DRONE)))
    product = singular_values(angles, AR_DRONE).prod()
    assert np.linalg.norm(inputs) == pytest.approx(product, rel=1e-9, abs=1e-14)


@given(angles=gaits, roll=st.floats(-0.7, 0.7), pitch=st.floats(-0.7, 0.7))
def test_margin_is_the_smallest_rotation_to_a_singular_attitude(angles, roll, pitch) -> None:
    """Turn world up by the margin about every axis across it: the best turn just reaches zero."""
    margin = float(singularity_margin(angles, AR_DRONE, roll, pitch))
    if margin == 0.0:
        return
    R, R_phi, R_theta = residuals(angles, AR_DRONE)
    force = np.array([-R_theta, R_phi, R]) / np.linalg.norm([R, R_phi, R_theta])
    up = world_up(roll, pitch)
    across = np.linalg.svd(up[np.newaxis])[2][1:]
    heading = np.linspace(0, 2 * np.pi, 1_001)[:, np.newaxis]
    axes = np.cos(heading) * across[0] + np.sin(heading) * across[1]

    def reaches_zero(turn: float) -> bool:
        turned = np.cos(turn) * up + np.sin(turn) * axes
        values = turned @ force
        return bool(values.min() <= 0.0 <= values.max())

    low, high = 0.0, np.pi / 2
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if reaches_zero(middle) else (middle, high)
    assert abs(margin) == pytest.approx(high, abs=1e-4)


def test_margin_changes_sign_across_the_curve() -> None:
    angles = [-0.65, -0.65, 0.65, 0.65]
    level = float(singularity_margin(angles, AR_DRONE))
    attitudes = np.linspace(0.0, 1.5, 200)
    values = singularity_margin(angles, AR_DRONE, 0.0, attitudes)
    values = np.concatenate([singularity_margin(angles, AR_DRONE, 0.0, -attitudes)[::-1], values])
    assert level > 0.0
    assert values.min() < 0.0
    signs = np.sign(determinant(angles, 0.0, attitudes, AR_DRONE))
    np.testing.assert_array_equal(signs, np.sign(values[200:]))


def test_margin_over_a_gait_is_negative_after_a_crossing() -> None:
    """Red gaits on either side of the curve L: each safe by itself, not the step between them."""
    up, down = [-0.3, 0.3, -0.3, 0.3], [0.5, -0.5, 0.5, -0.5]
    margins = margin_over_gait(np.array([up, down]), AR_DRONE)
    np.testing.assert_allclose(margins, [np.pi / 2, -np.pi / 2])
    np.testing.assert_allclose(margin_over_gait(np.array([down, down]), AR_DRONE), np.pi / 2)


@given(angles=gaits, drag=st.floats(0.02, 0.9))
def test_rank_is_numpys_and_direction_is_free_of_torque(angles, drag) -> None:
    vehicle = vehicle_with(1.0, 1.0, drag)
    matrix = torque_matrix(angles, vehicle)
    assert int(rank(angles, vehicle)) == np.linalg.matrix_rank(matrix, rtol=1e-8)
    np.testing.assert_allclose(
        singular_values(angles, vehicle), np.linalg.svd(matrix)[1], atol=1e-12
    )
    direction = torque_free_direction(angles, vehicle)
    if np.isnan(direction).any():
        assert float(singularity_margin(angles, vehicle)) == 0.0
        return
    assert direction[2] >= 0.0
    kernel = np.linalg.svd(matrix)[2][3]
    force = force_matrix(angles) @ kernel
    np.testing.assert_allclose(np.cross(force, direction), 0.0, atol=1e-6)


@pytest.mark.parametrize("vehicle", PRESETS.values(), ids=PRESETS)
@pytest.mark.parametrize("angles", [(-0.5, 0.5), (0.3, -0.2), (0.9, 0.1)])
def test_blue_gaits_lose_rank_and_red_gaits_are_vertical(vehicle, angles) -> None:
    first, second = angles
    offset = 2.0 * np.arctan(drag_ratio(vehicle))
    blue = (first, second, offset - first, -offset - second)
    assert rank(blue, vehicle) == 2
    np.testing.assert_allclose(residuals(blue, vehicle), 0.0, atol=1e-14)
    assert singularity_margin(blue, vehicle) == 0.0
    assert np.isnan(torque_free_direction(blue, vehicle)).all()
    red = (first, second, first, second)
    R, R_phi, R_theta = residuals(red, vehicle)
    assert R_phi == R_theta == 0.0
    assert abs(R) > 0.1
    assert singularity_margin(red, vehicle) == pytest.approx(np.pi / 2, abs=1e-15)


def test_thesis_rounding_of_the_blue_offset_leaves_a_trace_of_rank() -> None:
    """0.334198 instead of 0.334186...: rank 3 by rounding, as the thesis met it."""
    angles = (0.5, -0.5, -0.5 + 0.334198, 0.5 - 0.334198)
    values = singular_values(angles, AR_DRONE)
    assert rank(angles, AR_DRONE) == 3
    assert values[2] / values[0] < 1e-4


def test_red_gait_on_the_curve_has_rank_three_and_no_direction() -> None:
    """On L the torque-free inputs make no force, though tau keeps its rank."""
    first = 0.6
    second = np.arctan(np.tan(first) - 2.0 * drag_ratio(AR_DRONE))
    angles = (first, second, first, second)
    assert rank(angles, AR_DRONE) == 3
    assert np.isnan(torque_free_direction(angles, AR_DRONE)).all()
    assert singularity_margin(angles, AR_DRONE) == 0.0


# Printed coefficients, term by term. A term is named by its factors for rotors 1 to 4, "csss"
# standing for c1 s2 s3 s4.

PRINTED_R = {
    **{"cccc": 4.000},
    **{"cccs": 5.592, "ccsc": -5.592, "cscc": 5.592, "sccc": -5.592},
    **{"ccss": 0.9716, "cssc": 0.9716, "sccs": 0.9716, "sscc": 0.9716},
    **{"cscs": -2.000, "scsc": -2.000},
    **{"csss": -0.1687, "scss": 0.1687, "sscs": -0.1687, "sssc": 0.1687},
}
PRINTED_R_PHI = {
    **{"ccsc": 1.000, "sccc": -1.000, "csss": -1.000, "sscs": 1.000},
    **{"ccss": 2.880, "cssc": 2.880, "sccs": -2.880, "sscc": -2.880},
}
PRINTED_R_THETA = {
    **{"cccs": 1.000, "cscc": -1.000, "scss": -1.000, "sssc": 1.000},
    **{"ccss": -2.880, "cssc": 2.880, "sccs": -2.880, "sscc": 2.880},
}
CH12 = {1.000: 1.025, 2.000: 2.050, 2.880: 2.927, 4.000: 4.100}
CH12 |= {5.592: 5.680, 0.9716: 0.9954, 0.1687: 0.1743}
CH12_SCALE = 1.025
"""Ch. 12 normalizes differently: its coefficient of the plain products is 1.025, not 1."""


def expand(vehicle: Vehicle) -> list[dict[str, float]]:
    """Coefficients of the sixteen products in R, R_phi, R_theta, which are linear in each product.

    Each product is 1 at one corner of {0, pi/2}^4 and 0 at all others.
    """
    names = ["".join(letters) for letters in itertools.product("cs", repeat=4)]
    corners = [[0.0 if letter == "c" else np.pi / 2 for letter in name] for name in names]
    tables = []
    for part in residuals(corners, vehicle):
        pairs = zip(names, part.tolist(), strict=True)
        tables.append({name: value for name, value in pairs if abs(value) > 1e-12})
    return tables


def digits(printed: float) -> float:
    """Half a unit in the last of the four printed significant digits."""
    return 0.5 * 10.0 ** (np.floor(np.log10(abs(printed))) - 3)


def test_printed_coefficients_of_chapter_3() -> None:
    """Propositions 1 and 2 (Eqs. 17, 19); each printed number to its last digit."""
    for computed, printed in zip(
        expand(AR_DRONE), (PRINTED_R, PRINTED_R_PHI, PRINTED_R_THETA), strict=True
    ):
        assert computed.keys() == printed.keys()
        for term, value in printed.items():
            assert computed[term] == pytest.approx(value, abs=1.001 * digits(value)), term


def test_printed_coefficients_of_chapter_12() -> None:
    """Eqs. (4)-(8): the same polynomial at the other vehicle's drag ratio, times 1.025."""
    for computed, printed in zip(
        expand(LUUKKONEN), (PRINTED_R, PRINTED_R_PHI, PRINTED_R_THETA), strict=True
    ):
        for term, chapter_3 in printed.items():
            value = np.copysign(CH12[abs(chapter_3)], chapter_3)
            scaled = computed[term] * CH12_SCALE
            # 1.025 itself is printed with four digits: also allow for its rounding.
            slack = digits(value) + abs(computed[term]) * 0.0005
            assert scaled == pytest.approx(value, abs=slack), term


def test_the_slips_of_the_pen_are_slips() -> None:
    """Read literally, ch. 3's Eq. (17) gives the wrong determinant; corrected, the right one."""
    generator = np.random.default_rng(5)
    angles = generator.uniform(-1, 1, (200, 4))
    sine, cosine = np.sin(angles), np.cos(angles)

    def evaluate(table: dict[str, float]) -> np.ndarray:
        return sum(
            value
            * np.prod(
                [sine[:, i] if f == "s" else cosine[:, i] for i, f in enumerate(term)], axis=0
            )
            for term, value in table.items()
        )

    correct = residuals(angles, AR_DRONE).R_phi
    slipped = dict(PRINTED_R_PHI)
    slipped["sscs"] += slipped.pop("sscc")
    assert np.abs(evaluate(PRINTED_R_PHI) - correct).max() < 5e-3
    assert np.abs(evaluate(slipped) - correct).max() > 0.1
