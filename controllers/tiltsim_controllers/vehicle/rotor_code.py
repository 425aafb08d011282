"""What layers around a control law ask of a vehicle's rotors, for any number of them.

Rotors on the cross have closed forms over a `Vehicle`; any others are read from tables, which are
fields of a record.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, Final, NamedTuple

from tiltsim_controllers.mathematics.records import make_record_type, vector_of
from tiltsim_controllers.mathematics.scalar import Octet, Quad, Triple, Values, scalar
from tiltsim_controllers.mathematics.vectors import (
    componentwise,
    tuple_text,
    vectors_of,
    written_out,
)
from tiltsim_controllers.vehicle.decoupling_matrix import (
    body_force,
    body_torque,
    sines_and_cosines,
    torque_entries,
    trigonometric_rates,
)
from tiltsim_controllers.vehicle.effectiveness import (
    ROTOR_FLOATS,
    SPIN_SIGN,
    VECTOR_FLOATS,
    Rotor,
    TiltOfRotor,
    effectiveness_of,
    tilts_of,
    turning_vectors_of,
)
from tiltsim_controllers.vehicle.multirotor import Body, inertia_times, inverse_inertia_times
from tiltsim_controllers.vehicle.parameters import Vehicle, drag_ratio


class RotorCode(NamedTuple):
    """Scalar functions of vehicles whose parameters are a ``vehicle``, of the type `record`.

    ``axes`` are thrust axes d_i in body axes, in a form that only these functions know.
    """

    record: Any
    body: Any  # the type of what `inertia` and `inverse` read of a vehicle
    heights: Callable[..., Values]
    """``(tilts, up, vehicle)``: of the rotors along a direction, from the body's centre, m."""
    lift: Callable[..., Values]
    """``(force, tilts, thrusts, gains, vehicle)``: a force (N), increased by that of shares
    ``gains`` of the rotors' thrusts, and their torque (N m) without drag. ``thrusts`` are controls,
    (rad/s)^2."""
    torque: Callable[..., Triple]  # (tilts, thrusts, vehicle): N m, of these controls, with drag
    pods: Callable[..., Triple]
    """``(inertias, rates, vehicle)``: sum of both and the unit vectors of the hinges, one a tilt:
    of tilt rates, the pods' own momentum."""
    axes: Callable[..., Any]  # (tilts, vehicle)
    turning: Callable[..., Any]  # (axes, tilt rates): the axes' rates, 1/s
    along: Callable[..., Triple]  # (axes, values): sum of values_i d_i
    on_hinges: Callable[..., Values]
    """``(axes, speeds, accelerations, omega)``: about each hinge along ``a``, the sum of ``varpi_i
    omega . d d_i / d alpha - varpi_i' a . d_i`` over its rotors, rad/s^2: the torque on the pod per
    unit of spin inertia."""
    inertia: Callable[..., Triple]  # (omega, vehicle): inertia times a vector
    inverse: Callable[..., Triple]  # (momentum, vehicle): its inverse times a vector


# --- four rotors on a cross ---------------------------------------------------------------------


@scalar
def _cross_heights(tilts: Values, up: Triple, vehicle: Vehicle) -> Quad:
    """Rotors lie along x, y, -x and -y."""
    arm = vehicle.arm_length
    return arm * up[0], arm * up[1], -arm * up[0], -arm * up[1]


@scalar
def _tilting_axes(tilts: Quad, vehicle: Vehicle) -> Octet:
    return sines_and_cosines(tilts[0], tilts[1], tilts[2], tilts[3])


@scalar
def _upright_axes(tilts: Values, vehicle: Vehicle) -> Octet:
    return 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0


@scalar
def _upright_turning(axes: Octet, tilt_rates: Values) -> Octet:
    return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0


@scalar
def sum_along_thrust_axes(trig: Octet, values: Quad) -> Triple:
    """``sum_i values_i d_i`` of rotors on the cross: of rotor speeds (rad/s), their momentum.

    ``trig`` are the `sines_and_cosines` of the tilt angles, or their rates for ``values_i d_i'``.
    """
    return body_force(trig, -values[0], values[1], -values[2], values[3])


