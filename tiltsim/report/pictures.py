"""The figures of the report, a few per chapter, drawn with `tiltsim.views.figures`."""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Final

from tiltsim.report.claim import Metrics
from tiltsim.report.flights import PLANTS, Plant, variant_for
from tiltsim.report.store import flight_key
from tiltsim_controllers.analysis.published_gaits import PATHS, PUBLISHED_GAITS
from tiltsim_controllers.vehicle.parameters import PRESETS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tiltsim.scenario.scenario import Scenario

_VEHICLE: Final = PRESETS["ar_drone_2"]


@dataclass(frozen=True)
class Picture(ABC):
    """A figure with its chapter and caption."""

    chapter: int
    name: str
    caption: str

    @abstractmethod
    def content(
        self,
        scenarios: Mapping[tuple[str, Plant], Scenario],
        metrics: Mapping[tuple[str, Plant], Metrics],
    ) -> str | None:
        """The data that the figure depends on, as text; None if its flights are missing."""

    @abstractmethod
    def figure(self, metrics: Mapping[tuple[str, Plant], Metrics]) -> Figure:
        """Draw the figure from the metrics of the flights."""


@dataclass(frozen=True, kw_only=True)
class AnalysisPicture(Picture):
    """A figure that needs no flight."""

    draw: Callable[[], Figure]

    def content(self, scenarios: object, metrics: object) -> str:
        """Nothing but the sources."""
        return ""

    def figure(self, metrics: object) -> Figure:
        """Draw the figure."""
        return self.draw()


@dataclass(frozen=True, kw_only=True)
class FlightPicture(Picture):
    """The page of one flight (`tiltsim.views.vehicle_views`)."""

    address: str
    plant: Plant = "mujoco"

    def content(
        self, scenarios: Mapping[tuple[str, Plant], Scenario], metrics: object
    ) -> str | None:
        """The scenario."""
        scenario = scenarios.get((self.address, self.plant))
        return None if scenario is None else flight_key(scenario) + scenario.title

    def figure(self, metrics: object) -> Figure:
        """Fly again, and draw."""
        from tiltsim.simulation.simulate import simulate
        from tiltsim.views.vehicle_views import flight_figure

        return flight_figure(simulate(variant_for(self.address, self.plant)))


@dataclass(frozen=True, kw_only=True)
class MetricsPicture(Picture):
    """A figure of the metrics of several flights."""

    addresses: tuple[str, ...]
    draw: Callable[[Mapping[tuple[str, Plant], Metrics]], Figure]

    def content(
        self, scenarios: object, metrics: Mapping[tuple[str, Plant], Metrics]
    ) -> str | None:
        """The metrics of the flights on both plants."""
        keys = [(address, plant) for address in self.addresses for plant in PLANTS]
        if not all(key in metrics for key in keys):
            return None
        return json.dumps([metrics[key] for key in keys], sort_keys=True)

    def figure(self, metrics: Mapping[tuple[str, Plant], Metrics]) -> Figure:
        """Draw the figure."""
        return self.draw(metrics)


_RHOS: Final = ("rho_065", "rho_0325", "rho_0", "rho_minus_0325", "rho_minus_065")
_LETTERS: Final = {"conventional": "A", "modified": "B"}
_PERIODS: Final = (1, 2, 3)
_SETPOINTS: Final = tuple(
    f"ch04_tracking/setpoint#{rho}_{decoupler}" for decoupler in _LETTERS for rho in _RHOS
)
_TROTS: Final = tuple(
    f"ch04_tracking/{reference}#{form}_t{period}_{decoupler}"
    for reference in ("line", "circle")
    for form in ("instant", "continuous")
    for period in _PERIODS
    for decoupler in _LETTERS
)
FIG_4: Final = {
    "A": ((3.35, -3.56), (0.0, 0.0), (-3.35, 3.56)),
    "B": ((-0.38, 0.17), (0.0, 0.0), (0.38, -0.17)),
}
"""The errors that ch. 4, Fig. 4, prints (m), for rho = 0.65, 0 and -0.65."""


def _setpoint_errors(metrics: Mapping[tuple[str, Plant], Metrics]) -> Figure:
    from tiltsim.views.figures.tracking_errors import SetpointErrors, setpoint_figure

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


def _trot_errors(metrics: Mapping[tuple[str, Plant], Metrics]) -> Figure:
    from tiltsim.views.figures.tracking_errors import PeriodErrors, period_figure

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
        for reference in ("line", "circle")
        for form in ("instant", "continuous")
    ]
    return period_figure(panels)


def _singular_surface() -> Figure:
    from tiltsim.views.figures.quadrotor_singularity import singularity_figure

    return singularity_figure(PRESETS["ar_drone_2_unrounded"])


def _determinant() -> Figure:
    from tiltsim.views.figures.determinant import determinant_figure

    return determinant_figure("equal", _VEHICLE)


def _gait_and_biased(key: str) -> Figure:
    from tiltsim.views.figures.gait import comparison_figure

    published = PUBLISHED_GAITS[key]
    assert published.biased is not None
    biased = f"biased, η = {published.bias:.0%}"
    return comparison_figure(
        [("as published", published.gait), (biased, published.biased)], _VEHICLE
    )


