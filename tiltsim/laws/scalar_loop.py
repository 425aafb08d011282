"""Closed loops around scalar laws that command thrusts: baselines and those of packages.

One loop serves every rotorcraft: its rotors are a table, as those of multirotors, and its layout is
compiled in. The rotors' speeds are states that approach the commanded ones; so are the tilts of a
law that commands them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from math import sqrt
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.closed_loop.loop import (
    ClosedLoop,
    Columns,
    ControlSetup,
    Dynamics,
    Equations,
    Sampling,
)
from tiltsim.equations.tiltrotor import body_fields, initial_state
from tiltsim.laws.airframe import airframe_of, initial_states
from tiltsim.laws.rotorcraft import (
    body_state,
    held_controls_of,
    servo_commands_of,
    thrust_controls_of,
    torque_free_columns,
)
from tiltsim.laws.scalar_parameters import Key, Known, record_of
from tiltsim.laws.tiltrotor import REFERENCE_COLUMNS, reference_columns, servo_lead
from tiltsim.scenario.scalar_controller import ScalarController
from tiltsim.vehicles.rotorcraft import initial_rotor_speeds, rotorcraft_kind
from tiltsim.vehicles.rotorcraft.layout import CROSS, TILT_1, TILT_RATE_1
from tiltsim_controllers.gaits.any_tilts import tilt_motion_of
from tiltsim_controllers.laws.observed import Desired, Observed
from tiltsim_controllers.mathematics.rotation import rotation_from_euler
from tiltsim_controllers.mathematics.scalar import Floats, Triple, Values, Vector, scalar
from tiltsim_controllers.mathematics.vectors import componentwise, entries_of, vectors_of
from tiltsim_controllers.references.trajectories import reference_derivatives
from tiltsim_controllers.vehicle.actuators import held_gain
from tiltsim_controllers.vehicle.effectiveness import (
    ROTOR_FLOATS,
    effectiveness_of,
    table_per_newton,
)
from tiltsim_controllers.vehicle.multirotor import BODY_STATES, body_of, equations_of_motion_of

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan


CORRECTION: Final = 5.0
"""1/s: the rate at which rotor speeds approach those of their model, slow beside any latency."""


@scalar
def signed_root(value: float) -> float:
    """The number whose product with its own size is the value."""
    return sqrt(value) if value >= 0.0 else -sqrt(-value)


@cache
def _inputs_of(key: Key) -> Callable[..., Values]:
    """Scalar code ``(time, body, tilts, tilt_rates, speeds, states, parameters, knots)``.

    Returns rotor accelerations, rates of the law's states, tilt rates where it commands them; the
    ``states`` end with the commanded tilts there.
    """
    rotors, tilts = key.layout.places
    own, law, free, spins = len(key.states), key.law, key.tilts, key.layout.spins
    functions = effectiveness_of(key.layout.tilt_of_rotor)
    cosines, sines, rows_of = functions.cosines, functions.sines, functions.rows
    planned = tilt_motion_of(tilts).planned
    angles_of = componentwise("angles_of_jets", "jets", "jets#[0]", tilts)
    rates_of = componentwise("rates_of_jets", "jets", "jets#[1]", tilts)
    coefficients_in = componentwise("coefficients", "knots, at", "knots[at + @]", rotors)
    pushes = componentwise("pushes", "k, speeds", "k# * speeds# * abs(speeds#)", rotors)
    product = vectors_of(rotors).product
    accelerations = componentwise(
        "accelerations",
        "gain, thrusts, k, speeds, spins",
        "gain * spins# * (root(thrusts# / k#) - speeds#)",
        rotors,
        root=signed_root,
    )
    states_in, commanded = entries_of(0, own), entries_of(own, tilts)
    modelled_in = entries_of(own + tilts * free, rotors)
    models_rotors, correction = key.models_rotors, CORRECTION
    corrected = componentwise(
        "corrected",
        "rates, spins, f, modelled, speeds",
        "rates# + f * spins# * (modelled# - speeds#)",
        rotors,
    )
    tilt_rates_for = componentwise(
        "tilt_rates_for", "gain, angles, commanded", "gain * (angles# - commanded#)", tilts
    )
    per_newton, coefficients = ROTOR_FLOATS * rotors, 2 * ROTOR_FLOATS * rotors
    own_table = coefficients + rotors

    @scalar
    def inputs(
        time: float,
        body: Values,
        tilts: Values,
        tilt_rates: Values,
        speeds: Values,
        states: Values,
        parameters: Any,
        knots: Vector,
    ) -> Values:
        x, y, z, vx, vy, vz, roll, pitch, yaw, p, q, r = body
        known = parameters.law
        at, reference, jets = int(known.rotors), known.reference, planned(time, known.gait, knots)
        fx, fy, fz, tx, ty, tz = rows_of(1.0, cosines(tilts), sines(tilts), knots, at + per_newton)
        px, py, pz, ux, uy, uz, ax, ay, az, jx, jy, jz, _, _, _ = reference_derivatives(
            time, reference, knots
        )
        turning, k = product(spins, speeds), coefficients_in(knots, at + coefficients)
        # Built where it is used: native code cannot return records.
        observed = Observed(
            time,
            (x, y, z),
            (vx, vy, vz),
            (roll, pitch, yaw),
            rotation_from_euler(roll, pitch, yaw),
            (p, q, r),
            tilts,
            tilt_rates,
            turning,
            pushes(k, turning),
            states_in(states),
            Desired(
                (px, py, pz),
                (ux, uy, uz),
                (ax, ay, az),
                (jx, jy, jz),
                (reference.roll, reference.pitch, reference.yaw),
                angles_of(jets),
                rates_of(jets),
            ),
            known.vehicle,
            (fx, fy, fz),
            (tx, ty, tz),
            knots,
            at + per_newton,
            at + own_table,
        )
        thrusts, angles, rates = law(observed, parameters.own)
        reached = modelled_in(states) if models_rotors else turning
        demanded = accelerations(known.rotor_gain, thrusts, k, reached, spins)
        # Angles beside a gait are controls that no vehicle has: refused before the flight.
        moving = tilt_rates_for(known.tilt_gain, angles, commanded(states)) if free else angles
        if models_rotors:
            following = corrected(demanded, spins, correction, reached, turning)
            return (*following, *rates, *moving, *product(spins, demanded))
        return (*demanded, *rates, *moving)

    return inputs


def _sampling(key: Key) -> Sampling:
    """The control step in MuJoCo."""
    free, own = key.tilts, len(key.states)
    rotors, tilts = key.layout.places
    further = key.further_states
    tilts_in, tilt_rates_in = entries_of(TILT_1, tilts), entries_of(TILT_RATE_1, tilts)
    speeds_in, states_in = entries_of(0, rotors), entries_of(rotors, further)
    commanded = entries_of(rotors + own, tilts)  # of activations, and their rates of the inputs
    thrusts, servo_commands = thrust_controls_of(key.layout.spins), servo_commands_of(tilts)
    led = componentwise("led", "angles, rates, lead", "angles# + lead * rates#", tilts)
    inputs = _inputs_of(key)

    @scalar
    def controls(
        time: float, qpos: Vector, qvel: Vector, act: Vector, parameters: Any, knots: Vector
    ) -> Values:
        body, tilts, moving = body_state(qpos, qvel), tilts_in(qpos), tilt_rates_in(qvel)
        speeds, states = speeds_in(act), states_in(act)
        rates = inputs(time, body, tilts, moving, speeds, states, parameters, knots)
        lead = parameters.servo_lead
        if free:
            servos = led(commanded(act), commanded(rates), lead)
        else:
            servos = servo_commands(time, lead, parameters.law.gait, knots)
        return (*servos, *thrusts(act), *rates)

    return Sampling(controls, held_controls_of(key.layout.spins, tilts))


def _idle(key: Key) -> Values:
    """Tilts that a sample of the quadrotor has, and it has not."""
    return (0.0,) * (CROSS.tilts if key.model == "quadrotor" else 0)


def _columns(key: Key) -> Columns:
    """Samples of flights, and the columns of references and margin."""
    rotors, tilts = key.layout.places
    idle = _idle(key)
    tilts_in, tilt_rates_in = entries_of(TILT_1, tilts), entries_of(TILT_RATE_1, tilts)
    speeds_in, states_in = entries_of(0, rotors), entries_of(rotors, key.further_states)
    planned = tilt_motion_of(tilts).planned
    angles = componentwise("angles_of_jets", "jets", "jets#[0]", tilts)
    shown = CROSS if idle else key.layout.places
    commands = shown.names("tilt_command") if key.tilts else ()
    modelled = shown.names("modelled_rotor_speed") if key.models_rotors else ()
    units = {
        **dict(key.states),
        **dict.fromkeys(commands, "rad"),
        **dict.fromkeys(modelled, "rad/s"),
    }
    columns = (*REFERENCE_COLUMNS, *shown.names("alpha_ref"))
    fields = (*shown.observed_fields, *units)

    @scalar
    def observe(qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector) -> Values:
        seen = (*body_state(qpos, qvel), *tilts_in(qpos), *idle, *speeds_in(act))
        return (*seen, *tilt_rates_in(qvel), *idle, *states_in(act))

    @scalar
    def asked(time: float, values: Vector, parameters: Any, knots: Vector) -> Values:
        known = parameters.law
        reference = known.reference
        motion = reference_derivatives(time, reference, knots)
        jets = planned(time, known.gait, knots)
        return (
            *(motion[0], motion[1], motion[2], reference.roll, reference.pitch, reference.yaw),
            *angles(jets),
            *idle,
        )

    def derive(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
        found = reference_columns(asked, fields, samples, setup, columns)
        commanded = zip(shown.names("alpha_ref"), commands, strict=False)
        first = int(setup.parameters.law.rotors)
        table = setup.knots[first : first + ROTOR_FLOATS * rotors]
        return {
            **found,
            **{column: samples[name] for column, name in commanded},
            **torque_free_columns(key.layout.places, table, samples),
        }

    return Columns(observe, derive, fields=tuple(units), units=units)


def _equations(key: Key) -> Equations:
    """The law on the equations of motion, with pods that follow their commands exactly."""
    rotors, tilts = key.layout.places
    own, free, gyroscopic = len(key.states), key.tilts, float(key.model == "quadrotor")
    further, idle = key.further_states, _idle(key)
    motion = equations_of_motion_of(key.layout.tilt_of_rotor)
    planned = tilt_motion_of(tilts).planned
    angles = componentwise("angles_of_jets", "jets", "jets#[0]", tilts)
    rates_of = componentwise("rates_of_jets", "jets", "jets#[1]", tilts)
    zeros = componentwise("zeros", "tilts", "0.0", tilts)
    speeds_in = entries_of(BODY_STATES, rotors)
    states_in = entries_of(BODY_STATES + rotors, further)
    commanded = entries_of(BODY_STATES + rotors + own, tilts)
    moving, state_rates = entries_of(rotors + own, tilts), entries_of(rotors, further)
    inputs_of = _inputs_of(key)

    @scalar
    def tilts_of(time: float, state: Vector, parameters: Any, knots: Vector) -> Any:
        if free:
            return commanded(state)
        return angles(planned(time, parameters.law.gait, knots))

    @scalar
    def equation_inputs(time: float, state: Vector, parameters: Any, knots: Vector) -> Values:
        tilts = tilts_of(time, state, parameters, knots)
        rates = zeros(tilts) if free else rates_of(planned(time, parameters.law.gait, knots))
        body, speeds, states = body_fields(state), speeds_in(state), states_in(state)
        inputs: Values = inputs_of(time, body, tilts, rates, speeds, states, parameters, knots)
        return inputs

    @scalar
    def rates(
        time: float,
        state: Vector,
        inputs: Vector,
        parameters: Any,
        knots: Vector,
        disturbance: Triple,
    ) -> Values:
        known, tilts = parameters.law, tilts_of(time, state, parameters, knots)
        at = int(known.rotors)
        body = motion(state, tilts, inputs, known.vehicle, knots, at, disturbance, gyroscopic)
        return (*body, *state_rates(inputs))

    @scalar
    def observe(
        time: float, state: Vector, inputs: Vector, parameters: Any, knots: Vector
    ) -> Values:
        tilts = tilts_of(time, state, parameters, knots)
        rates = moving(inputs) if free else rates_of(planned(time, parameters.law.gait, knots))
        seen = (*body_fields(state), *tilts, *idle, *speeds_in(state))
        return (*seen, *rates, *idle, *states_in(state))

    def initial(plan: FlightPlan, _setup: ControlSetup) -> Vector:
        return (*initial_state(plan.scenario, initial_rotor_speeds(plan)), *initial_states(plan))

    return Equations(
        inputs=equation_inputs,
        inputs_size=rotors + further,
        rates=rates,
        initial=initial,
        observe=observe,
        tilts=None if key.model == "quadrotor" else tilts_of,
    )


def _setup(plan: FlightPlan, signature: float) -> ControlSetup:
    scenario, airframe = plan.scenario, airframe_of(plan)
    controller, vehicle = scenario.controller, airframe.vehicle
    assert isinstance(controller, ScalarController)
    own, step = controller.law_parameters(airframe), scenario.simulation.control_timestep
    known = Known(
        plan.gait.parameters,
        plan.reference,
        body_of(vehicle.mass, np.reshape(vehicle.inertia, (3, 3)), vehicle.gravity),
        float(len(plan.knots)),
        held_gain(controller.rotor_bandwidth, step),
        held_gain(controller.tilt_rate_gain, step),
    )
    lead = servo_lead(scenario.any_rotorcraft.tilt_servo)
    knots = (
        *plan.knots,
        *vehicle.table,
        *table_per_newton(vehicle.table, vehicle.thrust_coefficients),
    )
    return ControlSetup(
        record_of(type(own))(signature, lead, known, own),
        (*knots, *vehicle.thrust_coefficients, *controller.law_table(airframe)),
    )


@cache
def scalar_loop(key: Key) -> ClosedLoop:
    """The closed loop of a scalar law."""
    layout = key.layout
    places, free = layout.places, key.tilts
    states = key.further_states
    sampling, equations = _sampling(key), _equations(key)
    tilts = "".join(f"_{tilt}" if tilt >= 0 else "_f" for tilt in layout.tilt_of_rotor)
    senses = "".join("p" if spin > 0.0 else "m" for spin in layout.spins)
    for step in (sampling.controls, equations.inputs):
        step.__qualname__ = f"{key.code_name}.{key.model}{tilts}_{senses}"
    multirotor = key.model == "multirotor"
    return ClosedLoop(
        kind=rotorcraft_kind(places if multirotor else CROSS, ("singularity_margin",)),
        parameters=record_of(key.parameters),
        setup=_setup,
        dynamics=Dynamics(
            f"multirotor{tilts}_{senses}" if multirotor else key.model,
            places.sizes(states),
            lambda plan, _setup: (*initial_rotor_speeds(plan), *initial_states(plan)),
            states,
            layout.spins,
            layout.tilt_of_rotor if multirotor else (),
        ),
        sampling=sampling,
        columns=_columns(key),
        equations=equations,
        follows_position=lambda scenario: scenario.reference.kind != "attitude_altitude",
        uses_gait=places.tilts > 0 and not free,
    )
