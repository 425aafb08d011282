"""Scenario files: every mistake in one line; variants, overrides and the way back to TOML."""

from __future__ import annotations

import json
import tomllib
from functools import partial
from pathlib import Path

import pytest

from tests.refusals import refusal as refused
from tiltsim.errors import InputError
from tiltsim.scenario.documents import parse_override
from tiltsim.scenario.library import library_entries
from tiltsim.scenario.loading import load_scenario, merge, parse_scenario, scenario_toml
from tiltsim.scenario.messages import did_you_mean
from tiltsim.scenario.metric_names import METRICS
from tiltsim.studies.checking import collect

LIBRARY = [address for address, _, _ in library_entries()]

FAMILY = """
title = "base"
source = "a book"
[simulation]
duration = 2.0
seed = 3
[gait]
type = "fixed"
angles = [0.1, 0.2, 0.3, 0.4]
[[expect]]
metric = "final_roll"
max = 0.5
[[variant]]
name = "plain"
[[variant]]
name = "long"
title = "longer"
simulation.duration = 4.0
[[variant.expect]]
metric = "final_pitch"
min = -0.5
[[variant]]
name = "trotting"
[variant.gait]
type = "trot_instant"
amplitude = 0.3
period = 1.5
[[variant]]
name = "tilted"
gait.angles = [0.0, 0.0, 0.0, -0.1]
"""


