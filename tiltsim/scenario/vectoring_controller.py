"""The ``[controller]`` table of the law for every rotorcraft."""

from collections.abc import Mapping
from math import hypot, inf
from typing import Any, ClassVar

import numpy as np

from tiltsim.scenario.controller_table import FailureAwareController
from tiltsim.scenario.law_controller import Airframe, LawController, TiltingTable
from tiltsim_controllers.analysis.stability import ErrorLoop
from tiltsim_controllers.analysis.vectoring_design import REACH, Timing, design
from tiltsim_controllers.analysis.vectoring_limits import Craft
from tiltsim_controllers.laws.vectoring import Vectoring, vectoring
from tiltsim_controllers.laws.vectoring_state import Parameters, state_units
from tiltsim_controllers.mathematics.attitude import quaternion_of_euler
from tiltsim_controllers.mathematics.scalar import Floats, Values
from tiltsim_controllers.vehicle.actuators import held_gain
from tiltsim_controllers.vehicle.rotors import table_per_newton

LARGEST_LEAN = 1.57
"""rad: the axis of a pose points up."""


class VectoringController(Vectoring, FailureAwareController, TiltingTable, LawController):
    """Observers, prediction and allocation within limits, for any rotorcraft."""

    models_latency = True
    observes_forces = True
    reference_kinds = ("position", "pose")
    follows_turns = True
    control: ClassVar = staticmethod(vectoring)

    @property
    def position_stiffness(self) -> float | None:  # type: ignore[override]
        return None if self.position_bandwidth is None else self.position_bandwidth**2

    def error_loops(self, vehicle: Any) -> list[ErrorLoop]:
        return []

    def state_units(self, airframe: Airframe) -> Mapping[str, str]:
        tilts = len(airframe.initial_tilts) if self.commands_tilts else 0
        return state_units(airframe.rotors, tilts, airframe.latency)

    def initial_states(self, airframe: Airframe) -> Values:
        tilts = airframe.initial_tilts if self.commands_tilts else ()
        return (
            *airframe.initial_position,
            *airframe.initial_velocity,
            *quaternion_of_euler(airframe.initial_attitude),
            *airframe.initial_body_rates,
            *(0.0,) * 7,
            *airframe.initial_speeds * (airframe.latency + 1),
            *tilts * airframe.latency,
            *(0.0,) * len(tilts),
        )

    def law_parameters(self, airframe: Airframe) -> Parameters:
        return self._design(airframe)[0]

    def law_table(self, airframe: Airframe) -> Values:
        return self._design(airframe)[1]

    def _design(self, airframe: Airframe) -> tuple[Parameters, Values]:
        vehicle, servo = airframe.vehicle, airframe.tilt_servo
        thrust = np.array(vehicle.thrust_coefficients)
        slowest, fastest = _speeds(airframe, thrust)
        craft = Craft(
            table_per_newton(vehicle.table, vehicle.thrust_coefficients),
            vehicle.mass,
            vehicle.gravity,
            np.reshape(vehicle.inertia, (3, 3)),
            thrust,
            slowest,
            fastest,
            np.array(airframe.initial_tilts),
            self.commands_tilts and len(airframe.initial_tilts) > 0,
            min(self.max_tilt, servo.max_angle or inf),
            len(airframe.initial_tilts) > 0 and not airframe.gait.is_constant,
            np.array([hypot(*rotor.place) for rotor in vehicle.rotors]),
            np.ones(len(thrust)),
        )
        sampled = airframe.control_timestep > 0.0
        timing = Timing(
            airframe.control_timestep or airframe.timestep,
            sampled,
            airframe.latency,
            airframe.rotor_time_constant or 0.0,
            (servo.natural_frequency, servo.damping_ratio),
            (servo.max_rate or inf, servo.max_angle or inf),
            held_gain(self.tilt_rate_gain, airframe.control_timestep),
            airframe.noise,
        )
        found = design(self, craft, timing, self.resolve_failure())
        reference, cone = airframe.reference, min(found[0].cone, LARGEST_LEAN)
        if reference.lean > cone:
            key = "type" if reference.turns else "roll" if reference.roll else "pitch"
            able = f"within its limits the vehicle hovers at up to {cone:.3g} rad"
            leans = "roll and pitch are no outputs of a vehicle that leans to move"
            reason = f"leans by {reference.lean:.3g} rad; {able if cone else leans}"
            raise reference.mistake(key, reason)
        return found


def _speeds(airframe: Airframe, thrust: Floats) -> tuple[Floats, Floats]:
    """Least and largest speeds along the spins, rad/s, (N,): limits, the file's, or by thrusts."""
    vehicle = airframe.vehicle
    spins = np.array(vehicle.spins)[:, np.newaxis]
    low, high = np.sort(spins * np.array(vehicle.speed_ranges), axis=1).T
    slowest, fastest = airframe.speed_limits
    if fastest < inf:
        low, high = np.full(len(thrust), slowest), np.full(len(thrust), fastest)
    most = np.sqrt(REACH * vehicle.mass * vehicle.gravity / len(thrust) / thrust)
    return np.maximum(low, -most), np.minimum(high, most)
