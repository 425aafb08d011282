"""``tiltsim view``: shows flights and recordings in the Rerun viewer."""

from pathlib import Path

from tiltsim.commands.options import refuse_both
from tiltsim.commands.text import print_line, viewing


def run(paths: tuple[Path, ...], *, rerun: Path | None = None, connect: str | None = None) -> int:
    """Show a flight in the Rerun viewer, or several in one recording for comparison.

    Recordings (.rrd) are opened unchanged.

    Args:
        paths (PATH): folders of results, flight.parquet files, or .rrd recordings
        rerun (FILE.rrd): save a recording instead of opening the viewer
        connect (URL): show it in a viewer that is already open
    """
    from tiltsim.errors import InputError
    from tiltsim.flight.reading import load_flight
    from tiltsim.system.files import prepare_file
    from tiltsim.views.titles import flight_names

    refuse_both(rerun=rerun, connect=connect)
    recordings = [path for path in paths if path.suffix.lower() == ".rrd"]
    if recordings:
        if len(recordings) < len(paths) or rerun or connect:
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

        view_flights(flights, connect, names)
    else:
        from tiltsim.views.rerun.recording import save_recording

        save_recording(flights, rerun, names)
        print_line(f"recording written to {viewing(rerun)}")
    return 0
