"""``tiltsim plot``: draws a flight, a comparison of several, or a sweep."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tiltsim.commands.declaring import Option
from tiltsim.commands.options import FigureOptions, Names, file_in, prepare_figure
from tiltsim.commands.text import print_line
from tiltsim.views import figures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tiltsim.logs.log import Log


def run(
    flights: tuple[Path, ...],
    *,
    metrics: Annotated[tuple[str, ...], Option("--metric")] = (),
    out: Path | None = None,
    panels: Names = (),
    figure: FigureOptions,
) -> int:
    """Draw a flight on one page, several in the same axes, logs beside flights, or a sweep.

    A sweep is drawn as lines, maps, distributions or boundaries, according to its axes or its
    [plot] table.

    Note:
        panels of a flight: position_error, altitude, margin, attitude, tilt_angles, rotor_speeds,
        path, attitude_plane; of a tilt-car: position_error, inputs, direction, direction_error,
        lyapunov, path, portrait; of several flights: position_error, margin, determinant,
        supervisor, attitude, path; of a sweep: its metrics. Every column or vector of a flight,
        such as vx or velocity, is also the name of a panel.

    Args:
        flights (FLIGHT): folder of results, flight.parquet, log (.mcap, .ulg, .csv) or folder of a
            sweep; several flights and logs are compared
        metrics (NAME): metric of a sweep to draw; repeatable
        out (FILE): PNG, SVG or PDF, or a folder (default: flight.png, flights.png or sweep.png
            beside the first flight)
        panels: the panels to draw, in this order
    """
    from tiltsim.errors import InputError
    from tiltsim.logs.log import is_log
    from tiltsim.sweeps.dataset import is_sweep_folder, load_results

    first, *others = flights
    sweep = next((path for path in flights if is_sweep_folder(path)), None)
    if sweep is not None and others:
        raise InputError(
            f"{sweep}: a sweep cannot be drawn together with others; remove the other paths"
        )
    if metrics and sweep is None:
        raise InputError(f"--metric {metrics[0]}: {first} is not the folder of a sweep")
    logs: list[Log] = []
    if sweep is not None:
        results = load_results(sweep)
    elif any(is_log(path) for path in flights):
        from tiltsim.logs.reading import read_log

        if panels:
            raise InputError("--panels: not for logs, which are drawn whole")
        logs = [read_log(path) for path in flights]
    else:
        from tiltsim.flight.reading import load_flight
        from tiltsim.views.titles import flight_names

        loaded = [load_flight(path) for path in flights]
        names = flight_names([flight.scenario for flight in loaded], flights) if others else [""]
        texts = {name: name.replace("_", " ") for name in names if name} | dict(figure.labels)

    def draw() -> Figure:
        if sweep is not None:
            return figures.sweep.sweep_figure(results, (*metrics, *panels))
        if logs:
            shown = [path.name for path in flights]
            return figures.logs.logs_figure(logs, shown, figure.title)
        drawn = figures.plot.draw_flights
        return drawn(loaded, names, texts, panels=panels, title=figure.title)

    file = file_in(out, first, "sweep.png" if sweep else "flights.png" if others else "flight.png")
    prepare_figure("--out", file)
    figure.save(draw, file, is_named=sweep is None and not logs)
    print_line(f"figure written to {file}")
    return 0
