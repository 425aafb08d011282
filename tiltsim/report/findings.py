"""Our own findings, each with the tests that support it.

The texts contain no measured number: functions compute them when the report is made.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from tiltsim_controllers.analysis.attainable import (
    attainable_accelerations,
    attainable_torque_thrust,
    published_speed_limits,
)
from tiltsim_controllers.analysis.published_gaits import PUBLISHED_GAITS
from tiltsim_controllers.analysis.quadrotor_singularity import (
    normalized_determinant,
    published_singular_curve,
)
from tiltsim_controllers.analysis.singularity import residuals, singular_values
from tiltsim_controllers.analysis.stability import third_order_loop
from tiltsim_controllers.analysis.two_color_map import delta
from tiltsim_controllers.laws import gains, yaw_position
from tiltsim_controllers.vehicle.parameters import PRESETS


@dataclass(frozen=True, kw_only=True)
class Finding:
    """A result beyond the thesis."""

    key: str
    title: str
    chapters: str
    text: tuple[str, ...]
    """Paragraphs with ``{names}`` of ``numbers``; text between backticks is code."""
    tests: Mapping[str, tuple[str, ...]]
    """Names of tests by their file in the folder of the tests."""
    numbers: Callable[[], dict[str, str]] = dict

    @property
    def paragraphs(self) -> list[str]:
        """The text with its numbers."""
        numbers = self.numbers()
        return [paragraph.format(**numbers) for paragraph in self.text]

    @property
    def nodes(self) -> list[str]:
        """Its tests, as pytest addresses them."""
        return [f"tests/{file}::{name}" for file, names in self.tests.items() for name in names]

    @property
    def command(self) -> str:
        """The command that runs its tests."""
        return " \\\n  ".join(("pytest -n 0", *self.nodes))


_VEHICLE: Final = PRESETS["ar_drone_2"]


def _matrix_gain() -> dict[str, str]:
    """Routh's numbers for ch. 4's roll gains, and the loop gain that the printed matrix adds."""
    roll = gains.GAIN_SETS["ch04"]
    factor = 2.0 * _VEHICLE.hover_rotor_speed
    loop = third_order_loop("roll", (roll.roll_1, roll.roll_2, roll.roll_3), 1.0)
    worst = max(root.real for root in np.roots(loop.polynomial))
    return {
        "factor": f"{factor:.0f}",
        "product": f"{roll.roll_1 * roll.roll_2:g}",
        "third": f"{roll.roll_3:g}",
        "root": f"{worst:+.2f}",
    }


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


def _attainable_numbers() -> dict[str, str]:
    """Rotor limits of ch. 9, and what gait 2 attains within them."""
    limits = published_speed_limits(_VEHICLE)
    angles = PUBLISHED_GAITS["ch09_gait_2"].gait.angles(0.0)
    found = attainable_torque_thrust(angles, _VEHICLE, limits)
    sideways = attainable_accelerations(angles, _VEHICLE, limits)
    return {
        "slow": f"{limits[0]:.2f}",
        "fast": f"{limits[1]:.2f}",
        "low": f"{found.lower[2]:.2f}",
        "high": f"{found.upper[2]:.2f}",
        "sideways": f"{sideways.upper[0]:.2f}",
    }


_SINGULARITY: Final = "controllers/analysis/test_singularity.py"
_MAP: Final = "controllers/analysis/test_two_color_map.py"
_CLAIMS: Final = "report/test_claims.py"
_ATTAINABLE: Final = "controllers/analysis/test_attainable.py"
_FLIGHTS: Final = "simulation/test_simulate.py"

FINDINGS: Final = (
    Finding(
        key="determinant",
        title="The singular attitudes of a gait are a great circle, in closed form",
        chapters="ch. 3, 5, 6",
        text=(
            "With the torque-free force `n = (-R_θ, R_φ, R)` and world up in body axes, `r₃`, the "
            "determinant is `n · r₃` for every vehicle. It vanishes where world up is "
            "perpendicular to `n`: the curve of singular attitudes needs no root finding, and the "
            "smallest rotation to a singular attitude is `asin(n · r₃ / |n|)`, the singularity "
            "margin that tiltsim records in flight.",
        ),
        tests={
            "controllers/vehicle/test_decoupling_matrix.py": (
                "test_determinant_has_the_closed_form",
            ),
            _SINGULARITY: ("test_margin_is_the_smallest_rotation_to_a_singular_attitude",),
            "controllers/analysis/test_unacceptable_attitudes.py": (
                "test_the_closed_form_is_singular_and_agrees_with_the_great_circle",
            ),
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
        tests={
            _SINGULARITY: (
                "test_the_slips_of_the_pen_are_slips",
                "test_printed_coefficients_of_chapter_3",
            ),
            _CLAIMS: ("test_chapter_3_prints_two_wrong_terms_of_the_determinant",),
        },
    ),
    Finding(
        key="gains",
        title="The printed attitude gains are unstable; a missing factor in the matrix helps",
        chapters="ch. 3, Eq. (12); ch. 4, Prop. 4",
        text=(
            "Ch. 4's gains (1, 10, 50) fail the thesis's own Routh condition: K₁K₂ = {product} "
            "does not exceed K₃ = {third}, and the rightmost root of the loop has the real part "
            "{root}. Yet the flights agree with the published ones if the decoupling matrix is "
            "used as printed, without the factor 2|ϖ| in its three attitude rows: the attitude "
            "loops then have a gain about {factor} times higher, and are stable.",
            'Both forms are available: `decoupling = "published"` and `"exact"`, the latter with '
            "gains that satisfy the condition. A scenario whose gains fail is rejected with the "
            "numbers.",
        ),
        tests={
            "controllers/analysis/test_stability.py": (
                "test_published_attitude_gains_fail_under_the_exact_matrix",
                "test_published_gains_pass_under_the_published_matrix",
                "test_published_matrix_multiplies_the_attitude_loops_by_twice_the_hover_speed",
            )
        },
        numbers=_matrix_gain,
    ),
    Finding(
        key="map",
        title="The Two Color Map has a closed form for every vehicle",
        chapters="ch. 6-8, 12",
        text=(
            "With `tan δ = K_m / (L K_f)` the equations R_φ = R_θ = 0 factor, and their roots are "
            "two families of lines: red, α₃ = α₁ and α₄ = α₂; blue, α₃ = 2δ - α₁ and α₄ = -2δ - "
            "α₂. 2δ is {ar} rad for the vehicle of ch. 3 and {luukkonen} rad for that of ch. 12. "
            "The printed 0.334198 comes from searching with coefficients of four digits. This "
            "removes the limitation that ch. 12 names, a map known only by numerical search.",
        ),
        tests={
            _MAP: (
                "test_residuals_factor",
                "test_roots_are_roots_and_lie_on_the_lines",
                "test_printed_coefficients_explain_the_published_offset",
            )
        },
        numbers=_map_numbers,
    ),
    Finding(
        key="red",
        title="Red gaits have no singular attitude at all",
        chapters="ch. 6, 8",
        text=(
            "On red the torque-free force is exactly vertical: R_φ = R_θ = 0, and the margin is a "
            "right angle everywhere except on the curve L, where R vanishes, too. P lies exactly "
            "on L, not slightly below it; switching colors there passes through a singular point.",
        ),
        tests={
            _SINGULARITY: ("test_blue_gaits_lose_rank_and_red_gaits_are_vertical",),
            _MAP: ("test_p_lies_on_l_and_both_colors_meet_there",),
        },
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
            "largest. The torques that ch. 9 calls linearly coupled are this loss of rank. In "
            "simulation every flight with a blue gait ends as singular immediately.",
        ),
        tests={
            _MAP: ("test_blue_has_no_margin_and_red_all_of_it",),
            _ATTAINABLE: ("test_linear_coupling_of_blue_gaits_is_their_loss_of_rank",),
            _SINGULARITY: ("test_thesis_rounding_of_the_blue_offset_leaves_a_trace_of_rank",),
            _FLIGHTS: ("test_blue_gait_is_singular_from_the_start",),
        },
        numbers=_blue_numbers,
    ),
    Finding(
        key="triangle",
        title="The region of positive R contains the untilted vehicle",
        chapters="ch. 6, Sec. 3",
        text=(
            "Ch. 6 gives the grid points with R > 0 as a triangle with vertices (-7, 7), (-7, -5) "
            "and (5, 7), in units of π/16. It excludes the untilted vehicle, for which R = 4. "
            "Computed, it reaches (-7, -7) and (7, 7).",
        ),
        tests={_MAP: ("test_positive_residual_needs_red_and_fills_a_triangle",)},
    ),
    Finding(
        key="switching",
        title="Not every path between regions is blocked",
        chapters="ch. 3, Sec. 5.2",
        text=(
            "Ch. 3 says that a gait going from (α₂, α₄) = (1, 1) to (-1, -1) must cross a singular"
            " gait in all cases. For α₁ = -α₃ = ±1.4 it need not: both ends are in the same "
            "region.",
        ),
        tests={_CLAIMS: ("test_one_pair_of_chapter_3_can_switch_without_a_crossing",)},
    ),
    Finding(
        key="statics",
        title="Steady-state errors follow from statics, and can be removed",
        chapters="ch. 4",
        text=(
            "The position at which a vehicle comes to rest follows from the direction of its "
            "torque-free force, without simulation; both plants agree with it, and with Fig. 4 to "
            "its last digit. (Its text swaps the labels: A is the conventional decoupler, B the "
            "modified one.) Choosing roll and pitch so that the torque-free force itself points "
            "along the desired one gives an exact decoupler in closed form, which leaves no "
            "steady-state error.",
        ),
        tests={
            _FLIGHTS: (
                "test_setpoint_flights_come_to_rest_where_statics_say",
                "test_setpoint_error_is_the_published_one",
                "test_exact_decoupler_leaves_no_steady_error",
            ),
            "controllers/laws/test_attitude_altitude.py": (
                "test_exact_decoupler_points_the_torque_free_force_along_the_wanted_one",
            ),
        },
    ),
    Finding(
        key="gyroscopic",
        title="The gyroscopic torque omitted by the thesis can make the vehicle lose control",
        chapters="ch. 4",
        text=(
            "The two plants differ only by the gyroscopic torque of the rotating body. It hardly "
            "affects most flights. The instant trot with T = 3 s and the conventional decoupler is"
            " an exception: it completes on the thesis's equations and loses control in MuJoCo.",
        ),
        tests={
            _FLIGHTS: (
                "test_plants_differ_by_the_gyroscopic_torque_once_the_body_rolls_and_yaws",
                "test_plants_agree_where_they_model_the_same",
            )
        },
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
        tests={
            "controllers/laws/test_switching.py": (
                "test_experiment_2_is_lost_after_switches",
                "test_experiment_2_with_the_other_reference_rests_on_the_zones_edge",
            )
        },
    ),
    Finding(
        key="limits",
        title="Rotor limits leave little acceleration",
        chapters="ch. 9",
        text=(
            "With rotor speeds from {slow} to {fast} rad/s and no yaw torque, gaits 1 and 4 have "
            "no solution, as published. Gait 2 reaches thrusts from {low} to {high} N; at 4.2 N "
            "the body accelerations span ±{sideways} m/s², by exact polytopes and by linear "
            "programs alike, where ch. 9 prints ±2 m/s².",
        ),
        tests={
            _ATTAINABLE: (
                "test_published_speed_limits",
                "test_gaits_1_and_4_cannot_free_themselves_of_yaw",
                "test_gaits_2_and_3",
                "test_support_function_is_that_of_a_linear_program",
            )
        },
        numbers=_attainable_numbers,
    ),
)
"""All findings, in the order of the report."""
