"""The figures of the report, a few per chapter, drawn with `tiltsim.views.figures` and stored."""

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from itertools import product
from pathlib import Path
from typing import Any, Final, TypeAlias

from matplotlib.figure import Figure
from PIL import Image

from tiltsim.linear.attraction import Attraction, attraction
from tiltsim.report.claim import Metrics
from tiltsim.report.flights import (
    PLANTS,
    FlightRecord,
    Flights,
    Plant,
    ReportEntry,
    code_digest,
    flight_key,
    results,
    sources_digest,
    store,
    variant_for,
)
from tiltsim.scenario.library import read_toml
from tiltsim.scenario.loading import load_scenario
from tiltsim.scenario.scenario import Scenario
from tiltsim.simulation.simulate import simulate_to_end
from tiltsim.views.figures.comparisons import period_figure, setpoint_figure
from tiltsim.views.figures.gaits import comparison_figure, map_figure
from tiltsim.views.figures.plot import plot
from tiltsim.views.figures.stability import attraction_panels
from tiltsim.views.figures.style import paper_style
from tiltsim.views.figures.vehicles import attainable_figure, determinant_figure, singularity_figure
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
    draw: Callable[[FlightMetrics], Figure]  # from the metrics of the report's flights
    flights: tuple[tuple[str, Plant], ...] = ()
    """Flights that it shows; one without flights needs only analysis."""


_RHOS: Final = ("rho_065", "rho_0325", "rho_0", "rho_minus_0325", "rho_minus_065")
_LETTERS: Final = {"conventional": "A", "modified": "B"}
_PANELS: Final = tuple(product(("line", "circle"), ("instant", "continuous")))
_PERIODS: Final = (1, 2, 3)
_SETPOINTS: Final = tuple(
    f"ch04_tracking/setpoint#{rho}_{decoupler}" for decoupler in _LETTERS for rho in _RHOS
)


def _trot(reference: str, form: str, period: int, decoupler: str) -> str:
    return f"ch04_tracking/{reference}#{form}_t{period}_{decoupler}"


_TROTS: Final = tuple(
    _trot(reference, form, period, decoupler)
    for (reference, form), period, decoupler in product(_PANELS, _PERIODS, _LETTERS)
)
FIG_4: Final = {
    "A": ((3.35, -3.56), (0.0, 0.0), (-3.35, 3.56)),
    "B": ((-0.38, 0.17), (0.0, 0.0), (0.38, -0.17)),
}
"""The errors that ch. 4, Fig. 4, prints (m), for rho = 0.65, 0 and -0.65."""


def setpoint_errors(metrics: FlightMetrics) -> Figure:
    """Ch. 4, Fig. 4."""

    def error(address: str) -> tuple[float, float]:
        flown = metrics[address, "mujoco"]
        return float(flown["final_position_error_x"]), float(flown["final_position_error_y"])

    families = {}
    for decoupler, letter in _LETTERS.items():
        addresses = enumerate((a for a in _SETPOINTS if a.endswith(decoupler)), start=1)
        points = {f"{letter}{number}": error(address) for number, address in addresses}
        families[f"{letter}: {decoupler}, MuJoCo"] = points, FIG_4[letter]
    return setpoint_figure(families)


def trot_errors(metrics: FlightMetrics) -> Figure:
    """Ch. 4, Figs. 8, 9, 13, 14."""

    def error(address: str, plant: Plant) -> float | None:
        value = metrics[address, plant].get("sup_position_error_after_20s")
        return None if value is None else float(value)

    names = {"mujoco": "MuJoCo", "thesis": "thesis plant"}
    return period_figure(
        {
            f"{reference}, {form}": {
                f"{decoupler}, {names[plant]}": {
                    period: error(_trot(reference, form, period, decoupler), plant)
                    for period in _PERIODS
                }
                for plant, decoupler in product(reversed(PLANTS), _LETTERS)
            }
            for reference, form in _PANELS
        }
    )


def gait_and_biased(key: str) -> Figure:
    """A published gait beside its biased twin."""
    published = PUBLISHED_GAITS[key]
    assert published.biased is not None
    biased = f"biased, η = {published.bias:.0%}"
    return comparison_figure(
        [("as published", published.gait), (biased, published.biased)], _VEHICLE
    )


GAITS: Final[dict[str, tuple[str, dict[str, Any]]]] = {
    "ch. 3, gait 1": ("ch03_gaits/stabilization#gait_1", {}),
    "ch. 4, fixed at 0.65": ("ch04_tracking/setpoint#rho_065_modified", {}),
    "ch. 4, trot to 0.65, T = 2 s": (
        "ch04_tracking/line#continuous_t2_modified",
        {"reference.type": "setpoint"},
    ),
    "ch. 5, walk at 1/3, T = 1 s": ("ch05_gaits/line#walk_third_t1_modified", {}),
    "ch. 6, gait 3, red": ("ch06_two_color/stabilization#gait_3", {}),
    "ch. 7, gait 2, red": ("ch07_robust_gaits/circle#gait_2", {}),
    "ch. 8, E1": ("ch08_generalized_map/stabilization#E1", {}),
}
"""Scenarios with overrides, by their names for readers."""

SETTLED: Final[dict[str, Any]] = {
    "simulation.plant": "thesis",
    "simulation.engine": "native",
    "simulation.duration": 16.0,  # the altitude decays as exp(-0.2 t)
}


def attraction_map(name: str, coarse: int = 10, refinements: int = 1) -> Attraction:
    """The map of one of `GAITS`; see `tiltsim.linear.attraction.attraction`."""
    address, overrides = GAITS[name]
    scenario = load_scenario(address, SETTLED | overrides)
    return attraction(scenario, coarse=coarse, refinements=refinements)


