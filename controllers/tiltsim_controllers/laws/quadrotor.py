"""The quadrotor's control laws of ch. 2: yaw-position, attitude-altitude, and switching.

**Yaw-position** feedback linearization with dynamic extension. Outputs are the position and yaw;
inputs the total thrust, twice integrated, and three torques. Thrust does not affect the attitude,
and torque does not affect the position's second derivative, so the controller treats the thrust
``zeta`` and its rate ``xi`` as its own states and differentiates the position four times (Eqs.
1-28).

The thrust acts along the body's third axis ``b = R e3``. Its derivatives, ``b' = R (omega x e3)``
and ``b'' = R (omega x (omega x e3) + omega' x e3)``, give the decoupling matrix in closed form; its
determinant is in `tiltsim_controllers.analysis.singularity`. The axes are ours, z up; ch. 2's have
z down, which changes the signs of y and z, of pitch and yaw and of their torques.

**Attitude-altitude** feedback linearization, second order (Appendix B). Outputs are altitude, roll,
pitch and yaw, inputs the total thrust and three torques. Ch. 2 switches to this controller near the
published singular curve: its decoupling matrix is singular only at a roll or pitch of 90 degrees.

**Switching** (Sec. 5). Ch. 2 considers its determinant surface singular near level attitude and
switches to the attitude-altitude controller there. The choice is a function of the attitude only,
without memory.

Only the yaw-position controller has states, the thrust ``zeta`` and its rate ``xi``. The chapter
does not state how they evolve while the other controller is active: under the inactive yaw-position
controller (``running``), constant (``held``), or ``bumpless``. These follow the thrust and thrust
rate of the attitude-altitude controller, so that both are continuous when the yaw-position
controller takes over again.
"""

from typing import Any, ClassVar, Final, Literal

from pydantic import ConfigDict

from tiltsim_controllers.code.arrays import branch, xp
from tiltsim_controllers.gaits.motion import NO_KNOTS
from tiltsim_controllers.laws.feedback import error_dynamics
from tiltsim_controllers.laws.keys import (
    Gains2,
    Gains4,
    GainSets,
    Keys,
    NamedGains,
    Positive,
    choice,
    default,
    record_of,
    required,
)
from tiltsim_controllers.mathematics.attitude import euler_rates, rotation_matrix, wrapped
from tiltsim_controllers.mathematics.linear import cross
from tiltsim_controllers.references.trajectories import ReferenceParameters, reference_motion
from tiltsim_controllers.vehicle.parameters import Vehicle


class YawPositionGainTable(Keys):
    """Explicit gains of yaw-position control."""

    position: Gains4 = required(
        "k_1 to k_4, on the errors of jerk, acceleration, velocity and position [1/s, 1/s^2, "
        "1/s^3, 1/s^4]",
        [10.0, 37.5, 62.5, 39.0625],
    )
    yaw: Gains2 = default((5.0, 5.0), "on the errors of the yaw rate and of yaw [1/s, 1/s^2]")


PositionGains = record_of(YawPositionGainTable)

POSITION_GAINS: Final = {
    # Appendix B. The position loop s^4 + 10 s^3 + 20 s^2 + 50 s + 500 is unstable.
    "ch02": PositionGains((10.0, 20.0, 50.0, 500.0), (5.0, 5.0)),
    # Ours: the same k_1, all four poles of the position loop at -2.5.
    "stable": PositionGains((10.0, 37.5, 62.5, 39.0625), (5.0, 5.0)),
}
"""Gains of yaw-position control by name (ch. 2, Eqs. A2-A6)."""

YawPositionGains = NamedGains[Literal["ch02", "stable"], YawPositionGainTable]
YAW_POSITION_GAINS: Final = (
    "stable, or ch02 as the thesis prints them, which are unstable, or a table of gains"
)
"""The choices of gains, for descriptions."""


class YawPosition(Keys):
    """Keys of `yaw_position_inputs`."""

    gain_sets: ClassVar[GainSets] = {"gains": POSITION_GAINS}

    law: Literal["yaw_position"] = required(
        "the quadrotor's thrust and three torques control position and yaw"
    )
    gains: YawPositionGains = default("stable", YAW_POSITION_GAINS)


YawPositionParameters = record_of(YawPosition, vehicle=Vehicle, reference=ReferenceParameters)


def moments_of(vehicle: Vehicle) -> Any:
    """Principal moments of inertia, kg m^2, shape (3,)."""
    return xp.array([vehicle.inertia_xx, vehicle.inertia_yy, vehicle.inertia_zz])


