"""References and gaits as tables over time: files, tables of other libraries, functions."""

from __future__ import annotations

import pickle
from math import cos, pi, sin

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import tiltsim
from tests.refusals import refusal
from tiltsim.errors import InputError
from tiltsim.flight.flight import Flight
from tiltsim.scenario.library import MAX_ROWS
from tiltsim.scenario.loading import load_scenario
from tiltsim.sweeps.loading import load_sweep
from tiltsim_controllers.references.trajectories import waypoint_motion

SHORT = {"simulation": {"duration": 0.4}, "controller": {"decoupling": "exact", "gains": "exact"}}
TIMES = np.linspace(0.0, 0.4, 9)
COLUMNS = {"time": TIMES, "x": np.sin(TIMES), "y": np.cos(TIMES), "z": TIMES**2}
HEAD = "time,x,y,z\n0,0,0,0\n"
TURNS = "time,x,y,z,qw,qx,qy,qz\n0,0,0,0,0.7648,0,0.6442,0\n"
POSES = "time,x,y,z,roll,pitch,yaw\n0,0,0,0,0,0,0\n"


def csv_text(columns):
    lines = [columns, *zip(*(column.tolist() for column in columns.values()))]
    return "".join(",".join(map(str, line)) + "\n" for line in lines)


@pytest.fixture
def files(tmp_path):
    """One table in three files; in one of them its columns are in another order."""
    other = {name: COLUMNS[name] for name in ("z", "x", "time", "y")}
    (tmp_path / "own.csv").write_text(csv_text(COLUMNS))
    (tmp_path / "other.csv").write_text(csv_text(other).replace(",", " , ").replace("\n", "\n\n"))
    pq.write_table(pa.table(COLUMNS), tmp_path / "own.parquet")
    return tmp_path


def test_every_way_to_give_a_table_gives_the_same_rows(files, monkeypatch):
    rows = tuple(zip(*(column.tolist() for column in COLUMNS.values())))
    toml = '[reference]\ntype = "table"\nfile = "../own.csv"\nyaw = 0.25\n'
    (files / "down").mkdir()
    (files / "down" / "own.toml").write_text(toml)
    monkeypatch.chdir(files)
    base = {**SHORT, "reference": {"type": "setpoint", "yaw": 0.25, "position": [1, 2, 3]}}
    scenarios = [
        load_scenario("down/own.toml"),
        load_scenario(base, {"reference.type": "table", "reference.rows": rows}),
        *(
            load_scenario(base, reference=given)
            for given in (COLUMNS, pa.table(COLUMNS), "own.csv", files / "other.csv", "own.parquet")
        ),
    ]
    knots = scenarios[0].reference.knots
    for scenario in scenarios:
        assert scenario.reference.table == rows
        assert scenario.reference.knots == knots
    assert {s.reference.yaw for s in scenarios} == {0.25, 0.0}
    assert scenarios[1].reference.yaw == 0.0, "another type empties its table"


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (HEAD + "1,abc,0,0\n", "row 2, column x = 'abc': no number"),
        (HEAD + "1,0,nan,0\n", "row 2, column y = nan: must be a finite number"),
        (HEAD + "1,0,0,2e6\n", "row 2, column z = 2000000.0: must be from"),
        (HEAD + "0,0,0,0\n", "row 2, column time = 0.0: must be at least 0.0001 s after"),
        (HEAD + "nan,0,0,0\n", "row 2, column time = nan: must be at least 0.0001 s after"),
        ("time,x,y,z\n1,0,0,0\n", "1 row; at least 2"),
        ("time,x,y,z\n1,0,0,0\n2,0,0,0\n", "row 1, column time = 1.0: must be 0"),
        (HEAD + "1,0,0\n", "row 2: 3 values in 4 columns"),
        ("", "is empty"),
        (
            "time x;y z\n",
            "no column time; needs one each of time, x, y, z; found ['time x', 'y z']",
        ),
        (
            "t,x,y,z\n",
            "no column time; needs one each of time, x, y, z; found ['t', 'x', 'y', 'z']",
        ),
        ("time,x,x,y,z\n", "2 columns x; needs one each"),
        ("time,x,y,z,yaw\n", "no column roll; needs one each of time, x, y, z, roll, pitch, yaw;"),
        ("time,x,y,z,vx\n", "column 'vx' is unknown; needs time, x, y, z, and may have roll, pit"),
        (POSES + "1,0,0,0,0,1.6,0\n", "row 2, column pitch = 1.6: must be between -pi/2 and pi/2"),
        (POSES + "1,0,0,0,3.2,0,0\n", "row 2, column roll = 3.2: jumps by 3.2 rad; unwrap the a"),
        ("time,x,y,z,yaw,qw\n", "has roll, pitch or yaw beside a quaternion; remove one of them"),
        ("time,x,y,z,qw\n", "no column qx; needs one each of time, x, y, z, qw, qx, qy, qz; found"),
        (TURNS + "1,0,0,0,0.5,0,0,0\n", "row 2: norm of qw, qx, qy, qz = 0.5; must be 1"),
        (TURNS + "1,0,0,0,0.66,0,0.7513,0\n", "row 2: too close to a pitch of pi/2, "),
        (HEAD + "1,0,0,0\n" * (MAX_ROWS + 1), "10002 rows; at most 10000: keep every second"),
        (b"\xff\xfe", "not UTF-8 text"),
    ],
)
def test_a_mistake_in_a_file_is_named_by_row_column_and_value(tmp_path, content, words):
    file = tmp_path / "a.csv"
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    message = refusal(load_scenario, SHORT, reference=file)
    assert message.startswith(f'scenario: reference.file = "{file}": {words}')
    assert "\n" not in message


