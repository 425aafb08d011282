"""From a sweep file to points and scenarios."""

from __future__ import annotations

import re
from math import ceil, log2, pi
from pathlib import Path

import numpy as np
import pytest

import tiltsim.sweeps.loading
from tiltsim.errors import InputError
from tiltsim.sweeps.definition import SweepDefinition
from tiltsim.sweeps.loading import check_points, load_sweep
from tiltsim.sweeps.points import SweepPoints
from tiltsim.sweeps.tables import LinspaceAxis

HEAD = """
scenario = "ch04_tracking/circle#continuous_t2_modified"
"""
PERIODS = """
[[axis]]
type = "linspace"
key = "gait.period"
start = 1
stop = 3
count = 5
"""
AMPLITUDES = """
[[axis]]
type = "list"
key = "gait.amplitude"
values = [0.1, 0.2, 0.3, 0.4, 0.5]
"""
MASS = """
[[axis]]
type = "uniform"
key = "vehicle.mass"
relative = true
low = 0.9
high = 1.1
"""
SEARCH = """
[bisect]
key = "gait.amplitude"
start = 0.1
stop = 1.0
step = 0.1
tolerance = 0.01
holds = [{ metric = "diverged", equals = false }]
"""


@pytest.fixture
def points_of(tmp_path):
    def make(text, overrides=None):
        path = tmp_path / "sweep.toml"
        path.write_text(HEAD + text if "scenario" not in text else text, encoding="utf-8")
        return SweepPoints(load_sweep(path, overrides))

    return make


def test_axes_are_crossed_the_last_one_fastest(points_of):
    sweep = points_of(AMPLITUDES + PERIODS)
    points = [sweep.point(index) for index in range(len(sweep))]
    assert len(points) == 25
    assert [p["gait.period"] for p in points[:6]] == [1.0, 1.5, 2.0, 2.5, 3.0, 1.0]
    assert [p["gait.amplitude"] for p in points[::5]] == [0.1, 0.2, 0.3, 0.4, 0.5]
    assert sorted(i for n in range(sweep.chunks) for i in sweep.chunk(n)) == list(range(25))


def test_chunks_of_sweeps_on_arrays_fill_arrays(points_of):
    masses = MASS.replace("[[axis]]", "[sample]\ncount = 5000\n[[axis]]")
    assert points_of(masses).chunk_size == 32
    on_arrays = {"simulation.plant": "thesis", "simulation.engine": "jax"}
    assert points_of(masses, on_arrays).chunk_size == 1024
    few = masses.replace("5000", "400")
    assert points_of(few, on_arrays).chunk_size == 100


TROT = """
scenario = "ch04_tracking/circle#fixed_modified"
[set]
gait.type = "trot_continuous"
"""
"""A base that lacks the amplitude and the period of its gait."""


@pytest.mark.parametrize(
    ("amplitudes", "first"),
    [
        (AMPLITUDES, 0.1),
        (SEARCH, 0.1),
        ('[[axis]]\ntype = "uniform"\nkey = "gait.amplitude"\nlow = 0.3\nhigh = 0.5\n', 0.3),
        (
            '[[axis]]\ntype = "normal"\nkey = "gait.amplitude"\nmean = 0.4\n'
            "standard_deviation = 0.01\n",
            0.4,
        ),
    ],
)
def test_axes_give_the_keys_that_the_base_lacks(points_of, amplitudes, first):
    drawn = "uniform" in amplitudes or "normal" in amplitudes
    sample = "[sample]\ncount = 2\n" if drawn else ""
    sweep = points_of(TROT + PERIODS + amplitudes + sample)
    assert (
        sweep.definition.base["gait"] | {"amplitude": first, "period": 1.0}
        == (sweep.definition.base["gait"])
    )
    values = sweep.point(0)
    assert sweep.scenario(values | {"gait.amplitude": 0.25}).gait.amplitude == 0.25
    with pytest.raises(InputError, match=r"drops the other keys of gait; also set gait.amp") as one:
        points_of(TROT + PERIODS)
    assert one.value.missing == {"gait.amplitude"}


