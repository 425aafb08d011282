"""Gaits: exact rates, the published transformations, and the same bits in native code."""

from __future__ import annotations

from math import inf, pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.natively import natively
from tiltsim_controllers.analysis.published_gaits import smallest_margin
from tiltsim_controllers.analysis.singularity import residuals
from tiltsim_controllers.analysis.two_color_planner import Circle, four_angle_gait
from tiltsim_controllers.gaits import plans
from tiltsim_controllers.gaits.cat import FOOTFALLS, FORWARD, SWINGS, Footfall, cat_keyframes
from tiltsim_controllers.gaits.colors import colored_angles
from tiltsim_controllers.gaits.motion import LINEAR, anticipated_tilts, planned_tilts
from tiltsim_controllers.gaits.plans import Gait
from tiltsim_controllers.vehicle.parameters import PRESETS, drag_ratio

AR_DRONE = PRESETS["ar_drone_2"]
RATIO = drag_ratio(AR_DRONE)

GAITS: dict[str, Gait] = {
    "fixed": plans.fixed([-0.65, -0.65, 0.65, 0.65]),
    "trot_instant": plans.instant_trot(0.65, 2.0),
    "trot_continuous": plans.continuous_trot(0.65, 3.0),
    **{name: plans.cat(name, 0.65, 1.0, lean=0.1) for name in FOOTFALLS},
    "waypoints": plans.waypoints(
        [[0.1, 0.2, 0.3, 0.4], [0.5, -0.2, 0.1, 0.0], [-0.3, 0.0, 0.2, -0.6]], 1.7
    ),
    "jump": plans.keyframes(
        [(0, 0, 0, 0, 0), (0.4, 1, 0, 0, 0), (0.4, -1, 0.5, 0, 0), (1, 0, 0, 0, 0)], 2.0
    ),
    "table": plans.table(
        [0.0, 0.3, 0.7, 1.2, 1.5],
        [
            [0.1, 0, -0.1, 0],
            [0.3, -0.2, 0, 0.1],
            [0, 0.2, 0.4, 0.2],
            [-0.3, 0, 0, 0],
            [0.1, 0, -0.1, 0],
        ],
        repeats=True,
    ),
    "red_circle": four_angle_gait(Circle("red", (0.5, -0.5), 0.3), 1.5, AR_DRONE),
    "blue_circle": four_angle_gait(Circle("blue", (0.1, -0.2), 0.4), 1.5, AR_DRONE),
}
GAITS |= {
    "penguin_small": plans.penguin("penguin_small", pi / 4, 2.0),
    "penguin_large": plans.penguin("penguin_large", 2 * pi / 3, 2.0),
}
GAITS |= {
    "walk_third": GAITS["walk"].scaled(3),
    "table_biased": GAITS["table"].scaled(2).biased(0.8),
    "circle_biased": GAITS["red_circle"].biased(0.8),
    "trot_biased": GAITS["trot_continuous"].scaled(2).biased(0.99),
}


@pytest.mark.parametrize("gait", GAITS.values(), ids=GAITS)
def test_gaits_are_periodic_and_rates_are_their_derivatives(gait: Gait) -> None:
    period = gait.period or 1.0
    time = np.linspace(-1.0, 2.0, 337) * period + 1e-4
    step = 1e-7 * period
    difference = (gait.angles(time + step) - gait.angles(time - step)) / (2 * step)
    # Corners and jumps between the two samples have no derivative.
    kink = np.abs(gait.rates(time + step) - gait.rates(time - step)).max(axis=-1) > 1e-4
    kink |= np.abs(difference).max(axis=-1) > 1e3
    assert kink.mean() < 0.05
    np.testing.assert_allclose(gait.rates(time)[~kink], difference[~kink], atol=1e-5)
    off_corners = ~kink
    np.testing.assert_allclose(
        gait.angles(time)[off_corners], gait.angles(time + period)[off_corners], atol=1e-9
    )