@pytest.fixture
def write(tmp_path):
    def write(text, name="case.toml"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return write


refusal = partial(refused, load_scenario)


def trot(amplitude="0.3", period="1.0", more=""):
    return f'[gait]\ntype = "trot_continuous"\namplitude = {amplitude}\nperiod = {period}\n{more}'


def fixed(angles):
    return f'[gait]\ntype = "fixed"\nangles = {angles}'


MISTAKES = {
    # name: (file, key and value as shown, allowed values)
    "unknown key at the top": ('titel = "x"', 'titel = "x"', "did you mean title?"),
    "unknown key in a table": (
        '[controller]\ndecopler = "exact"',
        'controller.decopler = "exact"',
        "did you mean decoupler?",
    ),
    "unknown key in a table in a table": (
        "[vehicle.tilt_servo]\nmax_angel = 1.0",
        "vehicle.tilt_servo.max_angel = 1.0",
        "did you mean max_angle?",
    ),
    "unknown key in a gait": (
        trot(more="amplitud = 0.3"),
        "gait.amplitud = 0.3",
        "did you mean amplitude?",
    ),
    "unknown key in a reference": (
        '[reference]\ntype = "circle"\nradius = 1.0\nangular_frequency = 0.1\nradios = 2.0',
        "reference.radios = 2.0",
        "did you mean radius?",
    ),
    "unknown key in a table of gains": (
        "[controller.gains]\nattitude = [[1,1,1],[9,9,9],[1,1,1]]\naltitude = [9,9,9]\n"
        "positon = [1, 1]",
        "controller.gains.positon = [1, 1]",
        "did you mean position?",
    ),
    "unknown key in an expectation": (
        '[[expect]]\nmetric = "duration"\nmaxi = 3.0',
        "expect[0].maxi = 3.0",
        "did you mean max?",
    ),
    "name that does not fit": (
        '[controller]\nlaw = "numpy"\nfunction = "law.py:law"\nstates = { height = "m" }',
        "controller.states.height",
        "the name must be state_, then",
    ),
    "key that is two lines": ('"a\\nb" = 3', "= 3", "unknown key"),
    "string for a number": (
        '[simulation]\nduration = "40"',
        'simulation.duration = "40"',
        "must be a number",
    ),
    "truth value for a number": (
        "[vehicle]\nmass = true",
        "vehicle.mass = true",
        "must be a number",
    ),
    "number for a truth value": (
        "[controller]\nallow_unstable = 1",
        "controller.allow_unstable = 1",
        "must be true or false",
    ),
    "fraction for a whole number": (
        "[simulation]\nseed = 1.5",
        "simulation.seed = 1.5",
        "must be a whole number",
    ),
    "number for a string": ("title = 3", "title = 3", "must be a string"),
    "number for a table": ("simulation = 3", "simulation = 3", "must be a table"),
    "number for a gait": ("gait = 3", "gait = 3", "must be a table"),
    "number for a list": ("[initial]\nposition = 3.0", "initial.position = 3.0", "must be a list"),
    "string in a list of numbers": (
        '[initial]\nposition = [0, 0, "up"]',
        'initial.position[2] = "up"',
        "must be a number",
    ),
    "string for a rotor speed": (
        '[initial]\nrotor_speed = "fast"',
        'initial.rotor_speed = "fast"',
        "must be a number",
    ),
    "negative rotor speed": (
        "[initial]\nrotor_speed = -300.0",
        "initial.rotor_speed = -300.0",
        "greater than 0",
    ),
    "negative mass": ("[vehicle]\nmass = -0.4", "vehicle.mass = -0.4", "greater than 0"),
    "NaN": ("[vehicle]\nmass = nan", "vehicle.mass = NaN", "finite"),
    "infinity": ("[simulation]\nduration = inf", "simulation.duration = Infinity", "finite"),
    "NaN in a list": ("[initial]\nposition = [0, nan, 0]", "initial.position[1] = NaN", "finite"),
    "inertia of no body": (
        "[vehicle]\ninertia = [1.0, 3.0, 1.0]",
        "vehicle.inertia = ",
        "must satisfy the triangle inequality",
    ),
    "trot beyond the servo": (
        trot("0.65", more="[vehicle.tilt_servo]\nmax_angle = 0.5"),
        "gait.amplitude = 0.65",
        "vehicle.tilt_servo.max_angle = 0.5",
    ),
    "negative trot beyond the servo": (
        trot("-0.65", more="[vehicle.tilt_servo]\nmax_angle = 0.5"),
        "gait.amplitude = -0.65",
        "vehicle.tilt_servo.max_angle = 0.5",
    ),
    "angles beyond the servo": (
        "[vehicle.tilt_servo]\nmax_angle = 0.5\n" + fixed("[0.1, -0.6, 0.0, 0.0]"),
        "gait.angles = [0.1, -0.6, 0.0, 0.0]",
        "vehicle.tilt_servo.max_angle = 0.5",
    ),
    "angles in degrees": (fixed("[0.0, -45.0, 0.0, 0.0]"), "gait.angles[1] = -45.0", "-3.14159"),
    "amplitude in degrees": (trot("37.0"), "gait.amplitude = 37.0", "3.14159"),
    "three angles": (
        fixed("[0.1, 0.2, 0.3]"),
        "gait.angles = [0.1, 0.2, 0.3]",
        "has 3 tilt angles; the vehicle has 4",
    ),
    "five angles": (
        fixed("[0.1, 0.2, 0.3, 0.4, 0.5]"),
        "gait.angles = [0.1, 0.2, 0.3, 0.4, 0.5]",
        "has 5 tilt angles; the vehicle has 4",
    ),
    "unknown gait": (
        '[gait]\ntype = "trott"',
        'gait.type = "trott"',
        "fixed, trot_instant, trot_continuous",
    ),
    "gait without a type": ("[gait]\nangles = [0, 0, 0, 0]", "gait.type", "fixed, trot_instant"),
    "trot without an amplitude": (
        '[gait]\ntype = "trot_instant"\nperiod = 1.0',
        "gait.amplitude",
        "required",
    ),
    "unknown preset": (
        '[vehicle]\npreset = "ardrone"',
        'vehicle.preset = "ardrone"',
        "ar_drone_2, ar_drone_2_unrounded or luukkonen",
    ),
    "unknown decoupler": (
        '[controller]\ndecoupler = "exakt"',
        'controller.decoupler = "exakt"',
        "none, conventional, modified or exact",
    ),
    "unknown set of gains": (
        '[controller]\ngains = "ch05"',
        'controller.gains = "ch05"',
        "ch03, ch04, exact or feedforward",
    ),
    "number for gains": ("[controller]\ngains = 3", "controller.gains = 3", "must be a table"),
    "ch. 4's gains under the exact matrix": (
        '[controller]\ndecoupling = "exact"\ngains = "ch04"',
        'controller.gains = "ch04"',
        "roll K1 K2 = 10 must exceed K3 = 50; change the gains or set controller.allow_unstable",
    ),
    "ch. 3's gains under the exact matrix": (
        '[controller]\ndecoupling = "exact"\ngains = "ch03"',
        'controller.gains = "ch03"',
        "roll K1 K2 = 1 must exceed K3 = 1; change the gains or set controller.allow_unstable",
    ),
    "unstable gains written out": (
        "[controller.gains]\nattitude = [[1,1,1],[9,9,9],[1,1,1]]\naltitude = [2,3,7]",
        "controller.gains = ",
        "altitude K1 K2 = 6 must exceed K3 = 7",
    ),
    "setpoint without a decoupler": (
        '[controller]\ndecoupler = "none"',
        'controller.decoupler = "none"',
        "'setpoint' needs conventional, modified or exact",
    ),
    "attitude reference with a decoupler": (
        '[reference]\ntype = "attitude_altitude"',
        'controller.decoupler = "modified"',
        "'attitude_altitude' needs none",
    ),
    "duration no multiple of the timestep": (
        "[simulation]\nduration = 1.0\ntimestep = 0.003",
        "simulation.duration = 1.0",
        "multiple of timestep = 0.003",
    ),
    "control timestep no multiple of the timestep": (
        "[simulation]\nduration = 1.0\ntimestep = 0.002\ncontrol_timestep = 0.003",
        "simulation.control_timestep = 0.003",
        "multiple of timestep = 0.002",
    ),
    "control timestep below the timestep": (
        "[simulation]\nduration = 1.0\ntimestep = 0.002\ncontrol_timestep = 0.0005",
        "simulation.control_timestep = 0.0005",
        "multiple of timestep = 0.002",
    ),
    "rotor limits that cross": (
        "[vehicle]\nmin_rotor_speed = 400.0\nmax_rotor_speed = 200.0",
        "vehicle.min_rotor_speed = 400.0",
        "below max_rotor_speed = 200.0",
    ),
    "half a circle beside a rectangle": (
        '[gait]\ntype = "two_color"\nperiod = 1.0\nrectangle = [[0.2, 0.8], [-0.8, -0.2]]\n'
        "radius = 0.3",
        'gait.type = "two_color"',
        "give one of rectangle",
    ),
    "start beyond the rotor limit": (
        "[vehicle]\nmax_rotor_speed = 200.0",
        "initial.rotor_speed = 300.0",
        "200.0",
    ),
    "ground on the thesis plant": (
        '[simulation]\nplant = "thesis"\n[ground]\nheight = -1.0',
        'simulation.plant = "thesis"',
        "use mujoco",
    ),
    "unknown metric": (
        '[[expect]]\nmetric = "final_rol"\nmin = 1.0',
        'expect.metric = "final_rol"',
        ", ".join(METRICS),
    ),
    "expectation without a bound": (
        '[[expect]]\nmetric = "duration"',
        'expect.metric = "duration"',
        "give min, max or both",
    ),
    "expectation that nothing meets": (
        '[[expect]]\nmetric = "duration"\nmin = 3.0\nmax = 2.0',
        "expect.min = 3.0",
        "must not exceed max = 2.0",
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_one_line_with_file_key_value_and_what_is_allowed(write, mistake):
    text, shown, allowed = MISTAKES[mistake]
    path = write(text)
    file, _, rest = refusal(path).partition(": ")
    assert file == str(path)
    assert shown in rest
    assert allowed in rest.partition(shown)[2]


def test_further_mistakes_are_named(write):
    line = refusal(write("[vehicle]\nmass = -1.0\narm_length = -1.0\ngravity = -1.0"))
    assert line.endswith("be greater than 0 (also wrong: vehicle.arm_length, vehicle.gravity)")
    line = refusal(write('[gait]\ntype = "fixed"\nangels = [0, 0, 0, 0]\nbiass = 1.0'))
    assert line.endswith("known: angles, bias, scale, type (also wrong: gait.biass)")
    line = refusal(write("\n".join(f"foo_{i} = 1" for i in range(8))))
    assert line.endswith("(also wrong: foo_1, foo_2, foo_3, foo_4, foo_5 and 2 more)")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("wind = [5, 0, 0]", "wind = [5, 0, 0]: unknown key; did you mean air.wind? known: air,"),
        ("duration = 5", "did you mean simulation.duration or air.gust.duration? known"),
        (
            '[gait]\ntype = "fixed"\namplitude = 1',
            "unknown key; only for type trot_instant, trot_continuous, walk, run, ",
        ),
        ('[controller]\ntilt_weight = "even"', "unknown key; only for law full_pose; known"),
        ("[controller.supervisor]\nsupervisor = 1", "unknown key; known: clear"),
        ("[sensors.gps]\nposition_resolution = 1", "did you mean resolution? known: delay"),
        ("[sensors.gnss]\nrate = 1", "unknown key; did you mean gps? known"),
        ('[[companion]]\nname = "a"\ncompanion = 1', "companion = 1: unknown key; known: ch"),
        ("[air]\nwind = 5", "air.wind = 5: must be a list of 3 numbers"),
        ("[air.gust]\nrise = 1\nvelocity = 5", "velocity = 5: must be a list of 3 numbers"),
        ("[vehicle]\ninertia = 5", "vehicle.inertia = 5: must be a list of 3 numbers"),
        ('[gait]\ntype = "waypoints"\nperiod = 1\nangles = 5', "must be a list of lists"),
        ("[controller]\nleave_out = 5", "leave_out = 5: must be a list of names"),
        ("[vehicle]\nmass = 500", "vehicle.mass = 500.0: is in kg; to hover its rotors would"),
        ("[vehicle]\ninertia = [2.24, 2.99, 4.80]", "is in kg m^2, arms in m: mass this far"),
        ("[vehicle]\narm_length = 178.5", "does not belong to arms of 178.5 m; check inertia, "),
    ],
)
def test_a_mistake_says_what_to_write(write, text, words):
    assert words in refusal(write(text))


def test_a_long_value_is_cut(write):
    line = refusal(write(f'foo = "{"x" * 500}"'))
    assert "x" * 60 in line
    assert "x" * 81 not in line
    path = "/".join(["folder"] * 20)
    assert path in refusal(write(f'foo = "{path}"'))


def test_gains_that_fail_routh_fly_when_allowed(write):
    text = '[controller]\ndecoupling = "exact"\ngains = "ch04"\nallow_unstable = true'
    assert load_scenario(write(text)).controller.allow_unstable


# --- files -------------------------------------------------------------------------------------


def test_a_missing_file_points_to_the_library(tmp_path):
    path = tmp_path / "nowhere.toml"
    assert refusal(path) == (
        f"{path}: no such file, nor a scenario of the library (see tiltsim list)"
    )


def test_an_unknown_name_is_no_scenario_of_the_library():
    assert refusal("ch99/nothing").startswith("ch99/nothing: no such file, nor a scenario")


@pytest.mark.parametrize("name", ["ch04_tracking/setpont", "ch04_trackin/setpoint.toml#rho_0"])
def test_a_misspelt_file_is_answered_with_the_closest(name):
    assert "did you mean ch04_tracking/setpoint? see tiltsim list" in refusal(name)
    with pytest.raises(InputError, match=r"did you mean ch04_tracking\?"):
        collect(["ch04_trackin"])


@pytest.mark.parametrize(
    ("text", "question"),
    [
        ('[[expect]]\nmetric = "max_abs_rol"\nmax = 1.0', "did you mean max_abs_roll? choose"),
        ('[gait]\ntype = "trot_instnt"', "did you mean trot_instant? choose"),
    ],
)
def test_a_misspelt_name_is_answered_with_the_closest(write, text, question):
    assert question in refusal(write(text))


def test_a_misspelt_list_is_answered_with_the_closest(write):
    path = write("[initial]\nattitude = [0.0, 0.0, 0.0]")
    with pytest.raises(InputError, match=r"no such entry; did you mean attitude\? give the whole"):
        load_scenario(path, {"initial.atitude[0]": 1.0})
    with pytest.raises(InputError, match="no such entry; give the whole list"):
        load_scenario(path, {"initial.position[0]": 1.0})
    with pytest.raises(InputError, match=r"no such entry; initial.attitude has 3, from .*\[0\]"):
        load_scenario(path, {"initial.attitude[3]": 1.0})
    with pytest.raises(
        InputError, match=r"initial.attitude is a list; write initial.attitude\[0\]"
    ):
        load_scenario(path, {"initial.attitude.0": 1.0})


def test_a_folder_is_not_a_scenario(tmp_path):
    assert (
        refusal(tmp_path)
        == f"{tmp_path}: a folder, not a scenario file; tiltsim check takes folders"
    )


def test_an_unreadable_file_says_why(write, monkeypatch):
    path = write("")

    def deny(self, *arguments, **options):
        raise PermissionError(13, "Permission denied", str(self))

    monkeypatch.setattr(Path, "read_text", deny)
    assert refusal(path) == f"{path}: cannot be read: Permission denied"


def test_a_file_that_is_not_utf_8_says_where(tmp_path):
    path = tmp_path / "latin.toml"
    path.write_bytes('title = "Flügel"'.encode("latin-1"))
    assert refusal(path).startswith(f"{path}: not UTF-8 text (byte 11: ")


def test_a_file_that_is_not_toml_says_where(write):
    path = write("title = 'a'\ngait = = 3")
    assert refusal(path).startswith(f"{path}: not valid TOML: ")
    assert "line 2, column 8" in refusal(path)


@pytest.mark.parametrize(
    ("name", "hint"),
    [("a.xml", "vehicle.mjcf"), ("a.parquet", "scenario.toml"), ("a.py", "FILE.py:NAME")],
)
def test_a_file_of_another_kind_says_where_it_belongs(tmp_path, name, hint):
    path = tmp_path / name
    path.write_bytes(b"PAR1\xff")
    message = refusal(path)
    assert message.startswith(f"{path}: not a TOML file: ")
    assert hint in message


def test_a_key_without_its_table_is_found_among_dotted_names():
    names = ["vehicle.center_of_mass", "vehicle.mass", "model_error.mass"]
    assert did_you_mean("mass", names) == "did you mean vehicle.mass? "


# --- variants ----------------------------------------------------------------------------------


def test_a_variant_changes_what_it_names_and_keeps_the_rest(write):
    scenario = load_scenario(f"{write(FAMILY)}#long")
    assert scenario.title == "longer"
    assert scenario.source == "a book"
    assert scenario.simulation.duration == 4.0
    assert scenario.simulation.seed == 3
    assert scenario.gait.angles == (0.1, 0.2, 0.3, 0.4)


def test_a_variant_adds_its_expectations_to_the_base(write):
    path = write(FAMILY)
    metrics = [expectation.metric for expectation in load_scenario(f"{path}#long").expect]
    assert metrics == ["final_roll", "final_pitch"]
    assert [expectation.metric for expectation in load_scenario(f"{path}#plain").expect] == [
        "final_roll"
    ]


def test_a_table_of_another_type_replaces_the_whole(write):
    gait = load_scenario(f"{write(FAMILY)}#trotting").gait
    assert gait.model_dump(exclude={"scale", "bias"}) == {
        "type": "trot_instant",
        "amplitude": 0.3,
        "period": 1.5,
    }


def test_a_table_without_a_type_changes_the_one_of_the_base(write):
    gait = load_scenario(f"{write(FAMILY)}#tilted").gait
    assert gait.model_dump(exclude={"scale", "bias"}) == {
        "type": "fixed",
        "angles": (0.0, 0.0, 0.0, -0.1),
    }


def test_a_scenario_knows_its_address(write):
    path = write(FAMILY)
    assert load_scenario(f"{path}#long").address == f"{path}#long"
    assert load_scenario("ch04_tracking/setpoint.toml#rho_065_modified").address == (
        "ch04_tracking/setpoint#rho_065_modified"
    )


def test_a_family_without_a_choice_lists_its_members(write):
    path = write(FAMILY)
    assert refusal(path) == f"{path}: choose a variant with #: plain, long, trotting, tilted"


def test_a_family_alone_asks_for_a_member_but_overrides_fly_its_base(write):
    path = write(FAMILY)
    assert refusal(path) == f"{path}: choose a variant with #: plain, long, trotting, tilted"
    scenario = load_scenario(path, {"simulation.seed": 9})
    assert (scenario.title, scenario.simulation.seed) == ("base", 9)


def test_an_unknown_variant_lists_the_known_ones(write):
    path = write(FAMILY)
    assert refusal(f"{path}#short") == (
        f"{path}#short: no such variant; choose plain, long, trotting, tilted"
    )
    assert "did you mean trotting? choose plain, long" in refusal(f"{path}#troting")


def test_a_file_without_variants_says_so(write):
    path = write("title = 'alone'")
    assert refusal(f"{path}#any") == f"{path}#any: no such variant; the file has no variants"


@pytest.mark.parametrize("choice", ["", "#a"])
@pytest.mark.parametrize(
    ("text", "key", "allowed"),
    [
        ('[[variant]]\nname = "a"\n[[variant]]\nname = "a"', "variant.name = 'a'", "used twice"),
        ('[[variant]]\nname = "a b"', 'name = "a b"', "letters, digits, _, . and -"),
        ('[[variant]]\ntitle = "a"', "name", "required"),
        ("[[variant]]\nname = 3", "name = 3", "must be a string"),
        ('[variant]\nname = "a"', "variant = ", "[[variant]] tables"),
        ("variant = [1]", "= 1", "must be a table"),
    ],
    ids=["duplicate", "bad name", "no name", "number for a name", "one table", "number"],
)
def test_a_mistake_in_a_family_is_one_line(write, text, key, allowed, choice):
    path = write(text)
    file, _, rest = refusal(f"{path}{choice}").partition(": ")
    assert file == str(path)
    assert key in rest
    assert allowed in rest.partition(key)[2]


def test_a_misspelt_table_in_a_variant_is_refused(write):
    path = write('[[variant]]\nname = "a"\n[[variant.expects]]\nmetric = "duration"\nmin = 1.0')
    line = refusal(f"{path}#a")
    assert line.startswith(f"{path}#a: expects = ")
    assert "did you mean expect?" in line


def test_a_variant_may_not_mix_the_keys_of_two_types(write):
    text = FAMILY + '[[variant]]\nname = "mixed"\n[variant.gait]\ntype = "fixed"\namplitude = 1.0'
    assert "gait.amplitude = 1.0: unknown key" in refusal(f"{write(text)}#mixed")


# --- overrides ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "key", "value"),
    [
        ("controller.decoupler=exact", "controller.decoupler", "exact"),
        ("simulation.duration = 2.5", "simulation.duration", 2.5),
        ("simulation.seed=7", "simulation.seed", 7),
        ("controller.allow_unstable=true", "controller.allow_unstable", True),
        ("gait.angles=[0.1, 0.2, 0.3, 0.4]", "gait.angles", [0.1, 0.2, 0.3, 0.4]),
        ("title=a = b", "title", "a = b"),
        ('title="3"', "title", "3"),
    ],
)
def test_an_override_is_read_as_toml_or_as_a_string(text, key, value):
    assert parse_override(text) == (key, value)