def _map(preset: str, *, examples: bool = False) -> Figure:
    from tiltsim.views.figures.two_color_map import map_figure

    return map_figure(PRESETS[preset], list(PATHS.items()) if examples else None)


def _attainable(key: str) -> Figure:
    from tiltsim.views.figures.attainable import attainable_figure

    return attainable_figure(PUBLISHED_GAITS[key].gait, _VEHICLE)


PICTURES: Final[tuple[Picture, ...]] = (
    FlightPicture(
        1,
        "gust",
        "Tiltrotor with the perfect gait in a gust of 1 m/s² along x (MuJoCo): it hovers level.",
        address="ch01_gust/hover#perfect_gait",
    ),
    AnalysisPicture(
        2,
        "singular-surface",
        "The determinant surface S(θ, φ) as published with its curve S = 0 through level attitude, "
        "and the exact determinant of the same matrix, which has no zero.",
        draw=_singular_surface,
    ),
    FlightPicture(
        2,
        "through-the-curve",
        "Yaw-position control with gains that satisfy the Routh-Hurwitz criterion: the flight from "
        "(0.5, 0.5, 0) crosses S = 0 and continues to the circle.",
        address="ch02_singular_zone/exact_law#stable_gains",
    ),
    AnalysisPicture(
        3,
        "determinant",
        "The determinant at level attitude for the five pairs with α₁ = α₃ (ch. 3, Figs. 2, 3 and "
        "10): surfaces, their zero curves with the triangle U, V, M, and sections.",
        draw=_determinant,
    ),
    FlightPicture(
        3,
        "over-actuated",
        "Over-actuated control from gait 1 (ch. 3, Figs. 24-27), in MuJoCo.",
        address="ch03_gaits/over_actuated#gait_1",
    ),
    MetricsPicture(
        4,
        "setpoint-errors",
        "Steady-state errors at the set point (ch. 4, Fig. 4): dots measured in MuJoCo, squares "
        "published. A is the conventional decoupler, B the modified one; 1 to 5 run from ρ = 0.65 "
        "to -0.65.",
        addresses=_SETPOINTS,
        draw=_setpoint_errors,
    ),
    MetricsPicture(
        4,
        "trot-errors",
        "Largest error after 20 s against the period of the trot (ch. 4, Figs. 8, 9, 13, 14).",
        addresses=_TROTS,
        draw=_trot_errors,
    ),
    FlightPicture(
        5,
        "walk",
        "The walk at 1/3 with a period of 1 s along the line, modified decoupler (MuJoCo).",
        address="ch05_gaits/line#walk_third_t1_modified",
    ),
    AnalysisPicture(
        6,
        "map",
        "The Two Color Map for the vehicle of ch. 3 and the examples E1 to E4 of ch. 8.",
        draw=partial(_map, "ar_drone_2", examples=True),
    ),
    AnalysisPicture(
        6,
        "red-and-biased",
        "Gait 3 (red) and its biased twin (ch. 6, Figs. 24, 25): the singular attitudes "
        "over a period. On red there are none.",
        draw=partial(_gait_and_biased, "ch06_gait_3"),
    ),
    AnalysisPicture(
        6,
        "blue-and-biased",
        "Gait 1 (blue) as printed and its biased twin (ch. 6, Figs. 20, 21). The curves of "
        "the printed gait result from the rounding of its angles: on the exact blue lines the "
        "matrix is singular at every attitude.",
        draw=partial(_gait_and_biased, "ch06_gait_1"),
    ),
    FlightPicture(
        7,
        "red-circle",
        "Gait 2 (red) on the circle, modified decoupler (MuJoCo).",
        address="ch07_robust_gaits/circle#gait_2",
    ),
    AnalysisPicture(
        8,
        "circle-and-biased",
        "Gait 2 of ch. 8, a circle on red, and its biased twin.",
        draw=partial(_gait_and_biased, "ch08_gait_2"),
    ),
    AnalysisPicture(
        9,
        "attainable",
        "Gait 2 of ch. 9: torques and thrust within the rotor limits at zero yaw torque.",
        draw=partial(_attainable, "ch09_gait_2"),
    ),
    FlightPicture(
        9,
        "ellipse",
        "The circle at 1.5 rad/s with gait 2: the vehicle flies an ellipse (MuJoCo).",
        address="ch09_input_limits/circle#omega_15",
    ),
    FlightPicture(
        10,
        "drift",
        "Two thousand seconds on the circle: no error, and diverging rotor speeds (MuJoCo).",
        address="ch10_state_drift/third_derivative#two_thousand_seconds",
    ),
    FlightPicture(
        11,
        "penguin",
        "The large swing: the error along y ends in a limit cycle (MuJoCo).",
        address="ch11_penguin/straight_line#large",
    ),
    AnalysisPicture(
        12,
        "map-luukkonen",
        "The Two Color Map for the vehicle of ch. 12.",
        draw=partial(_map, "luukkonen"),
    ),
)
"""All figures, in order."""