@pytest.mark.parametrize("gait", GAITS.values(), ids=GAITS)
def test_accelerations_are_derivatives_and_smooth_gaits_need_no_rounded_corners(gait: Gait) -> None:
    period = gait.period or 1.0
    smooth = gait.is_continuous
    for time in np.linspace(0.0, 2.0, 211) * period + 1e-4:
        step = 1e-6 * period
        difference = (gait.rates(time + step) - gait.rates(time - step)) / (2.0 * step)
        corner = np.abs(difference).max() > 1e4
        smooth &= not corner
        if not corner:
            found = np.transpose(gait.jets(time))[2]
            np.testing.assert_allclose(found, difference, atol=1e-3)
    smooth &= gait.parameters.type != LINEAR  # corners between samples
    if smooth:
        found = anticipated_tilts(0.3, gait.parameters, gait.knots, gait.tilts, 0.1)
        assert found == gait.jets(0.3)


@pytest.mark.parametrize("gait", GAITS.values(), ids=GAITS)
def test_gaits_know_their_amplitude_rate_and_continuity(gait: Gait) -> None:
    period = gait.period or 1.0
    time = np.linspace(0.0, period, 2_001)
    angles, rates = gait.angles(time), gait.rates(time)
    assert gait.amplitude == pytest.approx(np.abs(angles).max(), rel=1e-3)
    assert gait.is_constant == (not np.ptp(angles, axis=0).any())
    largest_step = np.abs(np.diff(angles, axis=0)).max()
    if gait.is_continuous:
        assert gait.max_rate == pytest.approx(np.abs(rates).max(), rel=1e-6)
        assert largest_step <= gait.max_rate * (time[1] - time[0]) * (1 + 1e-9)
    else:
        assert gait.max_rate == np.inf
        assert largest_step > 0.1
    jumping = {"trot_instant", "jump", "penguin_small", "penguin_large"}
    assert jumping == {name for name in GAITS if not GAITS[name].is_continuous}


def test_a_jump_belongs_to_the_time_after_it() -> None:
    jump = GAITS["jump"]
    before, at = jump.angles([0.8 - 1e-9, 0.8])
    np.testing.assert_allclose(before, [1, 0, 0, 0], atol=1e-6)
    np.testing.assert_array_equal(at, [-1, 0.5, 0, 0])


def test_sample_times_hit_every_keyframe() -> None:
    rotary = GAITS["rotary_gallop"]
    times = rotary.sample_times(11)
    for start in rotary.knots[::9]:
        assert start in times
    assert times[0] == 0.0
    assert times[-1] == rotary.period
    assert GAITS["fixed"].sample_times().tolist() == [0.0]
    assert GAITS["trot_instant"].sample_times(11)[-1] < 2.0


@given(time=st.floats(-20, 20), amplitude=st.floats(0, 1.5), period=st.floats(0.1, 10))
def test_the_trot_is_a_cat_gait_of_duty_factor_one_half(time, amplitude, period) -> None:
    footfall = Footfall((0.0, 0.5, 0.0, 0.5), duty_factor=0.5)  # the diagonals in turn
    trot = plans.keyframes(cat_keyframes(footfall, amplitude), period)
    expected = plans.continuous_trot(amplitude, period).angles(time)
    np.testing.assert_allclose(trot.angles(time), expected, atol=1e-9)


@pytest.mark.parametrize("name", FOOTFALLS)
def test_cat_gaits_keep_their_footfalls(name) -> None:
    footfall = FOOTFALLS[name]
    gait = plans.cat(name, 0.4, 2.0, lean=0.3)
    touchdown = np.array(footfall.touchdown) * 2.0
    np.testing.assert_allclose(FORWARD * np.diag(gait.angles(touchdown)), 0.7, atol=1e-12)
    lift_off = touchdown + footfall.duty_factor * 2.0
    np.testing.assert_allclose(FORWARD * np.diag(gait.angles(lift_off)), -0.1, atol=1e-12)
    time = np.linspace(0.0, 2.0, 4000, endpoint=False) + 1e-6
    backward = FORWARD * gait.rates(time) < 0
    np.testing.assert_allclose(backward.mean(axis=0), footfall.duty_factor, atol=2e-3)


