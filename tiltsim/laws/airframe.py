"""Facts about a vehicle and its gait that laws may use when a flight is planned."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from typing import Any

from tiltsim.errors import InputError
from tiltsim.models.cross import as_multirotor
from tiltsim.scenario.law_controller import Airframe
from tiltsim.scenario.loading import load_scenario
from tiltsim.scenario.scenario import FlightPlan, Scenario, plan_flight
from tiltsim.vehicles.rotorcraft import initial_rotor_speeds, initial_tilts


def airframe(scenario: Scenario | str | PathLike[str] | Mapping[str, Any]) -> Airframe:
    """Facts that the controller of a scenario may use, as methods of a `LawController` take them.

    Args:
        scenario: Anything that `tiltsim.load_scenario` takes, of a rotorcraft.

    Raises:
        InputError: If it is not valid, or of a tilt-car.
    """
    loaded = load_scenario(scenario)
    if loaded.vehicle.model == "tilt_car":
        raise InputError(f"{loaded.address}: vehicle.model: airframe takes rotorcraft only")
    return airframe_of(plan_flight(loaded))


def airframe_of(plan: FlightPlan) -> Airframe:
    """The airframe of a planned flight."""
    scenario, simulation = plan.scenario, plan.scenario.simulation
    table = scenario.any_rotorcraft
    vehicle, tilting = table.resolve(), table.has_tilting_rotors
    speeds = initial_rotor_speeds(plan)
    return Airframe(
        as_multirotor(vehicle, tilting=tilting),
        plan.gait,
        initial_tilts(plan)[0] if tilting else (),
        tuple(spin * speed for spin, speed in zip(table.spins, speeds, strict=True)),
        scenario.initial.position,
        scenario.initial.velocity,
        scenario.initial.attitude,
        scenario.initial.angular_velocity,
        # The thesis's equations omit the gyroscopic torque but for the quadrotor's.
        float(simulation.plant != "thesis" or table.model == "quadrotor"),
        simulation.timestep,
        simulation.control_timestep,
        simulation.latency_steps,
        table.speeds_along_spin,
        table.rotor_time_constant,
        table.tilt_servo,
        scenario.reference,
    )
