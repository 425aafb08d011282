"""The environments: their interfaces' own checkers, determinism, ends, rewards, randomisation."""

from __future__ import annotations

import re
import sys
from importlib import import_module
from pathlib import Path

import dm_env
import numpy as np
import pytest
from absl.testing import absltest
from dm_env import specs, test_utils

import tiltsim
from tiltsim.env.environment import Environment, TiltrotorEnv
from tiltsim.env.task import Task
from tiltsim.errors import InputError
from tiltsim.flight.metrics import End
from tiltsim.flight.reading import load_flight
from tiltsim.plants.command import Command, ControllerError
from tiltsim.studies.multirotor_analysis import fleet_file
from tiltsim_controllers.vehicle.parameters import PRESETS

DOCS = Path(__file__).parents[2] / "docs" / "environment.md"
VEHICLE = PRESETS["ar_drone_2"]
WEIGHT = VEHICLE.mass * VEHICLE.gravity
HOVER = np.array([WEIGHT / 4.0] * 4 + [0.0] * 4)
SHORT = {"duration": 0.2, "timestep": 0.002, "control_timestep": 0.02}
AXES = [
    {
        "keys": ["vehicle.mass", "vehicle.inertia"],
        "type": "uniform",
        "low": 0.8,
        "high": 1.2,
        "relative": True,
    },
    {"key": "initial.position[0]", "type": "normal", "mean": 1.0, "standard_deviation": 0.2},
    {"key": "initial.rotor_speed", "type": "list", "values": [300.0, 320.0]},
]


def scenario(simulation=None, **tables):
    simulation = {**SHORT, **(simulation or {})}
    tables.setdefault("controller", {"law": "python", "function": "test"})
    return tiltsim.parse_scenario({**tables, "simulation": simulation})


def spread(env, seed=0):
    """Random actions within the bounds, for ever."""
    spec, generator = env.action_spec(), np.random.default_rng(seed)
    while True:
        yield generator.uniform(spec.minimum, spec.maximum)


class TestTiltrotor(test_utils.EnvironmentTestMixin, absltest.TestCase):
    def make_object_under_test(self):
        return TiltrotorEnv(scenario())

    def make_action_sequence(self):
        for action, _ in zip(spread(self.environment), range(35)):  # three ends and a bit
            yield action


class TestQuadrotorWithRandomisation(test_utils.EnvironmentTestMixin, absltest.TestCase):
    def make_object_under_test(self):
        return TiltrotorEnv(scenario(vehicle={"model": "quadrotor"}), domain=AXES[1:])

    def make_action_sequence(self):
        for action, _ in zip(spread(self.environment), range(25)):
            yield action


def rollout(env, steps, seed=0):
    """Everything that an environment says over some random steps."""
    said = []
    for action, _ in zip(spread(env, seed), range(steps)):
        step = env.step(action)
        arrays = [step.observation[name].copy() for name in sorted(step.observation)]
        said.append((step.step_type, step.reward, step.discount, np.concatenate(arrays)))
    return said


def assert_same(first, second):
    for one, other in zip(first, second, strict=True):
        assert one[:3] == other[:3]
        np.testing.assert_array_equal(one[3], other[3])


def test_the_same_seed_gives_the_same_episodes_bit_for_bit():
    first, second = (TiltrotorEnv(scenario(), domain=AXES, seed=3) for _ in range(2))
    assert_same(rollout(first, 25), rollout(second, 25))
    other = rollout(TiltrotorEnv(scenario(), domain=AXES, seed=4), 2)
    assert (
        other[0][3].tolist()
        != rollout(TiltrotorEnv(scenario(), domain=AXES, seed=3), 2)[0][3].tolist()
    )


REAL = {
    "simulation": {"control_latency": 0.04},
    "vehicle": {"rotor_time_constant": 0.03, "tilt_servo": {"max_rate": 2.0}},
    "sensors": {"position_noise": 0.05, "body_rates_noise": 0.1},
    "air": {"wind": [2.0, 0.0, 0.0], "drag": {"linear": [0.3, 0.3, 0.1]}},
}
ideal_and_real = pytest.mark.parametrize("layers", [{}, REAL], ids=["ideal", "real"])


