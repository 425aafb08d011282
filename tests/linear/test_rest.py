"""Rest points, their poles and their linear systems."""

from __future__ import annotations

from functools import cache
from math import factorial

import numpy as np
import pytest

import tiltsim
from tiltsim.commands.stability import stability_text
from tiltsim.linear.equilibrium import equilibrium_of
from tiltsim.linear.linearization import linearization_at
from tiltsim.linear.modes import exponents, is_stable, modes_of, spectrum
from tiltsim.linear.mujoco_motion import make_motion
from tiltsim.linear.newton import ERROR, derivative_at
from tiltsim.linear.stability import stability_at
from tiltsim_controllers.analysis.stability import error_loops

SETPOINT = "ch04_tracking/setpoint#rho_065_modified"
THESIS = {"simulation.plant": "thesis"}


@cache
def setpoint(plant="mujoco"):
    """The rest point of the published flight, found once."""
    return equilibrium_of(tiltsim.load_scenario(SETPOINT, {"simulation.plant": plant}))


def random_hover(seed):
    """A level hover with random tilts, vehicle and gains, under the exact matrix."""
    draw = np.random.default_rng(seed).uniform
    fast = draw(6.0, 12.0, 3)
    rho = float(draw(0.3, 0.8))
    return tiltsim.parse_scenario(
        {
            "simulation": {"plant": "thesis"},
            "vehicle": {"mass": float(draw(0.3, 0.6))},
            "initial": {"rotor_speed": 380.0},
            "controller": {
                "law": "attitude_altitude",
                "decoupling": "exact",
                "decoupler": "none",
                "gains": {
                    "attitude": [fast.tolist(), (5.0 * fast).tolist(), (8.0 * fast).tolist()],
                    "altitude": draw([8.0, 5.0, 8.0], [12.0, 9.0, 10.0]).tolist(),
                    "position": [1.0, 1.0],
                },
            },
            "gait": {"type": "fixed", "angles": [rho, -rho, rho, -rho]},
            "reference": {"type": "attitude_altitude", "altitude": 1.0},
        }
    )


def random_line(seed):
    """A line flown with random fixed tilts and mass, on the plants in turn."""
    draw = np.random.default_rng(seed).uniform
    angles = np.array((1.0, -1.0, 1.0, -1.0)) * draw(0.3, 0.7) * draw(0.9, 1.1, 4)
    changes = {
        "simulation.plant": ("thesis", "mujoco")[seed % 2],
        "vehicle.mass": float(draw(0.40, 0.45)),
        "gait.angles": angles.tolist(),
        "reference.type": "line",
        "reference.velocity": draw(-0.3, 0.3, 3).tolist(),
    }
    return tiltsim.load_scenario(SETPOINT, changes)


def routh_roots(scenario):
    """The poles of the error loops that the law follows, in closed form."""
    loops = error_loops(scenario.controller.resolve_gains(), 1.0, 1.0)
    return np.concatenate([np.roots(loop.polynomial) for loop in loops if loop.name != "position"])


def distance(found, expected):
    """The largest distance of an expected value to the found ones, each taken once."""
    left, far = list(found), 0.0
    for value in expected:
        nearest = min(left, key=lambda other: abs(other - value))
        left.remove(nearest)
        far = max(far, abs(nearest - value))
    return far


@pytest.mark.parametrize("seed", range(4))
def test_poles_are_the_roots_of_the_routh_polynomials(seed):
    """Under the exact matrix; nothing follows the horizontal position, two double integrators."""
    scenario = random_hover(seed)
    found = tiltsim.stability(scenario)
    moving = found.poles[np.abs(found.poles) > 1e-3]
    assert len(moving) == 12
    assert distance(moving, routh_roots(scenario)) < 1e-8
    assert found.kind == "rest"
    assert found.residual < 1e-9
    assert not found.stable  # its place drifts


