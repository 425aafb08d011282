"""The ``[controller]`` tables of the baselines: known controllers to compare with."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Literal

import numpy as np
from pydantic import Field

import tiltsim_controllers.laws.geometric as geometric
import tiltsim_controllers.laws.indi as indi
import tiltsim_controllers.laws.pid as pid
from tiltsim.scenario.messages import InvalidValueError
from tiltsim.scenario.scalar_controller import Airframe, ScalarController, TiltingTable
from tiltsim.scenario.table import Gains2, Positive, Vector3
from tiltsim_controllers.analysis.stability import ErrorLoop, linear_loop
from tiltsim_controllers.mathematics.scalar import Values
from tiltsim_controllers.vehicle.effectiveness import CONSTANT, COSINE, ROTOR_FLOATS, tilt_of_rotor


def require_no_pose(scenario: Any) -> None:
    """Refuse a reference of roll and pitch, of which the position disposes."""
    reference = scenario.reference
    for key in ("roll", "pitch"):
        if getattr(reference, key):
            reason = "is an output of the law with controller.tilts = free only"
            raise InvalidValueError(f"reference.{key}", getattr(reference, key), reason)


class GeometricController(TiltingTable, ScalarController):
    """Tracking control on SE(3) (Lee et al. 2010)."""

    reference_kinds = ("position", "pose")

    law: Literal["geometric"] = Field(
        description="tracking control on SE(3) (Lee et al. 2010), from any attitude; force and "
        "torque are allocated to the rotors, or to rotors and tilts (Kamel et al. 2018)"
    )
    position_bandwidth: Positive = Field(
        2.0, description="natural frequency of the position's error [rad/s]"
    )
    position_damping: Positive = Field(1.0, description="its damping ratio [-]")
    attitude_bandwidth: Positive = Field(
        10.0,
        description="natural frequency of a small error of attitude, about an axis of the mean "
        "moment of inertia [rad/s]",
    )
    attitude_damping: Positive = Field(1.0, description="its damping ratio [-]")
    max_acceleration: Positive = Field(
        1e9, description="largest acceleration that the feedback of position demands [m/s^2]"
    )

    def check_scenario(self, scenario: Any) -> None:
        super().check_scenario(scenario)
        if not self.commands_tilts:
            require_no_pose(scenario)

    def scalar_law(self, airframe: Airframe) -> Callable[..., Any]:
        layout = tilt_of_rotor(airframe.vehicle.table)
        if self.tilts == "gait":
            return geometric.geometric_law_of(airframe.rotors)
        self._check_free(airframe)
        return geometric.free_geometric_law_of(layout)

    def _check_free(self, airframe: Airframe) -> None:
        """Refuse tilts that static allocation does not reach."""
        table = np.reshape(airframe.vehicle.table, (airframe.rotors, ROTOR_FLOATS))
        layout = tilt_of_rotor(airframe.vehicle.table)
        fixed = np.abs(table[:, CONSTANT:COSINE]).max() > 1e-9 * np.abs(table[:, CONSTANT:]).max()
        if len(set(layout)) < len(layout) or -1 in layout or fixed:
            reason = "every rotor needs a tilt of its own, about an axis across its thrust"
            raise self.mistake("tilts", reason)
        rows = np.hstack([table[:, COSINE : COSINE + 6].T, table[:, COSINE + 6 :].T])
        if np.linalg.matrix_rank(rows) < len(rows):
            raise self.mistake("tilts", "the vehicle has not force and torque in all directions")

    def law_parameters(self, airframe: Airframe) -> geometric.Parameters:
        inertia = float(np.trace(np.reshape(airframe.vehicle.inertia, (3, 3)))) / 3.0
        position, attitude = self.position_bandwidth, self.attitude_bandwidth
        return geometric.Parameters(
            position * position,
            2.0 * self.position_damping * position,
            inertia * attitude * attitude,
            2.0 * inertia * self.attitude_damping * attitude,
            self.max_acceleration,
            airframe.gyroscopic,
        )


class PidController(ScalarController):
    """The cascade of P, PI, P and PID that a practitioner tries first."""

    law: Literal["pid"] = Field(
        description="cascade: position (P), velocity (PI), attitude (P) and rates (PID)"
    )
    position_gain: Positive = Field(
        1.0, description="velocity demanded per error of position [1/s]"
    )
    max_speed: Positive = Field(
        3.0, description="largest velocity that the error of position demands [m/s]"
    )
    velocity_gains: Gains2 = Field(
        (3.0, 0.9),
        description="acceleration demanded per error of velocity and per its integral [1/s, 1/s^2]",
    )
    max_acceleration: Positive = Field(
        5.0, description="largest acceleration that the feedback demands [m/s^2]"
    )
    attitude_gain: Positive = Field(9.0, description="rates demanded per error of attitude [1/s]")
    rate_gains: Vector3 = Field(
        (27.0, 72.9, 0.1),
        description="angular acceleration demanded per error of the rates, per its integral, and "
        "per minus the derivative of the rates [1/s, 1/s^2, 1]",
    )
    derivative_filter: Positive = Field(
        100.0, description="of the rates whose derivative is taken, a lag of first order [1/s]"
    )

    def error_loops(self, vehicle: Any) -> list[ErrorLoop]:
        velocity, rate = self.velocity_gains, self.rate_gains
        k, i = velocity[0], velocity[1]
        p, j, d = rate[0], rate[1], 1.0 + rate[2]
        a, b = self.position_gain, self.attitude_gain
        return [
            *super().error_loops(vehicle),
            linear_loop("velocity", velocity),
            linear_loop("position", (k, a * k + i, a * i) if i else (k, a * k)),
            linear_loop("rates", (p / d, j / d) if j else (p / d,)),
            linear_loop(
                "attitude", (p / d, (b * p + j) / d, b * j / d) if j else (p / d, b * p / d)
            ),
        ]

    def scalar_law(self, airframe: Airframe) -> Callable[..., Any]:
        return pid.pid_law_of(airframe.rotors)

    def law_parameters(self, airframe: Airframe) -> pid.Parameters:
        return pid.Parameters(
            self.position_gain,
            self.max_speed,
            *self.velocity_gains,
            self.max_acceleration,
            self.attitude_gain,
            *self.rate_gains,
            self.derivative_filter,
        )

    def state_units(self, airframe: Airframe) -> Mapping[str, str]:
        return pid.STATES


class IndiController(ScalarController):
    """Incremental nonlinear dynamic inversion (Smeur et al. 2016)."""

    law: Literal["indi"] = Field(
        description="incremental nonlinear dynamic inversion of the attitude (Smeur et al. 2016), "
        "with filtered rates and thrusts"
    )
    position_bandwidth: Positive = Field(
        2.0, description="natural frequency of the position's error, critically damped [rad/s]"
    )
    attitude_gain: Positive = Field(9.0, description="rates demanded per error of attitude [1/s]")
    rate_gain: Positive = Field(
        27.0, description="angular acceleration demanded per error of the rates [1/s]"
    )
    filter_frequency: Positive = Field(
        50.0, description="natural frequency of the filter of rates and thrusts [rad/s]"
    )
    filter_damping: Positive = Field(0.55, description="its damping ratio [-]")
    max_acceleration: Positive = Field(
        5.0, description="largest acceleration that the feedback of position demands [m/s^2]"
    )

    def scalar_law(self, airframe: Airframe) -> Callable[..., Any]:
        return indi.indi_law_of(airframe.rotors)

    def law_parameters(self, airframe: Airframe) -> indi.Parameters:
        position = self.position_bandwidth
        return indi.Parameters(
            position * position,
            2.0 * position,
            self.max_acceleration,
            self.attitude_gain,
            self.rate_gain,
            self.filter_frequency,
            self.filter_damping,
        )

    def state_units(self, airframe: Airframe) -> Mapping[str, str]:
        return indi.state_units(airframe.rotors)

    def initial_states(self, airframe: Airframe) -> Values:
        pairs = zip(airframe.vehicle.thrust_coefficients, airframe.initial_speeds, strict=True)
        thrusts = (k * speed * abs(speed) for k, speed in pairs)
        filtered = (*airframe.initial_body_rates, 0.0, 0.0, 0.0)
        return (*filtered, *thrusts, *(0.0,) * airframe.rotors)
