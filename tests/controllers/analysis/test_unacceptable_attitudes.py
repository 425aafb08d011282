"""Unacceptable-attitude curves and the acceptable share of the roll-pitch square."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tiltsim_controllers.analysis.singularity import (
    acceptable_share,
    determinant,
    residuals,
    torque_free_direction,
    unacceptable_attitudes,
)
from tiltsim_controllers.vehicle.parameters import PRESETS, drag_ratio

AR_DRONE = PRESETS["ar_drone_2"]
OFFSET = 2.0 * float(np.arctan(drag_ratio(AR_DRONE)))

tilt = st.floats(-1.5, 1.5)
gaits = st.tuples(tilt, tilt, tilt, tilt)


def unacceptable_pitch(angles, vehicle, roll):
    """The singular pitch (rad) at each roll: ``atan(-(R cos + R_phi sin) / R_theta)``.

    NaN where ``R_theta`` is exactly zero: the curve is then a vertical line or absent.
    """
    R, R_phi, R_theta = (float(value) for value in residuals(angles, vehicle))
    roll = np.asarray(roll, dtype=float)
    if R_theta == 0.0:
        return np.full_like(roll, np.nan)
    return np.asarray(np.arctan(-(R * np.cos(roll) + R_phi * np.sin(roll)) / R_theta))


@given(angles=gaits)
def test_every_point_of_the_curve_is_singular(angles) -> None:
    curve = unacceptable_attitudes(angles, AR_DRONE)
    assume(curve.kind in ("graph", "vertical"))
    scale = np.linalg.norm(residuals(angles, AR_DRONE))
    values = determinant(angles, curve.roll, curve.pitch, AR_DRONE)
    assert np.abs(values).max() < 1e-12 * scale
    assert np.abs(curve.roll).max() <= np.pi / 2
    assert np.abs(curve.pitch).max() <= np.pi / 2


@given(angles=gaits)
def test_the_closed_form_is_singular_and_agrees_with_the_great_circle(angles) -> None:
    R, R_phi, R_theta = residuals(angles, AR_DRONE)
    scale = np.linalg.norm([R, R_phi, R_theta])
    assume(abs(R_theta) > 1e-3 * scale)
    roll = np.linspace(-1.5, 1.5, 61)
    pitch = unacceptable_pitch(angles, AR_DRONE, roll)
    assert np.abs(determinant(angles, roll, pitch, AR_DRONE)).max() < 1e-12 * scale
    curve = unacceptable_attitudes(angles, AR_DRONE)
    np.testing.assert_allclose(
        unacceptable_pitch(angles, AR_DRONE, curve.roll), curve.pitch, atol=1e-9
    )


def test_kinds_of_curve() -> None:
    """alpha_2 = alpha_4 makes R_theta vanish: the curve is a vertical line."""
    vertical = unacceptable_attitudes((0.8, 0.2, -0.8, 0.2), AR_DRONE)
    assert vertical.kind == "vertical"
    assert np.ptp(vertical.roll) < 1e-14
    assert np.isnan(unacceptable_pitch((0.8, 0.2, -0.8, 0.2), AR_DRONE, 0.1))
    assert unacceptable_attitudes((0.5, -0.5, 0.5, -0.5), AR_DRONE).kind == "none"
    assert unacceptable_attitudes((0.0, 0.0, 0.0, 0.0), AR_DRONE).kind == "none"
    blue = (0.5, -0.5, OFFSET - 0.5, 0.5 - OFFSET)
    assert unacceptable_attitudes(blue, AR_DRONE).kind == "everywhere"
    trot = unacceptable_attitudes((-0.65, -0.65, 0.65, 0.65), AR_DRONE)
    assert trot.kind == "graph"


def test_share_of_red_blue_and_vertical() -> None:
    assert acceptable_share((0.5, -0.5, 0.5, -0.5), AR_DRONE) == pytest.approx(1.0, abs=1e-12)
    assert acceptable_share((0.5, -0.5, OFFSET - 0.5, 0.5 - OFFSET), AR_DRONE) == 0.0
    angles = (0.8, 0.2, -0.8, 0.2)
    line = unacceptable_attitudes(angles, AR_DRONE).roll[0]
    assert acceptable_share(angles, AR_DRONE) == pytest.approx(
        (np.pi / 2 + abs(line)) / np.pi, abs=1e-9
    )


@pytest.mark.parametrize("steepness", [1e-3, 1e-5, 1e-7, 1e-9])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_share_of_a_nearly_vertical_curve_tends_to_the_share_of_the_line(steepness, side) -> None:
    upright = (side * 0.8, 0.2, -side * 0.8, 0.2)
    tilted = (side * 0.8, 0.2, -side * 0.8, 0.2 + steepness)
    assert acceptable_share(tilted, AR_DRONE) == pytest.approx(
        acceptable_share(upright, AR_DRONE), abs=3 * steepness + 1e-8
    )


@pytest.mark.parametrize("half_width", [np.pi / 2, 0.7])
def test_share_agrees_with_counting(half_width) -> None:
    generator = np.random.default_rng(3)
    side = (np.arange(400) + 0.5) / 200 * half_width - half_width
    roll, pitch = np.meshgrid(side, side)
    for angles in generator.uniform(-1.2, 1.2, (20, 4)):
        if np.isnan(torque_free_direction(angles, AR_DRONE)).any():
            continue
        level = determinant(angles, 0.0, 0.0, AR_DRONE)
        counted = np.mean(determinant(angles, roll, pitch, AR_DRONE) * level > 0.0)
        assert acceptable_share(angles, AR_DRONE, half_width) == pytest.approx(counted, abs=2e-3)


def test_share_is_exact_for_a_known_integral() -> None:
    """R_phi = 0, R = k R_theta: the share is 1/2 + (2/pi^2) times the integral of atan(k cos)."""
    from scipy.integrate import quad

    angles = (0.2, 0.5, 0.2, -0.3)
    R, R_phi, R_theta = residuals(angles, AR_DRONE)
    assert abs(R_phi) < 1e-15
    exact = 0.5 + quad(lambda x: np.arctan(abs(R / R_theta) * np.cos(x)), 0, np.pi / 2)[0] * (
        2 / np.pi**2
    )
    assert acceptable_share(angles, AR_DRONE) == pytest.approx(exact, abs=1e-9)


@pytest.mark.parametrize("half_width", [0.0, -1.0, 2.0, float("nan")])
def test_share_refuses_a_square_beyond_the_roll_pitch_range(half_width) -> None:
    with pytest.raises(ValueError, match="half_width"):
        acceptable_share((0.1, 0.2, 0.3, 0.4), AR_DRONE, half_width)
