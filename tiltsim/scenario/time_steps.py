"""Checks that the integrators can follow a scenario's servos, rotors, supervisor and law."""

from functools import lru_cache
from typing import Any, Final

import numpy as np

from tiltsim.models.rotor_table import Multirotor, hover_speeds
from tiltsim.scenario.controller_table import GaitFollowingController
from tiltsim.scenario.linearizing_controllers import AttitudeForceController
from tiltsim.scenario.messages import InvalidValueError
from tiltsim.scenario.rotorcraft import RotorcraftTable
from tiltsim.scenario.scenario_tables import ScenarioTables
from tiltsim.scenario.simulation_table import SimulationTable
from tiltsim_controllers.analysis.singularity import hover_rotor_speeds
from tiltsim_controllers.analysis.stability import (
    ErrorLoop,
    attitude_feedback,
    largest_held_gain,
    reaction_gains,
)
from tiltsim_controllers.laws.attitude_altitude import DECOUPLINGS
from tiltsim_controllers.laws.supervisor import LAG
from tiltsim_controllers.mathematics.scalar import Floats, Values
from tiltsim_controllers.vehicle.cross import cross_table
from tiltsim_controllers.vehicle.parameters import Vehicle

MAX_LOOP_STEP: Final = 2.5
"""Largest product of timestep and closed-loop pole; RK4 turns unstable at 2.78, ode3 at 2.51."""

MAX_HOVER_SPEED: Final = 5000.0
"""Rotor speed (rad/s) in hover that no rotor reaches: tips at 7 cm would be supersonic."""

MAX_HELD_STEP: Final = 2.0
"""Largest product of control timestep and pole, where a held third derivative turns unstable."""

MAX_SERVO_STEP: Final = 2.6
"""Largest product of timestep and servo pole.

On the real axis RK4 turns unstable at 2.78; at a damping ratio of 0.3 or more it is stable here.
"""

MAX_ODE3_SERVO_STEP: Final = 2.45
"""Limit for ode3, unstable from 2.51 on; at less damping: `MAX_UNDAMPED_SERVO_STEP`."""

MAX_UNDAMPED_SERVO_STEP: Final = 1.7  # ode3 turns unstable at 1.73 on the imaginary axis

MAX_EULER_STEP: Final = 1.9
"""Largest product of timestep and a rotor's pole where MuJoCo integrates activations by Euler."""


def check_time_steps(scenario: ScenarioTables) -> None:
    """Refuse servos, supervisors and laws that a scenario's time steps make unstable.

    Raises `InvalidValueError`, also for gains that are unstable at any step.
    """
    _check_servo(scenario)
    _check_rotors(scenario)
    _check_supervisor(scenario)
    _check_stability(scenario)


def _check_servo(scenario: ScenarioTables) -> None:
    servo, timestep = scenario.vehicle.tilt_servo, scenario.simulation.timestep
    # The fastest pole of the servo must stay where explicit integration is stable.
    fastest = servo.natural_frequency * max(1.0, 2.0 * servo.damping_ratio)
    limit = _largest_servo_step(scenario.simulation)
    if scenario.simulation.solver == "ode3" and servo.damping_ratio < 0.3:
        limit = MAX_UNDAMPED_SERVO_STEP
    # On the thesis plant ideal pods follow the gait exactly.
    ideal = scenario.has_ideal_actuators_in_still_air
    moves = scenario.simulation.plant != "thesis" or not ideal
    if scenario.vehicle.has_tilting_rotors and moves and fastest * timestep > limit:
        raise scenario.mistake(
            "simulation.timestep",
            f"too long for a tilt servo at {servo.natural_frequency:g} rad/s; at most "
            f"{limit / fastest:.3g} s, or a slower vehicle.tilt_servo",
        )


def _check_rotors(scenario: ScenarioTables) -> None:
    """Refuse a lag of the rotors that is too short for the integrator."""
    vehicle, simulation = scenario.vehicle, scenario.simulation
    if not isinstance(vehicle, RotorcraftTable) or vehicle.rotor_time_constant is None:
        return
    longest = _largest_rotor_step(simulation) * vehicle.rotor_time_constant
    if simulation.timestep > longest:
        raise scenario.mistake(
            "simulation.timestep",
            f"too long for vehicle.rotor_time_constant = {vehicle.rotor_time_constant:g}; at most "
            f"{longest:.3g} s",
        )
    _check_measured_reaction(scenario, vehicle)


def _largest_servo_step(simulation: SimulationTable) -> float:
    return MAX_ODE3_SERVO_STEP if simulation.solver == "ode3" else MAX_SERVO_STEP


def _largest_rotor_step(simulation: SimulationTable) -> float:
    """Largest product of timestep and a pole of the rotors."""
    by_euler = simulation.solver not in {"RK4", "ode3"}
    return MAX_EULER_STEP if by_euler else _largest_servo_step(simulation)


