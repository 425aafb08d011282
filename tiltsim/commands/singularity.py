"""``tiltsim singularity``: a quadrotor's published and exact determinants."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from tiltsim.commands.gait_options import Pitch, Roll, VehicleOption, parse_vehicle
from tiltsim.commands.options import Json, PlotOptions
from tiltsim.commands.text import aligned
from tiltsim.views import figures

if TYPE_CHECKING:
    from tiltsim_controllers.vehicle.parameters import Vehicle


def run(
    vehicle_model: Literal["quadrotor"],
    *,
    vehicle: VehicleOption = None,
    roll: Roll = None,
    pitch: Pitch = None,
    json: Json = False,
    figure: PlotOptions,
) -> int:
    """Compare ch. 2's determinant of yaw-position control with the exact one.

    Ch. 2 has a surface S(theta, phi) and a singular curve. The exact determinant is not zero in
    hover up to 90 degrees.

    Args:
        vehicle_model (quadrotor): the only vehicle of ch. 2
        vehicle (PRESET): default: ar_drone_2_unrounded
    """
    parameters = vehicle or parse_vehicle("ar_drone_2_unrounded")
    figure.check()
    report = _report(parameters, roll or 0.0, pitch or 0.0)

    figure.show(
        lambda: figures.vehicles.singularity_figure(parameters), report, _summary(report), json=json
    )
    return 0


def _report(vehicle: Vehicle, roll: float, pitch: float) -> dict[str, Any]:
    from math import asin, cos

    from tiltsim_controllers.analysis.singularity import (
        exact_determinant,
        normalized_determinant,
        published_determinant,
        published_singular_curve,
    )
    from tiltsim_controllers.laws.switching import PUBLISHED_ZONE

    hover = vehicle.mass * vehicle.gravity
    curve_roll, curve_pitch = published_singular_curve()
    on_curve = normalized_determinant(curve_roll, curve_pitch, hover, vehicle)
    return {
        "vehicle": vehicle._asdict(),
        "roll": roll,
        "pitch": pitch,
        "published_determinant": float(published_determinant(roll, pitch)),
        "exact_determinant": float(exact_determinant(roll, pitch, hover, vehicle)),
        "normalized_determinant": float(normalized_determinant(roll, pitch, hover, vehicle)),
        "singularity_margin": asin(cos(roll) * cos(pitch)),
        "published_zone": {
            f"{angle}_{side}": bound
            for angle, bounds in PUBLISHED_ZONE
            for side, bound in zip(("min", "max"), bounds, strict=True)
        },
        "exact_on_published_curve": {"min": float(on_curve.min()), "max": float(on_curve.max())},
        "published_curve": {
            "roll": (curve_roll + 0.0).tolist(),  # no negative zeros
            "pitch": (curve_pitch + 0.0).tolist(),
        },
    }


def _summary(report: dict[str, Any]) -> str:
    zone, on_curve = report["published_zone"], report["exact_on_published_curve"]
    curve = report["published_curve"]
    rows = [
        ("attitude", f"roll {report['roll']:g}, pitch {report['pitch']:g} rad"),
        ("published determinant S", f"{report['published_determinant']:.6g}"),
        ("exact determinant", f"{report['normalized_determinant']:.6g} of that in level hover"),
        ("singularity margin", f"{report['singularity_margin']:.6g} rad, exact"),
        (
            "published curve S = 0",
            f"roll {min(curve['roll']):.4g} to {max(curve['roll']):.4g}, "
            f"pitch {min(curve['pitch']):.4g} to {max(curve['pitch']):.4g} rad",
        ),
        ("exact on that curve", f"{on_curve['min']:.6g} to {on_curve['max']:.6g}, never singular"),
        (
            "published zone",
            f"roll {zone['roll_min']:.4g} to {zone['roll_max']:.4g}, "
            f"pitch {zone['pitch_min']:.4g} to {zone['pitch_max']:.4g} rad",
        ),
    ]
    return "\n".join(aligned(rows))