@pytest.mark.parametrize("separator", [";", "\t", " ", "   ", " ; "])
def test_the_first_line_shows_what_separates_the_columns(tmp_path, separator):
    file = tmp_path / "own.csv"
    file.write_text(csv_text(COLUMNS).replace(",", separator))
    rows = tuple(zip(*(column.tolist() for column in COLUMNS.values())))
    assert load_scenario(SHORT, reference=file).reference.table == rows


@pytest.mark.parametrize(
    ("column", "words"),
    [
        (["a"] * 9, "column x is of type string; choose double, float"),
        ([None, *TIMES[1:]], "row 1, column x = nan: must be a finite number"),
    ],
)
def test_a_parquet_file_has_numbers(tmp_path, column, words):
    file = tmp_path / "a.parquet"
    pq.write_table(pa.table({**COLUMNS, "x": column}), file)
    with pytest.raises(InputError, match=rf"reference\.file = .*: {words}"):
        load_scenario(SHORT, reference=file)


def test_a_parquet_file_has_no_more_rows_than_a_csv_file(tmp_path):
    file, zeros = tmp_path / "a.parquet", np.zeros(MAX_ROWS + 1)
    pq.write_table(pa.table(dict.fromkeys(COLUMNS, zeros)), file)
    with pytest.raises(InputError, match="10001 rows; at most 10000"):
        load_scenario(SHORT, reference=file)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("a\0.csv", "a file name has no NUL"),
        ("missing.csv", "cannot be read: No such file"),
        ("missing.parquet", "no such file"),
        ("table.txt", "must end with .csv or .parquet"),
        (".", "not a file"),
    ],
)
def test_a_file_that_cannot_be_read_is_named(tmp_path, name, words):
    with pytest.raises(InputError, match=rf"reference\.file = .*: {words}"):
        load_scenario(SHORT, reference=tmp_path / name)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"reference": 3}, "reference = 3: must be a function of time, the name of a CSV"),
        ({"gait": [1, 2]}, r"gait = \[1, 2\]: must be a function .* alpha_4"),
        ({"gait": COLUMNS}, "gait: no column alpha_1"),
        (
            {"reference": {**COLUMNS, "x": ["a"] * 9}},
            "reference: column x must be numbers: of type <U1",
        ),
        ({"reference": {**COLUMNS, "x": ["1.5"] * 9}}, "reference: column x must be numbers"),
        ({"reference": {**COLUMNS, "x": [True] * 9}}, "column x must be numbers: of type bool"),
        ({"reference": {**COLUMNS, "x": 1j * TIMES}}, "column x must be numbers: of type complex"),
        ({"reference": {**COLUMNS, "x": 0.0}}, "column x = 0.0: must be a list of numbers"),
        ({"reference": {**COLUMNS, "x": [[1.0], []]}}, "column x must be numbers: "),
        (
            {"reference": {**COLUMNS, "y": TIMES[1:]}},
            "one number of rows; time has 9, x has 9, y has 8, z has 9",
        ),
        *(
            ({"reference": {**COLUMNS, "time": (1e9 * TIMES).astype(kind)}}, "column time must be")
            for kind in ("m8[ns]", "M8[ns]")
        ),
        ({"reference": {**COLUMNS, "x": [np.timedelta64(1, "s")] * 9}}, "column x must be numbers"),
        ({"reference": lambda t: (t, t)}, r"reference\(0\) = \(0.0, 0.0\): must be 3 finite"),
        ({"gait": lambda t: [1 / (t < 0.1)] * 4}, r"gait\(0.1\) raised ZeroDivisionError"),
        ({"gait": lambda t: [4.0] * 4}, "row 1, column alpha_1 = 4.0: must be from -3.14159 to"),
        ({"reference": lambda t: "abc"}, "reference.0. = 'abc': must be 3 finite numbers"),
        ({"reference": lambda t: (t, t, 1j)}, "must be 3 finite numbers"),
        ({"reference": lambda t: (t, t, t, 0.1)}, "numbers, or 6 with roll, pitch and yaw"),
        (
            {"gait": "walk"},
            """gait = 'walk': must be your own gait; override {"gait.type": "walk"}""",
        ),
        ({"gait": {"type": "trot_instant"}}, 'own gait; override {"gait.type": "trot_instant"}'),
        ({"reference": "circle"}, 'own reference; override {"reference.type": "circle"}'),
    ],
)
def test_a_wrong_argument_is_one_line(arguments, words):
    with pytest.raises(InputError, match=words) as caught:
        load_scenario(SHORT, **arguments)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({}, "reference.file = null: give one of file and rows"),
        ({"rows": [[0, 0, 0, 0]] * 2, "file": "a.csv"}, "give one of file and rows"),
        ({"rows": [[0, 0, 0], [1, 0, 0]]}, "must have 4 entries"),
        ({"rows": [[0, 0, 0, 0]]}, "1 row; at least 2"),
    ],
)
def test_a_wrong_table_is_one_line(table, words):
    with pytest.raises(InputError, match=words):
        load_scenario({"reference": {"type": "table", **table}})


