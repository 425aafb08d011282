"""The reports of ``tiltsim gait`` as text: of a gait, of all gaits, of a multirotor."""

from collections.abc import Sequence
from typing import Any, Final

from tiltsim.commands.gait_options import vehicle_text
from tiltsim.commands.text import Columns, aligned, number, numbers, table
from tiltsim.system.text import printable

CURVES: Final = {
    "graph": "one pitch for each roll",
    "vertical": "two rolls, at any pitch",
    "none": "none: every attitude is acceptable",
    "everywhere": "every attitude",
}
"""Descriptions of the kinds of singular-attitude curves."""


SETS: Final = {
    "all": "every attitude",
    "great circle": "attitudes with world up in a plane of the body (a great circle)",
    "two directions": "attitudes with world up along one line of the body (two directions)",
    "none": "none",
}

LIST: Final[Columns] = {
    "gait": (lambda row: row.key, ""),
    "color": (lambda row: row.color or "-", ""),
    "angles": (lambda row: "printed" if row.printed else "ours", ""),
    "margin": (lambda row: row.margin, ".4f"),
    "exact": (lambda row: row.margin_exact, ".4f"),
    "biased": (lambda row: row.margin_biased, ".4f"),
    "condition": (lambda row: row.conditioning if row.conditioning > 1e-12 else "0", ".2e"),
    "claim": (lambda row: {True: "yes", False: "no", None: "-"}[row.claim_holds], ""),
}

DETERMINANT: Final[Columns] = {
    "alpha_1 (rad)": ("alpha_1", ".6g"),
    "alpha_3 (rad)": ("alpha_3", ".6g"),
    "minimum R in the triangle U V M": ("least_R", ".6g"),
}


def list_text(rows: Sequence[Any]) -> str:
    """The robustness table of the thesis's gaits."""
    return f"""{table(LIST, rows)}

margin: minimum over a period at level attitude, rad; negative: R changes sign
exact: the same on the exact lines of the color; biased: of the biased twin
condition: smallest over largest singular value of tau, on the exact lines
claim: more robust than the biased twin, and not singular itself"""


def determinant_text(report: dict[str, Any]) -> str:
    """The minima of R for the restrictions of ch. 3."""
    return table(DETERMINANT, report["pairs"])


def gait_text(report: dict[str, Any]) -> str:
    """The analysis in aligned lines; a moving gait's values at time zero and their worst case."""
    direction = report["torque_free_direction"]
    at_start = " at the gait's start" if "time" in report else ""
    rows = [
        (
            "gait",
            printable(report["gait"] + (f" ({report['source']})" if report["source"] else "")),
        ),
        ("vehicle", vehicle_text(report["vehicle"])),
        ("tilt angles", numbers(report["angles"]) + " rad"),
        ("rank of tau", str(report["rank"])),
        ("singular values", numbers(report["singular_values"]) + " of tau / (L K_f)"),
        ("R, R_phi, R_theta", numbers([report["R"], report["R_phi"], report["R_theta"]])),
        ("torque-free force", "along " + numbers(direction) if direction else "none"),
        ("singularity margin", f"{number(report['singularity_margin'])} rad{at_start}"),
        (
            "acceptable share",
            f"{100.0 * report['acceptable_share']:.2f} % of the roll-pitch square",
        ),
        ("singular attitudes", CURVES[report["unacceptable_attitudes"]["kind"]]),
    ]
    if "determinant" in report:
        attitude = f"roll {number(report['roll'])}, pitch {number(report['pitch'])} rad"
        rows.insert(8, ("determinant", f"{number(report['determinant'])} at {attitude}"))
    if report["hover_rotor_speeds"] is not None:
        speeds = numbers(report["hover_rotor_speeds"])
        rows.append(("hover rotor speeds", f"{speeds} rad/s along the spins"))
    if "time" in report:
        rate = "jumps" if report["max_rate"] is None else f"{report['max_rate']:.6g} rad/s"
        rows += [
            ("period", f"{report['period']:g} s; the values above hold at t = 0"),
            ("maximum tilt angle", f"{report['amplitude']:.6g} rad"),
            ("maximum tilt rate", rate),
            ("minimum rank", str(report["min_rank"])),
            ("minimum margin", f"{number(report['min_singularity_margin'])} rad over the period"),
            ("", "its sign is relative to the gait's start: negative once R has changed sign"),
        ]
    rows += [_loss_row(loss) for loss in report.get("faults", {}).get("rotor_loss", [])]
    return "\n".join([*aligned(rows), *(f"warning: {text}" for text in report["warnings"])])