RANDOM = [
    pytest.param(seed, engine, marks=marks, id=f"{seed}-{engine}")
    for seeds, engine, marks in (((0, 1), "python", ()), (range(20), "native", pytest.mark.slow))
    for seed in seeds
]


@pytest.mark.parametrize(("seed", "engine"), RANDOM)
def test_matrix_and_poles_agree_with_a_flown_step(seed, engine):
    """A step's matrix is the solver's polynomial of the linear system's matrix; its poles likewise.

    The servos' poles are double and defective. An error of differences splits such an eigenvalue by
    the error's root, so neither side has single ones to compare: the mean of the split eigenvalues
    is well posed, and both sides take it.
    """
    scenario = random_line(seed)
    found = tiltsim.stability(scenario)
    motion, state = make_motion(scenario, engine), found.equilibrium.root.state
    coordinates, timestep = motion.coordinates, scenario.simulation.timestep
    step = derivative_at(
        lambda at: coordinates.between(state, motion.flown(0, at, 1)), coordinates, state
    )
    order = 4 if scenario.simulation.plant == "mujoco" else 3
    power = growth = np.eye(coordinates.size)
    for term in range(1, order + 1):
        power = power @ found.equilibrium.root.derivative * (timestep / term)
        growth = growth + power
    assert np.abs(step - growth).max() < 1e-8 * np.abs(growth).max()
    kept = found.equilibrium.kept
    flown, _, _ = spectrum(step[np.ix_(kept, kept)], ERROR)
    factors = np.polynomial.Polynomial(1.0 / np.array([factorial(i) for i in range(order + 1)]))
    assert distance(flown, factors(timestep * found.poles)) < 1e-5 * timestep


def test_the_plants_have_the_same_poles_but_for_the_servos():
    """Pods of 1e-9 kg move the other poles by less than a millionth."""
    thesis, mujoco = stability_at(setpoint("thesis")).poles, stability_at(setpoint())
    assert distance(mujoco.poles / 800.0, thesis / 800.0) < 1e-6
    servos = next(mode for mode in mujoco.modes if mode.name == "tilt servos")
    assert (servos.count, servos.frequency) == (8, pytest.approx(300.0, rel=1e-4))


def test_the_differences_are_as_good_as_symbolic_derivatives():
    casadi = pytest.importorskip("casadi")
    found = setpoint("thesis")
    system, scenario = linearization_at(found), found.motion.scenario
    coordinates, at = found.motion.coordinates, found.root.state
    symbolic = tiltsim.symbolic(scenario)
    state = casadi.SX.sym("state", len(at))
    jacobian = casadi.jacobian(symbolic.closed_loop(0.0, state), state)
    exact = casadi.Function("jacobian", [state], [jacobian])(at).full()
    lift = derivative_at(lambda moved: moved, coordinates, at)
    columns = [coordinates.rates(at, column) for column in (exact @ lift).T]
    assert pytest.approx(np.array(columns).T, rel=1e-8, abs=1e-7) == system.A


def test_a_linear_system_predicts_a_flight():
    """A small step of a rotor's acceleration, in MuJoCo, to the square of its size."""
    found = setpoint()
    system, motion = linearization_at(found), make_motion(found.motion.scenario, "python")
    start, coordinates = found.root.state, motion.coordinates
    motion.offsets[1] = 1e-2
    steps = 20
    moved = coordinates.between(start, motion.flown(0, start, steps))
    time = steps * motion.scenario.simulation.timestep
    whole = np.block([[system.A, system.B[:, 1:2]], [np.zeros((1, len(moved) + 1))]])
    powers = np.eye(len(whole))
    expected = np.zeros(len(whole))
    start_at = np.array((*np.zeros(len(moved)), 1e-2))
    for order in range(1, 60):  # the exponential series
        powers = powers @ whole * (time / order)
        expected = expected + powers @ start_at
    assert moved == pytest.approx(expected[:-1], rel=1e-4, abs=1e-9)