def _reaction_gains(scenario: ScenarioTables, controller: GaitFollowingController) -> Floats:
    """The `reaction_gains` of level hovers with the tilts of a scenario's gait."""
    assumed, limits = scenario.vehicle.resolve(), (-np.inf, np.inf)
    gait = scenario.gait.plan(assumed)
    angles, dimension, norm = gait.angles(gait.sample_times()), 1, "speed"
    found: list[Values | None]
    if isinstance(assumed, Multirotor):
        assert isinstance(controller, AttitudeForceController)
        dimension, norm = controller.resolve_force(assumed, gait).dimension, controller.norm
        table, inertia = assumed.table, np.reshape(assumed.inertia, (3, 3))
        found = [hover_speeds(assumed, (*row,), limits, dimension) for row in angles.tolist()]
    else:
        assert isinstance(assumed, Vehicle)
        table, inertia = cross_table(assumed, tilting=True), np.diag(assumed.moments)
        found = [hover_rotor_speeds((*row,), assumed) for row in angles.tolist()]
    return reaction_gains(
        table,
        [(tilts, speeds) for tilts, speeds in zip(angles, found, strict=True) if speeds],
        fed_back=attitude_feedback(controller.resolve_gains(), inertia),
        rotor_inertia=scenario.any_rotorcraft.rotor_inertia,
        decoupling=DECOUPLINGS[controller.decoupling],
        dimension=dimension,
        norm=norm,
    )


def _check_measured_reaction(scenario: ScenarioTables, vehicle: RotorcraftTable) -> None:
    """Refuse rotors whose reaction, measured and fed back, makes a loop that is unstable."""
    lag, simulation = vehicle.rotor_time_constant, scenario.simulation
    controller = scenario.controller
    measured = controller.measures_angular_acceleration and vehicle.rotor_inertia > 0.0
    if lag is None or not measured or controller.allow_unstable:
        return
    assert isinstance(controller, GaitFollowingController)  # no other measures it
    gains = _reaction_gains(scenario, controller)
    highest, against = gains.max(initial=0.0), -gains.min(initial=0.0)
    if simulation.control_timestep:
        held = simulation.control_timestep
        step = f"control_timestep = {held:g}"
        largest = largest_held_gain(held, lag, simulation.latency_steps)
    else:
        step = f"timestep = {simulation.timestep:g}"
        largest = _largest_rotor_step(simulation) * lag / simulation.timestep - 1.0
    excess = max(highest / largest, against)
    if excess > 1.0:
        cause = f"a pole at {(1.0 + highest) / lag:.4g} rad/s, too fast for simulation.{step}"
        if excess == against:
            cause = "instability at any time step, at tilt angles of the gait"
        raise scenario.mistake(
            "vehicle.rotor_inertia",
            f'controller.angular_acceleration = "measured" feeds the reaction of the rotors back: '
            f"{cause}; at most {vehicle.rotor_inertia / excess:.3g} kg m^2, or slower gains, or "
            "controller.allow_unstable = true",
        )


def _check_supervisor(scenario: ScenarioTables) -> None:
    """Refuse a supervisor that cannot keep its thresholds, or is sampled too slowly for its lag."""
    supervisor = scenario.controller.supervision
    if supervisor is None:
        return
    supervisor.resolve(scenario.any_rotorcraft.resolve())
    longest = MAX_HELD_STEP * LAG
    step, strategy = scenario.simulation.control_timestep, supervisor.strategy
    if strategy != "scale" and step >= longest:
        raise scenario.mistake(
            "simulation.control_timestep",
            f"too long for controller.supervisor.strategy = {strategy}, which moves with a lag "
            f"of {LAG:g} s; below {longest:g} s",
        )


def _check_stability(scenario: ScenarioTables) -> None:
    controller = scenario.controller
    if controller.allow_unstable:
        return
    vehicle: Any = scenario.vehicle.resolve()  # each controller's table takes its own vehicle
    for loop in controller.error_loops(vehicle):
        if not loop.stable:
            raise scenario.mistake(
                "controller.gains" if hasattr(controller, "gains") else "controller.law",
                f"fails the Routh-Hurwitz criterion under {controller.linearization}: "
                f"{loop.condition}; change the gains or set controller.allow_unstable = true",
            )
        _check_speed(scenario, loop)


def _check_speed(scenario: ScenarioTables, loop: ErrorLoop) -> None:
    """Refuse a loop whose fastest pole the time steps cannot follow.

    The published decoupling matrix speeds the attitude loops up some 700 times, so that
    harmless-looking gains can outrun the integrator within a few steps.
    """
    fastest = _fastest_pole(tuple(map(float, loop.polynomial)))
    limits = {"timestep": MAX_LOOP_STEP, "control_timestep": MAX_HELD_STEP}
    for key, limit in limits.items():
        step = getattr(scenario.simulation, key)
        if fastest * step > limit:
            _check_weight(scenario)
            raise scenario.mistake(
                f"simulation.{key}",
                f"too long for the {loop.name} loop under "
                f"{scenario.controller.linearization}, with its fastest pole at {fastest:.4g} "
                f"rad/s; at most {limit / fastest:.3g} s, or slower gains, or "
                "controller.allow_unstable = true",
            )


@lru_cache(maxsize=256)
def _fastest_pole(polynomial: Values) -> float:
    """The largest absolute value (rad/s) of a root; the scenarios of a sweep share most loops."""
    return float(np.abs(np.roots(polynomial)).max())


def _check_weight(scenario: ScenarioTables) -> None:
    """Refuse a mass, such as one in grams, that no rotors carry; loops are as fast as rotors."""
    vehicle = scenario.vehicle.resolve()
    if isinstance(vehicle, Vehicle) and vehicle.hover_rotor_speed > MAX_HOVER_SPEED:
        raise InvalidValueError(
            "vehicle.mass",
            vehicle.mass,
            f"is in kg; to hover its rotors would have to turn at {vehicle.hover_rotor_speed:.4g} "
            "rad/s; check mass and thrust_coefficient",
        )
