"""Layers around a closed loop: stages between the controller and its vehicle.

A layer has its own parameters and states and replaces some functions; the rest stays as in the loop
within. `wrap_loop` is the one place where that is put together.

`on_equations` puts any loop of a rotorcraft, with any layers, on equations of motion. The controls
are the same function of time, `qpos`, `qvel` and `act` as in MuJoCo, with the same sensors, noise
and latency. Only the plant on which they act differs: the thesis's vehicle or a rigid body, both of
`tiltsim.equations.actuator_level`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup, Equations
from tiltsim.engines.sample_evaluation import evaluate_over_samples
from tiltsim.equations.actuator_level import ActuatorPlant, limit_speeds_of, mechanics
from tiltsim.models.parts import WRENCH_SIZE, ExtraActuators
from tiltsim.scenario.scenario import FlightPlan
from tiltsim.vehicles.rotorcraft import layout_of
from tiltsim_controllers.code.arrays import traceable, xp
from tiltsim_controllers.mathematics.records import make_record_type
from tiltsim_controllers.mathematics.scalar import Floats, Values, Vector

Samples = Mapping[str, Floats]


class PlantState(NamedTuple):
    """MuJoCo's vectors as a loop sees them."""

    qpos: Any
    qvel: Any
    act: Any


@dataclass(frozen=True, eq=False)
class Layer:
    """The parts of a layer, which it adds to a closed loop or replaces in it.

    Where a function is None, the loop within goes on unchanged. Functions have the layer's own
    parameters as ``own``, and the loop within as a function ``within(state) -> ctrl`` of a
    `PlantState`, or ``within(act)`` between samples.
    """

    parameters: type[tuple[Any, ...]]  # the type of the layer's parameters
    read: Callable[[FlightPlan], Any]  # ``(plan) -> parameters``
    sees: Callable[..., PlantState] | None = None
    """Traceable function ``(within, time, state, own) -> state`` that the loop within sees."""
    controls: Callable[..., Values] | None = None
    """Traceable function ``(within, time, state, own, knots) -> ctrl``; see `ClosedLoop`."""
    hold: Callable[..., Values] | None = None
    """Traceable function ``(within, time, qpos, act, ctrl, own) -> ctrl``, likewise."""
    adds: Callable[..., Values] | None = None
    """Traceable function ``(time, qpos, qvel, act, ctrl, own) -> further controls``, which follow
    the controls ``ctrl`` of the loop within, also while these are held."""
    actuators: ExtraActuators | None = None
    """Appended to the actuators of the model; by default a state for each field."""
    initial_activations: Callable[[FlightPlan, Any, Vector], Vector] | None = None
    """``(plan, own, inner activations) -> activations`` of these actuators at time zero; None for
    zeros."""
    derive: Callable[[Samples, ControlSetup], dict[str, Floats]] = lambda _samples, _setup: {}
    """``(samples by field, setup) -> further columns``."""
    columns: Callable[..., Values] | None = None
    """Traceable function ``(time, values, own) -> columns`` of `units`, in place of ``derive``,
    from the values of the fields ``columns_from`` of a sample."""
    columns_from: tuple[str, ...] = ()
    fields: Mapping[str, str] = field(default_factory=dict)
    """Fields of a sample with their units: the first activations of these actuators."""
    remembered: Mapping[str, str] = field(default_factory=dict)
    """Further fields: the first controls of these actuators after rates of activations."""
    units: Mapping[str, str] = field(default_factory=dict)
    """Columns of a flight that the layer derives, with their units."""
    equations: Equations | None = None
    """See `ClosedLoop`; for the parameters of the whole. The equations of the loop within are not
    used: they do not know the layer."""
    of_controller: bool = False
    """Whether it is part of the controller, as a supervisor is: the loop around it counts as a
    controller's own loop, and has none ``within``."""