@ideal_and_real
def test_an_episode_does_not_depend_on_those_before(layers):
    used = TiltrotorEnv(scenario(**layers))
    rollout(used, 17)
    used.reset()
    fresh = TiltrotorEnv(scenario(**layers))
    fresh.reset()
    assert_same(rollout(used, 10, seed=5), rollout(fresh, 10, seed=5))


def test_reseeding_restarts_the_draws():
    env = TiltrotorEnv(scenario(), domain=AXES[1:2], seed=1)
    places = []
    for _ in range(2):
        env.reseed(9)
        places.append([float(env.reset().observation["position"][0]) for _ in range(3)])
    assert places[0] == places[1]
    assert len(set(places[0])) == 3


def test_hovering_holds_the_place_and_earns_the_whole_reward():
    env = TiltrotorEnv()
    step, total = env.reset(), 0.0
    assert step.reward is None
    while not step.last():
        step = env.step(HOVER)
        total += step.reward
    assert total == pytest.approx(500.0, abs=1e-6)
    assert (step.discount, env.end.kind) == (1.0, "completed")
    np.testing.assert_allclose(step.observation["position"], 0.0, atol=1e-6)


@ideal_and_real
def test_a_step_is_the_flight_of_a_held_command(layers):
    """Physics, step by step from outside, equals `tiltsim.simulate`."""
    this = scenario(initial={"attitude": [0.1, 0.2, 0.3]}, **layers)
    action = np.array([1.0, 1.1, 0.9, 1.2, 0.1, -0.2, 0.3, 0.0])
    env = TiltrotorEnv(this)
    env.reset()
    for _ in range(10):
        step = env.step(action)
    command = Command(thrusts=action[:4], tilt_angles=action[4:])
    flown = tiltsim.simulate(this, controller=lambda _: command)
    episode = env.flight()
    np.testing.assert_array_equal(episode.samples, flown.samples[::2])
    noise = np.abs(step.observation["position"] - [flown[a][-1] for a in "xyz"]).max()
    assert bool(noise > 0.0) is ("sensors" in layers)
    assert len(episode) == 11


def test_a_seed_axis_draws_other_noise_every_episode():
    axis = {"key": "simulation.seed", "type": "seed"}
    env = TiltrotorEnv(scenario(sensors=REAL["sensors"]), domain=[axis], seed=1)
    seen = [env.reset().observation["position"][0] for _ in range(3)]
    assert len(set(map(float, seen))) == 3


def test_termination_uses_the_true_position_not_the_measured_one():
    env = TiltrotorEnv(scenario(sensors={"position_bias": [9.0, 9.0, 0.0]}), max_position_error=1.0)
    env.reset()
    assert not env.step(HOVER).last()


def test_episodes_are_flights_with_files_and_metrics(tmp_path):
    env = TiltrotorEnv(scenario())
    with pytest.raises(InputError, match="call reset"):
        env.flight()
    env.reset()
    for _ in range(4):
        env.step(HOVER)
    assert env.flight().end.kind == "interrupted"
    for _ in range(6):
        env.step(HOVER)
    env.flight().save(tmp_path)
    back = load_flight(tmp_path)
    assert (back.end.kind, back.metrics()["duration"]) == ("completed", pytest.approx(0.2))


def test_a_lost_vehicle_terminates_with_zero_discount_and_reward():
    env = TiltrotorEnv(scenario({"duration": 5.0}), max_position_error=0.5)
    step = env.reset()
    while not step.last():
        assert env.end is None
        step = env.step(np.zeros(8))
    assert (step.reward, step.discount) == (0.0, 0.0)
    assert env.end.kind == "diverged"
    assert "m away from the reference" in env.end.cause
    # Falling half a meter takes sqrt(2 s / g) = 0.32 s.
    assert env.end.time == pytest.approx(0.32, abs=0.021)
    assert env.step(HOVER).first()
    assert env.end is None


def test_divergence_leaves_finite_observations():
    env = TiltrotorEnv(
        scenario({"duration": 5.0}, initial={"angular_velocity": [990.0, 5.0, 0.0]}),
        max_position_error=1e9,
    )
    spin = np.array([0.0, 2.0, 0.0, 0.0, *[0.0] * 4])
    step = env.reset()
    while not step.last():
        step = env.step(spin)
    assert step.discount == 0.0
    assert all(np.isfinite(array).all() for array in step.observation.values())
    for name, spec in env.observation_spec().items():
        spec.validate(step.observation[name])