def test_the_open_loop_is_the_vehicle():
    """Integrators only; with the feedback it is the closed loop."""
    closed = tiltsim.linearize(SETPOINT, loop="closed")
    vehicle = tiltsim.linearize(tiltsim.load_scenario(SETPOINT, THESIS), loop="open")
    assert vehicle.A[12:] == pytest.approx(0.0, abs=1e-7)  # rotors turn as commanded
    assert vehicle.B[12:] == pytest.approx(np.eye(4), abs=1e-9)
    assert np.linalg.matrix_power(vehicle.A, 6) == pytest.approx(0.0, abs=1e-3)
    opened = closed.opened()
    assert opened.A + opened.B @ closed.feedback == pytest.approx(closed.A, abs=1e-9)
    assert [signal.text for signal in vehicle.inputs] == [
        f"rotor_acceleration_{rotor} [rad/s^2]" for rotor in (1, 2, 3, 4)
    ]
    assert vehicle.state["x"] == pytest.approx(0.38, abs=1e-2)  # as published, behind by 0.38 m


def test_to_control_names_the_signals():
    pytest.importorskip("control")
    system = tiltsim.linearize(random_hover(0))
    space = system.to_control()
    assert space.state_labels == [signal.name for signal in system.states]
    assert space.input_labels == [signal.name for signal in system.inputs]
    assert space.output_labels[:3] == ["x", "y", "z"]
    assert pytest.approx(system.A) == space.A
    assert space.dt == 0


def test_a_sampled_controller_gives_a_system_in_discrete_time():
    """On a set point of slow gains, sampled at 10 ms: near the continuous one."""
    slow = random_hover(1)
    sampled = slow.replace({"simulation.control_timestep": 0.01})
    found = equilibrium_of(sampled)
    system = linearization_at(found)
    assert system.timestep == pytest.approx(0.01)
    poles = exponents(system.poles, system.timestep)
    continuous = tiltsim.linearize(slow).poles
    assert 1e-3 < distance(poles, continuous) < 0.5
    assert stability_at(found).poles.real.max() < 1e-3


def test_results_are_one_line_in_python_and_a_table_in_a_notebook():
    found = stability_at(setpoint())
    assert repr(found) == "<Stability of a rest point: stable, 0 neutral of 24 states>"
    assert found._repr_html_().count("<tr>") == 1 + len(found.modes)
    system = tiltsim.linearize(SETPOINT)
    assert repr(system).startswith("<Linearization, closed loop, continuous: 24 states, ")


def test_neutral_states_are_counted_but_do_not_grow():
    """A hexarotor's rotors have two combinations that move nothing."""
    found = tiltsim.stability("fleet/hexarotor#hover")
    assert (found.stable, found.neutral) == (True, 2)
    assert found.modes[0].name == "rotors"
    assert "integral_x" not in found.states  # without a gain


AT_REST = {"reference.type": "setpoint"}


def test_a_frame_moves_with_a_line():
    line = {"reference.type": "line", "reference.velocity": [0.5, -0.2, 0.1]}
    moving = tiltsim.load_scenario(SETPOINT, {**THESIS, **line})
    found = tiltsim.stability(moving)
    assert distance(found.poles, tiltsim.stability(moving.replace(AT_REST)).poles) < 1e-6
    assert found.residual < 1e-9


def test_double_integrators_are_not_stable_but_single_ones_are():
    for matrix, timestep in ((np.array([[0.0, 1.0], [0.0, 0.0]]), None), (np.eye(2), 0.1)):
        poles = exponents(np.linalg.eigvals(matrix), timestep)
        assert is_stable(matrix, poles, timestep) == (timestep is not None)


def test_an_undamped_swing_is_not_stable_beside_neutral_states_either():
    swing = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    assert not is_stable(swing, np.linalg.eigvals(swing), None)
    damped = swing - np.diag([0.0, 0.1, 0.0])
    assert is_stable(damped, np.linalg.eigvals(damped), None)


