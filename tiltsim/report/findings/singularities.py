"""Findings about where the decoupling matrix is singular."""

from __future__ import annotations

from typing import Final

import numpy as np

from tiltsim.report.findings.finding import Finding
from tiltsim_controllers.analysis.published_gaits import PUBLISHED_GAITS
from tiltsim_controllers.analysis.quadrotor_singularity import (
    normalized_determinant,
    published_singular_curve,
)
from tiltsim_controllers.analysis.singularity import residuals, singular_values
from tiltsim_controllers.analysis.two_color_map import delta, grid_roots
from tiltsim_controllers.laws import yaw_position
from tiltsim_controllers.vehicle.parameters import PRESETS

_VEHICLE: Final = PRESETS["ar_drone_2"]


def _map_numbers() -> dict[str, str]:
    """2 delta of both published vehicles, rad."""
    return {
        "ar": f"{2.0 * delta(_VEHICLE):.9f}",
        "luukkonen": f"{2.0 * delta(PRESETS['luukkonen']):.9f}",
    }


def _blue_numbers() -> dict[str, str]:
    """Ratios of the singular values of ch. 6's blue gait, as printed and on the exact lines."""
    printed = PUBLISHED_GAITS["ch06_gait_1"]
    assert printed.exact is not None
    shares = []
    for gait in (printed.gait, printed.exact):
        values = singular_values(gait.angles(gait.sample_times(401)), _VEHICLE)
        shares.append(float((values[:, 2] / values[:, 0]).max()))
    angles = printed.exact.angles(printed.exact.sample_times(401))
    largest = max(float(np.abs(part).max()) for part in residuals(angles, _VEHICLE))
    remainder = max(shares[1], largest)
    return {
        "printed": f"{shares[0]:.0e}",
        "zero": "below 1e-9" if remainder < 1e-9 else f"{remainder:.0e}",
    }


def _triangle_numbers() -> dict[str, str]:
    """Grid points of ch. 6 that have a root with R > 0, and those of them below the diagonal."""
    positive = {
        (i, j)
        for i, row in enumerate(grid_roots(_VEHICLE)[1:-1])
        for j, cell in enumerate(row[1:-1])
        for root in cell
        if root.R > 1e-9
    }
    below = sum(j < i for i, j in positive)
    return {"points": str(len(positive)), "below": str(below)}


def _quadrotor_numbers() -> dict[str, str]:
    """The exact determinant on ch. 2's published curve, and the unstable root of its gains."""
    vehicle = PRESETS["ar_drone_2_unrounded"]
    hover = vehicle.mass * vehicle.gravity
    on_curve = normalized_determinant(*published_singular_curve(), hover, vehicle)
    roots = np.roots((1.0, *yaw_position.GAIN_SETS["ch02"][:4]))
    worst = roots[np.argmax(roots.real)]
    return {
        "low": f"{on_curve.min():.3f}",
        "high": f"{on_curve.max():.3f}",
        "root": f"{worst.real:.2f} ± {abs(worst.imag):.2f}j",
    }


_SINGULARITY: Final = "controllers/analysis/test_singularity.py"
_MAP: Final = "controllers/analysis/test_two_color_map.py"
_CLAIMS: Final = "report/test_claims.py"

