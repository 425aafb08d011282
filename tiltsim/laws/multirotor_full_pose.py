"""Full-pose control of multirotors of any layout in closed loops: the tilt angles are inputs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any

from tiltsim.closed_loop.loop import ClosedLoop, Monitoring
from tiltsim.laws.rotor_loop import (
    RotorLaw,
    RotorLayout,
    body_of_vehicle,
    layout_of_vehicle,
    rotor_loop,
    table_of,
)
from tiltsim.laws.rotorcraft import rotor_stops, torque_free_columns
from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.tiltrotor_controllers import FullPoseController
from tiltsim.vehicles.rotorcraft import initial_tilts
from tiltsim_controllers.laws.full_pose import limited_tilt_rate
from tiltsim_controllers.laws.multirotor_full_pose import Parameters, full_pose_law_of
from tiltsim_controllers.mathematics.scalar import Values, Vector, scalar
from tiltsim_controllers.mathematics.vectors import componentwise, entries_of

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan, Scenario


@cache
def _inputs_of(layout: RotorLayout) -> Callable[..., Values]:
    """Scalar code of `RotorLaw.inputs`: the ``states`` are the commands of the servos."""
    rotors, tilts = layout.places
    accelerations, rates_in = entries_of(0, rotors), entries_of(rotors, tilts)
    law = full_pose_law_of(layout.tilt_of_rotor)
    # The law's limit sees a pod that stops at its servo's stop, but not the command beyond it.
    limited = componentwise(
        "limited_commands",
        "rates, commands, limits",
        "limited(rates#, commands#, limits)",
        tilts,
        limited=limited_tilt_rate,
    )

    @scalar
    def inputs(
        time: float,
        state: Values,
        tilt_rates: Values,
        states: Values,
        parameters: Any,
        knots: Vector,
    ) -> Values:
        found, limits = law(time, state, parameters.law, knots), parameters.law.limits
        return (*accelerations(found), *limited(rates_in(found), states, limits))

    return inputs


def _setup(plan: FlightPlan) -> tuple[Parameters, Values]:
    controller, vehicle = plan.scenario.controller, plan.scenario.vehicle.resolve()
    assert isinstance(controller, FullPoseController)
    assert isinstance(vehicle, Multirotor)
    law = Parameters(
        vehicle=body_of_vehicle(vehicle),
        gains=controller.resolve_gains(),
        reference=plan.reference,
        limits=controller.resolve_limits(),
        tilt_weight=controller.resolve_tilt_weight(vehicle),
        rotors=float(len(plan.knots)),
        failure=controller.resolve_failure(),
    )
    return law, vehicle.table


@cache
def full_pose_loop(layout: RotorLayout) -> ClosedLoop:
    """Full-pose control of all multirotors of a layout."""
    places = layout.places
    speeds_in, stops = entries_of(places.speed_1, places.rotors), rotor_stops(places.rotors)

    @scalar
    def speeds(time: float, values: Vector, parameters: Any, knots: Vector) -> Values:
        # A pod that turns across its thrust spans one plane with it at any angle: the rank of such
        # rotors' matrix changes only where one of them stops, whichever of them are lost.
        return speeds_in(values)

    law = RotorLaw(
        "full_pose",
        _inputs_of(layout),
        Parameters,
        _setup,
        states=dict.fromkeys(places.names("tilt_command"), "rad"),
        initial=lambda plan: initial_tilts(plan)[0],
        commands=0,
        margins=lambda samples, setup: torque_free_columns(
            places, table_of(places, setup), samples, failure=setup.parameters.law.failure
        ),
    )
    return replace(
        rotor_loop(layout, law),
        monitoring=Monitoring(speeds, lambda _sample, _setup: stops),
        uses_gait=True,  # its angles at time zero
    )


def full_pose_loop_of(scenario: Scenario, _measured: bool) -> ClosedLoop:
    """The full-pose loop of a scenario's multirotor, without layers; it measures nothing."""
    vehicle = scenario.vehicle.resolve()
    assert isinstance(vehicle, Multirotor)
    return full_pose_loop(layout_of_vehicle(vehicle))
