"""Instruments around any rotorcraft's controller, read at its control steps.

The layer takes readings of the true vehicle and keeps them for their delay. The controller within
sees them behind MuJoCo's velocities: of every instrument its values, then 1 if a reading arrived at
this control step, else 0. Its memory, activations of MuJoCo, are walking biases, readings under way
and the last ones that arrived.

The plant's accelerations are known at the instant of a control step: thrusts, servos, air and
lagging rotors depend on the state and not on the rotor accelerations that a controller commands. So
the controls are computed once to find them, and once more with the readings.
"""

from collections.abc import Callable
from functools import cache
from math import ceil, inf
from typing import Any, Final, NamedTuple

import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop
from tiltsim.equations.actuator_level import mechanics, mechanics_record, servo_accelerations
from tiltsim.laws.layers.layer import Layer, PlantState, read_actuators, wrap_loop
from tiltsim.models.parts import ExtraActuators
from tiltsim.scenario.scenario import FlightPlan, Scenario
from tiltsim.vehicles.rotorcraft import QW, TILT_1, TILT_RATE_1, body_less, layout_of, rotor_limits
from tiltsim_controllers.code.arrays import traceable, xp
from tiltsim_controllers.mathematics.attitude import rotation_matrix, rotation_of_quaternion
from tiltsim_controllers.mathematics.linear import cross
from tiltsim_controllers.mathematics.records import Vector3, make_record_type, vector_of
from tiltsim_controllers.vehicle import instruments
from tiltsim_controllers.vehicle.body import Body, inertia_matrix, inverse_inertia_matrix
from tiltsim_controllers.vehicle.craft import craft_of
from tiltsim_controllers.vehicle.instruments import reading_index
from tiltsim_controllers.vehicle.rotors import wrench_map

CHANNELS: Final = 64  # of the draws of an instrument; other parts of a flight use those below 1000
WALK: Final = 32.0  # channels between the noise of an instrument and the walk of its biases


class Instrument(NamedTuple):
    """The part of an instrument that a loop is compiled for."""

    name: str
    units: tuple[tuple[str, str], ...]  # columns and their units
    errors: int
    under_way: int  # readings that wait for their delay
    walks: bool
    first: int  # of its values among all readings
    late: int  # control steps, its delay

    @property
    def columns(self) -> dict[str, str]:
        """Its columns and units: values, then whether they are new."""
        return {**dict(self.units), f"{self.name}_new": "1"}

    @property
    def states(self) -> int:
        """Numbers in its memory."""
        return self.walks * self.errors + (self.under_way + 2) * len(self.units)


def instruments_of(scenario: Scenario) -> tuple[Instrument, ...]:
    """The instruments of a scenario, in the order of their readings."""
    rotors, step = scenario.any_rotorcraft.rotor_count, scenario.simulation.control_timestep
    found: list[Instrument] = []
    for name, table in scenario.sensors.instruments.items():
        units = {
            column.replace("#", str(i)): unit
            for column, unit in table.columns.items()
            for i in range(1, 1 + (rotors if "#" in column else 1))
        }
        errors, period = table.errors(1.0, rotors), table.period(step)
        late = (ceil(table.delay / span - 1e-6) for span in (period, step))
        first = sum(len(each.columns) for each in found)
        walks, (under_way, steps) = any(errors.walk), late
        own = len(errors.noise), under_way, walks, first, steps
        found.append(Instrument(name, tuple(units.items()), *own))
    return tuple(found)


@cache
def with_instruments(loop: ClosedLoop, carried: tuple[Instrument, ...]) -> ClosedLoop:
    """A loop whose controller sees the readings of instruments behind MuJoCo's velocities."""
    first = loop.sizes.act
    _, loads = read_actuators(loop)
    acceleration, measured = plant_acceleration_of(loop), _measured(loop.spins)
    columns = {name: unit for each in carried for name, unit in each.columns.items()}
    states = sum(each.states for each in carried)
    record = make_record_type(
        "Instruments",
        motion=motion_record(loop),
        control_period=float,  # s
        disturbance=Vector3,  # m/s^2, world
        field=Vector3,  # direction of the magnetic field, world
        **{each.name: instruments.instrument_record(each.errors) for each in carried},
    )

    def read(within: Any, time: Any, state: PlantState, own: Any) -> tuple[PlantState, Any, Any]:
        """The state with readings, rates of the memory, and the readings."""
        qpos, qvel, act = state
        memory = act[first : first + states]
        # Forces of the air and of loads are among the controls, and depend on no reading.
        ctrl = within(state._replace(qvel=xp.hstack([qvel, xp.zeros(len(columns))])))
        moved = acceleration(qpos, qvel, ctrl, loads(ctrl), own.motion)
        readings, kept = [], []
        for each in carried:
            truth = measured[each.name](qpos, qvel, act, moved, own)
            remembered, memory = memory[: each.states], memory[each.states :]
            seen, after = _read(each, time, truth, remembered, own)
            readings.append(seen)
            kept.append((after - remembered) / own.control_period)
        seen = xp.hstack(readings)
        return state._replace(qvel=xp.hstack([qvel, seen])), kept, seen

    def controls(within: Any, time: Any, state: PlantState, own: Any, knots: Any) -> Any:
        state, kept, seen = read(within, time, state, own)
        return xp.hstack([within(state), *kept, seen])

    layer = Layer(
        record,
        lambda plan: _parameters(plan, record, loop, carried),
        sees=lambda *given: read(*given)[0],
        controls=controls,
        actuators=ExtraActuators(states=states, memories=len(columns)),
        remembered=columns,
    )
    return wrap_loop(loop, layer)