def wrap_loop(inner: ClosedLoop, layer: Layer) -> ClosedLoop:
    """A closed loop with one more layer around it.

    Its parameters are the signature, the ``layer``'s and the ``inner`` loop's.
    """
    record = make_record_type(
        f"{layer.parameters.__name__}Parameters",
        signature=float,
        layer=layer.parameters,
        inner=inner.parameters,
    )
    added = layer.actuators or ExtraActuators(states=len(layer.fields))
    unnamed = range(1, added.states - len(layer.fields) + 1)
    kind = layer.parameters.__name__.lower()
    added = added._replace(names=(*layer.fields, *(f"{kind}_state_{i}" for i in unnamed)))
    sizes = inner.sizes._replace(
        act=inner.sizes.act + added.states, ctrl=inner.sizes.ctrl + added.controls
    )

    def setup(plan: FlightPlan, signature: float) -> ControlSetup:
        parameters, knots = inner.setup(plan, inner.signature)
        return ControlSetup(record(signature, layer.read(plan), parameters), knots)

    def within(setup: ControlSetup) -> ControlSetup:
        return ControlSetup(setup.parameters.inner, setup.knots)

    @traceable
    def columns(time: Any, values: Any, own: Any, knots: Any) -> Any:
        assert layer.columns is not None
        return layer.columns(time, values, own)

    def derive(samples: Samples, setup: ControlSetup) -> dict[str, Floats]:
        if layer.columns is None:
            return layer.derive(samples, setup)
        values = np.stack([samples[name] for name in layer.columns_from], axis=-1)
        own = ControlSetup(setup.parameters.layer)
        rows = evaluate_over_samples(columns, len(layer.units), samples["time"], values, own)
        return dict(zip(layer.units, rows.T, strict=True))

    def initial_activations(plan: FlightPlan, setup: ControlSetup) -> Vector:
        before = inner.initial_activations(plan, within(setup))
        if layer.initial_activations is None:
            return (*before, *(0.0,) * added.states)
        return (*before, *layer.initial_activations(plan, setup.parameters.layer, before))

    return replace(
        inner,
        **_functions_within(inner, layer, inner.sizes.ctrl + added.states),
        parameters=record,
        setup=setup,
        sizes=sizes,
        initial_activations=initial_activations,
        extra_actuators=(*inner.extra_actuators, *([added] if any(added) else ())),
        derive=lambda s, own: {**inner.derive(s, within(own)), **derive(s, own)},
        fields=(*inner.fields, *layer.fields, *layer.remembered),
        further_units={**inner.further_units, **layer.units, **layer.fields, **layer.remembered},
        observe_reads_controls=inner.observe_reads_controls or bool(layer.remembered),
        causes=lambda sample, own: inner.causes(sample, within(own)),
        equations=layer.equations,
        within=None if layer.of_controller else inner,
    )


def _functions_within(inner: ClosedLoop, layer: Layer, first: int) -> dict[str, Any]:
    """Functions of a loop, by name, in a layer that remembers controls from ``first`` on."""
    act_size, ctrl_size = inner.sizes.act, inner.sizes.ctrl
    end = act_size + len(layer.fields)
    adds = layer.adds or (lambda *_: xp.zeros(0))

    def within_at(time: Any, parameters: Any, knots: Any) -> Callable[[PlantState], Any]:
        return lambda state: inner.controls(time, *state, parameters.inner, knots)

    @traceable
    def sees(time: Any, qpos: Any, qvel: Any, act: Any, parameters: Any, knots: Any) -> Any:
        state = PlantState(qpos, qvel, act)
        if layer.sees is None:
            return state
        return layer.sees(within_at(time, parameters, knots), time, state, parameters.layer)

    @traceable
    def controls(time: Any, qpos: Any, qvel: Any, act: Any, parameters: Any, knots: Any) -> Any:
        within, own = within_at(time, parameters, knots), parameters.layer
        if layer.controls:
            return layer.controls(within, time, PlantState(qpos, qvel, act), own, knots)
        ctrl = within(sees(time, qpos, qvel, act, parameters, knots))
        return xp.hstack([ctrl, adds(time, qpos, qvel, act, ctrl, own)])

    @traceable
    def hold(time: Any, qpos: Any, qvel: Any, act: Any, ctrl: Any, parameters: Any) -> Any:
        def within(act: Any) -> Any:
            return inner.hold(time, qpos, qvel, act, ctrl[:ctrl_size], parameters.inner)

        if layer.hold:
            return layer.hold(within, time, qpos, act, ctrl, parameters.layer)
        held, further = within(act), ctrl[ctrl_size:]
        if layer.adds:
            further = adds(time, qpos, qvel, act, held, parameters.layer)
        return xp.hstack([held, further])

    @traceable
    def observe(qpos: Any, qvel: Any, act: Any, ctrl: Any) -> Any:
        values = inner.observe(qpos, qvel, act[:act_size], ctrl[:ctrl_size])
        remembered = ctrl[first : first + len(layer.remembered)]
        return xp.hstack([values, act[act_size:end], remembered])

    @traceable
    def sign_check_values(time: Any, values: Any, parameters: Any, knots: Any) -> Any:
        return inner.sign_check_values(time, values, parameters.inner, knots)

    return {
        "sees": sees,
        "controls": controls,
        "hold": hold,
        "observe": observe,
        "sign_check_values": sign_check_values,
    }