_OF_FLIGHTS: Final = {
    "setpoint_errors": (setpoint_errors, tuple(product(_SETPOINTS, PLANTS))),
    "trot_errors": (trot_errors, tuple(product(_TROTS, PLANTS))),
}
"""Functions of metrics, with the flights whose metrics they need."""

_OF_ANALYSIS: Final[dict[str, Callable[..., Figure]]] = {
    "singular_surface": lambda: singularity_figure(PRESETS["ar_drone_2_unrounded"]),
    "determinants": lambda: determinant_figure("equal", _VEHICLE),
    "two_color_map": lambda name: map_figure(
        PRESETS[name], [*PATHS.items()] if name == "ar_drone_2" else None
    ),
    "gait_and_biased": gait_and_biased,
    "attraction_maps": lambda: attraction_panels({name: attraction_map(name) for name in GAITS}),
    "attainable": lambda: attainable_figure(PUBLISHED_GAITS["ch09_gait_2"].gait, _VEHICLE),
}
"""Functions of the ``args`` of a picture."""


def _picture(name: str, chapter: int, caption: str, **how: Any) -> Picture:
    if "flight" in how:
        flight = how["flight"], PLANTS[1]
        return Picture(
            chapter, name, caption, lambda _: plot(simulate_to_end(variant_for(*flight))), (flight,)
        )
    if how["draw"] in _OF_FLIGHTS:
        return Picture(chapter, name, caption, *_OF_FLIGHTS[how["draw"]])
    draw = partial(_OF_ANALYSIS[how["draw"]], *how.get("args", ()))
    return Picture(chapter, name, caption, lambda _: draw())


PICTURES: Final[tuple[Picture, ...]] = tuple(
    _picture(name, **table)
    for name, table in read_toml(Path(__file__).parent / "pictures.toml").items()
)
"""All figures, in order."""


DPI: Final = 144
SHOWN_DPI: Final = 108
COLORS: Final = 256


@dataclass(frozen=True)
class Drawing:
    """A picture as PNG."""

    picture: Picture
    png: bytes

    @property
    def width(self) -> int:
        """As shown, pixels; drawn at a higher resolution, for dense screens and print."""
        return self._shown(16)

    @property
    def height(self) -> int:
        """As shown, pixels."""
        return self._shown(20)

    def _shown(self, offset: int) -> int:
        return round(int.from_bytes(self.png[offset : offset + 4], "big") * SHOWN_DPI / DPI)


def draw_all(
    entries: list[ReportEntry],
    flights: Flights,
    folder: Path,
    jobs: int,
    progress: Callable[[int, int], None],
    *,
    whole: bool,
) -> list[Drawing]:
    """Draw the pictures whose flights are available; drawings are stored in the folder.

    Args:
        entries, flights: The scenarios and their records.
        folder: Where drawings are stored.
        jobs: Processes.
        progress: Called with the number of drawn figures and their total.
        whole: Whether to include pictures that need no flight.

    Raises:
        InputError: If a figure cannot be drawn or a process dies.
    """
    own = Path(__file__).parent
    folders = own.parent / "views" / "figures", own.parent / "linear"
    sources = [own / name for name in ("pictures.py", "pictures.toml")]
    sources += [file for folder in folders for file in folder.glob("*.py")]
    style = sources_digest(sources, code_digest().hex())
    scenarios = {
        (entry.address, plant): scenario
        for entry in entries
        for plant, scenario in entry.plants.items()
        if isinstance(scenario, Scenario)
    }
    metrics = {key: r.metrics for key, r in flights.items() if isinstance(r, FlightRecord)}
    files: dict[str, Path] = {}
    for picture in PICTURES:
        if (picture.flights or whole) and all(flight in scenarios for flight in picture.flights):
            shown = [scenarios[flight] for flight in picture.flights]
            content = [picture.name, *(flight_key(one) + one.title for one in shown)]
            digest = hashlib.sha256(style + "".join(content).encode()).hexdigest()
            files[picture.name] = folder / f"{digest[:24]}.png"
    steps = {
        picture.name: sum(scenarios[one].simulation.steps for one in picture.flights)
        for picture in PICTURES
        if picture.name in files
    }
    # Long flights first, so that no process ends up alone with one of them.
    by_length = sorted(files.items(), key=lambda item: -steps[item[0]])
    missing = [(name, file) for name, file in by_length if not file.is_file()]
    progress(0, len(missing))
    work = partial(_draw_one, metrics=metrics)
    drawn = results(work, missing, jobs, lambda task: f"figure {task[0]}")
    for done, _ in enumerate(drawn, start=1):
        progress(done, len(missing))
    return [
        Drawing(picture, files[picture.name].read_bytes())
        for picture in PICTURES
        if picture.name in files
    ]


def _draw_one(task: tuple[str, Path], metrics: FlightMetrics) -> None:
    name, file = task
    picture = next(candidate for candidate in PICTURES if candidate.name == name)
    store(file, png(picture.draw(metrics)))


def png(figure: Figure) -> bytes:
    """A figure as PNG, equal for equal figures.

    A palette of 256 colors makes the page a third as large without a visible difference.
    """
    drawn, packed = BytesIO(), BytesIO()
    with paper_style():
        figure.savefig(drawn, format="png", dpi=DPI)
    with Image.open(drawn) as image:
        # Other methods spend the palette on large areas and shift the hue of thin lines.
        method, dither = Image.Quantize.MAXCOVERAGE, Image.Dither.NONE
        few = image.convert("RGB").quantize(COLORS, method, dither=dither)
    few.save(packed, format="PNG", optimize=True)
    return packed.getvalue()
