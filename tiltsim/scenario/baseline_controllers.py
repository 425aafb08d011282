"""The ``[controller]`` tables of the baselines: known controllers to compare with."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import numpy as np

from tiltsim.scenario.law_controller import Airframe, LawController, TiltingTable
from tiltsim.scenario.messages import InvalidValueError
from tiltsim_controllers.analysis.stability import ErrorLoop, linear_loop
from tiltsim_controllers.laws.geometric import Geometric, geometric, geometric_with_tilts
from tiltsim_controllers.laws.indi import Indi, indi, state_units
from tiltsim_controllers.laws.pid import STATES, Pid, pid
from tiltsim_controllers.mathematics.scalar import Values
from tiltsim_controllers.vehicle.effectiveness import CONSTANT, COSINE, ROTOR_FLOATS, tilt_of_rotor


def require_no_pose(scenario: Any) -> None:
    """Refuse a reference of roll and pitch, of which the position disposes."""
    reference = scenario.reference
    for key in ("roll", "pitch"):
        if getattr(reference, key):
            reason = "is an output of the law with controller.tilts = free only"
            raise InvalidValueError(f"reference.{key}", getattr(reference, key), reason)


class GeometricController(Geometric, TiltingTable, LawController):
    """Tracking control on SE(3) (Lee et al. 2010)."""

    reference_kinds = ("position", "pose")
    control: ClassVar = staticmethod(geometric)

    def check_scenario(self, scenario: Any) -> None:
        super().check_scenario(scenario)
        if not self.commands_tilts:
            require_no_pose(scenario)

    def law_function(self, airframe: Airframe) -> Callable[..., Any]:
        if not self.commands_tilts:
            return self.control
        self._check_free(airframe)
        return geometric_with_tilts

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


class PidController(Pid, LawController):
    """The cascade of P, PI, P and PID that a practitioner tries first."""

    states = STATES
    control: ClassVar = staticmethod(pid)

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


class IndiController(Indi, LawController):
    """Incremental nonlinear dynamic inversion (Smeur et al. 2016)."""

    control: ClassVar = staticmethod(indi)

    def state_units(self, airframe: Airframe) -> Mapping[str, str]:
        return state_units(airframe.rotors)

    def initial_states(self, airframe: Airframe) -> Values:
        pairs = zip(airframe.vehicle.thrust_coefficients, airframe.initial_speeds, strict=True)
        thrusts = (k * speed * abs(speed) for k, speed in pairs)
        filtered = (*airframe.initial_body_rates, 0.0, 0.0, 0.0)
        return (*filtered, *thrusts, *(0.0,) * airframe.rotors)
