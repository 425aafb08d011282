"""Margins of loops broken at inputs and measured states."""

from __future__ import annotations

from math import floor

import numpy as np
import pytest

import tiltsim
from tests.linear.test_rest import SETPOINT, random_hover
from tiltsim.linear.linearization import Linearization, Signal, linearize
from tiltsim.linear.margins import (
    BrokenLoop,
    Margin,
    _margin,
    broken_loops,
    frequency_grid,
    margins_of,
)


def third_order(gains):
    """Margins of ``(k1 s^2 + k2 s + k3) / s^3``: smallest gain, phase and delay at the crossing."""
    k1, k2, k3 = gains
    # |L| = 1 in u = w^2: u^3 = (k3 - k1 u)^2 + k2^2 u
    roots = np.roots([1.0, -(k1**2), 2.0 * k1 * k3 - k2**2, -(k3**2)])
    crossings = [float(root.real) ** 0.5 for root in roots if abs(root.imag) < 1e-9 < root.real]
    values = {w: (k3 - k1 * w**2 + 1j * k2 * w) / (-1j * w**3) for w in crossings}
    phases = {w: abs(np.angle(-value)) for w, value in values.items()}
    delays = [((np.angle(value) + np.pi) % (2.0 * np.pi)) / w for w, value in values.items()]
    return k3 / (k1 * k2), min(phases.values()), min(delays)


@pytest.fixture(scope="module")
def scenario():
    return random_hover(2)


@pytest.fixture(scope="module")
def margins(scenario):
    return {margin.place: margin for margin in tiltsim.margins(scenario)}


def test_margins_of_all_inputs_equal_the_margins_of_the_error_loops(scenario, margins):
    """Under the exact matrix the loci are the loops of roll, pitch, yaw and altitude."""
    gains = scenario.controller.resolve_gains()
    loops = [third_order(own) for own in gains.loops.values()]
    found = margins["all inputs"]
    assert found.gain[0] == pytest.approx(max(loop[0] for loop in loops), rel=1e-6)
    assert found.phase == pytest.approx(min(loop[1] for loop in loops), rel=1e-6)
    assert found.delay == pytest.approx(min(loop[2] for loop in loops), rel=1e-6)
    assert found.gain[1] == np.inf


def test_gain_margins_of_measured_states_agree_with_routh(scenario, margins):
    """The altitude's gain may grow until K1 K2 = K3, its rate's may shrink to that."""
    k1, k2, k3 = scenario.controller.resolve_gains().altitude
    ratio = k1 * k2 / k3
    assert margins["z"].gain == (0.0, pytest.approx(ratio, rel=1e-6))
    assert margins["vz"].gain == (pytest.approx(1.0 / ratio, rel=1e-6), np.inf)
    assert "x" not in margins  # nothing follows it


def test_a_loop_at_the_edge_of_its_disk_is_unstable(scenario):
    """Some factors of the disk's size at the frequency of its peak put a pole on the axis."""
    system = linearize(scenario)
    margin = margins_of(system)[0]
    together = next(broken_loops(system))
    grid = frequency_grid(system)
    inverse = np.linalg.inv(np.eye(4) + together.transfer(grid))
    peak = int(np.argmax(np.linalg.norm(2.0 * inverse - np.eye(4), ord=2, axis=(1, 2))))
    left, sizes, right = np.linalg.svd(2.0 * inverse[peak] - np.eye(4))
    worst = np.outer(right[0].conj(), left[:, 0].conj()) / sizes[0]  # d, of norm alpha / 2
    factor = np.linalg.solve(np.eye(4) - worst, np.eye(4) + worst)
    loop = together.transfer(grid[[peak]])[0] @ factor
    assert abs(np.linalg.det(np.eye(4) + loop)) < 1e-9
    assert 2.0 * np.linalg.norm(worst, ord=2) == pytest.approx(margin.disk)