@pytest.mark.parametrize(
    ("vehicle", "low", "high"),
    [
        ({}, [0.0] * 4 + [-np.pi / 2] * 4, [WEIGHT / 2.0] * 4 + [np.pi / 2] * 4),
        (
            {"min_rotor_speed": 100.0, "max_rotor_speed": 500.0, "tilt_servo": {"max_angle": 0.4}},
            [8.048e-6 * 1e4] * 4 + [-0.4] * 4,
            [8.048e-6 * 25e4] * 4 + [0.4] * 4,
        ),
        ({"model": "quadrotor"}, [0.0] * 4, [WEIGHT / 2.0] * 4),
    ],
)
def test_actions_have_the_vehicles_bounds_and_are_clipped_there(vehicle, low, high):
    env = TiltrotorEnv(scenario(vehicle=vehicle, initial={"rotor_speed": 300.0}))
    spec = env.action_spec()
    np.testing.assert_allclose(spec.minimum, low)
    np.testing.assert_allclose(spec.maximum, high)
    speeds = []
    for action in (spec.maximum, 10.0 * spec.maximum):
        env.reset()
        speeds.append(env.step(action).observation["rotor_speeds"])
    np.testing.assert_array_equal(*speeds)
    assert ("tilt_angles" in env.observation_spec()) == (vehicle.get("model") != "quadrotor")


@pytest.mark.parametrize(
    ("action", "words"),
    [
        (np.zeros(7), r"action of shape \(7,\); expected \(8,\) \(thrusts, tilt_angles\)"),
        (np.array([0.0] * 7 + [np.nan]), r"action\[7\] = nan: must be finite"),
        (np.full(8, 1.0 + 2.0j), r"action of type complex128: must be real numbers"),
    ],
)
def test_invalid_actions_are_refused(action, words):
    env = TiltrotorEnv(scenario())
    env.reset()
    with pytest.raises(ValueError, match=words):
        env.step(action)


def test_the_user_defines_the_reward():
    seen = []

    def reward(observation, action):
        seen.append((observation["position"].copy(), action.copy()))
        return -float(action[:4].sum())

    env = TiltrotorEnv(scenario(), reward=reward)
    env.reset()
    step = env.step(HOVER)
    assert step.reward == pytest.approx(-WEIGHT)
    np.testing.assert_array_equal(seen[0][1], HOVER)
    np.testing.assert_array_equal(seen[0][0], step.observation["position"])


def test_a_task_may_replace_any_hook():
    class Climb(Task):
        """Climb; reward, observation and termination are its own."""

        def observation_spec(self):
            return {"altitude": specs.Array((1,), np.float64, "altitude")}

        def get_observation(self, plant):
            return {"altitude": np.array(plant.observe()[2:3])}

        def get_reward(self, observation, action):
            return float(observation["altitude"][0])

        def get_termination(self, sample, observation):
            return End("diverged", float(sample[0]), "too high") if sample[3] > 0.1 else None

    env = Environment(Climb(scenario({"duration": 5.0})))
    env.observation_spec()["altitude"].validate(env.reset().observation["altitude"])
    step = env.step(1.5 * HOVER)
    assert step.reward == step.observation["altitude"][0] > 0.0
    while not step.last():
        step = env.step(1.5 * HOVER)
    # Half a g of net thrust: 0.1 m after sqrt(2 s / a) = 0.2 s.
    assert (env.end.cause, step.discount) == ("too high", 0.0)
    assert env.end.time == pytest.approx((0.2 / (0.5 * VEHICLE.gravity)) ** 0.5, abs=0.021)


def test_changing_what_was_returned_changes_nothing_else():
    meddled, calm = TiltrotorEnv(scenario()), TiltrotorEnv(scenario())
    for env in (meddled, calm):
        env.reset()
    step = meddled.step(HOVER)
    for array in step.observation.values():
        array[:] = 1e3
    step.observation.clear()
    calm.step(HOVER)
    assert_same(rollout(meddled, 5), rollout(calm, 5))


