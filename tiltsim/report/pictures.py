"""The figures of the report, a few per chapter, drawn with `tiltsim.views.figures`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Final, TypeAlias

from matplotlib.figure import Figure

from tiltsim.report.attraction_maps import GAITS, attraction_map
from tiltsim.report.claim import Metrics
from tiltsim.report.flights import PLANTS, Plant, variant_for
from tiltsim.simulation.simulate import simulate_to_end
from tiltsim.views.figures.attainable import attainable_figure
from tiltsim.views.figures.attraction import attraction_panels
from tiltsim.views.figures.determinant import determinant_figure
from tiltsim.views.figures.gait import comparison_figure
from tiltsim.views.figures.plot import plot
from tiltsim.views.figures.quadrotor_singularity import singularity_figure
from tiltsim.views.figures.tracking_errors import (
    PeriodErrors,
    SetpointErrors,
    period_figure,
    setpoint_figure,
)
from tiltsim.views.figures.two_color_map import map_figure
from tiltsim_controllers.analysis.published_gaits import PATHS, PUBLISHED_GAITS
from tiltsim_controllers.vehicle.parameters import PRESETS

FlightMetrics: TypeAlias = Mapping[tuple[str, Plant], Metrics]

_VEHICLE: Final = PRESETS["ar_drone_2"]


@dataclass(frozen=True)
class Picture:
    """A figure with its chapter and caption."""

    chapter: int
    name: str
    caption: str
    draw: Callable[[FlightMetrics], Figure]
    """From the metrics of the report's flights."""
    flights: tuple[tuple[str, Plant], ...] = ()
    """Flights that it shows; one without flights needs only analysis."""


def _flight_picture(chapter: int, name: str, caption: str, address: str) -> Picture:
    """The page of one flight in MuJoCo, which is flown again."""

    def draw(metrics: object) -> Figure:
        return plot(simulate_to_end(variant_for(address, "mujoco")))

    return Picture(chapter, name, caption, draw, ((address, "mujoco"),))


_RHOS: Final = ("rho_065", "rho_0325", "rho_0", "rho_minus_0325", "rho_minus_065")
_LETTERS: Final = {"conventional": "A", "modified": "B"}
_PANELS: Final = tuple(product(("line", "circle"), ("instant", "continuous")))
_PERIODS: Final = (1, 2, 3)
_SETPOINTS: Final = tuple(
    f"ch04_tracking/setpoint#{rho}_{decoupler}" for decoupler in _LETTERS for rho in _RHOS
)
_TROTS: Final = tuple(
    f"ch04_tracking/{reference}#{form}_t{period}_{decoupler}"
    for (reference, form), period, decoupler in product(_PANELS, _PERIODS, _LETTERS)
)
FIG_4: Final = {
    "A": ((3.35, -3.56), (0.0, 0.0), (-3.35, 3.56)),
    "B": ((-0.38, 0.17), (0.0, 0.0), (0.38, -0.17)),
}
"""The errors that ch. 4, Fig. 4, prints (m), for rho = 0.65, 0 and -0.65."""


def _setpoint_errors(metrics: FlightMetrics) -> Figure:
    families = []
    for decoupler, letter in _LETTERS.items():
        flown = [metrics[f"ch04_tracking/setpoint#{r}_{decoupler}", "mujoco"] for r in _RHOS]
        points = [
            (float(m["final_position_error_x"]), float(m["final_position_error_y"])) for m in flown
        ]
        names = [f"{letter}{number}" for number in range(1, 6)]
        families.append(
            SetpointErrors(f"{letter}: {decoupler}, MuJoCo", names, points, FIG_4[letter])
        )
    return setpoint_figure(families)


def _trot_errors(metrics: FlightMetrics) -> Figure:
    def series(reference: str, form: str, decoupler: str, plant: Plant) -> PeriodErrors:
        errors: list[float | None] = []
        for period in _PERIODS:
            address = f"ch04_tracking/{reference}#{form}_t{period}_{decoupler}"
            value = metrics[address, plant].get("sup_position_error_after_20s")
            errors.append(None if value is None else float(value))
        name = "MuJoCo" if plant == "mujoco" else "thesis plant"
        return PeriodErrors(f"{decoupler}, {name}", _PERIODS, errors)

    panels = [
        (
            f"{reference}, {form}",
            [series(reference, form, d, plant) for plant in reversed(PLANTS) for d in _LETTERS],
        )
        for reference, form in _PANELS
    ]
    return period_figure(panels)


def _gait_and_biased(key: str) -> Figure:
    published = PUBLISHED_GAITS[key]
    assert published.biased is not None
    biased = f"biased, η = {published.bias:.0%}"
    return comparison_figure(
        [("as published", published.gait), (biased, published.biased)], _VEHICLE
    )


