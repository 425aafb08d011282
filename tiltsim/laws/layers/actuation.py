"""Real actuators and sensors around any controller that follows a gait.

`with_actuation` puts a layer between controller and vehicle. Each control step goes

    sensors -> controller -> latency -> servos and motors -> faults -> vehicle

and by default each of these stages does nothing. Its memory is MuJoCo's state: the speed commands
of the motors and the commands under way are activations, the commands in force are controls of
actuators that act on nothing. So the control step remains a pure function that restarts anywhere,
and a scenario with ideal actuators runs without the layer.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import inf
from typing import TYPE_CHECKING, Any, NamedTuple, get_type_hints

import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup
from tiltsim.engines.sample_evaluation import evaluate_over_samples
from tiltsim.laws.layers.delay_line import delay_line, held_line, undelayed
from tiltsim.laws.layers.layer import Layer, Samples, wrap_loop
from tiltsim.laws.layers.sensing import measured_qpos, measured_qvel, sensor_parameters
from tiltsim.laws.rotorcraft import servo_lead
from tiltsim.models.parts import ExtraActuators
from tiltsim.vehicles.rotorcraft import initial_tilts
from tiltsim.vehicles.rotorcraft.layout import TILT_1, layout_of
from tiltsim_controllers.mathematics.records import make_record_type
from tiltsim_controllers.mathematics.scalar import Floats, Values, Vector, clipped, scalar
from tiltsim_controllers.mathematics.vectors import entries_of, tuple_text, written_out
from tiltsim_controllers.vehicle.actuators import (
    RotorFault,
    rate_limited_command,
    servo_command,
    thrust_factor,
)
from tiltsim_controllers.vehicle.sensors import Sensors

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan


class Actuation(NamedTuple):
    """The parameters of the layer; `actuation_record` adds the faults of every rotor."""

    sensors: Sensors
    control_timestep: float  # s; 0 if continuous
    slowest: float  # rad/s, of a rotor along its spin
    fastest: float
    rotor_pole: float  # 1/s, one over the rotors' time constant; 0 where they follow at once
    servo_reach: float  # rad, see `tiltsim_controllers.vehicle.actuators.rate_limited_command`


@cache
def faults_record(rotors: int) -> Any:
    """The type of the faults of so many rotors, ``rotor_1`` and so on.

    The fault of a servo is among those of the rotor with its number.
    """
    return make_record_type("Faults", **{f"rotor_{i + 1}": RotorFault for i in range(rotors)})


@cache
def actuation_record(rotors: int) -> Any:
    """The type of the layer's parameters for so many rotors."""
    own = get_type_hints(Actuation)
    return make_record_type("Actuation", **own, faults=faults_record(rotors))


@cache
def actuators_of(spins: Values, tilts: int, first: int) -> Callable[..., Values]:
    """Scalar code of the actuators of rotors with these spins: ``(time, qpos, act, commands, a)``.

    Commands are tilt angles (rad), then rotor accelerations (rad/s^2); ``a`` is the layer's
    parameters. It returns the set points of the servos (rad), the thrust controls as reduced by
    faults, and the rotor accelerations, as commanded or by the lag behind the speed commands.
    Those are activations from ``first`` on; the plant keeps them within the rotors' limits at the
    end of each step, `clipped` at the stages of an integrator, too.
    """
    senses = "".join("p" if spin > 0.0 else "m" for spin in spins)
    signs, rotors = ["" if spin > 0.0 else "-" for spin in spins], range(len(spins))
    stuck = "stuck(time, commands[{0}], actuation.faults.rotor_{1})"
    servos = written_out(
        f"servo_controls_{tilts}",
        "time, qpos, commands, actuation",
        tuple_text(
            f"limited({stuck.format(j, j + 1)}, qpos[{TILT_1 + j}], actuation.servo_reach)"
            for j in range(tilts)
        ),
        limited=rate_limited_command,
        stuck=servo_command,
    )
    thrusts = written_out(
        f"faulty_thrusts_{senses}",
        "time, act, faults",
        tuple_text(
            f"{signs[i]}act[{i}] * abs(act[{i}]) * factor(time, faults.rotor_{i + 1})"
            for i in rotors
        ),
        factor=thrust_factor,
    )
    limits = ["low, high" if spin > 0.0 else "-high, -low" for spin in spins]
    lagging: Callable[..., Values] = written_out(
        f"lagging_rotors_{senses}_{first}",
        "act, pole, low, high",
        tuple_text(f"pole * (clipped(act[{first + i}], {limits[i]}) - act[{i}])" for i in rotors),
        clipped=clipped,
    )
    accelerations = entries_of(tilts, len(spins))

    @scalar
    def motors(act: Vector, commands: Vector, actuation: Any) -> Values:
        if actuation.rotor_pole == 0.0:
            return accelerations(commands)
        return lagging(act, actuation.rotor_pole, actuation.slowest, actuation.fastest)

    @scalar
    def driven(time: float, qpos: Vector, act: Vector, commands: Vector, actuation: Any) -> Values:
        return (
            *servos(time, qpos, commands, actuation),
            *thrusts(time, act, actuation.faults),
            *motors(act, commands, actuation),
        )

    return driven


