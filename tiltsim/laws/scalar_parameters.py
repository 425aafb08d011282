"""What the loop of a scalar law is compiled for, and its parameters."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

from tiltsim.laws.rotor_loop import RotorLayout
from tiltsim_controllers.gaits.parameters import GaitParameters
from tiltsim_controllers.mathematics.records import make_record_type
from tiltsim_controllers.mathematics.scalar import Values
from tiltsim_controllers.references.trajectories import ReferenceParameters
from tiltsim_controllers.vehicle.multirotor import Body


class Key(NamedTuple):
    """All that a loop is compiled for."""

    layout: RotorLayout
    law: Callable[..., tuple[Values, Values, Values]]
    name: str
    parameters: type[tuple[Any, ...]]  # of the law
    states: tuple[tuple[str, str], ...]  # of the law, with their units
    tilts: bool  # whether the law commands the tilts
    models_rotors: bool  # whether the rotors follow a model of theirs, as they do with latency

    @property
    def code_name(self) -> str:
        """Of the law, with what it commands."""
        return f"{self.name}{'_free' * self.tilts}{'_late' * self.models_rotors}"


@cache
def record_of(parameters: type[tuple[Any, ...]]) -> Any:
    """The type of what every law's loop knows of its flight, with the law's own parameters."""
    return make_record_type(
        "Known",
        gait=GaitParameters,
        reference=ReferenceParameters,
        vehicle=Body,
        rotors=float,  # index in the knots of the table of rotors, then per newton, then K_f
        rotor_gain=float,  # 1/s, of the rotor speeds' errors
        tilt_gain=float,  # 1/s, of the errors of tilts that the law commands
        own=parameters,
    )