PICTURES: Final[tuple[Picture, ...]] = (
    _flight_picture(
        1,
        "gust",
        "Tiltrotor with the perfect gait in a gust of 1 m/s² along x (MuJoCo): it hovers level.",
        "ch01_gust/hover#perfect_gait",
    ),
    Picture(
        2,
        "singular-surface",
        "The determinant surface S(θ, φ) as published with its curve S = 0 through level attitude, "
        "and the exact determinant of the same matrix, which has no zero.",
        lambda _: singularity_figure(PRESETS["ar_drone_2_unrounded"]),
    ),
    _flight_picture(
        2,
        "through-the-curve",
        "Yaw-position control with gains that satisfy the Routh-Hurwitz criterion: the flight from "
        "(0.5, 0.5, 0) crosses S = 0 and continues to the circle.",
        "ch02_singular_zone/exact_law#stable_gains",
    ),
    Picture(
        3,
        "determinant",
        "The determinant at level attitude for the five pairs with α₁ = α₃ (ch. 3, Figs. 2, 3 and "
        "10): surfaces, their zero curves with the triangle U, V, M, and sections.",
        lambda _: determinant_figure("equal", _VEHICLE),
    ),
    _flight_picture(
        3,
        "over-actuated",
        "Over-actuated control from gait 1 (ch. 3, Figs. 24-27), in MuJoCo.",
        "ch03_gaits/over_actuated#gait_1",
    ),
    Picture(
        4,
        "setpoint-errors",
        "Steady-state errors at the set point (ch. 4, Fig. 4): dots measured in MuJoCo, squares "
        "published. A is the conventional decoupler, B the modified one; 1 to 5 run from ρ = 0.65 "
        "to -0.65.",
        _setpoint_errors,
        tuple(product(_SETPOINTS, PLANTS)),
    ),
    Picture(
        4,
        "trot-errors",
        "Largest error after 20 s against the period of the trot (ch. 4, Figs. 8, 9, 13, 14), with "
        "the angular acceleration of the law's model: the crossed flights are lost in MuJoCo, and "
        "complete with the measured one.",
        _trot_errors,
        tuple(product(_TROTS, PLANTS)),
    ),
    _flight_picture(
        5,
        "walk",
        "The walk at 1/3 with a period of 1 s along the line, modified decoupler (MuJoCo).",
        "ch05_gaits/line#walk_third_t1_modified",
    ),
    Picture(
        6,
        "map",
        "The Two Color Map for the vehicle of ch. 3 and the examples E1 to E4 of ch. 8.",
        lambda _: map_figure(_VEHICLE, list(PATHS.items())),
    ),
    Picture(
        6,
        "red-and-biased",
        "Gait 3 (red) and its biased twin (ch. 6, Figs. 24, 25): the singular attitudes "
        "over a period. On red there are none.",
        lambda _: _gait_and_biased("ch06_gait_3"),
    ),
    Picture(
        6,
        "blue-and-biased",
        "Gait 1 (blue) as printed and its biased twin (ch. 6, Figs. 20, 21). The curves of "
        "the printed gait result from the rounding of its angles: on the exact blue lines the "
        "matrix is singular at every attitude.",
        lambda _: _gait_and_biased("ch06_gait_1"),
    ),
    _flight_picture(
        7,
        "red-circle",
        "Gait 2 (red) on the circle, modified decoupler (MuJoCo).",
        "ch07_robust_gaits/circle#gait_2",
    ),
    Picture(
        8,
        "circle-and-biased",
        "Gait 2 of ch. 8, a circle on red, and its biased twin.",
        lambda _: _gait_and_biased("ch08_gait_2"),
    ),
    Picture(
        8,
        "attraction",
        "Initial attitudes from which gaits of ch. 3 to 8 come back, on the thesis's equations, "
        "and the curves beyond which the thesis calls attitudes unacceptable. In the titles the "
        "shares of the acceptable and of the other attitudes that come back.",
        lambda _: attraction_panels({name: attraction_map(name) for name in GAITS}),
    ),
    Picture(
        9,
        "attainable",
        "Gait 2 of ch. 9: torques and thrust within the rotor limits at zero yaw torque.",
        lambda _: attainable_figure(PUBLISHED_GAITS["ch09_gait_2"].gait, _VEHICLE),
    ),
    _flight_picture(
        9,
        "ellipse",
        "The circle at 1.5 rad/s with gait 2: the vehicle flies an ellipse (MuJoCo).",
        "ch09_input_limits/circle#omega_15",
    ),
    _flight_picture(
        10,
        "drift",
        "Two thousand seconds on the circle: no error, and diverging rotor speeds (MuJoCo).",
        "ch10_state_drift/third_derivative#two_thousand_seconds",
    ),
    _flight_picture(
        11,
        "penguin",
        "The large swing: the error along y ends in a limit cycle (MuJoCo).",
        "ch11_penguin/straight_line#large",
    ),
    Picture(
        12,
        "map-luukkonen",
        "The Two Color Map for the vehicle of ch. 12.",
        lambda _: map_figure(PRESETS["luukkonen"], None),
    ),
)
"""All figures, in order."""
