"""The baselines against the claims of their sources, on every plant and engine."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

import tiltsim
from tests.laws.test_laws import GUST
from tests.laws.test_multirotor import TILTS, mjcf
from tiltsim.laws.assembling import assemble
from tiltsim_controllers.laws.periodic_lqr import PeriodicVehicle, linear_orbit
from tiltsim_controllers.mathematics.attitude import attitude_error, rotation_matrix
from tiltsim_controllers.vehicle.rotors import force_and_torque, table_per_newton

CIRCLE = {"type": "circle", "radius": 1.0, "angular_frequency": 0.5}
ON_CIRCLE = {"position": [1.0, 0.0, 0.0], "velocity": [0.0, 0.5, 0.0]}
TROT = {"type": "trot_continuous", "amplitude": 0.3, "period": 1.0}
ONCE = {"type": "table", "rows": [[0, 0, 0, 0, 0], [1, 0, 0, 0, 0]], "repeat": False}
HOVER = (0.429 * 9.8 / (4 * 8.048e-6)) ** 0.5  # rad/s, of the tiltrotor
FREE = {"law": "geometric", "tilts": "free"}
BASELINES = {
    "geometric": {"controller": {"law": "geometric"}, "gait": TROT, "disturbance": GUST},
    "geometric free": {"controller": FREE, "reference": {"type": "setpoint", "roll": 0.2}},
    "geometric quadrotor": {"controller": {"law": "geometric"}, "vehicle": {"model": "quadrotor"}},
    "geometric multirotor": {
        "controller": {"law": "geometric"},
        "vehicle": {"model": "multirotor", "mjcf": mjcf("tilt_hexarotor")},
        "gait": TILTS,
    },
    "pid": {"controller": {"law": "pid"}, "gait": TROT, "disturbance": GUST},
    "indi": {"controller": {"law": "indi"}, "gait": TROT, "disturbance": GUST},
    "lqr": {
        "controller": {"law": "lqr"},
        "gait": {"type": "fixed", "angles": [0.1, -0.2, 0.1, 0.2]},
        "disturbance": GUST,
    },
    "lqr moving": {"controller": {"law": "lqr"}, "gait": TROT, "disturbance": GUST},
}


def fly(tables, **simulation):
    simulation = {"duration": 0.3, "engine": "python", **simulation}
    flight = tiltsim.simulate(
        {"reference": CIRCLE, "initial": ON_CIRCLE, **tables, "simulation": simulation}
    )
    assert flight.end.kind == "completed", flight.end
    return flight


@pytest.mark.parametrize("name", BASELINES)
def test_the_plants_agree(name):
    # About its orbit it turns at 2 rad/s: the gyroscopic torque, which the thesis omits, counts.
    other = "rigid_body" if name == "lqr moving" else "thesis"
    mujoco, equations = (fly(BASELINES[name], plant=plant) for plant in ("mujoco", other))
    # A servo that leads its command still lags by alpha'' / omega^2: for the gait 1.3e-4 rad, which
    # turns gravity for 0.3 s; for tilts that the law turns at once 2e-3 rad, for 0.05 s.
    bound = 3e-4 if "free" in name else 1e-4
    assert np.abs(mujoco["position"] - equations["position"]).max() < bound


NATIVE = ("geometric", "geometric free", "pid", "indi", "lqr", "lqr moving")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "plant"), [*((name, "mujoco") for name in NATIVE), ("geometric free", "thesis")]
)
def test_native_flights_are_those_in_python(name, plant):
    for timing in ({}, {"control_timestep": 0.004}):
        python, native = (
            fly(BASELINES[name], plant=plant, engine=engine, **timing)
            for engine in ("python", "native")
        )
        np.testing.assert_array_equal(python.samples, native.samples)


LATE = {"timestep": 0.0025, "control_timestep": 0.005, "control_latency": 0.02}


def test_the_rotors_own_control_is_not_delayed():
    """Fed back through 20 ms of latency, rotors of 100 1/s would be unstable by themselves."""
    tables = {
        "controller": {"law": "geometric"},
        "reference": {"type": "setpoint", "position": [0.2, 0.1, 0.1]},
        "initial": {"rotor_speed": HOVER},
    }
    flight = fly(tables, duration=2.5, **LATE)
    assert np.abs(flight["position"][-1] - [0.2, 0.1, 0.1]).max() < 0.02
    modelled = np.stack([flight[f"modelled_rotor_speed_{i}"] for i in (1, 2, 3, 4)], axis=1)
    speeds = flight["rotor_speeds"] * [-1.0, 1.0, -1.0, 1.0]
    late = slice(None, -2)  # 20 ms, two samples
    assert np.abs(speeds[2:] - modelled[late])[50:].max() < 2.0


INERTIA = np.array([2.24e-3, 2.99e-3, 4.80e-3])  # kg m^2, of the ar_drone_2


@pytest.fixture(scope="module")
def turned_over():
    """From 179 degrees of roll, with a position loop too slow to matter and fast rotors."""
    controller = {"law": "geometric", "position_bandwidth": 1e-3, "rotor_bandwidth": 2000.0}
    start = {"attitude": [np.radians(179.0), 0.0, 0.0], "position": [0.0, 0.0, 0.0]}
    tables = {"controller": controller, "reference": {"type": "setpoint"}, "initial": start}
    timing = {"duration": 2.0, "timestep": 5e-4, "record_timestep": 0.005, "plant": "thesis"}
    return fly({**tables, "vehicle": {"model": "quadrotor"}}, **timing)


def test_geometric_attitude_converges_exponentially_from_179_degrees(turned_over):
    """Lee et al. 2010, Proposition 1 and its proof: V(t) <= V(0) exp(-beta t)."""
    omega = turned_over["body_rates"]
    rotations = [rotation_matrix(a) for a in turned_over["attitude"]]
    error = np.array([(r - r.T)[[2, 0, 1], [1, 2, 0]] for r in rotations]) / 2.0
    psi = np.array([1.5 - 0.5 * np.trace(r) for r in rotations])
    stiffness, damping = INERTIA.mean() * 100.0, 2.0 * INERTIA.mean() * 10.0
    low, high = INERTIA.min(), INERTIA.max()
    # c, below the bound of the proof.
    c = 0.5 * min(
        damping,
        4.0 * damping * stiffness * low**2 / (damping**2 * high + 4.0 * stiffness * low**2),
        np.sqrt(stiffness * low),
    )
    value = 0.5 * (INERTIA * omega**2).sum(1) + stiffness * psi + c * (error * omega).sum(1)
    across = -c * damping / (2.0 * low)
    decrease = np.array([[c * stiffness / high, across], [across, damping - c]])
    above = 0.5 * np.array([[2.0 * stiffness / (2.0 - psi[0]), c], [c, high]])
    beta = np.linalg.eigvalsh(decrease)[0] / np.linalg.eigvalsh(above)[-1]
    assert beta > 0.0
    assert psi[0] == pytest.approx(2.0, abs=1e-3)
    time = turned_over["time"]
    assert (value <= value[0] * np.exp(-beta * time) * (1.0 + 1e-3)).all()
    assert psi[-1] < 1e-4


def test_geometric_attitude_ends_at_the_slow_pole_of_its_linearization(turned_over):
    stiffness, damping = INERTIA.mean() * 100.0, 2.0 * INERTIA.mean() * 10.0
    slow = np.roots([INERTIA[0], damping, stiffness]).max()
    time, roll = turned_over["time"], np.abs(turned_over["attitude"][:, 0])
    last = (time > 1.6) & (roll > 1e-6)
    slope = np.polyfit(time[last], np.log(roll[last]), 1)[0]
    # The rotors' lag of 0.5 ms moves the pole by the order of its product with it.
    assert slope == pytest.approx(slow, rel=0.01)


@pytest.mark.parametrize(("step", "turning"), [(0.002, 0.0), (0.0, 0.02)])
def test_indi_follows_a_step_of_yaw_as_designed(step, turning):
    """Smeur et al. 2016: with equal filters, ``s^2 + A k_Omega s + A k_Omega k_eta``, A the lag.

    So it does from an initial rate of yaw, which its filters know from the beginning.
    """
    lag, rate, attitude = 100.0, 27.0, 9.0
    tables = {
        "controller": {"law": "indi"},
        "reference": {"type": "setpoint", "yaw": step},
        "initial": {"rotor_speed": HOVER, "angular_velocity": [0.0, 0.0, turning]},
    }
    yaw = fly(tables, plant="thesis", duration=0.6)["attitude"][:, 2]
    # Yaw, its rate and the angular acceleration that the rotors make.
    system = np.array(
        [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-lag * rate * attitude, -lag * rate, -lag]]
    )
    ways = np.array([expm(system * t)[0] for t in 0.01 * np.arange(len(yaw))])
    designed = step * (1.0 - ways[:, 0]) + turning * ways[:, 1]
    # Speeds, not thrusts, follow with the lag: thrusts change by up to 1.5 % here, and the sine of
    # the error by its third power.
    assert np.abs(yaw - designed).max() < 0.015 * np.abs(designed).max()


def test_indi_lets_go_of_thrusts_that_make_neither_torque_nor_push():
    """The others of six would stay as they are, and push to the side."""
    hover = 6 * [np.sqrt(2.663 / 8.048e-6)]
    initial = {"rotor_speed": [s * w for s, w in zip(2 * [1.0, 1.05, 0.95], hover, strict=True)]}
    hexarotor = BASELINES["geometric multirotor"]
    gait = {"type": "fixed", "angles": 3 * [0.35, -0.35]}
    tables = {"gait": gait, "initial": initial, "reference": {"type": "setpoint"}}
    flight = fly({**hexarotor, **tables, "controller": {"law": "indi"}})
    spread = np.ptp(flight["thrusts"], axis=1)
    assert spread[0] > 0.5
    # The rotors' 100 1/s in 0.3 s leave nothing; the attitude answers the push meanwhile.
    assert spread[-1] < 0.01 * spread[0]


@pytest.fixture(scope="module")
def regulated():
    """A flight under the regulator, and the hover that it is designed for."""
    tilts = [0.1, -0.2, 0.1, 0.2]
    tables = {
        "controller": {"law": "lqr"},
        "gait": {"type": "fixed", "angles": tilts},
        "reference": {"type": "setpoint"},
    }
    scenario = tiltsim.load_scenario({**tables, "simulation": {"plant": "thesis"}})
    airframe = tiltsim.airframe(scenario)
    return assemble(scenario), scenario.controller.solution(airframe), airframe


def test_lqr_closes_the_loop_with_the_poles_of_the_riccati_solution(regulated):
    assembly, solution, airframe = regulated
    (thrusts,), (hover,), vehicle = solution.thrusts, solution.states, airframe.vehicle
    table = table_per_newton(vehicle.table, vehicle.thrust_coefficients)
    rotors = (part[None] for part in force_and_torque(table, airframe.initial_tilts))
    inertia = np.reshape(vehicle.inertia, (3, 3))
    known = PeriodicVehicle(1.0, vehicle.mass, vehicle.gravity, inertia, 0.0, 100.0, *rotors)
    a, b = (m[0] for m in linear_orbit(known, solution.states, solution.thrusts))
    # Half of the Hamiltonian's poles, in the left half plane, with Bryson's weights.
    errors = np.r_[np.repeat([0.5, 1.0, 0.3, 3.0], 3), np.full(4, np.inf)]
    weight = np.diag((0.3 * thrusts) ** 2)
    hamiltonian = np.block([[a, -b @ weight @ b.T], [-np.diag(errors**-2.0), -a.T]])
    poles = np.linalg.eigvals(hamiltonian)
    designed = poles[poles.real < 0.0]
    assert designed.real.max() < -0.1

    equations, setup = assembly.loop.equations, assembly.setup
    speeds = np.sqrt(thrusts / airframe.vehicle.thrust_coefficients) * airframe.vehicle.spins
    rest = np.r_[np.zeros(6), rotation_matrix(hover[6:9]).ravel(), np.zeros(3), speeds]

    def rates(state):
        state = state.tolist()
        inputs = equations.inputs(0.0, state, setup.parameters, setup.knots)
        found = equations.rates(0.0, state, inputs, setup.parameters, setup.knots, (0.0, 0.0, 0.0))
        return np.array(found)

    assert np.abs(rates(rest)).max() < 1e-9
    # On the nine entries of the rotation: the tangent space is invariant, so its poles are among
    # those found.
    steps = 1e-5 * np.maximum(1.0, np.abs(rest))
    jacobian = [
        (rates(rest + h * e) - rates(rest - h * e)) / (2 * h)
        for h, e in zip(steps, np.eye(len(rest)), strict=True)
    ]
    found = np.linalg.eigvals(np.array(jacobian).T)
    nearest = np.abs(designed[:, None] - found[None, :]).min(axis=1)
    assert (nearest < 1e-4 * np.maximum(1.0, np.abs(designed))).all(), nearest


def test_lqr_cost_decreases():
    tables = {
        "controller": {"law": "lqr"},
        "reference": {"type": "setpoint", "position": [0.02, -0.01, 0.01]},
        "initial": {"rotor_speed": HOVER},
    }
    flight = fly(tables, plant="thesis", duration=1.0)
    airframe = tiltsim.airframe(flight.scenario)
    (cost,) = flight.scenario.controller.solution(airframe).cost
    errors = flight["position"] - flight["reference_position"]
    pushed = flight["thrusts"] - 0.25 * 0.429 * 9.8
    x = np.hstack([errors, flight["velocity"], flight["attitude"], flight["body_rates"], pushed])
    value = np.einsum("ni,ij,nj->n", x, cost, x)
    assert (np.diff(value) < 0.0).all()


ORBITING = {
    "controller": {"law": "lqr"},
    "gait": {"type": "trot_continuous", "amplitude": 0.5, "period": 0.4},
    "reference": {"type": "setpoint"},
}


@pytest.fixture(scope="module")
def orbit():
    """The regulator about a trot's orbit, and the errors of a flight that starts near it."""
    scenario = tiltsim.load_scenario({**ORBITING, "simulation": {"plant": "thesis"}})
    airframe = tiltsim.airframe(scenario)
    solution = scenario.controller.solution(airframe)
    thrust = np.array(airframe.vehicle.thrust_coefficients)
    nodes = len(solution.states)

    def errors(moved, duration):
        """At the nodes, shape (nodes flown, states), as the law has them."""
        start = solution.states[0] + moved
        initial = {
            "position": start[:3],
            "velocity": start[3:6],
            "attitude": start[6:9],
            "angular_velocity": start[9:12],
            "rotor_speed": np.sqrt(start[12:] / thrust),
        }
        initial = {key: values.tolist() for key, values in initial.items()}
        timing = {"timestep": 0.4 / nodes, "record_timestep": 0.4 / nodes}
        tables = {**ORBITING, "initial": initial}
        flight = fly(tables, plant="thesis", duration=duration, **timing)
        names = "position", "velocity", "attitude", "body_rates", "thrusts"
        states = np.hstack([flight[name] for name in names])
        near = solution.states[np.arange(len(states)) % nodes]
        found = states - near
        for row, state, desired in zip(found, states, near, strict=True):
            actual, planned = (rotation_matrix(values[6:9]) for values in (state, desired))
            row[6:9] = -attitude_error(actual, planned)
        return found

    return solution, errors


