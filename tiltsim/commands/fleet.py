"""``tiltsim fleet``: the vehicles that ship as MJCF files, and what each can do."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, Final

from tiltsim.commands.options import Subparsers, add_json
from tiltsim.commands.text import json_text, number, print_line, table

HEADER: Final = (
    "vehicle",
    "rotors",
    "tilt hinges",
    "tilt angles (rad)",
    "dimension",
    "singular attitudes",
    "margin (rad)",
    "side force (% of weight)",
    "survives the loss of",
)


def add_parser(subparsers: Subparsers) -> None:
    """Declare the command."""
    description = """List the vehicles that ship as MJCF files: rotors, dimension of the
    torque-free forces, singular attitudes, margin at level attitude, side force that level hover
    leaves in every direction, and the rotors whose loss leaves a hover that can be controlled."""
    summary = "list the vehicles that ship as MJCF files"
    parser = subparsers.add_parser("fleet", help=summary, description=description)
    add_json(parser)
    parser.add_argument("--markdown", action="store_true", help="as the table of docs/fleet.md")
    pictures = "also draw a picture of each, fleet_NAME.png"
    parser.add_argument("--pictures", type=Path, metavar="DIR", help=pictures)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Analyze, draw, print."""
    from tiltsim.errors import InputError

    if arguments.json and arguments.markdown:
        raise InputError("fleet: give either --json or --markdown")
    if arguments.pictures is not None:
        from tiltsim.views.video import prefer_offscreen_gl

        prefer_offscreen_gl()
    from tiltsim.studies.fleet import fleet_report

    report = fleet_report()
    if arguments.pictures is not None:
        _draw(arguments.pictures, quiet=arguments.json or arguments.markdown)
    if arguments.json:
        print(json_text(report))
        return 0
    rows = [_row(vehicle) for vehicle in report]
    print(markdown(rows) if arguments.markdown else table(HEADER, rows, frozenset({1, 2, 4, 6, 7})))
    return 0


def markdown(rows: list[tuple[str, ...]]) -> str:
    """The table as Markdown, with links to the files."""
    lines = ["| " + " | ".join(cells) + " |" for cells in (HEADER, ("---",) * len(HEADER))]
    for name, *cells in rows:
        lines.append(f"| [{name}](../mjcf/{name}.xml) | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _row(vehicle: dict[str, Any]) -> tuple[str, ...]:
    share, sets = vehicle["side_force_share"], vehicle["singular_attitudes"]
    angles, survived = vehicle["angles"], vehicle["survives"]
    return (
        vehicle["name"],
        str(vehicle["rotors"]),
        str(vehicle["tilts"]),
        ", ".join(number(angle) for angle in angles) or "-",
        str(vehicle["torque_free_dimension"]),
        sets,
        "-" if sets == "none" else number(vehicle["singularity_margin"], ".4f"),
        "-" if share is None else number(100.0 * share, ".1f"),
        ", ".join(map(str, survived)) or "none",
    )


def _draw(folder: Path, *, quiet: bool) -> None:
    from tiltsim.studies.fleet import FLEET, fleet_file
    from tiltsim.system.files import prepare_folder
    from tiltsim.views.video.portrait import save_portrait

    prepare_folder(folder)
    for name, angles in FLEET.items():
        file = folder / f"fleet_{name}.png"
        save_portrait(fleet_file(name), angles, file)
        if not quiet:
            print_line(f"picture written to {file}")
