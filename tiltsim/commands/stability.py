"""``tiltsim stability`` and ``attraction``: whether, and from how far, a flight comes back."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from math import degrees, isfinite
from typing import TYPE_CHECKING, Annotated, Any, Final

from tiltsim.commands.declaring import Option
from tiltsim.commands.options import Json, Overrides, PlotOptions, Quiet, Trust, load_scenarios
from tiltsim.commands.text import Columns, Progress, aligned, number, show_progress, table
from tiltsim.errors import InputError
from tiltsim.linear import COARSE, REFINEMENTS
from tiltsim.views import figures

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from tiltsim.linear.attraction import Attraction
    from tiltsim.linear.linearization import Linearization
    from tiltsim.linear.stability import Point, Stability
    from tiltsim.scenario.scenario import Scenario

SHORT_KEYS: Final = {"period": "gait.period", "amplitude": "gait.amplitude"}
POINTS: Final = 16
MOST_POINTS: Final = 1000


def _limit(value: float, form: str, without: str = "any") -> str:
    """A number, or the words for one without limit."""
    return number(value, form) if isfinite(value) else without


MARGINS: Final[Columns] = {
    "broken at": (lambda margin: margin.place, ""),
    "gain": (lambda m: f"{number(m.gain[0], '.3g')} to {_limit(m.gain[1], '.4g')}", ""),
    "phase (deg)": (lambda m: _limit(degrees(m.phase), ".1f", "any: no crossover"), ""),
    "at (rad/s)": (lambda m: m.frequency if isfinite(m.frequency) else None, ".4g"),
    "delay (s)": (lambda margin: _limit(margin.delay, ".4g"), ""),
    "disk": (lambda margin: margin.disk, ".3f"),
    "any gain, phase": (
        lambda m: f"x {_limit(m.disk_gain, '.3g')}, {number(degrees(m.disk_phase), '.1f')} deg",
        "",
    ),
}

MODES: Final[Columns] = {
    "mode": (lambda mode: mode.name, ""),
    "frequency (rad/s)": (lambda mode: mode.frequency, ".5g"),
    "damping": (lambda mode: mode.damping, ".4f"),
    "count": (lambda mode: mode.count, "d"),
    "states": (lambda mode: ", ".join([*mode.states[:6], *["..."] * (len(mode.states) > 6)]), ""),
}


def run_stability(
    scenario: str,
    more: tuple[str, ...] = (),
    *,
    sweep: str | None = None,
    margins: bool = False,
    overrides: Overrides = (),
    json: Json = False,
    quiet: Quiet = False,
    trust: Trust = False,
    figure: PlotOptions,
) -> int:
    """Print the poles of a scenario's rest point, or the Floquet multipliers of its periodic orbit.

    Each mode is listed with the states that take part in it: controller, gait, servos, rotors,
    sampling and latency included, on the plant of the scenario. From Python, tiltsim.linearize
    gives the matrices of the linear system.

    Args:
        scenario (SCENARIO): a TOML file or a library name
        more (SCENARIO): further ones, with --sweep
        sweep (KEY[=FROM:TO[:POINTS]]): how the largest multiplier moves with a number: period,
            amplitude or any key; default: from half to twice its value at 16 points, spaced evenly
            by ratio
        margins: at rest: gain, phase, delay and disk margins of the loop broken at one place
    """
    scenarios = load_scenarios([scenario, *more], overrides, trust)
    if sweep is not None and margins:
        raise InputError("--margins: not with --sweep, which has many points")
    if sweep is not None:
        return _run_sweep(sweep, scenarios, figure, quiet=quiet, json=json)
    if more:
        raise InputError(f"stability: {len(scenarios)} scenarios need --sweep KEY")

    from tiltsim.linear.stability import stability

    with show_progress(shown=not quiet) as progress:
        progress.begin("search for the state that returns, flights so far")
        found = stability(scenarios[0], progress=progress.move)
    report, text = found.report(), stability_text(found)
    system: Linearization | None = None
    if margins:
        from tiltsim.linear.margins import loop_for_margins, margins_of

        if found.multipliers is not None:
            raise InputError(
                f"--margins: {scenarios[0].address} is periodic; margins need a rest point"
            )
        system = loop_for_margins(scenarios[0])
        measured = margins_of(system)
        report["margins"] = [margin.report() for margin in measured]
        text = f"{text}\n\n{table(MARGINS, measured)}"

    def draw() -> Figure:
        drawn = figures.stability
        return drawn.stability_figure(found) if system is None else drawn.loop_figure(system)

    figure.show(draw, report, text, json=json)
    return 0


def parse_sweep(text: str, scenarios: Sequence[Scenario]) -> tuple[str, list[float]]:
    """The key and the values of ``--sweep``."""
    from tiltsim.scenario.documents import value_at

    name, _, span = text.partition("=")
    key = SHORT_KEYS.get(name, name)
    parts = span.split(":") if span else []
    try:
        points = int(parts[2]) if len(parts) == 3 else POINTS
        first, last = (float(part) for part in parts[:2]) if parts else (0.0, 0.0)
    except ValueError:
        raise InputError(f"--sweep {text}: write KEY=FROM:TO or KEY=FROM:TO:POINTS") from None
    if not parts:
        value = value_at(scenarios[0].model_dump(), key)
        if not isinstance(value, float) or value == 0.0:
            raise InputError(
                f"--sweep {text}: {key} has no value to start from; write {name}=FROM:TO"
            )
        first, last = 0.5 * value, 2.0 * value
    differ = isfinite(first) and isfinite(last) and first != last
    if len(parts) not in {0, 2, 3} or not 2 <= points <= MOST_POINTS or not differ:
        raise InputError(
            f"--sweep {text}: write KEY=FROM:TO, two finite numbers, with 2 to {MOST_POINTS} "
            ":POINTS"
        )
    shares = [index / (points - 1) for index in range(points)]
    if first > 0.0 and last > 0.0:
        return key, [first * (last / first) ** share for share in shares]
    return key, [first + (last - first) * share for share in shares]


def _run_sweep(
    text: str, scenarios: Sequence[Scenario], figure: PlotOptions, *, quiet: bool, json: bool
) -> int:
    """Sweep, draw, print."""
    from tiltsim.linear.stability import crossings, sweep_stability

    key, values = parse_sweep(text, scenarios)
    sweeps: dict[str, list[Point]] = {}
    with show_progress(shown=not quiet) as progress:
        found = itertools.count(1)
        progress.begin("points", len(scenarios) * len(values))
        for one in scenarios:
            sweeps[one.address] = sweep_stability(
                one, key, values, lambda _point: progress.move(next(found))
            )
    report = [
        {
            "scenario": address,
            "key": key,
            "points": [point.report() for point in points],
            "crossings": [crossing.report() for crossing in crossings(points)],
        }
        for address, points in sweeps.items()
    ]

    lines = "\n\n".join(_sweep_text(key, *item) for item in sweeps.items())
    figure.show(lambda: figures.stability.sweep_figure(key, sweeps), report, lines, json=json)
    return 0


def _sweep_text(key: str, address: str, points: Sequence[Point]) -> str:
    from tiltsim.linear.stability import crossings

    rests = any(point.found is not None and point.found.period is None for point in points)
    columns: Columns = {
        key: (lambda point: point.value, ".4g"),
        "left after 1 s" if rests else "largest multiplier": (lambda point: point.largest, ".4f"),
        "verdict": (_verdict, ""),
    }
    lines = [
        f"{key} = {number(crossing.value, '.4g')}: stability is "
        f"{'lost' if crossing.leaves else 'gained'} {crossing.how}"
        for crossing in crossings(points)
    ]
    return "\n".join([address, table(columns, points), *lines])


def _verdict(point: Point) -> str:
    if point.found is None:
        return point.reason
    return "stable" if point.found.stable else "unstable"


def stability_text(found: Stability) -> str:
    """The analysis in lines."""
    kind = "rest point" if found.period is None else f"orbit of {number(found.period)} s"
    verdict = "stable" if found.stable else "unstable"
    if found.neutral:
        verdict += f", {found.neutral} neutral: a disturbance of these neither grows nor decays"
    rows = [("kind", kind), ("verdict", verdict), ("residual", number(found.residual, ".2g"))]
    if found.multipliers is not None:
        largest = found.multipliers[0]
        rows.append(("largest multiplier", f"{complex(largest):.5g}, size {abs(largest):.5g}"))
    forgotten = len(found.states) - sum(mode.count for mode in found.modes)
    if forgotten:
        rows.append(("not listed", f"{forgotten} states, forgotten within a period or sample"))
    if found.left_out:
        rows.append(("left out", f"{', '.join(found.left_out)}: nothing holds them"))
    if found.corners:
        text = "the rates have a corner there, a limit or dead zone, so poles say little"
        rows.append(("corners", f"{', '.join(found.corners)}: {text}"))
    return "\n".join([*aligned(rows), "", table(MODES, found.modes)])


OPTIONS: Final = {"axes": "--axes", "coarse": "--coarse", "refinements": "--refine"}
"""Options by the arguments of `tiltsim.attraction` that they set."""

SHARES: Final = {
    "returned": "come back",
    "acceptable": "acceptable attitudes",
    "acceptable_returned": "of these come back",
    "unacceptable_returned": "of the others come back",
}


def _ranges(text: str) -> tuple[tuple[float, float], tuple[float, float]]:
    try:
        (a, b), (c, d) = (map(float, part.split(":")) for part in text.split(","))
    except ValueError:
        raise ValueError("write LOW:HIGH,LOW:HIGH") from None
    return (a, b), (c, d)


def run_attraction(
    scenario: str,
    *,
    axes: str = "roll,pitch",
    ranges: Annotated[Any, Option(read=_ranges)] = (None, None),
    coarse: int = COARSE,
    refine: int = REFINEMENTS,
    overrides: Overrides = (),
    json: Json = False,
    quiet: Quiet = False,
    trust: Trust = False,
    figure: PlotOptions,
) -> int:
    """Fly a scenario from a grid of initial states, and print which share comes back.

    The grid is over two numbers, roll and pitch unless others are given, refined where flights that
    come back border on flights that do not.

    Args:
        scenario (SCENARIO): a TOML file or a library name
        axes (A,B): two of x, y, z, vx, vy, vz, roll, pitch, yaw, p, q, r (default: roll,pitch)
        ranges (LOW:HIGH,LOW:HIGH): range of each axis, SI units (default: 1.5 rad, 5 m, 5 m/s or
            10 rad/s either way)
        coarse (N): cells across before cells at the boundary are divided (default: %(default)s)
        refine (N): how often these are divided in four (default: %(default)s)
    """
    (loaded,) = load_scenarios([scenario], overrides, trust)

    from tiltsim.linear.attraction import attraction

    first, _, second = axes.partition(",")
    with show_progress(shown=not quiet) as progress, _in_lines(progress):
        progress.begin("linear analysis")
        found = attraction(
            loaded,
            (first.strip(), second.strip()),
            ranges=ranges,
            coarse=coarse,
            refinements=refine,
            progress=partial(progress.tell, "flights"),
        )

    figure.show(
        lambda: figures.stability.attraction_figure(found), found.report(), _text(found), json=json
    )
    return 0


@contextmanager
def _in_lines(progress: Progress) -> Iterator[None]:
    """Within the block Python's warnings are lines, and mistakes name the options."""

    def show(message: Warning | str, *_: Any, **__: Any) -> None:
        progress.print(f"tiltsim: {message}", error=True)

    with warnings.catch_warnings():
        warnings.simplefilter("always", RuntimeWarning)
        warnings.showwarning = show
        try:
            yield
        except InputError as error:
            name, _, rest = str(error).partition(" = ")
            raise InputError(f"{OPTIONS[name]} {rest}" if name in OPTIONS else str(error)) from None


def _text(found: Attraction) -> str:
    report = found.report()
    rows = [("flights", str(found.flights)), ("engine", str(found.engine))]
    if found.slowest is not None:
        name, rate = found.slowest
        rows.append(("slowest mode", f"{name}, exp(-{number(rate, '.3g')} t)"))
    rows += [
        (label, f"{number(100.0 * report[key], '.1f')} %")
        for key, label in SHARES.items()
        if report[key] is not None
    ]
    return "\n".join(aligned(rows))
