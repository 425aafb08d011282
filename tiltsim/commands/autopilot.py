"""``tiltsim autopilot``: writes the files that a firmware needs to fly a vehicle."""

from pathlib import Path

from tiltsim.commands.options import Overrides, Silent, load_scenarios
from tiltsim.commands.text import print_line, write_text


def run(scenario: str, *, out: Path, overrides: Overrides = (), quiet: Silent = False) -> int:
    """Write parameters.parm and frame.lua for ArduPilot, from the vehicle and its outputs.

    tiltsim run then flies the scenario, as soon as the firmware runs beside it.

    Args:
        scenario (SCENARIO): a TOML file or library name with an [autopilot] table
        out (DIR): folder for the files
    """
    from tiltsim.plants.ardupilot_files import ardupilot_files
    from tiltsim.system.files import prepare_folder

    (loaded,) = load_scenarios([scenario], overrides, trust=False)
    files = ardupilot_files(loaded)
    prepare_folder(out)
    for name, text in files.items():
        write_text(out / name, text)
        if not quiet:
            print_line(f"{out / name} written")
    return 0
