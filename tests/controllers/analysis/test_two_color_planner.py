"""Paths on the Two Color Map against the two published theorems, and the gaits of the thesis."""

from __future__ import annotations

import numpy as np
import pytest

from tiltsim_controllers.analysis.published_gaits import (
    DETERMINANT_CASES,
    PATHS,
    PUBLISHED_GAITS,
    robustness_table,
)
from tiltsim_controllers.analysis.singularity import rank, residuals, singularity_margin
from tiltsim_controllers.analysis.two_color_map import curve_l, delta, point_p, region
from tiltsim_controllers.analysis.two_color_planner import (
    BLUE_WARNING,
    SWITCH_WARNING,
    Circle,
    Leg,
    Polyline,
    check_path,
    four_angle_gait,
    polygon,
    rectangle,
)
from tiltsim_controllers.vehicle.parameters import PRESETS

AR_DRONE = PRESETS["ar_drone_2"]
P = point_p(AR_DRONE)
TRIANGLE = (P, (0.7, -0.25), (0.25, -0.7), P)


def test_rectangles_satisfy_the_first_theorem() -> None:
    red = check_path(rectangle((0.2, 0.8), (-0.8, -0.2), "red"), AR_DRONE)
    assert red.theorem == "two_color"
    assert red.warnings == ()
    assert red.sound
    blue = check_path(rectangle((-0.8, 1.2), (-0.8, 1.2), "blue"), AR_DRONE)
    assert blue.theorem == "two_color"
    assert blue.warnings == (BLUE_WARNING,)
    assert blue.accepted
    assert not blue.sound


@pytest.mark.parametrize("example", ["E1", "E2", "E3"])
def test_examples_of_the_generalized_theorem(example) -> None:
    report = check_path(PATHS[example], AR_DRONE)
    assert report.theorem == "generalized"
    assert (BLUE_WARNING in report.warnings) == (example == "E2")


def test_e4_is_refused_where_it_crosses_l() -> None:
    report = check_path(PATHS["E4"], AR_DRONE)
    assert not report.accepted
    assert len(report.crossings) == 2
    for first, second in report.crossings:
        assert float(curve_l(first, AR_DRONE)) == pytest.approx(second, abs=1e-9)
        assert f"({first:.6f}, {second:.6f})" in report.reasons[0]


def test_a_red_path_that_only_touches_l_is_refused() -> None:
    on_l = (0.5, float(curve_l(0.5, AR_DRONE)))
    report = check_path(polygon(((0.6, -0.6), on_l, (0.8, -0.5)), "red"), AR_DRONE)
    assert report.crossings == (pytest.approx(on_l),)


def test_a_red_path_that_ends_its_leg_just_before_l_does_not_cross_it() -> None:
    start, on_l = np.array((0.6, -0.6)), np.array((0.5, float(curve_l(0.5, AR_DRONE))))
    near = start + 0.97 * (on_l - start)
    report = check_path(polygon(((0.6, -0.6), (near[0], near[1]), (0.8, -0.5)), "red"), AR_DRONE)
    assert report.crossings == ()


def test_a_red_path_that_dips_across_l_between_samples_is_refused() -> None:
    """A circle tangent to L, moved across by 1e-7: two crossings about 1e-3 apart."""
    first, offset = 0.2, 1e-7
    second = float(curve_l(first, AR_DRONE))
    slope = (np.cos(second) / np.cos(first)) ** 2
    normal = np.array([slope, -1.0]) / np.hypot(slope, 1.0)
    for shift, refused in ((-offset, True), (1e-4, False)):
        centre = np.array([first, second]) + (0.2 + shift) * normal
        report = check_path(Circle("red", (float(centre[0]), float(centre[1])), 0.2), AR_DRONE)
        assert report.accepted is not refused
        assert bool(report.crossings) is refused


def test_color_switch_at_p_and_nowhere_else() -> None:
    switching = Polyline((Leg("red", TRIANGLE), Leg("blue", TRIANGLE)))
    report = check_path(switching, AR_DRONE)
    assert report.theorem == "generalized"
    assert report.warnings == (BLUE_WARNING, SWITCH_WARNING)
    gait = four_angle_gait(switching, 2.0, AR_DRONE)
    assert gait.is_continuous
    np.testing.assert_allclose(gait.angles([0.0, 1.0, 2.0]), [[*P, *P]] * 3, atol=1e-15)
    square = ((0.5, -0.5), (0.6, -0.5), (0.6, -0.6), (0.5, -0.5))
    report = check_path(Polyline((Leg("red", square), Leg("blue", square))), AR_DRONE)
    assert "color changes at (0.500000, -0.500000)" in report.reasons[0]


def test_broken_and_far_paths_are_refused() -> None:
    broken = Polyline((Leg("red", ((0.5, -0.5), (0.6, -0.6), (0.5, -0.7))),))
    assert "broken at" in check_path(broken, AR_DRONE).reasons[0]
    far = check_path(Circle("red", (1.0, -1.0), 0.3), AR_DRONE)
    assert "holds up to 1" in far.reasons[0]
    beyond = check_path(rectangle((0.2, 1.6), (-0.8, -0.2), "blue"), AR_DRONE)
    assert "below pi/2" in beyond.reasons[0]


