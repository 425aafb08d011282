"""Closed loops around laws of arrays: baselines, and laws of packages and users.

One loop serves every rotorcraft: its rotors are a table, as in the loops of multirotors, and its
layout is compiled in. The rotors' speeds are states that approach the commanded ones; so are the
tilts of a law that commands them.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache, partial
from os import PathLike
from typing import Any, Final, NamedTuple

from tiltsim.closed_loop.loop import ClosedLoop
from tiltsim.errors import TiltsimError
from tiltsim.laws.law import Law, tilts_in_states, vehicle_of
from tiltsim.laws.layers.actuation import sensor_parameters
from tiltsim.laws.rotor_loop import RotorLayout, margins_of, rotor_loop
from tiltsim.scenario.law_controller import Airframe, LawController, LawTable
from tiltsim.scenario.loading import load_scenario
from tiltsim.scenario.scenario import FlightPlan, Scenario, plan_flight
from tiltsim.system.text import short_repr
from tiltsim.vehicles.rotorcraft import initial_rotor_speeds, initial_tilts
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.code.tracing import as_array
from tiltsim_controllers.gaits.motion import GaitParameters, planned_tilts
from tiltsim_controllers.laws.observed import ROTOR_COMMANDS, Command, Desired, Observed, Seen, Step
from tiltsim_controllers.mathematics.attitude import rotation_matrix
from tiltsim_controllers.mathematics.records import make_record_type
from tiltsim_controllers.mathematics.scalar import Values
from tiltsim_controllers.references.trajectories import (
    ReferenceParameters,
    reference_attitude,
    reference_motion,
)
from tiltsim_controllers.vehicle.actuators import held_gain
from tiltsim_controllers.vehicle.body import Body, inertia_matrix, state_of
from tiltsim_controllers.vehicle.cross import speed_along_spin
from tiltsim_controllers.vehicle.parameters import Vehicle
from tiltsim_controllers.vehicle.rotors import ROTOR_FLOATS, rotors_in, table_per_newton, wrench_map

_NO_CROSS: Final = Vehicle(*(0.0,) * len(Vehicle._fields))

CORRECTION: Final = 5.0
"""1/s: the rate at which rotors approach the speeds of their model, slow beside any latency."""


REMEDY: Final = "write tiltsim.xp for functions of arrays, xp.where for an if"


class LawError(TiltsimError):
    """A law returned an invalid command."""


class FlownLaw(NamedTuple):
    """A law of arrays, with all that its loop is compiled for."""

    layout: RotorLayout
    function: Callable[..., Command]  # ``(observed, parameters) -> command``
    parameters: type[tuple[Any, ...]]
    states: tuple[tuple[str, str], ...]  # with their units
    discrete: tuple[tuple[str, str], ...]  # likewise, discrete ones
    tilts: bool  # whether the law commands the tilts
    models_rotors: bool  # whether the rotors follow a model of theirs, as they do with latency
    models_latency: bool = False  # whether the law knows its commands on their way
    feels: bool = False  # whether there are objects or a load
    traced: bool = True  # see `ClosedLoop.traced`

    @property
    def commanded(self) -> slice:
        """Its states that are commanded tilts, behind its own and the discrete ones."""
        first = len(self.states) + len(self.discrete)
        return slice(first, first + self.layout.places.tilts * self.tilts)


NO_PARAMETERS: Final = make_record_type("NoParameters", none=float)(0.0)
"""For laws without parameters."""

Find = Callable[[FlightPlan], LawController | None]
"""The table of a flight's law with its numbers; None for a function without any."""


@cache
def record_of(parameters: type[tuple[Any, ...]]) -> Any:
    """The type of the parameters of every law's loop, with the law's own."""
    return make_record_type(
        "Known",
        gait=GaitParameters,
        reference=ReferenceParameters,
        vehicle=Body,
        cross=Vehicle,  # zeros for a multirotor
        gyroscopic=float,  # 1 where the plant has gyroscopic torque, else 0
        rotors=float,  # index in the knots of the table of rotors, then per newton, then K_f
        rotor_gain=float,  # 1/s, of the rotor speeds' errors
        tilt_gain=float,  # 1/s, of the errors of tilts that the law commands
        control_period=float,  # s, between samples; 0: continuous
        own=parameters,
    )


def _vector(command: Command, name: str, size: int) -> Any:
    """A vector of a command; none is of size 0. Raises `LawError` for another shape."""
    value = getattr(command, name)
    if value is None and size == 0:
        return xp.zeros(0)
    try:
        array = as_array(value) if hasattr(value, "shape") else xp.array(value)
    except (TypeError, ValueError):
        text = f"returned {name} = {short_repr(value)}; expected {size} numbers"
        raise LawError(text) from None
    if array.shape != (size,):
        raise LawError(f"returned {name} of shape {array.shape}; expected shape ({size},)")
    return array


