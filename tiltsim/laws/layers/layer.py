"""What all layers around a loop have in common: parameters of their own, all else as within."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup, SignCheck
from tiltsim_controllers.mathematics.records import make_record_type
from tiltsim_controllers.mathematics.scalar import Floats, Values, Vector, scalar

if TYPE_CHECKING:
    from tiltsim.scenario.flight_plan import FlightPlan


def around(
    loop: ClosedLoop, record: type[tuple[Any, ...]], read: Callable[[FlightPlan], Any]
) -> ClosedLoop:
    """A loop whose parameters hold those of a layer, too: the fields ``layer`` and ``law``.

    It flies as the loop within does until the layer replaces the functions that it is about. It has
    no equations: those of the loop within know nothing of the layer.

    Parameters
    ----------
    loop
        The loop within; its parameters become the field ``law``.
    record
        The type of the field ``layer``.
    read
        ``(plan) -> layer``.
    """
    parameters_type = make_record_type(
        f"{record.__name__}Parameters", signature=float, layer=record, law=loop.parameters
    )
    inner_controls, inner_hold = loop.controls, loop.held
    inner_watch: Any = loop.watch

    @scalar
    def controls(
        time: float, qpos: Vector, qvel: Vector, act: Vector, parameters: Any, knots: Vector
    ) -> Values:
        return inner_controls(time, qpos, qvel, act, parameters.law, knots)

    @scalar
    def hold(
        time: float, qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector, parameters: Any
    ) -> Values:
        return inner_hold(time, qpos, qvel, act, ctrl, parameters.law)

    @scalar
    def watch(values: Vector, parameters: Any) -> Values:
        watched: Values = inner_watch(values, parameters.law)
        return watched

    def setup(plan: FlightPlan, signature: float) -> ControlSetup:
        inner = loop.setup(plan, loop.signature)
        return ControlSetup(parameters_type(signature, read(plan), inner.parameters), inner.knots)

    def within(setup: ControlSetup) -> ControlSetup:
        return ControlSetup(setup.parameters.law, setup.knots)

    def initial_activations(plan: FlightPlan, setup: ControlSetup) -> Vector:
        return loop.initial_activations(plan, within(setup))

    def derive(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
        return loop.derive(samples, within(setup))

    def watched(sample: Mapping[str, float], setup: ControlSetup) -> tuple[SignCheck, ...]:
        return loop.watched(sample, within(setup))

    return replace(
        loop,
        parameters=parameters_type,
        controls=controls,
        hold=hold,
        setup=setup,
        initial_activations=initial_activations,
        derive=derive,
        watched=watched,
        watch=None if inner_watch is None else watch,
        equations=None,
    )
