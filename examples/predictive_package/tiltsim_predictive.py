"""The law ``predictive`` of tiltsim: nonlinear model predictive control, one iteration a sample.

At each control sample it linearizes the motion along the plan of the sample before, and improves
the plan by one quadratic program within the limits of rotors and tilt servos (Diehl, Bock and
Schloeder 2005, "A real-time iteration scheme for nonlinear optimization in optimal feedback
control"). Observers estimate the disturbance. With ``tilts = "free"`` the tilts are inputs.
"""

from functools import cache
from itertools import starmap
from math import inf
from typing import Literal

import casadi
import numpy as np
from pydantic import Field

import tiltsim
from tiltsim import xp
from tiltsim.scenario.law_controller import TiltingTable
from tiltsim_controllers.code.arrays import program_of
from tiltsim_controllers.code.casadi_function import casadi_function
from tiltsim_controllers.laws.compensation import STATES, observer_rates
from tiltsim_controllers.laws.vectoring_steps import Frame, Motion, moved
from tiltsim_controllers.vehicle.actuators import held_gain
from tiltsim_controllers.vehicle.rotors import Rotors, tilts_of, wrench_map

GRID = 0.012 * 1.35 ** np.arange(10)  # s, intervals of the plan: 0.66 s in all
UNIT = 100.0  # rad/s: speeds near 1 suit the solver
PAST = 18  # entries of the motion in a state, before rotor speeds and tilts


@cache
def interval_of(layout):
    """``(state, command, aim, known) -> next state, costs, and their derivatives``."""
    rotors, tilts = len(layout), tilts_of(layout)
    inputs, spins = rotors + tilts, np.ones(rotors)

    def kinds(of_rotors, of_tilts):
        return xp.array([of_rotors] * rotors + [of_tilts] * tilts)

    def after(state, command, known):
        """The next state: the wrench is that of the mean speeds and tilts, which lag."""
        h, mass, gravity, gyroscopic = known[0], *known[3:6]
        inertia, force, torque = known[6:15].reshape(3, 3), known[15:18], known[18:21]
        k, parts = known[21 : 21 + rotors], known[21 + rotors :].reshape(3, 6, rotors)
        lag = kinds(known[1], known[2])
        left, commanded, have = xp.exp(-h / lag), kinds(UNIT, 1.0) * command, state[PAST:]
        mean = commanded + (have - commanded) * (lag / h * (1.0 - left))
        speeds = mean[:rotors]
        rows = wrench_map(Rotors(layout, spins, *parts), mean[rotors:])
        frame = Frame(mass, gravity, inertia, gyroscopic, force, torque)
        now = Motion(state[:3], state[3:6], state[6:15].reshape(3, 3), state[15:18])
        then = moved(now, rows @ (k * speeds * abs(speeds)), frame, h)
        reached = commanded + left * (have - commanded)
        return xp.hstack([then[0], then[1], then[2].ravel(), then[3], reached])

    def costs(state, command, aim, known):
        """Residuals, of which the sum of squares is least."""
        then = after(state, command, known)
        nose, way = then[6:12:3], xp.array([xp.cos(aim[6]), xp.sin(aim[6])])
        yaw = xp.arctan2(nose[1] * way[0] - nose[0] * way[1], nose @ way)
        rate = (kinds(UNIT, 1.0) * command - state[PAST:]) / kinds(known[1], known[2])
        errors = [aim[7] * (then[:3] - aim[:3]), aim[8] * (then[3:6] - aim[3:6])]
        turn = [xp.array([2.0 * yaw]), 0.1 * then[12:14], 0.12 * then[15:18]]
        rest = [kinds(2e-4, 0.02) * rate, kinds(0.02, 0.2) * (command - aim[9:])]
        return xp.sqrt(known[0]) * xp.hstack([*errors, *turn, *rest])

    sizes = {"state": PAST + inputs, "command": inputs}
    more = {"aim": 9 + inputs, "known": 21 + 19 * rotors}
    x, u, aim, known = starmap(casadi.SX.sym, (sizes | more).items())
    step = program_of(after, **sizes, known=more["known"])
    then = casadi_function(step, "after", "then")(x, u, known)
    cost = casadi_function(program_of(costs, **sizes, **more), "costs", "cost")(x, u, aim, known)
    slopes = [casadi.jacobian(of, by) for of in (then, cost) for by in (x, u)]
    return casadi.Function("interval", [x, u, aim, known], [then, cost, *slopes])


