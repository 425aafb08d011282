"""The learning tasks: bounds, seeds, ends, pictures, and the scores that the page states."""

from __future__ import annotations

import importlib
import re
import runpy
import sys
from multiprocessing import dummy
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tiltsim
from tiltsim.env.environment import TiltrotorEnv
from tiltsim.env.task import hover_reward
from tiltsim.env.tasks import EPISODE_STEPS, TASKS
from tiltsim.errors import InputError
from tiltsim.plants.built_in import BuiltInController

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.utils.env_checker import check_env  # noqa: E402

from tiltsim.env.baselines import EPISODES, BuiltInPolicy, score, table, zeros  # noqa: E402

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "environment.md").read_text(encoding="utf-8")
each_task = pytest.mark.parametrize("task", TASKS)


def make(task, **arguments):
    return gymnasium.make(f"tiltsim/{task}-v0", **arguments)


def stated(task):
    """Mean and standard deviation of every baseline's score on the page."""
    row = re.search(rf"^\| `tiltsim/{task}-v0` \|( .* ± .*)\|$", PAGE, re.MULTILINE)
    return [tuple(map(float, cell.split("±"))) for cell in row[1].split("|")]


def mean_is_plausible(scores, mean, deviation):
    """Within three standard errors, of the scores and of the 20 that make the stated mean."""
    return abs(np.mean(scores) - mean) < 3.0 * deviation * (1 / len(scores) + 1 / 20) ** 0.5


LONG = {"SetPoint", "Push", "Carry"}
tasks = [pytest.param(task, marks=[pytest.mark.slow] if task in LONG else []) for task in TASKS]


@pytest.fixture(scope="module", params=tasks)
def flown(request):
    """A task, its environment after one episode of the built-in controller, and its score."""
    env = make(request.param).unwrapped
    return request.param, env, score(env, BuiltInPolicy(env), seed=0)


@pytest.mark.parametrize("task", ["SetPoint", "Circle", "Push", "Carry"])
def test_gymnasiums_checker_passes_without_a_warning(task):
    check_env(make(task).unwrapped, skip_render_check=True)


def test_gymnasiums_checker_passes_with_pictures():
    check_env(make("Hover", render_mode="rgb_array").unwrapped)


def test_the_built_in_controller_flies_to_the_end_with_the_stated_score(flown):
    task, env, total = flown
    mean, deviation = stated(task)[2]
    assert abs(total - mean) < 4.0 * deviation  # of one episode
    assert env.env.end.kind == "completed"
    assert len(env.env.flight()) == EPISODE_STEPS + 1


@pytest.mark.slow
def test_an_episode_of_a_push_is_repeated_bit_for_bit_and_holds_its_force():
    env = make("Push").unwrapped
    scores = [score(env, BuiltInPolicy(env), seed=0) for _ in range(2)]
    assert scores[0] == scores[1]
    flight = env.env.flight()
    late = flight["time"] > 4.5
    np.testing.assert_allclose(flight["push_force"][late], flight["push_force_ref"][late], rtol=0.1)
    seen = env.env.observe()
    turn = Rotation.from_quat(seen.quaternion, scalar_first=True).inv()
    missing = seen.reference.force - seen.contact_force
    np.testing.assert_allclose(
        env.env.task.get_observation(env.env._plant)["force_error_body"], turn.apply(missing)
    )
    assert seen.reference.force[1] == env.env.scenario.reference.force


def test_rewards_fall_with_errors_of_a_force_and_with_the_swing():
    still = {f"{name}_error_body": np.zeros(3) for name in ("position", "velocity", "force")}
    still |= {"body_rates": np.zeros(3), "swing_body": np.zeros(3)}
    assert hover_reward(still, None) == 1.0
    off = still | {"force_error_body": np.array([0.0, 2.0, 0.0])}
    assert hover_reward(off, None) == 0.5
    swinging = still | {"swing_body": np.array([0.3, 0.1, 0.0])}
    assert hover_reward(swinging, None) == pytest.approx(0.5)