@pytest.mark.parametrize("text", ["controller.decoupler", "=3", " = 3", ""])
def test_an_override_without_key_or_equals_sign_is_refused(text):
    assert refused(parse_override, text) == (
        f"--set {text}: write KEY=VALUE, for example controller.decoupler=exact"
    )


def test_an_override_changes_one_key(write):
    changed = load_scenario(f"{write(FAMILY)}#long", {"simulation.seed": 9, "title": "mine"})
    assert (changed.simulation.seed, changed.simulation.duration) == (9, 4.0)
    assert changed.title == "mine"


@pytest.mark.parametrize("turn", [1, -1], ids=["type first", "type last"])
def test_a_type_is_set_before_the_keys_of_its_table(write, turn):
    changes = [("gait.type", "trot_continuous"), ("gait.amplitude", 0.2), ("gait.period", 3.0)]
    gait = load_scenario(f"{write(FAMILY)}#plain", dict(changes[::turn])).gait
    assert gait.model_dump(exclude={"scale", "bias"}) == {
        "type": "trot_continuous",
        "amplitude": 0.2,
        "period": 3.0,
    }


def test_a_type_that_is_set_already_keeps_its_table(write):
    gait = load_scenario(f"{write(FAMILY)}#plain", {"gait.type": "fixed"}).gait
    assert gait.angles == (0.1, 0.2, 0.3, 0.4)