@scalar
def _cross_on_hinges(trig: Octet, speeds: Quad, accelerations: Quad, omega: Triple) -> Quad:
    """The thrust axes are perpendicular to the hinges."""
    s1, c1, s2, c2, s3, c3, s4, c4 = trig
    p, q, r = omega
    return (
        -speeds[0] * (q * c1 + r * s1),
        -speeds[1] * (r * s2 - p * c2),
        -speeds[2] * (r * s3 - q * c3),
        -speeds[3] * (r * s4 + p * c4),
    )


@scalar
def _no_hinges(axes: Any, speeds: Values, accelerations: Values, omega: Triple) -> Values:
    return ()


@scalar
def _cross_inertia(omega: Triple, vehicle: Vehicle) -> Triple:
    return (
        vehicle.inertia_xx * omega[0],
        vehicle.inertia_yy * omega[1],
        vehicle.inertia_zz * omega[2],
    )


@scalar
def _cross_inverse(momentum: Triple, vehicle: Vehicle) -> Triple:
    return (
        momentum[0] / vehicle.inertia_xx,
        momentum[1] / vehicle.inertia_yy,
        momentum[2] / vehicle.inertia_zz,
    )


@cache
def _lift_of_cross(axes: Callable[..., Octet]) -> Callable[..., Values]:
    @scalar
    def lift(force: Triple, tilts: Values, thrusts: Quad, gains: Quad, vehicle: Vehicle) -> Values:
        fx, fy, fz = force
        arm, per_thrust = vehicle.arm_length, vehicle.thrust_coefficient
        t1 = per_thrust * thrusts[0] * gains[0]
        t2 = per_thrust * thrusts[1] * gains[1]
        t3 = per_thrust * thrusts[2] * gains[2]
        t4 = per_thrust * thrusts[3] * gains[3]
        s1, c1, s2, c2, s3, c3, s4, c4 = axes(tilts, vehicle)
        return (
            fx + t2 * s2 - t4 * s4,
            fy - t1 * s1 + t3 * s3,
            fz + t1 * c1 + t2 * c2 + t3 * c3 + t4 * c4,
            arm * (t2 * c2 - t4 * c4),
            arm * (t3 * c3 - t1 * c1),
            -arm * (t1 * s1 + t2 * s2 + t3 * s3 + t4 * s4),
        )

    return lift


@cache
def _torque_of_cross(axes: Callable[..., Octet]) -> Callable[..., Triple]:
    @scalar
    def torque(tilts: Values, thrusts: Quad, vehicle: Vehicle) -> Triple:
        per_torque = vehicle.arm_length * vehicle.thrust_coefficient
        # The controls are s varpi |varpi| with s = (-1, 1, -1, 1), the matrix's are without s.
        x, y, z = body_torque(
            torque_entries(axes(tilts, vehicle), drag_ratio(vehicle)),
            *(-thrusts[0], thrusts[1], -thrusts[2], thrusts[3]),
        )
        return per_torque * x, per_torque * y, per_torque * z

    return torque


@scalar
def _cross_pods(inertias: Quad, rates: Quad, vehicle: Vehicle) -> Triple:
    """The hinges lie along x, y, -x and -y, and the pods are alike."""
    inertia = inertias[0]
    return inertia * (rates[0] - rates[2]), inertia * (rates[1] - rates[3]), 0.0


@scalar
def _no_pods(inertias: Values, rates: Values, vehicle: Vehicle) -> Triple:
    return 0.0, 0.0, 0.0


TILTING_CROSS: Final = RotorCode(
    Vehicle,
    Vehicle,
    _cross_heights,
    _lift_of_cross(_tilting_axes),
    _torque_of_cross(_tilting_axes),
    _cross_pods,
    _tilting_axes,
    trigonometric_rates,
    sum_along_thrust_axes,
    _cross_on_hinges,
    _cross_inertia,
    _cross_inverse,
)
"""Four rotors on the cross that tilt about their arms."""

