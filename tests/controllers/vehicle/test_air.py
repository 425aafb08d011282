"""Forces of the air against closed forms, turbulence against its spectrum."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate, linalg, signal

from tiltsim_controllers.vehicle.air import (
    FOOT,
    Air,
    Drag,
    GroundEffect,
    Gust,
    Turbulence,
    air_velocity,
    drag_force,
    dryden_rates,
    dryden_velocity,
    ground_effect,
    gust_profile,
    low_altitude_turbulence,
    stationary_states,
    white_noise,
)

speeds = st.floats(-20.0, 20.0)


# --- drag --------------------------------------------------------------------------------------


def dryden_spectrum(omega, turbulence, axis):
    """Power spectral density (m^2/s^2 per rad/s, one-sided) of a component: ``u``, ``v`` or ``w``.

    Sec. 3.7.1.2, over time: ``Phi(omega) = Phi(Omega) / V`` with ``Omega = omega / V``. Its
    integral from zero to infinity is the variance.
    """
    w = np.asarray(omega, dtype=float)
    length, sigma = turbulence.length_u, turbulence.intensity_u
    if axis == "w":
        length, sigma = turbulence.length_w, turbulence.intensity_w
    tau = length / turbulence.speed
    x = (tau * w) ** 2
    if axis == "u":
        return np.asarray(sigma**2 * 2.0 * tau / np.pi / (1.0 + x))
    return np.asarray(sigma**2 * tau / np.pi * (1.0 + 3.0 * x) / (1.0 + x) ** 2)


@given(st.tuples(speeds, speeds, speeds))
def test_drag_takes_energy(velocity):
    force = drag_force(velocity, Drag((0.2, 0.3, 0.1), (0.01, 0.02, 0.03)))
    assert np.dot(force, velocity) <= 0.0


def test_drag_is_linear_and_quadratic_as_it_says():
    assert drag_force((2.0, -1.0, 0.5), Drag((0.2, 0.3, 0.1))) == pytest.approx((-0.4, 0.3, -0.05))
    along_x = drag_force((-3.0, 0.0, 0.0), Drag(area=(0.02, 0.0, 0.0), density=1.2))
    assert along_x == pytest.approx((0.5 * 1.2 * 0.02 * 9.0, 0.0, 0.0))


def test_quadratic_drag_grows_with_the_whole_speed():
    velocity = np.array([2.0, -3.0, 6.0])  # 7 m/s
    areas = np.array([0.01, 0.02, 0.03])
    expected = -0.5 * 1.2 * areas * 7.0 * velocity
    found = drag_force(tuple(velocity.tolist()), Drag(area=tuple(areas.tolist()), density=1.2))
    np.testing.assert_allclose(found, expected, rtol=1e-12)


# --- gusts -------------------------------------------------------------------------------------


def test_a_gust_is_one_minus_cosine():
    gust = Gust(start=1.0, rise=2.0)
    times = [0.0, 1.0, 1.5, 2.0, 3.0, 50.0]
    desired = [0.0, 0.0, 0.5 * (1.0 - np.cos(np.pi / 4.0)), 0.5, 1.0, 1.0]
    assert [gust_profile(t, gust) for t in times] == pytest.approx(desired)


@given(st.floats(0.0, 3.0))
def test_a_gust_falls_as_it_rose(since):
    gust = Gust(start=1.0, rise=2.0, duration=6.0)
    assert gust_profile(1.0 + since, gust) == pytest.approx(gust_profile(7.0 - since, gust))


def test_a_gust_with_an_end_is_over_then():
    gust = Gust(start=1.0, rise=2.0, duration=6.0)
    times = [0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 7.5, 50.0]
    expected = [0.0, 0.0, 0.5, 1.0, 1.0, 1.0, 0.5, 0.0, 0.0, 0.0]
    assert [gust_profile(t, gust) for t in times] == pytest.approx(expected, abs=1e-12)


# --- turbulence --------------------------------------------------------------------------------

TURBULENCE = low_altitude_turbulence(6.0, 12.0, speed=6.0, seed=4.0)


def test_low_altitude_intensities_and_scales():
    made = low_altitude_turbulence(10.0, 100.0 * FOOT, speed=10.0)
    assert made.intensity_w == pytest.approx(1.0)
    assert made.length_w == pytest.approx(100.0 * FOOT)
    assert made.intensity_u == pytest.approx(1.0 / 0.2593**0.4)
    assert made.length_u == pytest.approx(100.0 * FOOT / 0.2593**1.2)
    # At 1000 ft turbulence is isotropic.
    high = low_altitude_turbulence(10.0, 1000.0 * FOOT, speed=10.0)
    assert high.intensity_u == pytest.approx(high.intensity_w, rel=1e-6)
    assert high.length_u == pytest.approx(high.length_w, rel=1e-6)


@pytest.mark.parametrize("axis", ["u", "v", "w"])
def test_the_spectrum_integrates_to_the_variance(axis):
    total, _ = integrate.quad(lambda w: float(dryden_spectrum(w, TURBULENCE, axis)), 0.0, np.inf)
    sigma = TURBULENCE.intensity_w if axis == "w" else TURBULENCE.intensity_u
    assert total == pytest.approx(sigma**2, rel=1e-6)


def filters(turbulence):
    """The filters' matrices, taken from the rates: dynamics, drive of the noises, output."""
    quiet = turbulence._replace(sample_time=1e30)  # the noise vanishes, the filters remain
    matrix = np.array([dryden_rates(0.0, tuple(row), quiet) for row in np.eye(5)]).T
    output = np.array([dryden_velocity(tuple(row), turbulence) for row in np.eye(5)]).T
    drive = np.zeros((5, 3))
    for noise, state in enumerate((0, 1, 3)):  # noise drives a state at its decay rate
        drive[state, noise] = -matrix[state, state]
    return matrix, drive, output


