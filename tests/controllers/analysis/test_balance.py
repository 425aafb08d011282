"""Gaits that hold the vehicle level against a constant acceleration."""

from __future__ import annotations

from math import atan, hypot, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from tiltsim_controllers.analysis.balance import balanced_gait
from tiltsim_controllers.vehicle.cross import cross_torque, torque_free_force, torque_free_inputs
from tiltsim_controllers.vehicle.parameters import PRESETS, SPIN, drag_ratio

AR_DRONE = PRESETS["ar_drone_2"]
VEHICLES = {name: PRESETS[name] for name in ("ar_drone_2", "luukkonen")}
quick = settings(deadline=None, max_examples=15)
accelerations = st.tuples(st.floats(-2, 2), st.floats(-2, 2), st.floats(-5, 3))

every_vehicle = pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=VEHICLES)


def rotor_loads(tilts, vehicle):
    """Fraction of each rotor in ``sum |w_i|`` when torque-free, times four: 1 where evenly loaded.

    Negative where a rotor would have to turn backwards. NaN where tau is rank-deficient.
    """
    torque = cross_torque(np.array(tilts), drag_ratio(vehicle))
    inputs = torque_free_inputs(torque) * SPIN
    total = inputs.sum()
    return 4.0 * inputs / total if total != 0.0 else np.full(4, np.nan)


def force(tilts, vehicle):
    return torque_free_force(np.array(tilts), drag_ratio(vehicle))


def levers(tilts, vehicle):
    twist = 2 * atan(drag_ratio(vehicle))
    return (
        sin(twist - tilts[0] - tilts[2]) / sin(twist),
        sin(twist + tilts[1] + tilts[3]) / sin(twist),
    )


def against(acceleration, vehicle):
    return np.array([0.0, 0.0, vehicle.gravity]) - acceleration


def assert_balanced(tilts, acceleration, vehicle, atol=1e-12):
    n, desired = force(tilts, vehicle), against(acceleration, vehicle)
    np.testing.assert_allclose(
        n / np.linalg.norm(n), desired / np.linalg.norm(desired), rtol=0, atol=atol
    )


@every_vehicle
@quick
@given(accelerations)
def test_the_torque_free_force_balances_gravity_and_the_acceleration(vehicle, acceleration):
    assert_balanced(balanced_gait(acceleration, vehicle), acceleration, vehicle)


@every_vehicle
def test_the_factored_force_is_the_torque_free_force(vehicle):
    delta = atan(drag_ratio(vehicle))
    for tilts in np.random.default_rng(0).uniform(-1.5, 1.5, (20, 4)):
        e13, e24, d13, d24 = *(tilts[:2] + tilts[2:]), *(tilts[:2] - tilts[2:])
        a, b = levers(tilts, vehicle)
        n = (
            a * np.sin(d24),
            -b * np.sin(d13),
            a * (np.cos(e24 + delta) / np.cos(delta) + np.cos(d24))
            + b * (np.cos(e13 - delta) / np.cos(delta) + np.cos(d13)),
        )
        np.testing.assert_allclose(n, force(tilts, vehicle), rtol=0, atol=1e-13)


@pytest.mark.parametrize("vertical", [-3.0, 0.0, 5.0])
def test_a_vertical_acceleration_needs_no_tilt(vertical):
    assert balanced_gait((0.0, 0.0, vertical), AR_DRONE) == (0.0, 0.0, 0.0, 0.0)


@every_vehicle
@pytest.mark.parametrize(
    "acceleration", [(1, 0, 0), (0, -1.5, 0), (1, 1, 0), (1.2, 0.5, -1), (-2, 0.7, 0)]
)
def test_no_gait_near_by_or_far_tilts_less(vehicle, acceleration):
    """Random search with another method, among gaits within the same levers."""
    tilts = balanced_gait(acceleration, vehicle)
    least = sum(value**2 for value in tilts)
    assert min(levers(tilts, vehicle)) >= 0.5 - 1e-9
    desired = against(acceleration, vehicle)
    x, y = desired[:2] / desired[2]

    def side(point):
        n = force(point, vehicle)
        return [n[0] - x * n[2], n[1] - y * n[2]]

    random = np.random.default_rng(1)
    for _ in range(6):
        found = minimize(
            lambda point: point @ point,
            random.normal(0.0, 0.3, 4),
            method="SLSQP",
            constraints=[
                {"type": "eq", "fun": side},
                {"type": "ineq", "fun": lambda p: np.array(levers(p, vehicle)) - 0.5},
            ],
            options={"ftol": 1e-12},
        )
        if (
            found.success
            and np.abs(side(found.x)).max() < 1e-8
            and min(levers(found.x, vehicle)) > 0.49
        ):
            assert least <= found.fun + 1e-6


