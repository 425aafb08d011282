"""Linear-quadratic regulation about the orbit of a moving gait.

The orbit is the vehicle's under a first regulator about the hover of each moment: it holds the
place as well as one that plans nothing ahead, and is one that the vehicle can fly (the projection
of Hauser 2002, "A projection operator approach to the optimization of trajectory functionals").
About it the errors obey ``x' = A(t) x + B(t) u`` with the period of the gait. Gains ``K = R^-1 B^T
P(t)`` come from the periodic Riccati equation (Bittanti, Colaneri and De Nicolao 1991, "The
periodic Riccati equation", in "The Riccati Equation", Springer), solved as a discrete one from node
to node of a table, backward until it repeats.
"""

from typing import Any, Final, NamedTuple

import numpy as np

from tiltsim_controllers.laws.lqr import BODY
from tiltsim_controllers.mathematics.attitude import rotation_matrix
from tiltsim_controllers.mathematics.scalar import Floats

LONGEST_STEP: Final = 0.005  # s, between two nodes
FEWEST_NODES: Final = 64
LONGEST_PERIOD: Final = 20.0  # s, for which a table of four rotors stays below 3 MB
ROUNDING: Final = 2.0  # lags of the rotors, to both sides, in which a rate is taken
SUBSTEPS: Final = 2  # of the integration between two nodes
TERMS: Final = 13  # of a power series, exact to rounding for matrices of norm 1/2
SWEEPS: Final = 1000
SETTLED: Final = 1e-13  # relative change of the Riccati equation's solution over a period
CLOSED: Final = 1e-11  # m, rad, N and so on, by which an orbit may miss itself


class PeriodicVehicle(NamedTuple):
    """A vehicle whose tilts follow a gait, at the nodes and between: ``SUBSTEPS`` steps, halved."""

    period: float  # s
    mass: float  # kg
    gravity: float  # m/s^2
    inertia: Floats  # kg m^2, shape (3, 3)
    gyroscopic: float  # 1 where the plant has gyroscopic torque, else 0
    lag: float  # 1/s, of the rotor speeds
    force: Floats  # of every rotor per newton, shape (nodes * 2 * SUBSTEPS, 3, N), body axes
    torque: Floats

    @property
    def nodes(self) -> int:
        """Their number in a period."""
        return len(self.force) // (2 * SUBSTEPS)

    @property
    def step(self) -> float:
        """Seconds between two nodes."""
        return self.period / self.nodes


class Regulator(NamedTuple):
    """Periodic gains about an orbit, at the nodes."""

    states: Floats  # position, velocity, roll, pitch, yaw, body rates, thrusts: (nodes, BODY + N)
    thrusts: Floats  # commanded, N, shape (nodes, N)
    gains: Floats  # shape (nodes, N, BODY + N)
    cost: Floats  # the solution of the Riccati equation, shape (nodes, BODY + N, BODY + N)
    transitions: Floats  # of the closed loop from node to node, of the same shape

    @property
    def multipliers(self) -> Floats:
        """Multipliers of the closed loop over a period, complex, the largest first."""
        eigenvalues = np.linalg.eigvals(_product(self.transitions)).astype(complex)
        return eigenvalues[np.argsort(-np.abs(eigenvalues), kind="stable")]

    @property
    def table(self) -> tuple[float, ...]:
        """Rows for `tiltsim_controllers.laws.lqr.lqr`; of several, the first again at the end."""
        count = len(self.states)
        rows = np.hstack([self.states, self.thrusts, self.gains.reshape(count, -1)])
        return tuple(np.vstack([rows, rows[: count > 1]]).ravel().tolist())


def node_count(period: float) -> int:
    """Nodes for a period (s): a multiple of eight, so that most gaits have their corners there."""
    return max(FEWEST_NODES, 8 * int(np.ceil(period / (8.0 * LONGEST_STEP) - 1e-9)))


def _turned(angles: Floats) -> Floats:
    """Rotations body to world of Euler angles, shape (..., 3, 3)."""
    return np.moveaxis(rotation_matrix(np.moveaxis(angles, -1, 0)), (0, 1), (-2, -1))


