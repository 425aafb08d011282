"""The decoupling matrix of the tiltrotor in factored form (ch. 3, Eqs. 3, 5, 12, 16-18).

Ch. 3 examines when ``[tau(alpha); r3^T F(alpha)]`` is invertible, with ``r3`` the third row of the
body-to-world rotation (world up in body axes), and expands the determinant into some thirty
products. The geometry is simpler. Only rotors 2 and 4 produce roll torque and only rotors 1 and 3
pitch torque, so the rotor inputs with zero total torque follow pair by pair; their force has the
direction ``n(alpha)``, and

    ``det [tau; r3^T F] = 2 L^2 K_f^3 K_m (n . r3)``,  ``n = (-R_theta, R_phi, R)``.

The matrix is singular exactly where world up is perpendicular to ``n``.

Everything except `sines_and_cosines` is arithmetic on its tuple ``trig`` and on the drag ratio
``r = K_m / (L K_f)``, so that it runs on floats, in native code and, element by element, on
arrays. Torques are in units of ``L K_f``, forces in units of ``K_f``; rotor inputs are
``w_i = varpi_i |varpi_i|`` (rad^2/s^2).
"""

from __future__ import annotations

from math import cos, sin

from tiltsim_controllers.mathematics.scalar import Octet, Quad, Triple


def sines_and_cosines(a1: float, a2: float, a3: float, a4: float) -> Octet:
    """``(sin alpha_1, cos alpha_1, ..., sin alpha_4, cos alpha_4)``.

    Args:
        a1, a2, a3, a4: tilt angles, rad
    """
    return sin(a1), cos(a1), sin(a2), cos(a2), sin(a3), cos(a3), sin(a4), cos(a4)


def torque_entries(trig: Octet, drag_ratio: float) -> Octet:
    """The eight non-zero entries of ``tau(alpha) / (L K_f)`` (ch. 3, Eq. 5).

    ``trig`` are the `sines_and_cosines` of the tilt angles.

    Returns ``(x2, x4, y1, y3, z1, z2, z3, z4)``: roll, pitch and yaw torque by rotor.
    """
    s1, c1, s2, c2, s3, c3, s4, c4 = trig
    return (
        c2 - drag_ratio * s2,
        -c4 + drag_ratio * s4,
        c1 + drag_ratio * s1,
        -c3 - drag_ratio * s3,
        s1 - drag_ratio * c1,
        -s2 - drag_ratio * c2,
        s3 - drag_ratio * c3,
        -s4 - drag_ratio * c4,
    )


def body_force(trig: Octet, w1: float, w2: float, w3: float, w4: float) -> Triple:
    """The force ``F(alpha) w / K_f`` in body axes (ch. 3, Eq. 3).

    Args:
        trig: `sines_and_cosines` of the tilt angles
        w1, w2, w3, w4: rotor inputs, rad^2/s^2
    """
    s1, c1, s2, c2, s3, c3, s4, c4 = trig
    return (s2 * w2 - s4 * w4, s1 * w1 - s3 * w3, -c1 * w1 + c2 * w2 - c3 * w3 + c4 * w4)


def vertical_force_entries(trig: Octet, ux: float, uy: float, uz: float) -> Quad:
    """The row ``u^T F(alpha) / K_f``: force along the direction ``u``, by rotor.

    With ``u = r3`` this is the last row of the decoupling matrix (ch. 3, Eq. 18).

    Args:
        trig: `sines_and_cosines` of the tilt angles
        ux, uy, uz: the direction, body axes
    """
    s1, c1, s2, c2, s3, c3, s4, c4 = trig
    return (s1 * uy - c1 * uz, s2 * ux + c2 * uz, -s3 * uy - c3 * uz, -s4 * ux + c4 * uz)


def torque_free_inputs(torque: Octet) -> Quad:
    """The rotor inputs that span ``ker tau(alpha)``; they may vanish where its rank is below 3.

    ``torque`` are the `torque_entries`. Rotors 2 and 4 share a factor that cancels their roll
    torque, rotors 1 and 3 one that cancels their pitch torque; the ratio of the two factors cancels
    the yaw torque.
    """
    x2, x4, y1, y3, z1, z2, z3, z4 = torque
    yaw_of_13 = z3 * y1 - z1 * y3
    yaw_of_24 = z4 * x2 - z2 * x4
    return (-y3 * yaw_of_24, x4 * yaw_of_13, y1 * yaw_of_24, -x2 * yaw_of_13)


def torque_free_force(trig: Octet, torque: Octet, drag_ratio: float) -> Triple:
    """The force at zero torque, ``n = (-R_theta, R_phi, R)``, body axes.

    Normalized as in ch. 3: ``R = 4`` for an untilted vehicle. Where ``n = 0`` the decoupling matrix
    is singular at every attitude: where ``tau`` is rank-deficient, and also where the torque-free
    forces of the two pairs cancel, as for red gaits on the curve L of the Two Color Map. ``trig``
    are the `sines_and_cosines`, ``torque`` the `torque_entries` of the tilt angles.
    """
    w1, w2, w3, w4 = torque_free_inputs(torque)
    nx, ny, nz = body_force(trig, w1, w2, w3, w4)
    scale = 0.5 / drag_ratio
    return nx * scale, ny * scale, nz * scale