def test_a_controller_written_for_simulate_flies_here():
    env = TiltrotorEnv(scenario())
    env.reset()
    observation = env.observe()
    assert observation.vehicle == VEHICLE
    speeds = Command(rotor_speeds=[300.0, 310.0, 320.0, 330.0], tilt_angles=[0.1, 0.2, 0.3, 0.4])
    action = env.action(speeds)
    np.testing.assert_allclose(action[:4], 8.048e-6 * np.array([300, 310, 320, 330.0]) ** 2)
    np.testing.assert_array_equal(action[4:], [0.1, 0.2, 0.3, 0.4])
    np.testing.assert_allclose(env.step(action).observation["rotor_speeds"], [300, 310, 320, 330])
    with pytest.raises(ControllerError, match="expected thrusts or rotor_speeds"):
        env.action(Command(rotor_accelerations=[0.0] * 4))
    with pytest.raises(ControllerError, match=r"thrusts of shape \(3,\)"):
        env.action(Command(thrusts=[1.0] * 3))


# --- scenarios and randomisation -----------------------------------------------------------------


def test_any_scenario_of_the_library_will_do():
    env = TiltrotorEnv("ch04_tracking/circle#continuous_t2_modified", control_timestep=0.02)
    step = env.reset()
    np.testing.assert_allclose(step.observation["reference_position"], [5.0, 0.0, 0.0])
    env.step(HOVER)
    assert env.observe().time == pytest.approx(0.02)
    assert env.scenario.controller.law == "python"


def test_scenarios_that_take_no_commands_are_refused():
    thesis = tiltsim.parse_scenario({"simulation": {"plant": "thesis"}})
    with pytest.raises(InputError, match=r"simulation\.plant"):
        TiltrotorEnv(thesis)


def test_episodes_are_drawn_from_the_axes():
    env = TiltrotorEnv(scenario(), domain=AXES, seed=0)
    masses, places, speeds = [], [], set()
    for _ in range(12):
        observation = env.reset().observation
        drawn = env.scenario.rotorcraft
        masses.append(drawn.mass / VEHICLE.mass)
        # One draw for both keys.
        np.testing.assert_allclose(np.array(drawn.inertia) / VEHICLE[1:4], masses[-1])
        assert env.observe().vehicle.mass == drawn.mass
        places.append(float(observation["position"][0]))
        speeds.add(float(observation["rotor_speeds"][0]))
    assert 0.8 <= min(masses) < 0.95 < 1.05 < max(masses) <= 1.2
    assert speeds == {300.0, 320.0}
    assert np.mean(places) == pytest.approx(1.0, abs=0.25)
    assert len(set(places)) == 12


def test_axes_of_a_group_are_drawn_together():
    axis = {"type": "list", "values": [0.1, 0.2, 0.3], "group": "diagonal"}
    domain = [{**axis, "key": f"initial.position[{i}]"} for i in range(2)]
    env = TiltrotorEnv(domain=[*domain, {**axis, "group": "other", "key": "initial.position[2]"}])
    drawn = set()
    for _ in range(40):
        env.reset()
        drawn.add(env.scenario.initial.position)
    assert {x for x, _, _ in drawn} == {0.1, 0.2, 0.3}
    assert all(x == y for x, y, _ in drawn)
    assert any(x != z for x, _, z in drawn)


def test_an_invalid_position_bound_is_refused():
    for bound in (0.0, float("nan")):
        with pytest.raises(InputError, match="max_position_error"):
            TiltrotorEnv(max_position_error=bound)


def test_the_drawn_mass_is_the_one_that_flies():
    axis = {"key": "vehicle.mass", "type": "list", "values": [0.8 * VEHICLE.mass]}
    env = TiltrotorEnv(scenario(), domain=[axis])
    env.reset()
    for _ in range(10):
        step = env.step(HOVER)
    fallen = 0.5 * VEHICLE.gravity * (1.0 / 0.8 - 1.0) * 0.2**2
    assert step.observation["position"][2] == pytest.approx(fallen, rel=1e-6)


@pytest.mark.parametrize(
    ("axis", "words"),
    [
        ({"key": "vehicle.mass", "type": "uniform", "low": 2.0, "high": 1.0}, "must be below high"),
        ({"key": "vehicle.mass", "type": "gaussian"}, "choose list, linspace, cases, uniform"),
        ({"type": "uniform", "low": 1.0, "high": 2.0}, "give either key or keys"),
        ({"key": "vehicle.mass", "type": "list", "values": [0.4, -1.0]}, r"mass = -1\.0"),
        ({"key": "vehicle.mas", "type": "uniform", "low": 0.4, "high": 0.5}, "did you mean mass"),
    ],
)
def test_bad_axes_are_reported_when_the_environment_is_made(axis, words):
    with pytest.raises(InputError, match=words) as caught:
        TiltrotorEnv(scenario(), domain=[axis])
    assert "\n" not in str(caught.value)


