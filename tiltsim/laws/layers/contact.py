"""Objects around the loop: their columns, and laws that push them or damp the swing of a load.

The force of a step is a reading of a sensor that MuJoCo keeps in its state. Functions of the loop
see objects' coordinates and readings behind ``act``, and the laws within see `Felt` in their place.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from math import sqrt
from typing import Any, Final, NamedTuple

import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup
from tiltsim.laws.layers.layer import Layer, PlantState, Samples, wrap_loop
from tiltsim.models.cables import CABLE_READING
from tiltsim.models.objects import COORDINATES, FORCE
from tiltsim.models.parts import ExtraActuators
from tiltsim.scenario.scenario import FlightPlan, Scenario
from tiltsim.vehicles.rotorcraft.others import CONTACT_FORCE, FELT, SWING, Others
from tiltsim_controllers.code.arrays import traceable, xp
from tiltsim_controllers.mathematics.attitude import (
    euler_angles,
    rotation_matrix,
    rotation_of_quaternion,
)
from tiltsim_controllers.mathematics.records import Vector3
from tiltsim_controllers.mathematics.scalar import Floats, Values
from tiltsim_controllers.references.trajectories import ReferenceParameters, reference_motion

FILTER: Final = 60.0  # rad/s, bandwidth in which laws see the contact force and a swing

PUSH_COLUMNS: Final = ("push_force", "push_force_ref")
"""The force along the direction of a push, and its command, N."""


class Push(NamedTuple):
    """A force that grows once the tool touches; by default there is none."""

    direction: Vector3 = (0.0, 0.0, 0.0)  # unit vector, world
    force: float = 0.0  # N
    begin: float = 0.0  # s, when the tool touches
    ramp: float = 1.0  # s, from there to the full force


class Among(NamedTuple):
    """Parameters of a loop among objects."""

    timestep: float  # s
    push: Push
    attachment: Vector3  # m, body axes, of a cable


class ForceLoop(NamedTuple):
    """Parameters of a loop of force."""

    push: Push
    gain: float  # 1/s
    proportional: float
    stiffness: float  # N/m, of the law within against an error of position


class Impedance(NamedTuple):
    """Parameters of a loop that gives the contact an impedance."""

    push: Push
    mass: float  # kg
    damping: float  # N s/m
    stiffness: float  # N/m
    ahead: float  # m/N, of the reference for the commanded force


@traceable
def commanded_force(time: Any, push: Push) -> Any:
    """The force (N) along the direction of a push at a time (s), shape ()."""
    return push.force * xp.clip((time - push.begin) / push.ramp, 0.0, 1.0)


@cache
def with_force_loop(loop: ClosedLoop) -> ClosedLoop:
    """A law of position in a loop of force: it sees the vehicle behind its place.

    Where an object stops the vehicle, a law that feeds back position pushes with its stiffness
    times the error. So an error that follows the force makes any force: the commanded one, plus the
    filtered error of the force times a gain, plus its integral. Before the touch there is neither
    force nor error, and the law flies as it is.
    """
    first = loop.sizes.act

    def controls(within: Any, time: Any, state: PlantState, own: Any, knots: Any) -> Any:
        qpos, _, act = state
        direction, commanded = xp.array(own.push.direction), commanded_force(time, own.push)
        filtered, integral = act[first], act[first + 1]
        error = commanded - filtered
        force = commanded + own.proportional * error + integral
        place = qpos[:3] - force / own.stiffness * direction
        measured = act[FELT.push_force] @ direction
        rates = xp.hstack([FILTER * (measured - filtered), own.gain * error])
        return xp.hstack([within(state._replace(qpos=xp.hstack([place, qpos[3:]]))), rates])

    layer = Layer(
        ForceLoop,
        _force_loop,
        controls=controls,
        fields={"filtered_push_force": "N", "push_integral": "N"},
        of_controller=True,
    )
    return wrap_loop(loop, layer)


@cache
def with_impedance(loop: ClosedLoop) -> ClosedLoop:
    """A law of position whose reference gives way to the error of the force along a push.

    The reference is ahead by a shift s with ``mass s'' + damping s' + stiffness s = error``, and by
    the way that a soft law needs for the commanded force.
    """
    first = loop.sizes.act

    def controls(within: Any, time: Any, state: PlantState, own: Any, knots: Any) -> Any:
        qpos, qvel, act = state
        direction, commanded = xp.array(own.push.direction), commanded_force(time, own.push)
        filtered, shift, speed = act[first], act[first + 1], act[first + 2]
        along = shift + own.ahead * commanded
        place = xp.hstack([qpos[:3] - along * direction, qpos[3:]])
        moving = xp.hstack([qvel[:3] - speed * direction, qvel[3:]])
        force = commanded - filtered - own.damping * speed - own.stiffness * shift
        following = FILTER * (act[FELT.push_force] @ direction - filtered)
        ctrl = within(PlantState(place, moving, act))
        return xp.hstack([ctrl, following, speed, force / own.mass])

    layer = Layer(
        Impedance,
        _impedance,
        controls=controls,
        fields={"filtered_push_force": "N", "push_shift": "m", "push_shift_rate": "m/s"},
        of_controller=True,
    )
    return wrap_loop(loop, layer)


def _impedance(plan: FlightPlan) -> Impedance:
    """A law that is soft itself is in series with the shift, which has to be stiffer for it."""
    table: Any = plan.scenario.reference
    own, softness = table.impedance, table.softness(plan.scenario)
    stiffness = own.stiffness / (1.0 - own.stiffness * softness)
    return Impedance(push_of(plan.scenario), own.mass, own.damping, stiffness, softness)


def push_of(scenario: Scenario) -> Push:
    """The push of a scenario's reference."""
    reference: Any = scenario.reference
    if reference.type != "push":
        return Push()
    touch = reference.touch(scenario)
    return Push(touch.direction, reference.force, touch.time, reference.ramp)