def gyroscopic_acceleration(omega: Any, vehicle: Vehicle) -> Any:
    """Angular acceleration (rad/s^2) at body rates (rad/s) without torque, (3,) (ch. 2, Eq. 15)."""
    moments = moments_of(vehicle)
    return -cross(omega, moments * omega) / moments


def drift(state: Any, vehicle: Vehicle) -> Any:
    """``Ma`` of ch. 2, Eq. (20): the derivatives of the outputs at zero input, shape (4,).

    They are the fourth of the position (m/s^4) and the second of yaw (rad/s^2); the state is
    `tiltsim_controllers.vehicle.body.EXTENDED_QUADROTOR_FIELDS`, shape (14,).
    """
    attitude, omega, thrust, thrust_rate = state[6:9], state[9:12], state[12], state[13]
    free, e3 = gyroscopic_acceleration(omega, vehicle), xp.array([0.0, 0.0, 1.0])
    turning = cross(omega, e3)
    curved = cross(omega, turning) + cross(free, e3)
    snap = rotation_matrix(attitude) @ (2.0 * thrust_rate * turning + thrust * curved)
    roll, pitch = attitude[0], attitude[1]
    roll_rate, pitch_rate, yaw_rate = euler_rates(attitude, omega)
    bent = pitch_rate * (roll_rate + xp.sin(pitch) * yaw_rate)
    yaw = (bent + xp.sin(roll) * free[1] + xp.cos(roll) * free[2]) / xp.cos(pitch)
    return xp.hstack([snap / vehicle.mass, yaw])


def decoupling_matrix(state: Any, vehicle: Vehicle) -> Any:
    """``Delta`` of ch. 2, Eqs. (20) and (42), for forces at the arms, shape (4, 4); see `drift`.

    Yaw torque does not turn the thrust, so the upper three entries of the last column are zero.
    They are printed as non-zero due to errors in Eqs. (31) and (36): ``s_theta s_phi`` should read
    ``s_theta c_phi``.
    """
    roll, pitch, thrust = state[6], state[7], state[12]
    x, y, z = rotation_matrix(state[6:9]).T  # the body's axes
    by_roll, by_pitch, by_yaw = vehicle.arm_length / moments_of(vehicle)
    position = xp.array([z, -thrust * by_roll * y, thrust * by_pitch * x, 0.0 * z]) / vehicle.mass
    yaw = xp.array([0.0, 0.0, by_pitch * xp.sin(roll), by_yaw * xp.cos(roll)]) / xp.cos(pitch)
    return xp.vstack([position.T, yaw])


def yaw_position_inputs(time: Any, state: Any, p: Any, knots: Any = NO_KNOTS) -> Any:
    """Thrust (N), torques (N m), rates of the controller's states (N/s, N/s^2), shape (6,).

    The inputs of ch. 2, Eqs. (1)-(8), with ``u_2`` to ``u_4`` converted from forces at the arms to
    torques. In body axes ``Delta`` is triangular: only ``u_1`` acts along the thrust, ``u_2`` and
    ``u_3`` across it, and ``u_4`` corrects the yaw (Eq. A1). NaN where it is singular: at zero
    thrust, and at a roll or pitch of 90 degrees.

    Args:
        time: s
        state: `tiltsim_controllers.vehicle.body.EXTENDED_QUADROTOR_FIELDS`, shape (14,).
        p: `YawPositionParameters`, or the parameters of `switching`.
        knots: Table data of the reference.
    """
    vehicle, reference = p.vehicle, p.reference
    position, velocity, attitude, omega = state[:3], state[3:6], state[6:9], state[9:12]
    thrust, thrust_rate, mass = state[12], state[13], vehicle.mass
    sin_roll, (cos_roll, cos_pitch) = xp.sin(attitude[0]), xp.cos(attitude[:2])

    # The present derivatives of the position: the thrust turns with the body (Eqs. 15-18, 24).
    to_world, e3 = rotation_matrix(attitude), xp.array([0.0, 0.0, 1.0])
    acceleration = thrust / mass * to_world[:, 2] - vehicle.gravity * e3
    jerk = to_world @ (thrust_rate * e3 + thrust * cross(omega, e3)) / mass

    # The demanded fourth derivative of the position and second of yaw (Eqs. A2-A6).
    motion = reference_motion(time, reference, knots)
    present = (position, velocity, acceleration, jerk)
    snap = error_dynamics(motion, present, p.gains.position)
    k1, k2 = p.gains.yaw
    yaw_rate = euler_rates(attitude, omega)[2]
    turn = k2 * wrapped(reference.yaw - attitude[2]) - k1 * yaw_rate

    # Solved in body axes: the force's second derivative is (zeta q', -zeta p', u_1).
    free = drift(state, vehicle)
    force = mass * to_world.T @ (snap - free[:3])
    regular = (thrust != 0.0) & (cos_roll != 0.0) & (cos_pitch != 0.0)
    scale = xp.where(regular, thrust, xp.nan)
    p_rate, q_rate = -force[1] / scale, force[0] / scale
    r_rate = (cos_pitch * (turn - free[3]) - sin_roll * q_rate) / cos_roll
    torque = moments_of(vehicle) * xp.array([p_rate, q_rate, r_rate])
    return xp.hstack([thrust, torque, thrust_rate, force[2]])


