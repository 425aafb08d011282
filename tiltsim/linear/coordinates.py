"""Minimal coordinates of a plant's state: its numbers, but three for a rotation."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from tiltsim_controllers.mathematics.rotation import (
    quaternion_from_rotation,
    rotation_from_quaternion,
)
from tiltsim_controllers.mathematics.scalar import Floats

ROTATION_NAMES: Final = ("rotation_x", "rotation_y", "rotation_z")
"""A small turn about the body axes, rad; at level attitude roll, pitch and yaw."""

MATRIX: Final = 9
QUATERNION: Final = 4


class Coordinates(NamedTuple):
    """Minimal coordinates of the states near a given one.

    A state is a vector of numbers in which a rotation from body to world, if there is one, takes
    nine entries (rows first) or four (a quaternion). Its coordinates relative to another state are
    the differences of the numbers, and for the rotation the vector, in body axes, of the turn from
    the other state's rotation.
    """

    names: tuple[str, ...]  # of the coordinates
    units: tuple[str, ...]
    rotation: int = 0  # entries of the rotation; 0 without one
    first: int = 3  # index of its first entry

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return len(self.names)

    def moved(self, state: Floats, by: Floats) -> Floats:
        """The state with the coordinates ``by`` relative to another."""
        if not self.rotation:
            return state + by
        first, after = self.first, self.first + self.rotation
        turned = _turned(state[first:after], by[first : first + 3])
        return np.concatenate((state[:first] + by[:first], turned, state[after:] + by[first + 3 :]))

    def between(self, start: Floats, end: Floats) -> Floats:
        """The coordinates of the state ``end`` relative to ``start``."""
        if not self.rotation:
            return end - start
        first, after = self.first, self.first + self.rotation
        turn = _turn(start[first:after], end[first:after])
        return np.concatenate((end[:first] - start[:first], turn, end[after:] - start[after:]))

    def rates(self, state: Floats, derivative: Floats) -> Floats:
        """The rates of the coordinates relative to a state, from the derivative of its numbers."""
        if not self.rotation:
            return derivative
        first, after = self.first, self.first + self.rotation
        rates = _turn_rates(state[first:after], derivative[first:after])
        return np.concatenate((derivative[:first], rates, derivative[after:]))


def _product(p: Floats, q: Floats) -> Floats:
    """The product of two quaternions."""
    vector = p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])
    return np.array((p[0] * q[0] - p[1:] @ q[1:], *vector))


def _turn_rates(rotation: Floats, derivative: Floats) -> Floats:
    """The body rates of a rotation, from the derivative of its entries."""
    if len(rotation) == QUATERNION:
        return 2.0 * _product(rotation * (1.0, -1.0, -1.0, -1.0), derivative)[1:]
    skew = rotation.reshape(3, 3).T @ derivative.reshape(3, 3)
    turning = (skew[2, 1] - skew[1, 2], skew[0, 2] - skew[2, 0], skew[1, 0] - skew[0, 1])
    return 0.5 * np.array(turning)


def _quaternion(rotation: Floats) -> Floats:
    """The unit quaternion of a rotation, which may be a matrix."""
    if len(rotation) == MATRIX:
        rotation = np.array(quaternion_from_rotation(tuple(rotation.tolist())))
    return rotation / np.linalg.norm(rotation)


def _turned(rotation: Floats, vector: Floats) -> Floats:
    """A rotation, turned by a vector in body axes."""
    half = 0.5 * float(np.linalg.norm(vector))
    turn = np.array((np.cos(half), *(0.5 * np.sinc(half / np.pi) * vector)))
    turned = _product(_quaternion(rotation), turn)
    if len(rotation) == MATRIX:
        return np.array(rotation_from_quaternion(*turned.tolist()))
    return turned


def _turn(start: Floats, end: Floats) -> Floats:
    """The vector, in the axes of ``start``, of the turn from one rotation to another."""
    inverse = _quaternion(start) * (1.0, -1.0, -1.0, -1.0)
    turn = _product(inverse, _quaternion(end))
    if turn[0] < 0.0:
        turn = -turn
    half = np.arctan2(np.linalg.norm(turn[1:]), turn[0])
    return np.asarray(2.0 * turn[1:] / np.sinc(half / np.pi))
