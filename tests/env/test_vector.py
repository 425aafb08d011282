"""Environments on arrays: the same episodes as the single environment's in MuJoCo."""

from __future__ import annotations

import numpy as np
import pytest

from tests.env.test_environment import documented
from tests.laws.test_multirotor import mjcf
from tiltsim.env.domain import Domain
from tiltsim.env.environment import HOVER, TiltrotorEnv
from tiltsim.env.functions import loop_on_equations
from tiltsim.env.tasks import TASKS
from tiltsim.equations.solvers import make_implicitfast_step
from tiltsim.errors import InputError
from tiltsim.laws.assembling import assemble, with_command

SPINNING = {"attitude": [0.2, -0.1, 0.5], "velocity": [1.0, 0.3, -0.2]} | {
    "angular_velocity": [1.0, -2.0, 0.5],
    "rotor_speed": 361.0,
}
LIMITED = {
    **TASKS["SetPoint"]["scenario"],
    "initial": SPINNING,
    "vehicle": {"max_rotor_speed": 480.0, "rotor_time_constant": 0.03},
    "air": {"drag": {"linear": [0.1, 0.2, 0.1]}, "wind": [2.0, -1.0, 0.5]},
}
LIMITED["vehicle"]["tilt_servo"] = {"natural_frequency": 50.0, "max_rate": 3.0, "max_angle": 0.4}


OTHERS = {
    name: {
        "simulation": TASKS["Hover"]["scenario"]["simulation"],
        "vehicle": vehicle,
        "initial": {**SPINNING, "rotor_speed": 250.0},
        "controller": HOVER["controller"],
    }
    for name, vehicle in {
        "quadrotor": {"model": "quadrotor"},
        "hexarotor": {
            "model": "multirotor",
            "mjcf": mjcf("tilt_hexarotor"),
            "rotor_time_constant": 0.03,
        },
        "octorotor": {"model": "multirotor", "mjcf": mjcf("omni_octorotor")},
    }.items()
}


@pytest.mark.parametrize(
    "scenario",
    [{**TASKS["Hover"]["scenario"], "initial": SPINNING}, LIMITED, *OTHERS.values()],
    ids=["ideal", "all", *OTHERS],
)
def test_the_step_is_mujocos(scenario):
    """Also with gyroscopic torques, drag, and rotors and servos that lag and have limits."""
    env = TiltrotorEnv(scenario)
    env.reset()
    assembly = assemble(env.scenario)
    loop = loop_on_equations(env.scenario)
    setup = loop.setup(assembly, loop.signature)
    vehicle = env.scenario.any_rotorcraft
    rotors, tilts = vehicle.rotor_count, vehicle.tilt_count
    first = 13 + 2 * tilts  # where commanded speeds go, unless rotors lag behind them
    first += rotors * (vehicle.rotor_time_constant is not None)
    state = [*map(float, loop.equations.initial(assembly, setup))]
    step = make_implicitfast_step(loop.equations, tilts)
    generator, index = np.random.default_rng(0), 0
    for _ in range(6):
        low = np.array([0.5] * rotors + [-0.5] * tilts)
        action = generator.uniform(low, [2.0] * rotors + [0.5] * tilts)
        env.step(action)
        speeds = np.sqrt(action[:rotors] / vehicle.thrust_coefficients)
        limited = vehicle.spins * np.clip(speeds, *vehicle.speeds_along_spin)
        state[first : first + rotors] = limited.tolist()
        command = (*action[rotors:].tolist(), *(0.0,) * rotors)
        parameters = with_command(setup.parameters, command)
        inputs = loop.equations.inputs(0.004 * index, state, parameters, setup.knots)
        for _ in range(5):
            time = 0.004 * index
            state = list(step(time, state, inputs, 0.004, parameters, setup.knots, (0.0,) * 3))
            index += 1
        flown = env._plant.data
        # MuJoCo's pods have inertia: 1e-7 of their servos', by which the body moves them.
        expected = np.concatenate([flown.qpos, flown.qvel, flown.act])
        np.testing.assert_allclose(state, expected, rtol=1e-7, atol=1e-7)


AXES = [
    {"key": "vehicle.mass", "type": "uniform", "low": 0.8, "high": 1.2, "relative": True},
    {"keys": ["vehicle.inertia"], "type": "uniform", "low": 0.9, "high": 1.1, "relative": True},
    {"key": "initial.position[2]", "type": "uniform", "low": -1.0, "high": 2.0},
]


