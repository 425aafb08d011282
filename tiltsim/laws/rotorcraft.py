"""Common parts of closed loops with rotorcraft of any number of rotors and tilt hinges."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Final

import numpy as np

from tiltsim.engines.sample_evaluation import flights_in
from tiltsim.vehicles.rotorcraft.layout import Layout
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


@scalar
def body_state(qpos: Vector, qvel: Vector) -> Values:
    """The twelve numbers of the rigid body, from MuJoCo's state."""
    roll, pitch, yaw = euler_from_quaternion(qpos[3], qpos[4], qpos[5], qpos[6])
    return (
        qpos[0], qpos[1], qpos[2], qvel[0], qvel[1], qvel[2],
        roll, pitch, yaw, qvel[3], qvel[4], qvel[5],
    )  # fmt: skip


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


@cache
def servo_commands_of(tilts: int) -> Callable[..., Values]:
    """Scalar code of the commands of so many tilt servos, ahead of a gait by their lag.

    They are ``(time, lead, gait, knots) -> commands``, s and rad.
    """
    planned = tilt_motion_of(tilts).planned
    ahead = componentwise("servo_commands", "jets, lead", "jets#[0] + lead * jets#[1]", tilts)

    @scalar
    def servo_commands(time: float, lead: float, gait: GaitParameters, knots: Vector) -> Values:
        commands: Values = ahead(planned(time, gait, knots), lead)
        return commands

    return servo_commands


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
    lost = np.arange(1, layout.rotors + 1) == failure.rotor
    works = ~(lost & (samples["time"][:, np.newaxis] >= failure.known_from))[:, np.newaxis]
    force, torque = force_and_torque(table, angles)
    pushing, up = (force * works, torque * works), world_up(samples["roll"], samples["pitch"])
    forces = torque_free_forces(*pushing)
    columns = {"singularity_margin": margin_over_flight(forces, up, flights_in(samples["time"]))}
    if dimension is not None:
        axes = controlled_axes(forces, up, dimension)
        columns[CONDITION] = decoupling_condition(*pushing, axes)
    return columns