@pytest.mark.parametrize("task", ["Push", "Carry"])
def test_tasks_with_contact_fly_in_vectors_of_single_environments(task):
    several = gymnasium.make_vec(f"tiltsim/{task}-v0", num_envs=2)
    observations, _ = several.reset(seed=3)
    for seed, observation in zip((3, 4), observations, strict=True):
        np.testing.assert_array_equal(observation, make(task).reset(seed=seed)[0])


@pytest.mark.parametrize("task", tasks)
def test_zero_actions_lose_the_vehicle_with_the_stated_score(task):
    env = make(task).unwrapped
    scores = []
    for seed in EPISODES:
        scores.append(score(env, zeros(env), seed))
        assert env.env.end.kind == "diverged"
    assert stated(task)[0] == (round(np.mean(scores), 1), round(np.std(scores), 1))
    assert max(scores) < 0.25 * stated(task)[2][0]


@pytest.mark.slow
def test_the_page_states_the_scores_that_its_command_prints():
    """For one task: the tests above fly the others."""
    assert table(["Hover"]) in PAGE


@pytest.mark.slow
def test_a_short_training_beats_zero_actions_whatever_the_number_of_processes(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.syspath_prepend(ROOT / "examples")  # also for the processes that it starts
    file = str(tmp_path / "policy.npy")
    options = ["--updates", "3", "--processes", "2", "--out", file]
    monkeypatch.setattr(sys, "argv", ["train_hover.py", *options])
    example = importlib.import_module("train_hover")
    example.main()
    printed = capsys.readouterr().out
    assert re.findall(r"update (\d+): ", printed) == ["1", "2", "3"]
    monkeypatch.setattr(example, "get_context", lambda _: dummy)  # in this process
    np.testing.assert_array_equal(np.load(file), example.train(updates=3, seed=0, processes=1))
    mean, deviation = stated("Hover")[0]
    assert float(re.search(r"score ([\d.]+)", printed)[1]) > mean + 3.0 * deviation


@pytest.fixture
def by_gradients():
    """The example that trains by gradients, as its names."""
    pytest.importorskip("jax")
    return runpy.run_path(str(ROOT / "examples" / "train_hover_by_gradients.py"))


@pytest.mark.slow
def test_the_policy_trained_by_gradients_has_the_stated_score_in_mujoco(by_gradients):
    weights = by_gradients["load"](ROOT / "examples" / "hover_policy.npz")
    scores = by_gradients["scores_in_mujoco"](weights, 4)
    row = re.search(r"by gradients \| .*? \| ([\d.]+) ± ([\d.]+) \|", PAGE)
    mean, deviation = map(float, row.groups())
    assert mean_is_plausible(scores, mean, deviation)
    assert scores.min() > stated("Hover")[2][0]


@pytest.mark.slow
def test_an_update_by_gradients_returns_weights_like_those_given(by_gradients):
    """Traced only: compiling it takes a quarter of a minute."""
    import jax

    functions = by_gradients["VectorEnv"](by_gradients["TASK"]).functions
    weights = by_gradients["initial_weights"]([12, 4, 8], 0)
    zero = jax.tree.map(np.zeros_like, weights)
    numbers = functions.draw([np.random.default_rng(0)] * 2).astype("float32")
    update = by_gradients["make_update"](functions)
    moved, _, reward = jax.eval_shape(update, weights, (zero, zero), numbers, 1.0, 0.1, 0.9)
    assert jax.tree.map(np.shape, moved) == jax.tree.map(np.shape, weights)
    assert reward.shape == ()


@pytest.mark.slow
def test_environments_in_processes_fly_as_alone():
    several = gymnasium.make_vec(
        "tiltsim.env:tiltsim/Hover-v0",
        num_envs=2,
        vectorization_mode="async",
        vector_kwargs={"context": "spawn"},  # JAX in this process must not be forked
    )
    observations, _ = several.reset(seed=3)
    for seed, observation in zip((3, 4), observations, strict=True):
        np.testing.assert_array_equal(observation, make("Hover").reset(seed=seed)[0])
    several.close()


def test_time_truncates_and_divergence_terminates():
    env = make("Circle", max_episode_steps=3)
    env.reset(seed=0)
    ends = [env.step(np.zeros(8, np.float32))[2:4] for _ in range(3)]
    assert ends == [(False, False), (False, False), (False, True)]
    env = make("Hover")
    env.reset(seed=0)
    terminated = truncated = False
    while not terminated:
        assert not truncated
        _, reward, terminated, truncated, info = env.step(-np.ones(8, np.float32))
    assert reward == 0.0
    assert "m away from the reference" in info["cause"]
    assert env.spec.max_episode_steps == EPISODE_STEPS


@each_task
def test_a_seed_draws_the_same_start_and_every_episode_another(task):
    first, second = make(task), make(task)
    starts = [env.reset(seed=seed)[0] for env, seed in ((first, 5), (second, 5), (first, 6))]
    np.testing.assert_array_equal(starts[0], starts[1])
    unseeded = [second.reset()[0] for _ in range(2)]
    assert len({start.tobytes() for start in (*starts, *unseeded)}) == 4


def test_a_vector_holds_the_arrays_divided_by_their_bounds():
    env = make("Circle").unwrapped
    vector, _ = env.reset(seed=3)
    vector, *_ = env.step(np.full(8, 0.2))
    seen, scenario = env.env.observe(), env.env.scenario
    to_body = Rotation.from_quat(seen.quaternion, scalar_first=True).inv()
    reference = seen.reference
    expected = [
        to_body.apply(reference.position - seen.position) / 3.0,
        to_body.apply(reference.velocity - seen.velocity) / 5.0,
        to_body.apply([0.0, 0.0, 1.0]),
        seen.body_rates / 10.0,
        to_body.apply(reference.acceleration) / 3.0,
    ]
    np.testing.assert_allclose(vector, np.concatenate(expected), atol=1e-7)  # single precision
    assert np.linalg.norm(reference.acceleration) == pytest.approx(1.5)
    assert scenario.air is None or not any(scenario.air.wind)


def test_actions_span_their_bounds():
    env = make("Hover").unwrapped
    weight = 0.429 * 9.8
    env.reset(seed=0)
    spec = env.env.action_spec()
    np.testing.assert_allclose(spec.maximum, [weight / 2] * 4 + [0.5] * 4)
    np.testing.assert_allclose(spec.minimum, [0.0] * 4 + [-0.5] * 4)
    command = tiltsim.Command(thrusts=[weight / 2] * 4, tilt_angles=[-0.5] * 4)
    np.testing.assert_allclose(env.action(command), [1.0] * 4 + [-1.0] * 4)


def test_starts_on_one_model_equal_the_starts_of_a_new_environment():
    used, fresh = (TiltrotorEnv(**TASKS["Hover"], seed=1) for _ in range(2))
    used.reset()
    model = used._plant.model
    used.reset()
    assert used._plant.model is model
    fresh.task.initialize_episode(fresh.generator)  # its first, which `used` has begun
    fresh.reset()
    for env in (used, fresh):
        for _ in range(5):
            env.step(np.array([1.0, 1.1, 0.9, 1.0, 0.1, 0.0, 0.2, -0.3]))
    np.testing.assert_array_equal(used.flight().samples, fresh.flight().samples)


@pytest.mark.parametrize(
    "scenario",
    [
        "ch04_tracking/setpoint#rho_065_modified",
        "ch03_gaits/over_actuated#gait_1",
        "ch02_singular_zone/exact_law#stable_gains",
        "beyond/gait_feedforward#t1",
        "beyond/allocation#prioritized_from_a_lean",
        "fleet/arms_to_horizontal#hold",
        "interaction/push#held",
        "interaction/carry#held",
    ],
)
def test_a_built_in_controller_commands_on_an_observation_what_it_does_in_its_plant(scenario):
    flight = tiltsim.Simulation(scenario)
    command = BuiltInController(flight.scenario)(flight.observation())
    expected = flight.command()
    for name in ("thrusts", "rotor_accelerations", "tilt_angles"):
        np.testing.assert_array_equal(getattr(command, name), getattr(expected, name))


@pytest.mark.parametrize(
    "scenario",
    [
        {"controller": {"angular_acceleration": "measured"}},
        {"controller": {"law": "python", "function": "mine"}},
        "beyond/estimator",
    ],
)
def test_controllers_that_need_more_than_observations_are_refused(scenario):
    with pytest.raises(InputError, match="needs observations only"):
        BuiltInController(tiltsim.load_scenario(scenario))


# --- pictures ------------------------------------------------------------------------------------


@pytest.mark.slow
def test_every_picture_shows_the_present_state_of_its_environment():
    first, second = make("Hover", render_mode="rgb_array"), make("Hover", render_mode="rgb_array")
    with pytest.raises(InputError, match="call reset"):
        first.unwrapped.render()
    for env in (first, second):
        env.reset(seed=0)
    picture, same = first.render(), second.render()
    np.testing.assert_array_equal(picture, same)
    second.close()  # and its OpenGL context, which was the present one
    np.testing.assert_array_equal(first.render(), picture)
    first.step(np.ones(8, np.float32))
    assert (first.render() != picture).mean() > 0.01
    assert first.metadata["render_fps"] == 50
    first.close()
    assert make("Hover").unwrapped.render() is None


def test_without_opengl_one_line_says_what_to_install(monkeypatch):
    from tiltsim.views.video import offscreen

    monkeypatch.setattr(offscreen, "_implementations", dict)
    env = make("Hover", render_mode="rgb_array").unwrapped
    env.reset(seed=0)
    with pytest.raises(InputError, match=r"no OpenGL implementation works .*; install a driver"):
        env.render()


# --- misuse --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"observations": {"speed": 1.0}}, r"'speed': did you mean rotor_speeds\? choose position"),
        ({"observations": {"velocty": 1.0}}, "'velocty': did you mean velocity"),
        ({"observations": ["velocity"]}, "must be a dict from names to bounds"),
        ({"observations": {"velocity": 0.0}}, r"\['velocity'\] = 0.0: must be a number above 0"),
        ({"max_tilt_angle": 2.0}, "max_tilt_angle = 2.0: must be .* above 0, at most 1.5708"),
        ({"max_tilt_angle": "0.5"}, "max_tilt_angle = '0.5': must be a number"),
        ({"reward": 1.0}, "reward = 1.0: must be a function"),
        ({"domain": "initial.position"}, "domain = .*: must be a list of axes"),
        ({"domain": 3}, "domain = 3: must be a list of axes"),
        ({"render_mode": "human"}, "render_mode = 'human': must be 'rgb_array' or None"),
        ({"render_mode": np.zeros(2)}, "must be 'rgb_array' or None"),
    ],
)
def test_wrong_arguments_are_reported_in_one_line(arguments, words):
    from tiltsim.env.gymnasium import GymnasiumEnv

    with pytest.raises(InputError, match=words) as caught:
        GymnasiumEnv(**{**TASKS["Hover"], **arguments})
    assert "\n" not in str(caught.value)


def test_a_quadrotor_has_no_tilts_to_observe_or_to_limit():
    controller = {"law": "python", "function": "mine"}
    quadrotor = {"vehicle": {"model": "quadrotor"}, "controller": controller}
    with pytest.raises(InputError, match="'tilt_angles': choose"):
        TiltrotorEnv(quadrotor, observations={"tilt_angles": 1.0})
    with pytest.raises(InputError, match="no tilt servos"):
        TiltrotorEnv(quadrotor, max_tilt_angle=0.5)


def test_a_reward_says_which_observation_it_misses():
    env = TiltrotorEnv(observations={"position": 5.0, "velocity": 5.0, "body_rates": 9.0})
    env.reset()
    with pytest.raises(InputError, match="observations: the reward needs 'reference_position'"):
        env.step(env.action_spec().maximum)
