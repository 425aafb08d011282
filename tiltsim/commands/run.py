"""``tiltsim run``: flies one scenario."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from tiltsim.commands.options import Overrides, Silent, refuse_both
from tiltsim.commands.text import print_line, show_progress, table, viewing, warn
from tiltsim.errors import DONE, EXPECTATION_FAILED, INTERRUPTED, VEHICLE_LOST
from tiltsim.system.interrupts import defer_interrupts
from tiltsim.system.text import printable

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from tiltsim.flight.flight import Flight
    from tiltsim.flight.metrics import Verdict
    from tiltsim.scenario.scenario import Scenario
    from tiltsim.views.rerun.viewer import LiveStream
    from tiltsim_controllers.mathematics.scalar import Floats

GREATEST_DEFLECTION: Final = 0.01
"""Angle (rad) of a pod against its servo at hover, beyond which `tiltsim run` warns."""

ROUNDING: Final = 1e-12  # rounding errors of quantities of order one
SOLVER_ERROR: Final = 1e-6
"""Errors that the solver's step may leave in such quantities (docs/performance.md)."""

_IN_HEADER: Final = ("duration", "realtime_factor", "diverged")


def run(
    scenario: str,
    *,
    controller: str | None = None,
    out: Path | None = None,
    rerun: Path | None = None,
    judge: bool = False,
    no_judge: bool = False,
    live: bool = False,
    connect: str | None = None,
    overrides: Overrides = (),
    quiet: Silent = False,
) -> int:
    """Fly one scenario, write its files and check its expectations.

    The expectations of the library hold for its flights as they are, on any plant: if you change
    anything else, the measured values are shown beside the published ones without a verdict.

    Args:
        scenario (SCENARIO): a TOML file or a name from the library, with #VARIANT for a member of a
            family (with --set, a family without #VARIANT flies its base)
        controller (FILE.py:NAME): fly your own controller, a function or class in a Python file;
            short for --set controller.law=python --set controller.function=FILE.py:NAME
        out (DIR): write metrics.json, flight.parquet, scenario.toml
        rerun (FILE.rrd): save a recording for the Rerun viewer
        judge: check the expectations in any case
        no_judge: show the measured values without a verdict in any case
        live: watch the flight in the Rerun viewer
        connect (URL): stream to a Rerun viewer that is already open
    """
    from tiltsim.flight.metrics import check_expectations
    from tiltsim.flight.writing import prepare_flight_folder
    from tiltsim.scenario.loading import as_in_file, is_changed_from_library, load_scenario
    from tiltsim.system.files import prepare_file

    refuse_both(judge=judge, no_judge=no_judge)
    refuse_both(live=live, connect=connect)
    changes = dict(overrides)
    loaded = load_scenario(scenario, changes, controller=controller, trusted=True)
    in_file = as_in_file(scenario) if changes or controller is not None else loaded
    expecting, judged = loaded, judge
    if judge is no_judge:
        own_bounds = any(key.startswith("expect") for key in changes)
        judged = own_bounds or not is_changed_from_library(scenario, loaded, in_file)
        loaded = loaded if judged else loaded.model_copy(update={"expect": ()})
    if out is not None:
        prepare_flight_folder(out, loaded)
    if rerun is not None:
        from tiltsim.views.rerun import require_rerun

        require_rerun()
        prepare_file("--rerun", rerun, (".rrd",))
    for warning in () if quiet else _warnings(loaded):
        warn(warning)
    flight = fly(loaded, live=live, connect=connect, quiet=quiet)
    with defer_interrupts():
        if out is not None:
            flight.save(out)
        if rerun is not None:
            from tiltsim.views.rerun.recording import save_recording

            save_recording([flight], rerun)
    if flight.end.kind == "interrupted":
        kept = f"; the flight so far is in {out}" if out is not None else ""
        print_line(f"tiltsim: interrupted at t = {flight.end.time:.3f} s{kept}", error=True)
        return INTERRUPTED
    metrics = flight.metrics()
    verdicts = check_expectations(expecting, metrics)
    if not quiet:
        if flight.end.kind == "completed" and (speed := metrics["min_rotor_speed"]) < 0.0:
            warn(f"a rotor stopped and reversed (min_rotor_speed = {speed:.4g} rad/s)")
        changes = _differing(changes, in_file, loaded)
        changes |= {} if controller is None else {"controller": controller}
        print(summary(flight, verdicts, judged=judged, changes=changes))
        for kind, path in (("flight", out), ("recording", rerun)):
            if path is not None:
                print_line(f"{kind} written to {viewing(path)}")
    return _exit_code(flight, verdicts if judged else (), quiet=quiet)


