"""The law ``predictive`` of tiltsim: nonlinear model predictive control, one iteration a sample.

At each control sample it linearizes the motion along the plan of the sample before, and improves
the plan by one quadratic program within the rotors' speed limits (Diehl, Bock and Schloeder 2005,
"A real-time iteration scheme for nonlinear optimization in optimal feedback control"). Observers
estimate the disturbance; tilts follow their gait.
"""

from functools import cache
from itertools import starmap
from math import isfinite
from typing import Literal

import casadi
import numpy as np
from pydantic import Field

import tiltsim
from tiltsim import xp
from tiltsim_controllers.code.arrays import program_of
from tiltsim_controllers.code.casadi_function import casadi_function
from tiltsim_controllers.laws.compensation import STATES, observer_rates
from tiltsim_controllers.laws.vectoring_steps import Frame, Motion, moved

GRID = 0.012 * 1.35 ** np.arange(10)  # s, intervals of the plan: 0.66 s in all
UNIT = 100.0  # rad/s: speeds near 1 suit the solver
PAST = 18  # entries of the motion in a state, before the rotor speeds


@cache
def interval_of(rotors):
    """``(state, command, aim, known) -> next state, costs, and their derivatives``."""

    def after(state, command, known):
        """The next state: the wrench is that of the mean speeds, which lag."""
        h, lag, mass, gravity, gyroscopic = known[:5]
        inertia, force, torque = known[5:14].reshape(3, 3), known[14:17], known[17:20]
        rows, k = known[20 : 20 + 6 * rotors].reshape(6, rotors), known[20 + 6 * rotors :]
        left = xp.exp(-h / lag)
        speeds, commanded = state[PAST:], UNIT * command
        mean = commanded + (speeds - commanded) * (lag / h * (1.0 - left))
        frame = Frame(mass, gravity, inertia, gyroscopic, force, torque)
        now = Motion(state[:3], state[3:6], state[6:15].reshape(3, 3), state[15:18])
        then = moved(now, rows @ (k * mean * abs(mean)), frame, h)
        reached = commanded + left * (speeds - commanded)
        return xp.hstack([then[0], then[1], then[2].ravel(), then[3], reached])

    def costs(state, command, aim, known):
        """Residuals, of which the sum of squares is least."""
        then = after(state, command, known)
        yaw = then[9] * xp.cos(aim[6]) - then[6] * xp.sin(aim[6])  # nose across its direction
        effort = (UNIT * command - state[PAST:]) / known[1]
        errors = [aim[7] * (then[:3] - aim[:3]), aim[8] * (then[3:6] - aim[3:6])]
        rest = [0.12 * then[15:18], 2e-4 * effort, 0.02 * (command - aim[9:])]
        return xp.sqrt(known[0]) * xp.hstack([*errors, xp.array([2.0 * yaw]), *rest])

    sizes = {"state": PAST + rotors, "command": rotors}
    more = {"aim": 9 + rotors, "known": 20 + 7 * rotors}
    x, u, aim, known = starmap(casadi.SX.sym, (sizes | more).items())
    step = program_of(after, **sizes, known=more["known"])
    then = casadi_function(step, "after", "then")(x, u, known)
    cost = casadi_function(program_of(costs, **sizes, **more), "costs", "cost")(x, u, aim, known)
    slopes = [casadi.jacobian(of, by) for of in (then, cost) for by in (x, u)]
    return casadi.Function("interval", [x, u, aim, known], [then, cost, *slopes])


@cache
def program(size):
    """A quadratic program with bounds."""
    shapes = {"h": casadi.Sparsity.dense(size, size), "a": casadi.Sparsity(0, size)}
    return casadi.conic("program", "daqp", shapes)


def improved(state, plan, aims, known, limits):
    """The plan, commanded speeds in `UNIT` of shape (intervals, N), after one iteration."""
    count, rotors = plan.shape
    interval, size = interval_of(rotors), plan.size
    moves = np.zeros((len(state), size))  # of the state by the plan
    hessian, gradient = 1e-9 * np.eye(size), np.zeros(size)
    for k in range(count):
        found = interval(state, plan[k], aims[k], [GRID[k], *known])
        then, cost, A, B, C, D = (np.array(one) for one in found)
        own = slice(k * rotors, (k + 1) * rotors)
        slope = C @ moves
        slope[:, own] += D
        hessian += slope.T @ slope
        gradient += slope.T @ cost[:, 0]
        moves = A @ moves
        moves[:, own] += B
        state = then[:, 0]
    low, high = (np.tile(limit / UNIT, count) - plan.ravel() for limit in limits)
    change = program(size)(h=hessian, g=gradient, lbx=low, ubx=high)["x"]
    return plan + np.array(change).reshape(plan.shape)