def test_a_gait_that_repeats_must_end_where_it_begins():
    rows = [[0, 0, 0, 0, 0], [1, 0, 0, 0, 0.1]]
    with pytest.raises(InputError, match=r"gait.repeat = true: the angles of the last row"):
        load_scenario({"gait": {"type": "table", "repeat": True, "rows": rows}})


@pytest.fixture(scope="module")
def circling():
    """A circle, flown as it is and as a function."""
    circle = {"type": "circle", "radius": 0.5, "angular_frequency": 2.0, "position": [0, 0, 1]}
    tables = {
        **SHORT,
        "simulation": {"duration": 2.0, "timestep": 0.002},
        "reference": {**circle, "acceleration_feedforward": True},
    }

    def as_function(time):
        return 0.5 * cos(2.0 * time), 0.5 * sin(2.0 * time), 1.0

    return tiltsim.simulate(tables), tiltsim.simulate(tables, reference=as_function)


def test_a_circle_as_a_function_flies_as_the_circle(circling):
    built_in, own = circling
    assert own.end.kind == "completed"
    assert own.scenario.reference.acceleration_feedforward
    assert np.abs(own["position"] - built_in["position"]).max() < 1e-6
    # Free ends: within h^4 / 50 of the fourth derivative, 8 m/s^4, and best between them.
    reference, bound = own.scenario.reference, 8.0 * 0.01**4 / 50
    for time, largest in ((0.003, bound), (1.0033, 1e-3 * bound), (1.997, bound)):
        x, y, z = waypoint_motion(time, float(len(reference.table)), 0.0, reference.knots)[0]
        expected = (0.5 * cos(2.0 * time), 0.5 * sin(2.0 * time), 1.0)
        assert (x, y, z) == pytest.approx(expected, abs=largest, rel=0.0)


def test_a_flight_with_tables_is_saved_with_them(circling, tmp_path):
    _, own = circling
    own.save(tmp_path)
    assert {file.name for file in tmp_path.glob("*.csv")} == {"reference.csv"}
    again = load_scenario(tmp_path / "scenario.toml")
    assert again.reference.table == own.scenario.reference.table
    own.save(tmp_path)  # over itself
    from_file = Flight.of_scenario(again, own.samples, own.end, "python", 0.1)
    from_file.save(tmp_path / "copy")
    (tmp_path / "reference.csv").write_text("mine")
    with pytest.raises(InputError, match=r"reference\.csv: not written by this version"):
        own.save(tmp_path)
    for folder in (tmp_path, tmp_path / "copy"):
        loaded = tiltsim.load_flight(folder)  # without the file
        assert loaded.scenario.reference.knots == own.scenario.reference.knots


