"""Names, meanings and units of the metrics."""

from __future__ import annotations

from typing import Final

METRICS: Final = {
    "final_position_error_x": "reference minus actual, mean over the last second, m",
    "final_position_error_y": "reference minus actual, mean over the last second, m",
    "final_position_error_z": "reference minus actual, mean over the last second, m",
    "sup_position_error_after_20s": "largest horizontal position error from 20 s on, m",
    "least_position_error_after_20s": "smallest horizontal position error from 20 s on, m",
    "max_orbit_radius_after_20s": "largest distance from the reference circle's centre, m",
    "min_orbit_radius_after_20s": "smallest distance from the reference circle's centre, m",
    "final_roll": "mean over the last second, rad",
    "final_pitch": "mean over the last second, rad",
    "final_yaw": "mean over the last second, rad",
    "final_attitude_error": "largest error of roll, pitch or yaw over the last second, rad",
    "max_abs_roll": "largest absolute roll, rad",
    "max_abs_pitch": "largest absolute pitch, rad",
    "min_rotor_speed": "smallest rotor speed along its spin, negative where one reversed, rad/s",
    "max_rotor_speed": "largest rotor speed along its spin, rad/s",
    "altitude_overshoot": "largest height above the reference, m",
    "altitude_settling_time": "time after which the altitude error stays within 5 mm, s",
    "max_published_determinant": "largest determinant surface S as published (ch. 2)",
    "min_published_determinant": "smallest determinant surface S as published (ch. 2)",
    "switches": "switches between two laws, from sample to sample",
    "first_switch_time": "first sample after a switch, s",
    "max_abs_error_x": "largest absolute position error along x, m (tilt_car)",
    "max_abs_error_y": "largest absolute position error along y, m (tilt_car)",
    "max_lyapunov": "largest Lyapunov candidate e_y'^2/2 + K_Y2 e_y^2/2 (ch. 11), m^2/s^2",
    "final_input_split": "omega_1^2 - omega_2^2, mean over the last second, rad^2/s^2 (tilt_car)",
    "max_tilt_rate": "largest absolute tilt rate, rad/s",
    "min_singularity_margin": "smallest rotation to a singular attitude, negative beyond it, rad",
    "min_decoupling_condition": "smallest over largest singular value of [tau/(L Kf); r3 F/Kf]",
    "saturated_fraction": "fraction of samples with a rotor at its speed limit",
    "first_saturation_time": "first sample with a rotor at its speed limit, s",
    "last_saturation_time": "last sample with a rotor at its speed limit, s",
    "diverged": "true if the vehicle was lost: divergence, singular matrix, failed controller",
    "duration": "time flown, s",
    "realtime_factor": "time flown over wall time of the integration",
}
"""Every metric by name, with its meaning; a flight has those that apply to it."""

WALL_CLOCK_METRICS: Final = frozenset({"realtime_factor"})
"""Metrics that depend on the computer; they differ between equal flights."""

BOOLEAN_METRICS: Final = frozenset({"diverged"})

_UNITS: Final = frozenset(
    {"m", "rad", "s", "rad/s", "m/s", "m/s^2", "N", "N m", "m^2/s^2", "rad^2/s^2"}
)


def unit_of(metric: str) -> str:
    """The unit of a metric; empty for dimensionless ones."""
    unit = METRICS[metric].rpartition(", ")[2].partition(" (")[0]
    return unit if unit in _UNITS and metric not in BOOLEAN_METRICS else ""