def _loss_row(loss: dict[str, Any]) -> tuple[str, str]:
    """How the vehicle hovers after the loss of a rotor."""
    fixed = (
        "these tilt angles hover, but cannot be controlled"
        if loss["hovers_with_fixed_tilts"]
        else f"these tilt angles are {number(loss['fixed_tilts_miss'])} rad away from a hover"
    )
    angles = numbers(loss["free_tilts"]["angles"])
    return (
        f"without rotor {loss['rotor']}",
        f"{fixed}; other angles hover with rotors that reach {loss['least_speed']:.4g} rad/s, such "
        f"as {angles} rad",
    )


def multirotor_text(report: dict[str, Any]) -> str:
    """The analysis in aligned lines."""
    direction, hover = report["torque_free_direction"], report["hover"]
    attitude = f"roll {number(report['roll'])}, pitch {number(report['pitch'])} rad"
    rows = [
        ("vehicle", printable(report["vehicle"])),
        ("rotors, tilt hinges", f"{report['rotors']}, {report['tilts']}"),
        ("tilt angles", numbers(report["angles"]) + " rad" if report["angles"] else "none"),
        ("rank of tau", str(report["rank"])),
        ("singular values", numbers(report["singular_values"]) + " of tau, by its largest column"),
        ("torque-free forces", f"of dimension {report['torque_free_dimension']}"),
        ("", "nearest to the z axis: " + numbers(direction) if direction else "none upward"),
        ("singular attitudes", SETS[report["singular_attitudes"]]),
        ("singularity margin", f"{number(report['singularity_margin'])} rad at {attitude}"),
        *_period_rows(report),
        ("hover", "none" if hover is None else _hover_text(hover)),
    ]
    if hover is not None:
        rows.append(("hover rotor speeds", numbers(hover["rotor_speeds"]) + " rad/s along spins"))
    if (tilting := report.get("with_tilts")) is not None:
        moved = f"{tilting['attitude_and_lift']} of attitude and lift, {tilting['pose']} of pose"
        rows.append(("with tilts as inputs", f"level hover at {numbers(tilting['angles'])} rad"))
        rows.append(("", f"moves {moved}"))
    if report["side_force_share"] is not None:
        share = f"{100.0 * report['side_force_share']:.4g} % of the weight in every direction"
        rows.append(("level side force", share))
    if "balance" in report:
        speeds = numbers(report["balance"]["rotor_speeds"]) + " rad/s along spins"
        rows.append(("balanced rotor speeds", speeds))
    for name, unit in (("forces", "N without torque"), ("torques", "N m at hover lift")):
        extent = (report["attainable"] or {}).get(name)
        if extent is not None and extent["lower"] is not None:
            bounds = zip(extent["lower"], extent["upper"], strict=True)
            ranges = ", ".join(
                f"{number(low, '.4g')}..{number(high, '.4g')}" for low, high in bounds
            )
            rows.append((f"attainable {name}", f"{ranges} {unit} (x, y, z)"))
    for loss in report.get("faults", ()):
        hover = loss["hover"]
        text = "no hover" if hover is None else _hover_text(hover)
        rows.append((f"without rotor {loss['rotor']}", text))
        if loss["free_tilts"] is not None:
            control = _control(loss["free_tilts"])
            rows.append(("", f"level, {control}, at {numbers(loss['free_tilts']['angles'])} rad"))
    return "\n".join([*aligned(rows), *(f"warning: {text}" for text in report["warnings"])])


def _period_rows(report: dict[str, Any]) -> list[tuple[str, str]]:
    """The worst instant of a moving gait; its other values are taken at time zero."""
    if "time" not in report:
        return []
    margin = number(report["min_singularity_margin"])
    return [
        ("over the gait", f"dimension {report['min_torque_free_dimension']} or more"),
        ("", f"margin {margin} rad or more; all else at t = 0"),
    ]


def _hover_text(hover: dict[str, Any]) -> str:
    level = "level" if hover["lean"] < 1e-6 else f"leaning by {number(hover['lean'], '.4g')} rad"
    return f"{level}, {_control(hover)}, up to {hover['max_rotor_speed']:.4g} rad/s"


def _control(hover: dict[str, Any]) -> str:
    return "controllable" if hover["controllable"] else "not controllable"
