"""``tiltsim concepts``: draws the pictures of docs/concepts.md."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final

from tiltsim.commands.progress import show_progress
from tiltsim.views import figures

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

    from tiltsim.flight.flight import Flight

DECOUPLER_FLIGHTS: Final = {
    "conventional": "ch04_tracking/setpoint#rho_065_conventional",
    "modified": "ch04_tracking/setpoint#rho_065_modified",
    "exact": "beyond/setpoint_exact_decoupler#rho_065",
}
"""Addresses of the flights that show the decouplers."""


def run(*, out: Path = Path("concepts")) -> int:
    """Draw the pictures of docs/concepts.md.

    They show the vehicle with its axes and signs, gaits, decouplers (flown), singular attitudes and
    their margin, red and blue gaits.

    Args:
        out (DIR): folder for the SVG files concepts_*.svg (default: concepts)
    """
    from tiltsim.system.files import prepare_folder

    prepare_folder(out)
    with show_progress(shown=True) as progress:
        for name, draw in drawings().items():
            progress.begin(f"drawing {name}")
            file = out / f"concepts_{name}.svg"
            figures.style.save(draw(), file)
            progress.print(f"figure written to {file}")
    return 0


def drawings() -> dict[str, Callable[[], Figure]]:
    """The pictures by their names, in the order of the page."""
    concepts = figures.concepts
    return {
        "vehicle": concepts.vehicle_figure,
        "gaits": concepts.gait_figure,
        "decouplers": lambda: concepts.decoupler_figure(fly_decouplers()),
        "attitudes": concepts.attitude_figure,
        "colors": concepts.color_figure,
    }


def fly_decouplers() -> dict[str, Flight]:
    """The flights that show the decouplers, by their names."""
    from tiltsim.scenario.loading import load_scenario
    from tiltsim.simulation.simulate import simulate_to_end

    return {name: simulate_to_end(load_scenario(at)) for name, at in DECOUPLER_FLIGHTS.items()}
