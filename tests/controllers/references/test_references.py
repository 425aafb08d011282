"""References against ch. 4, Eqs. (41)-(44)."""

from __future__ import annotations

import itertools
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tiltsim_controllers.mathematics.records import leaves
from tiltsim_controllers.references.trajectories import (
    POSES,
    REFERENCE_TYPES,
    ReferenceParameters,
    attitude_reference,
    minimum_snap_knots,
    position_reference,
    reference_attitude,
    reference_derivatives,
    reference_motion,
    table_knots,
    waypoint_motion,
)

CIRCLE = ReferenceParameters(
    REFERENCE_TYPES["circle"], (1.0, -2.0, 3.0), radius=5.0, angular_frequency=0.1
)
LINE = ReferenceParameters(REFERENCE_TYPES["line"], (1.0, 2.0, 3.0), velocity=(1.5, -0.5, 0.25))

times = st.floats(0.0, 300.0)
quick = settings(deadline=None, max_examples=60)


def test_setpoint_stays_where_it_is():
    reference = ReferenceParameters(REFERENCE_TYPES["setpoint"], (1.0, -2.0, 3.0), yaw=0.5)
    for time in (0.0, 12.5):
        assert tuple(position_reference(time, reference)) == (1.0, -2.0, 3.0, *[0.0] * 6)


def test_attitude_altitude_reference_holds_its_altitude():
    reference = ReferenceParameters(
        REFERENCE_TYPES["attitude_altitude"], (0.0, 0.0, 4.0), roll=0.1, pitch=0.2, yaw=0.3
    )
    assert tuple(position_reference(7.0, reference)) == (0.0, 0.0, 4.0, *[0.0] * 6)


def test_line_moves_uniformly_from_its_start():
    assert tuple(position_reference(4.0, LINE)) == (7.0, 0.0, 4.0, 1.5, -0.5, 0.25, 0.0, 0.0, 0.0)


@quick
@given(times)
def test_circle_is_eqs_43_and_44(time):
    phase = 0.1 * time
    x, y, z, vx, vy, vz, *acceleration = position_reference(time, CIRCLE)
    expected = (1 + 5 * np.cos(phase), -2 + 5 * np.sin(phase), 3.0)
    assert (x, y, z) == pytest.approx(expected, abs=1e-14)
    assert (vx, vy, vz) == pytest.approx((-0.5 * np.sin(phase), 0.5 * np.cos(phase), 0.0))
    assert acceleration == [0.0, 0.0, 0.0], "ch. 4 leaves the acceleration out"


@quick
@given(times)
def test_circle_passes_its_acceleration_on_when_requested(time):
    *_, ax, ay, az = position_reference(time, CIRCLE._replace(acceleration_feedforward=1.0))
    expected = (-0.05 * np.cos(0.1 * time), -0.05 * np.sin(0.1 * time), 0.0)
    assert (ax, ay, az) == pytest.approx(expected, abs=1e-16)


@pytest.mark.parametrize("reference", [LINE, CIRCLE], ids=["line", "circle"])
@quick
@given(time=times)
def test_each_derivative_belongs_to_the_one_before(reference, time):
    reference = reference._replace(acceleration_feedforward=1.0)
    step = 1e-3
    before, now, after = (
        np.array(position_reference(time + shift, reference)) for shift in (-step, 0.0, step)
    )
    slope = (after - before) / (2 * step)
    np.testing.assert_allclose(slope[:6], now[3:], rtol=0, atol=1e-8)


# --- beyond ch. 4: derivatives up to snap -----------------------------------------------------

LISSAJOUS = ReferenceParameters(
    REFERENCE_TYPES["lissajous"],
    (1.0, -2.0, 3.0),
    amplitude=(2.0, 1.5, 0.5),
    frequency=(0.6, 1.1, 0.4),
    phase=(0.3, -1.0, 2.0),
)
POINTS = [[0.0, 0.0, 0.0], [2.0, 1.0, 1.0], [3.0, -1.0, 0.5], [0.5, 0.5, 2.0]]
TIMES = [0.0, 2.0, 5.0, 6.5]
SNAP_TABLE = minimum_snap_knots(POINTS, TIMES)
BEFORE = (9.0, 8.0, 7.0)  # another table in front of it
WAYPOINTS = ReferenceParameters(REFERENCE_TYPES["waypoints"], segments=4.0, offset=3.0)
MOTIONS = {
    "setpoint": ReferenceParameters(REFERENCE_TYPES["setpoint"], (1.0, -2.0, 3.0), (4.0, 5.0, 6.0)),
    "line": LINE,
    "circle": CIRCLE,
    "lissajous": LISSAJOUS,
    "waypoints": WAYPOINTS,
    "table": WAYPOINTS._replace(type=REFERENCE_TYPES["table"], offset=103.0),
}
KNOTS = (*BEFORE, *SNAP_TABLE, *table_knots(TIMES, POINTS, "cubic"))


