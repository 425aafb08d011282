"""Common parts of closed loops with rotorcraft of any number of rotors and tilt hinges."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.closed_loop.loop import ControlSetup
from tiltsim.engines.sample_evaluation import evaluate_over_samples
from tiltsim.vehicles.rotorcraft.layout import QW, QX, QY, QZ, TILT_1, TILT_RATE_1, Layout
from tiltsim_controllers.analysis.singularity import world_up
from tiltsim_controllers.analysis.torque_free import (
    controlled_axes,
    decoupling_condition,
    margin_over_flight,
    torque_free_forces,
)
from tiltsim_controllers.gaits.any_tilts import tilt_motion_of
from tiltsim_controllers.gaits.parameters import GaitParameters
from tiltsim_controllers.laws.failures import UNHARMED, Failure
from tiltsim_controllers.mathematics.rotation import euler_from_quaternion
from tiltsim_controllers.mathematics.scalar import Floats, Values, Vector, scalar
from tiltsim_controllers.mathematics.vectors import componentwise, tuple_text, written_out
from tiltsim_controllers.vehicle.effectiveness import force_and_torque

if TYPE_CHECKING:
    from tiltsim.scenario.rotorcraft import ServoTable


def _reading(name: str, entries: Iterable[str]) -> Callable[..., Any]:
    """Scalar code ``(qpos, qvel, act)`` of a tuple.

    Its entries may also read ``angles``: roll, pitch and yaw (rad). It is one expression: several
    tuples, joined, would take Python half as much time again.
    """
    joined = written_out(name, "angles, qpos, qvel, act", tuple_text(entries))

    @scalar
    def reading(qpos: Vector, qvel: Vector, act: Vector) -> Any:
        angles = euler_from_quaternion(qpos[QW], qpos[QX], qpos[QY], qpos[QZ])
        return joined(angles, qpos, qvel, act)

    return reading


def _entries(vector: str, first: int, count: int) -> tuple[str, ...]:
    return tuple(f"{vector}[{i}]" for i in range(first, first + count))


_BODY: Final = (
    *_entries("qpos", 0, 3),
    *_entries("qvel", 0, 3),
    *_entries("angles", 0, 3),
    *_entries("qvel", 3, 3),
)
"""The rigid body, `tiltsim_controllers.vehicle.states.BODY_FIELDS`."""


@cache
def seen_of(layout: Layout, states: int, measured: bool) -> Callable[..., tuple[Values, ...]]:
    """Scalar code ``(qpos, qvel, act)`` of what a law sees of MuJoCo's vectors.

    That is the vehicle's state (twelve numbers of the body, then tilt angles, rad, and rotor
    speeds, rad/s), its tilt rates (rad/s) and the controller's states.

    Args:
        layout: Of the vehicle.
        states: How many states the controller has.
        measured: Whether the tilt rates end with the plant's angular acceleration (rad/s^2).
    """
    rotors, tilts = layout
    rates = _entries("qvel", TILT_RATE_1, tilts + 3 * measured)
    state = (*_BODY, *_entries("qpos", TILT_1, tilts), *_entries("act", 0, rotors))
    parts = map(tuple_text, (state, rates, _entries("act", rotors, states)))
    return _reading(f"seen_{rotors}_{tilts}_{len(rates)}_{states}", parts)


@cache
def observed_of(layout: Layout, shown: Layout, further: int) -> Callable[..., Values]:
    """Scalar code of a sample, `Columns.observe` without controls.

    Args:
        layout: Of the vehicle.
        shown: Of its samples, which may have tilts that are idle.
        further: How many states of the controller they have.
    """
    rotors, tilts = layout
    idle = ("0.0",) * (shown.tilts - tilts)
    angles, rates = _entries("qpos", TILT_1, tilts), _entries("qvel", TILT_RATE_1, tilts)
    speeds, states = _entries("act", 0, rotors), _entries("act", rotors, further)
    return _reading(
        f"observed_{rotors}_{tilts}_{shown.tilts}_{further}",
        (*_BODY, *angles, *idle, *speeds, *rates, *idle, *states),
    )


@cache
def thrust_controls_of(spins: Values) -> Callable[[Vector], Values]:
    """Scalar code of the controls of the thrust actuators, ``s varpi |varpi|`` with the spin s."""
    senses = "".join("p" if spin > 0.0 else "m" for spin in spins)
    signs = ["" if spin > 0.0 else "-" for spin in spins]
    terms = tuple_text(f"{sign}act[{i}] * abs(act[{i}])" for i, sign in enumerate(signs))
    controls: Callable[[Vector], Values] = written_out(f"thrust_controls_{senses}", "act", terms)
    return controls


@cache
def held_controls_of(spins: Values, tilts: int) -> Callable[..., Values]:
    """Scalar code of held controls with the thrusts of the present rotor speeds.

    Args:
        spins: Signs of the rotor speeds.
        tilts: Number of hinges.
    """
    thrusts, further = thrust_controls_of(spins), Layout(len(spins), tilts).acceleration_1

    @scalar
    def held_controls(
        time: float, qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector, parameters: object
    ) -> Values:
        return (*ctrl[:tilts], *thrusts(act), *ctrl[further:])

    return held_controls


def servo_lead(servo: ServoTable) -> float:
    """Lag (s) of a tilt servo behind a command of constant rate, ``2 zeta / omega_n``."""
    return 2.0 * servo.damping_ratio / servo.natural_frequency


@cache
def ahead_of(tilts: int) -> Callable[..., Values]:
    """Scalar code of angles ahead of themselves by a lag: ``(angles, rates, lead)``."""
    ahead: Callable[..., Values] = componentwise(
        "ahead", "angles, rates, lead", "angles# + lead * rates#", tilts
    )
    return ahead


@cache
def servo_commands_of(tilts: int) -> Callable[..., Values]:
    """Scalar code of the commands of so many tilt servos, ahead of a gait by their lag.

    They are ``(time, lead, gait, knots) -> commands``, s and rad.
    """
    moving, ahead = tilt_motion_of(tilts).moving, ahead_of(tilts)

    @scalar
    def servo_commands(time: float, lead: float, gait: GaitParameters, knots: Vector) -> Values:
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
        layout: Of the vehicle.
        table: Of its rotors.
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
        in_force: Scalar function ``(time, values, parameters, knots)`` of the columns' values.
        fields: Fields of a sample, its ``values``.
        samples: By field.
        setup: The flight's parameters and knots.
        names: Of the columns.
    """
    states = np.stack([samples[name] for name in fields], axis=-1)
    rows = evaluate_over_samples(in_force, len(names), samples["time"], states, setup)
    return dict(zip(names, rows.T, strict=True))


def rotor_stops(rotors: int) -> tuple[str, ...]:
    """Causes of an end where the speed of a rotor reaches zero, one a rotor."""
    return tuple(
        f"the decoupling matrix became singular: rotor {rotor} came to a stop"
        for rotor in range(1, rotors + 1)
    )


def singular_attitude(sample: Mapping[str, float], tilts: tuple[str, ...]) -> str:
    """Cause of an end at an attitude and tilt angles, which have these names."""
    angles = ", ".join(f"{sample[name]:.3g}" for name in tilts)
    return (
        f"the decoupling matrix became singular at roll = {sample['roll']:.3g} rad, "
        f"pitch = {sample['pitch']:.3g} rad" + (f", tilt angles ({angles}) rad" if tilts else "")
    )
