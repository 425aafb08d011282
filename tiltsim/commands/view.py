"""``tiltsim view``: shows flights and recordings in the Rerun viewer."""

from __future__ import annotations

import argparse
from pathlib import Path

from tiltsim.commands.options import Subparsers
from tiltsim.commands.text import print_line, viewing


def add_parser(subparsers: Subparsers) -> None:
    """Declare the command."""
    description = """Show a flight in the Rerun viewer, or several in one recording for comparison.
    Recordings (.rrd) are opened unchanged."""
    summary = "show flights in the Rerun viewer"
    parser = subparsers.add_parser("view", help=summary, description=description)
    paths = "folders of results, flight.parquet files, or .rrd recordings"
    parser.add_argument("paths", nargs="+", type=Path, metavar="PATH", help=paths)
    add = parser.add_mutually_exclusive_group().add_argument
    recording = "save a recording instead of opening the viewer"
    add("--rerun", type=Path, metavar="FILE.rrd", help=recording)
    add("--connect", metavar="URL", help="show it in a viewer that is already open")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Open the viewer, or save a recording."""
    from tiltsim.errors import InputError
    from tiltsim.flight.reading import load_flight
    from tiltsim.system.files import prepare_file
    from tiltsim.views.titles import flight_names

    recordings = [path for path in arguments.paths if path.suffix.lower() == ".rrd"]
    if recordings:
        if len(recordings) < len(arguments.paths) or arguments.rerun or arguments.connect:
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

    if arguments.rerun is not None:
        prepare_file("--rerun", arguments.rerun, (".rrd",))
    flights = [load_flight(path) for path in arguments.paths]
    names = flight_names([flight.scenario for flight in flights], arguments.paths)
    if arguments.rerun is None:
        from tiltsim.views.rerun.viewer import view_flights

        view_flights(flights, arguments.connect, names)
        return 0
    from tiltsim.views.rerun.recording_file import save_recording

    save_recording(flights, arguments.rerun, names)
    print_line(f"recording written to {viewing(arguments.rerun)}")
    return 0