@pytest.mark.parametrize(
    ("key", "value", "shown", "allowed"),
    [
        ("title.x", 3, "title.x = 3", "title is not a table"),
        (
            "controller.decopler",
            "exact",
            'controller.decopler = "exact"',
            "did you mean decoupler?",
        ),
        ("simulation.duration", "long", 'simulation.duration = "long"', "must be a number"),
        ("gait", 5, "gait = 5", "must be a table"),
        ("controller.law", {"a": 1}, 'controller.law = {"a": 1}', "choose attitude_altitude"),
        ("controller.law", [1], "controller.law = [1]", "choose attitude_altitude"),
    ],
)
def test_a_mistake_in_an_override_is_one_line(write, key, value, shown, allowed):
    path = write("title = 'alone'")
    line = refusal(path, {key: value})
    assert line.startswith(f"{path}: {shown}: ")
    assert allowed in line


@pytest.mark.parametrize(
    "changes",
    [
        {"gait.angles[0]": 0.1, "gait.angles": [0.0] * 4},
        {"gait.angles": [0.0] * 4, "gait": {"type": "fixed"}},
        {"gait": {"angles": [0.0] * 4}, "gait.type": "fixed"},  # a type is set before the others
    ],
)
def test_overrides_that_would_replace_another_are_refused(write, changes):
    path = write("gait = { type = 'fixed', angles = [0.1, 0.2, 0.3, 0.4] }")
    whole, part = sorted(changes, key=len)
    assert f"{path}: {whole} = " in (line := refusal(path, changes))
    assert line.endswith(f": would replace {part}, which is also given; give one of them")


