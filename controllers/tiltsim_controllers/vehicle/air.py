"""Aerodynamic forces: drag, wind, gusts, turbulence, ground effect, and the wakes of others.

Sources: MIL-F-8785C, "Flying qualities of piloted airplanes" (5 November 1980), for gusts and the
Dryden spectra; Cheeseman and Bennett, "The effect of the ground on a helicopter rotor in forward
flight", ARC R&M 3021 (September 1955, published 1957). The formulas were checked against other
implementations; paragraphs and equations are not cited, as neither document was available. Air
velocities are in world axes, z up.

By momentum theory the wake of a vehicle in hover carries the momentum of its weight, at twice the
induced velocity of its rotors. Below it spreads as a turbulent round jet (Pope, Turbulent Flows,
2000, Sec. 5.1), as measured below quadrotors (Bauersfeld et al., Robotics meets Fluid Dynamics,
arXiv 2403.13321): its velocity is a Gaussian of the distance from the axis, its width grows in
proportion to the depth, and its momentum stays.
"""

from math import log, pi, sqrt
from typing import Any, Final, NamedTuple

from tiltsim_controllers.code.arrays import branch, normal, traceable, xp
from tiltsim_controllers.code.tracing import make
from tiltsim_controllers.mathematics.linear import norm
from tiltsim_controllers.mathematics.records import Vector3

FOOT: Final = 0.3048
"""m; MIL-F-8785C is in feet, and its exponents do not carry over."""

ROOT_3: Final = 1.7320508075688772

# --- drag --------------------------------------------------------------------------------------


class Drag(NamedTuple):
    """Drag coefficients along each body axis."""

    linear: Vector3 = (0.0, 0.0, 0.0)  # N s/m
    area: Vector3 = (0.0, 0.0, 0.0)  # m^2: drag coefficient times the projected area
    density: float = 1.225  # kg/m^3, of the standard atmosphere at sea level


@traceable
def drag_force(velocity: Any, drag: Drag) -> Any:
    """Force (N), body axes, on a body that moves through the air with a velocity (m/s), shape (3,).

    ``F_i = -(linear_i + density / 2 area_i |v|) v_i``. The linear part models the drag of the
    rotors (H-force), the quadratic part the drag of the fuselage.
    """
    return -(drag.linear + 0.5 * drag.density * norm(velocity) * drag.area) * velocity


# --- gusts -------------------------------------------------------------------------------------


class Gust(NamedTuple):
    """A discrete gust (MIL-F-8785C), specified by its rise time instead of its length."""

    start: float = 0.0  # s
    rise: float = 1.0  # s, d_m over the speed of flight
    duration: float = 0.0  # s, at least twice the rise, from start to the end of the fall; 0: lasts
    velocity: Vector3 = (0.0, 0.0, 0.0)  # m/s, at its peak


def gust_profile(time: Any, gust: Gust) -> Any:
    """Fraction of the peak at a time (s): ``(1 - cos(pi t / rise)) / 2``, mirrored at the end."""
    since = time - gust.start
    left = xp.where(gust.duration > 0.0, gust.duration, xp.inf) - since
    inside = xp.clip(xp.minimum(since, left), 0.0, gust.rise)  # s from the nearer end
    return 0.5 * (1.0 - xp.cos(xp.pi * inside / gust.rise))


# --- turbulence --------------------------------------------------------------------------------


