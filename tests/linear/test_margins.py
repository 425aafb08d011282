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


def test_margins_of_all_inputs_are_those_of_the_error_loops(scenario, margins):
    """Under the exact matrix the loci are the loops of roll, pitch, yaw and altitude."""
    gains = scenario.controller.resolve_gains()
    loops = [
        third_order([getattr(gains, f"{name}_{order}") for order in (1, 2, 3)])
        for name in ("roll", "pitch", "yaw", "altitude")
    ]
    found = margins["all inputs"]
    assert found.gain[0] == pytest.approx(max(loop[0] for loop in loops), rel=1e-6)
    assert found.phase == pytest.approx(min(loop[1] for loop in loops), rel=1e-6)
    assert found.delay == pytest.approx(min(loop[2] for loop in loops), rel=1e-6)
    assert found.gain[1] == np.inf


def test_gain_margins_of_measured_states_are_those_of_routh(scenario, margins):
    """The altitude's gain may grow until K1 K2 = K3, its rate's may shrink to that."""
    gains = scenario.controller.resolve_gains()
    ratio = gains.altitude_1 * gains.altitude_2 / gains.altitude_3
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
    """Whether a flight from a small offset, with a latency of so many steps, grows or ends."""
    flight = tiltsim.simulate(scenario.replace({"simulation.control_latency": latency * STEP}))
    if flight.end.kind != "completed":
        return True
    moving = np.abs([flight[name] for name in ("p", "q", "r", "vz")])
    _, early, _, late = np.array_split(moving, 4, axis=1)
    return bool((late.max(axis=1) > np.maximum(early.max(axis=1), 1e-7)).any())


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
    offset = {"initial.position": [0, 0, 0], "initial.velocity": [0, 0, 0.01]}
    steps = {"simulation.timestep": STEP, "simulation.control_timestep": STEP}
    changes = {"reference.type": "setpoint", "initial.attitude": [0.01, -0.01, 0.01]}
    short = {"simulation.duration": 6.0, "simulation.engine": "python"}
    allowed = {"controller.allow_unstable": True} if name.startswith("beyond") else {}
    scenario = tiltsim.load_scenario(name, {**offset, **steps, **changes, **short, **allowed})
    predicted = tiltsim.margins(scenario)[0].delay
    steps = floor(predicted / STEP)
    assert steps > 0
    assert [is_lost(scenario, latency) for latency in (steps, steps + 1)] == [False, True]


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