def test_about_an_orbit_disturbances_change_as_the_riccati_solution_says(orbit):
    solution, errors = orbit
    moved = 1e-4 * np.random.default_rng(1).choice([-1.0, 1.0], 16)
    undisturbed, disturbed = errors(0.0 * moved, 0.4), errors(moved, 0.4)
    # The table is linear between nodes 5 ms apart, which the orbit feels by the square of it.
    assert np.abs(undisturbed[-1]).max() < 1e-3
    change = (disturbed - undisturbed)[[0, -1]]
    whole = np.linalg.multi_dot(solution.transitions[::-1])
    np.testing.assert_allclose(change[1], whole @ change[0], atol=2e-3 * np.abs(change[0]).max())


def test_the_cost_about_an_orbit_decreases(orbit):
    solution, errors = orbit
    moved = np.r_[0.02, -0.01, 0.01, np.zeros(13)]
    found = errors(moved, 1.2)
    costs = solution.cost[np.arange(len(found)) % len(solution.cost)]
    value = np.einsum("ni,nij,nj->n", found, costs, found)
    assert (np.diff(value) < 0.0).all()
    assert value[-1] < 0.05 * value[0]


def test_about_an_orbit_that_rests_the_gains_equal_the_hover_gains():
    angles = [0.1, -0.2, 0.1, 0.2]
    tables = {"controller": {"law": "lqr"}, "disturbance": GUST}
    flights = [
        fly({**tables, "gait": gait}, plant="thesis")
        for gait in (
            {"type": "fixed", "angles": angles},
            {"type": "waypoints", "angles": [angles, angles], "period": 0.2},
        )
    ]
    np.testing.assert_allclose(flights[0].samples, flights[1].samples, rtol=1e-7, atol=1e-9)


