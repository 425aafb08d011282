"""The ``[controller]`` table of the linear-quadratic regulator."""

from collections.abc import Callable
from functools import lru_cache
from math import inf
from typing import Any, ClassVar, NamedTuple

import numpy as np

from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.baseline_controllers import CompensatingController
from tiltsim.scenario.law_controller import Airframe
from tiltsim.scenario.messages import InvalidValueError
from tiltsim_controllers.gaits.motion import CUBIC
from tiltsim_controllers.gaits.plans import Gait
from tiltsim_controllers.laws.feedback import exact_decoupler
from tiltsim_controllers.laws.lqr import Lqr, Parameters, lqr, lqr_along
from tiltsim_controllers.laws.periodic_lqr import (
    LONGEST_PERIOD,
    SUBSTEPS,
    PeriodicVehicle,
    Regulator,
    node_count,
    regulator_about_hover,
    regulator_about_orbit,
)
from tiltsim_controllers.mathematics.scalar import Floats, Values
from tiltsim_controllers.vehicle.rotors import force_and_torque, table_per_newton


class Weights(NamedTuple):
    """Acceptable deviations."""

    errors: Values  # of each state
    thrust_change: float  # relative to the thrust in hover


class LqrController(Lqr, CompensatingController):
    """The linear-quadratic regulator about hover, or about the orbit of a moving gait."""

    damps_swing = False
    control: ClassVar = staticmethod(lqr)

    def check_scenario(self, scenario: Any) -> None:
        super().check_scenario(scenario)
        if scenario.gait.type == "fixed":
            return
        gait = scenario.gait.plan(scenario.vehicle.resolve())
        if gait.is_constant:
            return
        if gait.parameters.type == CUBIC and not gait.parameters.repeats:
            reason = "the lqr law needs a gait that repeats"
            raise InvalidValueError("gait.repeat", scenario.gait.repeat, reason)
        if not gait.is_continuous:
            reason = "its tilt angles jump; the lqr law needs fixed ones, or a gait without jumps"
            raise InvalidValueError("gait.type", scenario.gait.type, reason)
        if gait.period > LONGEST_PERIOD:
            reason = f"the lqr law has gains for periods of at most {LONGEST_PERIOD:g} s"
            raise InvalidValueError("gait.period", gait.period, reason)

    def solution(self, airframe: Airframe) -> Regulator:
        """The orbit of the gait, or hover, and the regulator about it."""
        return _regulator_of(
            airframe.vehicle,
            airframe.gait,
            airframe.initial_tilts,
            airframe.gyroscopic,
            1.0 / (1.0 / self.rotor_bandwidth + (airframe.rotor_time_constant or 0.0)),
            self._weights(airframe.rotors),
        )

    def _weights(self, rotors: int) -> Weights:
        errors = (self.position_error, self.velocity_error, self.attitude_error, self.rate_error)
        return Weights((*np.repeat(errors, 3).tolist(), *(inf,) * rotors), self.thrust_change)

    def plain_function(self, airframe: Airframe) -> Callable[..., Any]:
        return lqr_along if self.observer else self.control

    def plain_parameters(self, airframe: Airframe) -> Parameters:
        gait = airframe.gait
        return Parameters() if gait.is_constant else Parameters(gait.parameters.period)

    def law_table(self, airframe: Airframe) -> Values:
        return self.solution(airframe).table


def _hover(
    vehicle: Multirotor, force: Floats, torque: Floats
) -> tuple[Floats, tuple[float, float]]:
    """Thrusts (N), and roll and pitch (rad), of hover with rotors that do this per newton."""
    free = np.eye(force.shape[1]) - np.linalg.pinv(torque) @ torque
    lift = free @ force[2]
    axis = force @ lift
    weight = vehicle.mass * vehicle.gravity
    if np.linalg.matrix_rank(torque) < 3 or axis[2] < 1e-6 * np.abs(force).max():
        reason = "the vehicle cannot hover with these tilts"
        raise InvalidValueError("controller.law", "lqr", reason)
    x, y, z = axis.tolist()
    lean = exact_decoupler(0.0, 0.0, 0.0, 0.0, vehicle.gravity, (x, y, z))
    return lift * weight / np.linalg.norm(axis), lean


@lru_cache(maxsize=64)
def _regulator_of(
    vehicle: Multirotor, gait: Gait, tilts: Values, gyroscopic: float, lag: float, weights: Weights
) -> Regulator:
    """The regulator about the orbit of a gait, kept because a flight needs it several times."""
    moves = not gait.is_constant
    period = gait.parameters.period if moves else 1.0
    places = node_count(period) * 2 * SUBSTEPS if moves else 1
    table = table_per_newton(vehicle.table, vehicle.thrust_coefficients)
    angles = gait.angles(period * np.arange(places) / places) if moves else np.array([tilts])
    force, torque = force_and_torque(table, angles)
    nodes = range(0, places, 2 * SUBSTEPS)
    thrusts, lean = zip(*(_hover(vehicle, force[node], torque[node]) for node in nodes))
    known = PeriodicVehicle(
        period,
        float(vehicle.mass),
        float(vehicle.gravity),
        np.array(vehicle.inertia, float).reshape(3, 3),
        gyroscopic,
        lag,
        force,
        torque,
    )
    design = regulator_about_orbit if moves else regulator_about_hover
    try:
        return design(
            known,
            np.array(lean),
            np.array(thrusts),
            np.array(weights.errors, float),
            float(weights.thrust_change),
        )
    except (ValueError, np.linalg.LinAlgError) as error:
        reason = "found no orbit of the gait about which it can regulate"
        raise InvalidValueError("controller.law", "lqr", reason) from error