@cache
def with_actuation(loop: ClosedLoop, latency_steps: int, external: bool = False) -> ClosedLoop:
    """A loop around a rotorcraft with real sensors and actuators.

    Args:
        loop: Without them.
        latency_steps: Control steps between a reading and its command taking effect.
        external: Whether commands come from outside: with one number more, whether those of the
            rotors are speeds (rad/s), which they take at once. `tiltsim.plants.commanded_plant`
            moves these along the delay line, as no rate of activations makes a speed jump.
    """
    law_controls, dynamics = loop.sampling.controls, loop.dynamics
    law_act, law_ctrl = dynamics.sizes.act, dynamics.sizes.ctrl
    layout = layout_of(dynamics)
    rotors, tilts = layout
    size = rotors + tilts  # commands of a controller
    under_way = (size + external) * latency_steps
    line_ctrl = law_ctrl + rotors  # the delay line's controls
    memory = line_ctrl + under_way  # the commands in force, last of the controls
    # The delay line follows the speed commands of the motors.
    delivered, line_rates = (
        (undelayed, held_line(under_way))
        if external
        else delay_line(law_act + rotors, latency_steps, size)
    )
    driven = actuators_of(dynamics.spins, tilts, law_act)
    angles_in, demanded_in = entries_of(0, tilts), entries_of(layout.acceleration_1, rotors)
    accelerations_in, commands_in = entries_of(tilts, rotors), entries_of(memory, size)
    further = layout.further_rates

    @scalar
    def controls(
        time: float, qpos: Vector, qvel: Vector, act: Vector, parameters: Any, knots: Vector
    ) -> Values:
        actuation = parameters.layer
        seen_qpos = measured_qpos(time, qpos, actuation.sensors)
        seen_qvel = measured_qvel(time, qvel, actuation.sensors)
        ctrl = law_controls(time, seen_qpos, seen_qvel, act, parameters.inner, knots)
        sent = (*angles_in(ctrl), *demanded_in(ctrl))
        commands = delivered(act, sent)
        return (
            *driven(time, qpos, act, commands, actuation),
            *ctrl[further:],
            *accelerations_in(commands),
            *line_rates(act, sent, actuation.control_timestep),
            *commands,
        )

    @scalar
    def hold(
        time: float, qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector, parameters: Any
    ) -> Values:
        actuation = parameters.layer
        commands = commands_in(ctrl)
        return (
            *driven(time, qpos, act, commands, actuation),
            *ctrl[further:law_ctrl],
            *accelerations_in(commands),
            *ctrl[line_ctrl:],
        )

    def initial_activations(plan: FlightPlan, _layer: Actuation, inner: Vector) -> Vector:
        angles, at_rest = initial_tilts(plan)[0][:tilts], (0.0,) * rotors
        waiting = (*angles, *at_rest, 0.0) if external else (*angles, *at_rest)
        return (*inner[:rotors], *waiting * latency_steps)

    layer = Layer(
        f"with_actuation.{latency_steps}",
        actuation_record(rotors),
        _actuation,
        controls=controls,
        hold=hold,
        actuators=ExtraActuators(
            states=rotors + under_way, memories=size, begins_with_rotor_speeds=True
        ),
        initial_activations=initial_activations,
        derive=_derive,
        units=dict.fromkeys(layout.names("thrust_factor"), "1"),
    )
    return wrap_loop(loop, layer)


def _derive(
    inner: Callable[[], dict[str, Floats]], samples: Samples, setup: ControlSetup
) -> dict[str, Floats]:
    time, columns = samples["time"], inner()
    for rotor, fault in enumerate(setup.parameters.layer.faults, start=1):
        states, own = np.empty((len(time), 0)), ControlSetup(fault)
        remaining = evaluate_over_samples(_remaining, 1, time, states, own)
        columns[f"thrust_factor_{rotor}"] = remaining[:, 0]
    return columns


@scalar
def _remaining(time: float, state: Vector, fault: RotorFault, knots: Vector) -> tuple[float]:
    """`thrust_factor` of a sample."""
    return (thrust_factor(time, fault),)


def _actuation(plan: FlightPlan) -> Any:
    scenario = plan.scenario
    simulation, vehicle = scenario.simulation, scenario.any_rotorcraft
    slowest, fastest = vehicle.speeds_along_spin
    max_rate, time_constant = vehicle.tilt_servo.max_rate, vehicle.rotor_time_constant
    return actuation_record(vehicle.rotor_count)(
        sensors=sensor_parameters(scenario),
        control_timestep=simulation.control_timestep,
        slowest=slowest,
        fastest=fastest,
        rotor_pole=0.0 if time_constant is None else 1.0 / time_constant,
        servo_reach=inf if max_rate is None else servo_lead(vehicle.tilt_servo) * max_rate,
        faults=faults_record(vehicle.rotor_count)(*_faults(plan)),
    )


def _faults(plan: FlightPlan) -> tuple[RotorFault, ...]:
    """Those of the rotors; a servo's are among those of the rotor with its number."""
    vehicle, gait = plan.scenario.any_rotorcraft, plan.gait
    faults = [RotorFault()] * vehicle.rotor_count
    for table in plan.scenario.fault:
        if table.type == "stuck_servo":
            tilt = vehicle.tilt_of_rotor(table.rotor)
            planned = gait.jets(table.time)[tilt][0]
            angle = planned if table.angle is None else table.angle
            faults[tilt] = faults[tilt]._replace(stuck_time=table.time, stuck_angle=angle)
        else:
            factor = 0.0 if table.type == "rotor_loss" else table.factor
            index = table.rotor - 1
            faults[index] = faults[index]._replace(thrust_time=table.time, thrust_factor=factor)
    return tuple(faults)
