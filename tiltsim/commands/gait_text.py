"""The reports of ``tiltsim gait`` as text."""

from __future__ import annotations

from typing import Any, Final

from tiltsim.commands.angles import vehicle_text
from tiltsim.commands.text import aligned, number, numbers, table
from tiltsim.system.text import printable

CURVES: Final = {
    "graph": "one pitch for each roll",
    "vertical": "two rolls, at any pitch",
    "none": "none: every attitude is acceptable",
    "everywhere": "every attitude",
}
"""Descriptions of the kinds of singular-attitude curves."""


def list_text(report: list[dict[str, Any]]) -> str:
    """The robustness table of the thesis's gaits."""
    header = ["gait", "color", "angles", "margin", "exact", "biased", "condition", "claim"]
    claims = {True: "yes", False: "no", None: "-"}
    rows = [
        (
            row["key"],
            row["color"] or "-",
            "printed" if row["printed"] else "ours",
            number(row["margin"], ".4f"),
            number(row["margin_exact"], ".4f"),
            "-" if row["margin_biased"] is None else number(row["margin_biased"], ".4f"),
            number(row["conditioning"], ".2e") if row["conditioning"] > 1e-12 else "0",
            claims[row["claim_holds"]],
        )
        for row in report
    ]
    return "\n".join(
        [
            table(header, rows, frozenset({3, 4, 5, 6})),
            "",
            "margin: minimum over a period at level attitude, rad; negative: R changes sign",
            "exact: the same on the exact lines of the color; biased: of the biased twin",
            "condition: smallest over largest singular value of tau, on the exact lines",
            "claim: more robust than the biased twin, and not singular itself",
        ]
    )


def determinant_text(report: dict[str, Any]) -> str:
    """The minima of R for the restrictions of ch. 3."""
    rows = [
        (number(pair["alpha_1"]), number(pair["alpha_3"]), number(pair["least_R"]))
        for pair in report["pairs"]
    ]
    header = ("alpha_1 (rad)", "alpha_3 (rad)", "minimum R in the triangle U V M")
    return table(header, rows, frozenset({0, 1, 2}))


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
            ("period", f"{report['period']:g} s; the values above are those at t = 0"),
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
