"""``tiltsim new``, ``list``, ``fleet``, ``autopilot``, ``schema``: the library, files to fly."""

import json
import shlex
from functools import cache
from pathlib import Path
from typing import Any, Final

from tiltsim.commands.options import Json, Overrides, Silent, load_scenarios, refuse_both
from tiltsim.commands.text import (
    Columns,
    cells,
    fitted,
    json_text,
    markdown_table,
    number,
    print_line,
    table,
    write_text,
)
from tiltsim.errors import InputError
from tiltsim.scenario.library import Entry, library_entries, library_families, library_sweeps
from tiltsim.system.text import printable


def run_new(kind: str, file: Path | None = None, *, force: bool = False) -> int:
    """Write a commented MJCF file of a vehicle, and beside it a scenario that flies it at once.

    Change the places, axes, masses and coefficients in the MJCF file into your vehicle's.

    Note:
        kinds: quadrotor, hexarotor, octorotor; canted_hexarotor and omni_octorotor, which also push
        sideways; bicopter, tricopter, tiltrotor and tilt_hexarotor, whose rotors tilt

    Args:
        kind (KIND): one of the kinds below
        file (FILE): the MJCF file (default: KIND.xml); the scenario is FILE with the suffix .toml
        force: replace files that exist
    """
    from tiltsim.models.starters import STARTERS, starter_mjcf, starter_scenario
    from tiltsim.system.files import exists, prepare_file

    if kind not in STARTERS:
        raise InputError(f"KIND {printable(kind)!r}: unknown; choose {', '.join(STARTERS)}")
    mjcf = Path(f"{kind}.xml") if file is None else file
    prepare_file("FILE", mjcf, (".xml",))
    scenario = mjcf.with_suffix(".toml")
    prepare_file("FILE", scenario)
    for path in () if force else (mjcf, scenario):
        if exists(path):
            raise InputError(f"{path}: exists; --force replaces it")
    write_text(mjcf, starter_mjcf(kind))
    write_text(scenario, starter_scenario(kind, mjcf.name))
    print_line(f"vehicle written to {mjcf}, scenario to {scenario}")
    print_line(f"fly it:         tiltsim run {shlex.quote(str(scenario))}")
    print_line(f"its abilities:  tiltsim gait --mjcf {shlex.quote(str(mjcf))}")
    return 0


def run_list(word: str = "", *, sweeps: bool = False, json: Json = False) -> int:
    """List the scenario library with titles and sources in the thesis.

    A line that begins with # is a variant of the file above it: tiltsim run 'FILE#VARIANT'.

    Args:
        word (WORD): only what has this text in its address, title or source; case does not matter
        sweeps: list only the sweeps
    """
    found = [sweep for sweep in library_sweeps() if sweep.contains(word)]
    if json:
        keys = ("sweep" if sweeps else "scenario", "title", "source")
        entries = found if sweeps else library_entries(word)
        print(json_text([dict(zip(keys, entry)) for entry in entries]))
        return 0
    lines = []
    for family in () if sweeps else library_families(word):
        width = max((len(member.address) for member in family.members), default=0)
        lines.append(_line(family.entry, family.entry.address))
        lines += [_line(member, f"  {member.address:<{width}}") for member in family.members]
    if lines and found:
        lines.append("\nsweeps, for tiltsim sweep:")
    lines += [_line(sweep, sweep.address) for sweep in found]
    if not lines:
        raise InputError(f"{word}: in no address, title or source of the library")
    print("\n".join(lines))
    return 0


def _line(entry: Entry, address: str) -> str:
    line = f"{address}  {entry.title}" + (f" ({entry.source})" if entry.source else "")
    return fitted(printable(line), len(address) + 2 if address.startswith(" ") else 4)


def _margin(vehicle: dict[str, Any]) -> float | None:
    return None if vehicle["singular_attitudes"] == "none" else vehicle["singularity_margin"]


def _side_force(vehicle: dict[str, Any]) -> float | None:
    share = vehicle["side_force_share"]
    return None if share is None else 100.0 * share


def _with_tilts(vehicle: dict[str, Any]) -> str:
    """Outputs that rotors and tilts together move about a level hover."""
    tilting = vehicle["with_tilts"]
    if tilting is None or tilting["attitude_and_lift"] < 4:
        return "-"
    return "position and attitude" if tilting["pose"] == 6 else "attitude and lift"


FLEET_COLUMNS: Final[Columns] = {
    "vehicle": ("name", ""),
    "rotors": ("rotors", "d"),
    "tilt hinges": ("tilts", "d"),
    "tilt angles (rad)": (lambda row: ", ".join(map(number, row["angles"])) or "-", ""),
    "dimension": ("torque_free_dimension", "d"),
    "singular attitudes": ("singular_attitudes", ""),
    "margin (rad)": (_margin, ".4f"),
    "tilts as inputs": (_with_tilts, ""),
    "side force (% of weight)": (_side_force, ".1f"),
    "survives the loss of": (lambda row: ", ".join(map(str, row["survives"])) or "none", ""),
}


