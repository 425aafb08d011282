"""Fourth-derivative feedback linearization of the tilt-car (ch. 10, Sec. 6.1)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

from tiltsim.closed_loop.loop import Columns, ControlSetup, Sampling
from tiltsim.equations.tilt_car import equations_of_motion, limited_rate, yaw_of
from tiltsim.laws.tilt_car import (
    car_setup,
    car_state,
    derive_columns,
    integrating_loop,
    running_speed,
    speed_squares,
)
from tiltsim.scenario.tilt_car_controllers import FourthDerivativeController
from tiltsim_controllers.mathematics.scalar import Triple, Values, Vector, scalar
from tiltsim_controllers.tilt_car.fourth_derivative import (
    DECOUPLINGS,
    Parameters,
    fourth_derivative_inputs,
)

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan

ACCELERATIONS: Final = ("rotor_acceleration_1", "rotor_acceleration_2")
SPEEDS: Final = ("law_speed_1", "law_speed_2")
"""The rotor speeds that the controller integrates; the true ones are never below zero."""


class LoopParameters(NamedTuple):
    """The head of `userdata`."""

    signature: float  # see `tiltsim.closed_loop.loop.ClosedLoop.signature`
    servo_lead: float  # s, rate feed-forward of the tilt servo, 2 zeta / omega_n
    heading: float  # rad, yaw at zero tilt, for the thesis's equations
    law: Parameters


@scalar
def law_speed(speed: float, anti_windup: float) -> float:
    """A rotor speed (rad/s) as the controller has it: below zero only without anti-windup."""
    return 0.0 if anti_windup == 1.0 and speed < 0.0 else speed


@scalar
def _fourth_derivative_controls(
    time: float, qpos: Vector, qvel: Vector, act: Vector, parameters: LoopParameters, knots: Vector
) -> Values:
    """All nine controls: tilt servo, thrusts, then the rates of rotor speeds and law states.

    The controller's states are the command of the servo, its rate, and the rotor accelerations.
    """
    tilt, tilt_rate, rate_1, rate_2 = act[2], act[3], act[4], act[5]
    speed_1 = law_speed(act[0], parameters.law.anti_windup)
    speed_2 = law_speed(act[1], parameters.law.anti_windup)
    x, y, yaw, alpha = qpos[0], qpos[1], qpos[2], qpos[3]
    state = (x, y, qvel[0], qvel[1], yaw, alpha, speed_1, speed_2, tilt_rate, rate_1, rate_2)
    second_1, second_2, second_tilt = fourth_derivative_inputs(time, state, parameters.law)
    servo, thrusts = tilt + parameters.servo_lead * tilt_rate, speed_squares(act)
    return (servo, *thrusts, rate_1, rate_2, tilt_rate, second_tilt, second_1, second_2)


@scalar
def _refreshed_fourth_derivative_controls(
    time: float, qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector, parameters: LoopParameters
) -> Values:
    """Held second derivatives, with the present states that integrate them."""
    return (ctrl[0], *speed_squares(act), *(act[4], act[5], act[3], ctrl[6], ctrl[7], ctrl[8]))


@scalar
def fourth_derivative_law_state(state: Vector, parameters: LoopParameters) -> Values:
    """State of the control law from that of the thesis's equations."""
    x, y, vx, vy, alpha = state[0], state[1], state[2], state[3], state[4]
    yaw = yaw_of(alpha, parameters.heading, parameters.law.car)
    speed_1 = law_speed(state[5], parameters.law.anti_windup)
    speed_2 = law_speed(state[6], parameters.law.anti_windup)
    return x, y, vx, vy, yaw, alpha, speed_1, speed_2, state[7], state[8], state[9]


@scalar
def _fourth_derivative_equation_inputs(
    time: float, state: Vector, parameters: LoopParameters, knots: Vector
) -> Triple:
    """The control law on the thesis's equations."""
    law_state = fourth_derivative_law_state(state, parameters)
    return fourth_derivative_inputs(time, law_state, parameters.law)


@scalar
def integrated_rate(speed: float, rate: float, anti_windup: float) -> float:
    """Rate (rad/s^2) of a rotor speed as the controller has it."""
    return limited_rate(speed, rate) if anti_windup == 1.0 else rate


@scalar
def _fourth_derivative_equation_rates(
    time: float,
    state: Vector,
    inputs: Triple,
    parameters: LoopParameters,
    knots: Vector,
    disturbance: Triple,
) -> Values:
    """The thesis's equations with the inputs integrated twice."""
    _, _, _, _, yaw, alpha, _, _, _, _, _ = fourth_derivative_law_state(state, parameters)
    law, (second_1, second_2, second_tilt) = parameters.law, inputs
    speed_1, speed_2 = running_speed(state[5]), running_speed(state[6])
    square_1, square_2 = speed_1 * speed_1, speed_2 * speed_2
    return (
        *equations_of_motion(state, yaw + alpha, square_1, square_2, law.car, disturbance),
        state[7],
        integrated_rate(state[5], state[8], law.anti_windup),
        integrated_rate(state[6], state[9], law.anti_windup),
        second_tilt,
        second_1,
        second_2,
    )


def _setup(plan: FlightPlan, signature: float) -> ControlSetup:
    controller = plan.scenario.controller
    assert isinstance(controller, FourthDerivativeController)
    law = Parameters(
        plan.scenario.tilt_car.resolve(),
        controller.resolve_gains(),
        plan.reference,
        DECOUPLINGS[controller.decoupling],
        float(controller.anti_windup),
    )
    return car_setup(LoopParameters, plan, signature, law=law)


@scalar
def _observe_fourth_derivative(qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector) -> Values:
    """The car and the controller's states."""
    x, y, vx, vy, yaw, alpha, speed_1, speed_2 = car_state(qpos, qvel, act[0], act[1])
    return (
        x, y, vx, vy, yaw, qvel[2], alpha, qvel[3], speed_1, speed_2,
        act[2], act[3], act[4], act[5], act[0], act[1],
    )  # fmt: skip


@scalar
def _observe_fourth_derivative_equations(
    time: float, state: Vector, inputs: Vector, parameters: LoopParameters, knots: Vector
) -> Values:
    """A sample of the thesis's equations."""
    law_state = fourth_derivative_law_state(state, parameters)
    x, y, vx, vy, yaw, alpha, speed_1, speed_2, tilt_rate, rate_1, rate_2 = law_state
    r = yaw_of(tilt_rate, 0.0, parameters.law.car)
    return (
        x, y, vx, vy, yaw, r, alpha, tilt_rate, running_speed(speed_1), running_speed(speed_2),
        alpha, tilt_rate, rate_1, rate_2, speed_1, speed_2,
    )  # fmt: skip


FOURTH_DERIVATIVE: Final = integrating_loop(
    LoopParameters,
    _setup,
    Sampling(_fourth_derivative_controls, _refreshed_fourth_derivative_controls),
    Columns(
        _observe_fourth_derivative,
        derive_columns,
        fields=("alpha_ref", "alpha_ref_rate", *ACCELERATIONS, *SPEEDS),
        units={
            "alpha_ref_rate": "rad/s",
            **dict.fromkeys(ACCELERATIONS, "rad/s^2"),
            **dict.fromkeys(SPEEDS, "rad/s"),
        },
    ),
    inputs=_fourth_derivative_equation_inputs,
    rates=_fourth_derivative_equation_rates,
    observe=_observe_fourth_derivative_equations,
    controller_states=4,
)
"""Fourth-derivative feedback linearization of the tilt-car."""