def _step_of(flown: FlownLaw) -> Callable[..., Step]:
    """The function of `Law.step`.

    The states are the law's own, discrete ones last, the commanded tilts where it commands them,
    and the rotor speeds of their model where they have one.
    """
    rotors, tilts = flown.layout.places
    own, layout, commanded = len(flown.states), flown.layout.tilt_of_rotor, flown.commanded
    per_newton, coefficients = ROTOR_FLOATS * rotors, 2 * ROTOR_FLOATS * rotors
    is_cross = flown.layout.cross != ""

    def step(seen: Seen, known: Any, knots: Any) -> Step:
        # An array that outlives a trace would keep its precision in the next one of JAX.
        spins, time, states = xp.array(flown.layout.spins), seen.time, seen.states
        at, now = int(known.rotors), state_of(seen.state, layout)
        motion = reference_motion(time, known.reference, knots)
        moved = motion[:3] + seen.shift if flown.feels else motion[:3]
        attitude = reference_attitude(time, known.reference, knots)
        planned = planned_tilts(time, known.gait, knots, tilts)
        turning = spins * now.speeds
        k = xp.array(knots[at + coefficients : at + coefficients + rotors])
        pushing = rotors_in(knots, at + per_newton, layout)
        wrench = wrench_map(pushing, now.tilts)
        observed = Observed(
            time=time,
            position=now.position,
            velocity=now.velocity,
            attitude=now.attitude,
            rotation=rotation_matrix(now.attitude),
            body_rates=now.omega,
            tilt_angles=now.tilts,
            tilt_rates=seen.tilt_rates,
            rotor_speeds=turning,
            thrusts=k * turning * abs(turning),
            states=states[:own],
            discrete=states[own : commanded.start],
            reference=Desired(
                *moved,  # type: ignore[call-arg]
                motion[3],
                attitude[0],
                *planned[:, :2].T,
                *attitude[1:3],
            ),
            vehicle=known.cross if is_cross else known.vehicle,
            inertia=inertia_matrix(known.vehicle),
            gyroscopic=known.gyroscopic,
            force=wrench[:3],
            torque=wrench[3:],
            rotors=pushing,
            table=knots[at + coefficients + rotors :],
            tilt_commands=states[commanded],
            contact_force=xp.array(seen.contact_force),
            swing=xp.array(seen.swing),
            readings=seen.readings,
        )
        command = flown.function(observed, known.own)
        reached = states[len(states) - rotors :] if flown.models_rotors else turning
        along = _accelerations(command, known.rotor_gain, k, reached)
        rates, moving = _state_rates(flown, command, states, known)
        if not flown.models_rotors:
            return Step(spins * along, xp.hstack([rates, moving]))
        following = spins * (along + CORRECTION * (reached - turning))
        return Step(following, xp.hstack([rates, moving, along]))

    return step


def _accelerations(command: Command, gain: Any, k: Any, speeds: Any) -> Any:
    """Rotor accelerations (rad/s^2) along the spins, toward the speeds that a command gives.

    The gain of the speed errors is in 1/s, ``k`` in N s^2, speeds in rad/s, shape (N,).
    """
    if not isinstance(command, Command):
        raise LawError(
            f"returned {short_repr(command)}; expected a tiltsim.Command, as in "
            "tiltsim.Command(thrusts=...)"
        )
    given = [name for name in ROTOR_COMMANDS if getattr(command, name) is not None]
    if len(given) != 1:
        what = " and ".join(given) if given else "nothing for the rotors"
        raise LawError(f"returned {what}; expected one of {', '.join(ROTOR_COMMANDS)}")
    values = _vector(command, given[0], len(k))
    if given[0] == "rotor_accelerations":
        return values
    return gain * ((speed_along_spin(values / k) if given[0] == "thrusts" else values) - speeds)


def _state_rates(flown: FlownLaw, command: Command, states: Any, known: Any) -> tuple[Any, Any]:
    """Rates of the law's states, and of the tilts where it commands them."""
    own, commanded = len(flown.states), flown.commanded
    if not flown.tilts and command.tilt_angles is not None:
        raise LawError("returned tilt_angles; needs controller.tilts = free")
    rates, moving = _vector(command, "rates", own), xp.zeros(0)
    if flown.discrete:
        # Held for a period, these rates carry the states to their next values.
        before = states[own : commanded.start]
        change = _vector(command, "discrete", len(before)) - before
        rates = xp.hstack([rates, change / known.control_period])
    elif command.discrete is not None:
        raise LawError("returned discrete; name these states in controller.discrete_states")
    if flown.tilts:
        before = states[commanded]
        moving = known.tilt_gain * (_vector(command, "tilt_angles", len(before)) - before)
    return rates, moving