def test_a_relative_axis_multiplies_a_value_that_is_set(points_of):
    text = AMPLITUDES.replace("values = [0.1,", "relative = true\nvalues = [0.1,")
    sweep = points_of("[set]\ngait.amplitude = 0.5\n" + text)
    assert sweep.scenario(sweep.point(1)).gait.amplitude == 0.1


def test_a_table_is_not_a_value_of_an_axis(points_of):
    axis = """
[[axis]]
type = "list"
key = "controller.gains"
values = [{ attitude = { bandwidth = 20.0 }, altitude = { bandwidth = 8.0 } }]
"""
    with pytest.raises(InputError, match=r"controller\.gains is a table; vary its keys one by one"):
        check_points(points_of(axis))


def test_axes_of_a_group_advance_together(points_of):
    grouped = [text.rstrip() + '\ngroup = "both"\n' for text in (AMPLITUDES, PERIODS)]
    sweep = points_of("".join(grouped))
    assert len(sweep) == 5
    assert sweep.point(3) == {"gait.amplitude": 0.4, "gait.period": 2.5}


def test_rows_move_several_keys_together(points_of):
    rows = '[[axis]]\ntype = "list"\nkeys = ["gait.period", "gait.amplitude"]\n'
    sweep = points_of(rows + "values = [[1, 0.5], [2.5, 0.25]]")
    assert [sweep.point(i) for i in range(2)] == [
        {"gait.period": 1.0, "gait.amplitude": 0.5},
        {"gait.period": 2.5, "gait.amplitude": 0.25},
    ]
    assert sweep.scenario(sweep.point(1)).gait.amplitude == 0.25


@pytest.mark.parametrize("method", ["random", "latin_hypercube", "sobol"])
def test_samples_follow_their_distributions_and_their_seed(points_of, method):
    normal = '[[axis]]\ntype = "normal"\nkey = "initial.attitude[1]"\nmean = 0.1\n'
    normal += "standard_deviation = 0.02\n"

    def sample(seed):
        text = f'{MASS}{normal}[sample]\nmethod = "{method}"\ncount = 256\nseed = {seed}\n'
        sweep = points_of(text)
        points = [sweep.point(index) for index in range(len(sweep))]
        return np.array([[p["vehicle.mass"], p["initial.attitude[1]"]] for p in points])

    draws = sample(1)
    assert draws.shape == (256, 2)
    assert np.array_equal(draws, sample(1))
    assert not np.array_equal(draws, sample(2))
    assert draws[:, 0].min() >= 0.9 * 0.429
    assert draws[:, 0].max() <= 1.1 * 0.429
    # Three standard errors of plain random draws; the other methods do better.
    assert draws[:, 0].mean() == pytest.approx(0.429, abs=3 * 0.429 * 0.2 / 12**0.5 / 16)
    assert draws[:, 1].mean() == pytest.approx(0.1, abs=3 * 0.02 / 16)
    assert draws[:, 1].std() == pytest.approx(0.02, rel=0.15)
    if method == "latin_hypercube":
        cells = np.floor((draws[:, 0] / 0.429 - 0.9) / 0.2 * 256).astype(int)
        assert sorted(cells) == list(range(256))


def test_relative_values_scale_what_a_preset_gives(points_of):
    text = '[[axis]]\ntype = "list"\nrelative = true\nkey = "{key}"\nvalues = [0.9, 1.1]'
    sweep = points_of(text.format(key="vehicle.inertia[1]"))
    assert sweep.scenario(sweep.point(1)).vehicle.resolve().inertia_yy == pytest.approx(
        1.1 * 2.99e-3
    )
    assert sweep.scenario(sweep.point(1)).vehicle.resolve().inertia_xx == 2.24e-3
    sweep = points_of(text.format(key="vehicle.inertia"))
    assert sweep.point(0) == {"vehicle.inertia": [0.9 * v for v in (2.24e-3, 2.99e-3, 4.80e-3)]}