class QuadrotorAttitudeGainTable(Keys):
    """Explicit gains of the quadrotor's attitude-altitude control."""

    altitude: Gains2 = required(
        "on the errors of vertical velocity and altitude [1/s, 1/s^2]", [10.0, 10.0]
    )
    attitude: Gains2 = required(
        "on the errors of the rates and of roll, pitch and yaw [1/s, 1/s^2]", [10.0, 10.0]
    )


AttitudeGains = record_of(QuadrotorAttitudeGainTable)

ATTITUDE_GAINS: Final = {"ch02": AttitudeGains((10.0, 10.0), (10.0, 10.0))}
"""Gains of attitude-altitude control by name; ch. 2, Eqs. (A8)-(A9)."""

QuadrotorAttitudeGains = NamedGains[Literal["ch02"], QuadrotorAttitudeGainTable]


class QuadrotorAttitudeAltitude(Keys):
    """Keys of `attitude_altitude_inputs`."""

    gain_sets: ClassVar[GainSets] = {"gains": ATTITUDE_GAINS}

    law: Literal["quadrotor_attitude_altitude"] = required(
        "the quadrotor's thrust and three torques control attitude and altitude"
    )
    gains: QuadrotorAttitudeGains = default("ch02", "the thesis's set, or a table of gains")


AttitudeAltitudeParameters = record_of(
    QuadrotorAttitudeAltitude, vehicle=Vehicle, reference=ReferenceParameters
)


def attitude_altitude_inputs(
    time: Any,
    state: Any,
    vehicle: Vehicle,
    gains: Any,
    reference: ReferenceParameters,
    knots: Any = NO_KNOTS,
) -> Any:
    """Thrust (N) and the three torques (N m, body axes), shape (4,) (ch. 2, Eq. A7).

    NaN at a roll or pitch of 90 degrees.

    Args:
        time: s
        state: Begins with `tiltsim_controllers.vehicle.body.BODY_FIELDS`, shape (12,).
        vehicle, gains: The quadrotor and its gains.
        reference, knots: Altitude, roll, pitch and yaw, the angles constant.
    """
    z, vz, attitude, omega = state[2], state[5], state[6:9], state[9:12]
    (sin_roll, sin_pitch, _), (cos_roll, cos_pitch, _) = xp.sin(attitude), xp.cos(attitude)
    regular = (cos_roll != 0.0) & (cos_pitch != 0.0)
    upright = xp.where(regular, cos_roll * cos_pitch, xp.nan)
    (_, _, z_ref), (_, _, vz_ref) = reference_motion(time, reference, knots)[:2]
    k1, k2 = gains.altitude
    lift = vehicle.gravity + k1 * (vz_ref - vz) + k2 * (z_ref - z)

    # Eq. (A7), then Euler accelerations into body accelerations: omega = E(roll, pitch) euler',
    # omega' = E euler'' + E' euler'.
    rates = euler_rates(attitude, omega)
    desired = xp.array([reference.roll, reference.pitch, reference.yaw]) - attitude
    error = xp.array([desired[0], desired[1], wrapped(desired[2])])
    k1, k2 = gains.attitude
    roll, pitch, yaw = k2 * error - k1 * rates
    roll_rate, pitch_rate, yaw_rate = rates
    forward = cos_pitch * yaw - sin_pitch * pitch_rate * yaw_rate
    angular = xp.array(
        [
            roll - sin_pitch * yaw - cos_pitch * pitch_rate * yaw_rate,
            cos_roll * pitch + sin_roll * forward + roll_rate * omega[2],
            cos_roll * forward - sin_roll * pitch - roll_rate * omega[1],
        ]
    )
    torque = moments_of(vehicle) * (angular - gyroscopic_acceleration(omega, vehicle))
    return xp.hstack([vehicle.mass * lift / upright, torque + 0.0 * upright])


PUBLISHED_ROLL: Final = (-1.5707963267948966, 0.2)
"""rad: Eq. (47); its lower bound, -pi/2, is the edge of the attitudes that ch. 2 considers."""