def test_a_smooth_gait_as_a_function_flies_as_itself_and_corners_are_rounded():
    circle = {"type": "two_color", "centre": [-0.2, 0.2], "radius": 0.1, "period": 1.0}

    def as_function(time):
        first, second = -0.2 + 0.1 * cos(2 * pi * time), 0.2 + 0.1 * sin(2 * pi * time)
        return first, second, first, second

    tables = {**SHORT, "gait": circle}
    built_in, own = tiltsim.simulate(tables), tiltsim.simulate(tables, gait=as_function)
    assert own.end.kind == "completed"
    assert np.abs(own["position"] - built_in["position"]).max() < 1e-6

    trot = load_scenario({"gait": {"type": "trot_continuous", "amplitude": 0.3, "period": 0.5}})
    planned = trot.gait.plan(trot.vehicle.resolve())
    table = load_scenario(SHORT, gait=planned.angles).gait.plan(trot.vehicle.resolve())
    times = np.linspace(0.0, 0.4, 1601)
    error = np.abs(table.angles(times) - planned.angles(times)).max(axis=1)
    # At the corner, in the row at 0.25 s: about h / 12 of the jump of the rate, and there alone.
    jump = 2 * 4 * 0.3 / 0.5
    assert 0.01 / 13 < error.max() / jump < 0.01 / 11
    assert error[np.abs(times - 0.25) > 0.1].max() < 1e-6


def moving(time):
    return 0.1 * time, 0.0, 0.0


def swinging(time):
    return [0.1 * sin(time)] * 4


def last_row(scenario, name):
    return getattr(scenario, name).table[-1]


@pytest.mark.parametrize(("name", "function"), [("reference", moving), ("gait", swinging)])
def test_a_function_is_sampled_over_whatever_the_duration_becomes(name, function):
    scenario = load_scenario(SHORT, **{name: function})
    longer = scenario.replace({"simulation.duration": 0.8})
    assert last_row(longer, name) == (0.8, *function(0.8))
    assert longer == load_scenario(SHORT, {"simulation.duration": 0.8}, **{name: function})
    assert scenario.replace({"vehicle.mass": 0.4}).replace({"simulation.duration": 0.8}) == (
        longer.replace({"vehicle.mass": 0.4})
    )
    assert last_row(longer.replace({"simulation.duration": 0.2}), name)[0] == 0.2


def test_a_sampled_function_never_ends_before_the_flight_in_silence():
    scenario = pickle.loads(pickle.dumps(load_scenario(SHORT, reference=moving)))
    with pytest.raises(InputError, match=r"duration = 0\.8: the reference ends at 0\.4 s; give"):
        scenario.replace({"simulation.duration": 0.8})
    held = scenario.replace({"simulation.duration": 0.8, "reference.hold": True})
    assert last_row(held, "reference") == last_row(scenario, "reference")
    sweep = {
        "scenario": scenario,
        "axis": [{"type": "list", "key": "simulation.duration", "values": [0.2, 0.8]}],
    }
    with pytest.raises(InputError, match="the reference ends at"):
        load_sweep(sweep)


def test_a_table_takes_the_place_of_a_function():
    scenario = load_scenario(SHORT, reference=moving)
    rows = [[0.0, 0.0, 0.0, 0.0], [0.2, 1.0, 0.0, 0.0]]
    for other in (
        load_scenario(scenario, reference=COLUMNS),
        scenario.replace({"reference.type": "setpoint"}),
        scenario.replace({"reference.rows": rows, "reference.hold": True}),
    ):
        longer = other.replace({"simulation.duration": 0.8})
        assert longer.reference == other.reference


@pytest.mark.parametrize("given", [COLUMNS, moving])
def test_overrides_belong_to_the_given_table(given):
    keys = {"reference.interpolation": "cubic", "reference.yaw": 0.2}
    scenario = load_scenario(SHORT, keys, reference=given)
    assert (scenario.reference.interpolation, scenario.reference.yaw) == ("cubic", 0.2)
    assert scenario.replace({"simulation.duration": 0.3}).reference.interpolation == "cubic"


