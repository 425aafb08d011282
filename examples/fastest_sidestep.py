"""The fastest sidestep of a tiltrotor, by direct multiple shooting with CasADi and IPOPT.

    python examples/fastest_sidestep.py --out sidestep.png

The dynamics are those of `tiltsim.symbolic`, with rotor accelerations and tilt rates as inputs. The
vehicle moves from hover to hover in the least time, within the limits of its rotors and servos:
once level, by its pods alone, and once with its pods upright, as a quadrotor. Both plans are then
flown in MuJoCo without any feedback.
"""

from __future__ import annotations

import argparse
from math import ceil
from typing import Any, NamedTuple

import casadi
import numpy as np

import tiltsim

DISTANCE = 3.0  # m, along x
SPEEDS, ACCELERATION = (100.0, 500.0), 4000.0  # rad/s, of which hover needs 361, and rad/s^2
TILT, TILT_RATE = 0.8, 8.0  # rad, rad/s
LEVEL = 0.01  # rad and rad/s, of what shall not turn
HOLD = 0.001  # s, of the commands in MuJoCo
SERVO_LEAD = 2.0 / 300.0  # s, 2 zeta / omega of the tilt servos

SPIN = np.array([-1.0, 1.0, -1.0, 1.0])
X, ROTATION, ROTORS, TILTS = 0, slice(6, 15), slice(18, 22), slice(22, 26)  # of the state
YAW, PITCH, ROLL, P, Q, R = 9, 12, 13, 15, 16, 17  # sines of the angles, and body rates

SCENARIO: dict[str, Any] = {
    "simulation": {"plant": "thesis"},
    "controller": {"law": "full_pose"},
    "gait": {"type": "fixed", "angles": [0.0, 0.0, 0.0, 0.0]},
    "initial": {"rotor_speed": 361.3829880001334},
}


class Plan(NamedTuple):
    """A manoeuvre on a grid of times."""

    times: np.ndarray  # (intervals + 1,), s
    states: np.ndarray  # (intervals + 1, 26)
    inputs: np.ndarray  # (intervals, 8), held in each interval


def fastest(model: Any, tilting: bool, intervals: int) -> Plan:
    """The manoeuvre in the least time, level or with upright pods."""
    # Numbers of order one: rotor speeds in 100 rad/s, their accelerations in 1000 rad/s^2.
    x_scale, u_scale = np.ones(26), np.array([1000.0] * 4 + [1.0] * 4)
    x_scale[ROTORS] = 100.0
    start = np.array(model.initial) / x_scale
    step, x, u = casadi.SX.sym("step"), casadi.SX.sym("x", 26), casadi.SX.sym("u", 8)

    def rates(state: Any) -> Any:
        return model.dynamics(0.0, state * x_scale, u * u_scale) / x_scale

    k1 = rates(x)
    k2 = rates(x + 0.5 * step * k1)
    k3 = rates(x + 0.5 * step * k2)
    k4 = rates(x + step * k3)
    rk4 = casadi.Function("rk4", [x, u, step], [x + step / 6.0 * (k1 + 2 * k2 + 2 * k3 + k4)])

    problem = casadi.Opti()
    duration = problem.variable()
    states, inputs = problem.variable(26, intervals + 1), problem.variable(8, intervals)

    def within(values: Any, low: float, high: float) -> None:
        problem.subject_to(problem.bounded(low, casadi.vec(values), high))

    problem.minimize(duration + 1e-3 * casadi.sumsqr(inputs) / intervals)
    steps = rk4.map(intervals)(states[:, :-1], inputs, duration / intervals)
    problem.subject_to(states[:, 1:] == steps)
    problem.subject_to(states[:, 0] == start)
    for rotor, spin in zip(range(18, 22), SPIN, strict=True):
        within(spin * states[rotor, 1:], SPEEDS[0] / 100.0, SPEEDS[1] / 100.0)
    within(inputs[:4, :], -ACCELERATION / 1000.0, ACCELERATION / 1000.0)
    if tilting:
        within(states[TILTS, 1:], -TILT, TILT)
        within(inputs[4:, :], -TILT_RATE, TILT_RATE)
        within(states[[YAW, PITCH, ROLL, P, Q, R], 1:-1], -LEVEL, LEVEL)
    else:
        problem.subject_to(casadi.vec(inputs[4:, :]) == 0.0)
        within(states[[YAW, ROLL, P, R], 1:-1], -LEVEL, LEVEL)
    # Hover at the end; three entries of the rotation say that it is none.
    ends = [0, 1, 2, 3, 4, 5, YAW, PITCH, ROLL, P, Q, R, *range(18, 26 if tilting else 22)]
    problem.subject_to(states[ends, -1] == casadi.DM([DISTANCE, *start[ends[1:]]]))
    problem.subject_to(duration >= 0.1)

    guess = np.tile(start[:, None], intervals + 1)
    guess[X] = np.linspace(0.0, DISTANCE, intervals + 1)
    problem.set_initial(duration, 1.5)
    problem.set_initial(states, guess)
    problem.solver("ipopt", {"print_time": False, "expand": True}, {"print_level": 0, "sb": "yes"})
    solution = problem.solve()
    times = np.linspace(0.0, solution.value(duration), intervals + 1)
    found = solution.value(states).T * x_scale, solution.value(inputs).T * u_scale
    return Plan(times, *found)