def motion(time, reference):
    """Five rows: position and its derivatives up to snap."""
    return np.reshape(reference_derivatives(time, reference, KNOTS), (5, 3))


@pytest.mark.parametrize("name", MOTIONS)
@quick
@given(time=st.floats(0.01, 9.0))
def test_every_reference_has_its_derivatives_up_to_snap(name, time):
    if min(abs(time - knot) for knot in TIMES) < 0.005 and name in {"waypoints", "table"}:
        return  # the snap bends there, the jerk of a cubic spline jumps
    step = 1e-3
    f = {k: motion(time + k * step, MOTIONS[name]) for k in (-2, -1, 1, 2)}
    slope = (f[-2] - 8 * f[-1] + 8 * f[1] - f[2]) / (12 * step)
    now = motion(time, MOTIONS[name])
    np.testing.assert_allclose(slope[:4], now[1:], rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("name", MOTIONS)
@quick
@given(time=st.floats(0.0, 9.0))
def test_both_views_of_a_reference_agree(name, time):
    full = reference_derivatives(time, MOTIONS[name], KNOTS)
    plain = position_reference(time, MOTIONS[name], KNOTS)
    assert plain[:6] == pytest.approx(full[:6], abs=1e-13)
    assert plain[6:] == (0.0, 0.0, 0.0), "the acceleration is left out by default"
    forward = MOTIONS[name]._replace(acceleration_feedforward=1.0)
    assert position_reference(time, forward, KNOTS)[6:] == pytest.approx(full[6:9], abs=1e-13)


def test_waypoints_are_passed_at_their_times_from_rest_to_rest():
    for time, point in zip(TIMES, POINTS):
        np.testing.assert_allclose(motion(time, WAYPOINTS)[0], point, atol=1e-12)
    for time in (TIMES[0], TIMES[-1] - 1e-9, TIMES[-1], 100.0):
        np.testing.assert_allclose(motion(time, WAYPOINTS)[1:4], 0.0, atol=1e-5)
    np.testing.assert_array_equal(motion(100.0, WAYPOINTS)[0], POINTS[-1])


def test_two_waypoints_are_joined_by_the_known_polynomial():
    """``35 s^4 - 84 s^5 + 70 s^6 - 20 s^7`` of the way, with s the share of the time."""
    table = minimum_snap_knots([[0.0, 1.0, 2.0], [2.0, 1.0, -2.0]], [0.0, 3.0])
    two = ReferenceParameters(REFERENCE_TYPES["waypoints"], segments=2.0)
    for time in np.linspace(0.0, 3.0, 13):
        s = time / 3.0
        share = 35 * s**4 - 84 * s**5 + 70 * s**6 - 20 * s**7
        found = reference_derivatives(float(time), two, table)[:3]
        assert found == pytest.approx((2 * share, 1.0, 2 - 4 * share), abs=1e-12)


@cache
def snap_along_the_way():
    """Instants, and the snap along x there."""
    times = np.linspace(0.0, TIMES[-1], 13001)
    return times, np.array([motion(t, WAYPOINTS)[4, 0] for t in times])


def along_table(interpolation, rows, time):
    """Five rows as `motion`, of the curve (t^3, t, 1/(1 + t)) read from ``rows`` rows."""
    times = np.linspace(0.0, 2.0, rows)
    points = np.transpose([times**3, times, 1.0 / (1.0 + times)])
    parameters = WAYPOINTS._replace(segments=float(rows), offset=0.0)
    knots = table_knots(times.tolist(), points, interpolation)
    return np.reshape(reference_derivatives(time, parameters, knots), (5, 3))


@pytest.mark.parametrize("interpolation", ["minimum_snap", "cubic"])
@pytest.mark.parametrize("rows", [2, 3, 4, 5, 9])
def test_a_table_passes_its_rows_and_cubics_exactly(interpolation, rows):
    for time in np.linspace(0.0, 2.0, rows)[:-1].tolist():
        found = along_table(interpolation, rows, time)[0]
        np.testing.assert_allclose(found, [time**3, time, 1.0 / (1.0 + time)], atol=1e-12)
    if rows >= 4:  # neither has reason to bend, whatever the rows between
        found = along_table(interpolation, rows, 1.23)[:, :2]
        expected = [[1.23**3, 1.23], [3 * 1.23**2, 1.0], [6 * 1.23, 0.0], [6.0, 0.0], [0.0, 0.0]]
        np.testing.assert_allclose(found, expected, atol=1e-7)
    np.testing.assert_array_equal(along_table(interpolation, rows, 9.0)[:, 0], [8.0, 0, 0, 0, 0])


def test_the_snap_of_a_table_begins_and_ends_at_zero():
    """With its first two derivatives, as where nothing pulls at a beam: the ends are free."""
    for time in (0.0, 2.0 - 1e-9):
        assert along_table("minimum_snap", 9, time)[4] == pytest.approx(0.0, abs=1e-6)
    near = along_table("minimum_snap", 9, 0.01)[4] / along_table("minimum_snap", 9, 0.02)[4]
    assert near[2] == pytest.approx(1 / 8, rel=1e-3)


def snap_cost(shift, times, snap):
    """Integral of squared snap of the motion with a middle stretch bent by a bump."""
    # A bump that is zero with three derivatives at the knots 2 and 5: (s (1 - s))^4.
    s = np.clip((times - 2.0) / 3.0, 0.0, 1.0)
    bump = np.polynomial.Polynomial([0, 1, -1]) ** 4
    bent = shift * bump.deriv(4)(s) / 3.0**4 * ((s > 0) & (s < 1))
    return np.trapezoid((snap + bent) ** 2, times)


@pytest.mark.slow
def test_no_bump_between_waypoints_lowers_the_snap():
    flown = snap_along_the_way()
    at_rest = snap_cost(0.0, *flown)
    for shift in (0.3, -0.3):
        assert snap_cost(shift, *flown) > at_rest
    # To first order nothing changes: the motion is stationary.
    slope = (snap_cost(1e-3, *flown) - snap_cost(-1e-3, *flown)) / 2e-3
    assert abs(slope) < 1e-3 * at_rest


@pytest.mark.parametrize(
    ("points", "times", "message"),
    [
        (POINTS[:1], [0.0], "at least 2"),
        (POINTS, TIMES[:3], "4 waypoints but 3 times"),
        (POINTS, [0.0, 2.0, 2.0, 3.0], "must start at 0 and increase"),
        (POINTS, [1.0, 2.0, 3.0, 4.0], "must start at 0"),
        (POINTS, [0.0, 2.0, 3.0, float("inf")], "finite"),
    ],
)
def test_waypoints_that_make_no_motion_are_refused(points, times, message):
    with pytest.raises(ValueError, match=message):
        minimum_snap_knots(points, times)


def test_missing_parts_of_a_reference_are_zero():
    assert not any(leaves(ReferenceParameters(REFERENCE_TYPES["line"])[1:]))


def test_a_square_of_waypoints_is_left_as_documented():
    """docs/beyond.md: by 0.98 m with even times, with the edges' midpoints by 0.10 m."""
    corners = [(0.0, 0.0, 0.0), (2.0, 0.0, 0.0), (2.0, 2.0, 0.0), (0.0, 2.0, 0.0), (0.0, 0.0, 0.0)]
    halves = [tuple((np.add(a, b) / 2).tolist()) for a, b in itertools.pairwise(corners)]
    more = [point for pair in zip(corners, halves, strict=False) for point in pair] + corners[-1:]
    for points, outside in ((corners, 0.98), (more, 0.10)):
        times = np.linspace(0.0, 20.0, len(points)).tolist()
        knots = np.array(minimum_snap_knots(points, times))
        x = [waypoint_motion(t, len(times), 0.0, knots)[0, 0] for t in np.linspace(0.0, 20.0, 401)]
        assert round(max(x) - 2.0, 2) == outside


def test_attitudes_of_a_table_have_the_derivatives_of_their_polynomials():
    times = np.linspace(0.0, 2.0, 9)
    points = np.column_stack([np.sin(times + k) * (1.0 + 2.0 * (k == 3)) for k in range(6)])
    knots = (9.0, *table_knots(times.tolist(), points.tolist(), "minimum_snap"))
    poses = ReferenceParameters(POSES, segments=9.0, offset=1.0)
    for time, row in zip(times, points):
        np.testing.assert_allclose(reference_motion(time, poses, knots)[0], row[:3], atol=1e-9)
        np.testing.assert_allclose(attitude_reference(time, poses, knots), row[3:], atol=1e-9)
    step, now = 1e-4, 0.8
    before, here, after = (
        reference_attitude(time, poses, knots) for time in (now - step, now, now + step)
    )
    np.testing.assert_allclose((after[:3] - before[:3]) / (2.0 * step), here[1:], rtol=1e-6)
    moving = poses._replace(segments=2.0)
    turns = table_knots([0.0, 1.0], [[0.0] * 6, [0.0] * 3 + [4.0, 0.0, -7.0]], "cubic")
    found = attitude_reference(5.0, moving, (0.0, *turns))
    np.testing.assert_allclose(found, [4.0 - 2.0 * np.pi, 0.0, 2.0 * np.pi - 7.0], atol=1e-14)
