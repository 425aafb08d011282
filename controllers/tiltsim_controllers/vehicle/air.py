"""Aerodynamic forces: drag, wind, discrete gusts, turbulence and ground effect.

Sources: MIL-F-8785C, "Flying qualities of piloted airplanes" (5 November 1980), for gusts and the
Dryden spectra; Cheeseman and Bennett, "The effect of the ground on a helicopter rotor in forward
flight", ARC R&M 3021 (September 1955, published 1957). The formulas were checked against other
implementations; paragraphs and equations are not cited, as neither document was available. Air
velocities are in world axes, z up.
"""

from __future__ import annotations

from math import cos, pi, sqrt
from typing import Any, Final, NamedTuple

import numpy as np

from tiltsim_controllers.mathematics.noise import normal
from tiltsim_controllers.mathematics.scalar import Triple, scalar

FOOT: Final = 0.3048
"""m; MIL-F-8785C is in feet, and its exponents do not carry over."""

# --- drag --------------------------------------------------------------------------------------


class Drag(NamedTuple):
    """Drag coefficients along each body axis."""

    linear_x: float = 0.0  # N s/m
    linear_y: float = 0.0
    linear_z: float = 0.0
    area_x: float = 0.0  # m^2: drag coefficient times the area projected along the axis
    area_y: float = 0.0
    area_z: float = 0.0
    density: float = 1.225  # kg/m^3, of the standard atmosphere at sea level


@scalar
def drag_force(velocity: Triple, drag: Drag) -> Triple:
    """Force (N) on a body that moves through the air at a velocity (m/s), body axes.

    ``F_i = -(linear_i + density / 2 area_i |v|) v_i``. The linear part models the drag of the
    rotors (H-force), the quadratic part that of the fuselage.
    """
    vx, vy, vz = velocity
    pressure = 0.5 * drag.density * sqrt(vx * vx + vy * vy + vz * vz)
    return (
        -(drag.linear_x + drag.area_x * pressure) * vx,
        -(drag.linear_y + drag.area_y * pressure) * vy,
        -(drag.linear_z + drag.area_z * pressure) * vz,
    )


# --- gusts -------------------------------------------------------------------------------------


class Gust(NamedTuple):
    """A discrete gust (MIL-F-8785C), specified by its rise time instead of its length."""

    start: float = 0.0  # s
    rise: float = 1.0  # s, d_m over the speed of flight
    duration: float = 0.0  # s, from start to the end of the fall; 0: it does not fall
    x: float = 0.0  # m/s, at its peak
    y: float = 0.0
    z: float = 0.0


@scalar
def gust_profile(time: float, gust: Gust) -> float:
    """Fraction of the peak at a time (s): ``(1 - cos(pi t / rise)) / 2``, mirrored at the end."""
    since = time - gust.start
    if since <= 0.0 or (gust.duration > 0.0 and since >= gust.duration):
        return 0.0
    if since < gust.rise:
        return 0.5 * (1.0 - cos(pi * since / gust.rise))
    left = gust.duration - since
    if gust.duration > 0.0 and left < gust.rise:
        return 0.5 * (1.0 - cos(pi * left / gust.rise))
    return 1.0


# --- turbulence --------------------------------------------------------------------------------


class Turbulence(NamedTuple):
    """Dryden turbulence met at a constant airspeed; see `dryden_rates`."""

    intensity_u: float = 0.0  # m/s, standard deviation along the mean wind
    intensity_w: float = 0.0  # m/s, vertical; across the wind it is that of u
    length_u: float = 1.0  # m, scale; across the wind it is the same
    length_w: float = 1.0
    speed: float = 1.0  # m/s, through the turbulence
    along_x: float = 1.0  # unit vector of the mean wind, horizontal
    along_y: float = 0.0
    sample_time: float = 0.01  # s for which a draw of the noise is held
    seed: float = 0.0


DRYDEN_STATES: Final = 5
"""One for u, two each for v and w."""


def low_altitude_turbulence(
    wind_at_20_ft: float,
    height: float,
    *,
    speed: float,
    direction: float = 0.0,
    sample_time: float = 0.01,
    seed: float = 0.0,
) -> Turbulence:
    """Parameters of the low-altitude model (MIL-F-8785C), 10 to 1000 ft.

    ``L_w = h``, ``L_u = L_v = h / (0.177 + 0.000823 h)^1.2``, ``sigma_w = 0.1 W_20`` and
    ``sigma_u = sigma_v = sigma_w / (0.177 + 0.000823 h)^0.4``, ``h`` in feet.

    Args:
        wind_at_20_ft: mean wind 6 m above the ground, m/s
        height: above the ground, m; limited to 10 to 1000 ft
        speed: airspeed of the vehicle, m/s; in hover that of the mean wind
        direction: direction into which the mean wind blows, rad from +x towards +y
        sample_time: time for which a draw of the noise is held, s
        seed: an integer
    """
    feet = min(1000.0, max(10.0, height / FOOT))
    base = 0.177 + 0.000823 * feet
    intensity_w = 0.1 * wind_at_20_ft
    return Turbulence(
        intensity_u=intensity_w / base**0.4,
        intensity_w=intensity_w,
        length_u=feet / base**1.2 * FOOT,
        length_w=feet * FOOT,
        speed=speed,
        along_x=float(np.cos(direction)),
        along_y=float(np.sin(direction)),
        sample_time=sample_time,
        seed=seed,
    )


