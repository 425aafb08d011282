"""Closed forms of gaits on the cross, and the Two Color Map, as plain dicts ready for JSON.

Angles are in rad, everything else in SI units; NaN becomes null.
"""

from math import acos, cos
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from tiltsim_controllers.analysis import fault_tolerance, two_color_map
from tiltsim_controllers.analysis.published_gaits import DETERMINANT_CASES, TRIANGLE
from tiltsim_controllers.analysis.singularity import (
    acceptable_share,
    determinant,
    hover_rotor_speeds,
    margin_over_gait,
    rank,
    residuals,
    singular_values,
    torque_free_direction,
    unacceptable_attitudes,
)
from tiltsim_controllers.analysis.two_color_planner import Path, check_path
from tiltsim_controllers.gaits.plans import Gait
from tiltsim_controllers.mathematics.scalar import Floats, Quad
from tiltsim_controllers.vehicle.body import ROTORS
from tiltsim_controllers.vehicle.parameters import PRESETS, Vehicle, drag_ratio

NEARLY_SINGULAR: Final = 1e-3
"""Ratio of singular values of tau below which a gait has full rank only because of rounding.

Blue gaits with angles rounded as in the thesis stay below 3e-4, nonsingular gaits above 1e-2.
"""

OPPOSITE_SPEED_RATIO: Final = 0.7
"""Speed of the rotor opposite a lost one, as a share of the hover speed."""

REST_TOLERANCE: Final = 1e-6
"""Fraction of the fastest rotor's speed below which a rotor counts as at rest."""


def closed_forms(
    angles: Floats, vehicle: Vehicle, attitude: tuple[float, float]
) -> dict[str, Floats]:
    """The closed forms of ch. 3 and 6 for tilt angles (rad) of shape (4,), or (N, 4) in order.

    ``attitude`` is roll and pitch of determinant and margin, rad.
    """
    margin = margin_over_gait(np.atleast_2d(angles), vehicle, *attitude)
    return {
        **residuals(angles, vehicle)._asdict(),
        "determinant": determinant(angles, *attitude, vehicle),
        "singular_values": singular_values(angles, vehicle),
        "torque_free_direction": torque_free_direction(angles, vehicle),
        "singularity_margin": margin.reshape(angles.shape[:-1]),
    }


def cross_report(gait: Gait, vehicle: Vehicle) -> dict[str, Any]:
    """The part of a report that holds for the thesis's vehicle alone, at the gait's start.

    Fixed angles have ``hover_rotor_speeds`` (rad/s, along the spins), null if they cannot hover;
    rotors that would have to turn backwards have negative ones, and a warning.
    """
    start = gait.angles(0.0)
    curve = unacceptable_attitudes(start, vehicle)
    speeds = hover_rotor_speeds(start, vehicle) if gait.is_constant else None
    return {
        "vehicle": vehicle_name(vehicle),
        "drag_ratio": drag_ratio(vehicle),
        "acceptable_share": acceptable_share(start, vehicle),
        "unacceptable_attitudes": {
            "kind": curve.kind,
            "roll": curve.roll.tolist(),
            "pitch": curve.pitch.tolist(),
        },
        "hover_rotor_speeds": speeds,
        "warnings": gait_warnings(gait, vehicle) + _backward_rotors(speeds),
    }


def gait_warnings(gait: Gait, vehicle: Vehicle) -> list[str]:
    """Reasons why a gait is not fit for flight, one line each."""
    times = gait.sample_times()
    angles = gait.angles(times)
    deficient = rank(angles, vehicle) < 3
    values = singular_values(angles, vehicle)
    conditioning = values[:, 2] / values[:, 0]
    by_rounding = (conditioning < NEARLY_SINGULAR) & ~deficient
    directionless = np.isnan(torque_free_direction(angles, vehicle)).any(axis=-1) & ~deficient
    warnings = []
    if deficient.any():
        warnings.append(
            f"rank of tau is {int(rank(angles, vehicle).min())}{_when(deficient, times, gait)}: "
            "the decoupling matrix is singular at every attitude"
        )
    if by_rounding.any():
        warnings.append(
            f"tau is nearly singular{_when(by_rounding, times, gait)}: its smallest singular value "
            f"is {conditioning[by_rounding].min():.2g} of the largest; the margin is not meaningful"
        )
    if directionless.any():
        warnings.append(
            f"R = R_phi = R_theta = 0 (curve L){_when(directionless, times, gait)}: the decoupling "
            "matrix is singular at every attitude"
        )
    R = np.where(deficient | directionless, 0.0, residuals(angles, vehicle).R)
    signs = R[R != 0.0]
    if (signs > 0.0).any() and (signs < 0.0).any():
        reversed_ = (np.sign(R) == -np.sign(signs[0])) & (R != 0.0)
        warnings.append(
            f"R changes sign before t = {times[reversed_][0]:.3f} s: where R = 0, the "
            "decoupling matrix is singular at level attitude"
        )
    return warnings


def _backward_rotors(speeds: Quad | None) -> list[str]:
    """A warning if some hover speeds along the spins are negative."""
    if speeds is None:
        return []
    # Rounding gives a rotor at rest either sign.
    at_rest = REST_TOLERANCE * max(map(abs, speeds))
    backward = [str(rotor) for rotor, speed in zip(ROTORS, speeds, strict=True) if speed < -at_rest]
    if not backward:
        return []
    names = ("rotors " if len(backward) > 1 else "rotor ") + " and ".join(backward)
    return [f"{names} would have to spin backwards to hover"]


