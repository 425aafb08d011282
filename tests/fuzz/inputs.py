"""Kinds of inputs: each writes its files into a folder and returns the command to run."""

from __future__ import annotations

import argparse
import shutil
from functools import cache
from random import Random

from tests.fuzz.calls import python_call
from tests.fuzz.documents import STRANGE, Documents, damaged, dotted, toml_document, toml_text
from tiltsim.cli import build_parser, main
from tiltsim.commands.files import scenario_schema, sweep_schema
from tiltsim.flight.reading import load_flight
from tiltsim.resources import shipped_folder
from tiltsim.scenario.documents import parse_override
from tiltsim.scenario.loading import load_scenario, parse_scenario
from tiltsim.sweeps.loading import load_sweep

SHORT = ["--quiet", "--set", "expect=[]"]  # each expectation that fails has a line
for _key in ("duration=0.004", "timestep=0.002", "record_timestep=0.002", 'engine="python"'):
    SHORT += ["--set", f"simulation.{_key}"]
SETPOINT = "ch04_tracking/setpoint#rho_0_modified"
SWEEP = """
[scenario.simulation]
duration = 0.004
timestep = 0.002
engine = "python"
[[axis]]
type = "list"
key = "initial.position[0]"
values = [0.0, 0.1]
"""


@cache
def known_values():
    """Values by dotted key of scenarios, drawn until all tables of the schema had their turn."""
    documents = Documents(scenario_schema(), Random(1), strange=0.0)
    found = {}
    for _ in range(300):
        found |= dotted(documents.draw())
    found = {key: value for key, value in found.items() if "[" not in key or key[-2] in "03"}
    return sorted(found.items())


REACHES_OUT = {"--help", "--live", "--cluster", "--connect"}
"""Options that are not drawn: of other programs, which may answer late."""


@cache
def parsers():
    """The parser of each command of the command line."""
    (subparsers,) = (
        action
        for action in build_parser()._actions
        if isinstance(action, argparse._SubParsersAction)
    )
    return subparsers.choices


@cache
def options_of(command):
    """A command's own options, without options that name files to write."""
    actions = parsers()[command]._actions
    return [a for a in actions if a.metavar != "FILE" and not REACHES_OUT & {*a.option_strings}]


def scenario_file(random, folder):
    """A scenario file: read, and flown for a moment if it is valid."""
    document = Documents(scenario_schema(), random).draw()
    content = toml_document(document).encode(errors="surrogatepass")
    if random.random() < 0.3:
        library = sorted((shipped_folder("scenarios")).rglob("*.toml"))
        content = damaged(random.choice(library).read_bytes(), random)
    file = folder / random.choice(("a.toml", "b\x1b[2J.toml", "ü b.toml"))
    file.write_bytes(content)
    if random.random() < 0.9:
        return lambda: load_scenario(file)
    return lambda: main(["run", str(file), *SHORT])


def sweep_file(random, folder):
    """A sweep file."""
    file = folder / "sweep.toml"
    document = Documents(sweep_schema(), random).draw()
    if random.random() < 0.8:
        document["scenario"] = SETPOINT
        document.setdefault("set", {})
        document["axis"] = document.get("axis") or [{"type": "list"}]
        axes = document["axis"] if isinstance(document["axis"], list) else []
        for axis in axes:
            if isinstance(axis, dict):
                axis["key"], value = random.choice(known_values())
                axis.pop("keys", None)
                if axis.get("type") == "list":
                    axis["values"] = [value, random.choice((value, value, *STRANGE))]
    content = toml_document(document).encode(errors="surrogatepass")
    if random.random() < 0.2:
        content = damaged(SWEEP.encode(), random)
    file.write_bytes(content)
    return lambda: load_sweep(file)


def override(random, _folder):
    """One to three ``--set``."""
    texts = []
    for _ in range(random.choice((1, 1, 2, 3))):
        key, value = random.choice(known_values())
        value = toml_text(random.choice((value, value, *STRANGE[: random.randrange(1, 30)])))
        if random.random() < 0.2:
            key, value = (
                damaged(text.encode(errors="replace"), random).decode(errors="replace")
                for text in (key, value)
            )
        texts.append(f"{key}={value}")
    if random.random() < 0.1:
        given = [part for text in texts for part in ("--set", text)]
        return lambda: main(["run", SETPOINT, *given, *SHORT])
    return lambda: load_scenario(SETPOINT, dict(map(parse_override, texts)))


