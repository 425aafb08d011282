"""The supervisor against the singularity analysis for arrays, and in flight."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tests.controllers.multirotors import ring
from tiltsim_controllers.analysis.singularity import (
    determinant,
    margin_over_gait,
    torque_free_direction,
    world_up,
)
from tiltsim_controllers.gaits.motion import NO_KNOTS
from tiltsim_controllers.gaits.plans import continuous_trot as trot
from tiltsim_controllers.gaits.plans import fixed, waypoints
from tiltsim_controllers.gaits.plans import instant_trot as trot_instant
from tiltsim_controllers.laws.feedback import exact_decoupler
from tiltsim_controllers.laws.supervised_vehicles import (
    SUPERVISION,
    multirotor_supervision_of,
    watched,
)
from tiltsim_controllers.laws.supervisor import BAND, LAG, STRATEGIES, Supervisor, turned_along
from tiltsim_controllers.vehicle.cross import cross_table
from tiltsim_controllers.vehicle.parameters import PRESETS, drag_ratio
from tiltsim_controllers.vehicle.rotors import tilt_of_rotor

assess = SUPERVISION.assess
supervised_gait_scale = SUPERVISION.gait_scale
supervised_tilts = SUPERVISION.tilts
supervised_derivative = SUPERVISION.derivative
VEHICLE = PRESETS["ar_drone_2"]
RATIO = drag_ratio(VEHICLE)
WATCH = Supervisor(min_margin=0.3, min_determinant=1.0)


def clearance_of(code, tilts, up, limits, vehicle, knots=NO_KNOTS):
    """Distance above the thresholds by the largest possible."""
    return code.look(limits, vehicle, knots)(np.array(tilts), np.array(up))[0]


angles = st.tuples(*[st.floats(-1.5, 1.5)] * 4)
leans = st.floats(-0.5, 0.5)


def regular(scales, tilts, roll, pitch):
    """Whether scaled tilts meet the thresholds, by the array code."""
    scaled = np.multiply.outer(scales, tilts)
    determinants = determinant(scaled, roll, pitch, VEHICLE)
    margins = np.abs([margin_over_gait(row[None], VEHICLE, roll, pitch)[0] for row in scaled])
    return (np.sign(determinants) * margins >= WATCH.min_margin) & (
        determinants >= WATCH.min_determinant
    )


@example((0.0, 0.0, -1.0, -1.5), 0.0, -0.5)
@given(angles, leans, leans)
def test_tilts_that_pass_are_regular_and_slightly_larger_ones_are_not(tilts, roll, pitch):
    scale = supervised_gait_scale(tilts, roll, pitch, WATCH, RATIO)
    sixteenths = regular(np.arange(17) / 16, tilts, roll, pitch)
    if not sixteenths.any():
        return  # the vehicle leans too far for any share of this gait
    assert regular([max(0.0, scale - 1e-9)], tilts, roll, pitch).all()
    assert scale >= np.flatnonzero(sixteenths).max() / 16
    if scale < 1.0:
        assert not regular([min(1.0, scale + 1e-6)], tilts, roll, pitch).any()


def random_cases(random):
    """Supervisions, vehicles, tilts and leans: tiltrotors of any drag, and rings of six arms."""
    for _ in range(120):
        ratio, tilts = random.uniform(0.05, 0.4), random.uniform(-1.5, 1.5, 4)
        yield SUPERVISION, (ratio,), tuple(tilts), random.uniform(-0.9, 0.9, 2)
    table = ring(6, hinged=True)
    watch_all = multirotor_supervision_of(tilt_of_rotor(table), 1)
    vehicle = watched(table, 0, (0.0, 0.0, 1.0))
    for _ in range(40):
        tilts = random.uniform(-1.5, 1.5, 6)
        yield watch_all, (vehicle, table), tuple(tilts), random.uniform(-0.9, 0.9, 2)


@pytest.mark.slow
def test_the_scale_is_the_largest_that_is_allowed():
    """The largest scale of a dense grid, except for a range of scales between two sixteenths."""
    dense, unseen, nearest, partial, beyond = 128, 0, 0, 0, 0
    for number, (code, seen, tilts, lean) in enumerate(random_cases(np.random.default_rng(5))):
        limits = WATCH._replace(min_margin=0.3 if number % 2 else 1.1)
        scale, up = code.gait_scale(tilts, *lean, limits, *seen), tuple(world_up(*lean))
        scales = np.arange(dense + 1) / dense
        left = [clearance_of(code, tuple(k * np.array(tilts)), up, limits, *seen) for k in scales]
        allowed, sixteenths = np.array(left) >= 0.0, np.array(left)[:: dense // 16]
        if not (sixteenths >= 0.0).any():
            assert scale == 1.0 - np.argmax(sixteenths[::-1]) / 16  # the nearest
            unseen += bool(allowed.any())
            nearest += scale > 0.0
            continue
        coarse, largest = np.flatnonzero(sixteenths >= 0.0).max() / 16, scales[allowed].max()
        assert coarse <= scale < coarse + 1 / 16
        assert clearance_of(code, tuple(scale * np.array(tilts)), up, limits, *seen) >= 0.0
        unseen += largest >= scale + 1 / dense
        assert scale < largest + 1 / dense
        partial += 0.0 < scale < 1.0
        beyond += not allowed[scales < scale].all()
    assert unseen < 5
    assert nearest > 10
    assert partial > 30
    assert beyond > 3  # smaller scales are not all allowed


def test_without_thresholds_everything_passes():
    wild = (3.0, -2.0, 1.0, 2.5)
    assert supervised_gait_scale(wild, 2.0, 1.0, Supervisor(), RATIO) == 1.0


def test_a_vehicle_that_leans_too_far_gets_no_tilt():
    assert supervised_gait_scale((0.2, 0.1, 0.2, 0.1), 1.4, 0.0, WATCH, RATIO) == 0.0


def test_a_gait_across_the_curve_l_stops_before_it():
    """On red the margin is a right angle up to L: the determinant alone sees it come."""
    across = (0.4, -0.2, 0.4, -0.2)
    margin_alone = Supervisor(min_margin=0.3)
    assert determinant(np.array(across), 0.0, 0.0, VEHICLE) < 0.0
    stopped = supervised_gait_scale(across, 0.0, 0.0, margin_alone, RATIO)
    at_l = np.array(across) * stopped
    assert abs(determinant(at_l, 0.0, 0.0, VEHICLE)) < 1e-4
    kept = supervised_gait_scale(across, 0.0, 0.0, WATCH, RATIO)
    assert determinant(np.array(across) * kept, 0.0, 0.0, VEHICLE) == pytest.approx(1.0, abs=1e-4)


# --- hold and return to red ----------------------------------------------------------------------

JUMPS = trot_instant(0.8, 2.0)  # at 1 s the torque-free force turns by more than pi/2
WITH_STATES = ("hold", "return_to_red")
PLAN = ((0.3, 0.2, 0.1), (-0.4, 0.5, -0.3), (0.6, -0.1, 0.2), (0.2, 0.3, 0.4))


def watch(strategy, **changes):
    settings = Supervisor(0.3, 0.5, STRATEGIES[strategy], 0.5, 2.0, 0.1)
    return settings._replace(**changes)


def demand(time, roll, pitch, state, rate, supervisor, gait=JUMPS):
    planned = gait.parameters, gait.knots
    return supervised_derivative(time, roll, pitch, state, rate, *planned, supervisor, RATIO)[2]


@given(angles, leans, leans)
def test_room_is_what_is_left_above_the_thresholds(tilts, roll, pitch):
    supervisor = watch("hold")
    margin = margin_over_gait(np.array([tilts]), VEHICLE, roll, pitch)[0]
    value = determinant(np.array(tilts), roll, pitch, VEHICLE)
    left = clearance_of(SUPERVISION, tilts, tuple(world_up(roll, pitch)), supervisor, RATIO)
    assert (left >= 0.0) == (value >= 0.5 and np.sign(value) * abs(margin) >= 0.3)
    assert clearance_of(
        SUPERVISION, (0.0,) * 4, (0.0, 0.0, 1.0), supervisor, RATIO
    ) == pytest.approx(1.0)


@pytest.mark.parametrize("strategy", WITH_STATES)
def test_supervised_tilts_move_as_their_rates_say(strategy):
    """Against differences along a motion of plan and supervisor that is given in closed form."""
    supervisor = watch(strategy)

    def planned(time):
        return tuple((a + v * time + b * time**2 / 2, v + b * time, b) for a, v, b in PLAN)

    def tilts(time):
        supervisor_motion = (0.2 + 0.3 * time + 0.25 * time**2, 0.3 + 0.5 * time, 0.5)
        clock = time - supervisor_motion[0] if strategy == "hold" else time
        return np.array(supervised_tilts(planned(clock), 1.0, supervisor_motion, supervisor, RATIO))

    step = 1e-4
    before, now, after = tilts(-step), tilts(0.0), tilts(step)
    np.testing.assert_allclose(now[:, 1], (after - before)[:, 0] / (2 * step), atol=1e-7)
    np.testing.assert_allclose(now[:, 2], (after - before)[:, 1] / (2 * step), atol=1e-7)


@pytest.mark.parametrize("strategy", WITH_STATES)
def test_a_supervisor_with_room_to_spare_rests(strategy):
    assert demand(0.1, 0.0, 0.0, 0.0, 0.0, watch(strategy)) == 0.0


@pytest.mark.parametrize("strategy", WITH_STATES)
def test_the_supervisor_acts_as_soon_as_the_jump_comes_into_sight(strategy):
    """In hover before the jump of the trot at 1 s, with the attitude that its tilts need."""
    n = torque_free_direction(JUMPS.angles(0.65), VEHICLE)
    roll, pitch = exact_decoupler(0.0, 0.0, 0.0, 0.0, 9.8, tuple(n))
    supervisor = watch(strategy, horizon=0.4, min_margin=0.5)
    assert demand(0.55, roll, pitch, 0.0, 0.0, supervisor) == 0.0
    assert demand(0.65, roll, pitch, 0.0, 0.0, supervisor) > 1.0
    for rate in (0.0, 0.5):
        desired = demand(0.65, roll, pitch, 0.0, rate, supervisor) * LAG + rate
        if strategy == "hold":
            assert desired == pytest.approx(1.0)  # the clock is to stand
        else:
            assert desired == pytest.approx(2.0 / 0.8)  # the farthest tilt moves at max_tilt_rate


def test_the_clock_slows_down_within_the_band():
    """A gait toward L, at the instant whose last glance has half the band left."""
    gait = waypoints([(-0.3, 0.3, -0.3, 0.3), (0.4, -0.2, 0.4, -0.2)], 4.0)
    supervisor = watch("hold", min_determinant=2.0)
    state = asked_rates = None
    for time in np.arange(0.0, 2.0, 4e-3):
        acceleration = supervised_derivative(
            time, 0.0, 0.0, 0.0, 0.0, gait.parameters, gait.knots, supervisor, RATIO
        )[2]
        ahead = tuple(gait.angles(time + 0.5))
        left = clearance_of(SUPERVISION, ahead, (0.0, 0.0, 1.0), supervisor, RATIO)
        state, asked_rates = left, acceleration * LAG
        assert asked_rates == pytest.approx(min(1.0, max(0.0, 1.0 - left / BAND)), abs=1e-9)
        if left < 0.0:
            break
    assert state < 0.0
    assert asked_rates == pytest.approx(1.0)


def lean_of(time, gait):
    """Roll and pitch of the vehicle in hover at a time of a gait."""
    n = torque_free_direction(gait.angles(time), VEHICLE)
    return exact_decoupler(0.0, 0.0, 0.0, 0.0, 9.8, tuple(n))


@pytest.mark.parametrize("horizon", [0.5, 4.0])
def test_a_gait_with_which_the_vehicle_leans_is_flown(horizon):
    """At the present lean its tilts a quarter of a period ahead would violate the threshold."""
    gait, supervisor = trot(0.9, 1.6), watch("hold", min_margin=1.0, horizon=horizon)
    blocked = 0
    for time in np.arange(0.0, 1.6, 0.05):
        roll, pitch = lean_of(time, gait)
        later, up = tuple(gait.angles(time + 0.4)), tuple(world_up(roll, pitch))
        blocked += clearance_of(SUPERVISION, later, up, supervisor, RATIO) < 0.0
        assert demand(time, roll, pitch, 0.0, 0.0, supervisor, gait) == 0.0
    assert blocked > 10


def test_a_direction_is_turned_from_one_line_to_another():
    random = np.random.default_rng(1)
    for _ in range(20):
        start, end, up = random.normal(size=(3, 3))
        turned = turned_along(tuple(up), tuple(start), tuple(end))
        sense = np.sign(start @ end)
        rotation, _ = Rotation.align_vectors([sense * end], [start])
        np.testing.assert_allclose(turned, rotation.apply(up), atol=1e-9)
        np.testing.assert_allclose(turned_along(tuple(up), tuple(start), tuple(-end)), turned)
        assert turned_along(tuple(up), (0.0, 0.0, 0.0), tuple(end)) == tuple(up)


@pytest.mark.parametrize("strategy", WITH_STATES)
def test_only_the_scaling_strategy_scales(strategy):
    planned = (1.2, -0.9, 0.7, 1.1)
    scaling = Supervisor(0.3, 1.0, STRATEGIES["scale"])
    passed = supervised_gait_scale(planned, 0.2, -0.1, scaling, RATIO)
    assert 0.0 < passed < 1.0
    other = scaling._replace(strategy=STRATEGIES[strategy])
    assert supervised_gait_scale(planned, 0.2, -0.1, other, RATIO) == 1.0


@pytest.mark.parametrize("threshold", ["min_margin", "min_determinant"])
def test_one_threshold_is_enough_to_scale(threshold):
    planned = (1.2, -0.9, 0.7, 1.1)
    single = Supervisor(**{threshold: 1.0})
    assert supervised_gait_scale(planned, 0.2, -0.1, single, RATIO) < 1.0


@pytest.mark.parametrize("left", [1e-4, 1e-3])
def test_near_either_end_of_the_way_to_red_the_motion_is_critically_damped(left):
    """``s'' + s' / T + s / 4 T^2``, whose roots are equal: it comes to the end and not beyond."""
    eager = watch("return_to_red", max_rate=1e6)
    rates = np.linspace(-0.01, 0.01, 5)
    never = eager._replace(min_determinant=3.99)  # leaning, not even red meets it
    there = [demand(0.9, 0.4, 0.0, 1.0 - left, rate, never) for rate in rates]
    np.testing.assert_allclose(there, left / (2 * LAG) ** 2 - rates / LAG, rtol=0, atol=1e-9)
    calm = trot_instant(0.05, 2.0)
    back = [demand(0.3, 0.0, 0.0, left, rate, eager, calm) for rate in rates]
    np.testing.assert_allclose(back, -left / (2 * LAG) ** 2 - rates / LAG, rtol=0, atol=1e-9)


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_on_the_way_to_red_the_tilts_lie_on_the_line_to_it(share):
    """Opposite tilts of a red gait are equal: each pair's mean, apart from the drag."""
    supervisor = watch("return_to_red", clearance=0.0)
    start = np.array([-0.3, 0.4, -0.6, 0.1])  # of which the nearest red gait is regular
    still = tuple((angle, 0.0, 0.0) for angle in start)
    moved = supervised_tilts(still, 1.0, (share, 0.0, 0.0), supervisor, RATIO)
    red = supervised_tilts(still, 1.0, (1.0, 0.0, 0.0), supervisor, RATIO)
    ends = np.array([jet[0] for jet in red])
    np.testing.assert_allclose(ends, np.tile(0.5 * (start[:2] + start[2:]), 2), atol=1e-12)
    found = np.array([jet[0] for jet in moved])
    np.testing.assert_allclose(found, start + share * (ends - start), rtol=0, atol=1e-15)