def test_an_entry_of_a_list_that_is_set_may_be_set_after_it(write):
    path = write("gait = { type = 'fixed', angles = [0.1, 0.2, 0.3, 0.4] }")
    gait = load_scenario(path, {"gait.angles": [0.0] * 4, "gait.angles[0]": 0.1}).gait
    assert gait.angles == (0.1, 0.0, 0.0, 0.0)


def test_a_mistake_knows_the_keys_that_are_missing():
    for gait, missing in (
        ({"type": "walk"}, {"gait.amplitude", "gait.period"}),
        ({"period": 1.0}, {"gait.type"}),
        ({"type": "walk", "amplitude": 0.1, "period": "long"}, set()),
    ):
        with pytest.raises(InputError) as caught:
            parse_scenario({"gait": gait})
        assert caught.value.missing == missing


# --- the way back, and the library -------------------------------------------------------------


EVERY_KEY = """
title = "Quotes \\" and lines\\nand ümläute"
source = "ch. 1"
[vehicle]
preset = "luukkonen"
mass = 0.5
inertia = [0.005, 0.005, 0.009]
arm_length = 0.2
thrust_coefficient = 3e-6
drag_coefficient = 1e-7
gravity = 9.7
min_rotor_speed = 10.0
max_rotor_speed = 900.0
tilt_servo = { natural_frequency = 40.0, damping_ratio = 0.7, max_angle = 1.5 }
pod = { mass = 0.01, inertia = 1e-5 }
[simulation]
duration = 0.3
timestep = 0.0005
control_timestep = 0.002
record_timestep = 0.1
engine = "native"
integrator = "implicitfast"
seed = 12
[initial]
position = [1, 2, 3]
velocity = [0.1, 0.2, 0.30000000000000004]
attitude = [0.1, -0.1, 3.0]
angular_velocity = [0, 0, 1]
rotor_speed = [300.0, 310.0, 320.0, 330.0]
[controller]
decoupling = "exact"
decoupler = "exact"
allow_unstable = true
gains = { attitude = [[1, 2, 3], [4, 5, 6], [7, 8, 9]], altitude = [1, 2, 3], position = [4, 5] }
[gait]
type = "trot_continuous"
amplitude = -0.3
period = 2.0
[reference]
type = "circle"
position = [0, 0, 1]
radius = 2.0
angular_frequency = -0.3
yaw = 0.2
acceleration_feedforward = true
[[expect]]
metric = "diverged"
equals = false
[[expect]]
metric = "final_roll"
published = 0.1
max = 0.2
"""