def test_the_slowest_mode_comes_first():
    """A fast swing that lasts before a slow pole, and neutral states before both."""
    matrix = np.zeros((4, 4))
    matrix[0, 0] = -1.0
    matrix[1:3, 1:3] = [[-0.1, 50.0], [-50.0, -0.1]]
    modes = modes_of(matrix, ("z", "p", "q", "x"), None)
    assert [mode.frequency for mode in modes] == [0.0, pytest.approx(50.0, rel=1e-4), 1.0]
    found = stability_at(setpoint("thesis"))
    assert (np.diff(found.poles.real) <= 0.0).all()


def test_a_multiple_pole_that_errors_split_is_its_mean():
    """A critically damped servo: an error of 1e-11 splits -300 by 1e-3; a pole 0.1 away stays."""
    matrix = np.zeros((3, 3))
    matrix[:2, :2] = [[0.0, 1.0], [-9e4 * (1.0 + 1e-11), -600.0]]
    matrix[2, 2] = -300.1
    split = np.sort_complex(np.linalg.eigvals(matrix))
    assert np.abs(split[1:] + 300.0).min() > 5e-4
    values, _, _ = spectrum(matrix, 2e-11)
    assert distance(values, (-300.0, -300.0, -300.1)) < 1e-8


def test_modes_group_equal_poles_and_name_their_states():
    block = np.array([[-1.0, 2.0], [-2.0, -1.0]])
    matrix = np.kron(np.eye(2), block)
    (mode,) = modes_of(matrix, ("x", "vx", "rotor_speed_1", "rotor_speed_2"), None)
    assert (mode.count, mode.name) == (4, "x")
    assert (mode.frequency, mode.damping) == (pytest.approx(5**0.5), pytest.approx(5**-0.5))


def test_a_negative_multiplier_is_one_pole():
    """Its logarithm is complex, without a partner."""
    modes = modes_of(np.diag([-0.5, 0.3]), ("x", "y"), 1.0)
    assert [(mode.name, mode.count) for mode in modes] == [("x", 1), ("y", 1)]


def test_the_rest_point_has_the_commanded_attitude():
    """Upside down; level attitude, the farthest from there, is also a rest point."""
    changes = {"simulation.plant": "rigid_body", "simulation.engine": "python"}
    changes |= {"controller.turn_time": 1.0, "simulation.duration": 1.0}
    found = tiltsim.stability(tiltsim.load_scenario("fleet/omni_octorotor#upside_down", changes))
    assert found.stable
    quaternion = found.equilibrium.root.state[3:7]
    assert np.abs(quaternion) == pytest.approx((0.0, 1.0, 0.0, 0.0), abs=1e-9)


def test_a_rest_point_beyond_a_singular_attitude_does_not_count():
    """From a pitch of -1.4 rad, beyond the curve, Newton's method jumps to its near side."""
    beyond = {**THESIS, "simulation.duration": 0.1, "initial.attitude": [0.0, -1.4, 0.0]}
    with pytest.raises(tiltsim.InputError, match="found no rest point near its flight"):
        tiltsim.stability(tiltsim.load_scenario(SETPOINT, beyond))


LINE = {"reference.type": "line", "reference.velocity": [0.5, 0.0, 0.1]}

REFUSED = {
    "a line that accelerates through air": (
        {**LINE, "reference.acceleration": [0.1, 0, 0], "air.drag.linear": [0.1, 0.1, 0.1]},
        "reference.acceleration = .*: with air.drag",
    ),
    "a line that climbs above ground": (
        {**LINE, "air.ground_effect.height": -1.0},
        "the line climbs or descends: with air.ground_effect",
    ),
    "a table that ends": (
        {"gait": {"type": "table", "rows": [[0.0, *[0.0] * 4], [1.0, *[0.1] * 4]]}},
        "gait.repeat = false: a table that does not repeat ends; set it to true",
    ),
    "noise": ({"sensors.position_noise": 0.1}, "sensors.position_noise: with noise"),
    "a moving gait": (
        {"gait.type": "trot_continuous", "gait.amplitude": 0.5, "gait.period": 2.0},
        "period of 2 s",
    ),
}