def test_legs_that_lean_forward_push_forward() -> None:
    """Toward +X and +Y alike, as the references of ch. 4 and 5 go, and without any torque."""
    angles = 0.2 * np.array(FORWARD)
    R, R_phi, R_theta = residuals(angles, AR_DRONE)
    assert -R_theta / R == pytest.approx(0.5 * np.tan(0.2))
    assert R_phi / R == pytest.approx(0.5 * np.tan(0.2))


def test_the_determinant_falls_as_the_hind_legs_lean_over_the_fore_legs() -> None:
    r = drag_ratio(AR_DRONE)
    for pod, side in enumerate((1.0, 1.0, -1.0, -1.0)):  # right and left fore, left and right hind
        angles = np.zeros(4)
        angles[pod] = 1e-6 * FORWARD[pod]
        slope = (residuals(angles, AR_DRONE)[0] - 4.0) / 1e-6
        assert slope == pytest.approx(side * (1.0 / r - 2.0 * r), rel=1e-4)


@pytest.mark.parametrize("name", SWINGS)
def test_scaling_reconstructed_gaits_leads_away_from_singular_matrices(name) -> None:
    """Ch. 5, Sec. 4: all but the run are singular unscaled, and gain from 1/2 and from 1/3."""
    gait = plans.cat(name, SWINGS[name].amplitude, 1.0, SWINGS[name].lean)
    whole, half, third = (smallest_margin(gait.scaled(n), AR_DRONE) for n in (1, 2, 3))
    assert (whole > 0.0) == (name == "run")
    assert max(0.0, whole) < half < third


def test_footfall_orders_agree_with_the_sources() -> None:
    """Pods 1 to 4, around the body, are right fore, left fore, left hind, right hind."""
    feet = ("RF", "LF", "LH", "RH")

    def order(name: str) -> list[str]:
        touchdown = FOOTFALLS[name].touchdown
        return [feet[pod] for pod in np.argsort(touchdown)]

    assert order("walk") == order("run") == ["LH", "LF", "RH", "RF"]
    assert order("transverse_gallop") == ["LH", "RH", "LF", "RF"]
    assert order("rotary_gallop") == ["LH", "RH", "RF", "LF"]
    assert FOOTFALLS["walk"].duty_factor > 0.5 > FOOTFALLS["run"].duty_factor


def test_scale_and_bias_are_the_published_transformations() -> None:
    walk = GAITS["walk"]
    time = np.linspace(0, 1, 50)
    np.testing.assert_allclose(walk.scaled(3).angles(time), walk.angles(time) / 3, atol=1e-15)
    biased = walk.biased(0.8).angles(time)
    np.testing.assert_allclose(biased, walk.angles(time) * [1, 1, 0.8, 0.8], atol=1e-15)
    np.testing.assert_allclose(
        walk.biased(0.8).rates(time), walk.rates(time) * [1, 1, 0.8, 0.8], atol=1e-14
    )
    assert walk.scaled(3).amplitude == pytest.approx(walk.amplitude / 3)
    assert walk.scaled(3).max_rate == pytest.approx(walk.max_rate / 3)


@given(first=st.floats(-1, 1), second=st.floats(-1, 1))
def test_colors_meet_at_one_point_only(first, second) -> None:
    delta = np.arctan(RATIO)
    assert colored_angles(first, second, "red", RATIO) == (first, second)
    third, fourth = colored_angles(first, second, "blue", RATIO)
    assert third == pytest.approx(2 * delta - first, abs=1e-15)
    assert fourth == pytest.approx(-2 * delta - second, abs=1e-15)
    np.testing.assert_allclose(colored_angles(delta, -delta, "blue", RATIO), (delta, -delta))


