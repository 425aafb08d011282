"""Attitude-altitude feedback linearization of the tiltrotor (ch. 3, Sec. 3; ch. 4, Sec. 3).

Outputs are roll, pitch, yaw and altitude; inputs the four rotor accelerations, which appear in the
third derivatives. The horizontal position is controlled through roll and pitch by a decoupler. The
control law is one function of time and state; its steps follow the order of ch. 4.
"""

from typing import Any, Final, Literal

from tiltsim_controllers.code.arrays import traceable, xp
from tiltsim_controllers.gaits.motion import NO_KNOTS, GaitParameters
from tiltsim_controllers.laws.allocation import RotorRange
from tiltsim_controllers.laws.feedback import NO_DECOUPLER, decoupled
from tiltsim_controllers.laws.gains import Gains, GivenGains
from tiltsim_controllers.laws.keys import Keys, default, record_of
from tiltsim_controllers.laws.observed import Seen, Step
from tiltsim_controllers.laws.supervisor import Supervisor
from tiltsim_controllers.mathematics.attitude import rotation_matrix, wrapped
from tiltsim_controllers.mathematics.linear import cross, kernel, solved
from tiltsim_controllers.references.trajectories import ReferenceParameters, position_reference
from tiltsim_controllers.vehicle.body import (
    RotorcraftState,
    inertia_matrix,
    inverse_inertia_matrix,
    state_of,
)
from tiltsim_controllers.vehicle.parameters import Vehicle
from tiltsim_controllers.vehicle.rotors import airframe, rotor_accelerations, wrench_map

DECOUPLINGS: Final = {"published": 0.0, "exact": 1.0}
"""Forms of the decoupling matrix by their name in a scenario."""

PUBLISHED_DECOUPLING, EXACT_DECOUPLING = DECOUPLINGS.values()

LAYOUT: Final = (0, 1, 2, 3)
"""Every rotor of the tiltrotor has its own tilt."""


class AttitudeAltitude(Keys):
    """Keys of `attitude_altitude`, also with feed-forward of the gait (`gait_feedforward`)."""

    law: Literal["attitude_altitude"] = default(
        "attitude_altitude",
        "the four rotor speeds control roll, pitch, yaw and altitude by feedback linearization; "
        "the tilt angles follow the gait",
    )
    decoupling: Literal["published", "exact"] = default(
        "published",
        "form of the decoupling matrix, which relates rotor accelerations to the third "
        "derivatives of attitude and altitude: as the thesis prints it, without the factor 2 "
        "|rotor speed| in its attitude rows, or exact; the gains belong to one of the two",
    )
    decoupler: Literal["none", "conventional", "modified", "exact"] = default(
        "modified",
        "how the vehicle leans to control its horizontal position, for which no rotor speed is "
        "left: conventional leans as a quadrotor does, as if no rotor tilted; modified adds the "
        "lean that balances the tilted rotors' side force at hover, to first order; exact points "
        "their whole torque-free force along the desired acceleration; none leaves the position "
        "free, for reference.type attitude_altitude",
        "exact",
    )
    gains: GivenGains = default(
        "ch04",
        "a named set, or a table of gains or of poles: ch03 and ch04 are the thesis's, for "
        "decoupling published; exact and feedforward are for decoupling exact; with the set exact "
        "a yaw step of 0.39 rad stops a rotor",
    )
    gait_rate_feedforward: bool = default(
        False,
        "use the planned tilt rates as well as the angles; needs decoupling and decoupler exact, "
        "and allows integral action",
    )
    rotor_inertia_feedforward: bool = default(
        False,
        "include the gyroscopic torque of the rotors' vehicle.rotor_inertia; needs "
        "gait_rate_feedforward",
    )


OPTIONS: Final = frozenset({"law", "gait_rate_feedforward", "rotor_inertia_feedforward"})
"""Keys that the law does not read."""

Parameters = record_of(
    AttitudeAltitude,
    OPTIONS,
    vehicle=Vehicle,
    gains=Gains,
    gait=GaitParameters,
    reference=ReferenceParameters,
    supervisor=Supervisor,
    limits=RotorRange,  # of prioritized allocation
)


def torque_free_force(force: Any, torque: Any) -> Any:
    """The direction ``n`` in which four rotors push without torque, body axes, shape (3,).

    ``F(alpha)`` and ``tau(alpha)``, ch. 3, Eqs. 3 and 5, have shape (3, 4).
    """
    return force @ kernel(torque)