def arguments(random, folder):
    """Arguments of the commands that analyze gaits."""
    command = random.choice(("gait", "gait", "map", "singularity"))
    given = ["quadrotor"] if command == "singularity" else []
    if command == "gait":
        key, values = random.choice(
            (
                ("--angles", ("0.2,0.2,-0.3,0.1", "0,0,0,0", "1,1,1,1", _word(random, None))),
                ("--published", ("ch03_trot", "walk", _word(random, None))),
                ("--balance", ("1,0,0", "0,0,-9.8", "1e9,0,0", _word(random, None))),
                ("--", (SETPOINT, "ch04_tracking/circle#instant_t1_modified", "")),
            )
        )
        given += [key, random.choice(values)] if key != "--" else [random.choice(values)]
    for action in options_of(command):
        if action.option_strings and random.random() < 1.5 / len(options_of(command)):
            count = {None: 1, "+": 2, "?": 1}.get(action.nargs, action.nargs)
            given += [action.option_strings[0], *(_word(random, action) for _ in range(count))]
    return lambda: main([command, *given])


def any_command(random, folder):
    """A command with words for its arguments, and any of its options; long ones are interrupted."""
    command, parser = random.choice(sorted(parsers().items()))
    given = []
    for action in parser._actions:
        if REACHES_OUT & {*action.option_strings}:
            continue
        if not action.option_strings:
            given += [_given(random, folder, action) for _ in range(random.choice((1, 1, 2)))]
        elif random.random() < 2.0 / len(parser._actions):
            count = {None: 1, "+": 2, "?": 1, "*": 1}.get(action.nargs, action.nargs)
            values = [_given(random, folder, action) for _ in range(count)]
            given += [action.option_strings[0], *values]
    if "--quiet" in parser._option_string_actions:
        given.append("--quiet")
    if "--jobs" in parser._option_string_actions:  # the last one counts
        given += ["--jobs", "1"]
    if command == "view":  # else a window opens
        given += ["--rerun", str(folder / "a.rrd")]
    if "--out" in parser._option_string_actions and command != "check":
        given += ["--out", str(folder / random.choice(("out", "out.png", "a/b")))]
    return lambda: main([command, *given])


def _given(random, folder, action):
    """A value of an option or argument, by its name in the help."""
    names = action.metavar if isinstance(action.metavar, str) else ""
    likely = {
        "SCENARIO": (SETPOINT, "beyond/baselines#pid_quadrotor", "ch04_tracking/setpoint", "a"),
        "SWEEP": ("beyond/sweeps/monte_carlo", SETPOINT, "a.toml"),
        "PATH": (SETPOINT, "ch02", str(folder)),
        "FLIGHT": (str(folder), "flight.parquet"),
        "FILE": (str(folder / "a.json"), str(folder / "a.png"), str(folder / "none" / "a")),
        "DIR": (str(folder / "new"), "/dev/null"),
        "FILE.rrd": (str(folder / "a.rrd"), str(folder)),
        "TABLE": ("gait", "controller", "vehicle.mass"),
        "KEY=VALUE": ("vehicle.mass=1", "gait.period=nan", "expect=[]", "=", "a=["),
        "KEY[=FROM:TO[:POINTS]]": ("vehicle.mass", "vehicle.mass=0.4:0.5:2", "gait=1:2", "x=::"),
        "NAME=TABLE": ("a={law='pid'}", "a={}", "a=[", "=", "a={law='python'}"),
        "A,B,...": ("pid,lqr", "tiltrotor", "margin,position", ",", "x"),
        "N": ("1", "0", "-1", "1.5", "9" * 30),
    }.get(names)
    if likely and random.random() < 0.7:
        return random.choice(likely)
    word = _word(random, action)
    # A file with a strange name is written all the same, where it is removed.
    return str(folder / word.replace("/", "_")) if names in {"DIR", "FILE", "FILE.rrd"} else word


