"""Scenarios as linear systems at rest, and as functions of CasADi's symbols."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from os import PathLike
from typing import Any, Final, Literal, NamedTuple

import numpy as np

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.errors import InputError, TiltsimError
from tiltsim.laws.assembling import assemble
from tiltsim.laws.law_loop import airframe
from tiltsim.linear.coordinates import (
    ROTOR_INPUT,
    entry_names,
    equation_coordinates,
    equation_inputs,
    parted,
    unit_of,
)
from tiltsim.linear.equilibrium import Equilibrium, equilibrium_of
from tiltsim.linear.newton import derivative_at, jacobian, steps_at
from tiltsim.scenario.linearizing_controllers import force_dimension, upper_side
from tiltsim.scenario.loading import load_scenario
from tiltsim.scenario.rotorcraft import RotorcraftTable
from tiltsim.scenario.scenario import Scenario
from tiltsim.system.public import optional_package
from tiltsim.system.text import short_repr
from tiltsim.vehicles.rotorcraft import FEWEST_WITH_MARGIN
from tiltsim_controllers.code.arrays import program_of, xp
from tiltsim_controllers.code.casadi_function import casadi_function
from tiltsim_controllers.code.messages import TraceError
from tiltsim_controllers.laws.supervised_vehicles import Watched, multirotor_supervision_of
from tiltsim_controllers.mathematics.attitude import rotation_matrix
from tiltsim_controllers.mathematics.scalar import Floats

INPUT_SCALE: Final = 100.0
"""Rotor accelerations (rad/s^2) are of this order, and their steps in differences; others of 1."""


class Signal(NamedTuple):
    """A state, input or output of a linear system."""

    name: str
    unit: str
    prefix: str = ""  # of the name of a companion's or object's; empty for the first vehicle's

    @property
    def bare(self) -> str:
        """The name without the prefix."""
        return self.name.removeprefix(self.prefix)

    @property
    def text(self) -> str:
        """With the unit in brackets."""
        return f"{self.name} [{self.unit or '-'}]"


@dataclass(frozen=True, eq=False)
class Linearization:
    """A scenario at its rest point as a linear system ``x' = A x + B u``, ``y = C x + D u``.

    States, inputs and outputs are deviations from the rest point. A rotation has three states, the
    vector of a small turn in body axes. The inputs are added to the controller's commands to the
    vehicle, so ``u = feedback x + disturbance`` closes the loop. For a sampled controller it is the
    system from one sample to the next, ``x[k+1] = A x[k] + B u[k]``.
    """

    A: Floats  # dynamics of the closed loop, or of the vehicle alone, shape (states, states)
    B: Floats  # shape (states, inputs)
    C: Floats  # shape (outputs, states)
    D: Floats  # shape (outputs, inputs)
    feedback: Floats  # the controller, shape (inputs, states): commands of the vehicle's inputs
    states: tuple[Signal, ...]  # names and units
    inputs: tuple[Signal, ...]  # names and units
    outputs: tuple[Signal, ...]  # names and units
    timestep: float | None  # sample time, s; None in continuous time
    state: dict[str, float]
    """The states at rest by name: the turn of a rotation is from level attitude."""
    command: dict[str, float]  # the inputs at rest by name
    loop: str  # ``"closed"`` or ``"open"``

    def __repr__(self) -> str:
        """Sizes and time, in one line."""
        time = "continuous" if self.timestep is None else f"every {self.timestep:g} s"
        sizes = (f"{len(getattr(self, kind))} {kind}" for kind in ("states", "inputs", "outputs"))
        return f"<Linearization, {self.loop} loop, {time}: {', '.join(sizes)}>"

    @property
    def poles(self) -> Floats:
        """Eigenvalues of A, complex."""
        return np.linalg.eigvals(self.A).astype(complex)

    def opened(self) -> Linearization:
        """The vehicle without the controller; its controller's states, if any, keep their input."""
        if self.loop == "open":
            return self
        a, c = self.A - self.B @ self.feedback, self.C - self.D @ self.feedback
        return replace(self, A=a, C=c, loop="open")

    def to_control(self) -> Any:
        """The system as `control.StateSpace`, its signals named. Needs ``tiltsim[control]``."""
        control = optional_package("control", "to_control", "'tiltsim[control]'")
        names = {
            kind: [signal.name for signal in getattr(self, kind)]
            for kind in ("states", "inputs", "outputs")
        }
        timestep = 0 if self.timestep is None else self.timestep
        return control.ss(self.A, self.B, self.C, self.D, timestep, **names)