def _force_loop(plan: FlightPlan) -> ForceLoop:
    scenario = plan.scenario
    reference: Any = scenario.reference
    stiffness = scenario.controller.position_stiffness
    assert stiffness is not None  # else the scenario is refused
    mass = scenario.any_rotorcraft.resolve().mass
    gains = reference.gain, reference.proportional_gain
    return ForceLoop(push_of(scenario), *gains, mass * stiffness)


@cache
def with_objects(loop: ClosedLoop, others: Others) -> ClosedLoop:
    """A loop among objects; it goes around all other layers."""
    size, ctrl_size = loop.sizes.act, loop.sizes.ctrl
    states = 2 * len(others.vehicles) * bool(others.names)
    readings = size + states + others.coordinates
    accumulated, observed = _accumulated(others, size, readings), _observed(others, size, readings)
    felt = felt_among(others)

    def act_seen(qpos: Any, act: Any, own: Among) -> Any:
        return xp.hstack([act[:size], felt(qpos, act, own.attachment)])

    def sees(_within: Any, _time: Any, state: PlantState, own: Among) -> PlantState:
        return state._replace(act=act_seen(state.qpos, state.act, own))

    def adds(_time: Any, _qpos: Any, _qvel: Any, act: Any, _ctrl: Any, own: Among) -> Any:
        return accumulated(act, own)

    def hold(within: Any, time: Any, qpos: Any, act: Any, ctrl: Any, own: Any) -> Any:
        return xp.hstack([within(act_seen(qpos, act, own)), accumulated(act, own)])

    @traceable
    def observe(qpos: Any, qvel: Any, act: Any, ctrl: Any) -> Any:
        return xp.hstack([loop.observe(qpos, qvel, act[:size], ctrl[:ctrl_size]), observed(act)])

    layer = Layer(
        Among,
        _among,
        sees=sees,
        adds=adds,
        hold=hold,
        actuators=ExtraActuators(states=states),
        units={
            **others.columns,
            **(dict.fromkeys(PUSH_COLUMNS, "N") if others.pushed >= 0 else {}),
            **(dict.fromkeys(SWING, "rad") if others.hangs else {}),
        },
        derive=partial(_derive, others),
    )
    wrapped = wrap_loop(loop, layer)
    sizes = wrapped.sizes._replace(others=others.coordinates, history=others.readings)
    fields = (*loop.fields, *others.columns)
    return replace(wrapped, sizes=sizes, observe=observe, fields=fields)


