"""The tilt-car with a planned direction of its thrusts (ch. 10, Sec. 5; ch. 11)."""

from __future__ import annotations

from collections.abc import Mapping
from math import nan, sqrt
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from tiltsim.closed_loop.loop import (
    ClosedLoop,
    Columns,
    ControlSetup,
    Dynamics,
    Equations,
    Sampling,
    Sizes,
)
from tiltsim.engines.sample_evaluation import evaluate_over_samples
from tiltsim.equations.tilt_car import equations_of_motion, yaw_of
from tiltsim.laws.tilt_car import (
    CarState,
    car_setup,
    car_state,
    derived_columns,
    initial_motion,
    reference_columns,
)
from tiltsim.laws.tiltrotor import four
from tiltsim.scenario.tilt_car_controllers import PlannedDirectionController
from tiltsim.vehicles.tilt_car import ROTORS, TILT_CAR
from tiltsim_controllers.gaits.parameters import GaitParameters
from tiltsim_controllers.gaits.tilts import tilt_reference
from tiltsim_controllers.mathematics.scalar import Floats, Pair, Triple, Values, Vector, scalar
from tiltsim_controllers.tilt_car.planned_direction import (
    Parameters,
    demanded_acceleration,
    demanded_squared_speeds,
    lyapunov_candidate,
    planned_direction_inputs,
)

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan


class LoopParameters(NamedTuple):
    """The head of `userdata`."""

    signature: float  # see `tiltsim.closed_loop.loop.ClosedLoop.signature`
    servo_lead: float  # s, rate feed-forward of the tilt servo, 2 zeta / omega_n
    heading: float  # rad, yaw at zero tilt, for the thesis's equations
    gait: GaitParameters
    law: Parameters


@scalar
def _planned_direction_controls(
    time: float, qpos: Vector, qvel: Vector, act: Vector, parameters: LoopParameters, knots: Vector
) -> Values:
    """All five controls: tilt servo, thrusts, idle rotor states.

    The control law reads the true direction of the thrusts, which lags behind the gait's steps.
    """
    tilt, _, _, _, tilt_rate, _, _, _ = tilt_reference(time, parameters.gait, knots)
    state = car_state(qpos, qvel, 0.0, 0.0)
    square_1, square_2 = planned_direction_inputs(time, state, parameters.law)
    return tilt + parameters.servo_lead * tilt_rate, square_1, square_2, 0.0, 0.0


@scalar
def _planned_direction_law_state(
    time: float, state: Vector, parameters: LoopParameters, knots: Vector
) -> CarState:
    """State of the control law from that of the thesis's equations, with the planned tilt."""
    alpha, _, _, _, _, _, _, _ = tilt_reference(time, parameters.gait, knots)
    yaw = yaw_of(alpha, parameters.heading, parameters.law.car)
    return state[0], state[1], state[2], state[3], yaw, alpha, 0.0, 0.0


@scalar
def _planned_direction_equation_inputs(
    time: float, state: Vector, parameters: LoopParameters, knots: Vector
) -> Pair:
    """The squares of the rotor speeds on the thesis's equations."""
    law_state = _planned_direction_law_state(time, state, parameters, knots)
    return planned_direction_inputs(time, law_state, parameters.law)


@scalar
def _planned_direction_equation_rates(
    time: float,
    state: Vector,
    inputs: Pair,
    parameters: LoopParameters,
    knots: Vector,
    disturbance: Triple,
) -> Values:
    """The thesis's equations with a tilt that follows the gait exactly."""
    law_state = _planned_direction_law_state(time, state, parameters, knots)
    direction = law_state[4] + law_state[5]
    car = parameters.law.car
    return equations_of_motion(state, direction, inputs[0], inputs[1], car, disturbance)


def _setup(plan: FlightPlan, signature: float) -> ControlSetup:
    controller = plan.scenario.controller
    assert isinstance(controller, PlannedDirectionController)
    car = plan.scenario.tilt_car.resolve()
    gait = plan.gait.parameters
    law = Parameters(car, controller.resolve_gains(), plan.reference)
    return car_setup(LoopParameters, plan, signature, gait=gait, law=law)