def _angle_rates(angles: Floats) -> Floats:
    """Matrices that make rates of the Euler angles of body rates, shape (..., 3, 3)."""
    sr, cr = np.sin(angles[..., 0]), np.cos(angles[..., 0])
    tp, cp = np.tan(angles[..., 1]), np.cos(angles[..., 1])
    one, zero = np.ones_like(sr), np.zeros_like(sr)
    rows = ((one, sr * tp, cr * tp), (zero, cr, -sr), (zero, sr / cp, cr / cp))
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def _across(vectors: Floats) -> Floats:
    """Matrices of the cross product with vectors, shape (..., 3, 3)."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    none = np.zeros_like(x)
    rows = ((none, -z, y), (z, none, -x), (-y, x, none))
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def _times(matrices: Floats, vectors: Floats) -> Floats:
    """Products, one by one."""
    return np.asarray((matrices @ vectors[..., np.newaxis])[..., 0])


def _product(transitions: Floats) -> Floats:
    """Product of transitions over a period, the first applied first."""
    whole = np.eye(transitions.shape[-1])
    for transition in transitions:
        whole = transition @ whole
    return whole


def _exponentials(matrices: Floats) -> Floats:
    """Exponentials of small matrices by scaling and squaring; scipy's starts threads of BLAS."""
    halvings = max(0, int(np.ceil(np.log2(np.abs(matrices).sum(axis=-1).max()))) + 1)
    scaled, unit = matrices / 2.0**halvings, np.eye(matrices.shape[-1])
    whole = np.broadcast_to(unit, matrices.shape)
    for term in range(TERMS, 0, -1):
        whole = unit + scaled @ whole / term
    for _ in range(halvings):
        whole = whole @ whole
    return whole


def _rates(vehicle: PeriodicVehicle, states: Floats, thrusts: Floats, at: Any) -> Floats:
    """Rates of states under commanded thrusts at tilts of these indices; one in each row."""
    pushed, angles, omega = states[:, BODY:], states[:, 6:9], states[:, 9:12]
    acceleration = _times(_turned(angles), _times(vehicle.force[at], pushed)) / vehicle.mass
    acceleration[:, 2] -= vehicle.gravity
    torque = _times(vehicle.torque[at], pushed)
    torque -= vehicle.gyroscopic * np.cross(omega, omega @ vehicle.inertia)
    # Speeds follow with the lag; the thrusts are as their squares.
    follow = 2.0 * vehicle.lag * (np.sign(pushed) * np.sqrt(pushed * thrusts) - pushed)
    turning = np.linalg.solve(vehicle.inertia, torque.T).T
    rates = (states[:, 3:6], acceleration, _times(_angle_rates(angles), omega), turning, follow)
    return np.hstack(rates)


def _errors(states: Floats, orbit: Floats) -> Floats:
    """Errors as the law has them."""
    errors = states - orbit
    back = np.swapaxes(_turned(orbit[:, 6:9]), 1, 2) @ _turned(states[:, 6:9])
    skew = 0.5 * (back - np.swapaxes(back, 1, 2))
    errors[:, 6:9] = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)
    return errors


def linear_orbit(
    vehicle: PeriodicVehicle, states: Floats, thrusts: Floats
) -> tuple[Floats, Floats]:
    """Matrices A, shape (nodes, BODY + N, BODY + N), and B at the nodes of an orbit.

    The attitude's error is a small turn about the body axes, as of `attitude_error`.
    """
    force, torque = vehicle.force[:: 2 * SUBSTEPS], vehicle.torque[:: 2 * SUBSTEPS]
    nodes, rotors = thrusts.shape
    pushed, omega = states[:, BODY:], states[:, 9:12]
    rotation = _turned(states[:, 6:9])
    a = np.zeros((nodes, BODY + rotors, BODY + rotors))
    b = np.zeros((nodes, BODY + rotors, rotors))
    a[:, 0:3, 3:6] = a[:, 6:9, 9:12] = np.eye(3)
    a[:, 3:6, 6:9] = -rotation @ _across(_times(force, pushed)) / vehicle.mass
    a[:, 3:6, BODY:] = rotation @ force / vehicle.mass
    a[:, 6:9, 6:9] = -_across(omega)
    gyroscopic = _across(omega) @ vehicle.inertia - _across(omega @ vehicle.inertia)
    a[:, 9:12, 9:12] = -vehicle.gyroscopic * np.linalg.solve(vehicle.inertia, gyroscopic)
    a[:, 9:12, BODY:] = np.linalg.solve(vehicle.inertia, torque)
    ratio, rotor = np.sqrt(thrusts / pushed), np.arange(rotors)
    a[:, BODY + rotor, BODY + rotor] = vehicle.lag * (ratio - 2.0)
    b[:, BODY + rotor, rotor] = vehicle.lag / ratio
    return a, b