@pytest.mark.parametrize(
    ("rows", "reason"),
    [
        ([], "start at 0"),
        ([(0, 0, 0, 0, 0)], "start at 0"),
        ([(0, 0, 0, 0, 0), (0.5, 0, 0, 0, 0)], "end at 1"),
        ([(0, 0, 0, 0), (1, 0, 0, 0)], "four finite"),
        ([(0, 0, 0, 0, float("nan")), (1, 0, 0, 0, 0)], "four finite"),
        ([(0, *[0] * 4), (0.6, *[0] * 4), (0.5, *[0] * 4), (1, *[0] * 4)], "decrease"),
        ([(0, *[0] * 4), (0, *[0] * 4), (1, *[0] * 4)], "one row may be"),
        ([(0, *[0] * 4), *[(0.5, *[0] * 4)] * 3, (1, *[0] * 4)], "share a phase"),
    ],
)
def test_bad_keyframes_are_refused(rows, reason) -> None:
    with pytest.raises(ValueError, match=reason):
        plans.keyframes(rows, 1.0)


@pytest.mark.parametrize("period", [0.0, -1.0, float("inf"), float("nan")])
def test_bad_periods_are_refused(period) -> None:
    with pytest.raises(ValueError, match="period"):
        plans.continuous_trot(0.5, period)


def test_bad_names_list_the_choices() -> None:
    with pytest.raises(ValueError, match="walk, run, transverse_gallop, rotary_gallop"):
        plans.cat("wallk", 0.5, 1.0)
    with pytest.raises(ValueError, match="red, blue"):
        four_angle_gait(Circle("green", (0.1, 0.2), 0.1), 1.0, AR_DRONE)
    with pytest.raises(ValueError, match="2 waypoints but 1 phases"):
        plans.waypoints([[0] * 4, [1] * 4], 1.0, [0.0])


@pytest.mark.parametrize("name", sorted(GAITS))
def test_machine_code_gives_the_same_numbers(name) -> None:
    gait = GAITS[name]
    knots = (*gait.knots, *[np.nan] * 7)  # longer than the rows in use

    for time in np.random.default_rng(4).uniform(-100.0, 100.0, 3).tolist():
        found = natively(planned_tilts, time, gait.parameters, knots, gait.tilts)
        np.testing.assert_allclose(found, np.ravel(gait.jets(time)), rtol=1e-15, atol=1e-15)


def test_a_table_that_does_not_repeat_holds_its_last_row() -> None:
    times, angles = [0.0, 0.2, 0.5], [[0.0, 0.1, 0.2, 0.3], [0.4, 0.1, 0.2, 0.3], [0.6, 0, 0, 0]]
    gait = plans.table(times, angles, repeats=False)
    np.testing.assert_allclose(gait.angles(times), angles, atol=1e-15)
    for time in (0.5, 7.0):
        np.testing.assert_array_equal(gait.jets(time), [[0.6, 0.0, 0.0], *[[0.0] * 3] * 3])
    line = plans.table([0.0, 0.5], angles[:2], repeats=False)
    np.testing.assert_allclose(line.rates(0.3), [0.8, 0, 0, 0], atol=1e-12)


def test_a_table_of_a_sine_is_as_exact_as_a_cubic_spline() -> None:
    """Within 5/384 h^4 of the angle and h^3/24 of the rate, times the fourth derivative."""
    step, turning = 0.01, 2.0 * pi
    times = np.arange(101) * step
    sine = 0.3 * np.sin(turning * times)
    sine[-1] = sine[0]
    gait = plans.table(times.tolist(), np.transpose([sine] * 4), repeats=True)
    at = np.linspace(0.0, 3.0, 997)
    fourth = 0.3 * turning**4
    assert (
        np.abs(gait.angles(at)[:, 0] - 0.3 * np.sin(turning * at)).max()
        < fourth * step**4 * 5 / 384
    )
    rate = 0.3 * turning * np.cos(turning * at)
    assert np.abs(gait.rates(at)[:, 0] - rate).max() < fourth * step**3 / 24 * 1.01


