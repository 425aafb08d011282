"""``tiltsim fleet``: the vehicles that ship as MJCF files, and the abilities of each."""

from pathlib import Path
from typing import Any, Final

from tiltsim.commands import text
from tiltsim.commands.options import Json, refuse_both


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


COLUMNS: Final[text.Columns] = {
    "vehicle": ("name", ""),
    "rotors": ("rotors", "d"),
    "tilt hinges": ("tilts", "d"),
    "tilt angles (rad)": (lambda row: ", ".join(map(text.number, row["angles"])) or "-", ""),
    "dimension": ("torque_free_dimension", "d"),
    "singular attitudes": ("singular_attitudes", ""),
    "margin (rad)": (_margin, ".4f"),
    "tilts as inputs": (_with_tilts, ""),
    "side force (% of weight)": (_side_force, ".1f"),
    "survives the loss of": (lambda row: ", ".join(map(str, row["survives"])) or "none", ""),
}


def run(*, json: Json = False, markdown: bool = False, pictures: Path | None = None) -> int:
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
                text.print_line(f"picture written to {pictures / f'fleet_{name}.png'}")
    if markdown:
        linked = [row | {"name": f"[{row['name']}](../mjcf/{row['name']}.xml)"} for row in report]
        print("\n".join(text.markdown_table([*COLUMNS], text.cells(COLUMNS, linked)[1:])))
    else:
        print(text.json_text(report) if json else text.table(COLUMNS, report))
    return 0