def _among(plan: FlightPlan) -> Among:
    scenario, load = plan.scenario, plan.scenario.payload
    attachment = (0.0, 0.0, 0.0) if load is None else load.attachment
    return Among(scenario.simulation.timestep, push_of(scenario), attachment)


def _derive(others: Others, samples: Samples, setup: ControlSetup) -> dict[str, Floats]:
    columns: dict[str, Floats] = {}
    own = setup.parameters.layer
    if others.pushed >= 0:
        along = zip(CONTACT_FORCE, own.push.direction, strict=True)
        columns |= {
            "push_force": sum(samples[name] * component for name, component in along),
            "push_force_ref": commanded_force(samples["time"], own.push),
        }
    if others.hangs:
        turn, place, load = (
            np.array([samples[f"{before}{name}"] for name in names])
            for before, names in (("", ("roll", "pitch", "yaw")), ("", "xyz"), ("payload_", "xyz"))
        )
        arm = np.einsum("ij...,j->i...", rotation_matrix(turn), own.attachment)
        columns |= zip(SWING, swing(load - place - arm), strict=True)
    return columns


def swing(hanging: Any) -> Any:
    """Angles (rad), shape (2, ...), of a cable from straight down toward +x and +y.

    ``hanging`` leads from its attachment to the load, m, world axes, shape (3, ...).
    """
    return xp.array([xp.arctan2(hanging[0], -hanging[2]), xp.arctan2(hanging[1], -hanging[2])])


@cache
def felt_among(others: Others) -> Callable[..., Values]:
    """A function ``(qpos, act, attachment)`` of `Felt`, in this order; zeros of absent things.

    Its ``act`` is as `with_objects` has it, ``attachment`` the beginning of the cable, body axes.
    """

    @traceable
    def felt(qpos: Any, act: Any, attachment: Any) -> Any:
        first = len(act) - others.readings
        readings, total, pushed, angles = act[first:], xp.zeros(3), xp.zeros(3), xp.zeros(2)
        if others.names:
            total = _total(readings, others)
        if others.pushed >= 0:
            pushed = readings[others.force_places(others.pushed)]
        if others.hangs:
            load = act[first - COORDINATES["free"] : first][:3]
            arm = rotation_of_quaternion(qpos[3:7]) @ xp.array(attachment)
            angles = swing(load - qpos[:3] - arm)
        return xp.hstack([total, pushed, angles, xp.zeros(6)])

    return felt


def _total(readings: Any, others: Others, vehicle: int = 0) -> Any:
    """The force (N, world) of a vehicle on all objects, shape (3,)."""
    return sum(readings[others.force_places(index, vehicle)] for index in range(len(others.names)))


def _accumulated(others: Others, size: int, readings: int) -> Callable[..., Values]:
    """A function ``(act, own)`` of rates of each vehicle's largest force and time in contact."""

    @traceable
    def accumulated(act: Any, own: Among) -> Any:
        rates = []
        for vehicle in range(len(others.vehicles) if others.names else 0):
            force, peak = _total(act[readings:], others, vehicle), act[size + 2 * vehicle]
            magnitude = xp.sqrt(force @ force)
            rise = (xp.maximum(magnitude, peak) - peak) / own.timestep
            rates += [rise, xp.where(magnitude > 0.0, 1.0, 0.0)]
        return xp.array(rates) if rates else act[:0]

    return accumulated


