"""The model that replay and identification fly: a rigid body on the inputs of a log, in JAX.

Forces and torques, Euler's equation and drag are the functions of the vehicles' plants
(`tiltsim_controllers.vehicle`), whose parameters are numbers to be found here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from tiltsim.errors import InputError
from tiltsim.logs.windows import Windows
from tiltsim.models.cross import as_multirotor
from tiltsim.scenario.messages import choose
from tiltsim.scenario.scenario import Scenario
from tiltsim.system.text import short_repr
from tiltsim_controllers.mathematics.attitude import quaternion_product, rotation_of_quaternion
from tiltsim_controllers.mathematics.linear import cross
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.air import Drag, drag_force
from tiltsim_controllers.vehicle.body import Body
from tiltsim_controllers.vehicle.effectiveness import TiltOfRotor
from tiltsim_controllers.vehicle.motion import accelerations
from tiltsim_controllers.vehicle.rotors import Rotors, rotors_in, wrench_map


class Parameter(NamedTuple):
    """A number or vector that a log may tell.

    Attributes:
        field: The model's number.
        unit: Its unit.
        nominal: Its value in the scenario, shape (n,).
        scale: A change that counts as large, in the unit, shape (n,).
    """

    field: str
    unit: str
    nominal: Floats
    scale: Floats


FACTORS: Final = tuple(
    f"model_error.{key}" for key in ("mass", "inertia", "thrust_coefficient", "drag_coefficient")
)
"""Parameters as factors on the values of the scenario."""

CONJUGATE: Final = np.array([1.0, -1.0, -1.0, -1.0])

TINY: Final = 1e-12
"""Velocity (m/s) at which the drag of a vehicle at rest still has a derivative."""

STAGE_INPUTS: Final = np.array([0, 1, 1, 2])
"""Half steps after the beginning of a step at which the stages of RK4 take their inputs."""

RUNGE_KUTTA: Final = (
    np.array([0.0, 0.5, 0.5, 1.0]),
    np.array([1.0, 2.0, 2.0, 1.0]) / 6.0,
    np.array([False, False, False, True]),
)
"""By stage: how far along the last slope, the weight of its slope, and whether it ends the step."""

INITIAL: Final = 12
"""Numbers of a window's initial state: position, velocity, small turn, body rates."""


class LoggedVehicle:
    """A scenario's vehicle as a model of a log, and its parameters by key.

    Args:
        scenario: The scenario of a rotorcraft.

    Raises:
        InputError: If it is of another vehicle.
    """

    def __init__(self, scenario: Scenario) -> None:
        if scenario.vehicle.model == "tilt_car":
            raise InputError(f"{scenario.address}: vehicle.model: takes rotorcraft only")
        table = scenario.any_rotorcraft
        tilting = table.has_tilting_rotors
        assumed = as_multirotor(table.resolve(), tilting=tilting)
        vehicle = self.vehicle = scenario.model_error.apply_to_rotors(assumed)
        drag, servo = scenario.air.drag, table.tilt_servo
        mean = np.array([np.mean(vehicle.thrust_coefficients)])
        torque = np.array([np.mean([rotor.drag for rotor in vehicle.rotors])])
        inertia = np.reshape(vehicle.inertia, (3, 3))
        moments = np.diag(inertia).copy()
        lag = np.array([table.rotor_time_constant or 0.02])
        frequency = np.array([servo.natural_frequency])
        mass, three = np.array([vehicle.mass]), np.ones(3)
        resistance = np.array(drag.linear)
        self.parameters: dict[str, Parameter] = {
            "vehicle.mass": Parameter("mass", "kg", mass, mass),
            "vehicle.inertia": Parameter("inertia", "kg m^2", moments, moments),
            "vehicle.center_of_mass": Parameter("center", "m", 0.0 * three, 0.01 * three),
            "vehicle.thrust_coefficient": Parameter("thrust", "N s^2/rad^2", mean, mean),
            "vehicle.drag_coefficient": Parameter("torque", "N m s^2/rad^2", torque, torque),
            "vehicle.rotor_time_constant": Parameter("lag", "s", lag, lag),
            "vehicle.tilt_servo.natural_frequency": Parameter(
                "frequency", "rad/s", frequency, frequency
            ),
            "air.drag.linear": Parameter("resistance", "N s/m", resistance, 0.1 * mass * three),
            "sensors.body_rates_bias": Parameter("bias", "rad/s", 0.0 * three, 0.01 * three),
        }
        nominal = {one.field: one.nominal for one in self.parameters.values()}
        for key in FACTORS:
            found = self.parameters[key.replace("model_error.", "vehicle.")]
            size = np.ones(len(found.nominal))
            self.parameters[key] = Parameter(found.field, "-", size, size)
        pushes, turns = (
            rotors_in(np.concatenate(tables), 0, vehicle.tilt_of_rotor)[2:]
            for tables in (
                [rotor._replace(drag=0.0).entries for rotor in vehicle.rotors],
                [rotor._replace(thrust=0.0).entries for rotor in vehicle.rotors],
            )
        )
        self.numbers: dict[str, Any] = {
            "nominal": nominal,
            "inertia": inertia,
            "pushes": pushes,
            "turns": turns,
            "gravity": vehicle.gravity,
            "damping": servo.damping_ratio,
            "area": np.array(drag.area),
            "density": scenario.air.density,
        }
        """Arrays of the model, so that vehicles of one layout share a compiled program."""

    def chosen(self, free: Sequence[str]) -> dict[str, Parameter]:
        """Parameters by key. Raises `InputError` for an unknown key, or two keys of one number."""
        if isinstance(free, str) or not free:
            raise InputError(f"free = {free!r}: must be keys: {', '.join(self.parameters)}")
        fields: dict[str, str] = {}
        for key in free:
            if key not in self.parameters:
                raise InputError(f"free = {short_repr(key)}: {choose(key, self.parameters)}")
            field = self.parameters[key].field
            if field in fields:
                raise InputError(f"free: {fields[field]} and {key} are one number; give one")
            fields[field] = key
        return {key: self.parameters[key] for key in free}