# --- on equations of motion --------------------------------------------------------------------


@cache
def read_actuators(loop: ClosedLoop) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Functions of a model's controls, except thrusts and servos.

    Returns:
        ``rates(ctrl)`` of the activations, in their order, and ``loads(ctrl)``: force and torque on
        the body, then torques about the hinges; see `ActuatorPlant.rates`.
    """
    layout = layout_of(loop)
    own = ExtraActuators(states=layout.rotors + loop.controller_states)
    first, wrenches, hinges = layout.acceleration_1, [], []
    states: list[slice] = []
    for this in (own, *loop.extra_actuators):
        states.append(slice(first, first + this.states))
        force = first + this.states + this.memories
        hinge = force + WRENCH_SIZE * this.wrench
        wrenches += [slice(force, hinge)] if this.wrench else []
        hinges += [slice(hinge, hinge + layout.tilts)] if this.hinge_torques else []
        first += this.controls

    def rates(ctrl: Any) -> Any:
        return xp.hstack([ctrl[part] for part in states])

    def loads(ctrl: Any) -> Any:
        wrench = sum((ctrl[part] for part in wrenches), np.zeros(WRENCH_SIZE))
        torques = sum((ctrl[part] for part in hinges), np.zeros(layout.tilts))
        return xp.hstack([wrench, torques])

    return rates, loads


def _projection(plant: ActuatorPlant, loop: ClosedLoop) -> Callable[..., Any]:
    """Function ``(state, mechanics) -> state`` with motion and speed commands within limits."""
    first = plant.motion + len(loop.spins) + loop.controller_states
    projections = [plant.project_onto_limits] if plant.project_onto_limits else []
    for this in loop.extra_actuators:
        if this.begins_with_rotor_speeds:
            projections += [limit_speeds_of(loop.spins, first)]
        first += this.states

    def project(state: Any, mechanics: Any) -> Any:
        for projection in projections:
            state = projection(state, mechanics)
        return state

    return project


@cache
def on_equations(loop: ClosedLoop, plant: ActuatorPlant) -> ClosedLoop:
    """A loop with equations in which its controls act on a plant.

    Their inputs are the controls, their state is the vehicle's motion followed by the activations.
    """
    first, qpos_of, qvel_of = plant.motion, plant.qpos, plant.qvel
    motion_rates, finish = plant.rates, plant.finish
    activation_rates, loads = read_actuators(loop)
    project_motion = _projection(plant, loop)

    @traceable
    def equation_inputs(time: Any, state: Any, parameters: Any, knots: Any) -> Any:
        return loop.controls(
            time, qpos_of(state), qvel_of(state), state[first:], parameters.inner, knots
        )

    def controls_in_force(time: Any, state: Any, inputs: Any, parameters: Any) -> Any:
        return loop.hold(
            time, qpos_of(state), qvel_of(state), state[first:], inputs, parameters.inner
        )

    @traceable
    def equation_rates(
        time: Any, state: Any, inputs: Any, parameters: Any, knots: Any, disturbance: Any
    ) -> Any:
        # A stage may pass a rotor's limit by up to one step.
        state = project_motion(state, parameters.layer)
        ctrl = controls_in_force(time, state, inputs, parameters)
        moved = motion_rates(state, ctrl, loads(ctrl), parameters.layer, disturbance)
        return xp.hstack([moved, activation_rates(ctrl)])

    @traceable
    def observe_equations(time: Any, state: Any, inputs: Any, parameters: Any, knots: Any) -> Any:
        ctrl = controls_in_force(time, state, inputs, parameters)
        return loop.observe(qpos_of(state), qvel_of(state), state[first:], ctrl)

    @traceable
    def project_onto_limits(state: Any, parameters: Any) -> Any:
        if finish is not None:
            state = finish(state, parameters.layer)
        return project_motion(state, parameters.layer)

    def initial(plan: FlightPlan, setup: ControlSetup) -> Vector:
        inner = ControlSetup(setup.parameters.inner, setup.knots)
        return (*plant.initial(plan), *loop.initial_activations(plan, inner))

    equations = Equations(
        inputs=equation_inputs,
        inputs_size=loop.sizes.ctrl,
        rates=equation_rates,
        initial=initial,
        observe=observe_equations,
        project_onto_limits=project_onto_limits,
        states=plant.names,
    )
    return wrap_loop(loop, Layer(plant.mechanics, mechanics, equations=equations))