FINDINGS: Final = (
    Finding(
        key="determinant",
        title="The singular attitudes of a gait are a great circle, in closed form",
        chapters="ch. 3, 5, 6",
        text=(
            "The determinant of the decoupling matrix `[τ; r₃ᵀF]` is `2 L² K_f³ K_m (R cos φ cos θ "
            "+ R_φ sin φ cos θ + R_θ sin θ)` for every vehicle: ch. 3 drops the constant, and R, "
            "R_φ and R_θ, functions of the tilt angles, are the coefficients that ch. 6 names so. "
            "With the vector `n = (-R_θ, R_φ, R)` in body axes, the force that the rotors make at "
            "zero torque, and world up in body axes, `r₃`, the bracket is `n · r₃`. It vanishes "
            "where world up is perpendicular to `n`: the curve of singular attitudes needs no root "
            "finding, and the smallest rotation to a singular attitude is `asin(n · r₃ / |n|)`, "
            "the singularity margin that tiltsim records in flight.",
        ),
        proof="The first three rows are τ, so the determinant is the scalar product of the "
        "last row, r₃ᵀF, with the minors of τ, which span τ's kernel; F times them is n.",
        tests={
            "controllers/vehicle/test_decoupling_matrix.py": (
                "test_determinant_has_the_closed_form",
            ),
            _SINGULARITY: (
                "test_determinant_matches_lapack_for_any_vehicle",
                "test_torque_free_inputs_are_the_minors_of_tau",
                "test_margin_is_the_smallest_rotation_to_a_singular_attitude",
            ),
            "controllers/analysis/test_unacceptable_attitudes.py": (
                "test_the_closed_form_is_singular_and_agrees_with_the_great_circle",
            ),
        },
        pictures=("determinant",),
    ),
    Finding(
        key="rank",
        title="For any number of rotors the torque-free forces decide what is singular",
        chapters="beyond ch. 3",
        text=(
            "Let N rotors have the effectiveness F and τ (3 × N each), and let V be the space of "
            "forces that they make at zero torque, F times the kernel of τ. The matrix `[τ; r₃ᵀF]` "
            "has rank 4 exactly if τ has rank 3 and world up, r₃, is not perpendicular to V. So "
            "the singular attitudes are a great circle if V is a line (every four-rotor vehicle, "
            "and parallel rotors of any number), two opposite directions of world up if it is a "
            "plane, none if it is the whole space, and all if it is zero or τ has lost rank. The "
            "singularity margin is `asin |P r₃|`, P projecting on V; for four rotors it is the one "
            "above.",
        ),
        proof="With B = [τ; r₃ᵀF] and K an orthonormal basis of τ's kernel, det(B Bᵀ) = "
        "det(τ τᵀ) |Kᵀ Fᵀ r₃|², as the last row counts only with its share in the kernel. The "
        "second factor is zero exactly where r₃ is perpendicular to V = range(F K).",
        tests={
            "controllers/analysis/test_any_number_of_rotors.py": (
                "test_what_is_singular_follows_from_the_torque_free_forces",
                "test_four_rotors_have_the_margin_of_the_library",
            )
        },
    ),
    Finding(
        key="slips",
        title="Two misprints in the determinant of ch. 3",
        chapters="ch. 3, Eq. (17)",
        text=(
            "Read literally, Eq. (17) is not the determinant. `-2.880 s1 s2 c3 s4 sφ cθ` must be "
            "`s1 s2 c3 c4`, as ch. 5 and 6 have it, and `-2.880 s1 c2 s3 s4 sφ cθ` must be `s1 c2 "
            "c3 s4`. All other printed coefficients are correct to their last digit.",
        ),
        proof="At tilt angles of 0 and 90 degrees one product of sines and cosines is 1 and the "
        "others are 0: the exact determinant gives its coefficients one by one.",
        tests={
            _SINGULARITY: (
                "test_the_slips_of_the_pen_are_slips",
                "test_printed_coefficients_of_chapter_3",
            ),
            _CLAIMS: ("test_chapter_3_prints_two_wrong_terms_of_the_determinant",),
        },
    ),
    Finding(
        key="map",
        title="The Two Color Map has a closed form for every vehicle",
        chapters="ch. 6-8, 12",
        text=(
            "With `tan δ = K_m / (L K_f)` the equations R_φ = R_θ = 0 factor, and their roots are "
            "two families of lines: red, α₃ = α₁ and α₄ = α₂; blue, α₃ = 2δ - α₁ and α₄ = -2δ - "
            "α₂. 2δ is {ar} rad for the vehicle of ch. 3 and {luukkonen} rad for that of ch. 12. "
            "The printed offsets 0.334198 and 0.336842 are, to all digits, atan(1.000/2.880) and "
            "atan(1.025/2.927), the ratios of the printed coefficients. This removes the "
            "limitation that ch. 12 names, a map known only by numerical search.",
        ),
        proof="R_θ = k sin(α₁ + α₃ - 2δ) sin(α₂ - α₄) and R_φ = k sin(α₂ + α₄ + 2δ) "
        "sin(α₃ - α₁) with k = (tan δ + cot δ) / 2.",
        tests={
            _MAP: (
                "test_residuals_factor",
                "test_roots_are_roots_and_lie_on_the_lines",
                "test_offsets_round_to_the_published_ones",
                "test_printed_coefficients_explain_the_published_offset",
            )
        },
        pictures=("map", "map-luukkonen"),
        numbers=_map_numbers,
    ),
    Finding(
        key="red",
        title="Red gaits have no singular attitude at all, except where R vanishes",
        chapters="ch. 6, 8",
        text=(
            "On red the torque-free force is exactly vertical: R_φ = R_θ = 0, and the margin is a "
            "right angle wherever R is not zero, too. It is zero on the curve L, tan α₂ = tan α₁ - "
            "2 tan δ, and on two lines near the edge of the map, α₁ = δ - π/2 and α₂ = π/2 - δ. P "
            "lies exactly on L, not slightly below it; switching colors there passes through a "
            "singular point.",
        ),
        proof="On red R is a product whose factors vanish on L and on the two lines; at P = "
        "(δ, -δ) the first one is 2 tan δ - tan δ - tan δ.",
        tests={
            _SINGULARITY: ("test_blue_gaits_lose_rank_and_red_gaits_are_vertical",),
            _MAP: (
                "test_red_residual_factors_and_vanishes_on_l",
                "test_red_is_also_singular_on_two_lines_near_the_edge",
                "test_p_lies_on_l_and_both_colors_meet_there",
            ),
        },
        flights=("ch08_generalized_map/stabilization#E1", "ch07_robust_gaits/circle#gait_2"),
        pictures=("red-and-biased", "red-circle"),
    ),
    Finding(
        key="blue",
        title="Blue gaits are singular at every attitude",
        chapters="ch. 6-9",
        text=(
            "On blue, opposite columns of τ cancel: the third is minus the first, the fourth minus"
            " the second. So τ has rank 2, and R, R_φ and R_θ vanish together ({zero} on gait 1 of"
            " ch. 6, set on the exact lines). The results of ch. 6 to 8 for blue gaits depend on "
            "rounded angles, which leave the smallest singular value of τ at {printed} of the "
            "largest. The torques that ch. 9 calls linearly coupled are this loss of rank.",
            "A blue gait on the exact lines ends every flight at once. With the printed, rounded "
            "offset a hover survives as long as nothing disturbs it; on a circle the first "
            "attitude error demands rotor speeds that no rotor has, and the vehicle is lost.",
        ),
        proof="With ρ = √(L² K_f² + K_m²) the columns of τ are ρ (0, cos(α₁-δ), sin(α₁-δ)), "
        "ρ (cos(α₂+δ), 0, -sin(α₂+δ)), ρ (0, -cos(α₃-δ), sin(α₃-δ)) and ρ (-cos(α₄+δ), 0, "
        "-sin(α₄+δ)). On blue α₃ - δ = -(α₁ - δ) and α₄ + δ = -(α₂ + δ).",
        tests={
            _MAP: ("test_blue_has_no_margin_and_red_all_of_it",),
            "controllers/analysis/test_attainable.py": (
                "test_linear_coupling_of_blue_gaits_is_their_loss_of_rank",
            ),
            _SINGULARITY: ("test_thesis_rounding_of_the_blue_offset_leaves_a_trace_of_rank",),
            "simulation/test_simulate.py": ("test_blue_gait_is_singular_from_the_start",),
            "report/test_flown_findings.py": (
                "test_a_rounded_blue_gait_hovers_undisturbed_and_is_lost_on_a_circle",
            ),
        },
        flights=(
            "ch07_robust_gaits/circle#gait_1_blue",
            "ch07_robust_gaits/circle#gait_1_blue_rounded",
            "ch08_generalized_map/stabilization#gait_3_rounded",
        ),
        pictures=("blue-and-biased",),
        numbers=_blue_numbers,
    ),
    Finding(
        key="triangle",
        title="The region of positive R contains the untilted vehicle",
        chapters="ch. 6, Sec. 3",
        text=(
            "Ch. 6 gives the grid points with R > 0 as a triangle with vertices (-7, 7), (-7, -5) "
            "and (5, 7), in units of π/16. It excludes the untilted vehicle, for which R = 4. "
            "Computed, there are {points} points: all of the triangle (-7, 7), (-7, -7), (7, 7) "
            "with its diagonal, and {below} points below it.",
        ),
        proof="R > 0 needs red, and on red R is positive above the curve L, which lies below the "
        "diagonal by at most 2δ.",
        tests={_MAP: ("test_positive_residual_needs_red_and_fills_a_triangle",)},
        pictures=("map",),
        numbers=_triangle_numbers,
    ),
    Finding(
        key="switching",
        title="Not every path between regions is blocked",
        chapters="ch. 3, Sec. 5.2",
        text=(
            "Ch. 3 says that a gait going from (α₂, α₄) = (1, 1) to (-1, -1) must cross a singular"
            " gait in all cases. For α₁ = -α₃ = ±1.4 it need not: both ends are in the same "
            "region. Sec. 7 of the chapter itself takes the sentence back: “this is not always "
            "true”.",
        ),
        proof="R, computed along the straight way, keeps its sign for these two pairs.",
        tests={_CLAIMS: ("test_one_pair_of_chapter_3_can_switch_without_a_crossing",)},
        pictures=("determinant",),
    ),
    Finding(
        key="quadrotor",
        title="Yaw-position control of a quadrotor has no singular zone",
        chapters="ch. 2",
        text=(
            "The exact determinant is `-d³ζ² cos φ / (I_x I_y I_z m³ cos θ)`, which has no zero "
            "within 90 degrees. The published surface S(θ, φ) comes from one entry of Eq. (43): "
            "(3, 1) is printed as 0, but the printed factors give `-cos²θ (cos φ - sin φ)`. The "
            "misprints in Eqs. (31) and (36) alone do not change the determinant. On the published"
            " curve the exact determinant is {low} to {high} of its value in hover.",
            "The flights of ch. 2 diverge because of Appendix B's gains: `s⁴ + 10s³ + 20s² + 50s +"
            " 500` has roots at {root}. With stable gains the same control law crosses the curve "
            "without any effect.",
        ),
        proof="S is not symmetric under a reversal of roll, which alone refutes it for a vehicle "
        "that is its own mirror image.",
        tests={
            "controllers/laws/test_yaw_position.py": (
                "test_the_determinant_is_the_exact_one",
                "test_the_published_gains_are_unstable_by_themselves_and_ours_are_not",
                "test_stable_gains_fly_the_circle_through_the_published_curve",
            ),
            "controllers/analysis/test_quadrotor_singularity.py": (
                "test_the_surface_comes_from_one_missing_entry_of_eq_43",
                "test_the_slip_in_eq_31_does_not_touch_the_determinant",
            ),
        },
        pictures=("singular-surface", "through-the-curve"),
        numbers=_quadrotor_numbers,
    ),
    Finding(
        key="experiment",
        title="Ch. 2's second experiment contradicts itself",
        chapters="ch. 2, Sec. 5",
        text=(
            "The text states the goal (0.5, -0.5) for the attitude and then sets the reference "
            "(-0.5, 0.5). With the goal in the text the flight goes as printed: it switches, then "
            "diverges. With the printed reference it does not: that is a corner of the closed "
            "zone, where the attitude comes to rest.",
        ),
        proof="Shown by flights.",
        tests={
            "controllers/laws/test_switching.py": (
                "test_experiment_2_is_lost_after_switches",
                "test_experiment_2_with_the_other_reference_rests_on_the_zones_edge",
            )
        },
        flights=(
            "ch02_singular_zone/experiments#experiment_2_goal",
            "ch02_singular_zone/experiments#experiment_2_reference",
        ),
    ),
)
"""In the order of the report."""