def _values(free: tuple[tuple[str, str], ...], numbers: Any, theta: Any) -> dict[str, Any]:
    """Numbers of the model by field.

    Args:
        free: Key and field of each free parameter.
        numbers: See `LoggedVehicle.numbers`, with ``starts`` and ``scales`` by key.
        theta: Changes of the free parameters, in their scales.
    """
    found, first = dict(numbers["nominal"]), 0
    for key, field in free:
        size = len(found[field])
        change = numbers["scales"][key] * theta[first : first + size]
        value = numbers["starts"][key] + change
        found[field] = value * found[field] if key.startswith("model_error.") else value
        first += size
    return found


def _body_and_rotors(layout: TiltOfRotor, numbers: Any, values: Any) -> tuple[Body, Rotors]:
    """Mass, inertia and rotors with the model's numbers."""
    import jax.numpy as jnp

    size = jnp.sqrt(values["inertia"] / jnp.diag(numbers["inertia"]))
    inertia = numbers["inertia"] * jnp.outer(size, size)
    inverse = jnp.linalg.inv(inertia)
    places = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    entries = [matrix[place] for matrix in (inertia, inverse) for place in places]
    nominal = numbers["nominal"]
    thrust = values["thrust"] / nominal["thrust"]
    torque = values["torque"] / nominal["torque"]
    parts = [
        thrust * push + torque * turn
        for push, turn in zip(numbers["pushes"], numbers["turns"], strict=True)
    ]
    body = Body(values["mass"][0], numbers["gravity"], *entries)
    return body, Rotors(layout, jnp.ones(len(layout)), *parts)


def residuals_of(layout: TiltOfRotor, free: tuple[tuple[str, str], ...]) -> Callable[..., Any]:
    """The residuals of one window: ``(theta, initial, guess, window, noise, numbers)``.

    ``initial`` are changes of the initial state ``guess``; the result has a row per sample and a
    column per channel, (measured - predicted) over its noise, 0 where nothing is measured.

    Args:
        layout: The tilt of each rotor.
        free: Key and field of each free parameter.
    """
    import jax
    import jax.numpy as jnp

    fields = {field for _, field in free}

    def residuals(
        theta: Any, initial: Any, guess: Any, window: Windows, noise: Any, numbers: Any
    ) -> Any:
        values = _values(free, numbers, theta)
        body, rotors = _body_and_rotors(layout, numbers, values)
        center = values["center"]
        drag = Drag(values["resistance"], numbers["area"], numbers["density"])
        path = _flown(
            fields, values, body, rotors, drag, numbers["damping"], initial, guess, window
        )
        rotation = jax.vmap(rotation_of_quaternion)(path[2])
        spun = jax.vmap(cross, (0, None))(path[3], center)
        error = jax.vmap(quaternion_product)(path[2] * CONJUGATE, window.attitude)
        channels = {
            "position": window.position - (path[0] - rotation @ center),
            "velocity": window.velocity - (path[1] - jnp.einsum("kij,kj->ki", rotation, spun)),
            "attitude": 2.0 * error[:, 1:] * jnp.sign(error[:, :1]),
            "body_rates": window.body_rates - (path[3] + values["bias"]),
        }
        parts = [channels[name] / noise[name] for name in channels if name in noise]
        if "lag" in fields:
            parts.append((at_samples(window.speeds) - path[4]) / noise["rotor_speeds"])
        if "frequency" in fields:
            parts.append((at_samples(window.tilts) - path[5][:, 0]) / noise["tilt_angles"])
        found = jnp.concatenate(parts, axis=1)
        return jnp.where(jnp.isfinite(found), found, 0.0)

    def at_samples(stages: Any) -> Any:
        return jnp.concatenate([stages[:, 0], stages[-1:, -1]])

    return residuals


