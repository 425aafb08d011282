"""The ``[controller]`` tables of the baselines: known controllers to compare with."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from pydantic import Field

import tiltsim_controllers.laws.geometric as geometric
from tiltsim.scenario.messages import InvalidValueError
from tiltsim.scenario.scalar_controller import Airframe, TiltingController
from tiltsim.scenario.table import Positive
from tiltsim_controllers.vehicle.effectiveness import CONSTANT, COSINE, ROTOR_FLOATS, layout_of


def require_no_pose(scenario: Any) -> None:
    """Refuse a reference of roll and pitch, of which the position disposes."""
    reference = scenario.reference
    for key in ("roll", "pitch"):
        if getattr(reference, key):
            reason = "is an output of the law with controller.tilts = free only"
            raise InvalidValueError(f"reference.{key}", getattr(reference, key), reason)


class GeometricController(TiltingController):
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
        layout = layout_of(airframe.vehicle.table)
        if self.tilts == "gait":
            return geometric.geometric_law_of(airframe.rotors)
        self._check_free(airframe)
        return geometric.free_geometric_law_of(layout)

    def _check_free(self, airframe: Airframe) -> None:
        """Refuse tilts that static allocation does not reach."""
        table = np.reshape(airframe.vehicle.table, (airframe.rotors, ROTOR_FLOATS))
        layout = layout_of(airframe.vehicle.table)
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