def test_opening_a_loop_leaves_the_others_closed():
    """With the broken loop's own feedback the closed loop is back."""
    system = linearize(tiltsim.load_scenario(SETPOINT, {"simulation.plant": "thesis"}))
    loops = list(broken_loops(system))
    assert len(loops) == 1 + 4 + 12
    for loop in loops:
        closed = loop.A + loop.B @ loop.C
        assert closed == pytest.approx(system.A, abs=1e-9)


INTEGRAL = {"gait": {"type": "fixed", "angles": [0.0, 0.0, 0.0, 0.0]}}


def test_a_broken_measurement_reaches_no_integrator_either():
    """At zero gain of a measured position nothing of the controller moves with it."""
    system = linearize(tiltsim.load_scenario("beyond/constant_disturbance#with_integral", INTEGRAL))
    names = [signal.name for signal in system.states]
    opened = {loop.place: loop.A for loop in broken_loops(system)}
    for axis in "xyz":
        row, column = names.index(f"integral_{axis}"), names.index(axis)
        assert system.A[row, column] == pytest.approx(-1.0)
        assert np.abs(opened[axis][:, column]).max() < 1e-6


def test_the_position_of_an_integral_law_bears_any_smaller_gain():
    """The loop is stable at all factors below the upper limit, which python-control also finds."""
    system = linearize(tiltsim.load_scenario("beyond/constant_disturbance#with_integral", INTEGRAL))
    margin = next(margin for margin in margins_of(system) if margin.place == "x")
    loop = next(loop for loop in broken_loops(system) if loop.place == "x")
    low, high = margin.gain
    assert low == 0.0

    def growth(factor):
        return np.linalg.eigvals(loop.A + factor * loop.B @ loop.C).real.max()

    assert growth(0.01) < 1e-6
    assert growth(0.999 * high) < 1e-6 < growth(1.001 * high)
    control = pytest.importorskip("control")
    space = control.ss(loop.A, loop.B, -loop.C, 0.0)
    with np.errstate(over="ignore"):  # at roots of python-control's polynomials near infinity
        gain, phase, *_ = control.margin(space)
    assert (gain, np.radians(phase)) == (pytest.approx(high, rel=1e-3), pytest.approx(margin.phase))


QUADROTOR = {
    "vehicle": {"model": "quadrotor"},
    "controller": {"law": "quadrotor_attitude_altitude"},
    "reference": {"type": "attitude_altitude"},
}


@pytest.mark.parametrize("plant", ["mujoco", "rigid_body"])
def test_thrusts_of_the_quadrotor_are_in_newtons(plant):
    system = linearize({**QUADROTOR, "simulation": {"plant": plant}})
    vehicle = tiltsim.parse_scenario(QUADROTOR).vehicle.resolve()
    states = [signal.name for signal in system.states]
    assert [signal.text for signal in system.inputs] == [f"thrust_{i} [N]" for i in (1, 2, 3, 4)]
    weight = vehicle.mass * vehicle.gravity
    assert [*system.command.values()] == pytest.approx([0.25 * weight] * 4)
    assert system.B[states.index("vz")] == pytest.approx(1.0 / vehicle.mass)
    push = vehicle.arm_length / vehicle.inertia_xx
    assert system.B[states.index("p")] == pytest.approx([0.0, push, 0.0, -push], abs=1e-9)


@pytest.mark.parametrize(
    ("law", "plant"),
    [("pid", "mujoco"), ("indi", "rigid_body"), ("geometric", "mujoco"), ("lqr", "rigid_body")],
)
def test_a_baseline_of_the_quadrotor_is_opened_at_its_rotors(law, plant):
    scenario = tiltsim.load_scenario(f"beyond/baselines#{law}_quadrotor")
    system = linearize(scenario.replace({"simulation.plant": plant}))
    opened = system.opened()
    rotors = [i for i, state in enumerate(system.states) if state.name.startswith("rotor_speed")]
    assert [signal.name for signal in system.inputs] == [
        f"rotor_acceleration_{rotor}" for rotor in (1, 2, 3, 4)
    ]
    assert np.abs(system.A[rotors]).max() > 1e3
    assert np.abs(opened.A[rotors]).max() < 1e-6
    assert opened.B[rotors] == pytest.approx(np.eye(4))


