"""Closed loops around scalar laws that command thrusts: baselines and those of packages.

One loop serves every rotorcraft: its rotors are a table, as those of multirotors, and its layout is
compiled in. The rotors' speeds are states that approach the commanded ones; so are the tilts of a
law that commands them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from math import sqrt
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from tiltsim.closed_loop.loop import ClosedLoop
from tiltsim.laws.airframe import airframe_of, initial_states
from tiltsim.laws.rotor_loop import RotorLaw, body_of_vehicle, rotor_loop
from tiltsim.laws.scalar_parameters import Key, record_of
from tiltsim.scenario.scalar_controller import ScalarTable
from tiltsim_controllers.gaits.any_tilts import tilt_motion_of
from tiltsim_controllers.laws.observed import Desired, Observed
from tiltsim_controllers.mathematics.rotation import rotation_from_euler
from tiltsim_controllers.mathematics.scalar import Values, Vector, scalar
from tiltsim_controllers.mathematics.vectors import componentwise, entries_of, vectors_of
from tiltsim_controllers.references.trajectories import reference_derivatives
from tiltsim_controllers.vehicle.actuators import held_gain
from tiltsim_controllers.vehicle.effectiveness import (
    ROTOR_FLOATS,
    effectiveness_of,
    table_per_newton,
)
from tiltsim_controllers.vehicle.states import ALPHA_1

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan


CORRECTION: Final = 5.0
"""1/s: the rate at which rotor speeds approach those of their model, slow beside any latency."""


@scalar
def signed_root(value: float) -> float:
    """The number whose product with its own size is the value."""
    return sqrt(value) if value >= 0.0 else -sqrt(-value)


class _Following(NamedTuple):
    """Scalar code by which rotors and tilts follow what a law commands."""

    accelerations: Callable[..., Values]  # (gain, thrusts, k, speeds, spins): of rotors, rad/s^2
    corrected: Callable[..., Values]
    """``(rates, spins, f, modelled, speeds)``: the same of rotors that follow a model of theirs."""
    tilt_rates: Callable[..., Values]  # (gain, angles, commanded): rad/s


@cache
def _following_of(rotors: int, tilts: int) -> _Following:
    return _Following(
        componentwise(
            "accelerations",
            "gain, thrusts, k, speeds, spins",
            "gain * spins# * (root(thrusts# / k#) - speeds#)",
            rotors,
            root=signed_root,
        ),
        componentwise(
            "corrected",
            "rates, spins, f, modelled, speeds",
            "rates# + f * spins# * (modelled# - speeds#)",
            rotors,
        ),
        componentwise(
            "tilt_rates_for", "gain, angles, commanded", "gain * (angles# - commanded#)", tilts
        ),
    )


@cache
def _inputs_of(key: Key) -> Callable[..., Values]:
    """Scalar code of `RotorLaw.inputs`.

    The ``states`` are the law's own, the commanded tilts where it commands them, and the rotor
    speeds of their model where they have one.
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
    accelerations, corrected, tilt_rates_for = _following_of(rotors, tilts)
    tilts_in, speeds_in = entries_of(ALPHA_1, tilts), entries_of(ALPHA_1 + tilts, rotors)
    states_in, commanded = entries_of(0, own), entries_of(own, tilts)
    modelled_in = entries_of(own + tilts * free, rotors)
    models_rotors, correction = key.models_rotors, CORRECTION
    per_newton, coefficients = ROTOR_FLOATS * rotors, 2 * ROTOR_FLOATS * rotors
    own_table = coefficients + rotors

    @scalar
    def inputs(
        time: float,
        state: Values,
        tilt_rates: Values,
        states: Values,
        parameters: Any,
        knots: Vector,
    ) -> Values:
        known, angles_now = parameters.law, tilts_in(state)
        turning = product(spins, speeds_in(state))
        at, reference, jets = int(known.rotors), known.reference, planned(time, known.gait, knots)
        seen: Any = state
        motion: Any = reference_derivatives(time, reference, knots)
        rows: Any = rows_of(1.0, cosines(angles_now), sines(angles_now), knots, at + per_newton)
        k = coefficients_in(knots, at + coefficients)
        # Built where it is used: native code cannot return records.
        observed = Observed(
            time,
            seen[:3],
            seen[3:6],
            seen[6:9],
            rotation_from_euler(seen[6], seen[7], seen[8]),
            seen[9:12],
            angles_now,
            tilt_rates,
            turning,
            pushes(k, turning),
            states_in(states),
            Desired(
                motion[:3],
                motion[3:6],
                motion[6:9],
                motion[9:12],
                (reference.roll, reference.pitch, reference.yaw),
                angles_of(jets),
                rates_of(jets),
            ),
            known.vehicle,
            rows[:3],
            rows[3:],
            knots,
            at + per_newton,
            at + own_table,
        )
        thrusts, angles, rates = law(observed, known.own)
        reached = modelled_in(states) if models_rotors else turning
        demanded = accelerations(known.rotor_gain, thrusts, k, reached, spins)
        # Angles beside a gait are controls that no vehicle has: refused before the flight.
        moving = tilt_rates_for(known.tilt_gain, angles, commanded(states)) if free else angles
        if models_rotors:
            following = corrected(demanded, spins, correction, reached, turning)
            return (*following, *rates, *moving, *product(spins, demanded))
        return (*demanded, *rates, *moving)

    return inputs


def _setup_of(record: Any) -> Callable[[FlightPlan], tuple[Any, Values]]:
    """`RotorLaw.setup` of laws with a record of parameters."""

    def setup(plan: FlightPlan) -> tuple[Any, Values]:
        scenario, airframe = plan.scenario, airframe_of(plan)
        controller, vehicle = scenario.controller, airframe.vehicle
        assert isinstance(controller, ScalarTable)
        step = scenario.simulation.control_timestep
        known = record(
            plan.gait.parameters,
            plan.reference,
            body_of_vehicle(vehicle),
            float(len(plan.knots)),
            held_gain(controller.rotor_bandwidth, step),
            held_gain(controller.tilt_rate_gain, step),
            controller.law_parameters(airframe),
        )
        per_newton = table_per_newton(vehicle.table, vehicle.thrust_coefficients)
        tables = (*vehicle.table, *per_newton, *vehicle.thrust_coefficients)
        return known, (*tables, *controller.law_table(airframe))

    return setup


@cache
def scalar_loop(key: Key) -> ClosedLoop:
    """The closed loop of a scalar law."""
    record, shown = record_of(key.parameters), key.layout.shown
    commands = shown.names("tilt_command") if key.tilts else ()
    modelled = shown.names("modelled_rotor_speed") if key.models_rotors else ()
    late = key._replace(models_rotors=True)
    law = RotorLaw(
        key.code_name,
        _inputs_of(key),
        record,
        _setup_of(record),
        states={
            **dict(key.states),
            **dict.fromkeys(commands, "rad"),
            **dict.fromkeys(modelled, "rad/s"),
        },
        initial=partial(initial_states, models_rotors=key.models_rotors),
        commands=len(key.states) if key.tilts else None,
    )
    return replace(
        rotor_loop(key.layout, law),
        follows_position=lambda scenario: scenario.reference.kind != "attitude_altitude",
        with_latency=None if key.models_rotors else partial(scalar_loop, late),
    )
