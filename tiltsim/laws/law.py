"""The record of a control law, its parameters in a flight, its supervisor, and its closed loop."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any, ClassVar, Final

import numpy as np

from tiltsim.closed_loop.loop import (
    ClosedLoop,
    ControlSetup,
    Equations,
    VehicleKind,
    nothing_singular,
)
from tiltsim.engines.sample_evaluation import evaluate_over_samples
from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.rotorcraft import ServoTable
from tiltsim.scenario.scenario import FlightPlan, Scenario
from tiltsim_controllers.code.arrays import traceable, xp
from tiltsim_controllers.gaits.motion import planned_tilts
from tiltsim_controllers.laws.allocation import RotorRange
from tiltsim_controllers.laws.gait_feedforward import supervised_gait
from tiltsim_controllers.laws.keys import number_of
from tiltsim_controllers.laws.multirotor_keys import INTEGRAL_FIELDS
from tiltsim_controllers.laws.observed import Seen, Step
from tiltsim_controllers.laws.supervisor import HOLD, Supervision
from tiltsim_controllers.mathematics.records import make_record_type
from tiltsim_controllers.mathematics.scalar import Floats, Values, Vector
from tiltsim_controllers.vehicle.body import PITCH, ROLL

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
    """A control law."""

    step: Callable[[Seen, Any, Any], Step]
    """The law, a function of arrays ``(seen, parameters, knots) -> Step``."""
    parameters: Any
    """Type of its record. It has ``reference``; ``gait`` where the tilts follow it; and
    ``vehicle``, with ``rotors`` as the index of the rotors' table in the knots, see
    `tiltsim_controllers.vehicle.rotors.airframe`."""
    own: Callable[[FlightPlan], dict[str, Any]] = lambda _plan: {}
    """``(plan) -> values by name`` of parameters other than keys, where `parameters_of` does not
    know them."""
    tables: Callable[[FlightPlan], Values] = lambda _plan: ()
    """``(plan) -> numbers`` that follow the knots of gait and reference."""
    states: Mapping[str, str] = field(default_factory=dict)
    """Names of the controller's states, part of a sample, and their units."""
    initial: Callable[[FlightPlan], Values] | None = None
    """``(plan) -> states`` at time zero; None for zeros."""
    signals: tuple[str, ...] | None = None
    """Names of the first signals of a step, columns of a flight: roll, pitch and yaw that it
    tracks, and any more. None for the attitude of the reference."""
    units: Mapping[str, str] = field(default_factory=dict)
    """Columns of a flight other than the states and the columns of its kind, with units; also the
    fields of a sample beside the states."""
    tilts: Tilts | None = None  # see `Tilts`; None for `tilts_of_gait`
    uses_gait: bool = True  # whether the gait has a part in the flight
    records_commands: bool = False  # whether the commands of the tilt servos are part of a sample
    columns: tuple[str, ...] = ("singularity_margin",)
    """Its columns among `tiltsim.vehicles.rotorcraft.EXTRA_COLUMNS`."""
    margins: Margins = lambda _samples, _setup: {}  # see `Margins`
    signs: Callable[[Seen, Any, Any], Any] | None = None
    """Function of arrays ``(seen, parameters, knots)``: numbers that keep their sign until the law
    becomes singular. None for a law that is singular nowhere."""
    causes: Callable[[Mapping[str, float], ControlSetup], tuple[str, ...]] = lambda *_: ("",)
    """``(sample by field, setup) -> texts``: why a flight ends where each reaches zero."""
    measured: bool = False
    """Whether it sees the plant's angular acceleration, of `tiltsim.laws.layers.instruments`."""
    feels: bool = False  # whether it sees the contact force and the swing of a load, behind ``act``
    follows_position: Callable[[Scenario], bool] = lambda _scenario: True
    """See `tiltsim.closed_loop.loop.ClosedLoop`."""

    def initial_states(self, plan: FlightPlan) -> Values:
        """Its states at time zero."""
        return self.initial(plan) if self.initial else (0.0,) * len(self.states)


INTEGRALS: Final = dict.fromkeys(INTEGRAL_FIELDS, "m s")
"""States of a law that integrates the position error, with their units."""


def vehicle_of(plan: FlightPlan) -> Any:
    """The vehicle that a law knows: of a multirotor the rigid body."""
    vehicle = plan.scenario.vehicle.resolve()
    return vehicle.body if isinstance(vehicle, Multirotor) else vehicle


def _limits(plan: FlightPlan, horizon: float) -> RotorRange:
    vehicle = plan.scenario.any_rotorcraft
    low, high = vehicle.speeds_along_spin
    if vehicle.cross and vehicle.min_rotor_speed is None:
        low = 0.0  # its rotors do not reverse
    return RotorRange(low, high, horizon)