def _own(find: Find, plan: FlightPlan) -> dict[str, Any]:
    """`Law.own` of a law that is found for each flight."""
    airframe, table, controller = airframe_of(plan), find(plan), plan.scenario.controller
    assert isinstance(controller, LawTable)
    step, vehicle = airframe.control_timestep, vehicle_of(plan)
    return {
        "vehicle": airframe.vehicle.body,
        "cross": vehicle if isinstance(vehicle, Vehicle) else _NO_CROSS,
        "gyroscopic": airframe.gyroscopic,
        "rotor_gain": held_gain(controller.rotor_bandwidth, step),
        "tilt_gain": held_gain(controller.tilt_rate_gain, step),
        "control_period": step,
        "own": table.law_parameters(airframe) if table else NO_PARAMETERS,
    }


def _tables(find: Find, plan: FlightPlan) -> Values:
    """`Law.tables`: of the rotors, of these per newton, their coefficients, and the law's own."""
    airframe, table = airframe_of(plan), find(plan)
    rotors, coefficients = airframe.vehicle.table, airframe.vehicle.thrust_coefficients
    own = table.law_table(airframe) if table else ()
    return (*rotors, *table_per_newton(rotors, coefficients), *coefficients, *own)


def _initial(flown: FlownLaw, find: Find, plan: FlightPlan) -> Values:
    """`Law.initial`: of the law, of the tilts that it commands, of a model of the rotors."""
    airframe, table = airframe_of(plan), find(plan)
    own = table.initial_states(airframe) if table else (0.0,) * flown.commanded.start
    tilts = airframe.initial_tilts if flown.tilts else ()
    return (*own, *tilts, *(airframe.initial_speeds if flown.models_rotors else ()))


@cache
def law_loop(flown: FlownLaw, find: Find) -> ClosedLoop:
    """The closed loop of a law, for which a function finds the numbers of each flight."""
    shown, first = flown.layout.shown, flown.commanded.start
    commands = shown.names("tilt_command") if flown.tilts else ()
    modelled = shown.names("modelled_rotor_speed") if flown.models_rotors else ()
    law = Law(
        _step_of(flown),
        record_of(flown.parameters),
        partial(_own, find),
        partial(_tables, find),
        states={
            **dict(flown.states),
            **dict(flown.discrete),
            **dict.fromkeys(commands, "rad"),
            **dict.fromkeys(modelled, "rad/s"),
        },
        initial=partial(_initial, flown, find),
        margins=margins_of(flown.layout),
        tilts=tilts_in_states(first, flown.layout.places.tilts) if flown.tilts else None,
        uses_gait=not flown.tilts,
        feels=flown.feels,
        follows_position=lambda scenario: scenario.reference.kind != "attitude_altitude",
    )
    late = flown._replace(models_rotors=True)
    knows_latency = flown.models_rotors or flown.models_latency
    return replace(
        rotor_loop(flown.layout, law),
        with_latency=None if knows_latency else partial(law_loop, late, find),
        traced=flown.traced,
    )


def airframe(scenario: Scenario | str | PathLike[str] | Mapping[str, Any]) -> Airframe:
    """Facts that the controller of a scenario may use, as methods of a `LawController` take them.

    Args:
        scenario: Anything that `tiltsim.load_scenario` takes, of a rotorcraft.

    Raises:
        InputError: If it is not valid, or its vehicle is no rotorcraft.
    """
    loaded = load_scenario(scenario)
    loaded.require_rotorcraft("airframe")
    return airframe_of(plan_flight(loaded))


def airframe_of(plan: FlightPlan) -> Airframe:
    """The airframe of a planned flight."""
    scenario, simulation = plan.scenario, plan.scenario.simulation
    table = scenario.any_rotorcraft
    speeds, sensors = initial_rotor_speeds(plan), sensor_parameters(scenario)
    root = max(sensors.period, simulation.control_timestep) ** 0.5
    return Airframe(
        table.multirotor,
        plan.gait,
        initial_tilts(plan)[0] if table.has_tilting_rotors else (),
        tuple(spin * speed for spin, speed in zip(table.spins, speeds, strict=True)),
        scenario.initial.position,
        scenario.initial.velocity,
        scenario.initial.attitude,
        scenario.initial.angular_velocity,
        scenario.gyroscopic,
        simulation.timestep,
        simulation.control_timestep,
        simulation.latency_steps,
        table.speeds_along_spin,
        table.rotor_time_constant,
        table.tilt_servo,
        scenario.reference,
        (sensors.velocity.noise * root, sensors.body_rates.noise * root),
    )