UPRIGHT_CROSS: Final = TILTING_CROSS._replace(
    lift=_lift_of_cross(_upright_axes),
    torque=_torque_of_cross(_upright_axes),
    pods=_no_pods,
    axes=_upright_axes,
    turning=_upright_turning,
    on_hinges=_no_hinges,
)
"""Four upright rotors on the cross."""


# --- any rotors ---------------------------------------------------------------------------------


class RotorlessBody(NamedTuple):
    """What `RotorCode.inertia` and `RotorCode.inverse` read of such a vehicle."""

    body: Body


@cache
def rotors_record(count: int, tilts: int) -> Any:
    """The type of the parameters of a vehicle with so many rotors and hinges."""
    return make_record_type(
        "Rotors",
        body=Body,
        effects=vector_of(ROTOR_FLOATS * count),  # see `effectiveness`
        places=vector_of(VECTOR_FLOATS * count),
        axes=vector_of(VECTOR_FLOATS * count),
        thrusts=vector_of(count),  # K_f of each, N s^2/rad^2
        hinges=vector_of(3 * tilts),  # unit vectors along them
        along_hinges=vector_of(count),  # of each rotor's thrust axis, its component along its hinge
    )


def rotors_of(body: Body, rotors: tuple[Rotor, ...]) -> Any:
    """The parameters of a vehicle."""
    hinges = {rotor.tilt: rotor.hinge_axis for rotor in rotors if rotor.tilt >= 0}
    return rotors_record(len(rotors), len(hinges))(
        body,
        tuple(entry for rotor in rotors for entry in rotor.entries),
        tuple(entry for rotor in rotors for entry in rotor.place_entries),
        tuple(entry for rotor in rotors for entry in rotor.axis_entries),
        tuple(rotor.thrust for rotor in rotors),
        tuple(entry for tilt in sorted(hinges) for entry in hinges[tilt]),
        tuple(rotor.along_hinge for rotor in rotors),
    )


@scalar
def _inertia(omega: Triple, rotors: Any) -> Triple:
    return inertia_times(rotors.body, omega)


@scalar
def _inverse(momentum: Triple, rotors: Any) -> Triple:
    return inverse_inertia_times(rotors.body, momentum)


@cache
def _torque_of(layout: TiltOfRotor) -> Callable[..., Triple]:
    wrench_of = effectiveness_of(layout).wrench
    squares = componentwise(
        "squares_of_thrusts",
        "thrusts, effects",
        f"effects[{ROTOR_FLOATS} * @ + {SPIN_SIGN}] * thrusts#",
        len(layout),
    )

    @scalar
    def torque(tilts: Values, thrusts: Values, rotors: Any) -> Triple:
        _, _, _, x, y, z = wrench_of(tilts, squares(thrusts, rotors.effects), rotors.effects, 0)
        return x, y, z

    return torque


@cache
def _pods_of(tilts: int) -> Callable[..., Triple]:
    sums = [
        " + ".join(f"a[{j}] * b[{j}] * h[{3 * j + k}]" for j in range(tilts)) or "0.0"
        for k in range(3)
    ]
    along_hinges = written_out(f"along_hinges_{tilts}", "a, b, h", tuple_text(sums))

    @scalar
    def pods(inertias: Values, rates: Values, rotors: Any) -> Triple:
        momentum: Triple = along_hinges(inertias, rates, rotors.hinges)
        return momentum

    return pods


