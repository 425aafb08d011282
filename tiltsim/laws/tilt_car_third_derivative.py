"""Third-derivative feedback linearization of the tilt-car (ch. 10, Sec. 3.1)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

from tiltsim.closed_loop.loop import Columns, ControlSetup, Sampling
from tiltsim.equations.tilt_car import equations_of_motion, limited_rate, yaw_of
from tiltsim.laws.tilt_car import (
    CarState,
    car_setup,
    car_state,
    derive_columns,
    integrating_loop,
    running_speed,
    speed_squares,
)
from tiltsim.scenario.tilt_car_controllers import ThirdDerivativeController
from tiltsim_controllers.mathematics.scalar import Triple, Values, Vector, scalar
from tiltsim_controllers.tilt_car.third_derivative import Parameters, third_derivative_inputs

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan


class LoopParameters(NamedTuple):
    """The head of `userdata`."""

    signature: float  # see `tiltsim.closed_loop.loop.ClosedLoop.signature`
    servo_lead: float  # s, rate feed-forward of the tilt servo, 2 zeta / omega_n
    heading: float  # rad, yaw at zero tilt, for the thesis's equations
    law: Parameters


@scalar
def _third_derivative_controls(
    time: float, qpos: Vector, qvel: Vector, act: Vector, parameters: LoopParameters, knots: Vector
) -> Values:
    """All six controls: tilt servo, thrusts, rotor accelerations, tilt rate.

    The controller's state integrates the tilt rate to the command of the servo.
    """
    state = car_state(qpos, qvel, act[0], act[1])
    rate_1, rate_2, tilt_rate = third_derivative_inputs(time, state, parameters.law)
    servo = act[2] + parameters.servo_lead * tilt_rate
    return (servo, *speed_squares(act), rate_1, rate_2, tilt_rate)


@scalar
def _refreshed_third_derivative_controls(
    time: float, qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector, parameters: LoopParameters
) -> Values:
    """Held controls with the thrusts of the present rotor speeds."""
    return (ctrl[0], *speed_squares(act), ctrl[3], ctrl[4], ctrl[5])


@scalar
def third_derivative_law_state(state: Vector, parameters: LoopParameters) -> CarState:
    """State of the control law from that of the thesis's equations."""
    x, y, vx, vy, alpha = state[0], state[1], state[2], state[3], state[4]
    yaw = yaw_of(alpha, parameters.heading, parameters.law.car)
    return x, y, vx, vy, yaw, alpha, running_speed(state[5]), running_speed(state[6])


@scalar
def _third_derivative_equation_inputs(
    time: float, state: Vector, parameters: LoopParameters, knots: Vector
) -> Triple:
    """Rotor accelerations and tilt rate on the thesis's equations."""
    law_state = third_derivative_law_state(state, parameters)
    return third_derivative_inputs(time, law_state, parameters.law)


@scalar
def _third_derivative_equation_rates(
    time: float,
    state: Vector,
    inputs: Triple,
    parameters: LoopParameters,
    knots: Vector,
    disturbance: Triple,
) -> Values:
    """The thesis's equations with the inputs integrated."""
    _, _, _, _, yaw, alpha, speed_1, speed_2 = third_derivative_law_state(state, parameters)
    square_1, square_2, car = speed_1 * speed_1, speed_2 * speed_2, parameters.law.car
    rate_1, rate_2, tilt_rate = inputs
    motion = equations_of_motion(state, yaw + alpha, square_1, square_2, car, disturbance)
    return (*motion, tilt_rate, limited_rate(state[5], rate_1), limited_rate(state[6], rate_2))


def _setup(plan: FlightPlan, signature: float) -> ControlSetup:
    controller = plan.scenario.controller
    assert isinstance(controller, ThirdDerivativeController)
    law = Parameters(
        plan.scenario.tilt_car.resolve(),
        controller.resolve_gains(),
        plan.reference,
        controller.restoring_rate,
    )
    return car_setup(LoopParameters, plan, signature, law=law)


@scalar
def _observe_third_derivative(qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector) -> Values:
    """The car and the command of its servo."""
    x, y, vx, vy, yaw, alpha, speed_1, speed_2 = car_state(qpos, qvel, act[0], act[1])
    return x, y, vx, vy, yaw, qvel[2], alpha, qvel[3], speed_1, speed_2, act[2]


@scalar
def _observe_third_derivative_equations(
    time: float, state: Vector, inputs: Triple, parameters: LoopParameters, knots: Vector
) -> Values:
    """A sample of the thesis's equations."""
    x, y, vx, vy, yaw, alpha, speed_1, speed_2 = third_derivative_law_state(state, parameters)
    tilt_rate = inputs[2]
    r = yaw_of(tilt_rate, 0.0, parameters.law.car)
    return x, y, vx, vy, yaw, r, alpha, tilt_rate, speed_1, speed_2, alpha


THIRD_DERIVATIVE: Final = integrating_loop(
    LoopParameters,
    _setup,
    Sampling(_third_derivative_controls, _refreshed_third_derivative_controls),
    Columns(_observe_third_derivative, derive_columns, fields=("alpha_ref",)),
    inputs=_third_derivative_equation_inputs,
    rates=_third_derivative_equation_rates,
    observe=_observe_third_derivative_equations,
    controller_states=1,
)
"""Third-derivative feedback linearization of the tilt-car."""
