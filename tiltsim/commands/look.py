"""``tiltsim view``, ``plot`` and ``video``: flights on the screen, on paper and as a film."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from tiltsim.commands.declaring import Option
from tiltsim.commands.options import (
    FigureOptions,
    Names,
    Silent,
    file_in,
    prepare_figure,
    refuse_both,
)
from tiltsim.commands.text import print_line, show_progress, viewing
from tiltsim.views import figures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tiltsim.logs.log import Log


def run_view(
    paths: tuple[Path, ...],
    *,
    rerun: Path | None = None,
    connect: str | None = None,
    vehicle: str = "",
) -> int:
    """Show a flight in the Rerun viewer, or several in one recording for comparison.

    Recordings (.rrd) are opened unchanged.

    Args:
        paths (PATH): folders of results, flight.parquet files, or .rrd recordings
        rerun (FILE.rrd): save a recording instead of opening the viewer
        connect (URL): show it in a viewer that is already open
        vehicle (NAME): the only one to show of flights with several (default: all)
    """
    from tiltsim.errors import InputError
    from tiltsim.flight.reading import load_flight
    from tiltsim.system.files import prepare_file
    from tiltsim.views.titles import flight_names

    refuse_both(rerun=rerun, connect=connect)
    recordings = [path for path in paths if path.suffix.lower() == ".rrd"]
    if recordings:
        if len(recordings) < len(paths) or rerun or connect or vehicle:
            raise InputError(
                f"{recordings[0]}: a recording can only be opened; to compare, save or connect, "
                "give the folders of the flights"
            )
        for path in recordings:
            if not path.is_file():
                raise InputError(f"{path}: no such file")
        from tiltsim.views.rerun.viewer import view_recordings

        view_recordings(recordings)
        return 0
    if rerun is not None:
        prepare_file("--rerun", rerun, (".rrd",))
    flights = [load_flight(path) for path in paths]
    names = flight_names([flight.scenario for flight in flights], paths)
    if rerun is None:
        from tiltsim.views.rerun.viewer import view_flights

        view_flights(flights, connect, names, vehicle)
    else:
        from tiltsim.views.rerun.recording import save_recording

        save_recording(flights, rerun, names, vehicle)
        print_line(f"recording written to {viewing(rerun)}")
    return 0


def run_plot(
    flights: tuple[Path, ...],
    *,
    metrics: Annotated[tuple[str, ...], Option("--metric")] = (),
    out: Path | None = None,
    panels: Names = (),
    vehicle: str = "",
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
        vehicle (NAME): the only one to draw of flights with several (default: all)
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
    if vehicle and (sweep is not None or any(map(is_log, flights))):
        raise InputError(f"--vehicle {vehicle}: for flights alone, not for sweeps and logs")
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
        return drawn(loaded, names, texts, panels=panels, title=figure.title, vehicle=vehicle)

    file = file_in(out, first, "sweep.png" if sweep else "flights.png" if others else "flight.png")
    prepare_figure("--out", file)
    figure.save(draw, file, is_named=sweep is None and not logs)
    print_line(f"figure written to {file}")
    return 0


def _numbers(separator: str, kind: type[int] | type[float], example: str) -> Callable[[str], Any]:
    """The reader of an option that is several numbers."""

    def read(text: str) -> list[float]:
        try:
            return [kind(part) for part in text.lower().split(separator)]
        except ValueError:
            raise ValueError(f"must be numbers, such as {example}") from None

    return read


@dataclass(frozen=True, kw_only=True)
class Recording:
    """Size, pace and point of view, the arguments of `tiltsim.Flight.video`.

    Args:
        quality: draft: 640x360, 15 frames per second, jagged edges; standard (default): 640x360,
            25; high: 1280x720, 30, with shadows
        size (WxH): pixels, in place of the quality's
        fps (N): frames per second, in place of the quality's
        speed (X): times real time (default 1)
        start (S): where the video begins in the flight, s (default 0)
        end (S): where it ends, s (default: the end of the flight)
        camera (DISTANCE,AZIMUTH,ELEVATION): where the camera is: vehicle radii, degrees, degrees
            (default 7.5,130,-24 for rotorcraft)
    """

    quality: Literal["draft", "standard", "high"] = "standard"
    size: Annotated[Any, Option(read=_numbers("x", int, "1280x720"))] = None
    fps: int | None = None
    speed: float = 1.0
    start: float = 0.0
    end: float | None = None
    camera: Annotated[Any, Option(read=_numbers(",", float, "7.5,130,-24"))] = None


def run_video(
    flight: Path, *, out: Path | None = None, quiet: Silent = False, recording: Recording
) -> int:
    """Render a flight with MuJoCo, the camera following the vehicle; works without a screen.

    The inset shows the roll-pitch plane.

    Args:
        flight (FLIGHT): a folder of results, or a flight.parquet
        out (FILE): FILE.mp4 or FILE.gif, or a folder (default: flight.mp4 beside the flight)
    """
    from tiltsim.flight.reading import load_flight
    from tiltsim.views.video.making import video_format

    with show_progress(shown=not quiet) as progress:
        progress.begin("reading the flight")
        flown, file = load_flight(flight), file_in(out, flight, "flight.mp4")
        video = video_format(flown, file, vars(recording), prefix="--")
        from tiltsim.views.video.rendering import frame_times, write_video

        progress.begin("frames", len(frame_times(flown, video)))
        write_video(flown, file, video, progress.move)
    if not quiet:
        print_line(f"video written to {file}")
    return 0