def _attitude_reference(now: RotorcraftState, target: Any, wrench: Any, p: Any) -> Any:
    """Roll, pitch and yaw to track (rad), shape (3,); ch. 4, Eqs. 28-30."""
    reference, gravity, yaw = p.reference, p.vehicle.gravity, p.reference.yaw
    if p.decoupler == NO_DECOUPLER:
        return xp.array([reference.roll, reference.pitch, yaw])
    p_ref, v_ref, a_ref = target
    K_1, K_2 = p.gains.position
    # Eq. 28 demands the horizontal acceleration alone: the altitude has its own dynamics, Eq. 27.
    ax, ay, _ = a_ref + K_1 * (v_ref - now.velocity) + K_2 * (p_ref - now.position)
    n = torque_free_force(wrench[:3], wrench[3:])  # F_X / (m g) of Eq. 30 is n_x / n_z
    roll, pitch = decoupled(p.decoupler, (ax, ay, a_ref[2]), yaw, gravity, n)
    return xp.array([roll, pitch, yaw])


@traceable
def attitude_altitude(seen: Seen, p: Any, knots: Any = NO_KNOTS) -> Step:
    """The rotor accelerations (rad/s^2), 4, and as signals the attitude that they track (rad), 3.

    Equations and symbols are ch. 4's: the outputs ``y`` are roll, pitch, yaw and altitude, of which
    third-order error dynamics demand third derivatives. Two things differ from the print. Its
    rows of Eq. 18 are multiplied by the inertia and by the mass, so that they are ``tau`` and
    ``r3^T F`` with world up in body axes ``r3``, the third row of R. And masses, forces and torques
    are in units of ``K_f``, see `airframe`. NaN where the decoupling matrix is singular.

    Args:
        seen: The state has `tiltsim_controllers.vehicle.body.TILTROTOR_FIELDS`.
        p: `Parameters`.
        knots: Table data of the reference.
    """
    now, (body, rotors) = state_of(seen.state, LAYOUT), airframe(p, (), LAYOUT)
    # Position, velocity and acceleration by row; the last is zero in ch. 4, see the function.
    target = position_reference(seen.time, p.reference, knots).reshape(3, 3)
    wrench = wrench_map(rotors, now.tilts)
    F, tau = wrench[:3], wrench[3:]
    w = now.speeds * abs(now.speeds)  # w_i = varpi_i |varpi_i|, ch. 3, Eq. 1

    # Second derivatives of y (ch. 3, Eq. 10). Body rates count as rates of the angles (Eq. 8).
    r3 = rotation_matrix(now.attitude)[2]
    lift = r3 @ F  # vertical force of each rotor per unit of w
    omega_rate = seen.measured  # None: no sensor measures it, then ch. 3, Eq. 4
    if omega_rate is None:
        omega_rate = inverse_inertia_matrix(body) @ (tau @ w)
    z_acceleration = lift @ w / body.mass - body.gravity

    # Demanded third derivatives (Eqs. 26 and 27). The reference of the attitude counts as at rest.
    tracked = _attitude_reference(now, target, wrench, p)
    error = tracked - now.attitude
    error = xp.array([error[0], error[1], wrapped(error[2])])  # yaw turns the short way
    K_P1, K_P2, K_P3 = p.gains.attitude
    omega_jerk = K_P3 * error - K_P2 * now.omega - K_P1 * omega_rate
    K_PZ1, K_PZ2, K_PZ3 = p.gains.altitude
    z_ref, vz_ref, az_ref = target[:, 2]
    z_jerk = (
        K_PZ3 * (z_ref - now.position[2])
        + K_PZ2 * (vz_ref - now.velocity[2])
        + K_PZ1 * (az_ref - z_acceleration)
    )

    # Right side of Eq. 19, times I and m; Ma is the force's change as it turns with the body.
    Ma = r3 @ cross(now.omega, F @ w)
    desired = xp.hstack([inertia_matrix(body) @ omega_jerk, body.mass * z_jerk - Ma])

    # w_i' = 2 |varpi_i| varpi_i' (Eq. 16). The print has this factor in the last row only. It
    # belongs to every row, so that the exact solution is w', divided by the factor.
    if p.decoupling == PUBLISHED_DECOUPLING:
        inputs = solved(xp.vstack([tau, lift * (2.0 * abs(now.speeds))]), desired)
    else:
        inputs = rotor_accelerations(solved(xp.vstack([tau, lift]), desired), now.speeds)
    return Step(inputs, signals=tracked)
