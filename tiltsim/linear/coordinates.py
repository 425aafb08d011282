"""Coordinates of a plant's state, three for a rotation, and names and units of inputs.

The names of a companion's, as of its columns, begin with its own.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.closed_loop.loop import ClosedLoop
from tiltsim.laws.assembling import assemble
from tiltsim.scenario.scenario import Scenario
from tiltsim.vehicles.rotorcraft.others import SWING
from tiltsim_controllers.mathematics import attitude
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.body import BODY_FIELDS, ROTATION_NAMES

MATRIX: Final = 9
QUATERNION: Final = 4

POSITION: Final = BODY_FIELDS[:3]
VELOCITY: Final = BODY_FIELDS[3:6]
BODY_RATES: Final = BODY_FIELDS[9:]
PLANE: Final = ("x", "y", "vx", "vy")
SWING_RATES: Final = ("swing_rate_x", "swing_rate_y")
LOAD: Final = "payload_"
"""Beginning of the names of a load's coordinates."""

UNITS: Final = {
    **dict.fromkeys(POSITION, "m"),
    **dict.fromkeys(VELOCITY, "m/s"),
    **dict.fromkeys((*ROTATION_NAMES, "roll", "pitch", "yaw", *SWING, "angle"), "rad"),
    **dict.fromkeys((*BODY_RATES, *SWING_RATES, "angle_rate"), "rad/s"),
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


Pairwise = Callable[[Floats, Floats], Floats]


class Coordinates(NamedTuple):
    """Minimal coordinates of the states near a given one.

    A state is a vector of numbers in which every rotation from body to world takes nine entries
    (rows first) or four (a quaternion). Its coordinates relative to another state are
    the differences of the numbers, and for a rotation the vector, in body axes, of the turn from
    the other state's.
    """

    names: tuple[str, ...]  # of the coordinates
    units: tuple[str, ...]
    rotation: int = 0  # entries of a rotation; 0 without one
    turns: tuple[int, ...] = ()  # index of the first coordinate of each rotation

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return len(self.names)

    def _parts(self, vector: Floats, entries: int) -> list[Floats]:
        """Numbers and rotations by turns, of a vector in which rotations have these entries."""
        firsts = (at + number * (entries - 3) for number, at in enumerate(self.turns))
        places = (0, *(place for at in firsts for place in (at, at + entries)), len(vector))
        return [vector[first:last] for first, last in pairwise(places)]

    def _joined(self, numbers: Pairwise, rotations: Pairwise, *pair: Iterable[Floats]) -> Floats:
        """A function of two vectors, part by part."""
        parts = enumerate(zip(*pair, strict=True))
        return np.concatenate([(numbers, rotations)[at % 2](*both) for at, both in parts])

    def moved(self, state: Floats, by: Floats) -> Floats:
        """The state with the coordinates ``by`` relative to another."""
        parts = self._parts(state, self.rotation), self._parts(by, 3)
        return self._joined(lambda one, more: one + more, _turned, *parts)

    def between(self, start: Floats, end: Floats) -> Floats:
        """The coordinates of the state ``end`` relative to ``start``."""
        parts = (self._parts(state, self.rotation) for state in (start, end))
        return self._joined(lambda one, other: other - one, _turn, *parts)

    def rates(self, state: Floats, derivative: Floats) -> Floats:
        """The rates of the coordinates relative to a state, from the derivative of its numbers."""
        parts = (self._parts(vector, self.rotation) for vector in (state, derivative))
        return self._joined(lambda _, rates: rates, _turn_rates, *parts)

    def level(self, state: Floats) -> Floats:
        """The state of which all coordinates are zero, with the size of another."""
        eye = np.eye(3).ravel() if self.rotation == MATRIX else np.eye(1, QUATERNION)[0]
        parts = self._parts(np.zeros(len(state)), self.rotation)
        return np.concatenate([eye if at % 2 else part for at, part in enumerate(parts)])


def _turn_rates(rotation: Floats, derivative: Floats) -> Floats:
    """The body rates of a rotation, from the derivative of its entries."""
    if len(rotation) == QUATERNION:
        inverse = rotation * (1.0, -1.0, -1.0, -1.0)
        return np.asarray(2.0 * attitude.quaternion_product(inverse, derivative)[1:])
    skew = rotation.reshape(3, 3).T @ derivative.reshape(3, 3)
    turning = (skew[2, 1] - skew[1, 2], skew[0, 2] - skew[2, 0], skew[1, 0] - skew[0, 1])
    return 0.5 * np.array(turning)


def _quaternion(rotation: Floats) -> Floats:
    """The unit quaternion of a rotation, which may be a matrix."""
    if len(rotation) == MATRIX:
        rotation = attitude.quaternion_of_rotation(rotation.reshape(3, 3))
    return rotation / np.linalg.norm(rotation)


def _turned(rotation: Floats, vector: Floats) -> Floats:
    """A rotation, turned by a vector in body axes."""
    half = 0.5 * float(np.linalg.norm(vector))
    turn = np.array((np.cos(half), *(0.5 * np.sinc(half / np.pi) * vector)))
    turned = attitude.quaternion_product(_quaternion(rotation), turn)
    if len(rotation) == MATRIX:
        return attitude.rotation_of_quaternion(turned).ravel()
    return turned


def _turn(start: Floats, end: Floats) -> Floats:
    """The vector, in the axes of ``start``, of the turn from one rotation to another."""
    inverse = _quaternion(start) * (1.0, -1.0, -1.0, -1.0)
    turn = attitude.quaternion_product(inverse, _quaternion(end))
    if turn[0] < 0.0:
        turn = -turn
    half = np.arctan2(np.linalg.norm(turn[1:]), turn[0])
    return np.asarray(2.0 * turn[1:] / np.sinc(half / np.pi))


def vehicles_of(
    assembly: Assembly, adapted: Callable[[ClosedLoop], ClosedLoop] = lambda loop: loop
) -> dict[str, Assembly]:
    """The flight of each vehicle by the beginning of the names of its columns, ``""`` first.

    Args:
        assembly: The flight.
        adapted: See `tiltsim.laws.assembling.assemble`; for the companions.
    """
    scenario = assembly.scenario
    if not scenario.companion:
        return {"": assembly}
    assert assembly.loop.within is not None  # the first vehicle's
    first = replace(assembly, loop=assembly.loop.within)
    flown = zip(scenario.companion, scenario.companions, strict=True)
    return {"": first, **{f"{table.name}_": assemble(own, adapted) for table, own in flown}}


def prefixes_of(scenario: Scenario) -> tuple[str, ...]:
    """Beginnings of the names of companions' and objects' coordinates."""
    companions = (f"{table.name}_" for table in scenario.companion)
    objects = (f"{table.name}_" for table in scenario.object)
    return (*companions, *objects, *([LOAD] if scenario.payload else []))


def parted(name: str, prefixes: Iterable[str]) -> tuple[str, str]:
    """The beginning of a name, empty for the first vehicle's, and the name without it."""
    prefix = max((each for each in prefixes if name.startswith(each)), key=len, default="")
    return prefix, name.removeprefix(prefix)


def unit_of(name: str, loop: ClosedLoop, prefixes: Iterable[str] = ()) -> str:
    """The unit of a state, input or output; empty where it is not known."""
    _, bare = parted(name, prefixes)
    known = UNITS.get(bare) or loop.units.get(name) or loop.units.get(bare)
    kinds = (unit for kind, unit in KINDS.items() if bare.startswith(kind))
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


def mujoco_coordinates(
    loop: ClosedLoop, vehicles: Mapping[str, Assembly], scenario: Scenario
) -> Coordinates:
    """Coordinates of `qpos`, `qvel` and `act`: the vehicles', then the objects' and the load's."""
    places: list[str] = []
    speeds: list[str] = []
    activations: list[str] = []
    for prefix, own in vehicles.items():
        parts = (*own.loop.motion, activation_names(own.loop))
        for names, found in zip((places, speeds, activations), parts, strict=True):
            names += [prefix + name for name in found]
    moving = [(f"{table.name}_", table.joint) for table in scenario.object]
    if scenario.payload is not None and not scenario.payload.rigid:
        moving.append((LOAD, "free"))
    for prefix, joint in moving:
        if joint == "free":
            places += [prefix + name for name in (*POSITION, *ROTATION_NAMES)]
            speeds += [prefix + name for name in (*VELOCITY, *BODY_RATES)]
        elif joint == "hinged":
            places, speeds = [*places, f"{prefix}angle"], [*speeds, f"{prefix}angle_rate"]
    every = (*places, *speeds, *activations)
    return _coordinates(every, loop, QUATERNION, prefixes_of(scenario))


def equation_coordinates(assembly: Assembly, size: int) -> Coordinates:
    """Coordinates of a state of the equations of this size; a rigid body has MuJoCo's."""
    loop = assembly.loop
    if assembly.scenario.simulation.plant != "thesis":
        return mujoco_coordinates(loop, {"": assembly}, assembly.scenario)
    names = loop.required_equations.states
    if loop.within is not None:
        names = (*names, *activation_names(loop))
    further = size - len(names) - (MATRIX - 3 if ROTATION_NAMES[0] in names else 0)
    return _coordinates((*names, *loop.fields[:further]), loop, MATRIX)


def _coordinates(
    names: tuple[str, ...], loop: ClosedLoop, rotation: int, prefixes: Iterable[str] = ()
) -> Coordinates:
    """The coordinates of these names; rotations among them have ``rotation`` entries."""
    turns = tuple(at for at, name in enumerate(names) if name.endswith(ROTATION_NAMES[0]))
    units = tuple(unit_of(name, loop, prefixes) for name in names)
    return Coordinates(names, units, rotation if turns else 0, turns)


def entry_names(found: Coordinates) -> tuple[str, ...]:
    """Names of the entries of a vehicle's state, one for each of its rotation."""
    names = found.names
    if not found.rotation:
        return names
    (first,) = found.turns
    parts = "wxyz" if found.rotation == QUATERNION else [f"{i}{j}" for i in "123" for j in "123"]
    kind = "quaternion" if found.rotation == QUATERNION else "rotation"
    return (*names[:first], *(f"{kind}_{part}" for part in parts), *names[first + 3 :])


class Input(NamedTuple):
    """An input of a vehicle, as its controller commands it."""

    name: str
    place: int  # among the controls of the vehicle's model or the inputs of its equations
    per_unit: float = 1.0  # of these, a unit of the input
    vehicle: int = 0  # its number


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
