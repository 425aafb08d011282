"""The reports of ``tiltsim gait`` as text: of a gait, and of all gaits of the thesis."""

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
    direction, on_cross, moves = report["torque_free_direction"], "R" in report, "time" in report
    attitude = f"roll {number(report['roll'])}, pitch {number(report['pitch'])} rad"
    unit = "tau / (L K_f)" if on_cross else "tau, by its largest column"
    source = f" ({report['source']})" if report["source"] else ""
    rows = [
        ("gait", printable(report["gait"] + source)),
        ("vehicle", printable(vehicle_text(report["vehicle"]))),
        ("rotors, tilt hinges", f"{report['rotors']}, {report['tilts']}"),
        ("tilt angles", numbers(report["angles"]) + " rad" if report["angles"] else "none"),
        ("rank of tau", str(report["rank"])),
        ("singular values", f"{numbers(report['singular_values'])} of {unit}"),
        ("torque-free forces", f"of dimension {report['torque_free_dimension']}"),
        ("", "nearest to the z axis: " + numbers(direction) if direction else "none upward"),
        ("singular attitudes", SETS[report["singular_attitudes"]]),
    ]
    if on_cross:
        residuals = [report[name] for name in ("R", "R_phi", "R_theta")]
        share = f"{100.0 * report['acceptable_share']:.2f} % of the roll-pitch square"
        rows += [
            ("", CURVES[report["unacceptable_attitudes"]["kind"]]),
            ("acceptable share", share),
            ("R, R_phi, R_theta", numbers(residuals)),
            ("determinant", f"{number(report['determinant'])} at {attitude}"),
        ]
    margin = f"{number(report['singularity_margin'])} rad at {attitude}"
    rows.append(("singularity margin", margin + (", at the gait's start" if moves else "")))
    if moves:
        rate = "jumps" if report["max_rate"] is None else f"{report['max_rate']:.6g} rad/s"
        worst = f"{report['min_rank']}; dimension {report['min_torque_free_dimension']} or more"
        rows += [
            ("period", f"{report['period']:g} s; the other values hold at t = 0"),
            ("maximum tilt angle", f"{report['amplitude']:.6g} rad"),
            ("maximum tilt rate", rate),
            ("minimum rank", worst),
            ("minimum margin", f"{number(report['min_singularity_margin'])} rad over the period"),
        ]
        if on_cross:
            sign = "its sign is relative to the gait's start: negative once R has changed sign"
            rows.append(("", sign))
    rows += _hover_rows(report)
    return "\n".join([*aligned(rows), *(f"warning: {text}" for text in report["warnings"])])


def _hover_rows(report: dict[str, Any]) -> list[tuple[str, str]]:
    """Hover and attainable sets, also without a rotor."""
    rows = [("hover", _hover_text(report["hover"]))]
    if report["hover_rotor_speeds"] is not None:
        speeds = f"{numbers(report['hover_rotor_speeds'])} rad/s along the spins"
        rows.append(("hover rotor speeds", speeds))
    if (tilting := report.get("with_tilts")) is not None:
        moved = f"{tilting['attitude_and_lift']} of attitude and lift, {tilting['pose']} of pose"
        rows.append(("with tilts as inputs", f"level hover at {numbers(tilting['angles'])} rad"))
        rows.append(("", f"moves {moved}"))
    if report["side_force_share"] is not None:
        share = f"{100.0 * report['side_force_share']:.4g} % of the weight in every direction"
        rows.append(("level side force", share))
    if "balance" in report:
        speeds = f"{numbers(report['balance']['rotor_speeds'])} rad/s along the spins"
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
        rows.append((f"without rotor {loss['rotor']}", _hover_text(loss["hover"])))
        if (free := loss["free_tilts"]) is not None:
            rows.append(("", f"{_hover_text(free)}, at {numbers(free['angles'])} rad"))
        if "least_speed" in loss:
            rows += [
                ("", f"at least {loss['least_speed']:.4g} rad/s at any tilt angles"),
                ("", f"a hover of two is {number(loss['fixed_tilts_miss'])} rad from these angles"),
            ]
    return rows


def _hover_text(hover: dict[str, Any] | None) -> str:
    if hover is None:
        return "none at these tilt angles"
    level = "level" if hover["lean"] < 1e-6 else f"leaning by {number(hover['lean'], '.4g')} rad"
    control = "controllable" if hover["controllable"] else "not controllable"
    return f"{level}, {control}, up to {hover['max_rotor_speed']:.4g} rad/s"
