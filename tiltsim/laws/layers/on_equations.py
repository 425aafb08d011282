"""Any closed loop of a rotorcraft, with any layers, on equations of motion.

The controls are the same function of time, `qpos`, `qvel` and `act` as in MuJoCo, with the same
sensors, noise and latency. Only the plant on which they act differs: the thesis's vehicle
(`tiltsim.equations.actuator_level`) or a rigid body (`tiltsim.equations.rigid_body`).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup, Dynamics, Equations
from tiltsim.equations.actuator_level import ActuatorPlant, Loads, limit_speeds_of
from tiltsim.laws.layers.layer import Layer, wrap_loop
from tiltsim.models.parts import WRENCH_SIZE, ExtraActuators
from tiltsim.vehicles.rotorcraft.layout import layout_of
from tiltsim_controllers.mathematics.scalar import Triple, Values, Vector, scalar
from tiltsim_controllers.mathematics.vectors import tuple_text, written_out

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan


def read_actuators(dynamics: Dynamics) -> tuple[Callable[..., Values], Callable[..., Loads]]:
    """Scalar code that reads what a model's controls do besides thrusts and servos.

    Returns ``rates(ctrl)`` of the activations, in their order, and ``loads(ctrl)``.
    """
    layout = layout_of(dynamics)
    own = ExtraActuators(states=layout.rotors + dynamics.controller_states)
    return _read_actuators(
        (own, *dynamics.extra_actuators), layout.acceleration_1, WRENCH_SIZE + layout.tilts
    )


@cache
def _read_actuators(
    actuators: tuple[ExtraActuators, ...], first: int, loads: int
) -> tuple[Callable[..., Values], Callable[..., Loads]]:
    """`read_actuators` of these, whose controls begin at an index."""
    rates: list[int] = []
    sums: list[list[int]] = [[] for _ in range(loads)]  # the last layer's come first
    for this in actuators:
        rates += range(first, first + this.states)
        force = first + this.states + this.memories
        hinge = force + WRENCH_SIZE * this.wrench
        for load in range(WRENCH_SIZE * this.wrench):
            sums[load].insert(0, force + load)
        for load in range(this.hinge_torques):
            sums[WRENCH_SIZE + load].insert(0, hinge + load)
        first += this.controls
    terms = [[f"ctrl[{index}]" for index in places] for places in sums]
    name = "_".join("x".join(str(int(number)) for number in this) for this in actuators)
    name = f"{first}_{loads}_{name}"  # distinguishes them from all others
    return (
        written_out(f"rates_{name}", "ctrl", tuple_text(f"ctrl[{index}]" for index in rates)),
        written_out(
            f"loads_{name}", "ctrl", tuple_text(" + ".join(["0.0", *added]) for added in terms)
        ),
    )


def _projection(
    project_motion: Callable[..., list[float]], first: int, dynamics: Dynamics
) -> Callable[..., list[float]]:
    """A projection of the motion and of commanded rotor speeds onto their limits.

    The states of the actuators begin at ``first``. In scalar code, ``(state, mechanics) -> state``.
    """
    for this in dynamics.extra_actuators:
        if this.begins_with_rotor_speeds:
            break
        first += this.states
    else:
        return project_motion
    limit_speeds = limit_speeds_of(dynamics.spins, first)

    @scalar
    def project(state: list[float], mechanics: Any) -> list[float]:
        return limit_speeds(project_motion(state, mechanics), mechanics)

    return project


@cache
def on_equations(loop: ClosedLoop, plant: ActuatorPlant) -> ClosedLoop:
    """A loop with equations in which its controls act on a plant.

    Their inputs are the controls, their state is the vehicle's motion followed by the activations.
    """
    dynamics = loop.dynamics
    first, qpos_of, qvel_of = plant.motion, plant.qpos, plant.qvel
    motion_rates, finish = plant.rates, plant.finish
    controls, held = loop.sampling.controls, loop.sampling.hold
    observe = loop.columns.observe
    activation_rates, loads = read_actuators(dynamics)
    further = first + len(dynamics.spins) + dynamics.controller_states
    project_motion = _projection(plant.project_onto_limits, further, dynamics)

    @scalar
    def equation_inputs(time: float, state: Vector, parameters: Any, knots: Vector) -> Values:
        return controls(
            time, qpos_of(state), qvel_of(state), state[first:], parameters.inner, knots
        )

    @scalar
    def controls_in_force(time: float, state: Vector, inputs: Vector, parameters: Any) -> Values:
        return held(time, qpos_of(state), qvel_of(state), state[first:], inputs, parameters.inner)

    @scalar
    def equation_rates(
        time: float,
        state: list[float],
        inputs: Vector,
        parameters: Any,
        knots: Vector,
        disturbance: Triple,
    ) -> Values:
        # A stage may pass a rotor's limit by up to one step.
        state = project_motion(state, parameters.layer)
        ctrl = controls_in_force(time, state, inputs, parameters)
        return (
            *motion_rates(state, ctrl, loads(ctrl), parameters.layer, disturbance),
            *activation_rates(ctrl),
        )

    @scalar
    def observe_equations(
        time: float, state: Vector, inputs: Vector, parameters: Any, knots: Vector
    ) -> Values:
        ctrl = controls_in_force(time, state, inputs, parameters)
        return observe(qpos_of(state), qvel_of(state), state[first:], ctrl)

    @scalar
    def project_onto_limits(state: list[float], parameters: Any) -> list[float]:
        return project_motion(finish(state, parameters.layer), parameters.layer)

    def initial(plan: FlightPlan, setup: ControlSetup) -> Vector:
        inner = ControlSetup(setup.parameters.inner, setup.knots)
        return (*plant.initial(plan), *dynamics.initial_activations(plan, inner))

    equations = Equations(
        inputs=equation_inputs,
        inputs_size=dynamics.sizes.ctrl,
        rates=equation_rates,
        initial=initial,
        observe=observe_equations,
        project_onto_limits=project_onto_limits,
    )
    return wrap_loop(loop, Layer(plant.name, plant.mechanics, plant.read, equations=equations))