@pytest.mark.parametrize(
    ("overrides", "given", "words"),
    [
        ({"reference.interpolation": "foo"}, {"reference": moving}, "choose minimum_snap or cubic"),
        ({"reference.nonsense": 1}, {"reference": COLUMNS}, "nonsense = 1: unknown key"),
        ({"gait.foo": 1}, {"gait": swinging}, "foo = 1: unknown key"),
        ({"gait.repeat": True}, {"gait": swinging}, "repeat = true: the angles of the last row"),
        (
            {"reference.type": "setpoint"},
            {"reference": moving},
            r"reference\.type = 'setpoint': contradicts the given reference <function moving",
        ),
        ({"gait.rows[0]": [0.0] * 5}, {"gait": "a.csv"}, "contradicts the given gait 'a.csv'"),
        ({"gait": {"type": "fixed"}}, {"gait": swinging}, "contradicts the given gait"),
    ],
)
def test_overrides_that_do_not_fit_the_table_are_refused(overrides, given, words):
    with pytest.raises(InputError, match=words):
        load_scenario(SHORT, overrides, **given)


def test_the_title_of_a_flight_omits_replaced_parts():
    address = "ch04_tracking/setpoint#rho_0_modified"
    scenario = load_scenario(address)
    own = load_scenario(scenario, reference=moving)
    assert (own.title, own.source) == ("Own reference", "")
    assert load_scenario(address, gait=swinging).title == "Own gait"
    assert load_scenario(own, gait=swinging).title == "Own reference, gait"
    assert load_scenario(address, {"title": "Mine"}, reference=moving).title == "Mine"
    mine = scenario.replace({"title": "Mine"})
    assert load_scenario(mine, controller=moving).title == "Mine"
    assert load_scenario(own, controller=moving).title == "Own controller moving, reference"
    assert load_scenario({"title": "Mine"}, reference=moving).title == "Mine"


def test_a_gait_that_repeats_goes_on():
    rows = [[0, 0, 0, 0, 0], [0.1, 0.1, 0, 0, 0], [0.2, 0, 0, 0, 0]]
    table = {"type": "table", "rows": rows, "hold": False}
    with pytest.raises(InputError, match=r"gait ends at 0\.2 s; .*gait\.hold = true"):
        load_scenario({**SHORT, "gait": table})
    assert load_scenario({**SHORT, "gait": {**table, "repeat": True}}).gait.repeat


def test_a_gaits_unknown_column_is_refused(tmp_path):
    file = tmp_path / "gait.csv"
    file.write_text("time,alpha_1,alpha_2,alpha_3,alpha_4,beta\n0,0,0,0,0,0\n1,0,0,0,0,0\n")
    assert "column 'beta' is unknown" in refusal(load_scenario, SHORT, gait=file)


TURNING = {**COLUMNS, "roll": 4.0 * TIMES, "pitch": 0.1 * TIMES, "yaw": -TIMES}
OMNI = {"simulation.duration": 0.4, "expect": []}


def test_every_way_to_give_attitudes_gives_the_same_rows(tmp_path):
    rows = tuple(zip(*(column.tolist() for column in TURNING.values())))
    (tmp_path / "own.csv").write_text(csv_text(TURNING))
    pq.write_table(pa.table(TURNING), tmp_path / "own.parquet")
    given = TURNING, pa.table(TURNING), tmp_path / "own.csv", tmp_path / "own.parquet"
    scenarios = [load_scenario("fleet/omni_octorotor#hover", OMNI, reference=one) for one in given]
    rows_given = {"reference.type": "table", "reference.rows": rows}
    scenarios.append(load_scenario("fleet/omni_octorotor#hover", {**OMNI, **rows_given}))
    assert {scenario.reference.table for scenario in scenarios} == {rows}
    assert {scenario.reference.kind for scenario in scenarios} == {"pose"}
    level = {**TURNING, "roll": 0.0 * TIMES, "pitch": 0.0 * TIMES}
    assert load_scenario("fleet/hexarotor#hover", OMNI, reference=level).reference.turns


@pytest.mark.parametrize(
    ("scenario", "changes", "words"),
    [
        ("fleet/hexarotor#hover", {}, "roll and pitch are no outputs: a vehicle that"),
        ("fleet/bicopter#hover", {}, "the geometric law cannot follow roll, pitch and yaw that"),
        ("fleet/omni_octorotor#hover", {"controller.turn_time": 1.0}, "controller.turn_time = 1.0"),
        ("fleet/omni_octorotor#hover", {"reference.yaw": 0.1}, "reference.yaw = 0.1: is a column"),
        ("ch04_tracking/setpoint#rho_0_modified", {}, "the attitude_altitude law cannot follow"),
    ],
)
def test_attitudes_that_cannot_be_followed_are_refused_in_one_line(scenario, changes, words):
    changes = OMNI | changes
    assert words in refusal(load_scenario, scenario, changes, reference=TURNING)
