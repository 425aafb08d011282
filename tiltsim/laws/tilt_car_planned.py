"""The tilt-car with a planned direction of its thrusts (ch. 10, Sec. 5; ch. 11)."""

from collections.abc import Mapping
from typing import Any, Final

from tiltsim.closed_loop.loop import ControlSetup
from tiltsim.laws.law import Law
from tiltsim.laws.tilt_car import (
    DEMANDED,
    CarFunctions,
    car_setup_of,
    direction_columns,
    initial_motion,
    motion_rates,
    yaw,
)
from tiltsim.scenario.scenario import FlightPlan
from tiltsim.vehicles.tilt_car import ROTORS
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.gaits.motion import planned_tilts
from tiltsim_controllers.laws.observed import Seen, Step
from tiltsim_controllers.mathematics.scalar import Floats, Vector
from tiltsim_controllers.tilt_car import planned_direction
from tiltsim_controllers.tilt_car.vehicle import counter_yaw_per_tilt

SQUARES: Final = tuple(f"wanted_square_{rotor}" for rotor in ROTORS)


def _tilt(time: Any, p: Any, knots: Any) -> Any:
    """The planned tilt angle with its rate, rad and rad/s, shape (2,)."""
    return planned_tilts(time, p.gait, knots, 1)[0][:2]


def _speeds_of_squares(squares: Any) -> Any:
    """The rotor speeds (rad/s) of controls; NaN for a negative one or NaN."""
    return xp.where(squares >= 0.0, xp.sqrt(xp.where(squares >= 0.0, squares, 0.0)), xp.nan)


class _Planned(CarFunctions):
    """A law whose inputs are the squares of the rotor speeds; the tilt follows its gait."""

    def controls(
        self, time: Any, qpos: Any, qvel: Any, act: Any, parameters: Any, knots: Any
    ) -> Any:
        """Tilt servo, thrusts, idle rotor states.

        The law reads the true direction of the thrusts, which lags behind the gait's steps.
        """
        tilt, tilt_rate = _tilt(time, parameters.law, knots)
        seen = Seen(time, xp.hstack([qpos[:2], qvel[:2], qpos[2:4]]))
        squares = self.law.step(seen, parameters.law, knots).inputs
        return xp.hstack([tilt + parameters.servo_lead * tilt_rate, squares, xp.zeros(2)])

    def observe(self, qpos: Any, qvel: Any, act: Any, ctrl: Any) -> Any:
        return xp.hstack([self.discs(qpos, qvel), _speeds_of_squares(ctrl[1:3])])

    def in_equations(self, time: Any, state: Any, parameters: Any, knots: Any) -> Seen:
        """From a state of the equations, with the planned tilt."""
        tilt = _tilt(time, parameters.law, knots)[0]
        return Seen(time, xp.hstack([state[:4], yaw(tilt, parameters), tilt]))

    def initial_state(self, plan: FlightPlan) -> Vector:
        return initial_motion(plan.scenario)

    def equation_inputs(self, time: Any, state: Any, parameters: Any, knots: Any) -> Any:
        seen = self.in_equations(time, state, parameters, knots)
        return self.law.step(seen, parameters.law, knots).inputs

    def equation_rates(
        self, time: Any, state: Any, inputs: Any, parameters: Any, knots: Any, disturbance: Any
    ) -> Any:
        """The thesis's equations with a tilt that follows the gait exactly."""
        seen = self.in_equations(time, state, parameters, knots).state
        return motion_rates(state, seen[4] + seen[5], inputs, parameters.law.car, disturbance)

    def observe_equations(
        self, time: Any, state: Any, inputs: Any, parameters: Any, knots: Any
    ) -> Any:
        tilt, tilt_rate = _tilt(time, parameters.law, knots)
        yaw_rate = -counter_yaw_per_tilt(parameters.law.car) * tilt_rate
        discs = xp.array([yaw(tilt, parameters), yaw_rate, tilt, tilt_rate])
        return xp.hstack([state[:4], discs, _speeds_of_squares(inputs)])


def _step(seen: Seen, p: Any, knots: Any) -> Step:
    time, state = seen.time, seen.state
    signals = [
        planned_direction.demanded_acceleration(time, state, p),
        planned_direction.demanded_squared_speeds(time, state, p),
        _tilt(time, p, knots)[:1],
    ]
    inputs = planned_direction.planned_direction_inputs(time, state, p)
    return Step(inputs, signals=xp.hstack(signals))


def _columns(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
    """Directions, switches of the thrusts and the candidate of a Lyapunov function."""
    error: Any = samples["y_ref"] - samples["y"]
    error_rate: Any = samples["vy_ref"] - samples["vy"]
    gains = setup.parameters.law.gains
    lyapunov: Any = planned_direction.lyapunov_candidate(error, error_rate, gains)
    switches = {
        f"switch_{rotor}": (samples[name] > 0.0).astype(float)
        for rotor, name in zip(ROTORS, SQUARES, strict=True)
    }
    return {**direction_columns(samples, setup), **switches, "lyapunov": lyapunov}


PLANNED_DIRECTION: Final = _Planned(
    Law(
        _step,
        planned_direction.Parameters,
        car_setup_of(planned_direction.Parameters),
        signals=(*DEMANDED, *SQUARES, "alpha_ref"),
        units={
            **dict.fromkeys(SQUARES, "rad^2/s^2"),
            **{f"switch_{rotor}": "1" for rotor in ROTORS},
            "lyapunov": "m^2/s^2",
        },
        margins=_columns,
    )
).car_loop(0, 2, commands_thrusts=True)
"""The tilt-car with a planned direction of its thrusts (ch. 10, Sec. 5; ch. 11).

``switch_1`` and ``switch_2`` are ``p`` and ``q`` of ch. 11's switch matrix (Eqs. 22-24), 0 where a
rotor's thrust is saturated at zero; ``wanted_square_i`` is the demand without that limit.
"""
