"""What is recorded and watched of multirotors under the controller of attitude and force."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Final

from tiltsim.closed_loop.loop import Columns, ControlSetup, Monitoring
from tiltsim.laws.multirotor_layout import STATES, Layout, LoopParameters, law_state_of
from tiltsim.laws.rotorcraft import CONDITION, torque_free_columns
from tiltsim.laws.tiltrotor import (
    REFERENCE_COLUMNS,
    reference_columns,
    rotor_stops,
    singular_attitude,
)
from tiltsim.vehicles.rotorcraft.layout import TILT_RATE_1
from tiltsim_controllers.gaits.any_tilts import tilt_motion_of
from tiltsim_controllers.laws.attitude_altitude import PUBLISHED_DECOUPLING
from tiltsim_controllers.laws.failures import health_of, masked_of
from tiltsim_controllers.laws.gait_feedforward import INTEGRAL_FIELDS
from tiltsim_controllers.laws.multirotor_inputs import independence_of
from tiltsim_controllers.laws.multirotor_steps import Form
from tiltsim_controllers.laws.supervisor import SUPERVISOR_AT_REST
from tiltsim_controllers.mathematics.rotation import world_up_in_body
from tiltsim_controllers.mathematics.scalar import Floats, Triple, Values, Vector, scalar
from tiltsim_controllers.mathematics.vectors import componentwise, entries_of
from tiltsim_controllers.references.trajectories import position_reference
from tiltsim_controllers.vehicle.effectiveness import effectiveness_of
from tiltsim_controllers.vehicle.states import PITCH, ROLL

NULL_PART: Final = "null_part"
"""A column: the share of the rotors' ``varpi |varpi|`` that neither force nor torque show."""

REFERENCES: Final = (*REFERENCE_COLUMNS, NULL_PART)
"""Columns of what the law asks for."""

Margins = Callable[[Mapping[str, Floats], ControlSetup], dict[str, Floats]]


@cache
def references_of(layout: Layout, law: Callable[..., Values]) -> Callable[..., Values]:
    """Scalar code of the columns `REFERENCES`; see `SupervisedLaw.references`."""
    rotors, tilts = layout.places
    first = layout.places.speed_1 + rotors
    state_in, rates_of_sample = entries_of(0, first), entries_of(first, tilts)
    integrals_of_sample = entries_of(first + tilts, STATES)
    asked_in = entries_of(rotors + STATES, 4)  # roll, pitch, yaw, null part

    @scalar
    def references(
        time: float, values: Vector, motion: Triple, parameters: LoopParameters, knots: Vector
    ) -> Values:
        own = parameters.law
        x, y, z, _, _, _, _, _, _ = position_reference(time, own.reference, knots)
        moving, integrals = rates_of_sample(values), integrals_of_sample(values)
        inputs = law(time, state_in(values), moving, integrals, own, knots, motion)
        return (x, y, z, *asked_in(inputs))

    return references


@cache
def columns_of(layout: Layout, references: Callable[..., Values], margins: Margins) -> Columns:
    """Samples of flights under a law, and the columns of references, margin and null part."""
    places, state_of = layout.places, law_state_of(layout)
    rotors, tilts = places
    tilt_rates_in, integrals_in = entries_of(TILT_RATE_1, tilts), entries_of(rotors, STATES)
    planned = tilt_motion_of(tilts).planned
    angles = componentwise("angles_of_jets", "jets", "jets#[0]", tilts)

    @scalar
    def observe(qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector) -> Values:
        return (*state_of(qpos, qvel, act), *tilt_rates_in(qvel), *integrals_in(act))

    @scalar
    def asked(time: float, values: Vector, parameters: LoopParameters, knots: Vector) -> Values:
        jets = planned(time, parameters.law.gait, knots)
        return (*references(time, values, SUPERVISOR_AT_REST, parameters, knots), *angles(jets))

    names = (*REFERENCES, *places.names("alpha_ref"))

    def derive(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
        found = reference_columns(asked, fields_of(layout), samples, setup, names)
        return {**found, **margins(samples, setup)}

    units = {**dict.fromkeys(INTEGRAL_FIELDS, "m s"), NULL_PART: "1", CONDITION: "1"}
    return Columns(observe, derive, fields=INTEGRAL_FIELDS, units=units)


def fields_of(layout: Layout) -> tuple[str, ...]:
    """The fields of a sample."""
    return (*layout.places.observed_fields, *INTEGRAL_FIELDS)


@cache
def margins_of(layout: Layout, dimension: int) -> Margins:
    """The columns that a sample alone decides."""
    return lambda samples, setup: torque_free_columns(
        layout.places, _table(setup), samples, dimension, setup.parameters.law.failure
    )


def _table(setup: ControlSetup) -> Values:
    """The table of the rotors, after the knots of gait and reference."""
    return setup.knots[int(setup.parameters.law.rotors) :]


@cache
def monitoring_of(layout: Layout, form: Form) -> Monitoring:
    """Where the outputs depend on each other or, in the norm of the speeds, a rotor stops."""
    places = layout.places
    tilts_in = entries_of(places.alpha_1, places.tilts)
    turning = places.rotors if form.norm == "speed" else 0
    speeds_in = entries_of(places.speed_1, turning)
    cosines, sines, effect, _, _ = effectiveness_of(layout.tilt_of_rotor)
    independence = independence_of(places.rotors, form.dimension, form.forward)
    health, masked = health_of(places.rotors), masked_of(places.rotors)
    losses, names, stops = form.losses, places.names("alpha"), rotor_stops(turning)
    harmless = (1.0,) * len(stops)  # as published, the factor 2 |varpi| is in rows of force only

    @scalar
    def sign_check_values(
        time: float, values: Vector, parameters: LoopParameters, knots: Vector
    ) -> Values:
        own, side, tilts = parameters.law, parameters.upper_side, tilts_in(values)
        rows = effect(1.0, cosines(tilts), sines(tilts), knots, int(own.rotors))
        if losses:
            rows = masked(health(time, own.failure), rows)
            if time >= own.failure.known_from:
                side = parameters.upper_side_without
        up = world_up_in_body(values[ROLL], values[PITCH])
        share = independence(rows, up, (side.x, side.y, side.z))
        if own.decoupling == PUBLISHED_DECOUPLING:
            return (share, *harmless)
        return (share, *speeds_in(values))

    def causes(sample: Mapping[str, float], setup: ControlSetup) -> tuple[str, ...]:
        failure, attitude = setup.parameters.law.failure, singular_attitude(sample, names)
        if sample["time"] >= failure.known_from:
            attitude += f", without rotor {failure.rotor:g}"
        return (attitude, *stops)

    return Monitoring(sign_check_values, causes)
