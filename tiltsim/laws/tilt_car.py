"""The closed loops with the tilt-car, in MuJoCo and on the equations of ch. 10 (Eqs. 2 and 3).

Two laws integrate the rotor speeds and the command of the tilt servo; with the third, the tilt
follows a gait and the thrusts are commanded.
"""

from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple

import numpy as np

from tiltsim.closed_loop.loop import (
    ClosedLoop,
    Columns,
    ControlSetup,
    Dynamics,
    Equations,
    Monitoring,
    Sampling,
    Sizes,
)
from tiltsim.engines.sample_evaluation import evaluate_over_samples
from tiltsim.laws.parameters import head_of, parameters_of
from tiltsim.laws.rotorcraft import servo_lead
from tiltsim.scenario.scenario import FlightPlan, Scenario
from tiltsim.vehicles.tilt_car import ROTORS, SPEED_1, SPEED_2, TILT_CAR, initial_tilt
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.code.traceable import traceable
from tiltsim_controllers.mathematics.scalar import Floats, Vector
from tiltsim_controllers.references.trajectories import ReferenceParameters, reference_motion
from tiltsim_controllers.tilt_car import fourth_derivative, third_derivative
from tiltsim_controllers.tilt_car.vehicle import TiltCar, acceleration, counter_yaw_per_tilt


def car_record(law: Any, **own: type) -> Any:
    """The type of the head of `userdata`, around the parameters of a law.

    Args:
        law: Type of these parameters.
        own: Further fields.
    """
    # The lead (s) of the servo, and the yaw (rad) at zero tilt for the thesis's equations.
    return head_of(law, servo_lead=float, heading=float, **own)


def car_setup_of(law: Any, record: Any) -> Callable[[FlightPlan, float], ControlSetup]:
    """`ClosedLoop.setup` of a law.

    Args:
        law: Type of its parameters.
        record: `car_record`, whose further fields are the plan's.
    """

    def setup(plan: FlightPlan, signature: float) -> ControlSetup:
        car, heading = plan.scenario.tilt_car, plan.scenario.initial.attitude[2]
        own = parameters_of(plan, law, car=car.resolve())
        gait = {"gait": plan.gait.parameters} if "gait" in record._fields else {}
        lead = servo_lead(car.tilt_servo)
        known = record(signature=signature, servo_lead=lead, heading=heading, law=own, **gait)
        return ControlSetup(known, plan.knots)

    return setup


def initial_motion(scenario: Scenario) -> tuple[float, ...]:
    """Position (m) and velocity (m/s) on the plane at time zero."""
    return (*scenario.initial.position[:2], *scenario.initial.velocity[:2])


# --- equations of motion -----------------------------------------------------------------------


def yaw(alpha: Any, parameters: Any) -> Any:
    """Yaw (rad) at a tilt angle (rad); Eq. (2)."""
    return parameters.heading - counter_yaw_per_tilt(parameters.law.car) * alpha


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


def _running(speeds: Any) -> Any:
    """Rotor speeds (rad/s), zero where an integrator's stage has passed below."""
    return xp.where(speeds < 0.0, 0.0, speeds)


def _limited_rates(speeds: Any, rates: Any) -> Any:
    """The rates (rad/s^2) of rotors that cannot turn backwards, from the demanded rates."""
    return xp.where((speeds <= 0.0) & (rates < 0.0), 0.0, rates)


# --- columns -----------------------------------------------------------------------------------

REFERENCE_COLUMNS: Final = ("x_ref", "y_ref", "vx_ref", "vy_ref")


@traceable
def _reference_values(time: Any, state: Any, reference: ReferenceParameters, knots: Any) -> Any:
    """Position, velocity and acceleration of the reference along x and y."""
    return reference_motion(time, reference)[:3, :2].ravel()


def reference_columns(samples: Mapping[str, Floats], reference: ReferenceParameters) -> Floats:
    """`_reference_values` at the samples' times, shape (6, N)."""
    time, setup = samples["time"], ControlSetup(reference)
    return evaluate_over_samples(_reference_values, 6, time, np.empty((len(time), 0)), setup).T