@pytest.mark.parametrize(
    "text",
    [
        "",
        EVERY_KEY,
        '[reference]\ntype = "attitude_altitude"\naltitude = 2.0\n[controller]\ndecoupler = "none"',
        '[reference]\ntype = "line"\nvelocity = [1, 2, 3]',
    ],
    ids=["defaults", "every key", "attitude reference", "line"],
)
def test_a_scenario_written_as_toml_reads_back_equal(text):
    scenario = parse_scenario(tomllib.loads(text))
    assert parse_scenario(tomllib.loads(scenario_toml(scenario))) == scenario


@pytest.mark.parametrize("address", LIBRARY)
def test_every_scenario_of_the_library_loads_and_reads_back_equal(address):
    scenario = load_scenario(address)
    assert scenario.address == address
    assert scenario.title
    assert scenario.source
    again = parse_scenario(tomllib.loads(scenario_toml(scenario)), address)
    assert again == scenario
    assert json.loads(again.model_dump_json()) == json.loads(scenario.model_dump_json())


def test_addresses_of_the_library_are_unique():
    assert len(set(LIBRARY)) == len(LIBRARY) > 0


def test_gains_too_fast_for_the_time_step_are_refused_with_the_longest_step(write):
    """Under the published matrix a gain of 10 on the acceleration means a pole near 7200 rad/s."""
    rows = "[[10.0, 10.0, 1.0], [10.0, 10.0, 10.0], [10.0, 10.0, 10.0]]"
    text = f"[controller.gains]\nattitude = {rows}\naltitude = [10.0, 5.0, 10.0]\n"
    line = refusal(write(text))
    assert "simulation.timestep = 0.001" in line
    assert "roll loop" in line
    assert "at most 0.000346 s" in line
    assert load_scenario(write(text + "[simulation]\ntimestep = 1e-4\n")).simulation.steps == 400000