PUBLISHED_PITCH: Final = (-0.5, 0.5)
"""rad: Eq. (47) with z up; the interval is symmetric."""


class ZoneTable(Keys):
    """Attitudes at which attitude-altitude control is active, edges included; Eq. (47)."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"roll": [-1.57, 0.2]}]})

    roll: Gains2 = default(PUBLISHED_ROLL, "smallest and largest roll [rad]", [-1.57, 0.2])
    pitch: Gains2 = default(PUBLISHED_PITCH, "smallest and largest pitch [rad]")


PUBLISHED_ZONE: Final = ZoneTable()


class Switching(Keys):
    """Keys of `switching_inputs`."""

    gain_sets: ClassVar[GainSets] = {"gains": POSITION_GAINS, "attitude_gains": ATTITUDE_GAINS}

    law: Literal["switching"] = required(
        "yaw_position, and quadrotor_attitude_altitude while the attitude is in a zone"
    )
    gains: YawPositionGains = default("stable", f"of the yaw-position law: {YAW_POSITION_GAINS}")
    attitude_gains: QuadrotorAttitudeGains = default(
        "ch02", "of the attitude-altitude law: the thesis's set, or a table of gains"
    )
    zone: ZoneTable = default(
        ZoneTable(), "the attitudes at which the attitude-altitude law is active"
    )
    extension: Literal["bumpless", "held", "running"] = default(
        "bumpless",
        "the yaw-position law's own states, thrust and its rate, while the other law is active: "
        "bumpless follows the actual thrust, held stops them, running goes on",
    )
    extension_rate: Positive = default(
        100.0, "rate at which bumpless states converge to the actual thrust [1/s]"
    )


SwitchingParameters = record_of(Switching, vehicle=Vehicle, reference=ReferenceParameters)

BUMPLESS: Final = choice(Switching, "extension", "bumpless")
RUNNING: Final = choice(Switching, "extension", "running")


def in_attitude_zone(roll: Any, pitch: Any, zone: Any) -> Any:
    """Whether the attitude-altitude controller is active at an attitude (rad; ch. 2, Eq. 47)."""
    (roll_min, roll_max), (pitch_min, pitch_max) = zone.roll, zone.pitch
    rolled = (roll_min <= roll) & (roll <= roll_max)
    return rolled & (pitch_min <= pitch) & (pitch <= pitch_max)


def attitude_altitude_thrust_rate(
    time: Any, state: Any, thrust: Any, p: Any, knots: Any = NO_KNOTS
) -> Any:
    """Rate (N/s) of the attitude-altitude controller's thrust.

    Args:
        time: s
        state: Begins with `tiltsim_controllers.vehicle.body.BODY_FIELDS`, shape (12,).
        thrust: N
        p: `SwitchingParameters`.
        knots: Table data of the reference.
    """
    attitude, vz = state[6:9], state[5]
    vehicle, motion = p.vehicle, reference_motion(time, p.reference, knots)
    upright = xp.cos(attitude[0]) * xp.cos(attitude[1])
    upright = xp.where(upright == 0.0, xp.nan, upright)
    az = thrust * upright / vehicle.mass - vehicle.gravity
    k1, k2 = p.attitude_gains.altitude
    lift_rate = k1 * (motion[2, 2] - az) + k2 * (motion[1, 2] - vz)
    leaning = xp.tan(attitude[:2]) @ euler_rates(attitude, state[9:12])[:2]
    return vehicle.mass * lift_rate / upright + thrust * leaning


def switching_inputs(time: Any, state: Any, p: Any, knots: Any = NO_KNOTS) -> Any:
    """Thrust (N), torques (N m) and rates of the extension's states, shape (6,).

    Args:
        time: s
        state: `tiltsim_controllers.vehicle.body.EXTENDED_QUADROTOR_FIELDS`, shape (14,).
        p: `SwitchingParameters`.
        knots: Table data of the reference.
    """

    def outside() -> Any:
        return yaw_position_inputs(time, state, p, knots)

    def inside() -> Any:
        wrench = attitude_altitude_inputs(
            time, state, p.vehicle, p.attitude_gains, p.reference, knots
        )
        extension = xp.zeros(2)
        if p.extension == RUNNING:
            extension = outside()[4:]
        elif p.extension == BUMPLESS:
            thrust = wrench[0]
            thrust_rate = attitude_altitude_thrust_rate(time, state, thrust, p, knots)
            flown = xp.array([thrust, thrust_rate])
            follow = p.extension_rate * (flown - state[12:14])
            extension = xp.array([thrust_rate, 0.0]) + follow
        return xp.hstack([wrench, extension])

    return branch(in_attitude_zone(state[6], state[7], p.zone), inside, outside)
