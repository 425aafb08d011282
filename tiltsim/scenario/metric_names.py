"""Names, meanings and units of the metrics."""

from typing import Final, Literal, NamedTuple

from tiltsim.system.text import Quantity


class Metric(NamedTuple):
    """A metric: its label in figures, its unit and its meaning.

    One that is a number of a column is stated here with it; kinds of vehicles compute the others.
    """

    label: str
    unit: str  # empty for dimensionless ones
    meaning: str
    column: str = ""
    number: Literal["max", "min", "max_abs", "last"] = "max"  # of this column

    @property
    def quantity(self) -> Quantity:
        """Label and unit."""
        return Quantity(self.label, self.unit)

    @property
    def described(self) -> str:
        """The meaning with the unit."""
        return f"{self.meaning}, {self.unit}" if self.unit else self.meaning


METRICS: Final = {
    "final_position_error_x": Metric(
        "final error along x", "m", "reference minus actual, mean over the last second"
    ),
    "final_position_error_y": Metric(
        "final error along y", "m", "reference minus actual, mean over the last second"
    ),
    "final_position_error_z": Metric(
        "final error along z", "m", "reference minus actual, mean over the last second"
    ),
    "rms_position_error": Metric(
        "rms position error",
        "m",
        "root mean square distance from the reference; of altitude alone where no law follows x, y",
    ),
    "max_position_error": Metric(
        "largest position error",
        "m",
        "largest distance from the reference; of altitude alone where no law follows x, y",
    ),
    "sup_position_error_after_20s": Metric(
        "largest horizontal error after 20 s", "m", "largest horizontal position error from 20 s on"
    ),
    "least_position_error_after_20s": Metric(
        "smallest horizontal error after 20 s",
        "m",
        "smallest horizontal position error from 20 s on",
    ),
    "max_orbit_radius_after_20s": Metric(
        "largest radius after 20 s", "m", "largest distance from the reference circle's center"
    ),
    "min_orbit_radius_after_20s": Metric(
        "smallest radius after 20 s", "m", "smallest distance from the reference circle's center"
    ),
    "final_roll": Metric("final roll", "rad", "mean over the last second"),
    "final_pitch": Metric("final pitch", "rad", "mean over the last second"),
    "final_yaw": Metric("final yaw", "rad", "mean over the last second"),
    "final_attitude_error": Metric(
        "final attitude error", "rad", "largest error of roll, pitch or yaw over the last second"
    ),
    "max_abs_roll": Metric("largest roll", "rad", "largest absolute roll", "roll", "max_abs"),
    "max_abs_pitch": Metric("largest pitch", "rad", "largest absolute pitch", "pitch", "max_abs"),
    "min_rotor_speed": Metric(
        "lowest rotor speed",
        "rad/s",
        "smallest rotor speed along its spin, negative where one reversed",
    ),
    "max_rotor_speed": Metric("highest rotor speed", "rad/s", "largest rotor speed along its spin"),
    "rms_rotor_acceleration": Metric(
        "rotor acceleration", "rad/s^2", "root mean square over all rotors, from sample to sample"
    ),
    "altitude_overshoot": Metric(
        "overshoot of the altitude", "m", "largest height above the reference"
    ),
    "altitude_settling_time": Metric(
        "settling time of the altitude",
        "s",
        "time after which the altitude error stays within 5 mm",
    ),
    "max_published_determinant": Metric(
        "largest published determinant S",
        "",
        "largest determinant surface S as published (ch. 2)",
        "published_determinant",
    ),
    "min_published_determinant": Metric(
        "smallest published determinant S",
        "",
        "smallest determinant surface S as published (ch. 2)",
        "published_determinant",
        "min",
    ),
    "switches": Metric(
        "switches of the control law", "", "switches between two laws, from sample to sample"
    ),
    "first_switch_time": Metric("time of the first switch", "s", "first sample after a switch"),
    "max_abs_error_x": Metric(
        "largest error along x", "m", "largest absolute position error along x, in a plane"
    ),
    "max_abs_error_y": Metric(
        "largest error along y", "m", "largest absolute position error along y, in a plane"
    ),
    "max_lyapunov": Metric(
        "largest Lyapunov candidate",
        "m^2/s^2",
        "largest Lyapunov candidate e_y'^2/2 + K_Y2 e_y^2/2 (ch. 11)",
        "lyapunov",
    ),
    "final_input_split": Metric(
        "final ω₁² − ω₂²", "rad^2/s^2", "omega_1^2 - omega_2^2, mean over the last second"
    ),
    "max_tilt_rate": Metric("largest tilt rate", "rad/s", "largest absolute tilt rate"),
    "min_singularity_margin": Metric(
        "smallest singularity margin",
        "rad",
        "smallest rotation to a singular attitude, negative beyond it",
        "singularity_margin",
        "min",
    ),
    "min_decoupling_condition": Metric(
        "smallest σ₃/σ₁ of the decoupling matrix",
        "",
        "smallest over largest singular value of [tau/(L Kf); r3 F/Kf], for a multirotor with "
        "all components of force that its controller controls",
    ),
    "max_null_part": Metric(
        "largest null part of the rotor speeds",
        "",
        "largest share of varpi |varpi| that neither force nor torque show (multirotor)",
        "null_part",
    ),
    "max_supervision": Metric(
        "largest intervention of the supervisor",
        "",
        "largest share of the gait's angles (scale) or of its speed (hold) that the supervisor "
        "takes away, or of the way to red; 0 where it never acted",
        "supervision",
    ),
    "peak_force": Metric(
        "largest contact force",
        "N",
        "largest force on all objects together, at any physics step",
        "peak_contact_force",
        "last",
    ),
    "time_in_contact": Metric(
        "time in contact",
        "s",
        "time for which the vehicle touched an object",
        "contact_time",
        "last",
    ),
    "max_cable_tension": Metric("largest tension of a cable", "N", "of the recorded samples"),
    "max_swing": Metric(
        "largest swing of the load", "rad", "largest angle of the cable from straight down"
    ),
    "final_swing": Metric(
        "residual swing of the load", "rad", "largest such angle over the last second"
    ),
    "minimum_separation": Metric(
        "smallest distance between vehicles", "m", "between centers of mass of any two vehicles"
    ),
    "companion_rms_position_error": Metric(
        "rms position error of a companion", "m", "the largest of all companions"
    ),
    "rms_force_error": Metric(
        "rms error of the force",
        "N",
        "root mean square error of the force of a push, from 1 s after the full force is commanded",
    ),
    "nees": Metric(
        "NEES of the estimate",
        "",
        "squared errors of the estimated attitude, velocity and position, normalized by their "
        "covariance: mean over the samples and the nine errors, 1 for a consistent filter",
    ),
    "nees_in_band": Metric(
        "share of samples with consistent errors",
        "",
        "share of samples whose NEES is within the 95 % band of the chi-square distribution",
    ),
    "nis": Metric(
        "NIS of the estimate",
        "",
        "squared innovations, normalized by their covariance: mean over all components of all "
        "readings, 1 for a consistent filter",
    ),
    "nis_low": Metric("lower end of the NIS", "", "of the 95 % band for this number of readings"),
    "nis_high": Metric("upper end of the NIS", "", "of the 95 % band for this number of readings"),
    "saturated_fraction": Metric(
        "share of time with a saturated rotor",
        "",
        "fraction of samples with a rotor at its speed limit",
    ),
    "first_saturation_time": Metric(
        "time of the first saturation", "s", "first sample with a rotor at its speed limit"
    ),
    "last_saturation_time": Metric(
        "time of the last saturation", "s", "last sample with a rotor at its speed limit"
    ),
    "diverged": Metric(
        "vehicle lost",
        "",
        "true if the vehicle was lost: divergence, singular matrix, failed controller",
    ),
    "duration": Metric("time flown", "s", "time flown"),
    "realtime_factor": Metric(
        "speed relative to real time", "", "time flown over wall time of the integration"
    ),
}
"""Every metric by name, with its label, unit and meaning; a flight has the metrics that apply."""

