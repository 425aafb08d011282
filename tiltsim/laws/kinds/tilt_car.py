"""The closed loops with the tilt-car, in MuJoCo and on the equations of ch. 10 (Eqs. 2 and 3).

Two laws integrate the rotor speeds and the command of the tilt servo; with the third, the tilt
follows a gait and the thrusts are commanded (ch. 10, Sec. 5; ch. 11).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Final

import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup, Sizes
from tiltsim.laws.law import Law, VehicleFunctions, parts, servo_lead
from tiltsim.scenario.scenario import FlightPlan, Scenario
from tiltsim.vehicles.tilt_car import ROTORS, TILT_CAR, initial_tilt
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.gaits.motion import planned_tilts
from tiltsim_controllers.laws.observed import Seen, Step
from tiltsim_controllers.mathematics.scalar import Floats, Vector
from tiltsim_controllers.references.trajectories import reference_motion
from tiltsim_controllers.tilt_car import laws
from tiltsim_controllers.tilt_car.vehicle import TiltCar, acceleration, counter_yaw_per_tilt

PLANE: Final = ("x", "y", "vx", "vy")  # position and velocity, m and m/s

DEMANDED: Final = ("demanded_x", "demanded_y")
"""Signals: the acceleration (m/s^2) whose direction the thrusts are to bracket."""


def initial_motion(scenario: Scenario) -> tuple[float, ...]:
    """Position (m) and velocity (m/s) on the plane at time zero."""
    return (*scenario.initial.position[:2], *scenario.initial.velocity[:2])


def yaw(alpha: Any, parameters: Any) -> Any:
    """Yaw (rad) at a tilt angle (rad); Eq. (2)."""
    return parameters.heading - counter_yaw_per_tilt(parameters.law.vehicle) * alpha


def motion_rates(motion: Any, direction: Any, squares: Any, car: TiltCar, disturbance: Any) -> Any:
    """Rates of position and velocity, shape (4,); Eq. (3).

    Args:
        motion: Position and velocity, m and m/s, shape (4,).
        direction: Direction of the thrusts' bisector, rad.
        squares: Squares of the rotor speeds, (rad/s)^2, shape (2,).
        car: The vehicle.
        disturbance: An acceleration unknown to the controller, m/s^2, world axes, shape (3,).
    """
    return xp.hstack([motion[2:4], acceleration(direction, squares, car) + disturbance[:2]])


class CarFunctions(VehicleFunctions):
    """The functions of a law's loop with a car; the law sees `STATE_FIELDS` of the car's module."""

    def discs(self, qpos: Any, qvel: Any) -> Any:
        """Position, velocity, and the angles of both discs with their rates, as in a sample."""
        (_, _, yaw, alpha), (_, _, r, alpha_rate) = qpos, qvel
        return xp.hstack([qpos[:2], qvel[:2], yaw, r, alpha, alpha_rate])

    def in_sample(self, time: Any, values: Any) -> Seen:
        """From the fields of a sample."""
        v = parts(
            values, motion=4, yaw=1, _r=1, alpha=1, _rate=1, speeds=2, states=len(self.law.states)
        )
        state = xp.hstack([v.motion, v.yaw, v.alpha, v.speeds])
        return Seen(time, state, states=v.states, recorded=True)

    state_names: ClassVar[Any] = PLANE
    input_names: ClassVar[Any] = ("squared_speed_1", "squared_speed_2")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns of `references`."""
        return ("x_ref", "y_ref", "vx_ref", "vy_ref", *(self.law.signals or ()))

    def references(self, time: Any, values: Any, parameters: Any, knots: Any) -> Any:
        """Position and velocity to track, then the law's signals."""
        motion = reference_motion(time, parameters.law.reference, knots)[:2, :2]
        signals = self.law.step(self.in_sample(time, values), parameters.law, knots).signals
        return xp.hstack([motion.ravel(), signals])

    def car_loop(self, states: int, inputs_size: int, commands_thrusts: bool) -> ClosedLoop:
        """The closed loop.

        Args:
            states: Number of activations for the law's states.
            inputs_size: Number of inputs of the equations.
            commands_thrusts: Whether the rotor speeds among the activations are idle.
        """
        law = self.law

        def activations(plan: FlightPlan, _setup: ControlSetup) -> Vector:
            speeds = plan.scenario.initial.rotor_speeds(2)
            return (*((0.0, 0.0) if commands_thrusts else speeds), *law.initial_states(plan))

        return self.closed_loop(
            TILT_CAR,
            {
                "servo_lead": lambda plan: servo_lead(plan.scenario.vehicle.tilt_servo),
                "heading": lambda plan: plan.scenario.initial.attitude[2],
            },
            inputs_size,
            tuple(f"law_speed_{rotor}" for rotor in ROTORS if states > 1),
            model="tilt_car",
            motion=(("x", "y", "yaw", "alpha"), ("vx", "vy", "r", "alpha_rate")),
            sizes=Sizes(qpos=4, qvel=4, act=2 + states, ctrl=5 + states),
            initial_activations=activations,
            controller_states=states,
            commands_thrusts=commands_thrusts,
            observe_reads_controls=commands_thrusts,
        )


