"""Minimal coordinates of a plant's state, three for a rotation, and names and units of inputs.

A load on a taut cable is a pendulum, two angles and their rates. In flights a stiff tendon holds
it, which may also rise: a step of a difference would make it slack. Here the tension is the
multiplier that keeps the length.
"""

from typing import Any, Final, NamedTuple

import numpy as np

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.closed_loop.loop import ClosedLoop
from tiltsim.vehicles.rotorcraft.others import SWING
from tiltsim_controllers.mathematics.attitude import (
    quaternion_of_rotation,
    quaternion_product,
    rotation_of_quaternion,
)
from tiltsim_controllers.mathematics.scalar import Floats, Triple
from tiltsim_controllers.vehicle.body import BODY_FIELDS, ROTATION_NAMES

MATRIX: Final = 9
QUATERNION: Final = 4

POSITION: Final = BODY_FIELDS[:3]
VELOCITY: Final = BODY_FIELDS[3:6]
BODY_RATES: Final = BODY_FIELDS[9:]
PLANE: Final = ("x", "y", "vx", "vy")
SWING_RATES: Final = ("swing_rate_x", "swing_rate_y")
UNITS: Final = {
    **dict.fromkeys(POSITION, "m"),
    **dict.fromkeys(VELOCITY, "m/s"),
    **dict.fromkeys((*ROTATION_NAMES, "roll", "pitch", "yaw"), "rad"),
    **dict.fromkeys((*BODY_RATES, *SWING_RATES), "rad/s"),
    **dict.fromkeys(("squared_speed_1", "squared_speed_2"), "rad^2/s^2"),
    "force": "N",
    **dict.fromkeys(("torque_x", "torque_y", "torque_z"), "N m"),
}
ROTOR_INPUT: Final = "rotor_acceleration"
KINDS: Final = {
    "alpha_rate": "rad/s",
    "alpha": "rad",
    "rotor_speed": "rad/s",
    "speed_command": "rad/s",
    ROTOR_INPUT: "rad/s^2",
    "tilt_command": "rad",
}
"""Units of numbered quantities."""


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


def _turn_rates(rotation: Floats, derivative: Floats) -> Floats:
    """The body rates of a rotation, from the derivative of its entries."""
    if len(rotation) == QUATERNION:
        inverse = rotation * (1.0, -1.0, -1.0, -1.0)
        return np.asarray(2.0 * quaternion_product(inverse, derivative)[1:])
    skew = rotation.reshape(3, 3).T @ derivative.reshape(3, 3)
    turning = (skew[2, 1] - skew[1, 2], skew[0, 2] - skew[2, 0], skew[1, 0] - skew[0, 1])
    return 0.5 * np.array(turning)


def _quaternion(rotation: Floats) -> Floats:
    """The unit quaternion of a rotation, which may be a matrix."""
    if len(rotation) == MATRIX:
        rotation = quaternion_of_rotation(rotation.reshape(3, 3))
    return rotation / np.linalg.norm(rotation)


def _turned(rotation: Floats, vector: Floats) -> Floats:
    """A rotation, turned by a vector in body axes."""
    half = 0.5 * float(np.linalg.norm(vector))
    turn = np.array((np.cos(half), *(0.5 * np.sinc(half / np.pi) * vector)))
    turned = quaternion_product(_quaternion(rotation), turn)
    if len(rotation) == MATRIX:
        return rotation_of_quaternion(turned).ravel()
    return turned


def _turn(start: Floats, end: Floats) -> Floats:
    """The vector, in the axes of ``start``, of the turn from one rotation to another."""
    inverse = _quaternion(start) * (1.0, -1.0, -1.0, -1.0)
    turn = quaternion_product(inverse, _quaternion(end))
    if turn[0] < 0.0:
        turn = -turn
    half = np.arctan2(np.linalg.norm(turn[1:]), turn[0])
    return np.asarray(2.0 * turn[1:] / np.sinc(half / np.pi))


def unit_of(name: str, loop: ClosedLoop) -> str:
    """The unit of a state, input or output; empty where it is not known."""
    known = UNITS.get(name) or loop.units.get(name)
    kinds = (unit for kind, unit in KINDS.items() if name.startswith(kind))
    return known or next(kinds, "")


def numbered(kind: str, count: int) -> tuple[str, ...]:
    """``kind_1``, ``kind_2`` and so on."""
    return tuple(f"{kind}_{index}" for index in range(1, count + 1))


def is_of_vehicle(state: str) -> bool:
    """Whether a state is the vehicle's, not one of its controller or of commands under way."""
    return state in BODY_FIELDS or state.startswith(("rotation_", "alpha", "rotor_speed", "swing_"))