def test_control_too_coarse_for_the_loop_is_refused(write):
    line = refusal(write("[simulation]\ncontrol_timestep = 0.004\n"))
    assert "simulation.control_timestep = 0.004" in line


def test_an_unknown_key_is_reported_before_a_missing_one(write):
    text = '[gait]\ntype = "trot_instant"\namplitude = 0.3\nperod = 2.0\n'
    assert "gait.perod = 2.0: unknown key; did you mean period?" in refusal(write(text))


def test_a_single_table_of_a_list_is_refused_with_its_correct_form(write):
    line = refusal(write('[expect]\nmetric = "duration"\nmin = 1.0\n'))
    assert "expect: must be a list of tables; write [[expect]]" in line


# --- merging -----------------------------------------------------------------------------------

SPELT_OUT = {"law": "attitude_altitude", "gains": "exact"}


def test_the_default_law_written_out_keeps_the_rest_of_its_table():
    """A table without ``law`` is of the default one: naming it is no change of the kind."""
    unnamed = {"controller": {"decoupler": "exact"}}
    merged = merge(unnamed, {"controller": SPELT_OUT})
    assert merged == {"controller": {"decoupler": "exact", **SPELT_OUT}}
    assert unnamed == {"controller": {"decoupler": "exact"}}, "its arguments stay as they are"
    back = merge({"controller": SPELT_OUT}, unnamed)
    assert back == {"controller": {**SPELT_OUT, "decoupler": "exact"}}


