"""Linear-quadratic regulation about hover with fixed tilts, or about the orbit of a moving gait.

The errors of position, velocity and attitude, the body rates and the deviations of the thrusts obey
``x' = A x + B u``, the thrusts following their commands ``u`` with a lag of first order. Anderson
and Moore (1990), "Optimal Control", ch. 3; gains ``K`` from the Riccati equation
(`tiltsim_controllers.laws.periodic_lqr`), weights by Bryson's rule: one over the square of an
acceptable value.
"""

from typing import Any, Final, Literal, NamedTuple

from pydantic import Field

from tiltsim_controllers.code.arrays import take_row, xp
from tiltsim_controllers.laws.keys import Keys, NonNegative, Positive, default, required
from tiltsim_controllers.laws.observed import Command, Observed
from tiltsim_controllers.laws.outer_loop import UP, pointing_attitude, tracking_errors
from tiltsim_controllers.mathematics.attitude import attitude_error, rotation_matrix
from tiltsim_controllers.mathematics.linear import norm

BODY: Final = 12
"""States before the thrusts."""


class Lqr(Keys):
    """Keys of the design."""

    law: Literal["lqr"] = required(
        "linear-quadratic regulator about hover with fixed tilts, or with gains that repeat with "
        "a moving gait about its orbit; weights are one over the square of an acceptable "
        "deviation (Bryson's rule)"
    )
    position_error: Positive = default(0.5, "acceptable [m]")
    velocity_error: Positive = default(1.0, "acceptable [m/s]")
    attitude_error: Positive = default(0.3, "acceptable [rad]")
    rate_error: Positive = default(3.0, "acceptable [rad/s]")
    thrust_change: NonNegative = Field(
        0.3, gt=0.0, description="acceptable, of every rotor, as a part of its thrust in hover [-]"
    )


class Parameters(NamedTuple):
    """Parameters of the law beside its table."""

    period: float = 1.0  # s, of the table


def lqr(observed: Observed, p: Parameters) -> Command:
    """The law.

    Its table has a row for each node of a period, linear in between, the first again at the end, or
    a single row: states, thrusts (N, shape (N,)) and gains, shape (N, BODY + N), row by row. States
    are position, velocity (axes of the world but for the yaw), roll, pitch, yaw, body rates and
    thrusts.
    """
    yaw = observed.reference.attitude[2]
    states, thrusts, gains = _row_now(observed, p)
    desired = rotation_matrix(states[6:9] + yaw * xp.array([0.0, 0.0, 1.0]))
    return _regulated(observed, states, thrusts, gains, desired)


def lqr_along(observed: Observed, p: Parameters) -> Command:
    """The law about the attitude and the thrusts of the reference's acceleration."""
    a = observed.reference.acceleration
    states, thrusts, gains = _row_now(observed, p)
    g = observed.vehicle.gravity
    more = norm(a + g * xp.array(UP)) / g
    desired = pointing_attitude(observed, a, observed.force @ thrusts)
    states = xp.hstack([states[:BODY], more * states[BODY:]])
    return _regulated(observed, states, more * thrusts, gains, desired)


def _regulated(observed: Observed, states: Any, thrusts: Any, gains: Any, desired: Any) -> Command:
    """Thrusts that return to states and to an attitude, given the gains in one row."""
    N, yaw = len(thrusts), observed.reference.attitude[2]
    heading = rotation_matrix(xp.array([0.0, 0.0, yaw]))
    error, speed = tracking_errors(observed)
    deviation = xp.hstack(
        [
            -heading.T @ error - states[0:3],
            -heading.T @ speed - states[3:6],
            -attitude_error(observed.rotation, desired),
            observed.body_rates - states[9:BODY],
            observed.thrusts - states[BODY:],
        ]
    )
    return Command(thrusts=thrusts - gains.reshape(N, -1) @ deviation)


def _row_now(observed: Observed, p: Parameters) -> tuple[Any, Any, Any]:
    """States, thrusts (N) and gains of the table at the present time, shapes as in `lqr`."""
    N = len(observed.thrusts)
    width = (BODY + N) * (N + 1) + N
    nodes = len(observed.table) // width - 1
    if nodes == 0:
        row = xp.array(observed.table)
    else:
        turns = observed.time / p.period
        place = (turns - xp.floor(turns)) * nodes
        node = xp.minimum(xp.floor(place), nodes - 1.0)
        first, second = (take_row(observed.table, node + k, width) for k in (0.0, 1.0))
        row = first + (place - node) * (second - first)
    return row[: BODY + N], row[BODY + N : BODY + 2 * N], row[BODY + 2 * N :]