@pytest.mark.parametrize(
    "axes",
    [
        AXES,
        [*AXES, {"key": "air.density", "type": "normal", "mean": 1.2, "standard_deviation": 0.1}],
    ],
    ids=["at once", "one by one"],
)
def test_numbers_are_those_that_single_environments_draw(axes):
    domain = Domain.from_axes(TiltrotorEnv().scenario, axes)
    rows = domain.sample([np.random.default_rng(seed) for seed in (4, 5)])
    for seed, row in zip((4, 5), rows, strict=True):
        drawn = domain.draw(np.random.default_rng(seed))
        expected = [drawn.vehicle.mass, *drawn.vehicle.inertia, drawn.initial.position[2]]
        expected += [drawn.air.density] * (len(axes) > 3)
        np.testing.assert_allclose(row, expected, rtol=1e-15)


# --- with JAX and Gymnasium ------------------------------------------------------------------


def make(*args, **arguments):
    pytest.importorskip("jax")
    pytest.importorskip("gymnasium")
    from tiltsim.env import VectorEnv

    return VectorEnv(*args, **arguments)


@pytest.mark.parametrize(
    ("task", "arguments", "words"),
    [
        ("tiltsim/Hover-v0", {"num_envs": 0}, "num_envs = 0: must be a whole number above 0"),
        ("tiltsim/Hovver-v0", {}, "'tiltsim/Hovver-v0': did you mean tiltsim/Hover-v0"),
        ("tiltsim/Hover-v0", {"precision": "half"}, "precision = 'half': must be 'float32' or"),
        ("tiltsim/Hover-v0", {"precision": np.zeros(2)}, "must be 'float32' or 'float64'"),
        ({}, {}, "simulation.integrator = 'RK4': only 'implicitfast' flies on arrays"),
        (
            {**TASKS["Hover"]["scenario"], "vehicle": {"rotor_inertia": 1e-5}},
            {},
            "vehicle.rotor_inertia = 1e-05: does not fly on arrays; use GymnasiumEnv",
        ),
        ("tiltsim/Push-v0", {}, "object = .*: does not fly on arrays; use GymnasiumEnv"),
        ("tiltsim/Carry-v0", {}, "payload = .*: does not fly on arrays; use GymnasiumEnv"),
        (
            "tiltsim/Hover-v0",
            {"domain": [{"key": "simulation.seed", "type": "seed"}]},
            "domain: simulation.seed: arrays draw numbers on which a flight depends, of vehicle",
        ),
    ],
)
def test_features_that_do_not_fly_on_arrays_are_refused_by_name(task, arguments, words):
    with pytest.raises(InputError, match=words) as caught:
        make(task, **arguments)
    assert "\n" not in str(caught.value)


FLOWN = {
    **{task: TASKS[task] for task in ("SetPoint", "Circle")},
    **{n: {"scenario": OTHERS[n], "domain": AXES[2:]} for n in ("quadrotor", "hexarotor")},
}


@pytest.mark.slow
@pytest.mark.parametrize("task", FLOWN)
def test_episodes_equal_single_environments_step_for_step(task):
    """Observations, rewards, ends and the starts after them, with Gymnasium's own autoreset."""
    arguments = {**FLOWN[task], "max_position_error": 2.0}
    scenario = arguments.pop("scenario")
    scenario = {**scenario, "simulation": {**scenario["simulation"], "duration": 0.8}}
    vector = make(scenario, num_envs=3, precision="float64", **arguments)
    import gymnasium

    from tiltsim.env.gymnasium import GymnasiumEnv

    single = [lambda: GymnasiumEnv(scenario=scenario, **arguments, flat=True)] * 3
    several = gymnasium.vector.SyncVectorEnv(single)
    for name in ("action_space", "observation_space", "single_action_space"):
        assert getattr(vector, name) == getattr(several, name)
    assert vector.metadata["autoreset_mode"] == several.metadata["autoreset_mode"]
    generator, ends = np.random.default_rng(0), [0, 0]
    (entries,) = vector.single_action_space.shape
    np.testing.assert_array_equal(vector.reset(seed=3)[0], several.reset(seed=3)[0])
    for _ in range(100):
        actions = generator.normal([-1.0, 0.0, 0.0], 0.02, (entries, 3)).T  # the first one falls
        *mine, infos = vector.step(actions)
        *theirs, expected = several.step(actions)
        assert infos.keys() == expected.keys()
        for key, value in expected.items():
            np.testing.assert_array_equal(infos[key], value)
        assert mine[1].dtype == theirs[1].dtype
        np.testing.assert_allclose(mine[0], theirs[0], rtol=0.0, atol=2e-7)  # single precision
        np.testing.assert_allclose(mine[1], theirs[1], rtol=0.0, atol=1e-9)
        np.testing.assert_array_equal(mine[2:], theirs[2:])
        ends = [end + theirs[2 + kind].sum() for kind, end in enumerate(ends)]
    assert vector.observation_space.contains(mine[0])
    assert all(ends)  # lost, and over in time