_VALUES: Final[dict[str, Callable[[FlightPlan, Any], Any]]] = {
    "gait": lambda plan, _: plan.gait.parameters,
    "reference": lambda plan, _: plan.reference,
    "rotors": lambda plan, _: float(len(plan.knots)),  # where tables follow in the knots
    "vehicle": lambda plan, _: vehicle_of(plan),
    "gains": lambda _, keys: keys.resolve_gains(),
    "integral": lambda _, keys: keys.resolve_integral_gains(),
    "anticipation": lambda plan, keys: xp.minimum(
        keys.anticipation, 0.5 * plan.gait.min_segment_time
    ),
    # The thesis's equations omit the gyroscopic torque.
    "terms": lambda plan, keys: keys.resolve_feedforward_terms(
        gyroscopic_torque=plan.scenario.simulation.plant != "thesis"
    ),
    "supervisor": lambda plan, keys: keys.resolve_supervisor(plan.scenario.vehicle.resolve()),
    "failure": lambda _, keys: keys.resolve_failure(),
    "limits": lambda plan, keys: _limits(plan, keys.allocation_horizon),
}
"""Values of parameters that several laws have and that are no number of a key, by name."""


def parameters_of(plan: FlightPlan, law: Law) -> Any:
    """The parameters of a flight's law: its own, numbers of keys, and parts of the plan."""
    own, controller = law.own(plan), plan.scenario.controller

    def value(name: str) -> Any:
        if name in own:
            return own[name]
        return _VALUES[name](plan, controller) if name in _VALUES else number_of(controller, name)

    return law.parameters(*map(value, law.parameters._fields))


def decouples_position(scenario: Scenario) -> bool:
    """Whether a decoupler steers the vehicle to the reference's horizontal position."""
    controller: Any = scenario.controller
    return bool(controller.decoupler != "none")


SUPERVISION: Final = "supervision"
"""A column: how much the supervisor intervenes, from 0 to 1.

It is the share of the gait's angles or of its speed that is removed, or of the way to red.
"""

SUPERVISOR_FIELDS: Final = ("supervisor_state", "supervisor_rate")
"""States of a supervisor that has any: see `tiltsim_controllers.laws.supervisor`."""

_STATE_UNITS: Final = {"hold": ("s", "1"), "return_to_red": ("1", "1/s")}


def supervised(law: Law, supervision: Supervision, strategy: str) -> Law:
    """A law under a supervisor, whose states follow the law's.

    Args:
        law: Its parameters have ``gait`` and ``supervisor``.
        supervision: The functions of the supervisor.
        strategy: One of `tiltsim_controllers.laws.supervisor.STRATEGIES`, or empty for none.
    """
    if not strategy:
        return law
    assert law.signals is not None
    units, own, tracked = _STATE_UNITS.get(strategy, ()), len(law.states), len(law.signals)

    def watched(seen: Seen, p: Any, knots: Any) -> Seen:
        """The vehicle as the law sees it, with the motion of the supervisor."""
        state, rate = seen.states[own:]
        motion = xp.array([state, rate, 0.0])
        if not seen.recorded:
            vehicle = supervision.watched(seen.time, p)
            attitude = seen.state[ROLL], seen.state[PITCH]
            motion = supervision.derivative(
                seen.time, *attitude, state, rate, p.gait, knots, p.supervisor, vehicle
            )
        return seen._replace(states=seen.states[:own], supervisor=motion)

    def step(seen: Seen, p: Any, knots: Any) -> Step:
        if units:
            seen = watched(seen, p, knots)
            acts = seen.supervisor[1 if p.supervisor.strategy == HOLD else 0]
        else:
            acts = 1.0 - supervised_gait(seen, p, knots, supervision)[1]
        step = law.step(seen, p, knots)
        rates = xp.hstack([step.rates, seen.supervisor[1:]]) if units else step.rates
        return Step(step.inputs, rates, xp.hstack([step.signals[:tracked], acts]))

    def tilts(seen: Seen, rates: Any, p: Any, knots: Any) -> Any:
        if units:
            motion = xp.hstack([seen.states[own], rates[own:]])
            seen = seen._replace(supervisor=motion)
        return supervised_gait(seen, p, knots, supervision)[0][:, :2]

    return replace(
        law,
        step=step,
        states={**law.states, **dict(zip(SUPERVISOR_FIELDS, units, strict=False))},
        initial=lambda plan: (*law.initial_states(plan), *(0.0,) * len(units)),
        signals=(*law.signals, SUPERVISION),
        units={**law.units, SUPERVISION: "1"},
        tilts=tilts,
    )


