"""The Two Color Map: closed form against search, for any vehicle."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.controllers.analysis.test_singularity import (
    PRINTED_R,
    PRINTED_R_PHI,
    PRINTED_R_THETA,
    vehicle_with,
)
from tiltsim_controllers.analysis import two_color_map
from tiltsim_controllers.analysis.singularity import Residuals, rank, residuals, singularity_margin
from tiltsim_controllers.analysis.two_color_map import (
    curve_l,
    delta,
    find_roots,
    grid_axis,
    grid_roots,
    point_p,
    red_residual,
    region,
    root_classes,
    root_counts,
)
from tiltsim_controllers.vehicle.parameters import PRESETS, drag_ratio

AR_DRONE = PRESETS["ar_drone_2"]
tilt = st.floats(-1.5, 1.5)
ratios = st.floats(0.02, 0.9)


@pytest.fixture(scope="module", params=PRESETS)
def vehicle(request):
    return PRESETS[request.param]


def test_offsets_round_to_the_published_ones() -> None:
    """0.334198 and 0.336842 in ch. 8 and 12; exact to nine digits here."""
    assert 2 * delta(PRESETS["ar_drone_2"]) == pytest.approx(0.334186442, abs=5e-10)
    assert 2 * delta(PRESETS["luukkonen"]) == pytest.approx(0.336823800, abs=5e-10)


@given(angles=st.tuples(tilt, tilt, tilt, tilt), ratio=ratios)
def test_residuals_factor(angles, ratio) -> None:
    vehicle = vehicle_with(1.0, 1.0, ratio)
    a1, a2, a3, a4 = angles
    offset, k = 2 * delta(vehicle), 0.5 * (ratio + 1 / ratio)
    _, R_phi, R_theta = residuals(angles, vehicle)
    scale = 1e-13 / ratio
    assert R_theta == pytest.approx(k * np.sin(a1 + a3 - offset) * np.sin(a2 - a4), abs=scale)
    assert R_phi == pytest.approx(k * np.sin(a2 + a4 + offset) * np.sin(a3 - a1), abs=scale)


@given(first=tilt, second=tilt, ratio=ratios)
def test_red_residual_factors_and_vanishes_on_l(first, second, ratio) -> None:
    vehicle = vehicle_with(1.0, 1.0, ratio)
    R = residuals((first, second, first, second), vehicle).R
    assert float(red_residual(first, second, vehicle)) == pytest.approx(float(R), abs=1e-12 / ratio)
    on_l = float(curve_l(first, vehicle))
    assert abs(float(red_residual(first, on_l, vehicle))) < 1e-12 / ratio
    assert region(first, on_l, vehicle) == "L"
    sides = {region(first, on_l + 0.01, vehicle), region(first, on_l - 0.01, vehicle)}
    inside = abs(first) < 1.2 and abs(on_l) < 1.2 and ratio < 0.3
    assert sides == {"S_U", "S_D"} or not inside


@pytest.mark.parametrize("edge", [1, 2])
def test_red_is_also_singular_on_two_lines_near_the_edge(vehicle, edge) -> None:
    angle = delta(vehicle) - np.pi / 2
    for other in (-0.9, 0.2, 0.7):
        first, second = (angle, other) if edge == 1 else (other, -angle)
        np.testing.assert_allclose(residuals((first, second) * 2, vehicle), 0.0, atol=1e-13)
        aside = (first + 0.01, second) if edge == 1 else (first, second - 0.01)
        assert abs(float(residuals(aside * 2, vehicle).R)) > 1e-3


def test_p_lies_on_l_and_both_colors_meet_there(vehicle) -> None:
    """Ch. 8 and 12 place P a little below L; it is on it, and tau has rank 2 there."""
    first, second = point_p(vehicle)
    assert curve_l(first, vehicle) == pytest.approx(second, abs=1e-15)
    assert region(first, second, vehicle) == "L"
    assert rank((first, second, first, second), vehicle) == 2


def test_root_counts_are_the_published_ones(vehicle) -> None:
    """Ch. 6, Fig. 4: 2 inside, 3 on the sides, 5 in the corners."""
    counts = root_counts(grid_roots(vehicle))
    assert counts.shape == (17, 17)
    expected = np.full((17, 17), 2)
    expected[[0, -1], :] = expected[:, [0, -1]] = 3
    expected[np.ix_([0, -1], [0, -1])] = 5
    np.testing.assert_array_equal(counts, expected)


def test_roots_are_roots_and_lie_on_the_lines(vehicle) -> None:
    offset = 2 * delta(vehicle)
    for row in grid_roots(vehicle):
        for cell in row:
            for root in cell:
                angles = (root.alpha_1, root.alpha_2, root.alpha_3, root.alpha_4)
                R, R_phi, R_theta = residuals(angles, vehicle)
                assert abs(R_phi) < 1e-13
                assert abs(R_theta) < 1e-13
                assert pytest.approx(float(R)) == root.R
                red = max(
                    abs(np.sin(root.alpha_3 - root.alpha_1)),
                    abs(np.sin(root.alpha_4 - root.alpha_2)),
                )
                blue = max(
                    abs(np.sin(root.alpha_3 + root.alpha_1 - offset)),
                    abs(np.sin(root.alpha_4 + root.alpha_2 + offset)),
                )
                assert min(red, blue) < 1e-12
                if blue < 1e-12:
                    assert abs(root.R) < 1e-12


def test_seven_classes_as_published_and_none_mixed(vehicle) -> None:
    """Ch. 6: seven categories, and no (+,-) or (-,+)."""
    classes = root_classes(grid_roots(vehicle))
    assert set(classes) == {"(+,+)", "(-,-)", "(+,?)", "(?,+)", "(-,?)", "(?,-)", "(?,?)"}
    assert sum(classes.values()) == 2 * 15 * 15


@pytest.mark.parametrize(("share", "plane"), [(0.999, "?"), (1.001, "+")])
def test_planes_count_as_intersecting_within_half_a_grid_step(share, plane) -> None:
    """Without tilt they are ``2 delta`` apart; the grid of 17 points has steps of pi / 16."""
    ratio = np.tan(0.5 * share * 0.5 * np.pi / 16.0)
    lever = AR_DRONE.arm_length * AR_DRONE.thrust_coefficient
    vehicle = AR_DRONE._replace(drag_coefficient=float(ratio * lever))
    untilted = grid_roots(vehicle)[8][8]
    found = {(root.plane_3, root.plane_4) for root in untilted if abs(root.alpha_3) < 1e-9}
    assert found == {(plane, plane)}


def test_positive_residual_needs_red_and_fills_a_triangle(vehicle) -> None:
    """R > 0 for one root of each pair above the diagonal.

    Ch. 6 gives the triangle's vertices as (-7, 7), (-7, -5), (5, 7) in units of pi/16; the one
    computed reaches (-7, -7) and (7, 7), and must, as the untilted vehicle has R = 4.
    """
    positive = {
        (i, j)
        for i, row in enumerate(grid_roots(vehicle)[1:-1], start=-7)
        for j, cell in enumerate(row[1:-1], start=-7)
        for root in cell
        if root.R > 1e-9
    }
    assert {(-7, 7), (-7, -7), (7, 7), (0, 0)} <= positive
    assert all(j >= i - 2 for i, j in positive)
    assert {(i, j) for i in range(-7, 8) for j in range(i, 8)} <= positive
    assert (len(positive), sum(j < i for i, j in positive)) == (128, 8)


def test_no_grid_point_lies_exactly_on_a_crossing_of_planes() -> None:
    for first in grid_axis()[1:-1]:
        roots = find_roots(float(first), 0.2, AR_DRONE)
        assert {root.plane_3 for root in roots} <= {"+", "-"}


def test_printed_coefficients_explain_the_published_offset(monkeypatch) -> None:
    """With four digits the search yields 0.334198 and a blue R of about -1e-4, as in ch. 6 to 8.

    So the thesis's blue gaits were invertible by the rounding of its coefficients alone.
    """

    def printed(angles, vehicle):
        sine, cosine = np.sin(angles), np.cos(angles)

        def evaluate(table):
            return sum(
                value
                * np.prod(
                    [(sine if f == "s" else cosine)[..., i] for i, f in enumerate(term)], axis=0
                )
                for term, value in table.items()
            )

        return Residuals(*map(evaluate, (PRINTED_R, PRINTED_R_PHI, PRINTED_R_THETA)))

    monkeypatch.setattr(
        two_color_map, "residuals", lambda angles, vehicle: printed(np.array(angles), vehicle)
    )
    roots = find_roots(0.5, -0.5, AR_DRONE)
    blue = next(root for root in roots if root.plane_3 == "-")
    assert blue.alpha_3 + 0.5 == pytest.approx(0.334198, abs=5e-7)
    assert blue.alpha_4 - 0.5 == pytest.approx(-0.334198, abs=5e-7)
    assert -5e-4 < blue.R < -1e-5


@given(first=tilt, second=tilt, ratio=ratios)
def test_blue_has_no_margin_and_red_all_of_it(first, second, ratio) -> None:
    vehicle = vehicle_with(1.0, 1.0, ratio)
    offset = 2 * delta(vehicle)
    blue = (first, second, offset - first, -offset - second)
    assert rank(blue, vehicle) <= 2
    assert float(singularity_margin(blue, vehicle)) == 0.0
    red = (first, second, first, second)
    if abs(float(red_residual(first, second, vehicle))) > 1e-3 / ratio and rank(red, vehicle) == 3:
        assert float(singularity_margin(red, vehicle)) == pytest.approx(np.pi / 2, abs=1e-9)


def test_lines_of_roots_are_refused() -> None:
    with pytest.raises(ValueError, match="not isolated"):
        find_roots(delta(AR_DRONE), 0.4, AR_DRONE)
    with pytest.raises(ValueError, match="not isolated"):
        find_roots(0.4, -delta(AR_DRONE), AR_DRONE)


def test_published_drag_ratio_is_far_from_the_degenerate_case() -> None:
    assert drag_ratio(AR_DRONE) == pytest.approx(0.16867, abs=5e-6)