def test_a_path_ends_at_a_set_point():
    there = {"reference.type": "setpoint", "reference.position": [0.3, 0.0, 0.0]}
    rows = [[0.1 * step, 0.1 * step, 0.0, 0.0] for step in range(4)]
    path = {"reference.type": "table", "reference.rows": rows}
    found, expected = (
        tiltsim.stability(tiltsim.load_scenario(SETPOINT, THESIS | changes))
        for changes in (path, there)
    )
    assert found.equilibrium.time == pytest.approx(0.3, abs=2e-3)
    rests = [each.equilibrium.root.state[0] for each in (found, expected)]
    assert rests[0] == pytest.approx(rests[1], abs=1e-6)
    assert distance(found.poles, expected.poles) < 1e-8


@pytest.mark.parametrize("case", REFUSED)
def test_refusals(case):
    changes, message = REFUSED[case]
    with pytest.raises(tiltsim.InputError, match=message):
        tiltsim.linearize(tiltsim.load_scenario(SETPOINT, {**THESIS, **changes}))


@tiltsim.law
def upright(observed):
    """Altitude with both poles at -3, attitude with both at -10; level rotors."""
    roll, pitch, _ = observed.attitude
    p, q, r = observed.body_rates
    body, rise = observed.vehicle, observed.reference.position[2] - observed.position[2]
    arm, drag = observed.torque[0][1], observed.torque[2][0]
    lift = body.mass * (body.gravity + 9.0 * rise - 6.0 * observed.velocity[2])
    a = 0.5 / arm * body.inertia_xx * (-100.0 * roll - 20.0 * p)
    b = 0.5 / arm * body.inertia_yy * (-100.0 * pitch - 20.0 * q)
    c = 0.25 / drag * body.inertia_zz * (-10.0 * r)
    each = 0.25 * lift
    return tiltsim.Command(thrusts=[each - b + c, each + a - c, each + b + c, each - a - c])


LAGGED = {  # s^2 times the rotors' lag, 1 + s / 100, and the law's polynomial in altitude
    "geometric": [0.01, 1.0, 4.0, 4.0],
    "indi": [0.01, 1.0, 4.0, 4.0],
    "pid": [0.01, 1.0, 3.0, 3.9, 0.9],
    "own": [0.01, 1.0, 6.0, 9.0],
}


@pytest.mark.parametrize("law", LAGGED)
def test_baselines_and_own_laws_have_the_altitude_poles_of_their_gains(law):
    hover = "ch04_tracking/setpoint#rho_0_modified"
    given = {"controller": upright} if law == "own" else {}
    changes = {} if law == "own" else {"controller.law": law}
    found = tiltsim.stability(tiltsim.load_scenario(hover, changes, **given))
    for pole in np.roots(LAGGED[law]):
        assert np.abs(found.poles - pole).min() < 1e-6 * abs(pole)
    # The own law leaves x and y, and yaw, where they are put.
    assert (found.neutral > 0) == (law == "own")


EXACT_HOVER = "beyond/setpoint_exact_decoupler#rho_0"


def limited(speed, plant="rigid_body"):
    """A hover with rotors that turn at most at a speed."""
    changes = {"simulation.plant": plant, "vehicle.max_rotor_speed": speed}
    return tiltsim.load_scenario(EXACT_HOVER, changes)


def test_a_rotor_just_below_its_limit_is_not_slowed_by_it():
    """Hover takes 361.383 rad/s."""
    expected = tiltsim.stability(limited(None)).poles
    assert distance(tiltsim.stability(limited(361.39)).poles, expected) < 1e-6