def linearize(
    scenario: Scenario | str | PathLike[str] | Mapping[str, Any],
    *,
    loop: Literal["closed", "open"] = "closed",
) -> Linearization:
    """A scenario at its rest point as a linear system.

    Args:
        scenario: Anything that `tiltsim.load_scenario` takes, at rest: a fixed gait and a set
            point, or a line, in whose frame it rests.
        loop: ``"closed"``, or ``"open"`` for the vehicle without the controller.

    Raises:
        InputError: If it is invalid or has no rest point.
    """
    if not isinstance(loop, str) or loop not in ("closed", "open"):
        raise InputError(f"loop = {short_repr(loop)}: choose closed or open")
    found = equilibrium_of(load_scenario(scenario), at_rest=True)
    closed = linearization_at(found)
    return closed if loop == "closed" else closed.opened()


def linearization_at(found: Equilibrium) -> Linearization:
    """The closed loop at a rest point."""
    motion, state, time = found.motion, found.root.state, found.time
    if found.corners:
        raise InputError(
            f"{motion.scenario.address or 'scenario'}: rests at a limit or at the edge of a dead "
            f"zone of {', '.join(found.corners)}: there is no linear system; move it off"
        )
    closed_loop = motion.assembly.loop

    def varied(offsets: Floats) -> Floats:
        motion.offsets[:] = offsets
        try:
            if not found.steps:
                moved = motion.rates(time, state)
            else:
                after = motion.flown(found.step, state, found.steps)
                moved = motion.coordinates.between(state, after)
            return np.concatenate((moved, motion.observed(time, state)))
        finally:
            motion.offsets[:] = 0.0

    coordinates = motion.coordinates
    count = coordinates.size
    driven = [ROTOR_INPUT in name for name in motion.inputs]
    scales = np.where(driven, INPUT_SCALE, 1.0) * steps_at(np.zeros(len(driven)))
    by_input = jacobian(lambda each: map(varied, each), scales).matrix
    observed = derivative_at(lambda at: motion.observed(time, at), coordinates, state)
    feedback = derivative_at(lambda at: motion.commanded(time, at), coordinates, state)
    names, rows, columns = found.minimal
    fields = closed_loop.sample_fields[1:]

    def signals(of: tuple[str, ...]) -> tuple[Signal, ...]:
        known = motion.prefixes
        return tuple(Signal(n, unit_of(n, closed_loop, known), parted(n, known)[0]) for n in of)

    return Linearization(
        A=found.matrix,
        B=rows @ by_input[:count],
        C=observed @ columns,
        D=by_input[count:],
        feedback=feedback @ columns,
        states=signals(names),
        inputs=signals(motion.inputs),
        outputs=signals(fields),
        timestep=found.timestep,
        state=dict(zip(names, found.values.tolist(), strict=True)),
        command=dict(zip(motion.inputs, motion.commanded(time, state).tolist(), strict=True)),
        loop="closed",
    )


class Symbolic(NamedTuple):
    """CasADi functions of a scenario on equations of motion; its numbers are constants."""

    dynamics: Any  # ``(time, state, inputs) -> rates``: the vehicle, whatever its inputs
    controller: Any  # ``(time, state) -> inputs``
    closed_loop: Any  # ``(time, state) -> rates``
    sample: Any  # ``(time, state) -> sample``: the fields of a recorded sample after its time
    margin: Any
    """``(time, state, inputs) -> margin``: the angle (rad) of world up to the nearest direction in
    which the rotors, without torque, have no lift: the column `singularity_margin`, by the
    components of force that the vehicle has all over its planned gait, no rotor lost. None without
    four rotors or lift at zero torque."""
    signs: Any
    """``(time, state, inputs) -> signs``: numbers of which none may reach zero in a flight, where
    the controller is singular: first the determinant of its decoupling matrix, then, where they
    count, the rotor speeds; 1 if it is singular nowhere."""
    initial: tuple[float, ...]  # state at time zero
    states: tuple[str, ...]
    """Names of the state's entries; a rotation has four of a quaternion, or nine of its matrix,
    rows first."""
    inputs: tuple[str, ...]  # names of the inputs' entries; empty for one that changes nothing
    fields: tuple[str, ...]  # names of the sample's entries


