"""``tiltsim new``: writes an MJCF vehicle and a scenario that flies it, to start from."""

import shlex
from pathlib import Path

from tiltsim.commands.text import print_line, write_text
from tiltsim.errors import InputError
from tiltsim.system.text import printable


def run(kind: str, file: Path | None = None, *, force: bool = False) -> int:
    """Write a commented MJCF file of a vehicle, and beside it a scenario that flies it at once.

    Change the places, axes, masses and coefficients in the MJCF file into your vehicle's.

    Note:
        kinds: quadrotor, hexarotor, octorotor; canted_hexarotor and omni_octorotor, which also push
        sideways; bicopter, tricopter, tiltrotor and tilt_hexarotor, whose rotors tilt

    Args:
        kind (KIND): one of the kinds below
        file (FILE): the MJCF file (default: KIND.xml); the scenario is FILE with the suffix .toml
        force: replace files that exist
    """
    from tiltsim.models.starters import STARTERS, starter_mjcf, starter_scenario
    from tiltsim.system.files import exists, prepare_file

    if kind not in STARTERS:
        raise InputError(f"KIND {printable(kind)!r}: unknown; choose {', '.join(STARTERS)}")
    mjcf = Path(f"{kind}.xml") if file is None else file
    prepare_file("FILE", mjcf, (".xml",))
    scenario = mjcf.with_suffix(".toml")
    prepare_file("FILE", scenario)
    for path in () if force else (mjcf, scenario):
        if exists(path):
            raise InputError(f"{path}: exists; --force replaces it")
    write_text(mjcf, starter_mjcf(kind))
    write_text(scenario, starter_scenario(kind, mjcf.name))
    print_line(f"vehicle written to {mjcf}, scenario to {scenario}")
    print_line(f"fly it:         tiltsim run {shlex.quote(str(scenario))}")
    print_line(f"its abilities:  tiltsim gait --mjcf {shlex.quote(str(mjcf))}")
    return 0