def riccati(
    a: Floats, b: Floats, errors: Floats, changes: Floats, step: float
) -> tuple[Floats, Floats, Floats]:
    """Gains, solution of the periodic Riccati equation, and closed-loop transitions at the nodes.

    States and costates of ``x' = A x + B u`` with the cost ``x^T Q x + u^T R u`` obey linear
    equations. Their transition from a node to the next (exponential series of Magnus, fourth order)
    makes of the equation a discrete one.

    Args:
        a, b: at the nodes of a period, linear in between
        errors: acceptable, of each state; infinite ones have no weight
        changes: acceptable, of each input at each node
        step: between two nodes, s
    """
    from scipy.linalg import solve_continuous_are

    size = a.shape[-1]
    weight = b * changes[:, np.newaxis] ** 2  # B R^-1
    spread, state_cost = weight @ np.swapaxes(b, 1, 2), np.diag(errors**-2.0)
    whole = np.zeros((len(a), 2 * size, 2 * size))
    whole[:, :size, :size], whole[:, size:, size:] = a, -np.swapaxes(a, 1, 2)
    whole[:, :size, size:], whole[:, size:, :size] = -spread, -state_cost
    after = np.roll(whole, -1, axis=0)
    turn = whole @ after - after @ whole
    flow = _exponentials(0.5 * step * (whole + after) - step * step / 12.0 * turn)
    own, led = flow[:, :size, :size], flow[:, :size, size:]
    fed, back = flow[:, size:, :size], flow[:, size:, size:]
    start = b.mean(axis=0) * np.abs(changes).mean(axis=0)
    cost = solve_continuous_are(a.mean(axis=0), start, state_cost, np.eye(b.shape[-1]))
    costs = np.empty_like(a)
    for _ in range(SWEEPS):
        before = cost
        for node in reversed(range(len(a))):
            cost = np.linalg.solve(back[node] - cost @ led[node], cost @ own[node] - fed[node])
            cost = costs[node] = 0.5 * (cost + cost.T)
        if np.abs(cost - before).max() <= SETTLED * np.abs(cost).max():
            break
    return np.swapaxes(weight, 1, 2) @ costs, costs, own + led @ costs


def _flown(
    vehicle: PeriodicVehicle, starts: Floats, orbit: Floats, thrusts: Floats, gains: Floats
) -> Floats:
    """States a node later, of vehicles that start at each of the nodes under a law with a table."""
    after = [np.roll(values, -1, axis=0) for values in (orbit, thrusts, gains)]
    index: Any = 2 * SUBSTEPS * np.arange(vehicle.nodes)
    step, states = vehicle.step / SUBSTEPS, starts

    def rates(states: Floats, half: int) -> Floats:
        part = half / (2.0 * SUBSTEPS)
        tables = ((orbit, after[0]), (thrusts, after[1]), (gains, after[2]))
        near, level, gain = ((1.0 - part) * first + part * second for first, second in tables)
        command = level - _times(gain, _errors(states, near))
        return _rates(vehicle, states, command, (index + half) % len(vehicle.force))

    for substep in range(0, 2 * SUBSTEPS, 2):
        k1 = rates(states, substep)
        k2 = rates(states + 0.5 * step * k1, substep + 1)
        k3 = rates(states + 0.5 * step * k2, substep + 1)
        k4 = rates(states + step * k3, substep + 2)
        states = states + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return states


