"""Everything that is prepared for one flight, once, and the choices that select its programs.

Choices are parameters that choose code: compiled programs and batches on arrays have them as
constants.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any, Final, NamedTuple

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup
from tiltsim.scenario.scenario import FlightPlan
from tiltsim_controllers.mathematics.records import flatten, paths_of
from tiltsim_controllers.mathematics.scalar import Values, Vector


@dataclass(frozen=True, eq=False)
class Assembly(FlightPlan):
    """A planned flight with its closed loop.

    `tiltsim.laws.assembling.assemble` builds it; plants, engines, the termination monitor, flights,
    metrics and views read it.
    """

    loop: ClosedLoop  # the controller around the vehicle, with all layers
    setup: ControlSetup  # inputs of the control step other than the state
    follows_position: bool  # whether the controller follows the reference's horizontal position
    traced: bool = True  # whether the loop can be traced; else it runs as plain Python

    def sign_check_values(self, time: float, values: Vector) -> Values:
        """The numbers of `ClosedLoop.sign_check_values`, from a sample."""
        return self.loop.sign_check_values(time, values, *self.setup)


CHOICES: Final = frozenset(
    {
        "signature",
        "type",
        "keyframes",
        "repeats",
        "color",
        "segments",
        "offset",
        "decoupler",
        "decoupling",
        "strategy",
        "active",
        "rotor",
        "rotors",
        "extension",
        "attitude_error",
        "gait_rates",
        "attitude_rates",
        "reference_derivatives",
        "euler_rates",
        "gyroscopic_torque",
        "integral_action",
    }
)
"""Fields of records that choose code or count; they are the same for all flights of a batch."""


@cache
def _places(record: type[tuple[Any, ...]]) -> tuple[int, ...]:
    """Places of the choices in a flattened record."""
    names = (path.rpartition(".")[2] for path in paths_of(record))
    return tuple(place for place, name in enumerate(names) if name in CHOICES)


Choices = tuple[tuple[int, float], ...]  # places in a flattened record, and the numbers there


def choices_of(record: tuple[Any, ...]) -> Choices:
    """The choices in a record."""
    numbers = [*flatten(record)]
    return tuple((place, numbers[place]) for place in _places(type(record)))


class ProgramKey(NamedTuple):
    """Flights with equal keys share their compiled programs."""

    loop: ClosedLoop
    parameters: Choices  # of the loop's record
    reference: Choices
    knots: int


def program_key(assembly: Assembly) -> ProgramKey:
    """The choices of a flight."""
    parameters, knots = assembly.setup
    own, reference = choices_of(parameters), choices_of(assembly.reference)
    return ProgramKey(assembly.loop, own, reference, len(knots))