@pytest.mark.slow
def test_disk_margins_are_worst_between_the_frequencies_of_the_grid():
    """Near instability, where the peak is narrower than the grid."""
    changes = {"vehicle.rotor_time_constant": 0.052, "simulation.control_timestep": 0.0}
    allowed = {"reference.type": "setpoint", "controller.allow_unstable": True}
    scenario = tiltsim.load_scenario("beyond/actuators#rotor_lag", {**changes, **allowed})
    system = linearize(scenario)
    swing = np.abs(system.poles[np.abs(system.poles.imag) > 1.0]).astype(float)
    fine = np.concatenate([near + np.linspace(-0.3, 0.3, 1201) for near in np.unique(swing)])
    for margin, loop in list(zip(margins_of(system), broken_loops(system), strict=True))[:2]:
        transfer = loop.transfer(fine[fine > 0.0])
        eye = np.eye(transfer.shape[-1])
        sizes = np.linalg.norm(2.0 * np.linalg.inv(eye + transfer) - eye, ord=2, axis=(1, 2))
        assert margin.disk == pytest.approx(2.0 / sizes.max(), rel=1e-3)
        assert margin.disk <= 2.0 / sizes.max() * (1.0 + 1e-9)


def scalar_loop(pole, gain, timestep):
    """``x' = pole x + u`` with ``u = -gain x``, or from sample to sample."""
    one, signal = np.ones((1, 1)), Signal("x", "m")
    return Linearization(
        A=(pole - gain) * one,
        B=one,
        C=one,
        D=0.0 * one,
        feedback=-gain * one,
        states=(signal,),
        inputs=(signal,),
        outputs=(signal,),
        timestep=timestep,
        state={},
        command={},
        loop="closed",
    )


def test_a_sampled_loop_may_reach_minus_one_at_the_nyquist_frequency():
    """``L = gain / (z - pole)`` is real at z = -1 and nowhere else between."""
    margin = margins_of(scalar_loop(0.5, 0.6, 0.01))[0]
    assert margin.gain == (0.0, pytest.approx(1.5 / 0.6))


def test_an_unstable_vehicle_needs_a_gain():
    """``L = gain / (s - pole)`` reaches -1 at frequency zero."""
    margin = margins_of(scalar_loop(1.0, 3.0, None))[0]
    assert margin.gain == (pytest.approx(1.0 / 3.0), np.inf)


def test_report_has_null_where_there_is_no_limit():
    margin = Margin("z", (0.0, np.inf), np.inf, np.inf, np.nan, 2.0)
    report = margin.report()
    assert report == {"place": "z", "disk": 2.0} | dict.fromkeys(
        ("gain_low", "gain_high", "phase", "delay", "frequency")
    )
    assert (margin.disk_gain, margin.disk_phase) == (np.inf, pytest.approx(np.pi / 2.0))


def test_an_unstable_loop_has_no_margins():
    changes = {
        "simulation.plant": "thesis",
        "controller.allow_unstable": True,
        "controller.gains": {
            "attitude": [[1, 1, 1], [10, 10, 1], [50, 50, 1]],
            "altitude": [2.0, 1.5, 3.5],
            "position": [1, 1],
        },
    }
    with pytest.raises(tiltsim.InputError, match="the closed loop is unstable"):
        tiltsim.margins(tiltsim.load_scenario(SETPOINT, changes))


STEP = 0.002
"""Physics step, control step and resolution of the latency, s."""


