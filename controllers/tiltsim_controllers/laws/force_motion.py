"""Motion of the torque-free force, of the attitude that points it, and of the body's acceleration.

The derivatives by which gait feed-forward improves on `tiltsim_controllers.laws.decouplers`, which
treats the gait and all references as constant.
"""

from __future__ import annotations

from math import atan2, nan, sqrt

from tiltsim_controllers.mathematics.jets import (
    Jet,
    Jets3,
    Jets4,
    jet_angle,
    jet_cosine,
    jet_product,
    jet_quotient,
    jet_scaled,
    jet_sine,
    jet_square_root,
    jet_sum,
)
from tiltsim_controllers.mathematics.scalar import Triple, scalar
from tiltsim_controllers.vehicle.rigid_body import cross


@scalar
def torque_free_force_jet(tilts: Jets4, drag_ratio: float) -> Jets3:
    """`tiltsim_controllers.vehicle.decoupling_matrix.torque_free_force` of moving tilt angles.

    Written in the sums and differences of opposite angles, with which the products of ch. 3 reduce
    to ``n_x = -sin(a2 - a4) A / 2r`` and the like. Angles in rad; ``drag_ratio`` is
    ``r = K_m / (L K_f)``.
    """
    alpha_1, alpha_2, alpha_3, alpha_4 = tilts
    sum_13, sum_24 = jet_sum(1.0, alpha_1, 1.0, alpha_3), jet_sum(1.0, alpha_2, 1.0, alpha_4)
    gap_13, gap_24 = jet_sum(1.0, alpha_1, -1.0, alpha_3), jet_sum(1.0, alpha_2, -1.0, alpha_4)
    sin_13, cos_13 = jet_sine(sum_13), jet_cosine(sum_13)
    sin_24, cos_24 = jet_sine(sum_24), jet_cosine(sum_24)
    r = drag_ratio
    # Yaw torque of each pair per unit of its inputs without roll or pitch torque, over -2r.
    yaw_13 = jet_sum(0.5 * (1.0 / r - r), sin_13, -1.0, cos_13)
    yaw_24 = jet_sum(0.5 * (r - 1.0 / r), sin_24, -1.0, cos_24)
    lift_13 = jet_sum(1.0, jet_sum(1.0, cos_13, 1.0, jet_cosine(gap_13)), r, sin_13)
    lift_24 = jet_sum(1.0, jet_sum(1.0, cos_24, 1.0, jet_cosine(gap_24)), -r, sin_24)
    return (
        jet_product(jet_scaled(-1.0, jet_sine(gap_24)), yaw_13),
        jet_product(jet_sine(gap_13), yaw_24),
        jet_sum(-1.0, jet_product(lift_13, yaw_24), -1.0, jet_product(lift_24, yaw_13)),
    )


@scalar
def exact_decoupler_jet(ax: Jet, ay: Jet, lift: Jet, yaw: Jet, force: Jets3) -> tuple[Jet, Jet]:
    """`tiltsim_controllers.laws.decouplers.exact_decoupler` of moving arguments.

    Args:
        ax, ay, lift: desired horizontal acceleration and ``g + az``, m/s^2
        yaw: rad
        force: the torque-free force, of arbitrary unit

    Returns:
        Roll and pitch, rad: at rest where no roll reaches the desired direction and the nearest one
        is returned, NaN where the force has neither a lateral nor a vertical part or the desired
        acceleration is that of free fall.
    """
    nx, ny, nz = force
    sin_yaw, cos_yaw = jet_sine(yaw), jet_cosine(yaw)
    dx = jet_sum(1.0, jet_product(ax, cos_yaw), 1.0, jet_product(ay, sin_yaw))
    dy = jet_sum(1.0, jet_product(ay, cos_yaw), -1.0, jet_product(ax, sin_yaw))
    side = 1.0 if nz[0] >= 0.0 else -1.0
    nx, ny, nz = jet_scaled(side, nx), jet_scaled(side, ny), jet_scaled(side, nz)
    across = jet_sum(1.0, jet_product(ny, ny), 1.0, jet_product(nz, nz))
    if across[0] == 0.0:
        return (nan, nan, nan), (nan, nan, nan)
    desired = jet_sum(1.0, jet_product(dx, dx), 1.0, jet_product(lift, lift))
    square = jet_sum(1.0, across, 1.0, jet_product(nx, nx))
    length = jet_sum(1.0, desired, 1.0, jet_product(dy, dy))
    if length[0] == 0.0:
        return (nan, nan, nan), (nan, nan, nan)
    # n_y cos(roll) - n_z sin(roll) = d_y |n| / |d|: the component along the pitch axis.
    reach = jet_product(dy, jet_square_root(jet_quotient(square, length)))
    rest = jet_sum(1.0, across, -1.0, jet_product(reach, reach))
    phase = jet_angle(nz, ny)
    if rest[0] > 0.0:
        roll = jet_sum(1.0, jet_angle(jet_square_root(rest), reach), -1.0, phase)
    else:
        nearest = atan2(0.0, reach[0])
        roll = (nearest - phase[0], 0.0, 0.0)
    forward = jet_sum(1.0, jet_product(ny, jet_sine(roll)), 1.0, jet_product(nz, jet_cosine(roll)))
    pitch = jet_sum(1.0, jet_angle(dx, lift), -1.0, jet_angle(nx, forward))
    return roll, pitch


@scalar
def jerk_along(force: Jets3, specific: Triple, omega: Triple, factor: float) -> Triple:
    """Jerk (m/s^3, body axes) of a body whose force stays along the torque-free force.

    Args:
        force: the torque-free force, of arbitrary unit
        specific: the present force per mass, m/s^2, body axes
        omega: body rates, rad/s: the force rotates with the body
        factor: weight of the torque-free force's motion in the body, 1 or 0
    """
    nx, ny, nz = force
    across = jet_sum(1.0, jet_product(nx, nx), 1.0, jet_product(ny, ny))
    length = jet_square_root(jet_sum(1.0, across, 1.0, jet_product(nz, nz)))
    push_x, push_y, push_z = specific
    size = sqrt(push_x * push_x + push_y * push_y + push_z * push_z)
    if nz[0] < 0.0:
        size = -size
    size = size * factor
    swept = cross(omega, specific)
    return (
        swept[0] + size * jet_quotient(nx, length)[1],
        swept[1] + size * jet_quotient(ny, length)[1],
        swept[2] + size * jet_quotient(nz, length)[1],
    )