LIMITED_ON = [pytest.param("rigid_body", marks=pytest.mark.slow), "mujoco"]


@pytest.mark.parametrize("plant", LIMITED_ON)
def test_a_rotor_at_its_limit_has_no_linear_system(plant):
    free = equilibrium_of(limited(None, plant))
    rotors = [name.startswith("rotor") for name in free.minimal.names]
    speed = np.abs(free.values[rotors]).max() + 1e-7
    at_limit = tiltsim.stability(limited(speed, plant))
    assert {f"rotor_speed_{rotor}" for rotor in (1, 2, 3, 4)} <= set(at_limit.corners)
    assert np.abs(at_limit.equilibrium.root.state).max() < speed + 1e-6  # not beyond it
    assert at_limit.report()["corners"] == list(at_limit.corners)
    assert "corners" in stability_text(at_limit)
    with pytest.raises(tiltsim.InputError, match="rests at a limit or at the edge of a dead zone"):
        linearization_at(at_limit.equilibrium)


@pytest.mark.parametrize("plant", LIMITED_ON)
def test_no_rest_point_lies_beyond_a_limit(plant):
    """It misses hover by 1e-4 rad/s."""
    with pytest.raises(tiltsim.InputError, match="found no rest point"):
        tiltsim.stability(limited(361.3829, plant))


GAIT_1 = "ch03_gaits/stabilization#gait_1"


def test_the_attitude_of_a_vehicle_that_drifts_sideways_rests():
    """Nothing holds x and y of ch. 3's gait 1; the other states move as a flight's do."""
    scenario = tiltsim.load_scenario(GAIT_1, THESIS)
    found = tiltsim.stability(scenario)
    assert found.left_out == ("x", "y", "vx", "vy")
    assert found.report()["left_out"] == list(found.left_out)
    assert "nothing holds them: x, y, vx, vy" in found._repr_html_()
    assert "left out  x, y, vx, vy: nothing holds them" in stability_text(found)
    assert not set(found.states) & set(found.left_out)
    assert found.stable
    motion, start = found.equilibrium.motion, found.equilibrium.root.state
    coordinates, kept, steps = motion.coordinates, found.equilibrium.kept, 1000
    offset = 1e-5 * np.random.default_rng(0).standard_normal(len(kept))
    whole = np.zeros(coordinates.size)
    whole[kept] = offset
    moved = motion.flown(0, coordinates.moved(start, whole), steps)
    values, vectors = np.linalg.eig(found.matrix)
    time = steps * scenario.simulation.timestep
    expected = (vectors * np.exp(values * time)) @ np.linalg.solve(vectors, offset.astype(complex))
    apart = coordinates.between(motion.flown(0, start, steps), moved)[kept]
    assert apart == pytest.approx(expected.real, rel=1e-3, abs=1e-8)


@pytest.mark.slow
def test_drag_gives_a_drifting_vehicle_its_airspeed():
    """Then its velocity also rests: where drag alone drives it sideways."""
    drag = {"simulation.plant": "rigid_body", "air": {"drag": {"linear": [0.1, 0.1, 0.1]}}}
    scenario = tiltsim.load_scenario(GAIT_1, drag)
    found = tiltsim.stability(scenario)
    assert found.left_out == ("x", "y")
    assert {"vx", "vy"} < set(found.states)
    slowest = -0.1 / scenario.vehicle.resolve().mass
    assert found.poles[:2].real == pytest.approx([slowest, slowest], rel=1e-3)


def test_a_flight_with_nothing_to_hold_it_up_says_that_x_and_y_were_left_out():
    with pytest.raises(tiltsim.InputError, match="also without x and y, which nothing holds"):
        tiltsim.stability(tiltsim.load_scenario("ch09_input_limits/hover#gait_5", THESIS))
