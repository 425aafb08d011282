"""``tiltsim run``: flies one scenario."""

from __future__ import annotations

import argparse
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Final

from tiltsim.commands.options import Subparsers, add_overrides, add_quiet
from tiltsim.commands.progress import show_progress
from tiltsim.commands.text import print_line, table, viewing
from tiltsim.exit_codes import DONE, EXPECTATION_FAILED, INTERRUPTED, VEHICLE_LOST
from tiltsim.system.interrupts import defer_interrupts
from tiltsim.system.text import printable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tiltsim.flight.expectations import Verdict
    from tiltsim.flight.flight import Flight
    from tiltsim.scenario.expectation import Expectation
    from tiltsim.scenario.scenario import Scenario
    from tiltsim.views.rerun.live import LiveStream
    from tiltsim_controllers.mathematics.scalar import Floats

GREATEST_DEFLECTION: Final = 0.01
"""Angle (rad) of a pod against its servo at hover, beyond which `tiltsim run` warns."""


def add_parser(subparsers: Subparsers) -> None:
    """Declare the command."""
    description = """Fly one scenario, write its files and check its expectations. Those of the
    library are of the flight as it is there, on any plant: if you change anything else, the
    measured values are shown beside the published ones without a verdict."""
    parser = subparsers.add_parser("run", help="fly one scenario", description=description)
    add = parser.add_argument
    scenario = """a TOML file or a name from the library, with #VARIANT for a member of a family
    (with --set, a family without #VARIANT flies its base)"""
    add("scenario", metavar="SCENARIO", help=scenario)
    controller = """fly your own controller, a function or class in a Python file; short for --set
    controller.law=python --set controller.function=FILE.py:NAME"""
    add("--controller", metavar="FILE.py:NAME", help=controller)
    out = "write metrics.json, flight.parquet, scenario.toml"
    add("--out", type=Path, metavar="DIR", help=out)
    add("--rerun", type=Path, metavar="FILE.rrd", help="save a recording for the Rerun viewer")
    judge = parser.add_mutually_exclusive_group().add_argument
    judge("--judge", action="store_true", default=None, help="check the expectations in any case")
    no_judge = "show the measured values without a verdict in any case"
    judge("--no-judge", dest="judge", action="store_false", default=None, help=no_judge)
    live = parser.add_mutually_exclusive_group().add_argument
    live("--live", action="store_true", help="watch the flight in the Rerun viewer")
    live("--connect", metavar="URL", help="stream to a Rerun viewer that is already open")
    add_overrides(parser, "the scenario", "controller.decoupler=exact")
    add_quiet(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Fly, save, evaluate."""
    from tiltsim.flight.expectations import check_expectations
    from tiltsim.flight.writing import prepare_flight_folder
    from tiltsim.scenario.loading import is_changed_from_library, load_scenario
    from tiltsim.scenario.override_keys import parse_override
    from tiltsim.system.files import prepare_file

    overrides = dict(parse_override(text) for text in arguments.overrides)
    scenario = load_scenario(
        arguments.scenario, overrides, controller=arguments.controller, trusted=True
    )
    expecting, judged = scenario, arguments.judge
    if judged is None:
        own_bounds = any(key.startswith("expect") for key in overrides)
        judged = own_bounds or not is_changed_from_library(arguments.scenario, scenario)
        if not judged:  # the files do not claim them for this flight
            scenario = scenario.model_copy(update={"expect": ()})
    if arguments.out is not None:
        prepare_flight_folder(arguments.out, scenario)
    if arguments.rerun is not None:
        prepare_file("--rerun", arguments.rerun, (".rrd",))

    from tiltsim.studies.gait_analysis import gait_warnings
    from tiltsim_controllers.vehicle.parameters import Vehicle

    vehicle = scenario.vehicle.resolve()
    if not arguments.quiet and isinstance(vehicle, Vehicle):
        standard = scenario.rotorcraft.has_standard_layout
        gait = scenario.gait.plan(vehicle)
        for warning in gait_warnings(gait, vehicle) if standard else ():
            print_line(f"tiltsim: warning: gait: {warning}", error=True)
    if not arguments.quiet:
        _warn_of_own_vehicle(scenario)
    if arguments.rerun is None:
        flight = fly(scenario, arguments)
        _save(flight, arguments)
    else:
        from tiltsim.views.rerun.process import RecordingProcess

        with RecordingProcess(scenario) as recording:
            flight = fly(scenario, arguments)
            with defer_interrupts():
                recording.start(flight, arguments.rerun)
                _save(flight, arguments)
                recording.finish()
    if flight.end.kind == "interrupted":
        kept = f"; the flight so far is in {arguments.out}" if arguments.out is not None else ""
        print_line(f"tiltsim: interrupted at t = {flight.end.time:.3f} s{kept}", error=True)
        return INTERRUPTED
    metrics = flight.metrics()
    reversed_rotor = flight.end.kind == "completed" and metrics["min_rotor_speed"] < 0.0
    if reversed_rotor and not arguments.quiet:
        print_line(
            "tiltsim: warning: a rotor stopped and reversed (min_rotor_speed = "
            f"{metrics['min_rotor_speed']:.4g} rad/s)",
            error=True,
        )
    verdicts = check_expectations(expecting, metrics)
    if not arguments.quiet:
        changes = [*overrides.items()]
        if arguments.controller is not None:
            changes.append(("controller", arguments.controller))
        print(summary(flight, verdicts, judged=judged, changes=changes))
        if arguments.out is not None:
            print_line(f"flight written to {viewing(arguments.out)}")
        if arguments.rerun is not None:
            print_line(f"recording written to {viewing(arguments.rerun)}")
    if flight.end.kind != "completed":
        print_line(f"tiltsim: {flight.end.message}", error=True)
        return VEHICLE_LOST
    failed = [verdict for verdict in verdicts if judged and not verdict.holds]
    if arguments.quiet:
        for verdict in failed:
            print_line(
                f"tiltsim: FAILED {verdict.expectation.metric}: measured {_measured(verdict)}, "
                f"expected {verdict.bounds}",
                error=True,
            )
    return EXPECTATION_FAILED if failed else DONE


def _warn_of_own_vehicle(scenario: Scenario) -> None:
    """Warn of properties of a user's vehicle that controllers do not model, and of soft servos."""
    from tiltsim.scenario.rotorcraft import RotorcraftTable

    vehicle = scenario.vehicle
    own = vehicle.user_vehicle if isinstance(vehicle, RotorcraftTable) else None
    if own is None:
        return
    if own.unmodeled_properties and not scenario.controller.is_external:
        diagonal = "" if vehicle.model == "multirotor" else " and a diagonal inertia"
        print_line(
            f"tiltsim: warning: vehicle.mjcf: the {scenario.controller.law} controller assumes the "
            f"centre of mass at the body's origin{diagonal}; not modeled: "
            f"{own.unmodeled_properties}",
            error=True,
        )
    deflections = scenario.any_rotorcraft.hinge_deflections
    tilt = max(range(len(deflections)), key=lambda i: abs(deflections[i]), default=0)
    if deflections and abs(deflections[tilt]) > GREATEST_DEFLECTION:
        follows = (
            scenario.simulation.plant == "thesis" and scenario.has_ideal_actuators_in_still_air
        )
        print_line(
            f"tiltsim: warning: vehicle.mjcf: the rotors turn joint 'tilt_{tilt + 1}' by about "
            f"{abs(deflections[tilt]):.2g} rad against its servo at hover"
            + (", which the ideal pods of the thesis plant neglect" if follows else "")
            + "; more armature or a higher vehicle.tilt_servo.natural_frequency stiffens it",
            error=True,
        )


def _save(flight: Flight, arguments: argparse.Namespace) -> None:
    if arguments.out is not None:
        with defer_interrupts():
            flight.save(arguments.out)


def fly(scenario: Scenario, arguments: argparse.Namespace) -> Flight:
    """Simulate, showing the progress and, if requested, a live view."""
    from tiltsim.simulation.simulate import simulate

    with ExitStack() as stack:
        live: LiveStream | None = None
        if arguments.live or arguments.connect is not None:
            from tiltsim.views.rerun.live import LiveStream

            live = stack.enter_context(LiveStream(scenario, arguments.connect))
        progress = stack.enter_context(show_progress(shown=not arguments.quiet))
        progress.begin("flight", scenario.simulation.duration)

        def observe(sample: Floats) -> None:
            progress.move(float(sample[0]))
            if live is not None:
                live(sample)

        flight = simulate(scenario, observe)
        if live is not None:
            live.finish(flight.end)
    return flight


def summary(
    flight: Flight,
    verdicts: list[Verdict],
    *,
    judged: bool,
    changes: Sequence[tuple[str, object]] = (),
) -> str:
    """The flight in a few aligned lines.

    Args:
        flight: What was flown.
        verdicts: On its expectations.
        judged: Whether the verdicts count.
        changes: Keys of the scenario that the command line changed, and their values.
    """
    from tiltsim.scenario.messages import show
    from tiltsim.scenario.metric_names import METRICS

    scenario, metrics = flight.scenario, flight.metrics()
    lines = [printable(scenario.title or scenario.address or "scenario")]
    if scenario.title and "#" in scenario.address:  # the title may be the family's
        lines.append(f"  {printable(scenario.address)}")
    if scenario.source:
        lines.append(f"  {printable(scenario.source)}")
    if changes:
        values = (f"{key} = {show(value)}" for key, value in changes)
        lines.append(f"  changed: {printable(', '.join(values))}")
    simulation = scenario.simulation
    factor = metrics["realtime_factor"]
    speed = f"{factor:.0f}" if factor >= 10.0 else f"{factor:.2g}"
    lines.append(
        f"  {metrics['duration']:g} s on the {simulation.plant} plant, {simulation.solver} at "
        f"{simulation.timestep:g} s, {flight.engine} engine, {speed} times"
        " real time"
    )
    shown = [name for name in metrics if name not in _IN_HEADER]
    width = max(map(len, shown))
    if verdicts:
        lines += ["", *(expectation_lines(verdicts) if judged else _comparison_lines(verdicts))]
    lines.append("")
    lines += [
        f"  {name:<{width}}  {_shown(metrics[name]):>12} {METRICS[name].unit}".rstrip()
        for name in shown
    ]
    return "\n".join(lines)


def _shown(value: float) -> str:
    """A metric in few digits: of one that is zero but for the solver's error, one digit tells."""
    if abs(value) <= ROUNDING:
        return "0"
    return f"{value:.6g}" if abs(value) >= SOLVER_ERROR else f"{value:.0e}"


ROUNDING: Final = 1e-12
"""Rounding errors of quantities of order one."""

SOLVER_ERROR: Final = 1e-6
"""What the solver's step may leave of such quantities (docs/performance.md)."""

_IN_HEADER = ("duration", "realtime_factor", "diverged")


def _measured(verdict: Verdict) -> str:
    value, metric = verdict.measured, verdict.expectation.metric
    if isinstance(value, bool):
        return str(value).lower()
    if value is not None:
        return f"{value:.6g}"
    return "flight shorter than 20 s" if metric.endswith("after_20s") else "no value"


def _published(expectation: Expectation) -> str:
    value = expectation.published
    if value is None:
        return ""
    if not isinstance(value, bool):
        return f"{value:g}"
    # The thesis states that a number lies within the bounds, without printing it.
    words = ("out of bounds", "in bounds") if expectation.equals is None else ("false", "true")
    return words[value]


def expectation_lines(verdicts: list[Verdict]) -> list[str]:
    """A table of expectations: verdict, metric, measured, published, bounds."""
    rows = [
        (
            "ok" if verdict.holds else "FAILED",
            verdict.expectation.metric,
            _measured(verdict),
            _published(verdict.expectation),
            verdict.bounds,
        )
        for verdict in verdicts
    ]
    text = table(("", "expected", "measured", "published", "bounds"), rows, frozenset())
    return [f"  {line}" for line in text.splitlines()]


def _comparison_lines(verdicts: list[Verdict]) -> list[str]:
    """A table of expectations that are not judged: metric, measured, published, bounds."""
    rows = [
        (v.expectation.metric, _measured(v), _published(v.expectation), v.bounds) for v in verdicts
    ]
    text = table(("compared", "measured", "published", "bounds"), rows, frozenset())
    note = "no verdict: the bounds are those of the unchanged flight; --judge applies them"
    return [f"  {line}" for line in (*text.splitlines(), note)]
