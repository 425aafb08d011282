"""Whether a scenario's loops are stable, by themselves and at its time steps."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.scenario.messages import InvalidValueError
from tiltsim.scenario.tiltrotor_controllers import AttitudeAltitudeController
from tiltsim_controllers.analysis.stability import ErrorLoop
from tiltsim_controllers.laws.supervisor import LAG

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import Scenario

MAX_LOOP_STEP: Final = 2.5
"""Largest product of timestep and closed-loop pole; RK4 turns unstable at 2.78, ode3 at 2.51."""

MAX_HELD_STEP: Final = 2.0
"""Largest product of control timestep and pole, where a held third derivative turns unstable."""

MAX_SERVO_STEP: Final = {"mujoco": 2.6, "thesis": 2.45}
"""Largest product of timestep and servo pole, by plant.

On the real axis RK4 turns unstable at 2.78 and ode3 at 2.51; at a damping ratio of 0.3 or more both
bear these. With less, ode3 bears `MAX_UNDAMPED_SERVO_STEP`.
"""

MAX_UNDAMPED_SERVO_STEP: Final = 1.7
"""On the thesis plant: ode3 turns unstable at 1.73 on the imaginary axis."""


def check_time_steps(scenario: Scenario) -> None:
    """Refuse servos, supervisors and laws that a scenario's time steps make unstable.

    Raises `InvalidValueError`, also for gains that are unstable at any step.
    """
    _check_servo(scenario)
    _check_supervisor(scenario)
    _check_stability(scenario)


def _check_servo(scenario: Scenario) -> None:
    servo, timestep = scenario.vehicle.tilt_servo, scenario.simulation.timestep
    # The fastest pole of the servo must stay where explicit integration is stable.
    fastest = servo.natural_frequency * max(1.0, 2.0 * servo.damping_ratio)
    plant = scenario.simulation.plant
    limit = MAX_SERVO_STEP[plant]
    if plant == "thesis" and servo.damping_ratio < 0.3:
        limit = MAX_UNDAMPED_SERVO_STEP
    tilts = scenario.vehicle.model != "quadrotor"
    moves = (
        plant == "mujoco" or not scenario.has_ideal_actuators_in_still_air
    )  # else pods follow the gait exactly
    if tilts and moves and fastest * timestep > limit:
        raise InvalidValueError(
            "simulation.timestep",
            timestep,
            f"too long for a tilt servo at {servo.natural_frequency:g} rad/s; at most "
            f"{limit / fastest:.3g} s, or a slower vehicle.tilt_servo",
        )


def _check_supervisor(scenario: Scenario) -> None:
    """Refuse a supervisor that cannot keep its thresholds, or is sampled too seldom for its lag."""
    controller = scenario.controller
    if not isinstance(controller, AttitudeAltitudeController) or controller.supervisor is None:
        return
    controller.resolve_supervisor(scenario.rotorcraft.resolve())
    longest = MAX_HELD_STEP * LAG
    step, strategy = scenario.simulation.control_timestep, controller.supervisor.strategy
    if strategy != "scale" and step >= longest:
        raise InvalidValueError(
            "simulation.control_timestep",
            step,
            f"too long for controller.supervisor.strategy = {strategy}, which moves with a lag "
            f"of {LAG:g} s; below {longest:g} s",
        )


def _check_stability(scenario: Scenario) -> None:
    controller = scenario.controller
    if controller.allow_unstable:
        return
    vehicle: Any = scenario.vehicle.resolve()  # each law's table takes its own vehicle's
    for loop in controller.error_loops(vehicle):
        if not loop.stable:
            raise InvalidValueError(
                "controller.gains",
                controller.model_dump()["gains"],
                f"unstable under {controller.linearization} by Routh: "
                f"{loop.condition}; change the gains or set controller.allow_unstable = true",
            )
        _check_speed(scenario, loop)


def _check_speed(scenario: Scenario, loop: ErrorLoop) -> None:
    """Refuse a loop whose fastest pole the time steps cannot follow.

    The published decoupling matrix speeds the attitude loops up some 700 times, so that
    harmless-looking gains can outrun the integrator within a few steps.
    """
    fastest = float(np.abs(np.roots(loop.polynomial)).max())
    limits = {"timestep": MAX_LOOP_STEP, "control_timestep": MAX_HELD_STEP}
    for key, limit in limits.items():
        step = getattr(scenario.simulation, key)
        if fastest * step > limit:
            raise InvalidValueError(
                f"simulation.{key}",
                step,
                f"too long for the {loop.name} loop under "
                f"{scenario.controller.linearization}, with its fastest pole at {fastest:.4g} "
                f"rad/s; at most {limit / fastest:.3g} s, or slower gains, or "
                "controller.allow_unstable = true",
            )
