"""Plan a step of a hexarotor within the limits of its rotors, with CasADi's Opti and IPOPT."""

import casadi
import numpy as np

import tiltsim

STEP, INTERVALS = 0.05, 16  # s of an interval of the plan, and their number
SPEEDS, GOAL = (60.0, 838.0), 1.0  # rad/s; m along x, from hover at 0
WORLD = {
    "vehicle.min_rotor_speed": SPEEDS[0],
    "vehicle.max_rotor_speed": SPEEDS[1],
    "reference.position": [GOAL, 0.0, 0.0],
}


def planner(model):
    """The plan of least cost as a CasADi function: state, guess -> states, inputs."""
    rotors = [i for i, name in enumerate(model.inputs) if name.startswith("rotor_acceleration")]
    speeds = [i for i, name in enumerate(model.states) if name.startswith("rotor_speed")]
    rest, size, count = np.array(model.initial), len(model.initial), len(rotors)
    x, u = casadi.SX.sym("x", size), casadi.SX.sym("u", count)
    inputs = casadi.SX(len(model.inputs), 1)
    inputs[rotors] = 1000.0 * u  # rad/s^2; numbers near 1 suit the solver
    rates = casadi.Function("rates", [x, u], [model.dynamics(0.0, x, inputs)])
    after = x + STEP * rates(x + 0.5 * STEP * rates(x, u), u)
    step = casadi.Function("step", [x, u], [after]).map(INTERVALS)

    problem = casadi.Opti()
    states, change = problem.variable(size, INTERVALS + 1), problem.variable(count, INTERVALS)
    start = problem.parameter(size)
    problem.subject_to(states[:, 0] == start)
    problem.subject_to(states[:, 1:] == step(states[:, :-1], change))
    along = np.sign(rest[speeds])[:, np.newaxis] * states[speeds, 1:]
    problem.subject_to(problem.bounded(SPEEDS[0], casadi.vec(along), SPEEDS[1]))
    cost = dict.fromkeys("xyz", 10.0) | dict.fromkeys(("vx", "vy", "vz"), 0.3)
    cost |= dict.fromkeys("pqr", 0.03)
    others = {"quaternion": 1.0, "rotor": 1e-6}  # by the beginning of a name
    weights = np.array([cost.get(n) or others[n.split("_")[0]] for n in model.states])
    goal = rest + GOAL * np.eye(size)[0]
    error = (states - goal) ** 2
    total = casadi.sum2(error) + 9.0 * error[:, -1]  # the end counts ten times
    problem.minimize(casadi.dot(weights, total) + 1e-3 * casadi.sumsqr(change))
    ipopt = {"print_level": 0, "sb": "yes", "tol": 1e-3, "mu_init": 1e-2}
    problem.solver("ipopt", {"print_time": False, "expand": True}, ipopt)
    return problem.to_function("plan", [start, states, change], [states, change])


if __name__ == "__main__":
    changes = {**WORLD, "simulation.plant": "rigid_body", "controller": {"law": "geometric"}}
    model = tiltsim.symbolic(tiltsim.load_scenario("fleet/hexarotor#hover", changes))
    guess = np.tile(np.array(model.initial)[:, np.newaxis], INTERVALS + 1)
    states, change = planner(model)(model.initial, guess, np.zeros((6, INTERVALS)))
    x = np.array(states)[model.states.index("x")]
    print(f"after {STEP * INTERVALS:.1f} s at {x[-1]:.3f} m, accelerations up to", end=" ")
    print(f"{1000.0 * np.abs(np.array(change)).max():.0f} rad/s^2")