@pytest.mark.parametrize("rotor", [0, 1, 2, 3])
def test_on_the_way_to_red_the_tilt_with_the_longest_way_has_the_maximum_rate(rotor):
    """The other rotor of its pair has as long a way: each moves half of their difference."""
    angles = [-0.05, 0.05, -0.04, 0.06]
    angles[rotor] = (-0.9, 0.9)[rotor % 2]
    gait = fixed(angles)
    supervisor = watch("return_to_red", min_determinant=3.99, max_rate=0.2, clearance=0.0)
    half = 0.5 * abs(angles[rotor] - angles[(rotor + 2) % 4])
    # Far from both ends and from rest the state is driven to that rate, with the lag.
    rate = demand(0.0, 0.4, 0.0, 0.5, 0.0, supervisor, gait) * LAG
    assert abs(rate) == pytest.approx(0.2 / half)


def test_the_way_to_red_undershoots_a_threshold_by_less_than_the_band():
    """From red (at 0 s) toward blue (at 2 s) and back, level, as in beyond/supervisor_blue."""
    angles = ((-0.3, 0.3, -0.3, 0.3), (-0.3, 0.3, 0.634, -0.634))
    plan = waypoints(angles, 4.0)
    supervisor = watch("return_to_red", min_determinant=1.5, max_rate=1.0)
    state = rate = 0.0
    step, smallest = 0.005, 4.0
    for time in np.arange(0.8, 2.6, step).tolist():
        planned = plan.jets(time)
        tilts = np.array(supervised_tilts(planned, 1.0, (state, 0.0, 0.0), supervisor, RATIO))[:, 0]
        smallest = min(smallest, determinant(tilts, 0.0, 0.0, VEHICLE))
        _, rate_now, change = supervised_derivative(
            time, 0.0, 0.0, state, rate, plan.parameters, plan.knots, supervisor, RATIO
        )
        state, rate = state + step * rate_now, rate + step * change
    assert 1.5 - BAND * (4.0 - 1.5) < smallest < 1.5
    assert smallest == pytest.approx(1.464, abs=0.01)  # docs/supervisor.md