@scalar
def white_noise(time: float, channel: float, turbulence: Turbulence) -> float:
    """Sampled white noise (1/s^0.5) at a time (s): its integral has the variance ``time``."""
    # Rounding may leave an exact multiple slightly too small; that must not delay the next draw.
    index = float(int(time / turbulence.sample_time + 1e-6))
    return normal(turbulence.seed, channel, index) / sqrt(turbulence.sample_time)


@scalar
def dryden_rates(
    time: float, states: tuple[float, ...], turbulence: Turbulence
) -> tuple[float, float, float, float, float]:
    """Rates of the shaping filters' ``states`` at a time (s), driven by white noise.

    With ``T = L / V`` the filters are ``sigma sqrt(2 T) / (1 + T s)`` for u and
    ``sigma sqrt(T) (1 + sqrt(3) T s) / (1 + T s)^2`` for v and w. The states are outputs of
    first-order lags: one for u, two in series for v and for w.
    """
    u, v1, v2, w1, w2 = states
    if turbulence.intensity_u == 0.0 and turbulence.intensity_w == 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    rate_u = turbulence.speed / turbulence.length_u
    rate_w = turbulence.speed / turbulence.length_w
    return (
        rate_u * (white_noise(time, 20.0, turbulence) - u),
        rate_u * (white_noise(time, 21.0, turbulence) - v1),
        rate_u * (v1 - v2),
        rate_w * (white_noise(time, 22.0, turbulence) - w1),
        rate_w * (w1 - w2),
    )


@scalar
def dryden_velocity(states: tuple[float, ...], turbulence: Turbulence) -> Triple:
    """The turbulent velocity of the air (m/s, world) from the filters' states.

    ``(1 + sqrt(3) T s)`` after two lags is ``sqrt(3)`` times the first lag's output minus
    ``sqrt(3) - 1`` times the second's.
    """
    u, v1, v2, w1, w2 = states
    root_3 = 1.7320508075688772
    time_u = turbulence.length_u / turbulence.speed
    time_w = turbulence.length_w / turbulence.speed
    along = turbulence.intensity_u * sqrt(2.0 * time_u) * u
    across = turbulence.intensity_u * sqrt(time_u) * (root_3 * v1 - (root_3 - 1.0) * v2)
    up = turbulence.intensity_w * sqrt(time_w) * (root_3 * w1 - (root_3 - 1.0) * w2)
    cx, cy = turbulence.along_x, turbulence.along_y
    return cx * along - cy * across, cy * along + cx * across, up


# --- ground effect -----------------------------------------------------------------------------


class GroundEffect(NamedTuple):
    """The ground under the rotors."""

    rotor_radius: float = 0.0  # m; 0 for no ground effect
    height: float = 0.0  # m, z of the ground in the world


@scalar
def ground_effect(above: float, rotor_radius: float) -> float:
    """Ratio of a rotor's thrust near the ground to its thrust far away, at equal power.

    ``1 / (1 - (R / 4 h)^2)`` (Cheeseman and Bennett, at rest) with the rotor's height ``h``
    (``above``, m) and radius ``R`` (m). Derived for single, level rotors from a source and its
    image and valid above half a radius; below, the value at half a radius, 4/3, is used.
    """
    if rotor_radius == 0.0:
        return 1.0
    ratio = rotor_radius / (4.0 * max(above, 0.5 * rotor_radius))
    return 1.0 / (1.0 - ratio * ratio)


# --- combined ----------------------------------------------------------------------------------


class Air(NamedTuple):
    """The air around a vehicle."""

    wind_x: float = 0.0  # m/s, world: velocity of the air
    wind_y: float = 0.0
    wind_z: float = 0.0
    drag: Drag = Drag()
    gust: Gust = Gust()
    turbulence: Turbulence = Turbulence()
    ground: GroundEffect = GroundEffect()


@scalar
def air_velocity(time: float, states: tuple[float, ...], air: Any) -> Triple:
    """Velocity of the air (m/s, world) at a time (s): wind, gust and turbulence.

    ``states`` are those of the turbulence's filters; ``air`` is an `Air`.
    """
    share = gust_profile(time, air.gust)
    x, y, z = dryden_velocity(states, air.turbulence)
    return (
        air.wind_x + share * air.gust.x + x,
        air.wind_y + share * air.gust.y + y,
        air.wind_z + share * air.gust.z + z,
    )


def stationary_states(turbulence: Turbulence) -> tuple[float, float, float, float, float]:
    """A draw of the filters' initial states from their stationary distribution.

    A lag ``T`` of unit noise has the variance ``1 / 2T``, a second one in series ``1 / 4T``, which
    is also their covariance.
    """
    u, v1, v2, w1, w2 = (normal(turbulence.seed, channel, 0.0) for channel in range(25, 30))
    scale_u = float(np.sqrt(turbulence.speed / turbulence.length_u))
    scale_w = float(np.sqrt(turbulence.speed / turbulence.length_w))
    root_2, root_8 = float(np.sqrt(0.5)), float(np.sqrt(0.125))
    v1, w1 = root_2 * scale_u * v1, root_2 * scale_w * w1
    return (
        root_2 * scale_u * u,
        v1,
        0.5 * v1 + root_8 * scale_u * v2,
        w1,
        0.5 * w1 + root_8 * scale_w * w2,
    )
