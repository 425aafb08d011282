"""Names and units of the states and inputs of a closed loop on its plant."""

from __future__ import annotations

from typing import Final, NamedTuple

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.closed_loop.loop import ClosedLoop
from tiltsim.linear.coordinates import MATRIX, QUATERNION, ROTATION_NAMES, Coordinates
from tiltsim.models.rotor_table import Multirotor
from tiltsim.vehicles.rotorcraft.layout import layout_of
from tiltsim_controllers.vehicle.states import BODY_FIELDS

POSITION: Final = BODY_FIELDS[:3]
VELOCITY: Final = BODY_FIELDS[3:6]
BODY_RATES: Final = BODY_FIELDS[9:]
PLANE: Final = ("x", "y", "vx", "vy")
UNITS: Final = {
    **dict.fromkeys(POSITION, "m"),
    **dict.fromkeys(VELOCITY, "m/s"),
    **dict.fromkeys((*ROTATION_NAMES, "roll", "pitch", "yaw"), "rad"),
    **dict.fromkeys(BODY_RATES, "rad/s"),
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
    return state in BODY_FIELDS or state.startswith(("rotation_", "alpha", "rotor_speed"))


def activation_names(loop: ClosedLoop) -> tuple[str, ...]:
    """Rotor speeds, states of the controller, and states of the layers, as in `act`.

    A layer of actuators has the speeds that it commands, and the commands under way, the newest
    first: ``_late_1`` arrives last.
    """
    inner = loop
    while inner.within is not None:
        inner = inner.within
    dynamics, names = loop.dynamics, inner.columns.fields
    own = dynamics.controller_states
    if len(names) != own:
        names = numbered("law", own)
    rotors = dynamics.sizes.act - own - sum(extra.states for extra in dynamics.extra_actuators)
    layers: list[str] = []
    for index, extra in enumerate(dynamics.extra_actuators):
        if extra.begins_with_rotor_speeds:
            layers += numbered("speed_command", rotors)
            tilts = numbered("tilt_command", extra.memories - rotors)
            sent = (*tilts, *numbered(ROTOR_INPUT, rotors))
            places = (extra.states - rotors) // extra.memories
            layers += [f"{name}_late_{place + 1}" for place in range(places) for name in sent]
        else:
            layers += numbered(f"layer_{index}_state", extra.states)
    return (*numbered("rotor_speed", rotors), *names, *layers)


def mujoco_coordinates(loop: ClosedLoop) -> Coordinates:
    """Coordinates of `qpos`, `qvel` and `act`."""
    sizes = loop.dynamics.sizes
    if loop.dynamics.model == "tilt_car":
        names = ("x", "y", "yaw", "alpha", "vx", "vy", "r", "alpha_rate")
        return _coordinates((*names, *activation_names(loop)), loop, 0)
    tilts = sizes.qpos - len(POSITION) - QUATERNION
    places = (*POSITION, *ROTATION_NAMES, *numbered("alpha", tilts))
    speeds = (*VELOCITY, *BODY_RATES, *numbered("alpha_rate", tilts))
    return _coordinates((*places, *speeds, *activation_names(loop)), loop, QUATERNION)


def equation_coordinates(assembly: Assembly, size: int) -> Coordinates:
    """Coordinates of a state of the equations of this size; a rigid body has MuJoCo's."""
    loop, model = assembly.loop, assembly.scenario.vehicle.model
    if assembly.scenario.simulation.plant == "rigid_body":
        return mujoco_coordinates(loop)
    rotation = 0 if model in {"quadrotor", "tilt_car"} else MATRIX
    body = BODY_FIELDS
    if rotation:
        body = (*POSITION, *VELOCITY, *ROTATION_NAMES, *BODY_RATES)
    if model != "tilt_car" and loop.within is not None:
        tilts = layout_of(loop.dynamics).tilts
        servos = (*numbered("alpha", tilts), *numbered("alpha_rate", tilts))
        names = (*body, *servos, *activation_names(loop))
    elif model == "tilt_car":
        driven = ("alpha", "rotor_speed_1", "rotor_speed_2")
        names = (*PLANE, *(driven if size > len(PLANE) else ()))
    else:
        rotors = numbered("rotor_speed", len(loop.dynamics.spins)) if rotation else ()
        names = (*body, *rotors)
    further = size - len(names) - (rotation - 3 if rotation else 0)
    own = loop.columns.fields if len(loop.columns.fields) == further else numbered("law", further)
    return _coordinates((*names, *own), loop, rotation)


def _coordinates(names: tuple[str, ...], loop: ClosedLoop, rotation: int) -> Coordinates:
    first = names.index(ROTATION_NAMES[0]) if rotation else 0
    return Coordinates(names, tuple(unit_of(name, loop) for name in names), rotation, first)


class Input(NamedTuple):
    """An input of the vehicle, as a controller commands it."""

    name: str
    place: int  # among the controls of the model or the inputs of the equations
    per_unit: float = 1.0  # of these, a unit of the input


def control_inputs(assembly: Assembly) -> tuple[Input, ...]:
    """Inputs of the vehicle among the controls of its model."""
    dynamics = assembly.loop.dynamics
    rotors, sizes = len(dynamics.spins), dynamics.sizes
    if dynamics.model == "tilt_car":
        rotors = 2
        named: tuple[str, ...] = ("tilt_command",)
    else:
        named = numbered("tilt_command", sizes.qpos - len(POSITION) - QUATERNION)
    tilts = len(named)
    kind, first, per_unit = ROTOR_INPUT, tilts + rotors, 1.0
    if dynamics.commands_thrusts:  # as squared rotor speeds
        vehicle = assembly.scenario.vehicle.resolve()
        assert not isinstance(vehicle, Multirotor)  # its controllers command rates of rotor speeds
        per_unit = 1.0 / vehicle.thrust_coefficient
        kind, first = "thrust", tilts
    speeds = (Input(n, first + i, per_unit) for i, n in enumerate(numbered(kind, rotors)))
    return (*speeds, *(Input(name, index) for index, name in enumerate(named)))


def equation_inputs(assembly: Assembly, size: int) -> tuple[Input, ...]:
    """Inputs of the vehicle among the ``size`` inputs of the equations."""
    loop, model = assembly.loop, assembly.scenario.vehicle.model
    if model != "tilt_car" and loop.within is not None:
        return control_inputs(assembly)
    if model == "quadrotor":
        names: tuple[str, ...] = ("force", "torque_x", "torque_y", "torque_z")
    elif model == "tilt_car":
        names = ("squared_speed_1", "squared_speed_2")
        if size > len(names):
            names = (*numbered(ROTOR_INPUT, 2), "alpha_rate")
    else:
        # Further inputs turn the arms if they integrate to commands of tilts.
        commands = (f for f in loop.columns.fields if f.startswith("tilt_command"))
        rates = (command.replace("tilt_command", "alpha_rate") for command in commands)
        names = (*numbered(ROTOR_INPUT, len(loop.dynamics.spins)), *rates)
    return tuple(Input(name, index) for index, name in enumerate(names))