def _orbit(
    vehicle: PeriodicVehicle, desired: Floats, thrusts: Floats, gains: Floats, transitions: Floats
) -> Floats:
    """The orbit under a law with a table, at the nodes: Newton's method on all of them at once.

    Its derivatives are the transitions of the linear system, in Euler angles.

    Raises:
        ValueError: if it finds none.
    """
    states, size = desired, desired.shape[1]
    into, out = (np.broadcast_to(np.eye(size), transitions.shape).copy() for _ in range(2))
    into[:, 6:9, 6:9] = _angle_rates(desired[:, 6:9])
    out[:, 6:9, 6:9] = np.linalg.inv(into[:, 6:9, 6:9])
    moved = np.roll(into, -1, axis=0) @ transitions @ out
    back = np.linalg.inv(np.eye(size) - _product(moved))
    for _ in range(60):
        missed = _flown(vehicle, states, desired, thrusts, gains) - np.roll(states, -1, axis=0)
        if not np.isfinite(missed).all():
            break
        if np.abs(missed).max() <= CLOSED:
            return states
        change = np.zeros(size)
        for node in range(len(states)):
            change = moved[node] @ change + missed[node]
        change, changes = back @ change, []
        for node in range(len(states)):
            changes.append(change)
            change = moved[node] @ change + missed[node]
        states = states + np.array(changes)
    raise ValueError("no orbit")


def regulator_about_hover(
    vehicle: PeriodicVehicle, lean: Floats, hover: Floats, errors: Floats, share: float
) -> Regulator:
    """The hover of a vehicle with fixed tilts and the regulator about it, as one node.

    Args:
        vehicle: With its tilts, ``force`` and ``torque`` of shape (1, 3, N).
        lean, hover, errors, share: See `regulator_about_orbit`.
    """
    from scipy.linalg import solve_continuous_are

    states = np.zeros((1, BODY + hover.shape[1]))
    states[:, 6:8], states[:, BODY:] = lean, hover
    a, b = (matrices[0] for matrices in linear_orbit(vehicle, states, hover))
    weight = np.diag((share * np.abs(hover[0])) ** -2.0)
    cost = solve_continuous_are(a, b, np.diag(errors**-2.0), weight)
    gains = np.linalg.solve(weight, b.T @ cost)
    transitions = np.eye(len(a))  # of no time
    return Regulator(states, hover, gains[None], cost[None], transitions[None])


def regulator_about_orbit(
    vehicle: PeriodicVehicle, lean: Floats, hover: Floats, errors: Floats, share: float
) -> Regulator:
    """The orbit of a gait and the regulator about it.

    Args:
        vehicle: with the gait's tilts
        lean: roll and pitch (rad) of the hover of each node, shape (nodes, 2)
        hover: thrusts there, N, shape (nodes, N)
        errors: acceptable, of each state; infinite ones have no weight
        share: acceptable change of every thrust, as a part of that in hover

    Raises:
        ValueError: if no orbit is found, or none without a rotor that stops.
    """
    nodes, rotors = hover.shape
    changes = share * np.abs(hover)
    desired = np.zeros((nodes, BODY + rotors))
    desired[:, 6:8], desired[:, BODY:] = lean, hover
    # Over a few lags of the rotors: the lean's rate jumps where the tilts' do.
    span = max(1, round(ROUNDING / (vehicle.lag * vehicle.step)))
    ahead, behind = np.roll(lean, -span, axis=0), np.roll(lean, span, axis=0)
    swing = (ahead - behind) / (2.0 * span * vehicle.step)
    desired[:, 9:12] = np.linalg.solve(
        _angle_rates(desired[:, 6:9]), np.c_[swing, np.zeros(nodes)][..., np.newaxis]
    )[..., 0]
    with np.errstate(all="ignore"):
        first = riccati(*linear_orbit(vehicle, desired, hover), errors, changes, vehicle.step)
        states = _orbit(vehicle, desired, hover, first[0], first[2])
        thrusts = hover - _times(first[0], _errors(states, desired))
        if not ((thrusts * hover > 0.0).all() and (states[:, BODY:] * hover > 0.0).all()):
            raise ValueError("a rotor stops")
        last = riccati(*linear_orbit(vehicle, states, thrusts), errors, changes, vehicle.step)
    return Regulator(states, thrusts, *last)