def test_a_draw_that_cannot_be_flown_is_reported_with_its_key():
    axis = {"key": "vehicle.mass", "type": "uniform", "low": -1.0, "high": 1.0}
    env = TiltrotorEnv(scenario(), domain=[axis])

    def draw_twenty():
        for _ in range(20):
            env.reset()

    with pytest.raises(InputError, match=r"vehicle\.mass = -0\."):
        draw_twenty()


def test_a_sweeps_file_is_a_domain(tmp_path):
    path = tmp_path / "sweep.toml"
    path.write_text(
        "[scenario.simulation]\nduration = 0.1\ncontrol_timestep = 0.002\n"
        '[[axis]]\nkey = "vehicle.mass"\ntype = "uniform"\nlow = 0.9\nhigh = 1.1\nrelative = true\n'
        "[sample]\ncount = 4\n",
        encoding="utf-8",
    )
    env = TiltrotorEnv.from_sweep(path, control_timestep=0.01, seed=2)
    masses = {env.reset() and env.scenario.rotorcraft.mass for _ in range(3)}
    assert len(masses) == 3
    assert all(0.9 <= mass / VEHICLE.mass <= 1.1 for mass in masses)
    steps = 1
    while not env.step(HOVER).last():
        steps += 1
    assert steps == 10


# --- documentation and Gymnasium ----------------------------------------------------------------


def documented(arrays):
    """The code of the page, of its section on arrays or of the others."""
    before, section, after = re.split(
        "^## (?=Thousands|A controller)", DOCS.read_text("utf-8"), flags=re.M
    )
    text = section if arrays else before + after
    return re.findall(r"```python\n(.*?)```", text, re.DOTALL)


@pytest.mark.slow
def test_the_documented_examples_run(tmp_path, monkeypatch, capsys):
    pytest.importorskip("gymnasium")
    monkeypatch.chdir(tmp_path)
    blocks = documented(arrays=False)
    assert len(blocks) == 5
    names = {}
    for block in blocks:
        exec(compile(block, str(DOCS), "exec"), names)
    assert names["hovering"] == pytest.approx(500.0, abs=1e-3)
    assert names["random"] < 200.0
    assert isinstance(names["terminated"], bool)
    assert len(load_flight(tmp_path / "flights" / "hovering")) == 501
    assert "m away from the reference\nhover 500.0, random " in capsys.readouterr().out


@pytest.mark.parametrize("arguments", [{}, {"domain": AXES[1:]}], ids=["plain", "randomised"])
def test_gymnasiums_own_checker_passes_without_a_warning(arguments):
    gymnasium = pytest.importorskip("gymnasium")
    from gymnasium.utils.env_checker import check_env

    from tiltsim.env.tasks import ID

    check_env(gymnasium.make(ID, **arguments).unwrapped, skip_render_check=True)


def test_gymnasium_distinguishes_termination_from_truncation():
    pytest.importorskip("gymnasium")
    from tiltsim.env.gymnasium import GymnasiumEnv

    env = GymnasiumEnv(scenario=scenario())
    observation, info = env.reset(seed=0)
    assert info == {}
    ends = [env.step(np.zeros(8, np.float32))[2:4] for _ in range(10)]
    assert ends == [(False, False)] * 9 + [(False, True)]
    with pytest.raises(RuntimeError, match="call reset"):
        env.step(np.zeros(8, np.float32))
    env = GymnasiumEnv(scenario=scenario({"duration": 5.0}), max_position_error=0.2)
    env.reset()
    ended = False
    while not ended:
        observation, reward, ended, truncated, info = env.step(-np.ones(8, np.float32))
    assert not truncated
    assert reward == 0.0
    assert "away from the reference" in info["cause"]
    assert observation in env.observation_space