def test_derived_keys_follow_the_axes(points_of):
    text = """
scenario = "ch03_gaits/stabilization#gait_1"
[derive]
gait.angles = ["u * distance", 0.1, "-u * distance", "2 * initial.position[2]"]
[[axis]]
type = "list"
keys = ["u", "initial.position[2]"]
values = [[-1, 0.05], [1, 0.1]]
[[axis]]
type = "linspace"
key = "distance"
start = 0.0
stop = 0.2
count = 3
"""
    sweep = points_of(text)
    scenario = sweep.scenario(sweep.point(4))
    assert scenario.gait.angles == pytest.approx((0.1, 0.1, -0.1, 0.2))
    assert scenario.initial.position == (0.0, 0.0, 0.1)


def test_an_axis_has_its_ends_exactly_and_passes_neither():
    for count, start, stop in ((14, pi, 0.0), (14, 0.0, pi), (14, pi, pi), (2, 0.1, 0.3)):
        ends = {"start": start, "stop": stop, "count": count}
        axis = LinspaceAxis(type="linspace", key="reference.yaw", **ends)
        values = [value for (value,) in axis.rows()]
        assert (len(values), values[0], values[-1]) == (count, start, stop)
        assert min(start, stop) <= min(values) <= max(values) <= max(start, stop)
        np.testing.assert_allclose(values, np.linspace(start, stop, count), rtol=1e-15, atol=1e-15)


def test_values_of_set_survive_a_change_of_type(points_of):
    text = '[set]\ngait.amplitude = 0.3\ngait.period = 2.0\n[[axis]]\ntype = "list"\n'
    text += 'key = "gait.type"\nvalues = ["trot_instant", "walk"]'
    sweep = points_of(text)
    gaits = [sweep.scenario(sweep.point(i)).gait for i in range(2)]
    assert [(g.type, g.amplitude) for g in gaits] == [("trot_instant", 0.3), ("walk", 0.3)]


CASES = """
[[axis]]
type = "cases"
key = "stack"
[axis.cases.published]
controller = { decoupling = "published", decoupler = "modified", gains = "ch04" }
[axis.cases.poles]
controller.decoupling = "exact"
controller.decoupler = "exact"
controller.gains = { attitude = { bandwidth = 20.0 }, altitude = { bandwidth = 8.0 } }
[axis.cases.walk]
gait = { type = "walk", amplitude = 0.1, period = 2.0 }
"""
SEED = '[[axis]]\ntype = "seed"\nkey = "simulation.seed"\nstart = 7\n'


def test_cases_lay_their_tables_over_the_base(points_of):
    sweep = points_of(CASES.replace(", period = 2.0", "") + PERIODS)
    assert [sweep.point(i)["stack"] for i in (0, 5, 10)] == ["published", "poles", "walk"]
    published, poles, walk = (sweep.scenario(sweep.point(i)) for i in (1, 6, 11))
    assert (published.controller.decoupling, published.controller.gains) == ("published", "ch04")
    assert poles.controller.decoupler == "exact"
    assert poles.controller.gains.attitude.bandwidth == 20.0
    assert walk.gait.type == "walk"
    assert walk.controller == points_of(PERIODS).scenario({}).controller
    assert {s.gait.period for s in (published, poles, walk)} == {1.5}, "axes have the last word"


def test_seeds_number_the_samples_and_every_case_flies_the_same_draws(points_of):
    sweep = points_of(f"{CASES}{MASS}{SEED}[sample]\ncount = 4\n")
    points = [sweep.point(index) for index in range(len(sweep))]
    assert [p["simulation.seed"] for p in points] == [7, 8, 9, 10] * 3
    draws = [{k: v for k, v in p.items() if k != "stack"} for p in points]
    assert draws[:4] == draws[4:8] == draws[8:]
    assert sweep.scenario(points[6]).simulation.seed == 9