@pytest.mark.parametrize("min_lever", [0.3, 0.5, 0.9, 1.0])
@pytest.mark.parametrize("x", [1e-6, 0.3, 1.0, 2.0, 3.0, 4.0])
def test_the_answer_is_stationary(x, min_lever):
    """No step along the balanced gaits, within the levers, tilts less."""
    acceleration = (x, 0.2 * x, 0.0)
    tilts = np.array(balanced_gait(acceleration, AR_DRONE, min_lever=min_lever))
    desired = against(acceleration, AR_DRONE)
    slope = desired[:2] / desired[2]

    def side(point):
        n = force(point, AR_DRONE)
        return n[:2] - slope * n[2]

    h = 1e-6
    active = [(side(tilts + h * e) - side(tilts - h * e)) / (2 * h) for e in np.eye(4)]
    normals = list(np.transpose(active))
    lever_13, lever_24 = levers(tilts, AR_DRONE)
    normals += [np.array([1.0, 0, 1, 0])] if lever_13 < min_lever + 1e-6 else []
    normals += [np.array([0, 1.0, 0, 1])] if lever_24 < min_lever + 1e-6 else []
    normals = np.array(normals).T
    along = tilts - normals @ np.linalg.lstsq(normals, tilts, rcond=None)[0]
    np.testing.assert_allclose(along, 0.0, atol=1e-6)


@every_vehicle
def test_mirrored_accelerations_have_mirrored_gaits(vehicle):
    """Half a revolution about the vertical exchanges rotors 1 and 3, and 2 and 4."""
    a1, a2, a3, a4 = balanced_gait((1.3, 0.4, 0.0), vehicle)
    turned = balanced_gait((-1.3, -0.4, 0.0), vehicle)
    np.testing.assert_allclose(turned, (a3, a4, a1, a2), rtol=0, atol=1e-6)


def test_the_gust_of_chapter_1():
    """1 m/s^2 along +x: our own figures, the thesis prints none."""
    gust = (1.0, 0.0, 0.0)
    np.testing.assert_allclose(
        balanced_gait(gust, AR_DRONE), (-0.0346, -0.2258, -0.0346, 0.0725), atol=1e-4
    )
    even = (0.0, -0.20557, 0.0, 0.20557)  # loads all rotors alike
    np.testing.assert_allclose(rotor_loads(even, AR_DRONE), 1.0, atol=0.05)
    assert_balanced(even, gust, AR_DRONE, atol=1e-5)
    np.testing.assert_allclose(
        rotor_loads(balanced_gait(gust, AR_DRONE), AR_DRONE), (0.63, 1.35, 0.63, 1.39), atol=0.01
    )
    assert hypot(*balanced_gait(gust, AR_DRONE)) < 0.85 * hypot(*even)


def test_loads_at_the_point_where_the_torque_matrix_loses_rank():
    delta = atan(drag_ratio(AR_DRONE))
    assert np.isnan(rotor_loads((delta, -delta, delta, -delta), AR_DRONE)).all()


@pytest.mark.parametrize(
    ("acceleration", "message"),
    [
        ((0.0, 0.0, 9.8), r"\(0, 0, 9.8\).*az = 9.8"),
        ((1.0, 0.0, 12.0), r"\(1, 0, 12\).*must be smaller"),
        ((30.0, 0.0, 0.0), r"\(30, 0, 0\): out of reach"),
        ((0.0, float("inf"), 0.0), r"inf.*must be finite"),
        ((float("nan"), 0.0, 0.0), r"nan.*must be finite"),
    ],
)
def test_unreachable_accelerations_are_named(acceleration, message):
    with pytest.raises(ValueError, match=message):
        balanced_gait(acceleration, AR_DRONE)


@pytest.mark.parametrize("limits", [{"max_tilt": 0.1}, {"max_tilt": 0.3, "min_lever": 1.0}])
def test_tighter_limits_bring_it_out_of_reach(limits):
    assert balanced_gait((3.0, 0.0, 0.0), AR_DRONE)
    with pytest.raises(ValueError, match="out of reach"):
        balanced_gait((3.0, 0.0, 0.0), AR_DRONE, **limits)


@pytest.mark.parametrize(
    ("limits", "message"),
    [({"max_tilt": 2.0}, "max_tilt = 2"), ({"min_lever": 0.0}, "min_lever = 0")],
)
def test_limits_must_make_sense(limits, message):
    with pytest.raises(ValueError, match=message):
        balanced_gait((1.0, 0.0, 0.0), AR_DRONE, **limits)