class PredictiveController(tiltsim.LawController):
    """The table ``[controller]`` with ``law = "predictive"``."""

    law: Literal["predictive"] = Field(
        "predictive",
        description="nonlinear model predictive control within the rotors' limits, by CasADi",
    )
    position_weight: float = Field(
        6.0, gt=0.0, description="on errors of position, against 1 on errors of velocity [1/s]"
    )
    observer_bandwidth: float = Field(8.0, gt=0.0, description="bandwidth of the observers [1/s]")
    rotor_bandwidth: float = Field(
        400.0, gt=0.0, description="of the rotors' speed controllers [1/s]"
    )

    @staticmethod
    def control(observed, p):
        """The law, with the plan and `STATES` as states."""
        rotors, first = len(observed.thrusts), len(observed.states) - len(STATES)
        plan = observed.states[:first].reshape(-1, rotors)
        lag, wait, period = observed.table[:3]
        k, low, high, hover = np.reshape(observed.table[3:], (4, rotors))
        body, reference = observed.vehicle, observed.reference
        _, force, _, torque = observed.states[first:].reshape(4, 3)
        rows = np.vstack([observed.force, observed.torque])
        frame = lag, body.mass, body.gravity, observed.gyroscopic, *observed.inertia.ravel()
        known = [*frame, *force, *torque, *rows.ravel(), *k]
        pose = [observed.position, observed.velocity, observed.rotation.ravel()]
        state = np.hstack([*pose, observed.body_rates, observed.rotor_speeds])
        # Until the new command acts, the first one of the plan does.
        aims = np.empty((len(GRID), 9 + rotors))
        late = interval_of(rotors)(state, plan[0], 0.0, [wait, *known])[0]
        for at, aim in zip(wait + np.cumsum(GRID), aims, strict=True):
            a, change = reference.acceleration, at * reference.jerk
            mean = reference.velocity + at / 2.0 * (a + change / 3.0)
            aim[:3] = reference.position + at * mean
            aim[3:6] = reference.velocity + at * (a + change / 2.0)
            aim[6] = reference.attitude[2] + at * reference.attitude_rates[2]
            aim[7:] = p.position_weight, 1.0, *hover / UNIT
        aims[-1, 7:9] *= 2.0  # in place of the time after the plan
        better = improved(np.array(late)[:, 0], plan, aims, known, (low, high))
        learned = observer_rates(observed, first, p.observer_bandwidth)
        rates = [(better - plan).ravel() / period, learned]
        return tiltsim.Command(rotor_speeds=UNIT * better[0], rates=np.hstack(rates))

    def law_table(self, airframe):
        body, rotors = airframe.vehicle, airframe.rotors
        lag = (airframe.rotor_time_constant or 0.0) + 1.0 / self.rotor_bandwidth
        wait = (airframe.latency + 0.5) * airframe.control_timestep
        low, high = (limit if isfinite(limit) else 2000.0 for limit in airframe.speed_limits)
        hover = np.sqrt(body.mass * body.gravity / sum(body.thrust_coefficients))
        each = (*body.thrust_coefficients, *[low] * rotors, *[high] * rotors, *[hover] * rotors)
        return (lag, wait, airframe.control_timestep, *each)

    def state_units(self, airframe):
        rotors, intervals = range(1, airframe.rotors + 1), range(1, len(GRID) + 1)
        return {f"state_plan_{k}_{i}": "100 rad/s" for k in intervals for i in rotors} | STATES

    def initial_states(self, airframe):
        motion = airframe.initial_velocity, (0.0,) * 3, airframe.initial_body_rates, (0.0,) * 3
        plan = np.tile(np.array(airframe.initial_speeds) / UNIT, len(GRID))
        return (*plan, *np.ravel(motion))

    def check_scenario(self, scenario):
        if not scenario.simulation.control_timestep:
            raise self.mistake("law", "needs simulation.control_timestep > 0")
        super().check_scenario(scenario)