def fly(plan: Plan) -> tiltsim.Flight:
    """A plan in MuJoCo: its rotor speeds and tilt angles as commands, whatever the vehicle does."""
    rates = plan.inputs[:, 4:]

    def command(seen: tiltsim.Observation) -> tiltsim.Command:
        time = min(seen.time + 0.5 * HOLD, plan.times[-1])
        state = np.array([np.interp(time, plan.times, column) for column in plan.states.T])
        rate = rates[min(int(time / plan.times[1]), len(rates) - 1)]
        tilts = state[TILTS] + SERVO_LEAD * rate
        return tiltsim.Command(rotor_speeds=SPIN * state[ROTORS], tilt_angles=tilts)

    duration = HOLD * ceil(plan.times[-1] / HOLD)
    simulation = {"duration": duration, "timestep": HOLD, "control_timestep": HOLD}
    scenario = {"simulation": simulation, "initial": SCENARIO["initial"]}
    return tiltsim.simulate(scenario, controller=command)


def deviation(plan: Plan, flight: tiltsim.Flight) -> float:
    """Distance (m) of a flight's end from the plan's."""
    return float(np.linalg.norm(flight["position"][-1] - plan.states[-1, :3]))


def draw(plans: dict[str, Plan], flights: dict[str, tiltsim.Flight], file: str) -> None:
    """The vehicles from the side, with thrusts, and the manoeuvres over time."""
    import matplotlib.pyplot as plt

    blue, red, green, ink = "#0072B2", "#D55E00", "#009E73", "#222222"  # for the color-blind
    plt.rcParams.update({"axes.spines.top": False, "axes.spines.right": False, "axes.grid": True})
    plt.rcParams.update({"axes.titlelocation": "left", "grid.color": "#D9D9D9", "font.size": 9})
    figure, axes = plt.subplots(
        2, 4, figsize=(12, 4.6), width_ratios=(2.2, 1, 1, 1), layout="constrained", sharex="col"
    )
    for (name, plan), row, color in zip(plans.items(), axes, (blue, red)):
        side, course, turning, tilting = row
        flight = flights[name]
        side.plot(flight["x"], flight["z"], color="0.8", zorder=0)
        for row in range(0, len(plan.times), 5):
            state = plan.states[row]
            turn = state[ROTATION].reshape(3, 3)
            forward, sine, cosine = turn[:, 0], np.sin(state[TILTS]), np.cos(state[TILTS])
            thrusts = 8.048e-6 * state[ROTORS] ** 2
            front, back = state[:3] + 0.1785 * forward, state[:3] - 0.1785 * forward
            side.plot(*zip(front[::2], back[::2]), color="k", linewidth=2)
            pods = (
                (front, turn[:, 2] * thrusts[0] * cosine[0]),
                (state[:3], turn @ (sine[1] * thrusts[1] - sine[3] * thrusts[3], 0.0,
                                    cosine[1] * thrusts[1] + cosine[3] * thrusts[3])),
                (back, turn[:, 2] * thrusts[2] * cosine[2]),
            )  # fmt: skip
            for place, force in pods:
                side.quiver(place[0], place[2], force[0], force[2], color=color, angles="xy",
                            scale_units="xy", scale=8.0, width=0.004)  # fmt: skip
        side.set(title=f"{name}: {plan.times[-1]:.2f} s", ylabel="z (m)", aspect="equal")
        side.set(xlim=(-0.4, 3.4), ylim=(-0.5, 0.9))
        course.plot(plan.times, plan.states[:, X], color=ink, label="planned")
        course.plot(flight["time"][::5], flight["x"][::5], ".", color=color, label="in MuJoCo")
        course.set(title="Distance", ylabel="m")
        course.legend(frameon=False, fontsize="small")
        turning.plot(plan.times, np.abs(plan.states[:, ROTORS]), color=color, lw=1)
        turning.set(title="Rotor speeds", ylabel="rad/s", ylim=(0.0, 1.05 * SPEEDS[1]))
        angle = plan.states[:, TILTS] if name == "level" else np.arcsin(-plan.states[:, [PITCH]])
        tilting.plot(plan.times, angle, color=green, lw=1)
        tilting.set(title="Tilt angles" if name == "level" else "Pitch", ylabel="rad")
    for panel, label in zip(axes[1], ("x (m)", *["time (s)"] * 3)):
        panel.set_xlabel(label)
    figure.savefig(file, dpi=110)


def main() -> None:
    """Solve both, fly both, print and draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--intervals", type=int, default=40, help="of the grid; default: 40")
    parser.add_argument("--out", help="file for the figure, such as sidestep.png; default: none")
    arguments = parser.parse_args()
    model = tiltsim.symbolic(SCENARIO)
    plans = {
        name: fastest(model, name == "level", arguments.intervals)
        for name in ("level", "pods upright")
    }
    flights = {name: fly(plan) for name, plan in plans.items()}
    for name, plan in plans.items():
        error = 1e3 * deviation(plan, flights[name])
        print(f"{name}: {plan.times[-1]:.3f} s; in MuJoCo it ends {error:.1f} mm from the plan")
    if arguments.out:
        draw(plans, flights, arguments.out)


if __name__ == "__main__":
    main()