@pytest.fixture(scope="module")
def two():
    """The hover task by ``gymnasium.make_vec``, lost as soon as it is 1 cm off."""
    pytest.importorskip("jax")
    gymnasium = pytest.importorskip("gymnasium")
    return gymnasium.make_vec(
        "tiltsim.env:tiltsim/Hover-v0", num_envs=2, max_position_error=0.01, domain=()
    )


def test_make_vec_flies_a_task_on_arrays(two):
    from tiltsim.env import VectorEnv

    assert isinstance(two, VectorEnv)
    assert (two.num_envs, two.functions.scenario.simulation.steps) == (2, 2500)
    assert two.spec.id == "tiltsim/Hover-v0"


@pytest.mark.slow
def test_a_termination_says_why(two):
    two.reset(seed=0)
    fall, hover = -np.ones(8), np.zeros(8)
    for _ in range(10):
        _, rewards, terminated, _, infos = two.step(np.array([fall, hover]))
        assert rewards.dtype == np.float64
        if terminated.any():
            break
        assert infos == {}
    assert terminated.tolist() == infos["_cause"].tolist() == [True, False]
    assert infos["cause"][0].startswith("0.01")
    assert infos["cause"][0].endswith("m away from the reference")
    assert infos["cause"][1] is None
    actions = np.array([np.full(8, np.nan), hover])
    two.step(actions)  # the first one's is not used: its episode begins
    with pytest.raises(ValueError, match=r"actions\[0, 0\] = nan: must be finite"):
        two.step(actions)


def test_seeds_are_whole_numbers_of_any_kind(two):
    states = []
    for seed in (3, np.int64(3), [3, 4], [np.int64(3), np.uint8(4)]):
        two.reset(seed=seed)
        states.append([generator.random() for generator in two._generators])
    assert states[1:] == states[:1] * 3
    with pytest.raises(InputError, match="1 seeds for 2 episodes"):
        two.reset(seed=[3])


def test_make_vec_ends_episodes_after_fewer_steps_and_only_flat_ones():
    pytest.importorskip("jax")
    gymnasium = pytest.importorskip("gymnasium")
    env = gymnasium.make_vec("tiltsim.env:tiltsim/Hover-v0", max_episode_steps=20)
    assert env.functions.scenario.simulation.duration == pytest.approx(0.4)
    with pytest.raises(InputError, match="flat = False: arrays have flat observations only"):
        gymnasium.make_vec("tiltsim.env:tiltsim/Hover-v0", flat=False)


@pytest.mark.slow
@pytest.mark.parametrize("block", [0, 1])
def test_the_documented_examples_run(block):
    pytest.importorskip("jax")
    blocks, names = documented(arrays=True), {}
    assert len(blocks) == 2
    exec(compile(blocks[block], "environment.md", "exec"), names)
    result = names["slopes" if block else "observations"]
    assert result.shape == ((4, 8) if block else (16, 12))
    assert np.isfinite(result).all()
    assert (result != 0.0).all()


@pytest.mark.slow
@pytest.mark.parametrize("precisions", [("float32", "float64"), ("float64", "float32")])
def test_precisions_follow_each_other_in_one_process(precisions):
    """An array that outlives a trace keeps the precision that it had there."""
    for precision in precisions:
        env = make("tiltsim/Hover-v0", 2, precision=precision)
        env.reset(seed=0)
        _, rewards, *_ = env.step(np.zeros(env.action_space.shape, np.float32))
        assert np.isfinite(rewards).all()