def _differing(changes: dict[str, Any], before: Scenario | None, after: Scenario) -> dict[str, Any]:
    """The changes of a scenario whose values differ from the file's; all where it has no values."""
    from tiltsim.scenario.documents import value_at

    if before is None or not changes:
        return changes
    old, new = before.model_dump(), after.model_dump()
    return {k: v for k, v in changes.items() if value_at(old, k) != value_at(new, k)}


def _exit_code(flight: Flight, verdicts: Sequence[Verdict], *, quiet: bool) -> int:
    """The exit code of a flight; its reason is printed if nothing else has printed it."""
    if flight.end.kind != "completed":
        print_line(f"tiltsim: {flight.end.message}", error=True)
        return VEHICLE_LOST
    failed = [verdict for verdict in verdicts if not verdict.holds]
    for verdict in failed if quiet else ():
        measured = f"measured {verdict.measured_text}, expected {verdict.bounds}"
        print_line(f"tiltsim: FAILED {verdict.expectation.metric}: {measured}", error=True)
    return EXPECTATION_FAILED if failed else DONE


def _warnings(scenario: Scenario) -> Iterator[str]:
    """Properties of the gait, and of a user's vehicle, that the controller does not model."""
    from tiltsim.scenario.rotorcraft import RotorcraftTable
    from tiltsim.studies.gait_analysis import gait_warnings
    from tiltsim_controllers.vehicle.parameters import Vehicle

    vehicle = scenario.vehicle.resolve()
    if isinstance(vehicle, Vehicle) and scenario.rotorcraft.has_standard_layout:
        for warning in gait_warnings(scenario.gait.plan(vehicle), vehicle):
            yield f"gait: {warning}"
    table = scenario.vehicle
    own = table.user_vehicle if isinstance(table, RotorcraftTable) else None
    if own is None:
        return
    if own.unmodeled_properties and not scenario.controller.is_external:
        diagonal = " and a diagonal inertia" if isinstance(vehicle, Vehicle) else ""
        yield (
            f"vehicle.mjcf: the {scenario.controller.law} controller assumes the center of mass at "
            f"the body's origin{diagonal}; not modeled: {own.unmodeled_properties}"
        )
    touching = ("collision",) if scenario.ground is not None else ()
    through = [name for name in own.obstacles if not name.endswith(touching)]
    if through:
        yield (
            f"vehicle.mjcf: the vehicle passes through geom {through[0]!r}: contacts are those of "
            "geoms whose names end in 'collision' and of 'ground', with a [ground] table; an "
            "[[object]] has contacts, too"
        )
    deflections = [abs(angle) for angle in scenario.any_rotorcraft.hinge_deflections]
    most = max(deflections, default=0.0)
    if most > GREATEST_DEFLECTION:
        ideal = scenario.simulation.plant == "thesis" and scenario.has_ideal_actuators_in_still_air
        yield (
            f"vehicle.mjcf: the rotors turn joint 'tilt_{deflections.index(most) + 1}' by about "
            f"{most:.2g} rad against its servo at hover"
            + (", which the ideal pods of the thesis plant neglect" if ideal else "")
            + "; more armature or a higher vehicle.tilt_servo.natural_frequency stiffens it"
        )