def derived_columns(
    samples: Mapping[str, Floats], reference: Floats, demanded: Floats, car: TiltCar
) -> dict[str, Floats]:
    """Reference, directions and the split of the inputs.

    Args:
        samples: By field.
        reference: `reference_columns`.
        demanded: Acceleration along x and y, whose direction the thrusts are to bracket, (2, N).
        car: The vehicle.
    """
    direction = samples["yaw"] + samples["alpha"]
    away = np.arctan2(demanded[1], demanded[0]) - direction
    return {
        **dict(zip(REFERENCE_COLUMNS, reference[:4], strict=True)),
        "direction": direction,
        "direction_lower": direction - car.half_angle,
        "direction_upper": direction + car.half_angle,
        "direction_ref": direction + np.arctan2(np.sin(away), np.cos(away)),
        "input_split": samples["rotor_speed_1"] ** 2 - samples["rotor_speed_2"] ** 2,
    }


def _derive(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
    """See `Columns`; the thrusts are to bracket the reference's acceleration."""
    law = setup.parameters.law
    reference = reference_columns(samples, law.reference)
    return derived_columns(samples, reference, reference[4:6], law.car)


# --- laws that integrate -----------------------------------------------------------------------

AT_REST: Final = "the decoupling matrix became singular: both rotors came to rest"


@traceable
def _sum_of_squared_speeds(time: Any, values: Any, parameters: Any, knots: Any) -> Any:
    """Zero where the decoupling matrix loses rank."""
    return xp.array([values[SPEED_1] ** 2 + values[SPEED_2] ** 2])


class _Integrating(NamedTuple):
    """A loop whose law integrates both rotor speeds and the servo's command.

    The controller's states are the command of the servo (rad) and, for the fourth derivative, its
    rate and the rotor accelerations, which the law also integrates. The state of the equations is
    position, velocity, tilt angle, rotor speeds and these.

    Attributes:
        law: ``(time, state, parameters)``: derivatives of both rotor speeds and of the tilt.
        twice: Whether the law integrates them twice, for the fourth derivative of the position.
    """

    law: Callable[..., Any]
    twice: bool

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
        own = [act[3:4], act[4:6]] if self.twice else []
        speeds = self.law_speeds(act[:2], parameters)
        seen = xp.hstack([qpos[:2], qvel[:2], qpos[2:4], speeds, *own])
        inputs = self.law(time, seen, parameters.law)
        rates = xp.array([act[4], act[5], act[3]]) if self.twice else inputs
        servo = act[2] + parameters.servo_lead * rates[2]
        tail = [inputs[2:3], inputs[:2]] if self.twice else []
        return xp.hstack([xp.array([servo]), _running(act[:2]) ** 2, rates, *tail])

    def hold(self, time: Any, qpos: Any, qvel: Any, act: Any, ctrl: Any, parameters: Any) -> Any:
        """Held inputs, with the present states that integrate them."""
        rates = xp.array([act[4], act[5], act[3]]) if self.twice else ctrl[3:6]
        return xp.hstack([ctrl[:1], _running(act[:2]) ** 2, rates, ctrl[6:]])

    def observe(self, qpos: Any, qvel: Any, act: Any, ctrl: Any) -> Any:
        """A sample in MuJoCo."""
        disc = [qpos[:2], qvel[:2], qpos[2:3], qvel[2:3], qpos[3:4], qvel[3:4]]
        return xp.hstack([*disc, _running(act[:2]), act[2:], act[: 2 * self.twice]])

    def law_state(self, state: Any, parameters: Any) -> Any:
        """State of the law from the state of the equations."""
        angles = xp.array([yaw(state[4], parameters), state[4]])
        speeds = self.law_speeds(state[5:7], parameters)
        return xp.hstack([state[:4], angles, speeds, state[7:]])

    def inputs(self, time: Any, state: Any, parameters: Any, knots: Any) -> Any:
        """The law on the equations."""
        return self.law(time, self.law_state(state, parameters), parameters.law)

    def rates(
        self, time: Any, state: Any, inputs: Any, parameters: Any, knots: Any, disturbance: Any
    ) -> Any:
        """The thesis's equations with the inputs integrated."""
        direction, speeds = yaw(state[4], parameters) + state[4], state[5:7]
        squares = _running(speeds) ** 2
        motion = motion_rates(state[:4], direction, squares, parameters.law.car, disturbance)
        if not self.twice:
            return xp.hstack([motion, inputs[2:3], _limited_rates(speeds, inputs[:2])])
        limited = _limited_rates(speeds, state[8:10])
        spinning = xp.where(parameters.law.anti_windup == 1.0, limited, state[8:10])
        return xp.hstack([motion, state[7:8], spinning, inputs[2:3], inputs[:2]])

    def observe_equations(
        self, time: Any, state: Any, inputs: Any, parameters: Any, knots: Any
    ) -> Any:
        """A sample on the equations."""
        seen = self.law_state(state, parameters)
        tilt_rate = state[7] if self.twice else inputs[2]
        yaw_rate = -counter_yaw_per_tilt(parameters.law.car) * tilt_rate
        discs = xp.array([seen[4], yaw_rate, seen[5], tilt_rate])
        own = [state[4:5], state[7:], seen[6:8]] if self.twice else [state[4:5]]
        return xp.hstack([state[:4], discs, _running(seen[6:8]), *own])

    def loop(self, parameters: Any, units: Mapping[str, str]) -> ClosedLoop:
        """The closed loop.

        Args:
            parameters: Type of the law's parameters.
            units: Columns of the controller's states after the servo's command, with their units.
        """
        record, states = car_record(parameters), 4 if self.twice else 1
        further = (0.0,) * (states - 1)

        def initial(plan: FlightPlan, *, equations: bool) -> Vector:
            speeds, tilt = plan.scenario.initial.rotor_speeds(2), initial_tilt(plan)[0]
            if equations:
                return (*initial_motion(plan.scenario), tilt, *speeds, *further)
            return (*speeds, tilt, *further)

        return ClosedLoop(
            kind=TILT_CAR,
            parameters=record,
            setup=car_setup_of(parameters, record),
            dynamics=Dynamics(
                "tilt_car",
                Sizes(qpos=4, qvel=4, act=2 + states, ctrl=5 + states),
                lambda plan, _setup: initial(plan, equations=False),
                states,
            ),
            sampling=Sampling(traceable(self.controls), traceable(self.hold)),
            columns=Columns(
                traceable(self.observe), _derive, fields=("alpha_ref", *units), units=units
            ),
            monitoring=Monitoring(_sum_of_squared_speeds, lambda _sample, _setup: (AT_REST,)),
            equations=Equations(
                inputs=traceable(self.inputs),
                inputs_size=3,
                rates=traceable(self.rates),
                initial=lambda plan, _setup: initial(plan, equations=True),
                observe=traceable(self.observe_equations),
            ),
            uses_gait=False,
        )


THIRD_DERIVATIVE: Final = _Integrating(third_derivative.third_derivative_inputs, twice=False).loop(
    third_derivative.Parameters, {}
)
"""Third-derivative feedback linearization of the tilt-car (ch. 10, Sec. 3.1)."""

FOURTH_DERIVATIVE: Final = _Integrating(
    fourth_derivative.fourth_derivative_inputs, twice=True
).loop(
    fourth_derivative.Parameters,
    {
        "alpha_ref_rate": "rad/s",
        **{f"rotor_acceleration_{rotor}": "rad/s^2" for rotor in ROTORS},
        **{f"law_speed_{rotor}": "rad/s" for rotor in ROTORS},
    },
)
"""Fourth-derivative feedback linearization of the tilt-car (ch. 10, Sec. 6.1).

``law_speed_i`` are the rotor speeds that the controller integrates; the true ones are never below
zero.
"""