def response(omega, turbulence):
    """Velocity per unit noise of each filter, shape (3, N)."""
    matrix, drive, output = filters(turbulence)
    found = [output @ np.linalg.solve(1j * w * np.eye(5) - matrix, drive) for w in omega]
    return np.abs(np.array([[h[axis, axis] for h in found] for axis in range(3)]))


def test_the_filters_have_the_spectrum():
    omega = np.geomspace(1e-3, 1e2, 40)
    gain = response(omega, TURBULENCE)
    for row, axis in zip(gain, "uvw", strict=True):
        # One-sided over omega: white noise of unit density has 1 / pi.
        np.testing.assert_allclose(
            row**2 / np.pi, dryden_spectrum(omega, TURBULENCE, axis), rtol=1e-9
        )


def simulated(turbulence, count):
    """The turbulent velocities at every draw of the noise, shape (count, 3)."""
    matrix, drive, output = filters(turbulence)
    step = turbulence.sample_time
    decay = linalg.expm(step * matrix)
    noise = [
        [white_noise(index * step, 20.0 + axis, turbulence) for axis in range(3)]
        for index in range(count)
    ]
    kicks = np.array(noise) @ (np.linalg.solve(matrix, decay - np.eye(5)) @ drive).T
    states = np.empty((count, 5))
    states[0] = stationary_states(turbulence)
    for index in range(1, count):
        states[index] = decay @ states[index - 1] + kicks[index - 1]
    return states @ output.T


def test_the_rates_are_driven_by_the_noise():
    rates = dryden_rates(3.3, (0.0,) * 5, TURBULENCE)
    _, drive, _ = filters(TURBULENCE)
    noise = [white_noise(3.3, 20.0 + axis, TURBULENCE) for axis in range(3)]
    np.testing.assert_allclose(rates, drive @ noise)


@pytest.mark.slow
def test_the_process_has_the_spectrum():
    fast = TURBULENCE._replace(sample_time=0.02, length_u=6.0, length_w=3.0)  # 1 s and 0.5 s
    velocity = simulated(fast, 60_000)
    for column, axis in enumerate("uvw"):
        frequency, density = signal.welch(velocity[:, column], fs=50.0, nperseg=2048)
        band = (frequency > 0.05) & (frequency < 4.0)
        desired = 2.0 * np.pi * dryden_spectrum(2.0 * np.pi * frequency[band], fast, axis)
        ratio = density[band] / desired
        # Some 57 averages: each estimate scatters by 13 %, their mean over the band by much less.
        assert ratio.mean() == pytest.approx(1.0, abs=0.05)
        octaves = np.add.reduceat(ratio, np.searchsorted(frequency[band], [0.05, 0.2, 0.8, 2.0]))
        counts = np.diff([*np.searchsorted(frequency[band], [0.05, 0.2, 0.8, 2.0]), band.sum()])
        np.testing.assert_allclose(octaves / counts, 1.0, atol=0.15)


def test_flights_begin_in_the_stationary_distribution():
    draws = [
        dryden_velocity(stationary_states(made), made)
        for made in (TURBULENCE._replace(seed=float(seed)) for seed in range(3000))
    ]
    sigma = [TURBULENCE.intensity_u, TURBULENCE.intensity_u, TURBULENCE.intensity_w]
    np.testing.assert_allclose(np.std(draws, axis=0), sigma, rtol=0.05)
    assert abs(np.corrcoef(np.transpose(draws)) - np.eye(3)).max() < 0.08


def test_no_turbulence_by_default():
    assert dryden_velocity((1.0, 2.0, 3.0, 4.0, 5.0), Turbulence()) == (0.0, 0.0, 0.0)