class Turbulence(NamedTuple):
    """Dryden turbulence met at a constant airspeed; see `dryden_rates`."""

    intensity_u: float = 0.0  # m/s, standard deviation along and across the mean wind
    intensity_w: float = 0.0  # m/s, vertical
    length_u: float = 1.0  # m, scale along and across the mean wind
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
        wind_at_20_ft: Mean wind 6 m above the ground, m/s.
        height: Above the ground, m; limited to 10 to 1000 ft.
        speed: Airspeed of the vehicle, m/s; in hover, the speed of the mean wind.
        direction: Direction into which the mean wind blows, rad from +x toward +y.
        sample_time: Time for which a draw of the noise is held, s.
        seed: An integer.
    """
    feet = xp.clip(height / FOOT, 10.0, 1000.0)
    base = 0.177 + 0.000823 * feet
    intensity_w = 0.1 * wind_at_20_ft
    return Turbulence(
        intensity_u=intensity_w / base**0.4,
        intensity_w=intensity_w,
        length_u=feet / base**1.2 * FOOT,
        length_w=feet * FOOT,
        speed=speed,
        along_x=make("cos", direction),
        along_y=make("sin", direction),
        sample_time=sample_time,
        seed=seed,
    )


def white_noise(time: Any, channel: float, turbulence: Turbulence) -> Any:
    """Sampled white noise (1/s^0.5) at a time (s): its integral has the variance ``time``."""
    # Rounding may leave an exact multiple slightly too small; that must not delay the next draw.
    index = xp.floor(time / turbulence.sample_time + 1e-6)
    return normal(turbulence.seed, channel, index) / xp.sqrt(turbulence.sample_time)


@traceable
def dryden_rates(time: Any, states: Any, turbulence: Turbulence) -> Any:
    """Rates of the shaping filters' states, driven by white noise.

    With ``T = L / V`` the filters are ``sigma sqrt(2 T) / (1 + T s)`` for u and
    ``sigma sqrt(T) (1 + sqrt(3) T s) / (1 + T s)^2`` for v and w. The states are outputs of
    first-order lags: one for u, two in series for v and for w.

    Args:
        time: s.
        states: Shape (5,), 1/s^0.5.
        turbulence: Where it is calm, the states rest.
    """
    t = turbulence

    def blowing() -> Any:
        u, v1, v2, w1, w2 = states
        noises = [white_noise(time, channel, t) for channel in (20.0, 21.0, 22.0)]
        driven = [noises[0] - u, noises[1] - v1, v1 - v2, noises[2] - w1, w1 - w2]
        rate_u, rate_w = t.speed / t.length_u, t.speed / t.length_w
        return xp.array([rate_u, rate_u, rate_u, rate_w, rate_w]) * xp.array(driven)

    calm = (t.intensity_u == 0.0) & (t.intensity_w == 0.0)
    return branch(calm, lambda: 0.0 * states, blowing)


@traceable
def dryden_velocity(states: Any, turbulence: Turbulence) -> Any:
    """The turbulent velocity of the air (m/s, world), shape (3,), from the filters' states.

    ``(1 + sqrt(3) T s)`` after two lags is ``sqrt(3)`` times the first lag's output minus
    ``sqrt(3) - 1`` times the second's.
    """
    t = turbulence
    u, v1, v2, w1, w2 = states
    root_u, root_w = xp.sqrt(t.length_u / t.speed), xp.sqrt(t.length_w / t.speed)
    along = t.intensity_u * root_u * 2.0**0.5 * u
    across = t.intensity_u * root_u * (ROOT_3 * v1 - (ROOT_3 - 1.0) * v2)
    up = t.intensity_w * root_w * (ROOT_3 * w1 - (ROOT_3 - 1.0) * w2)
    cx, cy = t.along_x, t.along_y
    return xp.array([cx * along - cy * across, cy * along + cx * across, up])


def stationary_states(turbulence: Turbulence) -> Any:
    """A draw of the filters' initial states, shape (5,), from their stationary distribution.

    A lag ``T`` of unit noise has the variance ``1 / 2T``, a second one in series ``1 / 4T``, which
    is also their covariance.
    """
    t = turbulence
    u, v1, v2, w1, w2 = (normal(t.seed, channel, 0.0) for channel in range(25, 30))
    root_u, root_w = xp.sqrt(0.5 * t.speed / t.length_u), xp.sqrt(0.5 * t.speed / t.length_w)
    return xp.array(
        [
            *(root_u * u, root_u * v1, 0.5 * root_u * (v1 + v2)),
            *(root_w * w1, 0.5 * root_w * (w1 + w2)),
        ]
    )


# --- ground effect -----------------------------------------------------------------------------


class GroundEffect(NamedTuple):
    """The ground under the rotors."""

    rotor_radius: float = 0.0  # m; 0 for no ground effect
    height: float = 0.0  # m, z of the ground in the world


def ground_effect(above: Any, rotor_radius: Any) -> Any:
    """Ratio of a rotor's thrust near the ground to its thrust far away, at equal power.

    ``1 / (1 - (R / 4 h)^2)`` (Cheeseman and Bennett, at rest) at the height h (m, any shape), R the
    rotor's radius (m), 0 for no ground effect. Derived for single, level rotors from a source and
    its image and valid above half a radius; below, the value at half a radius, 4/3, is used.
    """
    lowest = xp.where(rotor_radius > 0.0, 0.5 * rotor_radius, 1.0)
    ratio = rotor_radius / (4.0 * xp.maximum(above, lowest))
    return 1.0 / (1.0 - ratio * ratio)


# --- combined ----------------------------------------------------------------------------------


class Air(NamedTuple):
    """The air around a vehicle."""

    wind: Vector3 = (0.0, 0.0, 0.0)  # m/s, world: velocity of the air
    drag: Drag = Drag()
    gust: Gust = Gust()
    turbulence: Turbulence = Turbulence()
    ground: GroundEffect = GroundEffect()


@traceable
def air_velocity(time: Any, states: Any, air: Air) -> Any:
    """Velocity of the air (m/s, world), shape (3,), at a time (s): wind, gust and turbulence.

    The turbulence's filters have `DRYDEN_STATES`.
    """
    gust = gust_profile(time, air.gust) * air.gust.velocity
    return air.wind + gust + dryden_velocity(states, air.turbulence)


HALF_WIDTH_RATE: Final = 0.094
"""Growth with depth of the radius at which a round jet has half its velocity (Pope, Table 5.1)."""

SPREADING: Final = HALF_WIDTH_RATE / sqrt(log(2.0))
"""Growth with depth of the radius at which it has 1/e of its velocity on the axis."""


class Wake(NamedTuple):
    """The wake of a vehicle that hovers."""

    weight: float  # N
    disc_area: float  # m^2, of all rotors together


class Downwash(NamedTuple):
    """The wakes' effect on a vehicle."""

    density: float = 1.225  # kg/m^3
    drag_area: float = 0.0  # m^2, drag coefficient times area


