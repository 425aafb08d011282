"""The record of a control law, from which `tiltsim.laws.vehicle_loop` makes a closed loop."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from tiltsim.closed_loop.loop import ControlSetup
from tiltsim.scenario.scenario import FlightPlan, Scenario
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.gaits.motion import planned_tilts
from tiltsim_controllers.laws.observed import Seen, Step
from tiltsim_controllers.mathematics.scalar import Floats, Values

Margins = Callable[[Mapping[str, Floats], ControlSetup], dict[str, Floats]]
"""``(samples by field, with the columns of references, setup) -> columns``."""

Tilts = Callable[[Seen, Any, Any, Any], Any]
"""``(seen, rates of the states, parameters, knots)``: tilt angles (rad) and rates, shape (M, 2)."""


def tilts_of_gait(tilts: int) -> Tilts:
    """Tilts that follow the gait of a law's parameters, if there are any."""
    if tilts == 0:
        return lambda *_: xp.zeros((0, 2))
    return lambda seen, _rates, p, knots: planned_tilts(seen.time, p.gait, knots, tilts)[:, :2]


def tilts_in_states(first: int, tilts: int) -> Tilts:
    """Tilts that a law commands: they are its states, from an index on."""
    own = slice(first, first + tilts)
    return lambda seen, rates, _p, _knots: xp.stack([seen.states[own], rates[own]], 1)


@dataclass(frozen=True, eq=False)
class Law:
    """A control law.

    Attributes:
        step: The law, a function of arrays ``(seen, parameters, knots) -> Step``.
        parameters: Type of its record. It has ``reference``; ``gait`` where the tilts follow it;
            and ``vehicle``, with ``rotors`` as the index of the rotors' table in the knots, see
            `tiltsim_controllers.vehicle.rotors.airframe`.
        setup: ``(plan) -> parameters, knots to append``.
        states: Names of the controller's states, part of a sample, and their units.
        initial: ``(plan) -> states`` at time zero.
        signals: Names of the first signals of a step, columns of a flight: roll, pitch and yaw that
            it tracks, and any more. None for the attitude of the reference.
        units: Columns of a flight other than the states and the columns of its kind, with units;
            also the fields of a sample beside the states.
        tilts: See `Tilts`; None for `tilts_of_gait`.
        uses_gait: Whether the gait has a part in the flight.
        records_commands: Whether the commands of the tilt servos are part of a sample.
        margins: See `Margins`.
        signs: Function of arrays ``(seen, parameters, knots)``: numbers that keep their sign until
            the law becomes singular. None for a law that is singular nowhere.
        causes: ``(sample by field, setup) -> texts``: why a flight ends where each reaches zero.
        measured: Whether it sees the plant's angular acceleration, of
            `tiltsim.laws.layers.measured_acceleration`.
        feels: Whether it sees the contact force and the swing of a load, behind ``act``.
        follows_position: See `tiltsim.closed_loop.loop.ClosedLoop`.
    """

    step: Callable[[Seen, Any, Any], Step]
    parameters: type[tuple[Any, ...]]
    setup: Callable[[FlightPlan], tuple[Any, Values]]
    states: Mapping[str, str] = field(default_factory=dict)
    initial: Callable[[FlightPlan], Values] = lambda _plan: ()
    signals: tuple[str, ...] | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    tilts: Tilts | None = None
    uses_gait: bool = True
    records_commands: bool = False
    margins: Margins = lambda _samples, _setup: {}
    signs: Callable[[Seen, Any, Any], Any] | None = None
    causes: Callable[[Mapping[str, float], ControlSetup], tuple[str, ...]] = lambda *_: ("",)
    measured: bool = False
    feels: bool = False
    follows_position: Callable[[Scenario], bool] = lambda _scenario: True
