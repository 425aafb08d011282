"""Common parts of the closed loops with the tilt-car."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Final

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
from tiltsim.laws.rotorcraft import servo_lead
from tiltsim.vehicles.tilt_car import SPEED_1, SPEED_2, TILT_CAR, initial_tilt
from tiltsim_controllers.mathematics.scalar import Floats, Pair, Values, Vector, scalar
from tiltsim_controllers.references.trajectories import ReferenceParameters, reference_derivatives
from tiltsim_controllers.tilt_car.vehicle import TiltCar

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan, Scenario

CarState = tuple[float, float, float, float, float, float, float, float]

REFERENCE_COLUMNS: Final = ("x_ref", "y_ref", "vx_ref", "vy_ref")


@scalar
def running_speed(speed: float) -> float:
    """A rotor speed (rad/s), zero where an integrator's stage has passed below."""
    return 0.0 if speed < 0.0 else speed


@scalar
def car_state(qpos: Vector, qvel: Vector, speed_1: float, speed_2: float) -> CarState:
    """State of the control laws.

    Args:
        qpos, qvel: MuJoCo's state
        speed_1, speed_2: rotor speeds, rad/s
    """
    x, y, yaw, alpha = qpos[0], qpos[1], qpos[2], qpos[3]
    return x, y, qvel[0], qvel[1], yaw, alpha, running_speed(speed_1), running_speed(speed_2)


@scalar
def speed_squares(act: Vector) -> Pair:
    """Controls of the thrust actuators, the squares of the rotor speeds."""
    speed_1, speed_2 = running_speed(act[0]), running_speed(act[1])
    return speed_1 * speed_1, speed_2 * speed_2


@scalar
def _reference_values(
    time: float, state: Vector, reference: ReferenceParameters, knots: Vector
) -> Values:
    """`reference_derivatives`; the references of the tilt-car have no knots."""
    return reference_derivatives(time, reference)


def reference_columns(samples: Mapping[str, Floats], reference: ReferenceParameters) -> Floats:
    """The reference and its derivatives at the samples' times, shape (15, N)."""
    time, setup = samples["time"], ControlSetup(reference)
    return evaluate_over_samples(_reference_values, 15, time, np.empty((len(time), 0)), setup).T


def derived_columns(
    samples: Mapping[str, Floats],
    reference: Floats,
    acceleration: tuple[Floats, Floats],
    car: TiltCar,
) -> dict[str, Floats]:
    """Reference, directions and the split of the inputs.

    Args:
        samples: By field.
        reference: `reference_columns`.
        acceleration: Along x and y: the thrusts are to bracket its direction.
        car: The vehicle.
    """
    direction = samples["yaw"] + samples["alpha"]
    away = np.arctan2(acceleration[1], acceleration[0]) - direction
    return {
        **dict(zip(REFERENCE_COLUMNS, reference[[0, 1, 3, 4]], strict=True)),
        "direction": direction,
        "direction_lower": direction - car.half_angle,
        "direction_upper": direction + car.half_angle,
        "direction_ref": direction + np.arctan2(np.sin(away), np.cos(away)),
        "input_split": samples["rotor_speed_1"] ** 2 - samples["rotor_speed_2"] ** 2,
    }


ROTORS_AT_REST: Final = "the decoupling matrix became singular: both rotors came to rest"


@scalar
def sum_of_squared_speeds(
    time: float, values: Vector, parameters: object, knots: Vector
) -> tuple[float]:
    """Zero where the decoupling matrix loses rank."""
    return (values[SPEED_1] * values[SPEED_1] + values[SPEED_2] * values[SPEED_2],)


def initial_motion(scenario: Scenario) -> tuple[float, float, float, float]:
    """Position (m) and velocity (m/s) on the plane at time zero."""
    x, y, _ = scenario.initial.position
    vx, vy, _ = scenario.initial.velocity
    return x, y, vx, vy


def car_setup(
    parameters: Callable[..., Any], plan: FlightPlan, signature: float, **own: Any
) -> ControlSetup:
    """The fields of every such loop's record, and its ``own`` by name."""
    lead = servo_lead(plan.scenario.tilt_car.tilt_servo)
    heading = float(plan.scenario.initial.attitude[2])
    return ControlSetup(parameters(signature, servo_lead=lead, heading=heading, **own))


def integrating_loop(
    parameters: type[tuple[Any, ...]],
    setup: Callable[[FlightPlan, float], ControlSetup],
    sampling: Sampling,
    columns: Columns,
    *,
    inputs: Callable[..., Values],
    rates: Callable[..., Values],
    observe: Callable[..., Values],
    controller_states: int,
) -> ClosedLoop:
    """A closed loop whose control law integrates both rotor speeds and the servo's command.

    Args:
        parameters, setup, sampling, columns: As in `tiltsim.closed_loop.loop.ClosedLoop`.
        inputs, rates, observe: As in `tiltsim.closed_loop.loop.Equations`; the state is position,
            velocity, tilt angle, rotor speeds and the further states of the controller.
        controller_states: How many there are, the servo's command (rad) the first; the others start
            at zero.
    """
    further = (0.0,) * (controller_states - 1)
    return ClosedLoop(
        kind=TILT_CAR,
        parameters=parameters,
        setup=setup,
        dynamics=Dynamics(
            "tilt_car",
            Sizes(qpos=4, qvel=4, act=2 + controller_states, ctrl=5 + controller_states),
            lambda plan, _setup: (
                *plan.scenario.initial.rotor_speeds(2),
                initial_tilt(plan)[0],
                *further,
            ),
            controller_states,
        ),
        sampling=sampling,
        columns=columns,
        monitoring=Monitoring(sum_of_squared_speeds, lambda _sample, _setup: (ROTORS_AT_REST,)),
        equations=Equations(
            inputs=inputs,
            inputs_size=3,
            rates=rates,
            initial=lambda plan, _setup: (
                *initial_motion(plan.scenario),
                initial_tilt(plan)[0],
                *plan.scenario.initial.rotor_speeds(2),
                *further,
            ),
            observe=observe,
        ),
        uses_gait=False,
    )


def derive_columns(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
    """See `tiltsim.closed_loop.loop.Columns`; the thrusts are to bracket the reference."""
    law = setup.parameters.law
    reference = reference_columns(samples, law.reference)
    return derived_columns(samples, reference, (reference[6], reference[7]), law.car)
