"""``tiltsim stability``: whether a rest point or a periodic orbit is stable."""

from __future__ import annotations

import argparse
import itertools
from functools import partial
from math import degrees, isfinite
from typing import TYPE_CHECKING, Any, Final

from tiltsim.commands.analysis import add_analysis, print_analysis, requested_scenarios
from tiltsim.commands.options import Subparsers
from tiltsim.commands.progress import show_progress
from tiltsim.commands.text import aligned, number, table
from tiltsim.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.figure import Figure

    from tiltsim.linear.linearization import Linearization
    from tiltsim.linear.margins import Margin
    from tiltsim.linear.stability import Stability
    from tiltsim.linear.sweeping import Point
    from tiltsim.scenario.scenario import Scenario


SHORT_KEYS: Final = {"period": "gait.period", "amplitude": "gait.amplitude"}
POINTS: Final = 16
FLIGHTS: Final = "flights over a period or sample"
MOST_POINTS: Final = 1000


def add_parser(subparsers: Subparsers) -> None:
    """Declare the command."""
    description = """Print the poles of a scenario's rest point, or the Floquet multipliers of its
    periodic orbit, with the states that take part in each mode: controller, gait, servos, rotors,
    sampling and latency included, on the plant of the scenario."""
    summary = "poles of a rest point or multipliers of a periodic flight"
    parser = subparsers.add_parser("stability", help=summary, description=description)
    add_analysis(parser, "the poles or multipliers, or the sweep", "gait.period=1.5")
    add = parser.add_argument
    add("more", nargs="*", metavar="SCENARIO", help="further ones, with --sweep")
    sweep = """how the largest multiplier moves with a number: period, amplitude or any key;
    default: from half to twice its value at 16 points, spaced evenly by ratio"""
    add("--sweep", metavar="KEY[=FROM:TO[:POINTS]]", help=sweep)
    margins = "at rest: gain, phase, delay and disk margins of the loop broken at one place"
    add("--margins", action="store_true", help=margins)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Analyze, draw, print."""
    scenarios = requested_scenarios(arguments, *arguments.more)
    if arguments.sweep is not None:
        if arguments.margins:
            raise InputError("--margins: of one rest point, not with --sweep")
        return _run_sweep(arguments, scenarios)
    if len(scenarios) > 1:
        raise InputError(f"stability: {len(scenarios)} scenarios need --sweep KEY")

    from tiltsim.linear.stability import stability

    with show_progress(shown=not arguments.quiet) as progress:
        progress.begin(FLIGHTS)
        found = stability(scenarios[0], progress=progress.move)
    report, text = found.report(), stability_text(found)
    draw = partial(_draw, found)
    if arguments.margins:
        from tiltsim.linear.margins import loop_for_margins, margins_of

        if found.multipliers is not None:
            raise InputError(
                f"--margins: {scenarios[0].address} is periodic; margins need a rest point"
            )
        system = loop_for_margins(scenarios[0])
        margins = margins_of(system)
        report["margins"] = [margin.report() for margin in margins]
        text = f"{text}\n\n{margins_text(margins)}"
        draw = partial(_draw_loop, system)
    print_analysis(arguments, report, text, draw)
    return 0


def _draw(found: Stability) -> Figure:
    from tiltsim.views.figures.stability import stability_figure

    return stability_figure(found)


def _draw_loop(system: Linearization) -> Figure:
    from tiltsim.views.figures.stability import loop_figure

    return loop_figure(system)


def _draw_sweep(key: str, sweeps: Mapping[str, Sequence[Point]]) -> Figure:
    from tiltsim.views.figures.stability import sweep_figure

    return sweep_figure(key, sweeps)


def margins_text(margins: Sequence[Margin]) -> str:
    """Margins as a table."""
    header = [
        "broken at",
        "gain",
        "phase (deg)",
        "at (rad/s)",
        "delay (s)",
        "disk",
        "any gain, phase",
    ]
    rows = [
        (
            margin.place,
            f"{number(margin.gain[0], '.3g')} to {number(margin.gain[1], '.4g')}",
            number(degrees(margin.phase), ".1f"),
            number(margin.frequency, ".4g"),
            number(margin.delay, ".4g"),
            number(margin.disk, ".3f"),
            f"x {number(margin.disk_gain, '.3g')}, {number(degrees(margin.disk_phase), '.1f')} deg",
        )
        for margin in margins
    ]
    return table(header, rows, frozenset({2, 3, 4, 5}))


def parse_sweep(text: str, scenarios: Sequence[Scenario]) -> tuple[str, list[float]]:
    """The key and the values of ``--sweep``."""
    name, _, span = text.partition("=")
    key = SHORT_KEYS.get(name, name)
    parts = span.split(":") if span else []
    try:
        points = int(parts[2]) if len(parts) == 3 else POINTS
        first, last = (float(part) for part in parts[:2]) if parts else (0.0, 0.0)
    except ValueError:
        raise InputError(f"--sweep {text}: write KEY=FROM:TO or KEY=FROM:TO:POINTS") from None
    if not parts:
        value: Any = scenarios[0].model_dump()
        for part in key.split("."):
            value = value.get(part) if isinstance(value, dict) else None
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


def _run_sweep(arguments: argparse.Namespace, scenarios: Sequence[Scenario]) -> int:
    """Sweep, draw, print."""
    from tiltsim.linear.sweeping import crossings, sweep_stability

    key, values = parse_sweep(arguments.sweep, scenarios)
    sweeps: dict[str, list[Point]] = {}
    with show_progress(shown=not arguments.quiet) as progress:
        found, total = itertools.count(1), len(scenarios) * len(values)
        progress.begin("points", total)
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
    text = "\n\n".join(_sweep_text(key, *item) for item in sweeps.items())
    print_analysis(arguments, report, text, partial(_draw_sweep, key, sweeps))
    return 0


def _sweep_text(key: str, address: str, points: Sequence[Point]) -> str:
    from tiltsim.linear.sweeping import crossings

    rows = [
        (
            number(point.value, ".4g"),
            "-" if point.largest is None else number(point.largest, ".4f"),
            {True: "stable", False: "unstable", None: point.reason}[
                None if point.found is None else point.found.stable
            ],
        )
        for point in points
    ]
    lines = [
        f"{key} = {number(crossing.value, '.4g')}: stability is "
        f"{'lost' if crossing.leaves else 'gained'} {crossing.how}"
        for crossing in crossings(points)
    ]
    rests = any(point.found is not None and point.found.period is None for point in points)
    header = (key, "left after 1 s" if rests else "largest multiplier", "verdict")
    return "\n".join([address, table(header, rows, frozenset({0, 1})), *lines])


def stability_text(found: Stability) -> str:
    """The analysis in lines."""
    kind = "rest point" if found.period is None else f"orbit of {number(found.period)} s"
    verdict = "stable" if found.stable else "unstable"
    if found.neutral:
        verdict += f", {found.neutral} neutral: disturbed along them, it does not come back"
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
    header = ["mode", "frequency (rad/s)", "damping", "count", "states"]
    modes = [
        (
            mode.name,
            number(mode.frequency, ".5g"),
            number(mode.damping, ".4f"),
            str(mode.count),
            ", ".join(mode.states[:6]) + (", ..." if len(mode.states) > 6 else ""),
        )
        for mode in found.modes
    ]
    return "\n".join([*aligned(rows), "", table(header, modes, frozenset({1, 2, 3}))])
