"""Loads on cables: the measured swing, and a reference that damps it."""

from __future__ import annotations

import numpy as np
import pytest

import tiltsim
from tests.refusals import refusal
from tiltsim.laws.layers.contact import RETURN, shift_gains

HANGING = {
    "simulation.duration": 4.0,
    "reference": {"type": "setpoint"},
    "payload.swing": 0.1,
    "expect": [],
}
VECTORING = {"law": "vectoring", "tilts": "free", "position_bandwidth": 4.0}
PID = {"law": "pid", "acceleration_limit": 5.0}


def hanging(scenario="interaction/carry#cable", **changes):
    named = {name.replace("__", "."): value for name, value in changes.items()}
    return tiltsim.load_scenario(scenario, HANGING | named)


def logarithmic_decrement(flight):
    """The damping ratio by the first swing to the other side, less the shift's slow return."""
    swing = flight["swing_x"]
    ratio = -swing.min() / swing[0]
    return -np.log(ratio) / np.hypot(np.pi, np.log(ratio))


@pytest.mark.parametrize("damping", [0.1, 0.5, 1.0])
def test_the_gains_give_a_pendulum_its_damping_ratio(damping):
    frequency = 3.0
    gain, decay = shift_gains(frequency, damping)
    poles = np.roots([1.0, decay + gain, frequency**2, decay * frequency**2])
    real, pair = poles[np.argmin(abs(poles))], poles[np.argmax(abs(poles.imag))]
    assert real.imag == 0.0
    assert -pair.real / abs(pair) == pytest.approx(damping, abs=1e-6)
    assert real == pytest.approx(-RETURN * abs(pair), rel=1e-6)


def test_a_pendulum_without_damping_keeps_its_shift():
    assert shift_gains(3.0, 0.0)[0] == pytest.approx(0.0, abs=1e-15)


def test_a_load_swings_down_as_fast_as_its_key_says():
    """The vehicle is ten times as heavy as the load and follows its reference within 0.2 s."""
    measured = [
        logarithmic_decrement(tiltsim.simulate(hanging(payload__swing_damping=ratio)))
        for ratio in (0.1, 0.2)
    ]
    np.testing.assert_allclose(measured, [0.1, 0.2], atol=0.03)
    assert logarithmic_decrement(tiltsim.simulate(hanging())) < 0.01


@pytest.mark.parametrize("controller", [{}, {"controller": VECTORING}], ids=["own", "vectoring"])
def test_both_engines_damp_with_the_same_bits(controller):
    changes = {"payload.swing_damping": 0.5, "simulation.duration": 0.6, **controller}
    plain, native = (
        tiltsim.simulate(hanging(**changes, simulation__engine=engine))
        for engine in ("python", "native")
    )
    assert plain["swing_shift_x"][-1] > 0.02
    for name in plain:
        np.testing.assert_array_equal(plain[name], native[name], err_msg=name)


def test_the_swing_is_the_angle_at_the_attachment_of_a_turned_vehicle():
    attached = {"payload.attachment": [0.1, 0.05, -0.05], "initial.attitude": [0.2, 0.1, 0.4]}
    scenario = hanging(**attached, simulation__duration=0.2)
    flight, simulation = tiltsim.simulate(scenario), tiltsim.Simulation(scenario)
    assert flight["swing_x"][0] == pytest.approx(0.1, abs=1e-12)
    assert flight["swing_y"][0] == pytest.approx(0.0, abs=1e-12)
    simulation.step(150)
    at = np.searchsorted(flight["time"], 0.15 - 1e-9)
    seen = simulation.observation().swing
    np.testing.assert_allclose(seen, [flight[name][at] for name in ("swing_x", "swing_y")])
    assert abs(seen[1]) > 1e-4


FELT = """
import tiltsim
from tiltsim import xp


@tiltsim.law
def resting(observed):
    felt = xp.hstack([observed.contact_force, observed.swing])
    return tiltsim.Command(thrusts=xp.array([4.0] * 6), rates=felt)
"""


def test_a_law_feels_contacts_and_the_swing_on_both_engines(tmp_path):
    (tmp_path / "felt.py").write_text(FELT)
    sums = {f"state_{name}": "1" for name in ("fx", "fy", "fz", "x", "y")}
    changes = {
        "controller": {
            "law": "numpy",
            "function": str(tmp_path / "felt.py:resting"),
            "states": sums,
        },
        "initial.position": [0.0, 0.54, 0.0],
        "initial.velocity": [0.0, 0.2, 0.0],
        "reference": {"type": "setpoint"},
        "simulation.duration": 0.5,
        "simulation.record_timestep": 0.001,
        "payload": {"mass": 0.1, "length": 0.3, "swing": 0.2},
        "expect": [],
    }
    plain, native = (
        tiltsim.simulate(
            tiltsim.load_scenario(
                "interaction/push#hold", changes | {"simulation.engine": engine}, trusted=True
            )
        )
        for engine in ("python", "native")
    )
    seen = [f"contact_force_{axis}" for axis in "xyz"] + ["swing_x", "swing_y"]
    assert plain.metrics()["peak_force"] > 1.0
    for total, name in zip(sums, seen, strict=True):
        np.testing.assert_array_equal(plain[total], native[total])
        np.testing.assert_allclose(plain[total][-1], 1e-3 * plain[name][:-1].sum(), atol=1e-9)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"payload.rigid": True, "payload.swing": 0.0}, "needs payload.rigid = false"),
        ({"controller": {"law": "lqr"}}, "choose full_pose, vectoring"),
        ({"controller": {"law": "attitude_force"}}, "the attitude_force law does not follow"),
        ({"payload.swing_damping": 1.5}, "payload.swing_damping = 1.5"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_swing_that_cannot_be_damped_is_refused(changes, words):
    assert words in refusal(hanging, **{"payload.swing_damping": 0.5, **changes})


def test_a_python_controller_damps_by_itself():
    seen = []

    def resting(observation):
        seen.append(observation.swing)
        return tiltsim.Command(thrusts=[2.6] * 6)

    scenario = hanging(payload__swing_damping=0.5, simulation__duration=0.01)
    assert "swing_shift_x" not in tiltsim.simulate(scenario, controller=resting)
    np.testing.assert_allclose(seen[0], [0.1, 0.0], atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(
    "controller",
    [VECTORING, {"law": "geometric"}, {"law": "pid"}, {"law": "indi"}],
    ids=lambda table: table["law"],
)
def test_every_law_that_follows_an_acceleration_damps_the_swing_after_a_step(controller):
    swings = [
        tiltsim.simulate(
            hanging(
                "interaction/carry#step",
                payload__swing=0.0,
                payload__swing_damping=ratio,
                reference__position=[1.0, 0.0, 0.0],
                simulation__duration=10.0,
                controller=controller,
            )
        ).metrics()["final_swing"]
        for ratio in (0.0, 0.3)
    ]
    assert swings[1] < 0.003 < 0.1 < swings[0]
