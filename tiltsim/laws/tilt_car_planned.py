"""The tilt-car with a planned direction of its thrusts (ch. 10, Sec. 5; ch. 11)."""

from collections.abc import Mapping
from typing import Any, Final

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
from tiltsim.laws.tilt_car import (
    car_record,
    car_setup_of,
    derived_columns,
    initial_motion,
    motion_rates,
    reference_columns,
    yaw,
)
from tiltsim.vehicles.tilt_car import ROTORS, TILT_CAR
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.code.traceable import traceable
from tiltsim_controllers.gaits.motion import planned_tilts
from tiltsim_controllers.gaits.parameters import GaitParameters
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.tilt_car import planned_direction
from tiltsim_controllers.tilt_car.vehicle import counter_yaw_per_tilt

PARAMETERS: Final = car_record(planned_direction.Parameters, gait=GaitParameters)


def _tilt(time: Any, parameters: Any, knots: Any) -> Any:
    """The planned tilt angle with its rate, rad and rad/s, shape (2,)."""
    return planned_tilts(time, parameters.gait, knots, 1)[0][:2]


@traceable
def _planned_controls(
    time: Any, qpos: Any, qvel: Any, act: Any, parameters: Any, knots: Any
) -> Any:
    """Tilt servo, thrusts, idle rotor states.

    The law reads the true direction of the thrusts, which lags behind the gait's steps.
    """
    tilt, tilt_rate = _tilt(time, parameters, knots)
    seen = xp.hstack([qpos[:2], qvel[:2], qpos[2:4]])
    squares = planned_direction.planned_direction_inputs(time, seen, parameters.law)
    servo = xp.array([tilt + parameters.servo_lead * tilt_rate])
    return xp.hstack([servo, squares, xp.zeros(2)])


def _planned_state(time: Any, state: Any, parameters: Any, knots: Any) -> Any:
    """State of the law from the state of the equations, with the planned tilt."""
    tilt = _tilt(time, parameters, knots)[0]
    return xp.hstack([state[:4], xp.array([yaw(tilt, parameters), tilt])])


@traceable
def _planned_inputs(time: Any, state: Any, parameters: Any, knots: Any) -> Any:
    """The squares of the rotor speeds on the thesis's equations."""
    seen = _planned_state(time, state, parameters, knots)
    return planned_direction.planned_direction_inputs(time, seen, parameters.law)


@traceable
def _planned_rates(
    time: Any, state: Any, inputs: Any, parameters: Any, knots: Any, disturbance: Any
) -> Any:
    """The thesis's equations with a tilt that follows the gait exactly."""
    seen = _planned_state(time, state, parameters, knots)
    return motion_rates(state, seen[4] + seen[5], inputs, parameters.law.car, disturbance)


def _speeds_of_squares(squares: Any) -> Any:
    """The rotor speeds (rad/s) of controls; NaN for a negative one or NaN."""
    return xp.where(squares >= 0.0, xp.sqrt(xp.where(squares >= 0.0, squares, 0.0)), xp.nan)


@traceable
def _observe_planned(qpos: Any, qvel: Any, act: Any, ctrl: Any) -> Any:
    """The car, its rotor speeds from the controls in force."""
    disc = [qpos[:2], qvel[:2], qpos[2:3], qvel[2:3], qpos[3:4], qvel[3:4]]
    return xp.hstack([*disc, _speeds_of_squares(ctrl[1:3])])


@traceable
def _observe_planned_equations(
    time: Any, state: Any, inputs: Any, parameters: Any, knots: Any
) -> Any:
    tilt, tilt_rate = _tilt(time, parameters, knots)
    yaw_rate = -counter_yaw_per_tilt(parameters.law.car) * tilt_rate
    discs = xp.array([yaw(tilt, parameters), yaw_rate, tilt, tilt_rate])
    return xp.hstack([state[:4], discs, _speeds_of_squares(inputs)])


@traceable
def _demanded(time: Any, state: Any, parameters: Any, knots: Any) -> Any:
    """Acceleration (m/s^2), squares of the rotor speeds (rad^2/s^2) and tilt (rad)."""
    acceleration = planned_direction.demanded_acceleration(time, state, parameters.law)
    squares = planned_direction.demanded_squared_speeds(time, state, parameters.law)
    return xp.hstack([acceleration, squares, _tilt(time, parameters, knots)[:1]])


def _derive_planned(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
    law = setup.parameters.law
    states = np.stack([samples[n] for n in ("x", "y", "vx", "vy", "yaw", "alpha")], axis=-1)
    demanded = evaluate_over_samples(_demanded, 5, samples["time"], states, setup).T
    reference = reference_columns(samples, law.reference)
    columns = derived_columns(samples, reference, demanded[:2], law.car)
    columns["alpha_ref"] = demanded[4]
    for rotor, values in zip(ROTORS, demanded[2:4], strict=True):
        columns[f"wanted_square_{rotor}"] = values
        columns[f"switch_{rotor}"] = (values > 0.0).astype(float)
    error_y: Any = columns["y_ref"] - samples["y"]
    error_rate_y: Any = columns["vy_ref"] - samples["vy"]
    lyapunov: Any = planned_direction.lyapunov_candidate(error_y, error_rate_y, law.gains)
    return columns | {"lyapunov": lyapunov}


PLANNED_DIRECTION: Final = ClosedLoop(
    kind=TILT_CAR,
    parameters=PARAMETERS,
    setup=car_setup_of(planned_direction.Parameters, PARAMETERS),
    dynamics=Dynamics(
        "tilt_car",
        Sizes(qpos=4, qvel=4, act=2, ctrl=5),
        lambda _plan, _setup: (0.0, 0.0),
        commands_thrusts=True,
    ),
    sampling=Sampling(_planned_controls),
    columns=Columns(
        _observe_planned,
        _derive_planned,
        units={
            **{f"wanted_square_{rotor}": "rad^2/s^2" for rotor in ROTORS},
            **{f"switch_{rotor}": "1" for rotor in ROTORS},
            "lyapunov": "m^2/s^2",
        },
        observe_reads_controls=True,
    ),
    equations=Equations(
        inputs=_planned_inputs,
        inputs_size=2,
        rates=_planned_rates,
        initial=lambda plan, _setup: initial_motion(plan.scenario),
        observe=_observe_planned_equations,
    ),
)
"""The tilt-car with a planned direction of its thrusts (ch. 10, Sec. 5; ch. 11).

``switch_1`` and ``switch_2`` are ``p`` and ``q`` of ch. 11's switch matrix (Eqs. 22-24), 0 where a
rotor's thrust is saturated at zero; ``wanted_square_i`` is the demand without that limit.
"""
