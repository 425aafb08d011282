"""Closed loops of laws with any kind of vehicle."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np

from tiltsim.closed_loop.loop import (
    ClosedLoop,
    ControlSetup,
    Equations,
    VehicleKind,
    nothing_singular,
)
from tiltsim.engines.sample_evaluation import evaluate_over_samples
from tiltsim.laws.law import Law, parameters_of
from tiltsim.scenario.rotorcraft import ServoTable
from tiltsim.scenario.scenario import FlightPlan
from tiltsim_controllers.code.arrays import traceable
from tiltsim_controllers.laws.observed import Seen
from tiltsim_controllers.mathematics.records import make_record_type
from tiltsim_controllers.mathematics.scalar import Floats, Vector


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