def activation_names(loop: ClosedLoop) -> tuple[str, ...]:
    """Rotor speeds, states of the controller, and states of the layers, as in `act`.

    A layer of actuators has the speeds that it commands, and the commands under way, the newest
    first: ``_late_1`` arrives last.
    """
    inner = loop
    while inner.within is not None:
        inner = inner.within
    own = loop.controller_states
    rotors = loop.sizes.act - own - sum(extra.states for extra in loop.extra_actuators)
    layers: list[str] = []
    for extra in loop.extra_actuators:
        if extra.begins_with_rotor_speeds:
            layers += numbered("speed_command", rotors)
            tilts = numbered("tilt_command", extra.memories - rotors)
            sent = (*tilts, *numbered(ROTOR_INPUT, rotors))
            places = (extra.states - rotors) // extra.memories
            layers += [f"{name}_late_{place + 1}" for place in range(places) for name in sent]
        else:
            layers += extra.names
    return (*numbered("rotor_speed", rotors), *inner.fields[:own], *layers)


def mujoco_coordinates(loop: ClosedLoop) -> Coordinates:
    """Coordinates of `qpos`, `qvel` and `act`."""
    places, speeds = loop.motion
    swing, swinging = (SWING, SWING_RATES) if loop.sizes.others else ((), ())
    return _coordinates(
        (*places, *swing, *speeds, *swinging, *activation_names(loop)), loop, QUATERNION
    )


def equation_coordinates(assembly: Assembly, size: int) -> Coordinates:
    """Coordinates of a state of the equations of this size; a rigid body has MuJoCo's."""
    loop = assembly.loop
    if assembly.scenario.simulation.plant != "thesis":
        return mujoco_coordinates(loop)
    names = loop.required_equations.states
    if loop.within is not None:
        names = (*names, *activation_names(loop))
    further = size - len(names) - (MATRIX - 3 if ROTATION_NAMES[0] in names else 0)
    return _coordinates((*names, *loop.fields[:further]), loop, MATRIX)


def _coordinates(names: tuple[str, ...], loop: ClosedLoop, rotation: int) -> Coordinates:
    """The coordinates of these names; a rotation among them has ``rotation`` entries."""
    rotation = rotation if ROTATION_NAMES[0] in names else 0
    first = names.index(ROTATION_NAMES[0]) if rotation else 0
    return Coordinates(names, tuple(unit_of(name, loop) for name in names), rotation, first)


def entry_names(found: Coordinates) -> tuple[str, ...]:
    """Names of the entries of a state: the coordinates', and a name for each of its rotation."""
    names, first = found.names, found.first
    if not found.rotation:
        return names
    parts = "wxyz" if found.rotation == QUATERNION else [f"{i}{j}" for i in "123" for j in "123"]
    kind = "quaternion" if found.rotation == QUATERNION else "rotation"
    return (*names[:first], *(f"{kind}_{part}" for part in parts), *names[first + 3 :])


class Input(NamedTuple):
    """An input of the vehicle, as a controller commands it."""

    name: str
    place: int  # among the controls of the model or the inputs of the equations
    per_unit: float = 1.0  # of these, a unit of the input


def control_inputs(assembly: Assembly) -> tuple[Input, ...]:
    """Inputs of the vehicle among the controls of its model."""
    loop = assembly.loop
    places, rotors = loop.motion[0], len(loop.kind.rotors)
    tilts = [name.replace("alpha", "tilt_command") for name in places if name.startswith("alpha")]
    kind, first, per_unit = ROTOR_INPUT, len(tilts) + rotors, 1.0
    if loop.commands_thrusts:  # as squared rotor speeds
        per_unit = 1.0 / assembly.scenario.vehicle.resolve().thrust_coefficient
        kind, first = "thrust", len(tilts)
    speeds = (Input(n, first + i, per_unit) for i, n in enumerate(numbered(kind, rotors)))
    return (*speeds, *(Input(name, index) for index, name in enumerate(tilts)))


def equation_inputs(assembly: Assembly) -> tuple[Input, ...]:
    """Inputs of the vehicle among the inputs of the equations."""
    equations = assembly.loop.equations
    if equations is None or not equations.input_names:
        return control_inputs(assembly)
    return tuple(Input(name, index) for index, name in enumerate(equations.input_names))


FREE: tuple[slice, slice] = (slice(-7, None), slice(-6, None))
"""Where the load's free joint is in ``qpos`` and ``qvel``."""


class Pendulum(NamedTuple):
    """A load on a cable below a vehicle, whose free joint is the first of ``qpos``."""

    length: float  # m, of the cable
    attachment: Triple  # m, body axes

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

    def distance(self, qpos: Floats, qvel: Floats) -> float:
        """The load's distance (m) from the attachment, by the motion in MuJoCo."""
        return float(np.linalg.norm(qpos[FREE[0]][:3] - qpos[:3] - self._attached(qpos, qvel)[0]))

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