# --- ground ------------------------------------------------------------------------------------


def test_ground_effect_is_cheeseman_and_bennetts():
    assert ground_effect(0.1, 0.1) == pytest.approx(16.0 / 15.0)
    assert ground_effect(0.2, 0.1) == pytest.approx(64.0 / 63.0)
    assert ground_effect(1e6, 0.1) == pytest.approx(1.0)
    assert ground_effect(-1.0, 0.1) == ground_effect(0.05, 0.1) == pytest.approx(4.0 / 3.0)
    assert ground_effect(0.1, 0.0) == 1.0


# --- the air as a whole ------------------------------------------------------------------------


def test_the_airs_velocity_is_wind_gust_and_turbulence_together():
    gust = Gust(start=1.0, rise=2.0, velocity=(4.0, -2.0, 6.0))
    states = (0.3, -0.2, 0.5, 0.1, -0.4)
    air = Air((0.5, -1.5, 0.25), gust=gust, turbulence=TURBULENCE)
    turbulent = np.array(dryden_velocity(states, TURBULENCE))
    assert np.abs(turbulent).min() > 0.01
    expected = np.array([0.5, -1.5, 0.25]) + 0.5 * np.array([4.0, -2.0, 6.0]) + turbulent
    np.testing.assert_allclose(air_velocity(2.0, states, air), expected, rtol=1e-12)


def test_air_at_rest_is_the_default():
    nothing = (0.0, 0.0, 0.0)
    assert Air() == Air(nothing, Drag(nothing, nothing, 1.225))
    air = Air(turbulence=TURBULENCE._replace(intensity_u=0.0, intensity_w=0.0))
    for time in (0.0, 0.5, 3.0):
        assert air_velocity(time, (1.0, 2.0, 3.0, 4.0, 5.0), air) == (0.0, 0.0, 0.0)
        assert air_velocity(time, (1.0, 2.0, 3.0, 4.0, 5.0), Air()) == (0.0, 0.0, 0.0)
        assert dryden_rates(time, (1.0, 2.0, 3.0, 4.0, 5.0), Turbulence()) == (0.0,) * 5
    assert ground_effect(0.01, GroundEffect().rotor_radius) == 1.0
    assert GroundEffect().height == 0.0
    # By default a gust begins at time zero, rises within a second and lasts.
    assert Gust() == Gust(start=0.0, rise=1.0, duration=0.0, velocity=nothing)
    assert gust_profile(0.5, Gust()) == pytest.approx(0.5)
    along = dryden_velocity((1.0, 0.0, 0.0, 0.0, 0.0), Turbulence(intensity_u=1.0))
    assert along == pytest.approx((2.0**0.5, 0.0, 0.0))


def test_turbulence_blows_along_its_direction():
    """Its first state drives what is along the mean wind, the next two what is across."""
    made = low_altitude_turbulence(6.0, 12.0, speed=6.0, direction=0.5, seed=4.0)
    along = np.array(dryden_velocity((1.0, 0.0, 0.0, 0.0, 0.0), made))
    across = np.array(dryden_velocity((0.0, 1.0, 0.0, 0.0, 0.0), made))
    heading = [np.cos(0.5), np.sin(0.5), 0.0]
    np.testing.assert_allclose(along / np.linalg.norm(along), heading, atol=1e-15)
    sideways = [-np.sin(0.5), np.cos(0.5), 0.0]
    np.testing.assert_allclose(across / np.linalg.norm(across), sideways, atol=1e-15)
    assert (made.sample_time, made.seed) == (0.01, 4.0)
    plain = low_altitude_turbulence(6.0, 12.0, speed=6.0)
    assert (plain.along_x, plain.along_y, plain.seed) == (1.0, 0.0, 0.0)


@pytest.mark.parametrize(("height", "feet"), [(0.0, 10.0), (1.0, 10.0), (400.0, 1000.0)])
def test_the_low_altitude_model_is_held_to_its_range(height, feet):
    assert low_altitude_turbulence(5.0, height, speed=5.0).length_w == pytest.approx(feet * FOOT)


def test_a_draw_of_the_noise_is_held_for_its_sample_time():
    for index in (0, 1, 7, 1000):
        at = [index * 0.01 + shift for shift in (0.0, 0.004, 0.0099)]
        assert len({white_noise(time, 20.0, TURBULENCE) for time in at}) == 1
    draws = [white_noise(index * 0.01, 20.0, TURBULENCE) for index in range(2000)]
    assert len(set(draws)) == 2000
    # The integral over a sample has the variance of its length.
    assert np.var(0.01 * np.array(draws)) == pytest.approx(0.01, rel=0.1)
