"""The wake of a hovering vehicle: momentum theory below its rotors, a jet farther down."""

from __future__ import annotations

import numpy as np
import pytest

from tiltsim_controllers.vehicle.air import Downwash, Wake, downwash_force, wake_velocity

WAKE = Wake(weight=24.0, disc_area=0.19)
DENSITY = 1.2


@pytest.mark.parametrize("depth", [1e-6, 0.5, 3.0])
def test_the_wake_carries_the_momentum_of_the_weight_at_every_depth(depth):
    distance = np.linspace(0.0, 8.0, 40001)
    velocity = wake_velocity(depth, distance, WAKE, DENSITY)
    flux = np.trapezoid(DENSITY * velocity**2 * 2.0 * np.pi * distance, distance)
    assert flux == pytest.approx(WAKE.weight, rel=1e-6)


def test_right_below_the_rotors_it_has_twice_the_induced_velocity_and_above_none():
    induced = np.sqrt(WAKE.weight / (2.0 * DENSITY * WAKE.disc_area))
    assert wake_velocity(1e-9, 0.0, WAKE, DENSITY) == pytest.approx(2.0 * induced)
    assert wake_velocity(-0.1, 0.0, WAKE, DENSITY) == 0.0


def test_far_below_the_velocity_falls_with_the_depth_and_its_half_width_grows_by_a_tenth_of_it():
    """Round jets: half the velocity at 0.094 of the distance from the virtual origin."""
    origin = np.sqrt(WAKE.disc_area / np.pi) / (0.094 / np.sqrt(np.log(2.0)))
    near, far = (wake_velocity(depth, 0.0, WAKE, DENSITY) for depth in (2.0, 6.0))
    assert near / far == pytest.approx((6.0 + origin) / (2.0 + origin))
    half = wake_velocity(6.0, 0.094 * (6.0 + origin), WAKE, DENSITY)
    assert half == pytest.approx(0.5 * far)


def test_the_force_is_the_dynamic_pressure_on_the_area_and_wakes_add_their_velocities():
    places = np.array([[0.0, 0.0, 2.0], [0.0, 0.0, 1.0], [0.3, 0.0, 0.0]])
    downwash, wakes = Downwash(DENSITY, 0.02), (WAKE, WAKE, WAKE)
    assert downwash_force(places, 0, wakes, downwash) == 0.0
    one = wake_velocity(1.0, 0.0, WAKE, DENSITY)
    assert downwash_force(places, 1, wakes, downwash) == pytest.approx(
        -0.5 * DENSITY * 0.02 * one**2
    )
    both = wake_velocity(2.0, 0.3, WAKE, DENSITY) + wake_velocity(1.0, 0.3, WAKE, DENSITY)
    assert downwash_force(places, 2, wakes, downwash) == pytest.approx(
        -0.5 * DENSITY * 0.02 * both**2
    )