WALL_CLOCK_METRICS: Final = frozenset({"realtime_factor"})
"""Metrics that depend on the computer; they differ between equal flights."""

KEPT_METRICS: Final = tuple(name for name in METRICS if name not in WALL_CLOCK_METRICS)
"""The others, which the results of sweeps hold."""

BOOLEAN_METRICS: Final = frozenset({"diverged"})


def split_metric(name: str) -> tuple[str, str]:
    """The vehicle and its metric in a name: a companion's name, empty for the first vehicle."""
    vehicle, _, own = name.rpartition(".")
    return vehicle, own


def is_metric(name: str) -> bool:
    """Whether a name is a metric's; a companion's follows the vehicle's name and a dot."""
    return split_metric(name)[1] in METRICS


def metric_of(name: str) -> Metric:
    """The metric of a name such as ``max_rotor_speed`` or ``wing.max_rotor_speed``.

    Raises:
        KeyError: If there is none.
    """
    vehicle, own = split_metric(name)
    found, words = METRICS[own], f"{vehicle}: "
    if not vehicle:
        return found
    return found._replace(label=words + found.label, meaning=words + found.meaning)


def is_boolean(name: str) -> bool:
    """Whether a metric, of any vehicle, is true or false."""
    return split_metric(name)[1] in BOOLEAN_METRICS


def unit_of(metric: str) -> str:
    """The unit of a metric; empty for dimensionless ones."""
    return metric_of(metric).unit