@pytest.mark.parametrize(
    "path",
    [
        Polyline(()),
        Polyline((Leg("red", ((0.0, 0.0),)),)),
        Polyline((Leg("red", ((0.0, 0.0), (float("nan"), 0.0))),)),
        Circle("red", (0.0, 0.0), 0.0),
        Circle("green", (0.0, 0.0), 0.2),
        Polyline((Leg("green", ((0.0, 0.0), (0.1, 0.0))),)),
    ],
)
def test_an_invalid_path_is_an_error(path) -> None:
    with pytest.raises(ValueError, match=r"\w"):
        check_path(path, AR_DRONE)


def test_a_short_path_is_a_gait() -> None:
    small = polygon(((0.3, -0.3), (0.4, -0.3), (0.4, -0.4)), "red")
    gait = four_angle_gait(small, 2.0, AR_DRONE)
    np.testing.assert_allclose(gait.angles(0.0)[:2], (0.3, -0.3), atol=1e-12)
    length = 0.2 + 0.1 * np.sqrt(2.0)
    assert np.hypot(*gait.rates(0.01)[:2]) == pytest.approx(length / 2.0)


def test_a_path_without_length_is_no_gait() -> None:
    with pytest.raises(ValueError, match="no length"):
        four_angle_gait(polygon(((0.5, -0.5), (0.5, -0.5)), "red"), 1.0, AR_DRONE)


@pytest.mark.parametrize("vehicle", PRESETS.values(), ids=PRESETS)
@pytest.mark.parametrize("color", ["red", "blue"])
def test_gaits_stay_on_their_color_at_constant_speed(vehicle, color) -> None:
    path = polygon(((0.4, -0.8), (0.9, -0.3), (0.7, -0.7)), color)
    for planned in (path, Circle(color, (0.6, -0.6), 0.2)):
        gait = four_angle_gait(planned, 3.0, vehicle)
        time = np.linspace(0.01, 2.99, 50)
        angles, rates = gait.angles(time), gait.rates(time)
        _, R_phi, R_theta = residuals(angles, vehicle)
        assert np.abs([R_phi, R_theta]).max() < 1e-14
        speed = np.hypot(rates[:, 0], rates[:, 1])
        np.testing.assert_allclose(speed, speed[0], rtol=1e-9)
        expected = np.pi / 2 if color == "red" else 0.0
        np.testing.assert_allclose(singularity_margin(angles, vehicle), expected, atol=1e-9)


def test_paths_of_chapter_8_start_where_it_says() -> None:
    start = {name: path.legs[0].vertices[0] for name, path in PATHS.items()}
    assert region(*start["E1"], AR_DRONE) == "S_U"
    assert region(*start["E3"], AR_DRONE) == "S_D"
    assert region(*start["E4"], AR_DRONE) == "S_D"


def test_printed_vertices_lie_on_the_published_lines() -> None:
    """To the three printed decimals, with the thesis's rounded offset and with the exact one."""
    for key in ("ch06_gait_1", "ch06_gait_2"):
        gait = PUBLISHED_GAITS[key].gait
        angles = gait.angles(np.arange(4) / 4)
        for offset in (0.334198, 2 * delta(AR_DRONE)):
            np.testing.assert_allclose(angles[:, 2], offset - angles[:, 0], atol=6e-4)
            np.testing.assert_allclose(angles[:, 3], -offset - angles[:, 1], atol=6e-4)


@pytest.mark.parametrize("key", ["ch08_gait_2", "ch08_gait_3"])
def test_the_circles_of_chapter_8_start_beside_their_center(key) -> None:
    phases = np.arange(4) / 4.0
    found = PUBLISHED_GAITS[key].gait.angles(phases)[:, :2]
    expected = [(0.8, -0.5), (0.5, -0.2), (0.2, -0.5), (0.5, -0.8)]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "factor"), [("equal", 1), ("half", 2), ("negative", -1), ("negative_half", -2)]
)
def test_the_restrictions_of_chapter_3_are_even_grids_around_no_tilt(name, factor) -> None:
    first, third = np.transpose(DETERMINANT_CASES[name].pairs)
    np.testing.assert_allclose(third, factor * first, rtol=0, atol=1e-15)
    np.testing.assert_allclose(first, np.linspace(-first[-1], first[-1], 5), rtol=0, atol=1e-15)


def test_where_the_robustness_claims_hold() -> None:
    """Red: a margin of pi/2 and far above the biased twin's. Blue: none at all."""
    table = {row.key: row for row in robustness_table()}
    assert len(table) == 20
    for row in table.values():
        if row.color == "red":
            assert row.margin_exact == pytest.approx(np.pi / 2, abs=2e-3)
            assert row.claim_holds in (True, None)
        elif row.color is not None:
            assert row.margin_exact == pytest.approx(0.0, abs=1e-12)
            assert row.conditioning < 1e-12
            assert row.claim_holds in (False, None)
    assert table["ch06_gait_4"].margin_biased == pytest.approx(1.08, abs=0.01)
    assert [row.key for row in table.values() if row.claim_holds is False] == [
        "ch06_gait_1",
        "ch06_gait_2",
        "ch07_gait_1",
        "ch08_gait_1",
        "ch08_gait_3",
    ]


def test_blue_gaits_as_printed_have_rank_by_rounding_only() -> None:
    for key in ("ch09_gait_5", "ch09_gait_6", "ch09_gait_7", "ch09_gait_8"):
        published = PUBLISHED_GAITS[key]
        assert rank(published.gait.angles(0.0), AR_DRONE) == 3
        assert published.exact is not None
        assert rank(published.exact.angles(0.0), AR_DRONE) == 2