# --- closed loops with any kind of vehicle -----------------------------------------------------


def servo_lead(servo: ServoTable) -> float:
    """Lag (s) of a tilt servo behind a command of constant rate, ``2 zeta / omega_n``."""
    return 2.0 * servo.damping_ratio / servo.natural_frequency


def parts(vector: Any, **sizes: int) -> SimpleNamespace:
    """Consecutive parts of a vector by name."""
    found, first = {}, 0
    for name, size in sizes.items():
        found[name] = vector[first : first + size]
        first += size
    return SimpleNamespace(**found)


@dataclass(frozen=True, eq=False)
class VehicleFunctions:
    """The functions of arrays by which a law moves a kind of vehicle.

    In MuJoCo and on the equations of motion, ``parameters`` are a record with the law's own as
    ``law``, and ``knots`` the table data of a flight. ``controls`` and ``observe`` are fields of
    `ClosedLoop`, the ``equation_...`` functions of `Equations`.
    """

    law: Law
    controls: ClassVar[Callable[..., Any]]
    observe: ClassVar[Callable[..., Any]]
    in_sample: ClassVar[Callable[..., Seen]]
    """``(time, values)``: the vehicle as the law sees it, from the fields of a sample."""
    references: ClassVar[Callable[..., Any]]
    """``(time, values, parameters, knots)``: references and signals of a sample."""
    names: ClassVar[Any]  # their names, which are columns
    initial_state: ClassVar[Callable[..., Vector]]
    """``(plan)``: the state of the equations at time zero."""
    state_names: ClassVar[Any]  # see `Equations`
    input_names: ClassVar[Any]  # see `Equations`
    equation_inputs: ClassVar[Callable[..., Any]]
    equation_rates: ClassVar[Callable[..., Any]]
    observe_equations: ClassVar[Callable[..., Any]]

    def hold(self, time: Any, qpos: Any, qvel: Any, act: Any, ctrl: Any, parameters: Any) -> Any:
        """The controls between samples, see `ClosedLoop`."""
        return ctrl

    def signs(self, time: Any, values: Any, parameters: Any, knots: Any) -> Any:
        """See `ClosedLoop.sign_check_values`."""
        assert self.law.signs is not None
        return self.law.signs(self.in_sample(time, values), parameters.law, knots)

    def closed_loop(
        self,
        kind: VehicleKind,
        head: Mapping[str, Callable[[FlightPlan], float]],
        inputs_size: int,
        fields: tuple[str, ...] = (),
        **model: Any,
    ) -> ClosedLoop:
        """The closed loop.

        Args:
            kind: Kind of the vehicle.
            head: Parameters beside the law's, by name.
            inputs_size: Number of inputs of the equations.
            fields: Fields of a sample after the kind's and the states of the law.
            model: Fields of `ClosedLoop` that describe the model.
        """
        law, references, names = self.law, traceable(self.references), self.names
        numbers = dict.fromkeys(head, float)
        record = make_record_type("LoopParameters", signature=float, **numbers, law=law.parameters)
        read, units = (*kind.observed_fields, *law.states), {**law.states, **law.units}

        def setup(plan: FlightPlan, signature: float) -> ControlSetup:
            own = [value(plan) for value in head.values()]
            parameters = record(signature, *own, parameters_of(plan, law))
            return ControlSetup(parameters, (*plan.knots, *law.tables(plan)))

        def derive(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
            states = np.stack([samples[name] for name in read], axis=-1)
            rows = evaluate_over_samples(references, len(names), samples["time"], states, setup)
            found = dict(zip(names, rows.T, strict=True))
            return {**found, **law.margins({**samples, **found}, setup)}

        return ClosedLoop(
            kind=kind,
            parameters=record,
            setup=setup,
            controls=traceable(self.controls),
            hold=traceable(self.hold),
            observe=traceable(self.observe),
            derive=derive,
            fields=(*law.states, *fields),
            further_units={name: unit for name, unit in units.items() if name not in kind.columns},
            sign_check_values=traceable(self.signs) if law.signs else nothing_singular,
            causes=law.causes,
            equations=Equations(
                inputs=traceable(self.equation_inputs),
                inputs_size=inputs_size,
                rates=traceable(self.equation_rates),
                initial=lambda plan, _setup: self.initial_state(plan),
                observe=traceable(self.observe_equations),
                states=self.state_names,
                input_names=self.input_names,
            ),
            follows_position=law.follows_position,
            uses_gait=law.uses_gait,
            **model,
        )