def _input_names(assembly: Assembly, size: int) -> tuple[str, ...]:
    """Names of the inputs of equations; a thrust is among them as a squared speed."""
    names = [""] * size
    for found in equation_inputs(assembly):
        scaled = found.per_unit != 1.0
        names[found.place] = found.name.replace("thrust", "squared_speed" if scaled else "thrust")
    return tuple(names)


def _margin_of(scenario: Scenario) -> Callable[[Mapping[str, Any]], Any] | None:
    """The angle (rad) to the nearest singular attitude, as a function of a sample; None without."""
    if not isinstance(scenario.vehicle, RotorcraftTable):
        return None
    craft = airframe(scenario)
    vehicle, dimension = craft.vehicle, force_dimension(craft.vehicle, craft.gait)[0]
    if craft.rotors < FEWEST_WITH_MARGIN or not dimension:
        return None
    watched = Watched(per_volume=1.0, side=upper_side(vehicle, craft.gait))
    supervision = multirotor_supervision_of(vehicle.tilt_of_rotor, dimension)

    def margin(seen: Mapping[str, Any]) -> Any:
        up = rotation_matrix(xp.array([seen[name] for name in ("roll", "pitch", "yaw")]))[2]
        tilts = xp.array([seen[f"alpha_{tilt + 1}"] for tilt in range(vehicle.tilts)])
        return supervision.assess(tilts, up, watched, xp.array(vehicle.table))[0]

    return margin


def symbolic(scenario: Scenario | str | PathLike[str] | Mapping[str, Any]) -> Symbolic:
    """A scenario as CasADi functions of its dynamics and of its closed loop.

    Args:
        scenario: Anything that `tiltsim.load_scenario` takes; on the plant thesis or rigid_body.

    Raises:
        InputError: If the scenario is invalid or in MuJoCo, or CasADi is missing.
        TiltsimError: If it needs random numbers, which have no symbolic form.
    """
    scenario = load_scenario(scenario)
    if scenario.simulation.plant == "mujoco":
        raise InputError(
            'simulation.plant = "mujoco": symbolic supports "thesis" and "rigid_body" only'
        )
    optional_package("casadi", "tiltsim.symbolic", "'tiltsim[casadi]'")
    assembly = assemble(scenario)
    equations, setup = assembly.loop.required_equations, assembly.setup
    initial = tuple(map(float, equations.initial(assembly, setup)))
    moved = *setup, scenario.disturbance_acceleration

    def dynamics(time: Any, state: Any, inputs: Any) -> Any:
        return equations.rates(time[0], state, inputs, *moved)

    def controller(time: Any, state: Any) -> Any:
        return equations.inputs(time[0], state, *setup)

    def closed_loop(time: Any, state: Any) -> Any:
        return dynamics(time, state, xp.array(controller(time, state)))

    def sample(time: Any, state: Any) -> Any:
        return equations.observe(time[0], state, xp.array(controller(time, state)), *setup)

    def signs(time: Any, state: Any, inputs: Any) -> Any:
        seen = equations.observe(time[0], state, inputs, *setup)
        return xp.array(assembly.loop.sign_check_values(time[0], xp.array(seen), *setup))

    fields, margin_at = assembly.loop.sample_fields[1:], _margin_of(scenario)

    def margin(time: Any, state: Any, inputs: Any) -> Any:
        assert margin_at is not None
        seen = dict(zip(fields, equations.observe(time[0], state, inputs, *setup), strict=True))
        return xp.array([margin_at(seen)])

    sizes = {"time": 1, "state": len(initial)}

    def function(traced: Callable[..., Any], result: str, **more: int) -> Any:
        program = program_of(traced, **sizes, **more)
        try:
            return casadi_function(program, traced.__name__, result)
        except TraceError as error:
            raise TiltsimError(str(error)) from error

    return Symbolic(
        function(dynamics, "rates", inputs=equations.inputs_size),
        function(controller, "inputs"),
        function(closed_loop, "rates"),
        function(sample, "sample"),
        function(margin, "margin", inputs=equations.inputs_size) if margin_at else None,
        function(signs, "signs", inputs=equations.inputs_size),
        initial,
        entry_names(equation_coordinates(assembly, len(initial))),
        _input_names(assembly, equations.inputs_size),
        fields,
    )