def test_another_law_or_type_replaces_the_whole_table():
    base = {"controller": {"decoupler": "exact"}, "gait": {"type": "fixed", "angles": [0.0] * 4}}
    full_pose, walk = {"law": "full_pose"}, {"type": "walk"}
    assert merge(base, {"controller": full_pose, "gait": walk}) == {
        "controller": full_pose,
        "gait": walk,
    }
    longer = merge({"simulation": {"duration": 1.0}}, {"simulation": {"timestep": 0.002}})
    assert longer == {"simulation": {"duration": 1.0, "timestep": 0.002}}
    assert merge({"gait": 1}, {"gait": walk}) == {"gait": walk}
    assert merge({"gait": walk}, {"gait": 1}) == {"gait": 1}


def test_a_kind_with_the_same_keys_keeps_them():
    trot = load_scenario({"gait": {"type": "trot_continuous", "amplitude": 0.3, "period": 2.0}})
    changed = trot.replace({"gait.type": "trot_instant"})
    assert changed.gait.model_dump() == trot.gait.model_dump() | {"type": "trot_instant"}
    assert merge(trot.model_dump(), {"gait": {"type": "trot_instant"}})["gait"]["period"] == 2.0


@pytest.mark.parametrize(
    ("changes", "end"),
    [
        (
            {"gait.type": "trot_instant"},
            'gait.type = "trot_instant": drops the other keys of gait; also set gait.amplitude, '
            "gait.period",
        ),
        (
            {"reference.type": "circle"},
            'reference.type = "circle": drops the other keys of reference; also set '
            "reference.radius, reference.angular_frequency",
        ),
    ],
)
def test_a_change_of_kind_says_what_it_drops(changes, end):
    case = {"gait": {"type": "fixed", "angles": [0.0, 0.0, 0.0, 0.0]}}
    assert refusal(case, changes).endswith(end)


@pytest.mark.parametrize(
    ("document", "line"),
    [
        (
            {"reference": {"type": "waypoints", "waypoints": [[0, 0, 0], [1, 0, 0]]}},
            "reference.waypoints = [[0, 0, 0], [1, 0, 0]]: unknown key; ",
        ),
        (
            {"reference": {"type": "waypoints", "waypoints": [[0, 0, 0]], "times": [0, 1]}},
            "did you mean positions? known:",
        ),
        ({"gait": {"type": "walk"}}, "gait.amplitude: missing, and required (also missing: gait.p"),
        ({"simulation": {"duration": "10s"}}, '"10s": must be a number in s, without the unit'),
    ],
)
def test_messages_name_the_keys_of_the_file_and_their_units(document, line):
    assert line in refusal(document)
    assert "waypoints.waypoints" not in refusal(document)


def test_a_custom_controller_decides_on_the_acceleration_of_the_reference():
    case = {"reference": {"type": "setpoint", "acceleration_feedforward": True}}
    own = {"controller.law": "python", "controller.function": "mine.py:fly"}
    for changed in (load_scenario(case, own), load_scenario(case, controller="mine.py:fly")):
        assert not changed.reference.acceleration_feedforward
    kept = own | {"reference.acceleration_feedforward": True}
    assert refusal(case, kept).endswith("always includes all derivatives; set it to false")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("[gait]\n[gait]", "Cannot declare [gait] twice (at line 2"),
        ("[vehicle.pod]\n[vehicle.pod]", "Cannot declare [vehicle.pod] twice (at line 2"),
        ("title = trot", "Invalid value; text needs quotes (at line 1"),
        ('[[expect]]\nmetric = "final_eror_x"\nmax = 1.0', "did you mean final_position_error_x?"),
    ],
)
def test_mistakes_in_files_are_quoted_as_written(write, text, reason):
    assert reason in refusal(write(text))