def wake_velocity(depth: Any, distance: Any, wake: Wake, density: float) -> Any:
    """Velocity of the air (m/s, downwards), shape (), 0 above the vehicle.

    Args:
        depth: Below the vehicle's center, m.
        distance: From the vertical through it, m.
        wake: The vehicle.
        density: Density of the air, kg/m^3.
    """
    width = xp.sqrt(wake.disc_area / pi) + SPREADING * xp.maximum(depth, 0.0)
    on_axis = xp.sqrt(2.0 * wake.weight / (pi * density)) / width
    share = distance / width
    return xp.where(depth > 0.0, on_axis * xp.exp(-share * share), 0.0)


def downwash_force(places: Any, number: Any, wakes: Any, downwash: Downwash) -> Any:
    """Force (N, along z of the world, not above 0) of all wakes on a vehicle, shape ().

    Args:
        places: Positions of all vehicles, m, shape (vehicles, 3).
        number: The vehicle, from 0.
        wakes: The `Wake` of each vehicle.
        downwash: The effect on the vehicle.
    """
    velocity: Any = 0.0
    for other, wake in enumerate(wakes):
        if other != number:
            x, y, depth = places[other] - places[number]
            distance = xp.sqrt(x * x + y * y)
            velocity = velocity + wake_velocity(depth, distance, wake, downwash.density)
    return 0.0 - 0.5 * downwash.density * downwash.drag_area * velocity * velocity
