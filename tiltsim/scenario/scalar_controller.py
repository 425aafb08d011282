"""Controllers whose law is one scalar function of what it sees: baselines and those of packages.

A package adds one by a subclass of `ScalarController`, which the entry-point group
``tiltsim.controllers`` names; see docs/controller_package.md.
"""

from __future__ import annotations

import inspect
import textwrap
from abc import abstractmethod
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal, NamedTuple, TypeVar

from pydantic import Field

from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.controller_table import ControllerTable, ReferenceKind
from tiltsim.scenario.table import Positive
from tiltsim_controllers.analysis.stability import ErrorLoop, linear_loop
from tiltsim_controllers.gaits.plans import Gait
from tiltsim_controllers.mathematics.scalar import Triple, Values
from tiltsim_controllers.mathematics.scalar import scalar as register

Function = TypeVar("Function", bound=Callable[..., Any])


def scalar(function: Function) -> Function:
    """Mark a function of your own as scalar code, which flies natively, in batches and on arrays.

    It works on floats, tuples and records of floats, and calls only functions marked so and those
    of ``math``.
    """
    if not Path(function.__code__.co_filename).is_file():  # of a notebook; arrays need its text
        with suppress(OSError):  # without its text, as in a plain Python shell, it flies otherwise
            function.__source__ = textwrap.dedent(inspect.getsource(function))  # type: ignore[attr-defined]
    return register(function)


class NoParameters(NamedTuple):
    """For laws without parameters."""

    none: float = 0.0


@dataclass(frozen=True)
class Airframe:
    """What a controller knows when a flight is planned.

    Attributes:
        vehicle: All about it, its rotors as a table.
        gait: Of its tilts.
        initial_tilts: Its tilt angles at time zero, rad.
        initial_speeds: Its rotor speeds at time zero, rad/s along the spin.
        initial_body_rates: Its body rates at time zero, rad/s.
        gyroscopic: 1 where the plant has gyroscopic torque, else 0.
    """

    vehicle: Multirotor
    gait: Gait
    initial_tilts: Values
    initial_speeds: Values
    initial_body_rates: Triple
    gyroscopic: float

    @property
    def rotors(self) -> int:
        """Their number."""
        return len(self.vehicle.spins)


class ScalarTable(ControllerTable):
    """What controllers have in common whose law is a scalar function, wherever that comes from."""

    vehicle_models = ("tiltrotor", "quadrotor", "multirotor")
    reference_kinds: ClassVar[tuple[ReferenceKind, ...]] = ("position",)
    rotors_have_speeds = True

    rotor_bandwidth: Positive = Field(
        100.0,
        description="of the rotors' speed controllers: the speeds approach the commanded ones as "
        "a lag of first order [1/s]",
    )

    def error_loops(self, vehicle: Any) -> list[ErrorLoop]:
        return [linear_loop("rotor speed", (self.rotor_bandwidth,))]

    @property
    def linearization(self) -> str:
        return "exact allocation"

    def law_parameters(self, airframe: Airframe) -> tuple[Any, ...]:
        """The law's parameters: a NamedTuple of floats and of such records, one at least."""
        return NoParameters()

    def law_table(self, airframe: Airframe) -> Values:
        """Any number of further floats, for the law in ``observed.table`` from ``own`` on."""
        return ()

    def state_units(self, airframe: Airframe) -> Mapping[str, str]:
        """The law's states, columns of the flight, and their units."""
        return {}

    def initial_states(self, airframe: Airframe) -> Values:
        """The law's states at time zero."""
        return (0.0,) * len(self.state_units(airframe))

    @property
    def tilt_rate_gain(self) -> float:
        """Rate (1/s) at which the tilts approach those of a law with `commands_tilts`."""
        return 30.0


class ScalarController(ScalarTable):
    """A controller whose law is one scalar function ``(observed, parameters)``.

    The function returns thrusts, tilts and rates of states; see
    `tiltsim_controllers.laws.observed`. The rotors take up the commanded speeds with a lag.
    """

    @abstractmethod
    def scalar_law(self, airframe: Airframe) -> Callable[..., tuple[Values, Values, Values]]:
        """The law, a function marked `scalar`."""


class TiltingTable(ScalarTable):
    """Those that may command the tilts, too."""

    tilts: Literal["gait", "free"] = Field(
        "gait",
        description="whether the tilts follow the gait, or are the law's, the gait being the "
        "angles at the start",
    )
    tilt_bandwidth: Positive = Field(
        30.0,
        description="of the approach to the tilts that the law commands; needs tilts = free [1/s]",
    )

    @property
    def commands_tilts(self) -> bool:  # type: ignore[override]
        """Whether the tilt angles are the law's."""
        return self.tilts == "free"

    @property
    def tilt_rate_gain(self) -> float:
        return self.tilt_bandwidth

    def check_scenario(self, scenario: Any) -> None:
        if not self.commands_tilts:
            self.require_defaults(("tilt_bandwidth",), "needs controller.tilts = free")
        elif not scenario.vehicle.has_tilting_rotors:
            raise self.mistake("tilts", f"the rotors of the {scenario.vehicle.model} do not tilt")