@cache
def _on_hinges_of(layout: TiltOfRotor) -> Callable[..., Values]:
    name = "_".join(str(tilt) if tilt >= 0 else "f" for tilt in layout)
    on_each = componentwise(
        "on_each", "x, y, z, a, w, f, o",
        "w# * (x# * o[0] + y# * o[1] + z# * o[2]) - f# * a#", len(layout),
    )  # fmt: skip
    summed = written_out(
        f"by_hinge_{name}",
        "torques",
        tuple_text(
            " + ".join(f"torques[{i}]" for i, own in enumerate(layout) if own == tilt)
            for tilt in range(tilts_of(layout))
        ),
    )

    @scalar
    def on_hinges(
        axes: tuple[Values, ...], speeds: Values, accelerations: Values, omega: Triple
    ) -> Values:
        _, _, _, dx, dy, dz, along_hinges = axes
        torques: Values = summed(on_each(dx, dy, dz, along_hinges, speeds, accelerations, omega))
        return torques

    return on_hinges


@cache
def rotor_code_of(layout: TiltOfRotor) -> RotorCode:
    """The functions for any rotors of a layout."""
    count, code, vectors = len(layout), effectiveness_of(layout), turning_vectors_of(layout)
    cosines_of, sines_of = code.cosines, code.sines
    name = "_".join(str(tilt) if tilt >= 0 else "f" for tilt in layout)
    of_rotors = vectors_of(count)
    dot, product = of_rotors.dot, of_rotors.product
    negative = componentwise("negative", "values", "-values#", tilts_of(layout))
    upwards = componentwise("upwards", "x, y, z, up", "x# * up[0] + y# * up[1] + z# * up[2]", count)
    lifts = componentwise("lifts", "k, w, gains", "k# * w# * gains#", count)
    rates = [f"rates[{tilt}]" if tilt >= 0 else "0.0" for tilt in layout]
    turned = written_out(
        f"turned_{name}", "d, rates", tuple_text(f"d[{i}] * {rate}" for i, rate in enumerate(rates))
    )

    @scalar
    def heights(tilts: Values, up: Triple, rotors: Any) -> Values:
        x, y, z = vectors(1.0, cosines_of(tilts), sines_of(tilts), rotors.places, 0)
        above: Values = upwards(x, y, z, up)
        return above

    @scalar
    def lift(force: Triple, tilts: Values, thrusts: Values, gains: Values, rotors: Any) -> Values:
        cosines, sines = cosines_of(tilts), sines_of(tilts)
        px, py, pz = vectors(1.0, cosines, sines, rotors.places, 0)
        dx, dy, dz = vectors(1.0, cosines, sines, rotors.axes, 0)
        forces = lifts(rotors.thrusts, thrusts, gains)
        fx, fy, fz = product(forces, dx), product(forces, dy), product(forces, dz)
        return (
            force[0] + dot(forces, dx), force[1] + dot(forces, dy), force[2] + dot(forces, dz),
            dot(py, fz) - dot(pz, fy), dot(pz, fx) - dot(px, fz), dot(px, fy) - dot(py, fx),
        )  # fmt: skip

    @scalar
    def axes(tilts: Values, rotors: Any) -> tuple[Values, ...]:
        cosines, sines = cosines_of(tilts), sines_of(tilts)
        x, y, z = vectors(1.0, cosines, sines, rotors.axes, 0)
        # Their derivatives by the tilt angles.
        dx, dy, dz = vectors(0.0, negative(sines), cosines, rotors.axes, 0)
        return x, y, z, dx, dy, dz, rotors.along_hinges

    @scalar
    def turning(axes: tuple[Values, ...], tilt_rates: Values) -> tuple[Values, ...]:
        return turned(axes[3], tilt_rates), turned(axes[4], tilt_rates), turned(axes[5], tilt_rates)

    @scalar
    def along(axes: tuple[Values, ...], values: Values) -> Triple:
        return dot(axes[0], values), dot(axes[1], values), dot(axes[2], values)

    return RotorCode(
        rotors_record(count, tilts_of(layout)),
        RotorlessBody,
        heights,
        lift,
        _torque_of(layout),
        _pods_of(tilts_of(layout)),
        axes,
        turning,
        along,
        _on_hinges_of(layout),
        _inertia,
        _inverse,
    )
