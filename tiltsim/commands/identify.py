"""``tiltsim identify``: finds parameters of a vehicle in a log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from tiltsim.commands.declaring import Option
from tiltsim.commands.options import Json, Names, Overrides, PlotOptions, Trust, load_scenarios
from tiltsim.commands.text import aligned
from tiltsim.errors import InputError
from tiltsim.views import figures


def _noise(text: str) -> dict[str, float]:
    try:
        pairs = [part.split("=") for part in text.split(",")]
        return {name.strip(): float(value) for name, value in pairs}
    except ValueError:
        raise ValueError("write position=0.005,attitude=0.002") from None


def run(
    log: Path,
    *,
    scenario: str,
    free: Names,
    window: float = 0.3,
    noise: Annotated[Any, Option(read=_noise)] = None,
    chart: Annotated[Path | None, Option("--map")] = None,
    out: Path | None = None,
    overrides: Overrides = (),
    json: Json = False,
    trust: Trust = False,
    figure: PlotOptions,
) -> int:
    """Find parameters of a vehicle in a log of its flight, with their standard deviations.

    The rotor speeds and tilts of the log drive the model in windows, whose initial states are found
    as well.

    Args:
        log (LOG): a log or a flight: FILE.mcap, .ulg, .csv, .parquet, or a folder
        scenario (SCENARIO): the vehicle as assumed: a TOML file or a library name
        free (KEY,...): keys to find, such as vehicle.mass,vehicle.inertia
        window (S): length of a window, s (default: %(default)s)
        noise (NAME=SIGMA,...): standard deviations of position (m), velocity (m/s), attitude (rad)
            and body_rates (rad/s) (default: estimated from the log)
        chart (FILE): a map of the log's signals, see tiltsim import
        out (FILE): also write the scenario with the values found
    """
    figure.check()
    (loaded,) = load_scenarios([scenario], overrides, trust)
    from tiltsim.logs.identify import identify
    from tiltsim.logs.reading import read_log

    read = read_log(log, chart)
    found = identify(read, loaded, free, window=window, noise=noise)
    if out is not None:
        from tiltsim.scenario.loading import scenario_toml
        from tiltsim.system.files import prepare_file, replacing

        prepare_file("--out", out, (".toml",))
        if out.exists():
            raise InputError(f"--out {out}: exists; choose another file")
        text = scenario_toml(loaded.replace(found.overrides()))
        with replacing(out) as temporary:
            temporary.write_text(text, encoding="utf-8")

    rows = [
        (name, f"{value:.6g} ± {found.sigma[name]:.2g} {found.units[name]}")
        for name, value in found.values.items()
    ]
    low, high = found.chi2_band
    lines = [*aligned(rows), f"chi2 {found.chi2:.4g} ({low:.3f} to {high:.3f} for a true model)"]
    lines += [f"{found.windows} windows of {window:g} s", *found.warnings, *read.notes]
    figure.show(
        lambda: figures.logs.estimate_figure(found), found.report(), "\n".join(lines), json=json
    )
    return 0