def _measured(spins: tuple[float, ...]) -> dict[str, Callable[..., Any]]:
    """The true values of every instrument: ``(qpos, qvel, act, accelerations, parameters)``."""

    def rotation(qpos: Any) -> Any:
        return rotation_of_quaternion(qpos[QW:TILT_1])

    def imu(qpos: Any, qvel: Any, _act: Any, moved: Any, own: Any) -> Any:
        linear, omega = moved[:3] + rotation(qpos).T @ own.disturbance, qvel[3:6]
        force = instruments.specific_force(linear, moved[3:], omega, own.imu.place)
        return xp.hstack([force, omega])

    def point(qpos: Any, place: Any) -> Any:
        return qpos[:3] + rotation(qpos) @ place

    def gps(qpos: Any, qvel: Any, _act: Any, _moved: Any, own: Any) -> Any:
        around = rotation(qpos) @ cross(qvel[3:6], own.gps.place)
        return xp.hstack([point(qpos, own.gps.place), qvel[:3] + around])

    return {
        "imu": imu,
        "mocap": lambda qpos, qvel, act, moved, own: xp.hstack(
            [point(qpos, own.mocap.place), qpos[QW:TILT_1]]
        ),
        "gps": gps,
        "barometer": lambda qpos, qvel, act, moved, own: point(qpos, own.barometer.place)[2:],
        "magnetometer": lambda qpos, qvel, act, moved, own: rotation(qpos).T @ own.field,
        "rotor_speed": lambda _qpos, _qvel, act, *_: xp.array(spins) * act[: len(spins)],
    }


def _turned(each: Instrument, axes: Any, values: Any) -> Any:
    """Vectors of an instrument that has an orientation, multiplied by a matrix."""
    if each.name not in ("imu", "magnetometer"):
        return values
    return xp.hstack([axes @ values[i : i + 3] for i in range(0, len(values), 3)])


def _read(each: Instrument, time: Any, truth: Any, memory: Any, own: Any) -> tuple[Any, Any]:
    """The last reading that arrived, with whether it is new, and the memory after this step."""
    p, size = getattr(own, each.name), len(each.units)
    axes = p.axes.reshape(3, 3)
    truth = _turned(each, axes.T, truth)
    walks = each.errors if each.walks else 0
    walked, line = memory[:walks], memory[walks:-size].reshape(each.under_way + 1, size)
    new = instruments.is_new(p, time, own.control_period)
    newest = reading_index(time, p.period)
    if walks:
        step = p.walk * instruments.draws(p, newest, WALK, each.errors)
        walked = walked + new * step
        truth = truth + walked
    line = xp.where(new > 0.0, xp.vstack([truth, *line[:-1]]), line)
    number, arrived = instruments.arrival(p, time, own.control_period)
    past, kept = newest - number, line[0]
    for place in range(1, each.under_way + 1):
        kept = xp.where(past == float(place), line[place], kept)
    make = instruments.pose_reading if each.name == "mocap" else instruments.reading
    found = _turned(each, axes, make(p, kept, number))
    found = xp.where(arrived > 0.0, found, memory[-size:])
    return xp.hstack([found, arrived]), xp.hstack([walked, line.ravel(), found])


def _parameters(
    plan: FlightPlan, record: Any, loop: ClosedLoop, carried: tuple[Instrument, ...]
) -> Any:
    scenario = plan.scenario
    simulation, tables = scenario.simulation, scenario.sensors.instruments
    rotors, step = scenario.any_rotorcraft.rotor_count, simulation.control_timestep
    magnetometer = scenario.sensors.magnetometer
    own = {}
    for index, each in enumerate(carried):
        table = tables[each.name]
        period, turn = table.period(step), getattr(table, "orientation", (0.0, 0.0, 0.0))
        own[each.name] = instruments.instrument_record(each.errors)(
            float(simulation.seed),
            1000.0 + CHANNELS * index,
            period,
            table.delay,
            table.dropout,
            getattr(table, "position", (0.0, 0.0, 0.0)),
            tuple(rotation_matrix(np.array(turn)).ravel().tolist()),
            *table.errors(1.0 / period, rotors),
        )
    return record(
        motion=read_motion(plan, loop),
        control_period=step,
        disturbance=scenario.disturbance_acceleration,
        field=(0.0, 0.0, 0.0) if magnetometer is None else magnetometer.field,
        **own,
    )


