"""Findings about the flights of the tiltrotor: gains, decouplers, gaits, limits."""

from __future__ import annotations

from typing import Final

import numpy as np

from tiltsim.report.findings.finding import Finding
from tiltsim_controllers.analysis.attainable import (
    attainable_accelerations,
    attainable_torque_thrust,
    published_speed_limits,
)
from tiltsim_controllers.analysis.published_gaits import PUBLISHED_GAITS
from tiltsim_controllers.analysis.stability import third_order_loop
from tiltsim_controllers.laws import gains
from tiltsim_controllers.vehicle.parameters import PRESETS

_VEHICLE: Final = PRESETS["ar_drone_2"]
_FLOWN: Final = "report/test_flown_findings.py"
_ATTAINABLE: Final = "controllers/analysis/test_attainable.py"
_FLIGHTS: Final = "simulation/test_simulate.py"


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


def _norm_numbers() -> dict[str, str]:
    """By how much a unit of tilt rate moves the force more than a unit of w' in hover."""
    return {"ratio": f"{_VEHICLE.hover_rotor_speed**2:,.0f}"}


FINDINGS: Final = (
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
        proof="The polynomial s³ + K₁s² + K₂s + K₃ is stable if and only if K₁K₂ > K₃; a loop gain "
        "g multiplies all three, and the condition becomes g K₁K₂ > K₃.",
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
        proof="At rest there is no torque, so the rotors' force is along n; it carries the weight, "
        "so n turned by the commanded attitude is vertical: two equations for the two errors.",
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
        flights=("ch04_tracking/setpoint#rho_065_modified",),
        pictures=("setpoint-errors",),
    ),
    Finding(
        key="short-period",
        title="At T = 1 s the modified decoupler is worse than the conventional one",
        chapters="ch. 4, Secs. 7.2-7.3",
        text=(
            "Ch. 4 reports that at T = 1 s the two decouplers hardly differ. They do: with either "
            "form of the trot, on the line and on the circle, the modified one has the larger "
            "error, on both plants. At 2 s and 3 s it has the smaller one, as published.",
        ),
        proof="The trot's side forces at +ρ and -ρ cancel over a period. A short period averages "
        "them out by itself. The modified decoupler leans against each of them, and the attitude "
        "lags behind a reference that jumps at every switch. Shown by flights, not by proof.",
        tests={_FLOWN: ("test_the_modified_decoupler_is_worse_at_short_periods_only",)},
        flights=tuple(
            f"ch04_tracking/{reference}#{form}_t1_{decoupler}"
            for reference in ("line", "circle")
            for form in ("instant", "continuous")
            for decoupler in ("conventional", "modified")
        ),
        pictures=("trot-errors",),
    ),
    Finding(
        key="gallops",
        title="With the modified decoupler the gallops beat the walk",
        chapters="ch. 5, Sec. 6",
        text=(
            "Ch. 5 finds the walk's error the smallest. That is so with the conventional "
            "decoupler, whose errors are ten times as large and dominate every average. With the "
            "modified one, which the chapter recommends, both gallops have the smaller errors at "
            "every period, on both references and both plants.",
        ),
        proof="Shown by flights; amplitudes and leans of the gaits are fitted, as their figures "
        "are not available.",
        tests={_FLOWN: ("test_gallops_beat_the_walk_with_the_modified_decoupler",)},
        flights=tuple(
            f"ch05_gaits/line#{gait}_third_t1_modified"
            for gait in ("walk", "transverse_gallop", "rotary_gallop")
        ),
        pictures=("walk",),
    ),
    Finding(
        key="gyroscopic",
        title="Which angular acceleration is fed back decides whether a flight is lost",
        chapters="ch. 4, Eq. (26)",
        text=(
            "Eq. (26) feeds back the second derivatives of roll, pitch and yaw. If they are "
            "computed from the law's model, which like the thesis leaves the gyroscopic torque "
            "`ω × I ω` out, the instant trot with T = 3 s and the conventional decoupler completes "
            "on the thesis's equations and is lost in MuJoCo. If they are measured, it completes "
            "in MuJoCo too, with nearly the same error: the torque alone loses nothing.",
            "The plants differ by that torque and by the tilt servos, which take time where the "
            "thesis's tilt angles jump. On most flights neither matters.",
        ),
        proof="In a measured acceleration an unmodelled torque appears and is compensated in the "
        "next instant; in a modelled one it does not.",
        tests={
            _FLIGHTS: (
                "test_plants_differ_by_the_gyroscopic_torque_once_the_body_rolls_and_yaws",
                "test_plants_agree_where_they_model_the_same",
            ),
            "laws/layers/test_measured_acceleration.py": (
                "test_it_is_the_acceleration_that_mujoco_integrates",
            ),
            _FLOWN: ("test_the_measured_acceleration_saves_the_flight_that_the_modelled_loses",),
        },
        flights=(
            "ch04_tracking/line#instant_t3_conventional",
            "ch04_tracking/measured_acceleration#line_t3_conventional",
        ),
    ),
    Finding(
        key="unacceptable",
        title="Unacceptable attitudes come back if the gait moves; the time step loses others",
        chapters="ch. 3-8",
        text=(
            "The thesis calls attitudes beyond a gait's curve of singular attitudes unacceptable. "
            "Flown from a grid of initial attitudes up to 1.5 rad of roll and pitch, vehicles with "
            "a fixed gait do not come back from there. Those with a moving gait do from a third to "
            "a half of the attitudes that are unacceptable at some time of its period, but from "
            "none that is so at the start.",
            "Of the acceptable attitudes, some one in fifteen of ch. 4's gaits and one in five of "
            "ch. 6's gait 3, which is red and has no singular attitude at all, do not come back. "
            "They are lost within some 25 ms, and by the solver's step of 1 ms: leaning far, the "
            "rotors reach thousands of rad/s for an instant, and the loop gain under the printed "
            "matrix grows with their speed until the step is too long for it. In steps of 25 µs "
            "nearly all of these flights complete.",
        ),
        proof="The determinant changes its sign along no flight: where it vanishes, no rotor "
        "follows the demanded acceleration. From beyond the curve of the first instant the vehicle "
        "would have to pass it; a curve that arrives later finds it level again. What the step "
        "loses is shown by flights in both steps.",
        tests={
            _FLOWN: (
                "test_what_comes_back_was_acceptable_when_the_flight_began",
                "test_acceptable_attitudes_are_lost_by_the_time_step",
            )
        },
        flights=("ch04_tracking/setpoint#rho_065_modified", "ch06_two_color/stabilization#gait_3"),
        pictures=("attraction",),
    ),
    Finding(
        key="rotor-inertia",
        title="The rotors' own inertia, which the thesis neglects, decides about the trots",
        chapters="ch. 3-9",
        text=(
            "Propellers of this vehicle's size have a spin inertia of 1e-6 to 3e-5 kg m². Their "
            "reaction and gyroscopic torques, off in every flight of the thesis, leave a fixed "
            "gait as it is. A trot turns the rotors' angular momentum with its pods: with "
            "1e-5 kg m² the error of the continuous trot at T = 2 s, modified decoupler, is "
            "smaller by more than a quarter on both plants, and with 3e-5 kg m² the same flight is "
            "lost in MuJoCo, though not on the thesis's equations. The published errors of moving "
            "gaits hold for rotors without inertia.",
        ),
        proof="A rotor of inertia J on the unit axis d adds the torque -d/dt (J ϖ d) - ω × J ϖ d. "
        "It vanishes for pods at rest, constant speeds and a body that does not turn.",
        tests={
            "laws/layers/test_rotor_inertia.py": (
                "test_accelerations_are_those_of_bodies_that_spin",
                "test_angular_momentum_stays",
                "test_pods_that_jump_turn_the_body_at_once",
                "test_a_trot_turns_the_body_and_a_fixed_gait_does_not",
            ),
            _FLOWN: ("test_rotor_inertia_changes_trots_but_no_fixed_gait",),
        },
        sweep="beyond/sweeps/rotor_inertia",
    ),
    Finding(
        key="norm",
        title="Over-actuated control in the published norm is lost",
        chapters="ch. 3, Sec. 6.3",
        text=(
            "The over-actuated controller takes the least norm of all eight inputs, the rates of "
            "ϖᵢ|ϖᵢ| and of αᵢ. With equal numerical weights, as published, a unit of tilt rate "
            "moves the force {ratio} times as much as a unit of the other in hover, so that "
            "tilting does nearly all the work: the finer the step, the faster the pods turn. On "
            "the thesis's equations a rotor is at rest, where the matrix is singular, within a "
            "tenth of a second; in MuJoCo only the lag of the servos lets the flight end. Weighted "
            "by the force they move, tilt rates behave as published.",
        ),
        proof="The share of an input in the least-norm solution is the square of its effect, and "
        "the effects are K_f for the rate of ϖ|ϖ| and K_f ϖ² for that of α.",
        tests={
            "controllers/laws/test_full_pose.py": (
                "test_under_the_published_weight_tilting_is_faster_than_any_step",
                "test_the_even_weight_is_that_of_hover",
            )
        },
        flights=("ch03_gaits/over_actuated#gait_1_published_norm",),
        pictures=("over-actuated",),
        numbers=_norm_numbers,
    ),
    Finding(
        key="limits",
        title="Rotor limits leave little acceleration",
        chapters="ch. 9",
        text=(
            "With rotor speeds from {slow} to {fast} rad/s and no yaw torque, gaits 1 and 4 have "
            "no solution, as published. Gait 2 reaches thrusts from {low} to {high} N; at 4.2 N "
            "the body accelerations span ±{sideways} m/s², where ch. 9 prints ±2 m/s².",
        ),
        proof="Exact polytopes, confirmed by linear programs.",
        tests={
            _ATTAINABLE: (
                "test_published_speed_limits",
                "test_gaits_1_and_4_cannot_free_themselves_of_yaw",
                "test_gaits_2_and_3",
                "test_support_function_is_that_of_a_linear_program",
            )
        },
        pictures=("attainable",),
        numbers=_attainable_numbers,
    ),
)
"""In the order of the report."""