def test_seeds_alone_are_a_random_set(points_of):
    sweep = points_of(f"{SEED}[sample]\ncount = 3\n")
    assert [sweep.point(index) for index in range(3)] == [{"simulation.seed": i} for i in (7, 8, 9)]


def test_files_of_an_inline_scenario_lie_beside_the_sweep(points_of, tmp_path, monkeypatch):
    (tmp_path / "mine.py").write_text("def law(observation): ...\n", encoding="utf-8")
    monkeypatch.chdir("/")
    own = 'controller = { law = "python", function = "mine.py:law" }\n'
    inline = f"[scenario.simulation]\nduration = 0.01\n{SEED}[sample]\ncount = 1\n"
    case = f'[[axis]]\ntype = "cases"\nkey = "law"\n[axis.cases.mine]\n{own}'
    for text in (f"scenario.{own}{inline}", inline + case):
        sweep = points_of(text)
        assert sweep.scenario(sweep.point(0)).controller.file == tmp_path / "mine.py"


def test_a_definition_survives_its_file(points_of):
    definition = points_of(AMPLITUDES + PERIODS).definition
    again = SweepDefinition.from_json(definition.to_json())
    assert again == definition
    assert again.difference(definition) == ""


@pytest.mark.parametrize(
    ("text", "difference"),
    [
        (PERIODS.replace("5", "6"), "axis[0].count was 5 and is 6"),
        (PERIODS + "[set]\ngait.amplitude = 0.2", "scenario.gait.amplitude was 0.65 and is 0.2"),
        (PERIODS.replace("period", "amplitude"), 'key was "gait.period" and is "gait.amplitude"'),
        ('title = "other"\n' + PERIODS, ""),
    ],
)
def test_differences_are_named(points_of, text, difference):
    before = points_of(PERIODS).definition
    found = before.difference(points_of(text).definition)
    assert difference in found
    assert bool(found) == bool(difference)


@pytest.mark.parametrize("count", [200_000, 20_000])
def test_huge_axes_are_refused_or_tried_in_a_few_places(points_of, count, monkeypatch):
    axis = PERIODS.replace("5", str(count))
    if count == 20_000:
        monkeypatch.setattr(tiltsim.sweeps.loading, "VALUES_TRIED", 50)
        assert len(check_points(points_of(axis))) == 50
    with pytest.raises(InputError, match="more than 10000000 points"):
        points_of(axis + AMPLITUDES + MASS + "[sample]\ncount = 1000000")