def test_gymnasium_refuses_steps_outside_of_an_episode_and_actions_of_other_shapes():
    pytest.importorskip("gymnasium")
    from tiltsim.env.gymnasium import GymnasiumEnv

    env = GymnasiumEnv()
    with pytest.raises(RuntimeError, match="call reset"):
        env.step(np.zeros(8))
    env.reset(seed=1)
    for action in (0.0, [0.0], np.zeros(4)):
        with pytest.raises(ValueError, match=r"expected \(8,\)"):
            env.step(action)
    with pytest.raises(ValueError, match="complex128: must be real numbers"):
        env.step(np.full(8, 1.0j))
    env.step(np.full(8, 5.0))  # clipped


def test_gymnasium_draws_by_the_constructor_s_seed():
    pytest.importorskip("gymnasium")
    from tiltsim.env.gymnasium import GymnasiumEnv

    def starts(env, **first):
        for arguments in (first, {}):
            env.reset(**arguments)
            yield env.env.scenario.initial.position[0]

    def made(**seed):
        return GymnasiumEnv(scenario=scenario(), domain=AXES[1:2], **seed)

    plain = TiltrotorEnv(scenario(), domain=AXES[1:2], seed=7)
    drawn = [plain.scenario.initial.position[0] for _ in range(2) if plain.reset()]
    adapted = GymnasiumEnv(TiltrotorEnv(scenario(), domain=AXES[1:2], seed=7))
    for env, first in ((made(seed=7), {}), (adapted, {}), (made(seed=8), {"seed": 7})):
        assert list(starts(env, **first)) == drawn
    assert len({*drawn, *starts(made(seed=8)), *starts(made())}) == 6


def test_zeros_hover_under_gymnasium():
    pytest.importorskip("gymnasium")
    from tiltsim.env.gymnasium import GymnasiumEnv

    env = GymnasiumEnv()
    env.reset(seed=0)
    for _ in range(50):
        observation, *_ = env.step(np.zeros(8, np.float32))
    np.testing.assert_allclose(observation["position"], 0.0, atol=1e-6)


def test_without_the_extra_one_line_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    monkeypatch.delitem(sys.modules, "tiltsim.env.gymnasium", raising=False)
    words = r"^tiltsim\.env\.gymnasium needs Gymnasium.*pip install 'tiltsim\[rl\]'"
    with pytest.raises(ModuleNotFoundError, match=words) as caught:
        import_module("tiltsim.env.gymnasium")
    assert "\n" not in str(caught.value)


def test_a_step_type_is_dm_envs():
    assert isinstance(TiltrotorEnv(scenario()).reset(), dm_env.TimeStep)


@pytest.mark.parametrize(
    ("name", "rotors", "tilts"), [("tilt_hexarotor", 6, 6), ("omni_octorotor", 8, 0)]
)
def test_a_multirotor_has_a_thrust_for_each_rotor_and_an_angle_for_each_servo(name, rotors, tilts):
    vehicle = {"model": "multirotor", "mjcf": str(fleet_file(name))}
    timing = {"duration": 0.1, "control_timestep": 0.01}
    law = {"law": "attitude_force", "norm": "thrust"}
    env = TiltrotorEnv({"vehicle": vehicle, "simulation": timing, "controller": law})
    spec, shapes = env.action_spec(), {n: s.shape for n, s in env.observation_spec().items()}
    assert spec.shape == (rotors + tilts,)
    assert (spec.minimum[:rotors].max() < 0.0) == (name == "omni_octorotor")  # it reverses
    assert shapes["rotor_speeds"] == (rotors,)
    assert shapes.get("tilt_angles", (0,)) == (tilts,)
    env.reset()
    known = env.observe().vehicle
    thrusts = known.thrust_coefficients * env.observe().rotor_speeds ** 2
    signs = np.sign(env.observe().rotor_speeds)  # the octorotor's stop halfway, or reverse
    for _ in range(5):
        step = env.step(np.array([*(signs * thrusts), *[0.0] * tilts]))
    assert step.reward == pytest.approx(1.0, abs=1e-9)
    np.testing.assert_allclose(step.observation["position"], 0.0, atol=1e-9)


@pytest.mark.parametrize("seed", [-1, 0.5, "a"])
def test_a_seed_that_is_no_whole_number_is_refused(seed):
    with pytest.raises(InputError, match=f"environment: seed = {seed!r}: must be a whole number"):
        TiltrotorEnv(seed=seed)