def test_a_penguin_swings_to_minus_first() -> None:
    gait = GAITS["penguin_large"]
    angles = gait.angles([0.0, 0.99, 1.0, 1.99, 2.0])
    np.testing.assert_array_equal(angles[:, 0], np.array([-1, -1, 1, 1, -1]) * 2 * pi / 3)
    assert angles.shape == (5, 1)
    assert not gait.is_continuous
    assert gait.amplitude == 2 * pi / 3
    assert gait.max_rate == inf


def test_a_rotating_gait_turns_for_ever() -> None:
    gait = plans.rotating(0.2, -2.0)
    np.testing.assert_allclose(gait.angles([0.0, 1.0, 100.0])[:, 0], [0.2, -1.8, -199.8])
    np.testing.assert_array_equal(gait.rates(0.7), [-2.0])
    assert gait.period == pi
    assert gait.amplitude == inf
    assert gait.max_rate == 2.0
    assert gait.is_continuous


# --- the named gaits ---------------------------------------------------------------------------

STRIDES = {  # touchdown of the right and left fore, left and right hind foot; stance; swing in rad
    "walk": ((0.75, 0.25, 0.0, 0.5), 0.95, 1.055, 1.25),
    "run": ((0.875, 0.375, 0.0, 0.5), 0.45, 0.5, 0.5),
    "transverse_gallop": ((0.6, 0.5, 0.0, 0.1), 0.3, 1.3, 0.4),
    "rotary_gallop": ((0.5, 0.6, 0.0, 0.1), 0.3, 1.3, 0.4),
}


@pytest.mark.parametrize("name", STRIDES)
def test_every_leg_swings_from_its_touchdown_to_its_lift_off(name):
    """The numbers with which the statements of ch. 5 hold, read off the tilts as flown."""
    touchdowns, stance, lean, amplitude = STRIDES[name]
    assert SWINGS[name] == (lean, amplitude)
    period = 1.6
    gait = plans.cat(name, amplitude, period, lean)
    for pod, (forward, touchdown) in enumerate(zip((-1, 1, 1, -1), touchdowns)):
        middle, lift_off = (touchdown + 0.5 * stance) % 1.0, (touchdown + stance) % 1.0
        phases = np.array([touchdown, middle, lift_off])
        expected = forward * (lean + amplitude * np.array([1.0, 0.0, -1.0]))
        found = gait.angles(phases * period)[:, pod]
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)


def test_the_shortest_line_of_every_kind_of_gait():
    assert plans.instant_trot(0.4, 2.0).min_segment_time == 0.0
    assert plans.continuous_trot(0.4, 2.0).min_segment_time == pytest.approx(1.0)
    assert plans.fixed([0.1] * 4).min_segment_time == inf
    three = plans.keyframes([(0, 0, 0, 0, 0), (0.3, 1, 0, 0, 0), (1, 0, 0, 0, 0)], 2.0)
    assert three.min_segment_time == pytest.approx(0.6)


def test_a_scale_or_bias_of_one_is_the_gait_itself():
    gait = plans.continuous_trot(0.4, 2.0)
    assert gait.scaled(1.0) == gait
    assert gait.biased(1.0) == gait


def test_a_slow_gait_has_a_small_maximum_rate():
    slow = plans.keyframes([(0, 0, 0, 0, 0), (0.5, 0.1, 0, -0.05, 0), (1, 0, 0, 0, 0)], 2.0)
    assert slow.max_rate == pytest.approx(0.1)
    assert slow.amplitude == pytest.approx(0.1)