@scalar
def speed_of_square(square: float) -> float:
    """The rotor speed (rad/s) of a control; NaN of a negative one or of NaN."""
    return sqrt(square) if square >= 0.0 else nan


@scalar
def _observe_planned_direction(qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector) -> Values:
    """The car, its rotor speeds from the controls in force."""
    x, y, vx, vy, yaw, alpha, _, _ = car_state(qpos, qvel, 0.0, 0.0)
    speed_1, speed_2 = speed_of_square(ctrl[1]), speed_of_square(ctrl[2])
    return x, y, vx, vy, yaw, qvel[2], alpha, qvel[3], speed_1, speed_2


@scalar
def _observe_planned_direction_equations(
    time: float, state: Vector, inputs: Vector, parameters: LoopParameters, knots: Vector
) -> Values:
    """A sample of the thesis's equations."""
    x, y, vx, vy, yaw, alpha, _, _ = _planned_direction_law_state(time, state, parameters, knots)
    tilt_rate = tilt_reference(time, parameters.gait, knots)[4]
    r = yaw_of(tilt_rate, 0.0, parameters.law.car)
    speed_1, speed_2 = speed_of_square(inputs[0]), speed_of_square(inputs[1])
    return x, y, vx, vy, yaw, r, alpha, tilt_rate, speed_1, speed_2


@scalar
def _demanded(time: float, state: Vector, parameters: LoopParameters, knots: Vector) -> Values:
    """Acceleration (m/s^2), squares of the rotor speeds (rad^2/s^2) and tilt (rad)."""
    seen = four(state, 0) + four(state, 4)
    ax, ay = demanded_acceleration(time, seen, parameters.law)
    square_1, square_2 = demanded_squared_speeds(time, seen, parameters.law)
    return ax, ay, square_1, square_2, tilt_reference(time, parameters.gait, knots)[0]


def _derive(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
    law = setup.parameters.law
    names = ("x", "y", "vx", "vy", "yaw", "alpha", "rotor_speed_1", "rotor_speed_2")
    states = np.stack([samples[name] for name in names], axis=-1)
    demanded = evaluate_over_samples(_demanded, 5, samples["time"], states, setup).T
    reference = reference_columns(samples, law.reference)
    acceleration = demanded[0], demanded[1]
    columns = derived_columns(samples, reference, acceleration, law.car)
    columns["alpha_ref"] = demanded[4]
    for rotor, values in zip(ROTORS, demanded[2:4], strict=True):
        columns[f"wanted_square_{rotor}"] = values
        columns[f"switch_{rotor}"] = (values > 0.0).astype(float)
    error_y: Any = columns["y_ref"] - samples["y"]
    error_rate_y: Any = columns["vy_ref"] - samples["vy"]
    lyapunov: Any = lyapunov_candidate(error_y, error_rate_y, law.gains)
    return columns | {"lyapunov": lyapunov}


PLANNED_DIRECTION: Final = ClosedLoop(
    kind=TILT_CAR,
    parameters=LoopParameters,
    setup=_setup,
    dynamics=Dynamics(
        "tilt_car",
        Sizes(qpos=4, qvel=4, act=2, ctrl=5),
        lambda _plan, _setup: (0.0, 0.0),
        commands_thrusts=True,
    ),
    sampling=Sampling(_planned_direction_controls),
    columns=Columns(
        _observe_planned_direction,
        _derive,
        units={
            **{f"wanted_square_{rotor}": "rad^2/s^2" for rotor in ROTORS},
            **{f"switch_{rotor}": "1" for rotor in ROTORS},
            "lyapunov": "m^2/s^2",
        },
        observe_reads_controls=True,
    ),
    equations=Equations(
        inputs=_planned_direction_equation_inputs,
        inputs_size=2,
        rates=_planned_direction_equation_rates,
        initial=lambda plan, _setup: initial_motion(plan.scenario),
        observe=_observe_planned_direction_equations,
    ),
)
"""The tilt-car with a planned direction of its thrusts.

``switch_1`` and ``switch_2`` are ``p`` and ``q`` of ch. 11's switch matrix (Eqs. 22-24), 0 where a
rotor's thrust is saturated at zero; ``wanted_square_i`` is the demand without that limit.
"""
