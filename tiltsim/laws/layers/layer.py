"""Layers around a closed loop: stages between the controller and its vehicle.

A layer has its own parameters and states and replaces some functions; the rest stays as in the loop
within. `wrap_loop` is the one place where that is put together.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup, Equations, Monitoring, Sampling
from tiltsim.models.parts import ExtraActuators
from tiltsim.scenario.scenario import FlightPlan
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.code.traceable import traceable
from tiltsim_controllers.mathematics.records import make_record_type
from tiltsim_controllers.mathematics.scalar import Floats, Values, Vector

_NO_ACTUATORS: Final = ExtraActuators()

Samples = Mapping[str, Floats]
Derive = Callable[[Callable[[], dict[str, Floats]], Samples, ControlSetup], dict[str, Floats]]


@dataclass(frozen=True, eq=False)
class Layer:
    """The parts of a layer, which it adds to a closed loop or replaces in it.

    Its functions see parameters with the fields ``layer``, its own, and ``inner``, for the
    loop within. Where one is None, the loop within goes on unchanged.

    Attributes:
        name: Part of the name of the record of parameters.
        parameters: The type of the layer's parameters.
        read: ``(plan) -> parameters``.
        controls, hold: See `tiltsim.closed_loop.loop.Sampling`.
        adds: Traceable function ``(time, qpos, qvel, act, ctrl, parameters) -> further controls``,
            which follow the controls ``ctrl`` of the loop within, also while these are held. Its
            parameters are the layer's.
        actuators: Appended to the actuators of the model.
        initial_activations: ``(plan, parameters, inner activations) -> activations`` of these
            actuators at time zero.
        derive: ``(inner columns, samples by field, setup) -> columns``; the first is a function.
        fields: Fields of a sample: the first activations of the layer's actuators.
        remembered: Further fields: the first controls of the layer's actuators after the rates of
            their activations.
        units: Columns of a flight that the layer adds, with their units.
        equations: See `ClosedLoop`; for these parameters. The equations of the loop within are not
            used: they do not know the layer.
        of_controller: Whether it is part of the controller, as a supervisor is: the loop around it
            counts as a controller's own loop, and has none ``within``.
    """

    name: str
    parameters: type[tuple[Any, ...]]
    read: Callable[[FlightPlan], Any]
    controls: Callable[..., Values] | None = None
    hold: Callable[..., Values] | None = None
    adds: Callable[..., Values] | None = None
    actuators: ExtraActuators = _NO_ACTUATORS
    initial_activations: Callable[[FlightPlan, Any, Vector], Vector] = (
        lambda _plan, _parameters, _inner: ()
    )
    derive: Derive = lambda inner, _samples, _setup: inner()
    fields: tuple[str, ...] = ()
    remembered: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    equations: Equations | None = None
    of_controller: bool = False


def wrap_loop(inner: ClosedLoop, layer: Layer) -> ClosedLoop:
    """A closed loop with one more layer around it.

    Args:
        inner: The loop within.
        layer: The layer around it.

    Returns:
        A loop whose parameters are the signature, the ``layer``'s and the ``inner`` loop's.
    """
    record = make_record_type(
        f"{layer.parameters.__name__}Parameters",
        signature=float,
        layer=layer.parameters,
        inner=inner.parameters,
    )
    dynamics, added = inner.dynamics, layer.actuators
    sizes = dynamics.sizes._replace(
        act=dynamics.sizes.act + added.states, ctrl=dynamics.sizes.ctrl + added.controls
    )
    controls, hold, observe, sign_check_values = _functions_within(inner, layer)

    def setup(plan: FlightPlan, signature: float) -> ControlSetup:
        parameters, knots = inner.setup(plan, inner.signature)
        return ControlSetup(record(signature, layer.read(plan), parameters), knots)

    def within(setup: ControlSetup) -> ControlSetup:
        return ControlSetup(setup.parameters.inner, setup.knots)

    def initial_activations(plan: FlightPlan, setup: ControlSetup) -> Vector:
        before = dynamics.initial_activations(plan, within(setup))
        return (*before, *layer.initial_activations(plan, setup.parameters.layer, before))

    def derive(samples: Samples, setup: ControlSetup) -> dict[str, Floats]:
        return layer.derive(lambda: inner.columns.derive(samples, within(setup)), samples, setup)

    columns = replace(
        inner.columns,
        observe=observe,
        derive=derive,
        fields=(*inner.columns.fields, *layer.fields, *layer.remembered),
        units={**inner.columns.units, **layer.units},
        observe_reads_controls=inner.columns.observe_reads_controls or bool(layer.remembered),
    )
    return replace(
        inner,
        parameters=record,
        setup=setup,
        dynamics=replace(
            dynamics,
            sizes=sizes,
            initial_activations=initial_activations,
            extra_actuators=(*dynamics.extra_actuators, *([added] if any(added) else ())),
        ),
        sampling=Sampling(layer.controls or controls, layer.hold or hold),
        columns=columns,
        monitoring=Monitoring(
            sign_check_values, lambda sample, setup: inner.monitoring.causes(sample, within(setup))
        ),
        equations=layer.equations,
        within=None if layer.of_controller else inner,
    )


def _none_added(time: Any, qpos: Any, qvel: Any, act: Any, ctrl: Any, parameters: Any) -> Any:
    return xp.zeros(0)


def _functions_within(inner: ClosedLoop, layer: Layer) -> tuple[Callable[..., Values], ...]:
    """Controls, hold, observe and sign check values of a loop, for a layer around it.

    They read the parameters ``inner`` and the first entries of ``act`` and ``ctrl``, add or hold
    the layer's part of ``ctrl``, and observe its fields, which are part of ``act``.
    """
    inner_controls, inner_hold = inner.sampling.controls, inner.sampling.hold
    inner_observe = inner.columns.observe
    inner_check = inner.monitoring.sign_check_values
    act_size, ctrl_size = inner.dynamics.sizes.act, inner.dynamics.sizes.ctrl
    end, first = act_size + len(layer.fields), ctrl_size + layer.actuators.states
    adds = layer.adds or _none_added

    @traceable
    def controls(time: Any, qpos: Any, qvel: Any, act: Any, parameters: Any, knots: Any) -> Any:
        ctrl = inner_controls(time, qpos, qvel, act, parameters.inner, knots)
        return xp.hstack([ctrl, adds(time, qpos, qvel, act, ctrl, parameters.layer)])

    @traceable
    def hold(time: Any, qpos: Any, qvel: Any, act: Any, ctrl: Any, parameters: Any) -> Any:
        inner = inner_hold(time, qpos, qvel, act, ctrl[:ctrl_size], parameters.inner)
        further = ctrl[ctrl_size:]
        if layer.adds:
            further = adds(time, qpos, qvel, act, inner, parameters.layer)
        return xp.hstack([inner, further])

    @traceable
    def observe(qpos: Any, qvel: Any, act: Any, ctrl: Any) -> Any:
        inner = inner_observe(qpos, qvel, act[:act_size], ctrl[:ctrl_size])
        remembered = ctrl[first : first + len(layer.remembered)]
        return xp.hstack([inner, act[act_size:end], remembered])

    @traceable
    def sign_check_values(time: Any, values: Any, parameters: Any, knots: Any) -> Any:
        return inner_check(time, values, parameters.inner, knots)

    return controls, hold, observe, sign_check_values