@cache
def iteration_of(layout):
    """``(state, plan, aims, known, low, high) -> better plan``, a column for each interval."""
    interval = interval_of(layout)
    inputs, numbers, size = interval.size1_in(1), interval.size1_in(2), len(GRID)
    plan, low, high = (casadi.MX.sym(name, inputs, size) for name in ("plan", "low", "high"))
    aims = casadi.MX.sym("aims", numbers, size)
    start, known = (casadi.MX.sym(name, interval.size1_in(i)) for name, i in (("x", 0), ("p", 3)))
    state, moves = start, casadi.MX(interval.size1_in(0), 0)  # of the state by the plan so far
    costs, slopes = [], []
    for k, h in enumerate(GRID):
        own = plan[:, k], aims[:, k], casadi.vertcat(h, known[1:])
        state, cost, A, B, C, D = interval(state, *own)
        rest = casadi.MX(interval.size1_out(1), inputs * (size - 1 - k))
        costs.append(cost)
        slopes.append(casadi.horzcat(C @ moves, D, rest))
        moves = casadi.horzcat(A @ moves, B)
    slope, count = casadi.vertcat(*slopes), inputs * size
    hessian = casadi.densify(slope.T @ slope) + 1e-9 * casadi.DM.eye(count)
    shapes = {"h": hessian.sparsity(), "a": casadi.Sparsity(0, count)}
    program = casadi.conic("program", "daqp", shapes)  # quadratic, with bounds
    bounds = {"lbx": casadi.vec(low - plan), "ubx": casadi.vec(high - plan)}
    change = program(h=hessian, g=slope.T @ casadi.vertcat(*costs), **bounds)["x"]
    better = plan + casadi.reshape(change, inputs, size)
    return casadi.Function("iteration", [start, plan, aims, known, low, high], [better])


