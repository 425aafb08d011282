"""The regulator about an orbit, against precise integration of the equations that it solves."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from tests.controllers.multirotors import tiltrotor
from tiltsim_controllers.laws.periodic_lqr import (
    SUBSTEPS,
    PeriodicVehicle,
    _angle_rates,
    _turned,
    regulator_about_orbit,
    riccati,
)
from tiltsim_controllers.vehicle.rotors import force_and_torque, table_per_newton

PERIOD, NODES = 0.8, 320
INERTIA = np.array([[3.0e-3, 2.0e-4, -3.0e-4], [2.0e-4, 4.0e-3, 1.0e-4], [-3.0e-4, 1.0e-4, 5.0e-3]])
ERRORS = np.r_[np.repeat([0.5, 1.0, 0.3, 3.0], 3), np.full(4, np.inf)]


def precise(rates, start, duration):
    """The state after a duration."""
    found = solve_ivp(rates, (0.0, duration), start, method="DOP853", rtol=1e-12, atol=1e-13)
    return found.y[:, -1]


def test_gains_solve_the_periodic_riccati_equation():
    """``-P' = A^T P + P A - P B R^-1 B^T P + Q``, backward over a period, ends where it began."""
    nodes, step, phase = 64, 0.05, 2.0 * np.pi * np.arange(64) / 64
    a = np.zeros((nodes, 2, 2))
    a[:, 0, 1] = 1.0
    a[:, 1, 0] = 1.5 + np.sin(phase)  # upright pendulum with a moving pivot
    a[:, 1, 1] = -0.2 * np.cos(phase)
    b = np.tile([[0.0], [1.0]], (nodes, 1, 1))
    errors, changes = np.array([0.5, np.inf]), np.full((nodes, 1), 2.0)
    gains, costs, transitions = riccati(a, b, errors, changes, step)
    weight = 4.0 * b[0] @ b[0].T
    state_cost = np.diag([4.0, 0.0])

    def system(time):
        place = time / step
        node, part = int(place // 1) % nodes, place % 1.0
        return (1.0 - part) * a[node] + part * a[(node + 1) % nodes]

    def backward(back, flat, node):
        cost, now = flat.reshape(2, 2), system((node + 1) * step - back)
        return (now.T @ cost + cost @ now - cost @ weight @ cost + state_cost).ravel()

    # The last node's successor is the first: only a periodic solution passes from one to the other.
    for node in (0, 13, 40, nodes - 1):
        after = costs[(node + 1) % nodes].ravel()
        found = precise(partial(backward, node=node), after, step).reshape(2, 2)
        np.testing.assert_allclose(found, costs[node], rtol=1e-7)
        np.testing.assert_allclose(gains[node], 4.0 * b[node].T @ costs[node], rtol=1e-12)

    def closed(time, flat, node):
        now = system(node * step + time)
        before, after = costs[node], costs[(node + 1) % nodes]
        cost = before + time / step * (after - before)
        return ((now - weight @ cost) @ flat.reshape(2, 2)).ravel()

    found = precise(partial(closed, node=7), np.eye(2).ravel(), step)
    np.testing.assert_allclose(found.reshape(2, 2), transitions[7], atol=1e-4)


@pytest.fixture(scope="module")
def regulated():
    """A vehicle that leans far in all directions, and the regulator about its orbit."""
    table = table_per_newton(tiltrotor().table, [8.048e-6] * 4)
    places = 2 * SUBSTEPS * NODES
    phase = 2.0 * np.pi * np.arange(places) / places
    swings = [0.12 * (-1) ** i * np.sin(phase + 0.4 * i) for i in range(4)]
    tilts = np.array([0.35, -0.35, -0.35, 0.35]) + np.transpose(swings)
    force, torque = force_and_torque(table, tilts)
    lean, hover = [], []
    for node in range(0, places, 2 * SUBSTEPS):
        free = np.linalg.svd(torque[node])[2][3]
        push = force[node] @ free
        scale = 0.5 * 9.8 / np.linalg.norm(push) * np.sign(push[2])
        x, y, z = push * scale
        # World up in body axes is (-sin pitch, sin roll cos pitch, cos roll cos pitch).
        lean.append((np.arctan2(y, z), -np.arcsin(x / np.linalg.norm((x, y, z)))))
        hover.append(scale * free)
    vehicle = PeriodicVehicle(PERIOD, 0.5, 9.8, INERTIA, 1.0, 60.0, force, torque)
    lean, hover = np.array(lean), np.array(hover)
    return vehicle, lean, hover, regulator_about_orbit(vehicle, lean, hover, ERRORS, 0.3)


def test_an_orbit_is_flown_by_its_own_thrusts(regulated):
    """From node to node, with a rotation matrix instead of Euler angles."""
    vehicle, lean, _, regulator = regulated
    assert np.abs(lean).max() > 0.2
    states, thrusts = regulator.states, regulator.thrusts
    for node in range(0, NODES, 20):
        after, first = (node + 1) % NODES, 2 * SUBSTEPS * node

        def tables(time, node=node, after=after, first=first):
            """Thrusts linear between nodes; force and torque quadratic through three samples."""
            part = time / vehicle.step
            place = 2.0 * SUBSTEPS * part
            middle = (first + SUBSTEPS) % len(vehicle.force)
            ends = (first, middle, (first + 2 * SUBSTEPS) % len(vehicle.force))
            s = place / SUBSTEPS - 1.0
            shares = 0.5 * s * (s - 1.0), 1.0 - s * s, 0.5 * s * (s + 1.0)
            force = sum(k * vehicle.force[end] for k, end in zip(shares, ends, strict=True))
            torque = sum(k * vehicle.torque[end] for k, end in zip(shares, ends, strict=True))
            return (1.0 - part) * thrusts[node] + part * thrusts[after], force, torque

        def rates(time, x):
            command, force, torque = tables(time)
            rotation, omega, pushed = x[6:15].reshape(3, 3), x[15:18], x[18:]
            acceleration = rotation @ force @ pushed / vehicle.mass - (0.0, 0.0, vehicle.gravity)
            gyroscopic = np.cross(omega, INERTIA @ omega)
            turning = np.linalg.solve(INERTIA, torque @ pushed - gyroscopic)
            speeds = np.sqrt(np.abs(pushed))
            lagging = vehicle.lag * (np.sqrt(np.abs(command)) - speeds)
            spun = rotation @ np.cross(np.eye(3), omega)
            return np.r_[
                x[3:6],
                acceleration,
                spun.ravel(),
                turning,
                2.0 * np.sign(pushed) * speeds * lagging,
            ]

        state = states[node]
        rotation = Rotation.from_euler("ZYX", state[8:5:-1]).as_matrix()
        found = precise(rates, np.r_[state[:6], rotation.ravel(), state[9:]], vehicle.step)
        angles = Rotation.from_matrix(found[6:15].reshape(3, 3)).as_euler("ZYX")[::-1]
        flown = np.r_[found[:6], angles, found[15:]]
        # The thrusts of the orbit are not quite linear between nodes: an error of second order.
        np.testing.assert_allclose(flown, states[after], rtol=0.0, atol=5e-6)


def test_the_orbit_follows_the_lean_of_hover(regulated):
    """With less than half of its swing missing, as the lean's rate is part of the desired state."""
    _, lean, _, regulator = regulated
    swing = np.ptp(lean, axis=0).max()
    assert np.abs(regulator.states[:, 6:8] - lean).max() < 0.5 * swing
    assert np.abs(regulator.states[:, :3]).max() < 0.02


def test_euler_angles_match_scipy():
    angles, rates = np.random.default_rng(6).uniform(-1.2, 1.2, (2, 5, 3))
    rotations = Rotation.from_euler("ZYX", angles[:, ::-1])
    np.testing.assert_allclose(_turned(angles), rotations.as_matrix(), atol=1e-14)
    h = 1e-6
    ends = [(rotations * Rotation.from_rotvec(side * rates)).as_euler("ZYX") for side in (h, -h)]
    expected = (ends[0] - ends[1])[:, ::-1] / (2.0 * h)
    found = np.einsum("nij,nj->ni", _angle_rates(angles), rates)
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-8)