def cross_loss(lost: int, tilts: Floats, vehicle: Vehicle) -> dict[str, Any]:
    """Hovers without a rotor, 1 to 4: how far fixed tilts (rad) are from one, and with free tilts.

    ``free_tilts`` is a hover on three rotors, of which the one opposite the lost one turns at
    `OPPOSITE_SPEED_RATIO`; ``least_speed`` is the maximum speed that the rotors must reach.
    """
    speed = OPPOSITE_SPEED_RATIO * vehicle.hover_rotor_speed
    free = fault_tolerance.three_rotor_hover(lost, vehicle, opposite_speed=speed)
    a, b, c, d = (0.0 if rotor == lost else 1.0 for rotor in ROTORS)
    return {
        "fixed_tilts_miss": fault_tolerance.fixed_tilt_imbalance(tilts, lost, vehicle),
        "least_speed": fault_tolerance.minimum_hover_speed(vehicle, factors=(a, b, c, d)),
        "free_tilts": {
            "angles": list(free.tilts),
            "lean": acos(cos(free.roll) * cos(free.pitch)),
            "rotor_speeds": list(free.rotor_speeds),
            "max_rotor_speed": free.max_rotor_speed,
            "controllable": free.authority > NEARLY_SINGULAR,
            "roll": free.roll,
            "pitch": free.pitch,
            "authority": free.authority,
        },
    }


def map_report(vehicle: Vehicle, path: Path | None = None) -> dict[str, Any]:
    """The Two Color Map of a vehicle, and the check of a path (``tiltsim map --json``).

    ``red`` and ``blue`` give ``alpha_3 = slope * alpha_1 + offset`` and likewise ``alpha_4`` from
    ``alpha_2``. ``roots`` is the 17 x 17 search of ch. 6, done numerically.
    """
    offset = 2.0 * two_color_map.delta(vehicle)
    grid = two_color_map.grid_roots(vehicle)
    alpha_1 = np.linspace(-np.pi / 2, np.pi / 2, 182)[1:-1]
    report: dict[str, Any] = {
        "vehicle": vehicle_name(vehicle),
        "drag_ratio": drag_ratio(vehicle),
        "delta": two_color_map.delta(vehicle),
        "P": list(two_color_map.point_p(vehicle)),
        "red": _lines(1.0, 0.0),
        "blue": _lines(-1.0, offset),
        "rank": {"red": 3, "blue": 2},
        "L": {
            "alpha_1": alpha_1.tolist(),
            "alpha_2": two_color_map.curve_l(alpha_1, vehicle).tolist(),
        },
        "roots": {
            "grid": two_color_map.grid_axis().tolist(),
            "count": two_color_map.root_counts(grid).tolist(),
            "classes": dict(sorted(two_color_map.root_classes(grid).items())),
            "list": [
                {
                    "alpha": [root.alpha_1, root.alpha_2, root.alpha_3, root.alpha_4],
                    "R": root.R,
                    "class": f"({root.plane_3},{root.plane_4})",
                }
                for row in grid
                for cell in row
                for root in cell
            ],
        },
        "warnings": ["blue: tau has rank 2, the decoupling matrix is singular at every attitude"],
    }
    if path is not None:
        verdict = check_path(path, vehicle)
        report["path"] = {
            "accepted": verdict.accepted,
            "sound": verdict.sound,
            "theorem": verdict.theorem,
            "reasons": list(verdict.reasons),
            "crossings": [list(crossing) for crossing in verdict.crossings],
            "warnings": list(verdict.warnings),
        }
    return report


def determinant_report(case: str, vehicle: Vehicle) -> dict[str, Any]:
    """How far a restriction of ch. 3 stays from singular (``tiltsim gait --figure determinant``).

    For each pair ``(alpha_1, alpha_3)`` the minimum of ``R`` over the region of interest of
    ``(alpha_2, alpha_4)``, the triangle U V M with its edges.
    """
    corners = np.array(TRIANGLE)
    share = np.linspace(0.0, 1.0, 101)
    first, second = np.meshgrid(share, share)
    weights = np.stack([1.0 - first, first * (1.0 - second), first * second], axis=-1)
    points = weights.reshape(-1, 3) @ corners
    pairs = []
    for alpha_1, alpha_3 in DETERMINANT_CASES[case].pairs:
        angles = np.insert(points, [0, 1], [alpha_1, alpha_3], axis=1)
        least = float(residuals(angles, vehicle).R.min())
        pairs.append({"alpha_1": alpha_1, "alpha_3": alpha_3, "least_R": least})
    return {
        "case": case,
        "restriction": DETERMINANT_CASES[case].restriction,
        "vehicle": vehicle_name(vehicle),
        "triangle": [list(corner) for corner in TRIANGLE],
        "pairs": pairs,
    }


def vehicle_name(vehicle: Vehicle) -> str | dict[str, float]:
    """The preset's name, or the parameters of any other vehicle."""
    for name, preset in PRESETS.items():
        if preset == vehicle:
            return name
    return dict(vehicle._asdict())


def _when(chosen: NDArray[np.bool_], times: Floats, gait: Gait) -> str:
    if gait.is_constant or chosen.all():
        return ""
    return f" at t = {times[chosen][0]:.3f} s"


def _lines(slope: float, offset: float) -> dict[str, dict[str, float]]:
    return {
        "alpha_3": {"slope": slope, "offset": offset},
        "alpha_4": {"slope": slope, "offset": -offset if offset else 0.0},
    }