def _word(random, action):
    """A value of an option; None for a list of numbers or a name."""
    if action is not None and action.choices and random.random() < 0.8:
        return random.choice(list(action.choices))
    numbers = ("0.3", "-0.2", "0", "1e-9", "3.15", "nan", "1e999", "", "x")
    several = ["0.2", "0.2", "-0.3", "0.1"][: random.choice((2, 3, 4))]
    if random.random() < 0.5:
        several[random.randrange(len(several))] = random.choice(numbers)
    words = (
        ",".join(several),
        random.choice(numbers),
        f"mass={random.choice(numbers)}",
        "ar_drone_2,drag_coefficient=1e-7",
        random.choice(("red", "blue", "fixed", SETPOINT)),
        str(random.choice(STRANGE))[:200].replace("\0", ""),
    )
    return random.choice(words)


@cache
def _model_texts():
    return [file.read_bytes() for file in sorted(shipped_folder("mjcf").glob("*rotor.xml"))]


def mjcf_file(random, folder):
    """A vehicle's MJCF: an attribute changed, a tag removed, bytes damaged."""
    shutil.copy(shipped_folder("mjcf") / "scene.xml", folder)
    file, content = folder / "own.xml", random.choice(_model_texts())
    for _ in range(random.choice((1, 1, 3))):
        parts = content.split(b'"')
        place = random.randrange(1, len(parts) - 1, 2)
        new = random.choice((b"nan", b"1e300", b"-1", b"0 0 0", b"x", b"", b"\x01", b"9" * 400))
        parts[place] = new if random.random() < 0.5 else damaged(parts[place], random)
        content = b'"'.join(parts)
    file.write_bytes(content)
    model = random.choice(("tiltrotor", "quadrotor"))
    return lambda: parse_scenario({"vehicle": {"model": model, "mjcf": str(file)}})


def damaged_flight(random, folder):
    """A ``flight.parquet``."""
    (folder / "flight.parquet").write_bytes(damaged(_results(folder)["flight.parquet"], random))
    return lambda: load_flight(folder)


def damaged_sweep(random, folder):
    """A finished sweep with a damaged file, continued."""
    results = _results(folder)
    chosen = random.choice([name for name in results if name.startswith("sweep/")])
    for name, content in results.items():
        if name.startswith("sweep"):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(damaged(content, random) if name == chosen else content)
    command = ["sweep", str(folder / "sweep.toml"), "--out", str(folder / "sweep")]
    return lambda: main([*command, "--jobs", "1", "--quiet"])


def damaged_cache(random, folder):
    """A file of the cache of compiled code, which counts as missing."""
    from tiltsim.engines.machine_code import _load, _save

    code, file = random.randbytes(random.randrange(200)), folder / "code.o"
    _save(file, code)
    whole = file.read_bytes()
    file.write_bytes(damaged(whole, random))

    def read():
        assert _load(file) is None or file.read_bytes() == whole

    return read


_kept = {}


def _results(folder):
    """The files of a flight and of a finished sweep, made once."""
    if not _kept:
        place = folder / "made"
        place.mkdir()
        (place / "sweep.toml").write_text(SWEEP)
        sweep = ["sweep", str(place / "sweep.toml"), "--out", str(place / "sweep"), "--quiet"]
        assert main(["run", SETPOINT, *SHORT, "--out", str(place)]) == 0
        assert main([*sweep, "--jobs", "1"]) == 0
        for file in place.rglob("*"):
            if file.is_file() and file.suffix in {".parquet", ".json", ".toml"}:
                _kept[file.relative_to(place).as_posix()] = file.read_bytes()
        shutil.rmtree(place)
    return _kept


KINDS = (
    *(scenario_file, scenario_file, scenario_file, sweep_file, sweep_file, override, override),
    *(arguments, mjcf_file, damaged_flight, damaged_sweep, damaged_cache),
    *(any_command, any_command, python_call, python_call, python_call),
)
"""Kinds of inputs, by turns; the most important ones more often."""