@pytest.mark.slow
def test_the_multipliers_about_an_orbit_agree_with_the_riccati_solution():
    scenario = tiltsim.load_scenario({**ORBITING, "simulation": {"duration": 4.0}})
    flown = tiltsim.stability(scenario).multipliers
    airframe = tiltsim.airframe(scenario)
    designed = scenario.controller.solution(airframe).multipliers
    nearest = np.abs(flown[:, None] - designed[None, :]).min(axis=1)
    # The servos lag behind the gait's corners, which the design does not know: yaw feels it most.
    assert nearest.max() < 2e-3
    assert abs(designed[0]) == pytest.approx(0.569, abs=1e-3)


def test_a_gait_without_an_orbit_is_refused():
    tables = {"controller": {"law": "lqr"}, "gait": {**TROT, "amplitude": 1.55}}
    with pytest.raises(tiltsim.InputError, match=r"^scenario: controller.law = .* no orbit"):
        tiltsim.simulate(tables)


def test_free_tilts_hold_a_pose_that_a_gait_cannot():
    tables = {
        "controller": FREE,
        "reference": {"type": "setpoint", "roll": 0.3, "pitch": -0.2},
        "initial": {},
    }
    flight = fly(tables, plant="thesis", duration=4.0, timestep=0.004)
    assert flight["attitude"][-1] == pytest.approx([0.3, -0.2, 0.0], abs=1e-4)
    assert np.abs(flight["position"][-1]).max() < 1e-3


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ({"controller": FREE, "vehicle": {"model": "quadrotor"}}, "do not tilt"),
        ({"controller": FREE, "gait": TROT}, "commands the tilts itself"),
        (
            {"controller": {"law": "geometric"}, "reference": {"type": "setpoint", "roll": 0.1}},
            "is an output of the law with controller.tilts = free only",
        ),
        (
            {"controller": {"law": "lqr"}, "gait": {**TROT, "type": "trot_instant"}},
            'gait.type = "trot_instant": its tilt angles jump',
        ),
        ({"controller": {"law": "lqr"}, "gait": {**TROT, "period": 21.0}}, "at most 20 s"),
        (
            {"controller": {"law": "lqr"}, "gait": ONCE},
            "gait.repeat = false: .* needs a gait that repeats",
        ),
        (
            {"controller": {"law": "pid", "velocity_gains": [1.0, -1.0]}},
            "velocity k2 = -1 must be positive",
        ),
        (
            {"controller": {"law": "geometric", "tilt_bandwidth": 5.0}},
            'needs controller.tilts = "free"',
        ),
    ],
)
def test_unsuitable_baselines_are_refused_in_one_line(tables, message):
    with pytest.raises(tiltsim.InputError, match=message):
        tiltsim.load_scenario(tables)
