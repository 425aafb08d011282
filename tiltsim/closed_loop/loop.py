"""Closed loops: a control law, as scalar code, around one of the MuJoCo models."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from tiltsim.closed_loop.vehicle_kind import VehicleKind
from tiltsim.models.parts import ExtraActuators
from tiltsim_controllers.mathematics.records import flatten, record_dtype, record_size
from tiltsim_controllers.mathematics.scalar import Floats, Values, Vector, scalar

if TYPE_CHECKING:
    from tiltsim.scenario.flight_plan import FlightPlan
    from tiltsim.scenario.scenario import Scenario


class Sizes(NamedTuple):
    """Lengths of the vectors that a loop reads and writes."""

    qpos: int
    qvel: int
    act: int
    ctrl: int


class ControlSetup(NamedTuple):
    """What the control step of one flight reads besides the state."""

    parameters: Any  # the loop's record
    knots: Values = ()  # keyframes of the gait, then waypoints of the reference

    @property
    def userdata(self) -> Floats:
        """Record and knots as MuJoCo's `userdata` holds them after its `Header`."""
        return np.array([*flatten(self.parameters), *self.knots])


class SignCheck(NamedTuple):
    """A number that must keep its sign, or the flight is over, and what to say if it does not."""

    value: float
    cause: str


@dataclass(frozen=True, eq=False)
class Equations:
    """A law around the equations of motion that the thesis prints for its vehicle.

    Attributes
    ----------
    inputs
        Scalar function ``(time, state, parameters, knots) -> inputs``: the law.
    inputs_size
        How many inputs there are.
    rates
        Scalar function ``(time, state, inputs, parameters, knots, disturbance) -> derivative`` of
        the state; the disturbance is an acceleration (m/s^2, world).
    initial
        ``(plan, setup) -> state`` at time zero.
    observe
        Scalar function ``(time, state, inputs, parameters, knots) -> values`` of the loop's
        `sample_fields` after the time; ``inputs`` are those in force.
    settled
        Scalar function ``(state, parameters) -> state`` for the end of each step: what has run
        past a limit is put back. None where there is none.
    """

    inputs: Callable[..., Values]
    inputs_size: int
    rates: Callable[..., Values]
    initial: Callable[[FlightPlan, ControlSetup], Vector]
    observe: Callable[..., Values]
    settled: Callable[..., list[float]] | None = None


@dataclass(frozen=True, eq=False)
class ClosedLoop:
    """A law around a model, for all that is the same whichever law flies.

    Scalar functions, for the engines:

    Attributes
    ----------
    model
        Name of the MJCF model.
    sizes
        Lengths of its vectors, the law's own states among the activations.
    parameters
        Record at the head of `userdata`; its first field is ``signature``. The knots of
        gaits of any length, may follow it.
    controls
        Scalar function ``(time, qpos, qvel, act, parameters, knots) -> ctrl``: the whole step.
    refresh
        Scalar function ``(ctrl, act) -> ctrl``: what moves between the samples of a held law.
    hold
        Scalar function ``(time, qpos, qvel, act, ctrl, parameters) -> ctrl`` in place of
        ``refresh``, where more than the activations decides what moves between samples.
    setup
        ``(plan, signature) -> ControlSetup``.
    initial_activations
        ``(plan, setup) -> act`` at time zero.
    observe
        Scalar function ``(qpos, qvel, act, ctrl) -> values`` of the kind's fields and
        ``law_fields``; ``ctrl`` are the controls in force if it ``observes_controls``.
    derive
        ``(samples by field, setup) -> columns``: references, determinant, margin and
        ``extra_columns``.
    watched
        ``(sample by field, setup) -> SignCheck, ...``: where the law ends.
    watch
        Scalar function ``(values, parameters) -> numbers``: at least the numbers of ``watched``,
        from ``values`` as ``observe`` gives them. None leaves watching to Python.
    observes_controls
        Whether ``observe`` reads the controls in force.
    law_states
        Number of activations that are states of the law.
    extra_actuators
        What layers around the law append to the model's actuators, the innermost first.
    law_fields
        Fields of a sample beyond those of the vehicle's kind.
    extra_columns
        Columns of a flight that other loops do not have, with their units.
    follows_position
        Whether a scenario has the law follow the reference's horizontal position.
    equations
        The same law on the thesis's own equations; None where it flies on MuJoCo alone, or, with a
        layer around it, by `tiltsim.laws.layers.on_equations`.
    kind
        What holds for all loops around such a vehicle.
    uses_gait
        Whether the scenario's gait has a part in the flight.
    """

    model: str
    sizes: Sizes
    parameters: type[tuple[Any, ...]]
    controls: Callable[..., Values]
    refresh: Callable[..., Values]
    setup: Callable[[FlightPlan, float], ControlSetup]
    initial_activations: Callable[[FlightPlan, ControlSetup], Vector]
    observe: Callable[..., Values]
    derive: Callable[[Mapping[str, Floats], ControlSetup], dict[str, Floats]]
    watched: Callable[[Mapping[str, float], ControlSetup], tuple[SignCheck, ...]]
    kind: VehicleKind
    equations: Equations | None = None
    watch: Callable[..., Values] | None = None
    observes_controls: bool = False
    law_states: int = 0
    extra_actuators: tuple[ExtraActuators, ...] = ()
    law_fields: tuple[str, ...] = ()
    extra_columns: Mapping[str, str] = field(default_factory=dict)
    follows_position: Callable[[Scenario], bool] = lambda _scenario: True
    hold: Callable[..., Values] | None = None
    uses_gait: bool = True

    @cached_property
    def signature(self) -> float:
        """A checksum of the layout of `userdata`, which tells our models from foreign ones."""
        layout = (self.model, self.sizes, record_dtype(self.parameters))
        return float(zlib.crc32(repr(layout).encode()))

    @cached_property
    def held(self) -> Callable[..., Values]:
        """``hold``, or ``refresh`` in its form."""
        if self.hold is not None:
            return self.hold
        refresh = self.refresh

        @scalar
        def only_refresh(
            time: float, qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector, parameters: Any
        ) -> Values:
            return refresh(ctrl, act)

        return only_refresh

    def native_name(self, plant: str) -> str:
        """Name of the loop's compiled code on a plant, as a file's name."""
        step = self.controls
        if plant == "thesis" and self.equations is not None:
            step = self.equations.inputs
        return f"{plant}.{step.__module__}.{step.__qualname__}"

    @cached_property
    def record_size(self) -> int:
        """Number of floats of the parameter record."""
        return record_size(self.parameters)

    @cached_property
    def sample_fields(self) -> tuple[str, ...]:
        """What a recorded sample holds, in order."""
        return ("time", *self.kind.observed_fields, *self.law_fields)

    @cached_property
    def units(self) -> dict[str, str]:
        """The columns of a flight and their units, in order."""
        return dict(self.kind.columns) | dict(self.extra_columns)