def run_fleet(*, json: Json = False, markdown: bool = False, pictures: Path | None = None) -> int:
    """List the vehicles that ship as MJCF files.

    Each row has the rotors, dimension of the torque-free forces, singular attitudes, margin at
    level attitude, the outputs that rotors and tilts together move, side force that level hover
    leaves in every direction, and the rotors whose loss leaves a hover that can be controlled.

    Args:
        markdown: print the table of docs/fleet.md
        pictures (DIR): also draw a picture of each, fleet_NAME.png
    """
    from tiltsim.system.files import prepare_folder

    refuse_both(json=json, markdown=markdown)
    if pictures is not None:
        from tiltsim.views.video import prefer_offscreen_gl

        prefer_offscreen_gl()
    from tiltsim.studies.multirotor_analysis import FLEET, fleet_file, fleet_report

    report = fleet_report()
    if pictures is not None:
        from tiltsim.views.video.rendering import save_portrait

        prepare_folder(pictures)
        for name, angles in FLEET.items():
            save_portrait(fleet_file(name), angles, pictures / f"fleet_{name}.png")
            if not (json or markdown):
                print_line(f"picture written to {pictures / f'fleet_{name}.png'}")
    if markdown:
        linked = [row | {"name": f"[{row['name']}](../mjcf/{row['name']}.xml)"} for row in report]
        print("\n".join(markdown_table([*FLEET_COLUMNS], cells(FLEET_COLUMNS, linked)[1:])))
    else:
        print(json_text(report) if json else table(FLEET_COLUMNS, report))
    return 0


def run_autopilot(
    scenario: str, *, out: Path, overrides: Overrides = (), quiet: Silent = False
) -> int:
    """Write parameters.parm and frame.lua for ArduPilot, from the vehicle and its outputs.

    tiltsim run then flies the scenario, as soon as the firmware runs beside it.

    Args:
        scenario (SCENARIO): a TOML file or library name with an [autopilot] table
        out (DIR): folder for the files
    """
    from tiltsim.plants.autopilot import ardupilot_files
    from tiltsim.system.files import prepare_folder

    (loaded,) = load_scenarios([scenario], overrides, trust=False)
    files = ardupilot_files(loaded)
    prepare_folder(out)
    for name, text in files.items():
        write_text(out / name, text)
        if not quiet:
            print_line(f"{out / name} written")
    return 0


DIALECT: Final = "https://json-schema.org/draft/2020-12/schema"


def run_schema(address: str | None = None, *, sweep: bool = False, markdown: bool = False) -> int:
    """Print the JSON Schema of the scenario file, with which editors complete TOML.

    With a table or key, print its keys for people.

    Args:
        address (TABLE): a table or key such as gait, gait.walk or simulation.duration, to read
        sweep: print the keys of the sweep file instead
        markdown: print all keys as a page, docs/scenario.md
    """
    from tiltsim.commands.key_tables import description, key_tables, page

    schema = sweep_schema() if sweep else scenario_schema()
    if address is not None:
        print(description(key_tables(schema), address))
    elif markdown:
        print(page(key_tables(schema)), end="")
    else:
        print(json.dumps(schema, indent=2))
    return 0


@cache
def scenario_schema() -> dict[str, Any]:
    """The schema of a scenario file: a base, and variants that may change any of its tables.

    A variant lists only the differences from the base, so that only its name is required.
    """
    from tiltsim.scenario.scenario import Scenario, Variant
    from tiltsim.scenario.scenario_tables import DESCRIPTIVE

    schema = Scenario.model_json_schema()
    schema["title"] = "tiltsim scenario"
    schema["$schema"] = DIALECT
    variant = Variant.model_json_schema()
    for key, value in schema["properties"].items():
        partial = {"type": "object", "description": value["description"]}
        whole = key in DESCRIPTIVE or value.get("type") == "array"
        variant["properties"][key] = value if whole else partial
    variant["additionalProperties"] = False
    schema["$defs"]["Variant"] = variant
    schema["properties"]["variant"] = {
        "type": "array",
        "items": {"$ref": "#/$defs/Variant"},
        "description": "a family of flights: each lists only what differs from the file's base",
    }
    return schema


@cache
def sweep_schema() -> dict[str, Any]:
    """The schema of a sweep file."""
    from tiltsim.sweeps.tables import Sweep

    schema = Sweep.model_json_schema()
    schema["title"] = "tiltsim sweep"
    schema["$schema"] = DIALECT
    return schema
