"""Full-pose control of any multirotor, with the tilt angles as inputs (ch. 3, Sec. 6.3).

`tiltsim_controllers.laws.full_pose` is the case of the tiltrotor: its outputs, gains, limits and
norm are those here. Of N rotors and M tilts the inputs are the rates of ``w_i = varpi_i |varpi_i|``
and of the tilt angles; of all that give position and attitude their desired third derivatives,
those of least norm are taken. A rotor that is known to have failed is left out of the matrix, and
with it what its tilt would move.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from tiltsim_controllers.gaits.parameters import NO_KNOTS
from tiltsim_controllers.laws.failures import Failure, health_of, masked_of
from tiltsim_controllers.laws.force_directions import factors_of
from tiltsim_controllers.laws.full_pose import Gains, Limits, desired_jerks, limited_tilt_rate
from tiltsim_controllers.laws.least_norm import nearest_of
from tiltsim_controllers.laws.multirotor_inputs import rotor_acceleration
from tiltsim_controllers.mathematics.rotation import rotation_from_euler, to_body, to_world
from tiltsim_controllers.mathematics.scalar import Triple, Values, Vector, scalar
from tiltsim_controllers.mathematics.vectors import (
    componentwise,
    entries_of,
    tuple_text,
    vectors_of,
    written_out,
)
from tiltsim_controllers.references.trajectories import ReferenceParameters
from tiltsim_controllers.vehicle.effectiveness import (
    Rows,
    TiltOfRotor,
    effectiveness_of,
    tilt_of_rotor,
    tilts_of,
)
from tiltsim_controllers.vehicle.multirotor import Body, body_acceleration, inertia_times
from tiltsim_controllers.vehicle.rigid_body import cross
from tiltsim_controllers.vehicle.states import PITCH, ROLL, YAW, P, Q, R

UP = (0.0, 0.0, 1.0)


class Parameters(NamedTuple):
    """Parameters of the controller."""

    vehicle: Body
    gains: Gains
    reference: ReferenceParameters
    limits: Limits
    tilt_weight: float  # (rad/s)^2/rad: the norm is that of (w', tilt_weight alpha')
    rotors: float  # where in the knots the table of the rotors begins
    failure: Failure = Failure()


@cache
def pose_rows_of(layout: TiltOfRotor) -> Callable[..., Rows]:
    """Scalar code ``(rows, turned, w)``: force and torque per rate of every input, body axes.

    Columns are those of the rates of ``w``, then of the tilts; ``rows`` are F and tau, ``turned``
    their derivatives by the tilt of each rotor.
    """
    moved = [
        " + ".join(f"turned[{{0}}][{i}] * w[{i}]" for i in range(len(layout)) if layout[i] == tilt)
        for tilt in range(tilts_of(layout))
    ]
    whole = (tuple_text(text.format(k) for text in (f"*rows[{k}]", *moved)) for k in range(6))
    name = "_".join(str(tilt) if tilt >= 0 else "f" for tilt in layout)
    rows: Callable[..., Rows] = written_out(
        f"pose_rows_{name}", "rows, turned, w", tuple_text(whole)
    )
    return rows


def pose_rank(table: Sequence[float], tilts: Sequence[float], w: ArrayLike) -> int:
    """How many of the six outputs the inputs move independently.

    Args:
        table: of the rotors
        tilts: rad
        w: ``varpi |varpi|`` of each rotor, of any unit, 0 for one that is not used
    """
    functions, squares = effectiveness_of(tilt_of_rotor(table)), np.asarray(w, float)
    c, s = functions.cosines(tilts), functions.sines(tilts)
    rows = np.array(functions.rows(1.0, c, s, table, 0)) * (squares != 0.0)
    turned = functions.rows(0.0, [-sine for sine in s], c, table, 0)
    whole = np.array(pose_rows_of(tilt_of_rotor(table))(rows, turned, squares))
    sizes = np.abs(whole[:3]).max(), np.abs(whole[3:]).max()
    return int(np.linalg.matrix_rank(whole / np.repeat(sizes, 3)[:, np.newaxis], 1e-8))


@cache
def full_pose_law_of(layout: TiltOfRotor) -> Callable[..., Values]:
    """The control law of vehicles of a layout: scalar code ``(time, state, parameters, knots)``.

    ``state`` has twelve numbers of the body (`tiltsim_controllers.vehicle.states.BODY_FIELDS`), the
    tilt angles (rad) and the rotor speeds (rad/s, signed). It returns the rotor accelerations
    (rad/s^2) and the tilt rates (rad/s); NaN where position and attitude depend on each other, and
    for a rotor at rest.
    """
    length, tilts = len(layout), tilts_of(layout)
    tilts_in, speeds_in = entries_of(12, tilts), entries_of(12 + tilts, length)
    cosines, sines, effect, squares, _ = effectiveness_of(layout)
    dot, _, _, product, _ = vectors_of(length)
    pose_rows, health, masked = pose_rows_of(layout), health_of(length), masked_of(length)
    factors, nearest = factors_of(length + tilts, 3), nearest_of(length + tilts, 6)
    negated = componentwise("negated", "a", "-a#", tilts)
    shared = componentwise("shared", "a, f", "a# / f", length)
    nothing = (0.0,) * (length + tilts)
    accelerations_of = componentwise(
        "accelerations", "rates, speeds", "acceleration(rates#, speeds#, 0.0)", length,
        acceleration=rotor_acceleration,
    )  # fmt: skip
    tilt_rates_of = componentwise(
        "limited_tilt_rates",
        "rates, weight, tilts, limits",
        f"limited(rates[{length} + @] / weight, tilts#, limits)",
        tilts,
        limited=limited_tilt_rate,
    )

    @scalar
    def solved(rows: Rows, torque_rate: Triple, force_rate: Triple) -> Values:
        _, pushes, units, _ = factors(rows, (rows[0], rows[1], rows[2]), UP)
        whole, desired = (rows[3], rows[4], rows[5], *pushes), (*torque_rate, *force_rate)
        # The second pass removes rounding, as the published weight needs it.
        return nearest(nearest(nothing, whole, units, desired), whole, units, desired)

    @scalar
    def inputs(
        time: float, state: Values, parameters: Parameters, knots: Vector = NO_KNOTS
    ) -> Values:
        body, at, weight = parameters.vehicle, int(parameters.rotors), parameters.tilt_weight
        angles, speeds, omega = tilts_in(state), speeds_in(state), (state[P], state[Q], state[R])
        c, s = cosines(angles), sines(angles)
        works = health(time, parameters.failure)
        w = product(works, squares(speeds))
        rows = masked(works, effect(1.0, c, s, knots, at))
        turned = effect(0.0, negated(s), c, knots, at)

        # Second derivatives from the model, ch. 3, Eqs. (1) and (4), without gyroscopic torque.
        rotation = rotation_from_euler(state[ROLL], state[PITCH], state[YAW])
        force = (dot(rows[0], w), dot(rows[1], w), dot(rows[2], w))
        torque = (dot(rows[3], w), dot(rows[4], w), dot(rows[5], w))
        ax, ay, az = to_world(rotation, force)
        linear = (ax / body.mass, ay / body.mass, az / body.mass - body.gravity)
        present = linear, body_acceleration(body, torque, omega, 0.0)
        jerk, angular_jerk = desired_jerks(time, state, rotation, present, parameters, knots)

        # In body axes: what the force's turning with the body leaves to the inputs.
        mass = body.mass
        jx, jy, jz = to_body(rotation, (mass * jerk[0], mass * jerk[1], mass * jerk[2]))
        x, y, z = cross(omega, force)
        # The columns of weighted tilt rates are those of tilt rates divided by the weight.
        rates = solved(
            pose_rows(rows, turned, shared(w, weight)),
            inertia_times(body, angular_jerk),
            (jx - x, jy - y, jz - z),
        )
        tilt_rates = tilt_rates_of(rates, weight, angles, parameters.limits)
        return (*accelerations_of(rates, speeds), *tilt_rates)

    return inputs
