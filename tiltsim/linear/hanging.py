"""A load on a taut cable as a pendulum, two angles and their rates, for derivatives.

In flights a stiff tendon holds the load, which may also rise: a step of a difference would make it
slack. Here the tension is the multiplier that keeps the length.
"""

from typing import Any, NamedTuple

import numpy as np

from tiltsim_controllers.mathematics.attitude import rotation_of_quaternion
from tiltsim_controllers.mathematics.scalar import Floats, Triple

FREE: tuple[slice, slice] = (slice(-7, None), slice(-6, None))
"""Where the load's free joint is in ``qpos`` and ``qvel``."""


class Pendulum(NamedTuple):
    """A load on a cable below a vehicle, whose free joint is the first of ``qpos``.

    Attributes:
        length: m, of the cable.
        attachment: m, body axes.
    """

    length: float
    attachment: Triple

    def placed(self, qpos: Floats, qvel: Floats) -> tuple[Floats, Floats]:
        """The motion in MuJoCo of a vehicle with angles (rad) and their rates behind it."""
        qpos, angles, qvel, rates = qpos[:-2], qpos[-2:], qvel[:-2], qvel[-2:]
        arm, moving = self._attached(qpos, qvel)
        hanging = np.array((*np.tan(angles), -1.0))
        hanging *= self.length / np.linalg.norm(hanging)
        x, y, z = hanging
        rows = np.array(((-z, 0.0, x), (0.0, -z, y), hanging))  # of the angles' rates and length
        moving = moving + np.linalg.solve(rows, (*(rates * (hanging[:2] ** 2 + z * z)), 0.0))
        place = (*(qpos[:3] + arm + hanging), 1.0, 0.0, 0.0, 0.0)
        return np.concatenate((qpos, place)), np.concatenate((qvel, moving, np.zeros(3)))

    def angles(self, qpos: Floats, qvel: Floats) -> tuple[Floats, Floats]:
        """The reverse of `placed`, for any length."""
        load, speed = qpos[FREE[0]][:3], qvel[FREE[1]][:3]
        qpos, qvel = qpos[: FREE[0].start], qvel[: FREE[1].start]
        arm, moving = self._attached(qpos, qvel)
        angles, rates, _ = _swinging(load - qpos[:3] - arm, speed - moving, np.zeros(3))
        return np.concatenate((qpos, angles)), np.concatenate((qvel, rates))

    def accelerations(self, model: Any, data: Any) -> tuple[Floats, float]:
        """Accelerations of the vehicle and the angles, and the tension (N), from free ones."""
        import mujoco

        turn, rates = rotation_of_quaternion(data.qpos[3:7]), data.qvel[3:6]
        arm, moving = self._attached(data.qpos, data.qvel)
        hanging = data.qpos[FREE[0]][:3] - data.qpos[:3] - arm
        speed, unit = data.qvel[FREE[1]][:3] - moving, hanging / self.length
        turning = turn @ np.cross(rates, np.cross(rates, self.attachment))
        row, change = np.zeros((1, model.nv)), np.zeros((1, model.nv))
        row[0, :3], row[0, FREE[1]][:3] = -unit, unit
        row[0, 3:6] = -np.cross(self.attachment, turn.T @ unit)
        mujoco.mj_solveM(model, data, change, row)
        excess = row[0] @ data.qacc - unit @ turning + speed @ speed / self.length
        tension = float(excess / (row[0] @ change[0]))
        qacc = data.qacc - tension * change[0]
        attached = qacc[:3] + turn @ np.cross(qacc[3:6], self.attachment) + turning
        _, _, swinging = _swinging(hanging, speed, qacc[FREE[1]][:3] - attached)
        return np.concatenate((qacc[: FREE[1].start], swinging)), tension

    def _attached(self, qpos: Floats, qvel: Floats) -> tuple[Floats, Floats]:
        """The attachment from the vehicle's place (m), and its velocity (m/s), world axes."""
        turn = rotation_of_quaternion(qpos[3:7] / np.linalg.norm(qpos[3:7]))
        spinning = turn @ np.cross(qvel[3:6], self.attachment)
        return turn @ np.array(self.attachment), qvel[:3] + spinning


def _swinging(hanging: Floats, speed: Floats, acceleration: Floats) -> tuple[Floats, ...]:
    """Angles (rad) of a vector from straight down toward +x and +y, and two derivatives."""
    (u, w), (du, dw), (ddu, ddw) = ((v[:2], -v[2]) for v in (hanging, speed, acceleration))
    square = u * u + w * w
    rates = (du * w - u * dw) / square
    second = (ddu * w - u * ddw - 2.0 * rates * (u * du + w * dw)) / square
    return np.arctan2(u, w), rates, second