def _along(state: Any, slope: Any, step: Any) -> Any:
    """A state after a step along a slope."""
    import jax

    return jax.tree.map(lambda a, b: a + step * b, state, slope)


def _runge_kutta(rate: Callable[..., Any]) -> Callable[..., Any]:
    """The fourth-order method from one sample to the next: ``(state, inputs) -> (state, state)``.

    Args:
        rate: ``(state, speeds, tilts, command)``: the derivative of a state.
    """
    import jax
    import jax.numpy as jnp

    def stage(carried: Any, given: Any) -> tuple[Any, None]:
        # One stage for all four of RK4: the program is compiled once, not four times.
        base, slope, total, size = carried
        speeds, tilts, command, (reach, weight, is_last) = given
        slope = rate(_along(base, slope, reach * size), speeds, tilts, command)
        total = _along(total, slope, weight * size)
        base = jax.tree.map(lambda old, new: jnp.where(is_last, new, old), base, total)
        return (base, slope, total, size), None

    def advance(state: Any, given: Any) -> tuple[Any, Any]:
        step, speeds, tilts, command = given
        substeps = (len(speeds) - 1) // 2
        at = (2 * np.arange(substeps)[:, None] + STAGE_INPUTS).ravel()
        held = jax.tree.map(lambda one: jnp.tile(one, (4 * substeps, 1)), command)
        schedule = tuple(np.tile(one, substeps) for one in RUNGE_KUTTA)
        carried = (state, jax.tree.map(jnp.zeros_like, state), state, step / substeps)
        carried, _ = jax.lax.scan(stage, carried, (speeds[at], tilts[at], held, schedule))
        return carried[0], carried[0]

    return advance


def _flown(
    fields: set[str],
    values: Any,
    body: Body,
    rotors: Rotors,
    drag: Drag,
    damping: Any,
    initial: Any,
    guess: Any,
    window: Windows,
) -> Any:
    """The states at all samples of a window: RK4 between them.

    Args:
        fields: The free numbers; with the lag and the servo's frequency among them, rotor speeds
            and tilts follow their commands.
        values, body, rotors, drag, damping: The model.
        initial, guess, window: See `residuals_of`.
    """
    import jax
    import jax.numpy as jnp

    center, frequency = values["center"], values["frequency"][0]

    def rate(state: Any, speeds: Any, tilts: Any, command: Any) -> Any:
        _, velocity, turn, omega, lagging, pods = state
        if "lag" in fields:
            speeds = lagging
        if "frequency" in fields:
            tilts = pods[0]
        rotation = rotation_of_quaternion(turn)
        wrench = wrench_map(rotors, tilts) @ (speeds * abs(speeds))
        force, torque = wrench[:3], wrench[3:] - cross(center, wrench[:3])
        force = force + drag_force(rotation.T @ velocity + TINY, drag)
        wrench = jnp.concatenate([force, torque])
        acceleration, spin = accelerations(body, rotation, omega, wrench, 0.0, 1.0)
        pull = frequency**2 * (command[1] - pods[0]) - 2.0 * damping * frequency * pods[1]
        return (
            velocity,
            acceleration,
            0.5 * quaternion_product(turn, jnp.concatenate([jnp.zeros(1), omega])),
            spin,
            (command[0] - lagging) / values["lag"][0],
            jnp.stack([pods[1], pull]),
        )

    place, velocity, turn, omega = guess
    small = jnp.concatenate([jnp.ones(1), 0.5 * initial[6:9]])
    turn = quaternion_product(turn, small / jnp.sqrt(small @ small))
    omega = omega + initial[9:12]
    arm = rotation_of_quaternion(turn) @ center
    start = (
        place + initial[:3] + arm,
        velocity + initial[3:6] + rotation_of_quaternion(turn) @ cross(omega, center),
        turn,
        omega,
        window.speeds[0, 0],
        jnp.stack([window.tilts[0, 0], jnp.zeros(window.tilts.shape[-1])]),
    )
    commands = (window.speed_commands[:-1], window.tilt_commands[:-1])
    if "lag" not in fields:
        commands = (window.speeds[:, 0], commands[1])
    if "frequency" not in fields:
        commands = (commands[0], window.tilts[:, 0])
    _, path = jax.lax.scan(
        _runge_kutta(rate), start, (window.step, window.speeds, window.tilts, commands)
    )
    return jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), start, path)