def test_more_points_than_a_machine_word_counts_are_refused(points_of):
    keys = ("gait.period", "gait.amplitude", "vehicle.mass", "reference.yaw", "initial.yaw")
    axes = (PERIODS.replace("gait.period", key).replace("5", "20000") for key in keys)
    with pytest.raises(InputError, match=f"axis = {20_000**5}: more than 10000000 points"):
        points_of("".join(axes))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["needs at least one [[axis]]"]),
        (PERIODS + "colour = 1", ["axis[0].colour", "unknown key"]),
        (PERIODS.replace("linspace", "lin"), ["axis[0].type", "list, linspace, cases, uniform"]),
        (SEED, ["axis.type", "seed", "[sample]"]),
        (SEED + "relative = true\n[sample]\ncount = 1", ["axis[0].relative"]),
        (CASES.replace('"stack"', '"gait.stack"'), ["gait.stack", "without a dot"]),
        (CASES.replace("decoupler =", "decuopler ="), ["decuopler", "did you mean decoupler"]),
        (CASES + PERIODS.replace("period", "amplitude"), ["axis.cases.walk.gait.amplitude = 0.1"]),
        (CASES + "[set]\ncontroller.decoupling = 'exact'", ["published.controller.decoupling"]),
        (PERIODS.replace("gait.period", "gait.perod"), ["gait.perod", "did you mean period"]),
        (PERIODS.replace("gait.period", "period"), ["period", "[derive]"]),
        (PERIODS.replace("start = 1", "start = -1"), ["gait.period = -1", "greater"]),
        (PERIODS.replace("gait.period", "gait.angles[0]"), ["gait.angles[0]", "no such entry"]),
        (PERIODS.replace("count = ", "count = 1000000"), ["axis[0].count", "200000"]),
        (AMPLITUDES.replace("0.5", "nan"), ["axis.values = NaN", "must be finite"]),
        (PERIODS.replace('key = "gait.period"', ""), ["axis.key", "key or keys"]),
        (PERIODS + PERIODS, ["gait.period", "set twice"]),
        (PERIODS + "[set]\ngait.period = 1.0", ["set.gait.period", "also set by an axis"]),
        (MASS, ["axis.type", "[sample]"]),
        (PERIODS + "[sample]\ncount = 3", ["sample.count", "no axis"]),
        (MASS + '[sample]\nmethod = "sobol"\ncount = 3', ["sample.count", "powers of two"]),
        (MASS.replace("0.9", "1.2") + "[sample]\ncount = 3", ["axis.low", "below high"]),
        ('metrics = ["roll"]\n' + PERIODS, ["metrics", "roll", "final_roll"]),
        ('metrics = ["realtime_factor"]\n' + PERIODS, ["metrics", "realtime_factor"]),
        (PERIODS + '[derive]\n"gait.amplitude" = "perod"', ["derive.gait.amplitude", "unknown"]),
        (PERIODS + '[derive]\n"gait.amplitude" = true', ["derive.gait.amplitude", "expression"]),
        (PERIODS + '[derive]\n"gait.amplitude" = "1 / 0"', ["divides by zero"]),
        (
            PERIODS.replace("gait.period", "p") + f'[derive]\n"gait.period" = "{"p+" * 300}p"',
            ["derive.gait.period", "nests more than 200 deep"],
        ),
        (
            PERIODS + 'relative = true\n[[axis]]\ntype = "list"\nkey = "gait.scale"\n'
            'relative = true\nvalues = ["x"]',
            ["axis.values", "relative values are numbers"],
        ),
        (SEARCH.replace("step = 0.1", "step = 1e-9"), ["bisect.step", "at most 1000000"]),
        (SEARCH.replace("stop = 1.0", 'stop = "foo"'), [": bisect.stop", "foo is unknown"]),
        ('scenario = "no/such"\n' + PERIODS, ["scenario", "no/such"]),
        ('scenario = "ch04_tracking/circle"\n' + PERIODS, ["scenario", "choose a variant"]),
        (
            PERIODS.replace("count = 5", 'count = 5\ngroup = "a"')
            + AMPLITUDES.replace(", 0.5", "").rstrip()
            + '\ngroup = "a"',
            ["axis.group", "[5, 4]"],
        ),
    ],
)
def test_mistakes_are_named_in_one_line(points_of, text, words):
    with pytest.raises(InputError) as caught:
        points_of(text)
    message = str(caught.value)
    assert "\n" not in message
    assert "sweep.toml" in message
    for word in words:
        assert word in message


def test_documented_sweeps_are_valid_and_end_soon(tmp_path):
    text = (Path(__file__).parents[2] / "docs" / "sweeps.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
    sweeps = [block for block in blocks if "\nscenario = " in f"\n{block}"]
    assert len(sweeps) == 3
    for number, block in enumerate(sweeps):
        file = tmp_path / f"{number}.toml"
        file.write_text(block, encoding="utf-8")
        sweep = SweepPoints(load_sweep(file))
        flights = len(sweep)
        if (bisect := sweep.sweep.bisect) is not None:
            steps = (sweep.stop(sweep.point(i)) - bisect.start for i in range(len(sweep)))
            halvings = ceil(log2(bisect.step / bisect.tolerance))
            flights = sum(ceil(length / bisect.step) + 1 + halvings for length in steps)
        assert flights <= 256
