"""Real actuators and sensors around any controller that follows a gait.

`with_actuation` puts a layer between controller and vehicle. Each control step goes

    sensors -> controller -> latency -> servos and motors -> faults -> vehicle

and by default each of these stages does nothing. Its memory is MuJoCo's state: the speed commands
of the motors and the commands under way are activations, the commands in force are controls of
actuators that act on nothing. So the control step remains a pure function that restarts anywhere,
and a scenario with ideal actuators runs without the layer.
"""

from functools import cache
from math import inf
from typing import Any, Final

import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup
from tiltsim.laws.law import servo_lead
from tiltsim.laws.layers.layer import Layer, PlantState, Samples, wrap_loop
from tiltsim.models.parts import ExtraActuators
from tiltsim.scenario.scenario import FlightPlan, Scenario
from tiltsim.vehicles.rotorcraft import QW, TILT_1, initial_tilts, layout_of
from tiltsim_controllers.code.arrays import traceable, xp
from tiltsim_controllers.mathematics.records import make_record_type
from tiltsim_controllers.mathematics.scalar import Floats, Vector
from tiltsim_controllers.vehicle.actuators import (
    faults_record,
    rate_limited_command,
    servo_commands,
    thrust_factors,
)
from tiltsim_controllers.vehicle.instruments import (
    Sensor,
    Sensors,
    reading_error,
    reading_index,
    rotate_by_small_angle,
)


@cache
def actuation_record(rotors: int) -> Any:
    """The type of the layer's parameters for a number of rotors."""
    return make_record_type(
        "Actuation",
        sensors=Sensors,
        control_timestep=float,  # s; 0 if continuous
        slowest=float,  # rad/s, of a rotor along its spin
        fastest=float,
        rotor_pole=float,  # 1/s, one over the rotors' time constant; 0 where they follow at once
        servo_reach=float,  # rad, see `tiltsim_controllers.vehicle.actuators.rate_limited_command`
        faults=faults_record(rotors),
    )


def driven(
    time: Any, tilts: Any, speeds: Any, asked: Any, commands: Any, spins: Any, actuation: Any
) -> Any:
    """Controls of actuators: set points of the servos, thrust controls, rotor accelerations.

    The thrusts are reduced by faults. Rotors accelerate as commanded, or by a lag behind the
    commanded speeds, which the plant keeps within the rotors' limits at the end of each step;
    stages of an integrator may pass them.

    Args:
        time: s.
        tilts: rad, shape (M,).
        speeds: Signed, of the rotors, rad/s, shape (N,).
        asked: Commanded speeds, as ``speeds``.
        commands: Tilt angles (rad), then rotor accelerations (rad/s^2), shape (M + N,).
        spins: Signs of the rotor speeds, shape (N,).
        actuation: The layer's parameters.
    """
    servos = servo_commands(time, commands[: len(tilts)], actuation.faults)
    points = rate_limited_command(servos, tilts, actuation.servo_reach)
    thrusts = spins * (speeds * abs(speeds)) * thrust_factors(time, actuation.faults)
    pole, limits = actuation.rotor_pole, (actuation.slowest, actuation.fastest)
    lagging = pole * (spins * xp.clip(spins * asked, *limits) - speeds)
    return xp.hstack([points, thrusts, xp.where(pole == 0.0, commands[len(tilts) :], lagging)])


def along_line(line: Any, sent: Any, timestep: float) -> tuple[Any, Any]:
    """Commands that arrive, and rates of a line of activations that delays them.

    By these each place of the line holds its neighbor's commands at the next control step.

    Args:
        line: Commands under way, the newest first, shape (steps, size); no steps for no latency.
        sent: New commands, shape (size,).
        timestep: s, between control steps.
    """
    if len(line) == 0:
        return sent, line
    return line[-1], (xp.vstack([sent, *line[:-1]]) - line) / timestep