def _observed(others: Others, size: int, readings: int) -> Callable[..., Values]:
    """A function ``(act)`` of the columns of `Others`."""

    @traceable
    def observed(act: Any) -> Any:
        parts, at = [], readings - others.coordinates
        for vehicle in range(len(others.vehicles) if others.names else 0):
            kept = size + 2 * vehicle
            parts += [_total(act[readings:], others, vehicle), act[kept : kept + 2]]
        for joint in others.joints:
            pose = act[at : at + COORDINATES[joint]]
            if joint == "free":
                pose = xp.hstack([pose[:3], euler_angles(pose[3:])])
            parts, at = [*parts, pose], at + COORDINATES[joint]
        tension = readings + others.contact_readings + FORCE
        tensions = act[tension::CABLE_READING]  # of the load's cable first
        parts += [act[at : at + 3]] if others.hangs else []
        parts += [tensions] if others.hangs or others.cables else []
        return xp.hstack(parts) if parts else act[:0]

    return observed


# --- a law that damps the swing of a load ------------------------------------------------------

SHIFTS: Final = ("swing_shift_x", "swing_shift_y")
"""How far the vehicle goes after its load, away from its reference, m."""

FILTERED_SWING: Final = ("filtered_swing_x", "filtered_swing_y")

RETURN: Final = 0.25  # rate at which it comes back, over the frequency of the swing


class SwingDamping(NamedTuple):
    """Parameters of the layer."""

    reference: ReferenceParameters
    length: float  # m, of the cable
    gravity: float  # m/s^2
    gain: float  # 1/s, from the load's displacement to the speed of the shift
    decay: float  # 1/s, of the shift


def shift_gains(frequency: float, damping: float) -> tuple[float, float]:
    """Gain and decay (1/s) of a shift that gives a pendulum a damping ratio.

    A load at the displacement s from below a place that shifts by d obeys ``s'' = -w^2 s - d''``.
    With ``d' = gain s - decay d`` its poles are a pair of the damping ratio, of the frequency v,
    and a real one at ``RETURN v``.

    Args:
        frequency: w of the pendulum, rad/s.
        damping: Its damping ratio to be.
    """
    slower = frequency / sqrt(1.0 + 2.0 * damping * RETURN)
    decay = RETURN * slower**3 / frequency**2
    return slower * (RETURN + 2.0 * damping) - decay, decay


def _swing_damping(plan: FlightPlan) -> SwingDamping:
    load, gravity = plan.scenario.payload, plan.scenario.any_rotorcraft.resolve().gravity
    assert load is not None  # else there is no such layer
    gains = shift_gains(sqrt(gravity / load.length), load.swing_damping)
    return SwingDamping(plan.reference, load.length, gravity, *gains)


@cache
def with_swing_damping(loop: ClosedLoop) -> ClosedLoop:
    """A law of position whose reference goes after the swinging load.

    Only the part of the swing counts that the reference's own acceleration does not explain: a load
    hangs back by that acceleration over gravity's. A law that does not read `Felt` sees the vehicle
    displaced in place of its reference.
    """
    sizes, first = loop.sizes, loop.sizes.act

    def controls(within: Any, time: Any, state: PlantState, own: Any, knots: Any) -> Any:
        qpos, qvel, act = state
        shift, filtered = act[first : first + 2], act[first + 2 : first + 4]
        hanging_back = reference_motion(time, own.reference, knots)[2][:2] / own.gravity
        displacement = own.length * (act[FELT.swing] + hanging_back)
        following = FILTER * (displacement - filtered)
        rate = own.gain * filtered - own.decay * shift
        if sizes.history:
            seen = xp.hstack([act[:-6], shift, rate, own.gain * following - own.decay * rate])
        else:
            seen = act
            qpos = xp.hstack([qpos[:2] - shift, qpos[2:]])
            qvel = xp.hstack([qvel[:2] - rate, qvel[2:]])
        return xp.hstack([within(PlantState(qpos, qvel, seen)), rate, following])

    layer = Layer(
        SwingDamping,
        _swing_damping,
        controls=controls,
        fields=dict.fromkeys((*SHIFTS, *FILTERED_SWING), "m"),
        of_controller=True,
    )
    return wrap_loop(loop, layer)
