"""The ``[controller]`` tables of the baselines: known controllers to compare with."""

from collections.abc import Callable, Mapping
from functools import lru_cache
from math import inf
from typing import Any, ClassVar, Final

import numpy as np

from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.law_controller import Airframe, LawController, TiltingTable
from tiltsim.scenario.messages import InvalidValueError
from tiltsim_controllers.analysis.stability import ErrorLoop, linear_loop
from tiltsim_controllers.analysis.torque_free import RANK_TOLERANCE
from tiltsim_controllers.gaits.motion import CUBIC
from tiltsim_controllers.gaits.plans import Gait
from tiltsim_controllers.laws.compensation import STATES as OBSERVER_STATES
from tiltsim_controllers.laws.compensation import Compensating, compensated, record_of_limits
from tiltsim_controllers.laws.feedback import exact_decoupler
from tiltsim_controllers.laws.geometric import (
    Geometric,
    geometric,
    geometric_leaning_with_tilts,
    geometric_with_tilts,
)
from tiltsim_controllers.laws.indi import Indi, indi, state_units
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
from tiltsim_controllers.laws.pid import STATES, Pid, pid
from tiltsim_controllers.mathematics.scalar import Floats, Values
from tiltsim_controllers.vehicle.rotors import (
    CONSTANT,
    COSINE,
    ROTOR_FLOATS,
    SINE,
    force_and_torque,
    table_per_newton,
)

FASTEST: Final = 1e6  # rad/s, in place of no limit


class CompensatingController(Compensating, LawController):
    """A baseline, with observers and a mixer if its keys ask for them.

    Attributes:
        turning, integrators: See `compensated`.
    """

    turning: ClassVar[bool] = True
    integrators: ClassVar[int] = 0

    @property
    def observes_forces(self) -> bool:  # type: ignore[override]
        """Whether it holds its place against forces."""
        return self.observer > 0.0

    @property
    def compensates(self) -> bool:
        """Whether there is anything around the law itself."""
        return self.observer > 0.0 or self.mixer == "prioritized"

    def check_scenario(self, scenario: Any) -> None:
        super().check_scenario(scenario)
        vehicle = scenario.vehicle
        if self.mixer == "prioritized" and not vehicle.has_rotor_limits:
            raise self.mistake("mixer", "needs vehicle.min_rotor_speed or vehicle.max_rotor_speed")

    def law_function(self, airframe: Airframe) -> Callable[..., Any]:
        law = self.plain_function(airframe)
        if not self.compensates:
            return law
        observes, mixes = self.observer > 0.0, self.mixer == "prioritized"
        return compensated(law, self.turning, self.integrators, observes, mixes)

    def plain_function(self, airframe: Airframe) -> Callable[..., Any]:
        """The function of the law itself."""
        return self.control

    def law_parameters(self, airframe: Airframe) -> tuple[Any, ...]:
        own = self.plain_parameters(airframe)
        if not self.compensates:
            return own
        thrusts = (
            tuple(k * speed * abs(speed) for k in airframe.vehicle.thrust_coefficients)
            for speed in np.clip(airframe.speed_limits, -FASTEST, FASTEST).tolist()
        )
        return record_of_limits(type(own), airframe.rotors)(own, self.observer, *thrusts)

    def plain_parameters(self, airframe: Airframe) -> tuple[Any, ...]:
        """The parameters of the law itself."""
        return super().law_parameters(airframe)

    def state_units(self, airframe: Airframe) -> Mapping[str, str]:
        return {**self.plain_states(airframe), **(OBSERVER_STATES if self.observer else {})}

    def plain_states(self, airframe: Airframe) -> Mapping[str, str]:
        """The states of the law itself, with their units."""
        return self.states

    def initial_states(self, airframe: Airframe) -> Values:
        own = self.plain_initial(airframe)
        velocity, rates = airframe.initial_velocity, airframe.initial_body_rates
        observed = (*velocity, *(0.0,) * 3, *rates, *(0.0,) * 3)
        return (*own, *observed) if self.observer else own

    def plain_initial(self, airframe: Airframe) -> Values:
        """The states of the law itself at time zero."""
        return (0.0,) * len(self.plain_states(airframe))


class GeometricController(Geometric, TiltingTable, CompensatingController):
    """Tracking control on SE(3) (Lee et al. 2010)."""

    reference_kinds = ("position", "pose")
    control: ClassVar = staticmethod(geometric)

    @property
    def position_stiffness(self) -> float | None:  # type: ignore[override]
        return self.position_bandwidth**2 if self.commands_tilts else None

    def check_scenario(self, scenario: Any) -> None:
        super().check_scenario(scenario)
        if self._leans(scenario.vehicle):
            reason = "is an output of the law with controller.tilts = free only"
            for key in ("reference.roll", "reference.pitch"):
                scenario.require(key, 0.0, reason)

    def records_attitude(self, scenario: Any) -> bool:
        return super().records_attitude(scenario) and not self._leans(scenario.vehicle)

    def plain_function(self, airframe: Airframe) -> Callable[..., Any]:
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


class PidController(Pid, CompensatingController):
    """The cascade of P, PI, P and PID that a practitioner tries first."""

    states = STATES
    turning = False  # its integral of the rates does so
    integrators = 6
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


class IndiController(Indi, CompensatingController):
    """Incremental nonlinear dynamic inversion (Smeur et al. 2016)."""

    turning = False  # it increments the torque that is there
    control: ClassVar = staticmethod(indi)

    def plain_states(self, airframe: Airframe) -> Mapping[str, str]:
        return state_units(airframe.rotors)

    def plain_initial(self, airframe: Airframe) -> Values:
        pairs = zip(airframe.vehicle.thrust_coefficients, airframe.initial_speeds, strict=True)
        thrusts = (k * speed * abs(speed) for k, speed in pairs)
        filtered = (*airframe.initial_body_rates, 0.0, 0.0, 0.0)
        return (*filtered, *thrusts, *(0.0,) * airframe.rotors)


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
        errors = (self.position_error, self.velocity_error, self.attitude_error, self.rate_error)
        return _regulator_of(
            airframe.vehicle,
            airframe.gait,
            airframe.initial_tilts,
            airframe.gyroscopic,
            1.0 / (1.0 / self.rotor_bandwidth + (airframe.rotor_time_constant or 0.0)),
            (*np.repeat(errors, 3).tolist(), *(inf,) * airframe.rotors),
            self.thrust_change,
        )

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
    vehicle: Multirotor,
    gait: Gait,
    tilts: Values,
    gyroscopic: float,
    lag: float,
    errors: Values,
    thrust_change: float,
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
            known, np.array(lean), np.array(thrusts), np.array(errors, float), float(thrust_change)
        )
    except (ValueError, np.linalg.LinAlgError) as error:
        reason = "found no orbit of the gait about which it can regulate"
        raise InvalidValueError("controller.law", "lqr", reason) from error
