"""The numbers in the texts of the findings, computed when the report is made."""

from __future__ import annotations

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

_VEHICLE: Final = PRESETS["ar_drone_2"]


def matrix_gain() -> dict[str, str]:
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


def map_numbers() -> dict[str, str]:
    """2 delta of both published vehicles, rad."""
    return {
        "ar": f"{2.0 * delta(_VEHICLE):.9f}",
        "luukkonen": f"{2.0 * delta(PRESETS['luukkonen']):.9f}",
    }


def blue_numbers() -> dict[str, str]:
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


def quadrotor_numbers() -> dict[str, str]:
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


def attainable_numbers() -> dict[str, str]:
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