def direction_columns(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
    """Directions of the thrusts and of the demanded acceleration, and the split of the inputs."""
    half_angle = setup.parameters.law.vehicle.half_angle
    direction = samples["yaw"] + samples["alpha"]
    demanded = np.arctan2(samples["demanded_y"], samples["demanded_x"])
    away = demanded - direction
    return {
        "direction": direction,
        "direction_lower": direction - half_angle,
        "direction_upper": direction + half_angle,
        "direction_ref": direction + np.arctan2(np.sin(away), np.cos(away)),
        "input_split": samples["rotor_speed_1"] ** 2 - samples["rotor_speed_2"] ** 2,
    }


# --- laws that integrate -----------------------------------------------------------------------


def _running(speeds: Any) -> Any:
    """Rotor speeds (rad/s), zero where an integrator's stage has passed below."""
    return xp.where(speeds < 0.0, 0.0, speeds)


def _limited_rates(speeds: Any, rates: Any) -> Any:
    """The rates (rad/s^2) of rotors that cannot turn backwards, from the demanded rates."""
    return xp.where((speeds <= 0.0) & (rates < 0.0), 0.0, rates)


@dataclass(frozen=True, eq=False)
class _Integrating(CarFunctions):
    """A law that integrates both rotor speeds and the servo's command.

    The controller's states are the command of the servo (rad) and, for the fourth derivative, its
    rate and the rotor accelerations, which the law also integrates. The state of the equations is
    position, velocity, tilt angle, rotor speeds and these.

    Attributes:
        twice: Whether the law integrates them twice, for the fourth derivative of the position.
    """

    twice: bool
    state_names: ClassVar[Any] = (*PLANE, "alpha", "rotor_speed_1", "rotor_speed_2")
    input_names: ClassVar[Any] = ("rotor_acceleration_1", "rotor_acceleration_2", "alpha_rate")

    def law_speeds(self, speeds: Any, parameters: Any) -> Any:
        """Rotor speeds as the law has them: below zero only without anti-windup."""
        if not self.twice:
            return _running(speeds)
        stops = (parameters.law.anti_windup == 1.0) & (speeds < 0.0)
        return xp.where(stops, 0.0, speeds)

    def controls(
        self, time: Any, qpos: Any, qvel: Any, act: Any, parameters: Any, knots: Any
    ) -> Any:
        """Tilt servo, thrusts, then the rates of rotor speeds and of the controller's states."""
        speeds, states = act[:2], act[2 : 2 + len(self.law.states)]
        state = [qpos[:2], qvel[:2], qpos[2:4], self.law_speeds(speeds, parameters)]
        step = self.law.step(Seen(time, xp.hstack(state), states=states), parameters.law, knots)
        servo = states[:1] + parameters.servo_lead * step.rates[:1]
        return xp.hstack([servo, _running(speeds) ** 2, step.inputs, step.rates])

    def hold(self, time: Any, qpos: Any, qvel: Any, act: Any, ctrl: Any, parameters: Any) -> Any:
        """Held inputs, with the present states that integrate them."""
        rates = xp.hstack([act[4:6], act[3:4]]) if self.twice else ctrl[3:6]
        return xp.hstack([ctrl[:1], _running(act[:2]) ** 2, rates, ctrl[6:]])

    def observe(self, qpos: Any, qvel: Any, act: Any, ctrl: Any) -> Any:
        states = act[2 : 2 + len(self.law.states)]
        return xp.hstack([self.discs(qpos, qvel), _running(act[:2]), states, act[: 2 * self.twice]])

    def in_equations(self, time: Any, state: Any, parameters: Any) -> Seen:
        """From a state of the equations."""
        s = parts(state, motion=4, alpha=1, speeds=2, further=len(self.law.states) - 1)
        speeds = self.law_speeds(s.speeds, parameters)
        seen = xp.hstack([s.motion, yaw(s.alpha, parameters), s.alpha, speeds])
        return Seen(time, seen, states=xp.hstack([s.alpha, s.further]))

    def initial_state(self, plan: FlightPlan) -> Vector:
        tilt, *further = self.law.initial_states(plan)
        speeds = plan.scenario.initial.rotor_speeds(2)
        return (*initial_motion(plan.scenario), tilt, *speeds, *further)

    def equation_inputs(self, time: Any, state: Any, parameters: Any, knots: Any) -> Any:
        """The highest derivatives of both rotor speeds and of the tilt."""
        step = self.law.step(self.in_equations(time, state, parameters), parameters.law, knots)
        if self.twice:
            return xp.hstack([step.rates[2:], step.rates[1:2]])
        return xp.hstack([step.inputs, step.rates])

    def equation_rates(
        self, time: Any, state: Any, inputs: Any, parameters: Any, knots: Any, disturbance: Any
    ) -> Any:
        """The thesis's equations with the inputs integrated."""
        direction, speeds = yaw(state[4], parameters) + state[4], state[5:7]
        squares = _running(speeds) ** 2
        motion = motion_rates(state[:4], direction, squares, parameters.law.vehicle, disturbance)
        if not self.twice:
            return xp.hstack([motion, inputs[2:3], _limited_rates(speeds, inputs[:2])])
        limited = _limited_rates(speeds, state[8:10])
        spinning = xp.where(parameters.law.anti_windup == 1.0, limited, state[8:10])
        return xp.hstack([motion, state[7:8], spinning, inputs[2:3], inputs[:2]])

    def observe_equations(
        self, time: Any, state: Any, inputs: Any, parameters: Any, knots: Any
    ) -> Any:
        seen = self.in_equations(time, state, parameters)
        v = parts(seen.state, motion=4, yaw=1, alpha=1, speeds=2)
        tilt_rate = seen.states[1:2] if self.twice else inputs[2:3]
        yaw_rate = -counter_yaw_per_tilt(parameters.law.vehicle) * tilt_rate
        sample = [v.motion, v.yaw, yaw_rate, v.alpha, tilt_rate, _running(v.speeds), seen.states]
        return xp.hstack([*sample, v.speeds[: 2 * self.twice]])


def _third(seen: Seen, p: Any, knots: Any) -> Step:
    found = laws.third_derivative_inputs(seen.time, seen.state, p)
    return Step(found[:2], found[2:], reference_motion(seen.time, p.reference)[2, :2])


def _fourth(seen: Seen, p: Any, knots: Any) -> Step:
    state = xp.hstack([seen.state, seen.states[1:]])
    _, tilt_rate, *accelerations = seen.states
    second = laws.fourth_derivative_inputs(seen.time, state, p)
    rates = xp.hstack([tilt_rate, second[2], second[:2]])
    demanded = reference_motion(seen.time, p.reference)[2, :2]
    return Step(xp.array(accelerations), rates, demanded)


def _integrating(
    step: Callable[[Seen, Any, Any], Step], record: Any, states: Mapping[str, str], *, twice: bool
) -> ClosedLoop:
    """The closed loop of a law with a record of parameters and states after the servo's command."""
    law = Law(
        step,
        record,
        states={"alpha_ref": "rad", **states},
        initial=lambda plan: (initial_tilt(plan)[0], *(0.0,) * len(states)),
        signals=DEMANDED,
        units=dict.fromkeys((f"law_speed_{rotor}" for rotor in ROTORS if twice), "rad/s"),
        uses_gait=False,
        margins=direction_columns,
        # Zero where the decoupling matrix loses rank.
        signs=lambda seen, _p, _knots: xp.array([seen.state[6] ** 2 + seen.state[7] ** 2]),
        causes=lambda *_: ("the decoupling matrix became singular: both rotors came to rest",),
    )
    return _Integrating(law, twice).car_loop(1 + len(states), 3, commands_thrusts=False)


# --- the law of a planned direction ----------------------------------------------------------


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
        return motion_rates(state, seen[4] + seen[5], inputs, parameters.law.vehicle, disturbance)

    def observe_equations(
        self, time: Any, state: Any, inputs: Any, parameters: Any, knots: Any
    ) -> Any:
        tilt, tilt_rate = _tilt(time, parameters.law, knots)
        yaw_rate = -counter_yaw_per_tilt(parameters.law.vehicle) * tilt_rate
        discs = xp.array([yaw(tilt, parameters), yaw_rate, tilt, tilt_rate])
        return xp.hstack([state[:4], discs, _speeds_of_squares(inputs)])


def _step(seen: Seen, p: Any, knots: Any) -> Step:
    time, state = seen.time, seen.state
    signals = [
        laws.demanded_acceleration(time, state, p),
        laws.demanded_squared_speeds(time, state, p),
        _tilt(time, p, knots)[:1],
    ]
    inputs = laws.planned_direction_inputs(time, state, p)
    return Step(inputs, signals=xp.hstack(signals))


def _columns(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
    """Directions, switches of the thrusts and the candidate of a Lyapunov function."""
    error: Any = samples["y_ref"] - samples["y"]
    error_rate: Any = samples["vy_ref"] - samples["vy"]
    gains = setup.parameters.law.gains
    lyapunov: Any = laws.lyapunov_candidate(error, error_rate, gains)
    switches = {
        f"switch_{rotor}": (samples[name] > 0.0).astype(float)
        for rotor, name in zip(ROTORS, SQUARES, strict=True)
    }
    return {**direction_columns(samples, setup), **switches, "lyapunov": lyapunov}


_PLANNED: Final = Law(
    _step,
    laws.PlannedParameters,
    signals=(*DEMANDED, *SQUARES, "alpha_ref"),
    units={
        **dict.fromkeys(SQUARES, "rad^2/s^2"),
        **{f"switch_{rotor}": "1" for rotor in ROTORS},
        "lyapunov": "m^2/s^2",
    },
    margins=_columns,
)

_DERIVATIVES: Final = {f"rotor_acceleration_{rotor}": "rad/s^2" for rotor in ROTORS}

LOOPS: Final = {
    "tilt_car_third_derivative": _integrating(_third, laws.ThirdParameters, {}, twice=False),
    "tilt_car_fourth_derivative": _integrating(
        _fourth, laws.FourthParameters, {"alpha_ref_rate": "rad/s", **_DERIVATIVES}, twice=True
    ),
    "tilt_car_planned_direction": _Planned(_PLANNED).car_loop(0, 2, commands_thrusts=True),
}
"""The loops by the names of their laws.

``law_speed_i`` are the rotor speeds that the law of the fourth derivative integrates; the true ones
are never below zero. ``switch_1`` and ``switch_2`` are ``p`` and ``q`` of ch. 11's switch matrix
(Eqs. 22-24), 0 where a rotor's thrust is saturated at zero; ``wanted_square_i`` is the demand
without that limit.
"""
