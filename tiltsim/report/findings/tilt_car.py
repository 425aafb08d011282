"""Findings about the tilt-car, and about the state drift of other vehicles."""

from __future__ import annotations

from typing import Final

from tiltsim.report.findings.finding import Finding
from tiltsim_controllers.tilt_car.state_drift import drift_rate, orbit
from tiltsim_controllers.tilt_car.vehicle import THESIS_CAR, turn_per_tilt

_CAR: Final = "controllers/tilt_car/test_tilt_car.py"
_DRIFT: Final = "controllers/tilt_car/test_state_drift.py"
_FLOWN: Final = "laws/test_tilt_car.py"


def _drift_numbers() -> dict[str, str]:
    """The drift on ch. 10's circle, rad/s, from the aligned state."""
    return {"rate": f"{drift_rate(0.0, orbit(10.0, 1.0), THESIS_CAR):.2e}"}


def _column_numbers() -> dict[str, str]:
    return {"share": f"{turn_per_tilt(THESIS_CAR):g}"}


FINDINGS: Final = (
    Finding(
        key="holonomy",
        title="State drift is a holonomy, with a rate in closed form",
        chapters="ch. 10, Secs. 4.2, 6.2",
        text=(
            "Why the inputs of the over-actuated car drift although its position stands still "
            "ch. 10 leaves open, as “beyond the scope”. Each acceleration is produced along a "
            "curve of inputs, parametrized by the lean β, the angle from the middle of the thrusts "
            "to the acceleration. The least-norm law moves the inputs perpendicular to these "
            "curves. Those perpendicular planes are tangent to no surface, so inputs that follow a "
            "closed path of accelerations do not return to their start.",
            "On a circle the lean advances by `β' = Ω / (1 + κ² W(β))`, with κ = 1 - I_T/I_B and "
            "W(β) the squared change of the rotor speeds per lean: {rate} rad/s at first on ch. "
            "10's circle. It has the sign of Ω, ends nowhere before a rotor stops, and is undone "
            "by the same path flown back. A restoring rate in the null space of the inputs holds "
            "the lean without touching the position.",
        ),
        proof="Minimize W β'² + α'² under β' + κ α' = Ω. By Frobenius the planes would be "
        "tangent to surfaces only if n · curl n of the null direction n were zero; it is not.",
        tests={
            _DRIFT: (
                "test_the_stiffness_is_the_speed_of_the_rotor_speeds",
                "test_a_lap_advances_the_lean_by_the_holonomy",
                "test_there_and_back_along_one_path_undoes_the_drift",
                "test_small_loops_miss_by_the_twist_times_their_area",
                "test_the_drift_never_arrives_where_a_rotor_stops",
            ),
            _FLOWN: (
                "test_the_lean_drifts_as_the_closed_form_says",
                "test_restoring_ends_the_drift_and_leaves_the_error_alone",
            ),
        },
        flights=(
            "ch10_state_drift/third_derivative#two_thousand_seconds",
            "ch10_state_drift/third_derivative#clockwise",
        ),
        pictures=("drift",),
        numbers=_drift_numbers,
    ),
    Finding(
        key="arms",
        title="Multirotors with more rotors than outputs drift, too, if their pods move",
        chapters="beyond ch. 10",
        text=(
            "Six outputs, attitude and force, leave one direction of seven rotors' inputs free. "
            "With fixed rotors nothing changes along it. If the pods sway, the rotor speeds move "
            "along it from one period to the next, until one nearly stops, while position and "
            "attitude do not notice. A restoring rate along the free direction, towards the inputs "
            "of least power, ends this and costs nothing; it is on by default where pods move and "
            "rotors are more than outputs.",
            "Eight arms that sway twice as far leave two directions free, and the drift turns "
            "round in their plane: 388 to 574 rad/s in the second circle, 386 to 574 in the ninth.",
        ),
        proof="The least-norm law keeps the part of the inputs in the null space of `[τ; F]` "
        "constant, with the norm of rotor speeds that of their logarithms. If the null space is "
        "fixed, so is that part. If it turns with the pods and returns, the part has been "
        "transported along a closed path of null spaces and need not return: a holonomy, as the "
        "tilt-car's.",
        tests={
            "simulation/test_fleet.py": (
                "test_seven_swaying_arms_drift_unseen_unless_they_are_restored",
            )
        },
        flights=(
            "fleet/state_drift#drifting",
            "fleet/state_drift#restored",
            "fleet/state_drift_eight#drifting",
            "fleet/state_drift_eight#restored",
        ),
    ),
    Finding(
        key="tilt-column",
        title="Ch. 10's failing controller has a factor missing, and no anti-windup",
        chapters="ch. 10, Sec. 6.1, Eq. (27)",
        text=(
            "Eq. (27), the column of the tilt in the fourth derivative, lacks the factor "
            "1 - I_T/I_B ({share} here) that Eq. (11) has: the bottom disc turns back while the "
            "top disc tilts. As printed, the controller drifts until a rotor stops and then fails. "
            "With the factor the drift is slower and no rotor stops within the minute flown. "
            "Ch. 10 blames the state drift, but even as printed the stop of a rotor is harmless if "
            "the controller's own rotor speeds stop at zero with it: the other rotor and the tilt "
            "suffice.",
        ),
        proof="Α'' enters the fourth derivative of the position as α does the second, "
        "Eq. (3), in which the thrusts have the direction ψ + α = (1 - I_T/I_B) α.",
        tests={
            _CAR: (
                "test_the_printed_tilt_column_lacks_the_yaws_answer",
                "test_drift_and_columns_make_the_fourth_derivative",
                "test_one_rotor_at_rest_leaves_full_rank_two_do_not",
            ),
            _FLOWN: (
                "test_the_fourth_derivative_fails_for_want_of_anti_windup",
                "test_with_the_exact_tilt_column_no_rotor_stops",
            ),
        },
        flights=(
            "ch10_state_drift/fourth_derivative#failure",
            "ch10_state_drift/fourth_derivative#exact",
            "ch10_state_drift/fourth_derivative#anti_windup",
        ),
        numbers=_column_numbers,
    ),
)
"""In the order of the report."""
