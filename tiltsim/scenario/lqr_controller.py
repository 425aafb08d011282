"""The ``[controller]`` table of the linear-quadratic regulator."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, lru_cache
from math import inf
from typing import Any, Literal, NamedTuple

import numpy as np
from pydantic import Field

from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.messages import InvalidValueError
from tiltsim.scenario.scalar_controller import Airframe, ScalarController
from tiltsim.scenario.table import NonNegative, Positive
from tiltsim_controllers.gaits.parameters import TABLE
from tiltsim_controllers.gaits.plans import Gait
from tiltsim_controllers.laws.decouplers import exact_decoupler
from tiltsim_controllers.laws.lqr import BODY, linear_hover, lqr_law_of, regulator
from tiltsim_controllers.laws.periodic_lqr import (
    LONGEST_PERIOD,
    SUBSTEPS,
    PeriodicVehicle,
    Regulator,
    node_count,
    periodic_lqr_law_of,
    regulator_about_orbit,
)
from tiltsim_controllers.mathematics.records import make_record_type, vector_of
from tiltsim_controllers.mathematics.rotation import rotation_from_euler
from tiltsim_controllers.mathematics.scalar import Floats, Values
from tiltsim_controllers.vehicle.effectiveness import force_and_torque, table_per_newton


class PeriodicParameters(NamedTuple):
    """Of the law about an orbit."""

    period: float  # s
    nodes: float  # of its table, in a period


class Weights(NamedTuple):
    """What is acceptable."""

    errors: Values  # of each state
    thrust_change: float  # as a part of the thrust in hover


class LqrController(ScalarController):
    """The linear-quadratic regulator about hover, or about the orbit of a moving gait."""

    law: Literal["lqr"] = Field(
        description="linear-quadratic regulator about hover with fixed tilts, or with gains that "
        "repeat with a moving gait about its orbit; weights are one over the square of what is "
        "acceptable (Bryson's rule)"
    )
    position_error: Positive = Field(0.5, description="acceptable [m]")
    velocity_error: Positive = Field(1.0, description="acceptable [m/s]")
    attitude_error: Positive = Field(0.3, description="acceptable [rad]")
    rate_error: Positive = Field(3.0, description="acceptable [rad/s]")
    thrust_change: NonNegative = Field(
        0.3, gt=0.0, description="acceptable, of every rotor, as a part of its thrust in hover [-]"
    )

    def check_scenario(self, scenario: Any) -> None:
        if scenario.gait.type == "fixed":
            return
        gait = scenario.gait.plan(scenario.vehicle.resolve())
        if gait.is_constant:
            return
        if gait.parameters.type == TABLE and not gait.parameters.repeats:
            reason = "the lqr law needs a gait that repeats"
            raise InvalidValueError("gait.repeat", scenario.gait.repeat, reason)
        if not gait.is_continuous:
            reason = "its tilt angles jump; the lqr law needs fixed ones, or a gait without jumps"
            raise InvalidValueError("gait.type", scenario.gait.type, reason)
        if gait.period > LONGEST_PERIOD:
            reason = f"the lqr law has gains for periods of at most {LONGEST_PERIOD:g} s"
            raise InvalidValueError("gait.period", gait.period, reason)

    def scalar_law(self, airframe: Airframe) -> Callable[..., Any]:
        if airframe.gait.is_constant:
            return lqr_law_of(airframe.rotors)
        return periodic_lqr_law_of(airframe.rotors)

    def hover(self, airframe: Airframe) -> tuple[Floats, Floats, tuple[float, float]]:
        """The linear system A, B about hover, thrusts (N), and roll and pitch (rad) there.

        A and B are stacked side by side.
        """
        vehicle = airframe.vehicle
        table = table_per_newton(vehicle.table, vehicle.thrust_coefficients)
        force, torque = force_and_torque(table, airframe.initial_tilts)
        thrusts, lean = _hover(vehicle, force, torque)
        up = vehicle.gravity * np.reshape(rotation_from_euler(*lean, 0.0), (3, 3))[2]
        inertia = np.reshape(vehicle.inertia, (3, 3))
        a, b = linear_hover(force, torque, vehicle.mass, inertia, up, self.rotor_bandwidth)
        return np.hstack([a, b]), thrusts, lean

    def solution(self, airframe: Airframe) -> tuple[Floats, Floats]:
        """Gains K about hover and the solution of the Riccati equation."""
        system, thrusts, _ = self.hover(airframe)
        size = BODY + airframe.rotors
        acceptable, share = self._weights(airframe.rotors)
        changes = share * np.abs(thrusts)
        return regulator(system[:, :size], system[:, size:], np.array(acceptable), changes)

    def periodic_solution(self, airframe: Airframe) -> Regulator:
        """The orbit of a moving gait, the gains about it and the solution of their equation."""
        return _regulator_of(
            airframe.vehicle,
            airframe.gait,
            airframe.gyroscopic,
            self.rotor_bandwidth,
            self._weights(airframe.rotors),
        )

    def _weights(self, rotors: int) -> Weights:
        errors = (self.position_error, self.velocity_error, self.attitude_error, self.rate_error)
        return Weights((*np.repeat(errors, 3).tolist(), *(inf,) * rotors), self.thrust_change)

    def law_parameters(self, airframe: Airframe) -> tuple[Any, ...]:
        if not airframe.gait.is_constant:
            nodes = float(len(self.periodic_solution(airframe).states))
            return PeriodicParameters(airframe.gait.parameters.period, nodes)
        _, thrusts, lean = self.hover(airframe)
        gains, _ = self.solution(airframe)
        record = _lqr_record(airframe.rotors)
        made: tuple[Any, ...] = record(
            *lean, tuple(thrusts.tolist()), tuple(gains.ravel().tolist())
        )
        return made

    def law_table(self, airframe: Airframe) -> Values:
        return () if airframe.gait.is_constant else self.periodic_solution(airframe).table


def _hover(
    vehicle: Multirotor, force: Floats, torque: Floats
) -> tuple[Floats, tuple[float, float]]:
    """Thrusts (N), and roll and pitch (rad), of hover with rotors that do this per newton."""
    free = np.eye(force.shape[1]) - np.linalg.pinv(torque) @ torque
    lift = free @ force[2]
    axis = force @ lift
    weight = vehicle.mass * vehicle.gravity
    if np.linalg.matrix_rank(torque) < 3 or axis[2] < 1e-6 * np.abs(force).max():
        raise InvalidValueError("controller.law", "lqr", "the vehicle cannot hover so")
    x, y, z = axis.tolist()
    lean = exact_decoupler(0.0, 0.0, 0.0, 0.0, vehicle.gravity, (x, y, z))
    return lift * weight / np.linalg.norm(axis), lean


@lru_cache(maxsize=64)
def _regulator_of(
    vehicle: Multirotor, gait: Gait, gyroscopic: float, lag: float, weights: Weights
) -> Regulator:
    """The regulator about the orbit of a moving gait, kept: a flight asks for it several times."""
    period = gait.parameters.period
    places = node_count(period) * 2 * SUBSTEPS
    table = table_per_newton(vehicle.table, vehicle.thrust_coefficients)
    tilts = gait.angles(period * np.arange(places) / places)
    force, torque = force_and_torque(table, tilts)
    nodes = range(0, places, 2 * SUBSTEPS)
    thrusts, lean = zip(*(_hover(vehicle, force[node], torque[node]) for node in nodes))
    known = PeriodicVehicle(
        period,
        vehicle.mass,
        vehicle.gravity,
        np.reshape(vehicle.inertia, (3, 3)),
        gyroscopic,
        lag,
        force,
        torque,
    )
    try:
        return regulator_about_orbit(
            known,
            np.array(lean),
            np.array(thrusts),
            np.array(weights.errors),
            weights.thrust_change,
        )
    except (ValueError, np.linalg.LinAlgError) as error:
        reason = "found no orbit of the gait about which it can regulate"
        raise InvalidValueError("controller.law", "lqr", reason) from error


@cache
def _lqr_record(rotors: int) -> Any:
    """The type of the law's parameters."""
    return make_record_type(
        "LqrParameters",
        roll=float,
        pitch=float,
        thrusts=vector_of(rotors),
        gains=vector_of(rotors * (BODY + rotors)),
    )