def is_lost(scenario, latency):
    """Whether a flight from a small offset, with a latency (s), grows or ends."""
    flight = tiltsim.simulate(scenario.replace({"simulation.control_latency": latency}))
    if flight.end.kind != "completed":
        return True
    moving = np.abs([flight[name] for name in ("p", "q", "r", "vz")])
    _, early, _, late = np.array_split(moving, 4, axis=1)
    return bool((late.max(axis=1) > np.maximum(early.max(axis=1), 1e-7)).any())


def offset_flight(name, step, changes):
    """A set-point flight from a small offset, with physics and control steps of a length."""
    offset = {"initial.position": [0, 0, 0], "initial.velocity": [0, 0, 0.01]}
    steps = {"simulation.timestep": step, "simulation.control_timestep": step}
    leaning = {"initial.attitude": [0.01, -0.01, 0.01], "simulation.engine": "native"}
    return tiltsim.load_scenario(name, {**offset, **steps, **leaning, **changes})


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "step"), [("pid", 0.002), ("indi", 0.002), ("geometric", 0.002), ("lqr", 0.004)]
)
@pytest.mark.parametrize("vehicle", ["tiltrotor", "hexarotor"])
def test_the_delay_margin_of_a_baseline_is_also_a_latency(law, step, vehicle):
    """Latency delays what the rotors are sent; the loop of their speeds follows a model."""
    rest = {"reference.position": [0, 0, 0], "simulation.duration": 8.0}
    scenario = offset_flight(f"beyond/baselines#{law}_{vehicle}", step, rest)
    steps = floor(tiltsim.margins(scenario)[0].delay / step)
    assert steps > 5
    assert [is_lost(scenario, late * step) for late in (steps, steps + 1)] == [False, True]


@pytest.mark.slow
def test_a_baseline_with_a_latency_has_that_much_less_delay_margin():
    """Without flights: the loop equals the one with commands under way."""
    rest = {"reference.position": [0, 0, 0], "simulation.plant": "rigid_body"}
    scenario = offset_flight("beyond/baselines#geometric_tiltrotor", 0.004, rest)
    late = scenario.replace({"simulation.control_latency": 0.004})
    margin, left = (tiltsim.margins(each)[0].delay for each in (scenario, late))
    assert left == pytest.approx(margin - 0.004, rel=1e-6)
    assert margin > 0.02


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "beyond/actuators#ideal",
        "beyond/actuators#rotor_lag",
        "fleet/hexarotor#hover",
        "fleet/tilt_hexarotor#hover",
        "fleet/cant_quadrotor#hover",
    ],
)
def test_the_delay_margin_is_the_smallest_latency_that_loses_the_flight(name):
    """In MuJoCo it is the first whole step beyond the margin."""
    allowed = {"controller.allow_unstable": True} if name.startswith("beyond") else {}
    changes = {"reference.type": "setpoint", "simulation.duration": 6.0, **allowed}
    scenario = offset_flight(name, STEP, changes)
    predicted = tiltsim.margins(scenario)[0].delay
    steps = floor(predicted / STEP)
    assert steps > 0
    assert [is_lost(scenario, late * STEP) for late in (steps, steps + 1)] == [False, True]


OSCILLATOR = np.array([[0.0, 1.0], [-1.0, 0.0]])
"""With poles at 1 rad/s, the middle of the frequencies below."""


def test_a_pole_at_a_frequency_of_the_search_is_no_obstacle():
    loop = BrokenLoop("input", OSCILLATOR, np.array([[0.0], [1.5]]), np.array([[-1.0, 0.0]]), None)
    found = _margin(loop, np.array([0.5, 2.0]))  # 1.5 / (1 - w^2)
    assert found.frequency == pytest.approx(2.5**0.5)
    assert found.phase == pytest.approx(0.0, abs=1e-9)


def test_a_loop_without_any_gain_has_every_margin():
    loop = BrokenLoop("input", OSCILLATOR, np.array([[0.0], [1.5]]), np.zeros((1, 2)), None)
    found = _margin(loop, np.array([0.5, 2.0]))
    assert found.gain == (0.0, np.inf)
    assert found.phase == found.delay == np.inf
