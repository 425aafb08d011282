"""Drawing of the report's pictures; drawings are stored like flights."""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Final

from matplotlib.figure import Figure
from PIL import Image

from tiltsim.report.flights import FlightRecord, Flights, ReportEntry
from tiltsim.report.pictures import PICTURES, FlightMetrics, Picture
from tiltsim.report.store import code_digest, flight_key, results, sources_digest, store
from tiltsim.scenario.scenario import Scenario
from tiltsim.views.figures.style import paper_style

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
    sources = [own / name for name in ("drawing.py", "pictures.py", "pictures.toml")]
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
