"""The alleged singular zone, gains and decouplers, and rotor limits (ch. 2, 4, 5 and 9)."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from tiltsim_controllers.analysis import attainable, singularity
from tiltsim_controllers.analysis.attainable import AttainableSet
from tiltsim_controllers.analysis.published_gaits import PUBLISHED_GAITS
from tiltsim_controllers.analysis.stability import is_hurwitz, third_order_loop
from tiltsim_controllers.laws.feedback import conventional_decoupler, modified_decoupler
from tiltsim_controllers.laws.gains import GAIN_SETS
from tiltsim_controllers.laws.quadrotor import ATTITUDE_GAINS, POSITION_GAINS
from tiltsim_controllers.mathematics.attitude import euler_rates
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.cross import torque_free_force
from tiltsim_controllers.vehicle.parameters import PRESETS, drag_ratio

_VEHICLE: Final = PRESETS["ar_drone_2"]
_QUADROTOR: Final = PRESETS["ar_drone_2_unrounded"]
_HOVER: Final = _QUADROTOR.mass * _QUADROTOR.gravity
_SINGULAR: Final = 1e-9
_LIMITS: Final = attainable.published_speed_limits(_VEHICLE)


def attitudes(limit: float, count: int) -> Floats:
    """Roll and pitch (rad) up to a limit either way, shape (2, count, count)."""
    return np.array(np.meshgrid(*[np.linspace(-limit, limit, count)] * 2))


def exact_determinant(roll: ArrayLike, pitch: ArrayLike, thrust: float = _HOVER) -> Floats:
    """The exact determinant at attitudes (rad) and a thrust (N), over its value in level hover."""
    return singularity.normalized_determinant(
        np.asarray(roll), np.asarray(pitch), thrust, _QUADROTOR
    )


def exact_on_published_curve() -> Floats:
    """The exact determinant on S = 0, over its value in level hover."""
    return exact_determinant(*singularity.published_singular_curve())


def rightmost_root() -> complex:
    """The root with the largest real part of ch. 2's position loop."""
    roots = np.roots((1.0, *POSITION_GAINS["ch02"].position))
    return complex(roots[np.argmax(roots.real)])


def eq_43(roll: float, pitch: float, yaw: float) -> Floats:
    """The matrix of Eq. (43) as printed, without its last row and column."""
    (sf, st, sp), (cf, cp) = np.sin([roll, pitch, yaw]), np.cos([roll, yaw])
    first = cp * st * cf - cp * st * sf + sp * sf + sp * cf
    second = sp * st * cf - sp * st * sf - cp * sf - cp * cf
    return np.array([[first, sp * cf, cp], [second, -cp * cf, sp], [0.0, sf, st]])


def eq_43_as_printed() -> bool:
    """Whether S is the determinant of the matrix of Eq. (43), with its printed zero."""
    angles = np.random.default_rng(0).uniform(-1.5, 1.5, (200, 3))
    exact = np.linalg.det([eq_43(*each) for each in angles])
    return bool(np.abs(exact - singularity.published_determinant(*angles[:, :2].T)).max() < 1e-12)


def quadrotor_gains_are_stable(law: str) -> bool:
    """Whether Appendix B's gains, of position or altitude, and of yaw stabilize their loops."""
    sets = POSITION_GAINS if law == "yaw_position" else ATTITUDE_GAINS
    return all(is_hurwitz((1.0, *gains)) for gains in sets["ch02"])


def attitude_altitude_is_singular() -> bool:
    """The matrix from thrust and torques to (z, roll, pitch, yaw) accelerations, over a grid."""
    angles = np.linspace(-1.55, 1.55, 63)
    for roll in angles:
        for pitch in angles:
            rates = euler_rates(np.array([roll, pitch, 0.0]), np.eye(3))
            lift = float(singularity.world_up(roll, pitch)[2])
            if abs(lift * np.linalg.det(rates)) < _SINGULAR:
                return True
    return False


def axis_has_no_influence(roll_sign: float, pitch_sign: float) -> bool:
    """Whether the exact determinant stays the same if body axes are reversed."""
    roll, pitch = attitudes(1.5, 61)
    flipped = exact_determinant(roll_sign * roll, pitch_sign * pitch)
    return bool(np.abs(exact_determinant(roll, pitch) - flipped).max() < _SINGULAR)


def zone_holds_the_curve() -> bool:
    """Whether the zone of Eq. (47) contains all of S = 0."""
    roll, pitch = singularity.published_singular_curve()
    inside = (np.abs(pitch) <= 0.5) & (roll >= -np.pi / 2) & (roll <= 0.2)
    return bool(inside.all())


def routh_holds(rows: Sequence[str]) -> bool:
    """Whether ch. 4's gains satisfy Routh's condition as printed, without another loop gain."""
    loops = GAIN_SETS["ch04"].loops
    return all(third_order_loop("", loops[row], 1.0).stable for row in rows)


def decouplers_agree_without_tilt() -> bool:
    """Whether both decouplers demand the same roll and pitch of the untilted vehicle."""
    n = torque_free_force(np.zeros(4), drag_ratio(_VEHICLE))
    desired = (1.3, -0.7, 0.4, _VEHICLE.gravity)  # m/s^2, m/s^2, rad, m/s^2
    pair = zip(modified_decoupler(*desired, n), conventional_decoupler(*desired), strict=True)
    return max(abs(modified - conventional) for modified, conventional in pair) < 1e-12


def gait_angles(number: int, *, exact: bool = False) -> list[float]:
    """Tilt angles (rad) of a gait of ch. 9, as printed or on the exact lines."""
    published = PUBLISHED_GAITS[f"ch09_gait_{number}"]
    gait = (published.exact or published.gait) if exact else published.gait
    return [float(angle) for angle in gait.angles(np.array([0.0]))[0]]


def torques(number: int, thrust: float | None = None, *, exact: bool = False) -> AttainableSet:
    """Roll and pitch torques and thrusts of a gait without yaw torque, at a vertical thrust (N)."""
    angles = gait_angles(number, exact=exact)
    return attainable.attainable_torque_thrust(angles, _VEHICLE, _LIMITS, vertical_thrust=thrust)


def torques_are_coupled(number: int) -> bool:
    """Whether for one thrust in the middle the torques on the exact lines are on a line."""
    thrusts = torques(number, exact=True)
    middle = 0.5 * float(thrusts.lower[2] + thrusts.upper[2])
    return torques(number, middle, exact=True).dimension <= 1


def accelerations(number: int) -> tuple[float, ...]:
    """Attainable accelerations in body axes, m/s^2: least along x and y, largest along x and y."""
    reached = attainable.attainable_accelerations(gait_angles(number), _VEHICLE, _LIMITS)
    return (*reached.lower.tolist(), *reached.upper.tolist())


def accelerations_are_a_rectangle(number: int) -> bool:
    """Whether their set has four corners, with two values along each axis."""
    corners = attainable.attainable_accelerations(gait_angles(number), _VEHICLE, _LIMITS).vertices
    spans = [np.unique(np.round(axis, 9)) for axis in corners.T]
    return len(corners) == 4 and all(len(span) == 2 for span in spans)
