"""What a tilt-car is plotted by over time (ch. 10 and 11)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from tiltsim.views.rerun import palette
from tiltsim.views.rerun.series import LIMIT_WIDTH, REFERENCE_WIDTH, Panel, Series
from tiltsim_controllers.mathematics.scalar import Floats

if TYPE_CHECKING:
    from tiltsim.flight.flight import Flight
    from tiltsim.scenario.scenario import Scenario

CAR_PANELS: Final = (
    Panel(
        "direction",
        "Direction of the thrusts, and of the acceleration wanted (rad)",
        7.0,
        (("middle", "Direction of the thrusts (rad)"),),
    ),
    Panel("inputs", "Rotor speeds squared (rad²/s²)", 6.0, (("split", "ω₁² - ω₂² (rad²/s²)"),)),
    Panel("discs", "Tilt and yaw (rad)", 5.0, ()),
    Panel(
        "position_error",
        "Position error, reference minus actual (m)",
        6.0,
        (("distance", "Distance from the reference (m)"),),
    ),
)
"""The plots of a tilt-car, from top to bottom."""

LYAPUNOV_PANEL: Final = Panel("lyapunov", "Lyapunov candidate (m²/s²)", 4.5, ())

_COLORS: Final = {1: palette.AMBER, 2: palette.SKY}


def has_candidate(scenario: Scenario) -> bool:
    """Whether flights of a scenario have a Lyapunov candidate."""
    from tiltsim.laws.assembling import loop_of

    return "lyapunov" in loop_of(scenario).units


def car_panels(scenario: Scenario) -> tuple[Panel, ...]:
    """The plots of a scenario's flights."""
    return (*CAR_PANELS, LYAPUNOV_PANEL) if has_candidate(scenario) else CAR_PANELS


def car_measured_series(scenario: Scenario) -> list[Series]:
    """The series of every sample that a flight of this scenario has."""
    series = [
        Series("direction/middle", "middle of the thrusts", palette.AMBER, 2.5),
        Series("direction/upper", "upper bound", palette.dimmed(palette.AMBER), REFERENCE_WIDTH),
        Series("direction/lower", "lower bound", palette.dimmed(palette.AMBER), REFERENCE_WIDTH),
        Series("direction/wanted", "acceleration wanted", palette.SKY),
    ]
    for rotor, color in _COLORS.items():
        series.append(Series(f"inputs/square_{rotor}", f"rotor {rotor}", color))
    series.append(Series("discs/alpha", "tilt", palette.PINK))
    series.append(
        Series("discs/alpha_ref", "tilt ref", palette.dimmed(palette.PINK), REFERENCE_WIDTH)
    )
    series.append(Series("discs/yaw", "yaw", palette.GREEN))
    for axis, color in {"x": palette.RED, "y": palette.GREEN}.items():
        series.append(Series(f"position_error/{axis}", axis, color))
    if has_candidate(scenario):
        series.append(Series("lyapunov/candidate", "candidate", palette.PINK))
    return series


def car_limit_series(_scenario: Scenario) -> list[tuple[Series, float]]:
    """Level lines, with their values: thrusts cannot pull."""
    return [(Series("inputs/least", "least", palette.GREY, LIMIT_WIDTH), 0.0)]


def car_series_values(flight: Flight) -> dict[str, Floats]:
    """Every series of a flight by entity, those for comparison included."""
    columns = flight.columns
    values = {
        "direction/middle": columns["direction"],
        "direction/upper": columns["direction_upper"],
        "direction/lower": columns["direction_lower"],
        "direction/wanted": columns["direction_ref"],
        "inputs/split": columns["input_split"],
        **{f"discs/{name}": columns[name] for name in ("alpha", "alpha_ref", "yaw")},
        **{f"inputs/square_{rotor}": columns[f"rotor_speed_{rotor}"] ** 2 for rotor in _COLORS},
    }
    errors = {axis: columns[f"{axis}_ref"] - columns[axis] for axis in ("x", "y")}
    values |= {f"position_error/{axis}": error for axis, error in errors.items()}
    values["position_error/distance"] = np.hypot(errors["x"], errors["y"])
    if "lyapunov" in columns:
        values["lyapunov/candidate"] = columns["lyapunov"]
    return values