@cache
def motion_record(loop: ClosedLoop) -> Any:
    """The type of the parameters of the angular acceleration."""
    tilts = layout_of(loop).tilts
    return make_record_type(
        "Motion",
        mechanics=mechanics_record(loop.vehicle_record, tilts),
        least_thrust=float,  # (rad/s)^2, limits of the thrusts' controls
        greatest_thrust=float,
        gyroscopic=float,  # factor of this torque, 0 of tilting vehicles on the thesis plant
        pod_inertias=vector_of(tilts),  # kg m^2, about the hinges; 0 of massless pods
        turning=Body,  # the body that turns where pods and the servos' armatures give way
    )


@cache
def plant_acceleration_of(loop: ClosedLoop) -> Callable[..., Any]:
    """The accelerations of a simulated vehicle by all forces but gravity, shape (6,).

    It is ``(qpos, qvel, ctrl, loads, motion) -> acceleration``: MuJoCo's vectors, the loads of air
    and spinning rotors, and a `motion_record`. In body axes, first the acceleration of the center
    of mass (m/s^2), then the angular one (rad/s^2) by Euler's equation with the momentum of the
    pods, ``I omega' + sum J alpha_i'' a_i + omega x (I omega + sum J alpha_i' a_i) = torque``, and
    for each hinge with the servo's armature ``A`` ``(J + A) alpha_i'' + J a_i . omega' = servo
    torque``. Impacts on stops or ground are left out.
    """
    layout, tilted = layout_of(loop), loop.tilt_of_rotor

    @traceable
    def plant_acceleration(qpos: Any, qvel: Any, ctrl: Any, loads: Any, motion: Any) -> Any:
        own, pods = motion.mechanics, motion.pod_inertias
        craft, omega, tilts = craft_of(own.vehicle, tilted), qvel[3:6], qpos[TILT_1:]
        tilt_rates = qvel[TILT_RATE_1 : TILT_RATE_1 + layout.tilts]
        thrusts = xp.clip(ctrl[layout.thrusts], motion.least_thrust, motion.greatest_thrust)
        # The controls are s varpi |varpi| with the spins s, the map's factors are without s.
        turned = wrench_map(craft.rotors, tilts) @ (xp.array(loop.spins) * thrusts)
        wrench = turned + loads[:6]
        momentum = inertia_matrix(craft.body) @ omega + (pods * tilt_rates) @ craft.hinges
        servos = servo_accelerations(craft, ctrl, thrusts, tilts, tilt_rates, loads, own)
        remaining = wrench[3:] - motion.gyroscopic * cross(omega, momentum)
        turning = inverse_inertia_matrix(motion.turning)
        angular = turning @ (remaining - (pods * servos) @ craft.hinges)
        return xp.hstack([wrench[:3] / craft.body.mass, angular])

    return plant_acceleration


def read_motion(plan: FlightPlan, loop: ClosedLoop) -> Any:
    """The `motion_record` of a planned flight."""
    scenario = plan.scenario
    plant, vehicle = scenario.simulation.plant, scenario.any_rotorcraft
    least, greatest = rotor_limits(scenario).thrust_range or (-inf, inf)
    tilts = layout_of(loop).tilts
    hinges = vehicle.hinge_inertias[:tilts]
    pods = vehicle.pod_inertias[:tilts] if plant == "mujoco" else (0.0,) * tilts
    # The share of a pod that its reaction turns; the rest of the hinge is the servo's armature.
    carried = tuple(pod * (pod / hinge) for pod, hinge in zip(pods, hinges, strict=True))
    return motion_record(loop)(
        mechanics=mechanics(plan),
        least_thrust=least,
        greatest_thrust=greatest,
        gyroscopic=scenario.gyroscopic,
        pod_inertias=pods,
        turning=body_less(scenario, carried),
    )


@cache
def with_measured_acceleration(loop: ClosedLoop) -> ClosedLoop:
    """A loop whose controller reads, after MuJoCo's velocities, the angular acceleration.

    It goes around all other layers, whose controls move the plant.
    """
    _, loads = read_actuators(loop)
    plant_acceleration = plant_acceleration_of(loop)

    def sees(within: Any, _time: Any, state: PlantState, own: Any) -> PlantState:
        qpos, qvel, _ = state
        ctrl = within(state._replace(qvel=xp.hstack([qvel, xp.zeros(3)])))
        measured = plant_acceleration(qpos, qvel, ctrl, loads(ctrl), own)[3:]
        return state._replace(qvel=xp.hstack([qvel, measured]))

    layer = Layer(motion_record(loop), lambda plan: read_motion(plan, loop), sees=sees)
    return wrap_loop(loop, layer)