@cache
def with_actuation(loop: ClosedLoop, latency_steps: int, external: bool = False) -> ClosedLoop:
    """A loop around a rotorcraft with real sensors and actuators.

    Args:
        loop: The loop without them.
        latency_steps: Control steps between a reading and its command taking effect.
        external: Whether commands come from outside. One more number then states whether the rotor
            commands are speeds (rad/s), which take effect at once: `tiltsim.plants.commanded_plant`
            moves these along the delay line, as no rate of activations makes a speed jump.
    """
    layout = layout_of(loop)
    rotors, tilts = layout
    size = rotors + tilts  # commands of a controller
    under_way = (size + external) * latency_steps
    # Activations: the law's, speed commands of the motors, the line. Controls: the law's, then
    # rates of these, then the commands in force.
    asked = slice(loop.sizes.act, loop.sizes.act + rotors)
    line = slice(asked.stop, asked.stop + under_way)
    states = slice(layout.further_rates, loop.sizes.ctrl)
    line_rates = slice(states.stop + rotors, states.stop + rotors + under_way)

    def controls_of(
        time: Any, qpos: Any, act: Any, ctrl: Any, commands: Any, rates: Any, actuation: Any
    ) -> Any:
        spins = xp.array(loop.spins)
        head = driven(time, qpos[TILT_1:], act[:rotors], act[asked], commands, spins, actuation)
        return xp.hstack([head, ctrl[states], commands[tilts:], rates, commands])

    def sees(_within: Any, time: Any, state: PlantState, own: Any) -> PlantState:
        return PlantState(*measured(time, state.qpos, state.qvel, own.sensors), state.act)

    def controls(within: Any, time: Any, state: PlantState, own: Any, knots: Any) -> Any:
        qpos, _, act = state
        ctrl = within(sees(within, time, state, own))
        commands = xp.hstack([ctrl[:tilts], ctrl[layout.accelerations]])
        rates = xp.zeros(under_way)  # the plant moves the line of external commands
        if not external:
            before = act[line].reshape(latency_steps, size)
            commands, rates = along_line(before, commands, own.control_timestep)
        return controls_of(time, qpos, act, ctrl, commands, rates.ravel(), own)

    def hold(_within: Any, time: Any, qpos: Any, act: Any, ctrl: Any, own: Any) -> Any:
        commands = ctrl[line_rates.stop :]
        return controls_of(time, qpos, act, ctrl, commands, ctrl[line_rates], own)

    def initial_activations(plan: FlightPlan, _layer: Any, inner: Vector) -> Vector:
        angles, at_rest = initial_tilts(plan)[0][:tilts], (0.0,) * rotors
        waiting = (*angles, *at_rest, 0.0) if external else (*angles, *at_rest)
        return (*inner[:rotors], *waiting * latency_steps)

    layer = Layer(
        actuation_record(rotors),
        _actuation,
        sees=sees,
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


def _derive(samples: Samples, setup: ControlSetup) -> dict[str, Floats]:
    time, faults = samples["time"], setup.parameters.layer.faults
    pairs = zip(faults.thrust_time, faults.thrust_factor, strict=True)
    return {
        f"thrust_factor_{rotor}": np.where(time >= since, factor, 1.0)
        for rotor, (since, factor) in enumerate(pairs, start=1)
    }


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
        faults=_faults(plan),
    )


NO_FAULT: Final = {"thrust_time": inf, "thrust_factor": 1.0, "stuck_time": inf, "stuck_angle": 0.0}


def _faults(plan: FlightPlan) -> Any:
    """The faults of the rotors; a servo's are at the rotor with its number."""
    vehicle, gait = plan.scenario.any_rotorcraft, plan.gait
    found = {name: [value] * vehicle.rotor_count for name, value in NO_FAULT.items()}
    for table in plan.scenario.fault:
        if table.type == "stuck_servo":
            tilt = vehicle.tilt_of_rotor(table.rotor)
            planned = gait.jets(table.time)[tilt][0]
            found["stuck_time"][tilt] = table.time
            found["stuck_angle"][tilt] = planned if table.angle is None else table.angle
        else:
            rotor = table.rotor - 1
            found["thrust_time"][rotor] = table.time
            found["thrust_factor"][rotor] = 0.0 if table.type == "rotor_loss" else table.factor
    return faults_record(vehicle.rotor_count)(**{k: tuple(v) for k, v in found.items()})


DEFAULT_SAMPLE_TIME: Final = 0.01
"""s between readings of the sensors, if neither they nor a held controller define it."""


@traceable
def measured(time: Any, qpos: Any, qvel: Any, sensors: Sensors) -> tuple[Any, Any]:
    """The vehicle's ``qpos`` and ``qvel`` as its sensors read them.

    Tilts and their rates are exact, and so is an angular acceleration that follows these.

    Args:
        time: s.
        qpos, qvel: Shapes (7 + tilts,) and (6 + tilts + any,).
        sensors: Errors of the measurements.
    """
    if sensors.active == 0.0:
        return qpos, qvel
    index = reading_index(time, sensors.period)

    def error(sensor: Sensor, channel: float) -> Any:
        return reading_error(sensor, sensors.seed, channel, index)

    position = qpos[:3] + error(sensors.position, 0.0)
    velocity = qvel[:3] + error(sensors.velocity, 3.0)
    quaternion = rotate_by_small_angle(qpos[QW:TILT_1], error(sensors.attitude, 6.0))
    body_rates = qvel[3:6] + error(sensors.body_rates, 9.0)
    return (
        xp.hstack([position, quaternion, qpos[TILT_1:]]),
        xp.hstack([velocity, body_rates, qvel[6:]]),
    )


def sensor_parameters(scenario: Scenario) -> Sensors:
    """The sensors of a scenario."""
    sensors, simulation = scenario.sensors, scenario.simulation
    vectors = {
        name: Sensor(getattr(sensors, f"{name}_noise"), getattr(sensors, f"{name}_bias"))
        for name in ("position", "velocity", "attitude", "body_rates")
    }
    return Sensors(
        active=float(sensors.have_errors),
        seed=float(simulation.seed),
        period=sensors.sample_time or simulation.control_timestep or DEFAULT_SAMPLE_TIME,
        **vectors,
    )