def test_tilts_exactly_at_the_threshold_are_allowed():
    tilts, lean = (0.4, -0.2, 0.1, 0.3), (0.2, -0.3)
    margin, determinant_there, _ = assess(tilts, tuple(world_up(*lean)), RATIO)
    for threshold in ({"min_margin": margin}, {"min_determinant": determinant_there}):
        assert supervised_gait_scale(tilts, *lean, Supervisor(**threshold), RATIO) == 1.0
        above = {name: value * (1.0 + 1e-15) for name, value in threshold.items()}
        assert supervised_gait_scale(tilts, *lean, Supervisor(**above), RATIO) < 1.0


# --- any multirotor ------------------------------------------------------------------------------


@settings(deadline=None, max_examples=30)
@given(angles, leans, leans)
def test_four_rotors_of_a_table_have_the_tiltrotor_s_margin_and_determinant(tilts, roll, pitch):
    table, up = cross_table(VEHICLE, tilting=True), tuple(world_up(roll, pitch))
    known = assess(tilts, up, RATIO)[:2]
    n = np.array(torque_free_direction(tilts, VEHICLE))
    side = tuple(np.sign(known[1]) * np.sign(n @ up) * n)  # the sign of the determinant
    general = multirotor_supervision_of(tilt_of_rotor(table), 1).assess
    found = general(tilts, up, watched(table, 0, side), table)[:2]
    np.testing.assert_allclose(found, known, rtol=0.0, atol=1e-7)


@pytest.mark.parametrize(("dimension", "forward"), [(1, False), (2, True), (3, False)])
def test_the_margin_is_zero_where_the_outputs_depend_on_each_other(dimension, forward):
    """Six arms without tilt push upwards only; sideways, none of them lifts."""
    table = ring(6, hinged=True)
    watch_all = multirotor_supervision_of(tilt_of_rotor(table), dimension, forward)
    vehicle, up = watched(table, 0, (0.0, 0.0, 1.0)), (0.0, 0.0, 1.0)

    def determinant_at(*tilts):
        return watch_all.assess(tilts, up, vehicle, table)[1]

    level = determinant_at(*[0.0] * 6)
    assert level == pytest.approx(4.0) if dimension == 1 else abs(level) < 1e-6
    assert determinant_at(0.4, -0.3, 0.4, -0.5, 0.2, -0.4) > 0.5
