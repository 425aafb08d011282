"""Common parts of closed loops with rotorcraft of any number of rotors and tilt hinges."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.closed_loop.loop import ControlSetup
from tiltsim.engines.sample_evaluation import evaluate_over_samples
from tiltsim.vehicles.rotorcraft.layout import QW, TILT_1, TILT_RATE_1, Layout
from tiltsim_controllers.analysis.singularity import world_up
from tiltsim_controllers.analysis.torque_free import (
    controlled_axes,
    decoupling_condition,
    margin_over_flight,
    torque_free_forces,
)
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.code.traceable import traceable
from tiltsim_controllers.gaits.motion import tilt_motion_of
from tiltsim_controllers.gaits.parameters import GaitParameters
from tiltsim_controllers.laws.failures import UNHARMED, Failure
from tiltsim_controllers.mathematics.attitude import euler_angles
from tiltsim_controllers.mathematics.scalar import Floats, Values, Vector
from tiltsim_controllers.vehicle.effectiveness import force_and_torque

if TYPE_CHECKING:
    from tiltsim.scenario.rotorcraft import ServoTable


@cache
def seen_of(layout: Layout, states: int, measured: bool) -> Callable[..., tuple[Values, ...]]:
    """A law's view of MuJoCo's vectors: ``(qpos, qvel, act)``.

    It returns the vehicle's state (`tiltsim_controllers.vehicle.states.RotorcraftState` in one
    vector), its tilt rates (rad/s) and the controller's states.

    Args:
        layout: Layout of the vehicle.
        states: Number of the controller's states.
        measured: Whether the tilt rates end with the plant's angular acceleration (rad/s^2).
    """
    rotors, tilts = layout

    def seen(qpos: Any, qvel: Any, act: Any) -> tuple[Any, ...]:
        attitude, angles = euler_angles(qpos[QW:TILT_1]), qpos[TILT_1 : TILT_1 + tilts]
        state = qpos[0:3], qvel[0:3], attitude, qvel[3:6], angles, act[:rotors]
        rates = qvel[TILT_RATE_1 : TILT_RATE_1 + tilts + 3 * measured]
        return xp.hstack(state), rates, act[rotors : rotors + states]

    return seen


@cache
def observed_of(layout: Layout, shown: Layout, further: int) -> Callable[..., Any]:
    """A sample as a function, `Columns.observe` without controls.

    Args:
        layout: Layout of the vehicle.
        shown: Layout of its samples, which may have tilts that are idle.
        further: Number of the controller's states in a sample.
    """
    rotors, tilts = layout
    idle, end = np.zeros(shown.tilts - tilts), TILT_RATE_1 + tilts

    def observed(qpos: Any, qvel: Any, act: Any) -> Any:
        attitude, angles = euler_angles(qpos[QW:TILT_1]), qpos[TILT_1 : TILT_1 + tilts]
        body = qpos[:3], qvel[:3], attitude, qvel[3:6]
        tilting = angles, idle, act[:rotors], qvel[TILT_RATE_1:end], idle
        return xp.hstack([*body, *tilting, act[rotors : rotors + further]])

    return observed


@cache
def thrust_controls_of(spins: Values) -> Callable[[Any], Any]:
    """Controls of the thrust actuators, ``s varpi |varpi|`` with the spin s, from ``act``."""

    def thrust_controls(act: Any) -> Any:
        speeds = act[: len(spins)]
        return xp.array(spins) * speeds * abs(speeds)

    return thrust_controls


@cache
def held_controls_of(spins: Values, tilts: int) -> Callable[..., Values]:
    """Held controls with the thrusts of the present rotor speeds.

    Args:
        spins: Signs of the rotor speeds.
        tilts: Number of hinges.
    """
    thrusts, further = thrust_controls_of(spins), Layout(len(spins), tilts).acceleration_1

    @traceable
    def held_controls(time: Any, qpos: Any, qvel: Any, act: Any, ctrl: Any, parameters: Any) -> Any:
        return xp.hstack([ctrl[:tilts], thrusts(act), ctrl[further:]])

    return held_controls


def servo_lead(servo: ServoTable) -> float:
    """Lag (s) of a tilt servo behind a command of constant rate, ``2 zeta / omega_n``."""
    return 2.0 * servo.damping_ratio / servo.natural_frequency


def ahead(angles: Any, rates: Any, lead: Any) -> Any:
    """Angles (rad) ahead of themselves by a lag (s) at their rates (rad/s)."""
    return angles + lead * rates


@cache
def servo_commands_of(tilts: int) -> Callable[..., Values]:
    """Function for the commands of tilt servos, ahead of a gait by their lag.

    It is ``(time, lead, gait, knots) -> commands``, s and rad.
    """
    moving = tilt_motion_of(tilts).moving

    @traceable
    def servo_commands(time: Any, lead: Any, gait: GaitParameters, knots: Any) -> Any:
        angles, rates = moving(time, gait, knots)
        return ahead(angles, rates, lead)

    return servo_commands


REFERENCE_COLUMNS: Final = ("x_ref", "y_ref", "z_ref", "roll_ref", "pitch_ref", "yaw_ref")

CONDITION: Final = "decoupling_condition"
"""A column: smallest over largest singular value of the decoupling matrix."""


def torque_free_columns(
    layout: Layout,
    table: Vector,
    samples: Mapping[str, Floats],
    dimension: int | None = None,
    failure: Failure = UNHARMED,
) -> dict[str, Floats]:
    """Angle (rad) to the nearest singular attitude, and how well the decoupling matrix inverts.

    Args:
        layout: Layout of the vehicle.
        table: Table of its rotors.
        samples: By field.
        dimension: How many components of force the controller controls; None for a controller
            without a decoupling matrix.
        failure: A rotor that the controller knows to have failed, which is left out from then on.
    """
    names = layout.names("alpha")
    angles = np.reshape([samples[name] for name in names], (len(names), len(samples["time"]))).T
    time, rotors = samples["time"], np.arange(1, layout.rotors + 1)
    known = time >= failure.known_from
    lost = known[:, np.newaxis] & (rotors == np.reshape(failure.rotor, (-1, 1)))
    works = ~lost[:, np.newaxis]
    force, torque = force_and_torque(table, angles)
    pushing, up = (force * works, torque * works), world_up(samples["roll"], samples["pitch"])
    forces = torque_free_forces(*pushing)
    begins = (time == time[:1]) | (known != np.roll(known, 1))
    columns = {"singularity_margin": margin_over_flight(forces, up, begins)}
    if dimension is not None:
        axes = controlled_axes(forces, up, dimension)
        columns[CONDITION] = decoupling_condition(*pushing, axes)
    return columns


def reference_columns(
    in_force: Callable[..., Values],
    fields: Sequence[str],
    samples: Mapping[str, Floats],
    setup: ControlSetup,
    names: tuple[str, ...],
) -> dict[str, Floats]:
    """The columns of references, evaluated over samples.

    Args:
        in_force: Function ``(time, values, parameters, knots)`` of the columns' values.
        fields: Fields of a sample, its ``values``.
        samples: By field.
        setup: The flight's parameters and knots.
        names: Names of the columns.
    """
    states = np.stack([samples[name] for name in fields], axis=-1)
    rows = evaluate_over_samples(in_force, len(names), samples["time"], states, setup)
    return dict(zip(names, rows.T, strict=True))


def rotor_stops(rotors: int, remedy: str = "") -> tuple[str, ...]:
    """Causes of an end where the speed of a rotor reaches zero, one a rotor.

    Args:
        rotors: Their number.
        remedy: A key that also helps.
    """
    remedies = ["vehicle.min_rotor_speed = 100", *[remedy] * bool(remedy)]
    advice = ", ".join(remedies) + ", or a smaller step of the reference may help"
    return tuple(
        f"the decoupling matrix became singular: rotor {rotor} came to a stop; {advice}"
        for rotor in range(1, rotors + 1)
    )


def singular_attitude(sample: Mapping[str, float], tilts: tuple[str, ...]) -> str:
    """Cause of an end at an attitude and tilt angles, which have these names."""
    angles = ", ".join(f"{sample[name]:.3g}" for name in tilts)
    return (
        f"the decoupling matrix became singular at roll = {sample['roll']:.3g} rad, "
        f"pitch = {sample['pitch']:.3g} rad" + (f", tilt angles ({angles}) rad" if tilts else "")
    )
