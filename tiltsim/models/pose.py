"""Places, directions and mass properties of a compiled vehicle, in the frame of its body."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from tiltsim_controllers.mathematics.scalar import Floats

if TYPE_CHECKING:
    import mujoco


class Moments(NamedTuple):
    """Mass, first moment and inertia of bodies about an origin."""

    mass: float  # kg
    first_moment: Floats  # kg m, shape (3,)
    inertia: Floats  # kg m^2, shape (3, 3)


class VehiclePose:
    """A compiled vehicle in its file's pose, in the frame of the body ``vehicle``."""

    def __init__(self, compiled: mujoco.MjModel, data: mujoco.MjData) -> None:
        self.compiled, self.data = compiled, data
        self.body = int(compiled.body("vehicle").id)
        self.frame = data.xmat[self.body].reshape(3, 3)  # from body to world

    def point(self, point: Floats) -> Floats:
        """A point of the world in body axes, from the body's origin."""
        return np.asarray(self.frame.T @ (point - self.data.xpos[self.body]))

    def direction(self, vector: Floats) -> Floats:
        """A vector of the world in body axes."""
        return np.asarray(self.frame.T @ vector)

    def moments(self, bodies: list[int]) -> Moments:
        """Mass properties of bodies, given by their ids, about the vehicle's origin."""
        mass, moment, inertia = 0.0, np.zeros(3), np.zeros((3, 3))
        for body in bodies:
            own = float(self.compiled.body_mass[body])
            center = self.point(self.data.xipos[body])
            turn = self.frame.T @ self.data.ximat[body].reshape(3, 3)
            mass += own
            moment += own * center
            inertia += turn @ np.diag(self.compiled.body_inertia[body]) @ turn.T
            inertia += own * parallel_axis(center)
        return Moments(mass, moment, inertia)


def parallel_axis(offset: Floats) -> Floats:
    """The inertia (m^2, shape (3, 3)) about the origin of a unit mass at an offset (m)."""
    return np.asarray(np.dot(offset, offset) * np.eye(3) - np.outer(offset, offset))
