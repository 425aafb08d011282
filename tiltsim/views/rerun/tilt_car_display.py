"""What the viewer shows for a tilt-car (ch. 10 and 11)."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from tiltsim.views.events import tilt_car_conditions
from tiltsim.views.rerun.display import (
    REFERENCE_WIDTH,
    Compared,
    Level,
    Panel,
    Series,
    VehicleDisplay,
    distance,
    error,
)
from tiltsim.views.rerun.palette import AMBER, GREEN, GREY, PINK, RED, SKY, dimmed

if TYPE_CHECKING:
    from tiltsim.closed_loop.assembly import Assembly
    from tiltsim.flight.flight import Flight
    from tiltsim_controllers.mathematics.scalar import Floats


def _squared_speed(rotor: int) -> Callable[[Flight], Floats]:
    return lambda flight: flight[f"rotor_speed_{rotor}"] ** 2


def _distance(flight: Flight) -> Floats:
    return distance(flight, "xy")


PANELS: Final = (
    Panel(
        "direction",
        "Direction of the thrusts and of the desired acceleration (rad)",
        7.0,
        (Compared("middle", "Direction of the thrusts (rad)", "direction"),),
    ),
    Panel(
        "inputs",
        "Rotor speeds squared (rad²/s²)",
        6.0,
        (Compared("split", "ω₁² - ω₂² (rad²/s²)", "input_split"),),
    ),
    Panel("discs", "Tilt and yaw (rad)", 5.0),
    Panel(
        "position_error",
        "Position error, reference minus actual (m)",
        6.0,
        (Compared("distance", "Distance from the reference (m)", _distance),),
    ),
)
"""The plots from top to bottom."""

LYAPUNOV_PANEL: Final = Panel("lyapunov", "Lyapunov candidate (m²/s²)", 4.5)


def panels(assembly: Assembly) -> tuple[Panel, ...]:
    """The plots of a flight."""
    return (*PANELS, LYAPUNOV_PANEL) if "lyapunov" in assembly.loop.units else PANELS


def tilt_car_series(assembly: Assembly) -> list[Series]:
    """The lines of the plots."""
    bound, reference = dimmed(AMBER), dimmed(PINK)
    series = [
        Series("direction/middle", "middle of the thrusts", AMBER, "direction", 2.5),
        Series("direction/upper", "upper bound", bound, "direction_upper", REFERENCE_WIDTH),
        Series("direction/lower", "lower bound", bound, "direction_lower", REFERENCE_WIDTH),
        Series("direction/desired", "desired acceleration", SKY, "direction_ref"),
        Series("inputs/square_1", "rotor 1", AMBER, _squared_speed(1)),
        Series("inputs/square_2", "rotor 2", SKY, _squared_speed(2)),
        Series("discs/alpha", "tilt", PINK, "alpha"),
        Series("discs/alpha_ref", "tilt ref", reference, "alpha_ref", REFERENCE_WIDTH),
        Series("discs/yaw", "yaw", GREEN, "yaw"),
        Series("position_error/x", "x", RED, error("x")),
        Series("position_error/y", "y", GREEN, error("y")),
    ]
    if "lyapunov" in assembly.loop.units:
        series.append(Series("lyapunov/candidate", "candidate", PINK, "lyapunov"))
    return series


def tilt_car_levels(_assembly: Assembly) -> list[Level]:
    """The minimum of the squared rotor speeds."""
    return [Level("inputs/minimum", "minimum", GREY, 0.0)]


TILT_CAR_DISPLAY: Final = VehicleDisplay(
    conditions=tilt_car_conditions,
    panels=panels,
    series=tilt_car_series,
    levels=tilt_car_levels,
    plane=None,
    eye=(0.0, -0.6, 6.5),
    up=(0.0, 1.0, 0.0),
    overview=True,
)
