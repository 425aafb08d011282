"""The ``[controller]`` tables of the baselines: known controllers to compare with."""

from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import numpy as np

from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.law_controller import Airframe, LawController, TiltingTable
from tiltsim.scenario.messages import InvalidValueError
from tiltsim_controllers.analysis.stability import ErrorLoop, linear_loop
from tiltsim_controllers.analysis.torque_free import RANK_TOLERANCE
from tiltsim_controllers.laws.geometric import (
    Geometric,
    geometric,
    geometric_leaning_with_tilts,
    geometric_with_tilts,
)
from tiltsim_controllers.laws.indi import Indi, indi, state_units
from tiltsim_controllers.laws.pid import STATES, Pid, pid
from tiltsim_controllers.mathematics.scalar import Values
from tiltsim_controllers.vehicle.effectiveness import CONSTANT, COSINE, ROTOR_FLOATS, SINE


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
        if self._leans(scenario.vehicle):
            require_no_pose(scenario)

    def records_attitude(self, scenario: Any) -> bool:
        return super().records_attitude(scenario) and not self._leans(scenario.vehicle)

    def law_function(self, airframe: Airframe) -> Callable[..., Any]:
        if not self.commands_tilts:
            return self.control
        outputs = self._outputs(airframe.vehicle)
        return geometric_with_tilts if outputs == 6 else geometric_leaning_with_tilts

    def _leans(self, vehicle: Any) -> bool:
        """Whether roll and pitch are inputs of the position, not outputs."""
        if not self.commands_tilts:
            return True
        resolved = vehicle.resolve()
        return isinstance(resolved, Multirotor) and self._outputs(resolved) < 6

    def _outputs(self, vehicle: Multirotor) -> int:
        """How many outputs rotors and tilts move: 6, or 4, torque and lift.

        Raises `mistake` for fewer, and for tilts that static allocation does not reach.
        """
        layout = np.array(vehicle.tilt_of_rotor)
        table = np.reshape(vehicle.table, (len(layout), ROTOR_FLOATS)).T
        still, along, across = (table[part : part + 6] for part in (CONSTANT, COSINE, SINE))
        tilting = layout >= 0
        skew = np.abs(still[:, tilting]).max(initial=0.0) > 1e-9 * np.abs(along).max()
        if len({*layout[tilting]}) < tilting.sum() or skew:
            reason = "every pod needs one rotor, and an axis across its thrust"
            raise self.mistake("tilts", reason)
        rows = np.hstack([np.where(tilting, along, still), across[:, tilting]])
        rows /= np.repeat([np.abs(rows[:3]).max(), np.abs(rows[3:]).max()], 3)[:, np.newaxis]
        if np.linalg.matrix_rank(rows, RANK_TOLERANCE) == 6:
            return 6
        moved = int(np.linalg.matrix_rank(rows[2:], RANK_TOLERANCE))
        if moved < 4:
            reason = f"rotors and tilts move {moved} of the four outputs attitude and lift"
            raise self.mistake("tilts", reason)
        return 4


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
