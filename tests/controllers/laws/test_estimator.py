"""The error-state filter against a straightforward one: dense, numerical Jacobians, Joseph form."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from tiltsim_controllers.laws import estimator as e

GRAVITY, STEP = 9.81, 0.01
NOISE = e.ImuNoise(gyro=2e-3, force=2e-2, gyro_walk=1e-4, force_walk=1e-3)
ARM = np.array([0.1, -0.05, 0.2])
FIELD = np.array([0.2, 0.05, -0.4])


def _scipy(quaternion: Any) -> Rotation:
    return Rotation.from_quat(np.roll(quaternion, -1))


def _moved(now: e.Estimate, error: Any) -> e.Estimate:
    """A state away from another by given errors."""
    turned = Rotation.from_rotvec(error[:3]) * _scipy(now.quaternion)
    return now._replace(
        quaternion=np.roll(turned.as_quat(), 1),
        velocity=now.velocity + error[3:6],
        position=now.position + error[6:9],
        gyro_bias=now.gyro_bias + error[9:12],
        force_bias=now.force_bias + error[12:],
    )


def _difference(a: e.Estimate, b: e.Estimate) -> Any:
    """The errors that lead from ``b`` to ``a``."""
    turn = (_scipy(a.quaternion) * _scipy(b.quaternion).inv()).as_rotvec()
    pairs = [(a.velocity, b.velocity), (a.position, b.position)]
    pairs += [(a.gyro_bias, b.gyro_bias), (a.force_bias, b.force_bias)]
    return np.concatenate([turn, *(x - y for x, y in pairs)])


def _numerical(function: Callable[[Any], Any], size: float = 1e-5) -> Any:
    columns = [
        (function(step) - function(-step)) / (2.0 * size) for step in size * np.eye(e.ERRORS)
    ]
    return np.transpose(columns)


def _full(packed: Any) -> Any:
    matrix = np.zeros((e.ERRORS, e.ERRORS))
    matrix[e.ROWS, e.COLUMNS] = matrix[e.COLUMNS, e.ROWS] = packed
    return matrix


@pytest.fixture
def now() -> e.Estimate:
    draws = np.random.default_rng(3)
    root = draws.normal(size=(e.ERRORS, e.ERRORS)) * np.repeat([0.02, 0.1, 0.1, 0.003, 0.05], 3)
    quaternion = draws.normal(size=4)
    return e.Estimate(
        *draws.normal(size=(2, 3)),
        quaternion / np.linalg.norm(quaternion),
        *(draws.normal(size=(2, 3)) * 0.02),
        (root.T @ root)[e.ROWS, e.COLUMNS],
    )


def _through(now: e.Estimate, steps: int) -> tuple[e.Estimate, e.Transition]:
    through, draws = e.no_transition(), np.random.default_rng(7)
    for _ in range(steps):
        rates, force = draws.normal(size=3), draws.normal(size=3) + np.array([0.0, 0.0, GRAVITY])
        now, through = e.integrated(now, through, rates, force, STEP, GRAVITY)
    return now, through


@pytest.mark.parametrize("steps", [1, 12])
def test_errors_travel_as_numerical_derivatives_do(now: e.Estimate, steps: int) -> None:
    end, through = _through(now, steps)
    matrix = _numerical(lambda d: _difference(_through(_moved(now, d), steps)[0], end))
    assert_allclose(e.transition_matrix(through), matrix, atol=2e-5)


def test_one_span_adds_the_noise_of_its_steps(now: e.Estimate) -> None:
    whole, through = now.covariance, e.no_transition()
    packed, rates, force = whole, np.array([0.1, 0.2, -0.1]), np.array([1.0, -0.5, GRAVITY])
    at = now._replace(gyro_bias=np.zeros(3), force_bias=np.zeros(3))
    for _ in range(10):
        _, single = e.integrated(at, e.no_transition(), rates, force, STEP, GRAVITY)
        at, through = e.integrated(at, through, rates, force, STEP, GRAVITY)
        packed = e.propagated(packed, single, NOISE)
    bound = 2e-3 * np.sqrt(np.outer(*[np.diag(_full(packed))] * 2))
    assert np.all(abs(_full(e.propagated(whole, through, NOISE)) - _full(packed)) < bound)


def _readings(now: e.Estimate, at: e.Estimate) -> dict[str, tuple[e.Reading, Any]]:
    """Readings of a state, and the measured numbers, by numpy alone."""
    R, rates = _scipy(at.quaternion), np.array([0.3, -0.2, 0.5])
    point = at.position + R.apply(ARM)
    speed = at.velocity + R.apply(np.cross(rates - at.gyro_bias, ARM))
    variance = np.array([1e-4, 2e-4, 3e-4])
    seen = R.inv().apply(FIELD)
    return {
        "position": (e.position_reading(now, point, ARM, variance), point),
        "altitude": (e.altitude_reading(now, point[2:], ARM, variance[:1]), point[2:]),
        "velocity": (e.velocity_reading(now, speed, ARM, variance, rates), speed),
        "attitude": (e.attitude_reading(now, at.quaternion, variance), None),
        "direction": (e.direction_reading(now, seen, FIELD, variance), seen),
    }


@pytest.mark.parametrize("name", ["position", "altitude", "velocity", "attitude", "direction"])
def test_jacobians_of_readings(now: e.Estimate, name: str) -> None:
    """An innovation of a state that is away by small errors is the Jacobian times these."""
    expected = _numerical(lambda d: _readings(now, _moved(now, d))[name][0].innovation)
    assert_allclose(_readings(now, now)[name][0].innovation, 0.0, atol=1e-14)
    assert_allclose(_readings(now, now)[name][0].jacobian, expected, atol=1e-9)


@pytest.mark.parametrize("name", ["position", "altitude", "velocity", "attitude", "direction"])
def test_corrections_are_joseph_form_with_the_reset(now: e.Estimate, name: str) -> None:
    away = np.repeat([0.02, 0.1, -0.1, 0.002, 0.03], 3)
    reading = _readings(now, _moved(now, away))[name][0]
    found, seen = e.corrected(now, reading, np.inf)
    P, H, V = _full(now.covariance), reading.jacobian, np.diag(reading.variance)
    S = H @ P @ H.T + V
    K = P @ H.T @ np.linalg.inv(S)
    change = K @ reading.innovation
    rest = np.eye(e.ERRORS) - K @ H
    expected = _moved(now, change)
    # The derivative of the errors about the new state by the errors about the old one, as is.
    G = _numerical(lambda d: _difference(_moved(now, change + d), expected))
    joseph = G @ (rest @ P @ rest.T + K @ V @ K.T) @ G.T
    scale = np.sqrt(np.outer(np.diag(joseph), np.diag(joseph)))
    assert_allclose(_difference(found, expected), 0.0, atol=1e-9)
    assert_allclose(_full(found.covariance) / scale, joseph / scale, atol=2e-3)
    assert_allclose(seen.nis, reading.innovation @ np.linalg.solve(S, reading.innovation))
    assert_allclose(seen.deviation**2, np.diag(S))


def test_an_outlier_leaves_the_state(now: e.Estimate) -> None:
    reading = _readings(now, _moved(now, np.full(e.ERRORS, 0.5)))["position"][0]
    found, seen = e.corrected(now, reading, 3.0)
    assert seen.nis > 3.0
    assert seen.accepted == 0.0
    for kept, before in zip(found, now, strict=True):
        assert_allclose(kept, before, atol=1e-15)


def test_rotations() -> None:
    for angle in (0.0, 1e-9, 0.3, 1.0):
        vector = angle * np.array([2.0, -1.0, 2.0]) / 3.0
        q = e.quaternion_of_vector(vector)
        assert_allclose(_scipy(q).as_rotvec(), vector, atol=1e-7)
        assert_allclose(e.vector_of_quaternion(-q), vector, atol=2e-4)
