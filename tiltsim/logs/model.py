"""The model that replay and identification fly: a rigid body on the inputs of a log, in JAX.

Forces and torques, Euler's equation and drag are the functions of the vehicles' plants
(`tiltsim_controllers.vehicle`), whose parameters are numbers to be found here.
"""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from tiltsim.errors import InputError
from tiltsim.scenario.messages import choose
from tiltsim.scenario.scenario import Scenario
from tiltsim.system.text import short_repr
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.mathematics.attitude import quaternion_product, rotation_of_quaternion
from tiltsim_controllers.mathematics.linear import cross, norm
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.air import Drag, drag_force
from tiltsim_controllers.vehicle.body import Body, accelerations
from tiltsim_controllers.vehicle.rotors import Rotors, TiltOfRotor, rotors_in, tilts_of, wrench_map


class Parameter(NamedTuple):
    """A number or vector that a log may tell."""

    field: str  # the model's number
    unit: str  # its unit
    nominal: Floats  # its value in the scenario, shape (n,)
    scale: Floats  # a change that counts as large, in the unit, shape (n,)


FACTORS: Final = tuple(
    f"model_error.{key}" for key in ("mass", "inertia", "thrust_coefficient", "drag_coefficient")
)
"""Parameters as factors on the values of the scenario."""

CONJUGATE: Final = np.array([1.0, -1.0, -1.0, -1.0])

TINY: Final = 1e-12  # velocity (m/s) at which the drag of a vehicle at rest still has a derivative


class LoggedVehicle:
    """A scenario's vehicle as a model of a log, and its parameters by key.

    Args:
        scenario: The scenario of a rotorcraft.

    Raises:
        InputError: If it is of another vehicle.
    """

    def __init__(self, scenario: Scenario) -> None:
        scenario.require_rotorcraft("identify")
        scenario.require_alone("identify")
        table = scenario.any_rotorcraft
        vehicle = self.vehicle = scenario.model_error.apply(table.multirotor)
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


def numbers_of(free: tuple[tuple[str, str], ...], known: Any, theta: Any) -> dict[str, Any]:
    """The numbers of a model by name, of which some are free.

    Args:
        free: Key and field of each free parameter.
        known: See `LoggedVehicle.numbers`, with ``starts`` and ``scales`` by key.
        theta: Changes of the free parameters, in their scales.
    """
    import jax.numpy as jnp

    values, first = dict(known["nominal"]), 0
    for key, field in free:
        size = len(values[field])
        change = known["scales"][key] * theta[first : first + size]
        value = known["starts"][key] + change
        values[field] = value * values[field] if key.startswith("model_error.") else value
        first += size
    stretch = jnp.sqrt(values["inertia"] / jnp.diag(known["inertia"]))
    inertia = known["inertia"] * jnp.outer(stretch, stretch)
    thrust, torque = (values[name] / known["nominal"][name] for name in ("thrust", "torque"))
    parts = zip(known["pushes"], known["turns"], strict=True)
    return {
        "body": Body(
            values["mass"][0], known["gravity"], inertia.ravel(), jnp.linalg.inv(inertia).ravel()
        ),
        "rotors": tuple((thrust * push + torque * turn).ravel() for push, turn in parts),
        "center": values["center"],
        "drag": Drag(values["resistance"], known["area"], known["density"]),
        "lag": values["lag"][0],
        "frequency": values["frequency"][0],
        "damping": known["damping"],
        "bias": values["bias"],
    }


class LoggedMotion:
    """The equations of a vehicle's model for one layout, as functions of small arrays.

    A state is position, velocity, quaternion, body rates, speeds that follow commands, tilts that
    do, and their rates.

    Args:
        layout: The tilt of each rotor.
        fields: The free numbers; with ``lag`` and ``frequency`` among them, the rotors and the
            tilts follow commands, else the log.
    """

    def __init__(self, layout: TiltOfRotor, fields: frozenset[str]) -> None:
        self._layout, self._fields = layout, fields
        self._rotors, self._tilts = len(layout), tilts_of(layout)

    def start(self, guess: Any, initial: Any, speeds: Any, tilts: Any, center: Any) -> Any:
        """The first state of a window.

        Args:
            guess: Measured position, velocity, quaternion and body rates, shape (13,).
            initial: Their changes, the rotation's as a small turn, shape (12,).
            speeds, tilts: Measured, rad/s and rad.
            center: The center of mass, from its place in the scenario, m, shape (3,).
        """
        small = xp.hstack([1.0, 0.5 * initial[6:9]])
        turn = quaternion_product(guess[6:10], small / norm(small))
        rotation, omega = rotation_of_quaternion(turn), guess[10:] + initial[9:]
        place = guess[:3] + initial[:3] + rotation @ center
        velocity = guess[3:6] + initial[3:6] + rotation @ cross(omega, center)
        return xp.hstack([place, velocity, turn, omega, speeds, tilts, 0.0 * tilts])

    def rate(self, state: Any, speeds: Any, tilts: Any, commands: Any, p: dict[str, Any]) -> Any:
        """The derivative of a state.

        Args:
            state: See the class.
            speeds, tilts: Measured, rad/s and rad, shapes (N,) and (M,).
            commands: Speeds (rad/s), then tilts (rad), shape (N + M,).
            p: See `numbers_of`.
        """
        n, m = self._rotors, self._tilts
        velocity, turn, omega = state[3:6], state[6:10], state[10:13]
        lagging, followed = state[13 : 13 + n], state[13 + n :]
        pods, pod_rates = followed[:m], followed[m:]
        speeds = lagging if "lag" in self._fields else speeds
        tilts = pods if "frequency" in self._fields else tilts
        parts = (part.reshape(6, n) for part in p["rotors"])
        rotors = Rotors(self._layout, np.ones(n), *parts)
        wrench = wrench_map(rotors, tilts) @ (speeds * abs(speeds))
        rotation = rotation_of_quaternion(turn)
        force = wrench[:3] + drag_force(rotation.T @ velocity + TINY, p["drag"])
        torque = wrench[3:] - cross(p["center"], wrench[:3])
        acceleration, spin = accelerations(
            p["body"], rotation, omega, xp.hstack([force, torque]), np.zeros(3), 1.0
        )
        pull = p["frequency"] * p["frequency"] * (commands[n:] - pods)
        return xp.hstack(
            [
                velocity,
                acceleration,
                0.5 * quaternion_product(turn, xp.hstack([0.0, omega])),
                spin,
                (commands[:n] - lagging) / p["lag"],
                pod_rates,
                pull - 2.0 * p["damping"] * p["frequency"] * pod_rates,
            ]
        )

    def errors(self, state: Any, measured: Any, p: dict[str, Any]) -> Any:
        """Measured minus predicted position, velocity, small turn and body rates, shape (12,).

        Args:
            state: See the class.
            measured: Position, velocity, quaternion and body rates, shape (13,).
            p: See `numbers_of`.
        """
        rotation, omega = rotation_of_quaternion(state[6:10]), state[10:13]
        error = quaternion_product(state[6:10] * CONJUGATE, measured[6:10])
        return xp.hstack(
            [
                measured[:3] - (state[:3] - rotation @ p["center"]),
                measured[3:6] - (state[3:6] - rotation @ cross(omega, p["center"])),
                xp.where(error[0] < 0.0, -2.0, 2.0) * error[1:],
                measured[10:] - (omega + p["bias"]),
            ]
        )
