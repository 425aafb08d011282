"""Linear-quadratic regulation about hover with fixed tilts.

In the axes of the body at hover, the errors of position, velocity and attitude, the body rates and
the deviations of the thrusts obey ``x' = A x + B u``, the thrusts following their commands ``u``
with a lag of first order. Anderson and Moore (1990), "Optimal Control", ch. 3; gains ``K`` from the
algebraic Riccati equation, weights by Bryson's rule: one over the square of what is acceptable.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim_controllers.laws.full_pose import attitude_error
from tiltsim_controllers.laws.geometric import Commands
from tiltsim_controllers.laws.observed import Observed
from tiltsim_controllers.laws.outer_loop import tracking_errors
from tiltsim_controllers.mathematics.rotation import rotation_from_euler, to_body
from tiltsim_controllers.mathematics.scalar import scalar
from tiltsim_controllers.mathematics.vectors import componentwise, vectors_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from tiltsim_controllers.mathematics.scalar import Floats

BODY: Final = 12
"""States before the thrusts."""


def linear_hover(
    force: ArrayLike, torque: ArrayLike, mass: float, inertia: ArrayLike, up: Floats, lag: float
) -> tuple[Floats, Floats]:
    """The matrices A and B.

    Args:
        force, torque: of every rotor per newton, shape (3, N), body axes
        mass: kg
        inertia: kg m^2, shape (3, 3)
        up: gravity, upward, in the body's axes at hover, m/s^2
        lag: of the thrusts, 1/s
    """
    force, torque = np.asarray(force, float), np.asarray(torque, float)
    size, rotors = BODY + force.shape[1], force.shape[1]
    x, y, z = up
    a, b = np.zeros((size, size)), np.zeros((size, rotors))
    a[0:3, 3:6] = a[6:9, 9:12] = np.eye(3)
    a[3:6, 6:9] = -np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])  # the attitude x up
    a[3:6, BODY:] = force / mass
    a[9:12, BODY:] = np.linalg.solve(np.asarray(inertia, float), torque)
    a[BODY:, BODY:] = -lag * np.eye(rotors)
    b[BODY:] = lag * np.eye(rotors)
    return a, b


def regulator(a: Floats, b: Floats, errors: Floats, inputs: Floats) -> tuple[Floats, Floats]:
    """Gains K, shape (N, states), and the solution of the Riccati equation.

    Args:
        a, b: of the system
        errors: acceptable, of each state; infinite ones have no weight
        inputs: acceptable changes
    """
    from scipy.linalg import solve_continuous_are

    weight = np.diag(inputs**-2.0)
    cost = solve_continuous_are(a, b, np.diag(errors**-2.0), weight)
    return np.linalg.solve(weight, b.T @ cost), cost


@cache
def lqr_law_of(rotors: int) -> Callable[..., Commands]:
    """The law of vehicles with this many rotors.

    Its parameters have the fields ``roll``, ``pitch`` (of hover, rad), ``thrusts`` (of hover, N)
    and ``gains``, row by row.
    """
    size = BODY + rotors
    less = vectors_of(rotors).add_scaled
    products = " - ".join(f"k[@ * {size} + {j}] * x[{j}]" for j in range(size))
    fed_back = componentwise("regulated", "hover, k, x", f"hover# - {products}", rotors)

    @scalar
    def lqr(observed: Observed, parameters: Any) -> Commands:
        yaw = observed.reference.attitude[2]
        hover = rotation_from_euler(parameters.roll, parameters.pitch, yaw)
        error, speed = tracking_errors(observed)
        ex, ey, ez = to_body(hover, error)
        vx, vy, vz = to_body(hover, speed)
        rx, ry, rz = attitude_error(observed.rotation, hover)
        level = parameters.thrusts
        x = (
            -ex, -ey, -ez, -vx, -vy, -vz, -rx, -ry, -rz,
            *observed.body_rates,
            *less(observed.thrusts, -1.0, level),
        )  # fmt: skip
        return fed_back(level, parameters.gains, x), (), ()

    return lqr