class PredictiveController(TiltingTable, tiltsim.LawController):
    """The table ``[controller]`` with ``law = "predictive"``."""

    law: Literal["predictive"] = Field(
        "predictive", description="nonlinear model predictive control within the limits, by CasADi"
    )
    position_weight: float = Field(
        9.0, gt=0.0, description="on errors of position, against 1 on errors of velocity [1/s]"
    )
    observer_bandwidth: float = Field(20.0, gt=0.0, description="bandwidth of the observers [1/s]")
    rotor_bandwidth: float = Field(
        400.0, gt=0.0, description="of the rotors' speed controllers [1/s]"
    )

    @staticmethod
    def control(observed, p):
        """The law, with the plan and `STATES` as states."""
        body, reference, table = observed.vehicle, observed.reference, observed.table
        count, first = len(observed.thrusts), len(observed.states) - len(STATES)
        plan = observed.states[:first].reshape(len(GRID), -1)
        lag, servo_lag, wait, period, gain, rate = table[:6]
        k, (low, high, home) = table[6 : 6 + count], table[6 + count :].reshape(3, -1)
        _, force, _, torque = observed.states[first:].reshape(4, 3)
        frame = body.mass, body.gravity, observed.gyroscopic, *observed.inertia.ravel()
        pushing, tilts = observed.rotors, observed.tilt_angles
        if len(observed.tilt_commands) == 0:  # a gait's tilts stay where they are
            rows, tilts = wrench_map(pushing, tilts), np.zeros(0)
            pushing = Rotors((-1,) * count, pushing.spins, rows, 0.0 * rows, 0.0 * rows)
        parts = np.ravel(pushing[2:])
        known = np.hstack([0.0, lag, servo_lag, *frame, force, torque, k, parts])
        layout = pushing.tilt_of_rotor
        pose = [observed.position, observed.velocity, observed.rotation.ravel()]
        state = np.hstack([*pose, observed.body_rates, observed.rotor_speeds, tilts])
        # Until the new command acts, the first one of the plan does.
        known[0] = wait
        late = np.array(interval_of(layout)(state, plan[0], 0.0, known)[0])[:, 0]
        aims = np.empty((len(GRID), 9 + len(home)))
        for at, aim in zip(wait + np.cumsum(GRID), aims, strict=True):
            a, change = reference.acceleration, at * reference.jerk
            mean = reference.velocity + at / 2.0 * (a + change / 3.0)
            aim[:3] = reference.position + at * mean
            aim[3:6] = reference.velocity + at * (a + change / 2.0)
            aim[6] = reference.attitude[2] + at * reference.attitude_rates[2]
            aim[7:] = p.position_weight, 1.0, *home
        aims[-1, 7:9] *= 2.0  # in place of the time after the plan
        # Servos are no faster than their limit: so far can each tilt be by then.
        reach = np.full((len(GRID), len(home)), inf)
        reach[:, count:] = rate * (servo_lag + np.cumsum(GRID) - GRID)[:, None]
        centre = np.hstack([np.zeros(count), late[PAST + count :]])
        limits = np.maximum(low, centre - reach).T, np.minimum(high, centre + reach).T
        better = np.array(iteration_of(layout)(late, plan.T, aims.T, known, *limits)).T
        learned = observer_rates(observed, first, p.observer_bandwidth)
        command = {"rotor_speeds": UNIT * better[0, :count]}
        if len(tilts):
            now = observed.tilt_commands
            command["tilt_angles"] = now + (better[0, count:] - now) / (gain * period)
        rates = np.hstack([(better - plan).ravel() / period, learned])
        return tiltsim.Command(**command, rates=rates)

    def law_table(self, airframe):
        body, rotors, servo = airframe.vehicle, airframe.rotors, airframe.tilt_servo
        period = airframe.control_timestep
        lag = (airframe.rotor_time_constant or 0.0) + 1.0 / self.rotor_bandwidth
        servo_lag = 2.0 * servo.damping_ratio / servo.natural_frequency
        wait = (airframe.latency + 0.5) * period
        gain, rate = held_gain(self.tilt_rate_gain, period), servo.max_rate or 100.0
        ends = np.clip(airframe.speed_limits, -2000.0, 2000.0) / UNIT
        low, high = (np.full(rotors, end) for end in ends)
        home, tilts = np.array(airframe.initial_speeds) / UNIT, self.tilts_of(airframe)
        bounds = np.hstack([low, tilts - 0.7]), np.hstack([high, tilts + 0.7])
        each = *body.thrust_coefficients, *np.ravel(bounds), *home, *tilts
        return (lag, servo_lag, wait, period, gain, rate, *each)

    def tilts_of(self, airframe):
        """The tilts that are inputs, at the start."""
        return np.array(airframe.initial_tilts if self.commands_tilts else ())

    def state_units(self, airframe):
        units = ["100 rad/s"] * airframe.rotors + ["rad"] * len(self.tilts_of(airframe))
        plan = {
            f"state_plan_{k}_{i}": unit
            for k in range(1, len(GRID) + 1)
            for i, unit in enumerate(units, 1)
        }
        return plan | STATES

    def initial_states(self, airframe):
        motion = airframe.initial_velocity, (0.0,) * 3, airframe.initial_body_rates, (0.0,) * 3
        speeds = np.array(airframe.initial_speeds) / UNIT
        plan = np.tile(np.hstack([speeds, self.tilts_of(airframe)]), len(GRID))
        return (*plan, *np.ravel(motion))

    def check_scenario(self, scenario):
        if not scenario.simulation.control_timestep:
            raise self.mistake("law", "needs simulation.control_timestep > 0")
        super().check_scenario(scenario)