def fly(scenario: Scenario, *, live: bool, connect: str | None, quiet: bool) -> Flight:
    """Simulate, showing the progress and, if requested, a live view.

    Args:
        scenario: The flight.
        live, connect, quiet: The options of `tiltsim run`.
    """
    from tiltsim.simulation.simulate import simulate

    with ExitStack() as stack:
        stream: LiveStream | None = None
        if live or connect is not None:
            from tiltsim.views.rerun.viewer import LiveStream

            stream = stack.enter_context(LiveStream(scenario, connect))
        progress = stack.enter_context(show_progress(shown=not quiet))
        progress.begin("flight", scenario.simulation.duration)

        def observe(sample: Floats) -> None:
            progress.move(float(sample[0]))
            if stream is not None:
                stream(sample)

        flight = simulate(scenario, observe)
        if stream is not None:
            stream.finish(flight.end)
    return flight


def summary(
    flight: Flight, verdicts: Sequence[Verdict], *, judged: bool, changes: Mapping[str, object]
) -> str:
    """The flight in a few aligned lines.

    Args:
        flight: The flight.
        verdicts: On its expectations.
        judged: Whether the verdicts count.
        changes: Keys of the scenario that the command line changed, and their values.
    """
    from tiltsim.scenario.messages import show
    from tiltsim.scenario.metric_names import unit_of

    scenario, metrics = flight.scenario, flight.metrics()
    lines = [printable(scenario.title or scenario.address or "scenario")]
    if scenario.title and "#" in scenario.address:  # the title may be the family's
        lines.append(f"  {printable(scenario.address)}")
    if scenario.source:
        lines.append(f"  {printable(scenario.source)}")
    if changes:
        values = (f"{key} = {show(value)}" for key, value in changes.items())
        lines.append(f"  changed: {printable(', '.join(values))}")
    simulation = scenario.simulation
    factor = metrics["realtime_factor"]
    speed = f"{factor:.0f}" if factor >= 10.0 else f"{factor:.2g}"
    lines.append(
        f"  {metrics['duration']:g} s on the {simulation.plant} plant, {simulation.solver} at "
        f"{simulation.timestep:g} s, {flight.engine} engine, {speed} times real time"
    )
    if verdicts:
        lines += ["", *(f"  {line}" for line in expectation_lines(verdicts, judged=judged))]
    shown = [name for name in metrics if name not in _IN_HEADER]
    width = max(map(len, shown))
    of_each = {name: one.metrics() for name, one in flight.vehicles.items()}
    heads = "".join(f"  {name:>12}" for name in of_each)
    lines.append("" if len(of_each) == 1 else f"\n  {'':<{width}}{heads}")
    for name in shown:
        cells = "".join(
            f"  {_shown(own[name]) if name in own else '-':>{max(12, len(vehicle))}}"
            for vehicle, own in of_each.items()
        )
        lines.append(f"  {name:<{width}}{cells} {unit_of(name)}".rstrip())
    return "\n".join(lines)


def _shown(value: float) -> str:
    """A metric in few digits: one digit if it is zero except for the solver's error."""
    if abs(value) <= ROUNDING:
        return "0"
    return f"{value:.6g}" if abs(value) >= SOLVER_ERROR else f"{value:.0e}"


def _published(verdict: Verdict) -> str:
    expectation = verdict.expectation
    value = expectation.published
    if value is None:
        return ""
    if not isinstance(value, bool):
        return f"{value:g}"
    # The thesis states that a number lies within the bounds, without printing it.
    words = ("out of bounds", "in bounds") if expectation.equals is None else ("false", "true")
    return words[value]


def expectation_lines(verdicts: Sequence[Verdict], *, judged: bool) -> list[str]:
    """A table of expectations: metric, measured, published, bounds and, if judged, the verdict."""
    columns = {
        "": (lambda verdict: "ok" if verdict.holds else "FAILED", ""),
        "expected" if judged else "compared": (lambda verdict: verdict.expectation.metric, ""),
        "measured": (lambda verdict: verdict.measured_text, ""),
        "published": (_published, ""),
        "bounds": (lambda verdict: verdict.bounds, ""),
    }
    if judged:
        return table(columns, verdicts).splitlines()
    del columns[""]
    note = "no verdict: the bounds hold for the unchanged flight; --judge applies them"
    return [*table(columns, verdicts).splitlines(), note]
