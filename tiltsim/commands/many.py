"""``tiltsim check``, ``sweep`` and ``bench``: many flights, checked, in a dataset, or timed."""

from __future__ import annotations

from collections import Counter
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from tiltsim.commands.declaring import Option
from tiltsim.commands.options import CORES, Jobs, Json, Overrides, Quiet, Silent, Trust, refuse_both
from tiltsim.commands.text import (
    Columns,
    counted,
    json_text,
    most_frequent,
    print_line,
    require_flown,
    show_progress,
    table,
    tally,
    write_text,
)
from tiltsim.errors import INTERRUPTED, InputError
from tiltsim.system.interrupts import defer_interrupts

if TYPE_CHECKING:
    from tiltsim.studies.checking import CheckResult

STANDARD_OUTPUT: Final = Path("-")


def _shard(text: str) -> list[int]:
    number, slash, count = text.partition("/")
    if slash and number.isdecimal() and count.isdecimal() and 1 <= int(number) <= int(count):
        return [int(number), int(count)]
    raise ValueError("must be K/N with 1 <= K <= N, such as 1/4")


def run_check(
    paths: tuple[str, ...] = (),
    *,
    word: Annotated[str, Option("-k")] = "",
    shard: Annotated[tuple[int, int], Option(read=_shard)] = (1, 1),
    fail_fast: bool = False,
    jobs: Jobs = CORES,
    overrides: Overrides = (),
    trust: Trust = False,
    junit: Path | None = None,
    json: Path | None = None,
    quiet: Quiet = False,
) -> int:
    """Fly all scenarios under files and folders, and check their expectations.

    Sweep files in folders are skipped. The JSON and JUnit files are written even when the check is
    interrupted; scenarios not yet flown are in them as well.

    Note:
        exit codes: 0 all passed, 1 an expectation failed, 2 invalid or crashed, 3 vehicle lost; if
        several apply, the most severe is returned (2 > 3 > 1)

    Args:
        paths (PATH): files, folders or library names; default: all
        word (WORD): only what has this text in its address, title or source, as tiltsim list WORD
        shard (K/N): only the K-th of N parts, for N machines; together they are everything
        fail_fast: end at the first that does not pass
        junit (FILE): write JUnit XML
        json (FILE): write JSON; - prints it instead of the table
        quiet: print only scenarios that did not pass
    """
    from tiltsim.resources import shipped_folder
    from tiltsim.studies.checking import (
        check_all,
        collect,
        exit_code,
        json_document,
        not_flown,
        write_junit,
    )
    from tiltsim.studies.checking import shard as part_of
    from tiltsim.system.files import prepare_file

    to_error = json == STANDARD_OUTPUT
    finished: dict[str, CheckResult] = {}
    reason: Literal["interrupted", "skipped"] = "interrupted"
    with show_progress(shown=not quiet) as progress:
        for option, file in (("--junit", junit), ("--json", None if to_error else json)):
            if file is not None:
                prepare_file(option, file)
        addresses = part_of(collect(paths or [str(shipped_folder("scenarios"))], word), *shard)
        width = max(map(len, addresses), default=0)
        progress.begin("scenarios", len(addresses))
        try:
            for result in check_all(addresses, jobs, dict(overrides), trusted=trust):
                finished[result.address] = result
                progress.tell("scenarios", len(finished), len(addresses))
                if result.status != "passed" or not quiet:
                    for line in _lines(result, width):
                        progress.print(line, error=to_error)
                if result.status != "passed" and fail_fast:
                    break
            reason = "skipped"
        finally:
            results = [finished.get(at) or not_flown(at, reason) for at in addresses]
            with defer_interrupts():
                if junit is not None:
                    write_junit(results, junit)
                if json is not None:
                    text = json_text(json_document(results))
                    print(text) if to_error else write_text(json, text)
    labels = Counter(
        "without expectations" if result.without_expectations else result.status
        for result in results
    )
    if not quiet:
        counts = f": {tally(labels)}" if results else ""
        print_line("", error=to_error)
        print_line(f"{counted(len(results), 'scenario', 'scenarios')}{counts}", error=to_error)
    return exit_code(results)


def _lines(result: CheckResult, width: int) -> list[str]:
    """A row of the table, and the reason why a scenario did not pass."""
    if result.verdicts:
        held = sum(verdict.holds for verdict in result.verdicts)
        outcome = f"{held}/{len(result.verdicts)} hold"
    else:
        outcome = "no expectations" if result.without_expectations else ""
    mark = "ok" if result.status == "passed" else result.status.upper()
    row = f"{mark:<8}{result.address:<{width}}  {outcome:<15}  {result.wall_time:6.1f} s"
    return [row, f"        {result.message}"] if result.message else [row]


NOT_FLOWN: Final = frozenset({"invalid", "crashed"})  # ends of rows without a flight
MISTAKES: Final = NOT_FLOWN | {"failed"}
"""Ends whose reason is a mistake in a scenario or in a controller's code."""


def run_sweep(
    sweep: str,
    *,
    jobs: Jobs = CORES,
    cluster: str | None = None,
    out: Path | None = None,
    overrides: Overrides = (),
    trust: Trust = False,
    quiet: Silent = False,
) -> int:
    """Fly a scenario along axes into one Parquet dataset.

    If it is interrupted or killed, running the same command again continues.

    Args:
        sweep (SWEEP): a TOML file or a name from the library (tiltsim list)
        cluster (ADDRESS): fly on the workers of this Dask scheduler, such as tcp://192.168.0.1:8786
        out (DIR): the results (default: sweeps/NAME)
    """
    from tiltsim.sweeps.loading import load_sweep
    from tiltsim.sweeps.points import SweepPoints
    from tiltsim.sweeps.running import run_sweep as fly_sweep
    from tiltsim.system.parquet import open_parquet

    with show_progress(shown=not quiet) as progress:
        progress.begin("checking the sweep")
        definition = load_sweep(sweep, dict(overrides))
        points = SweepPoints(definition)
        folder = out or Path("sweeps") / Path(definition.address).stem
        units = ("flight", "flights") if points.sweep.bisect is None else ("boundary", "boundaries")
        begun = False

        def report(finished: int) -> None:
            nonlocal begun
            if not (quiet or begun):
                state = everything = counted(len(points), *units)
                left = len(points) - finished
                if finished:
                    state = f"{finished} of {everything} finished, {left} to fly"
                if not left:
                    state = f"all {everything} finished, nothing to fly"
                title = points.sweep.title or definition.address
                progress.print(f"{title}: {state}", error=True)
            begun = True
            progress.tell(units[1], finished, len(points))

        try:
            dataset = fly_sweep(
                definition, folder, jobs=jobs, cluster=cluster, report=report, trusted=trust
            )
        except KeyboardInterrupt:
            kept = f"finished flights are in {folder}; the same command continues"
            progress.print(f"tiltsim: interrupted; {kept}", error=True)
            return INTERRUPTED
    with open_parquet(dataset) as opened:
        table = opened.read(columns=["end", "cause"])
    ends = list(zip(table["end"].to_pylist(), table["cause"].to_pylist()))
    if not quiet:
        counts = dict(Counter(end for end, _ in ends).most_common())
        print_line(f"{counted(len(ends), *units)}: {tally(counts)}")
        reasons = [cause for end, cause in ends if end in MISTAKES]
        if reasons:
            print_line(most_frequent(reasons))
        print_line(f"written to {dataset}")
    require_flown([cause if end in NOT_FLOWN else None for end, cause in ends])
    return 0


_STEP: Final = (lambda row: 1e3 * row["timestep"], "g")
_BATCH: Final[Columns] = {"vehicles": ("vehicles", "d"), "threads": ("threads", "d")}
_RATE: Final[Columns] = {"steps/s": ("steps_per_second", ".3g")}
_CPU_RATE: Final[Columns] = {"per CPU s": ("steps_per_cpu_second", ".3g")}
_REAL: Final[Columns] = {"x real time": ("realtime_factor", ".0f")}
_ERROR: Final[Columns] = {"error, m": ("position_error", ".1e")}
_PRECISION: Final[Columns] = {"precision": ("precision", "")}
_INTEGRATOR: Final[Columns] = {"integrator": ("integrator", "")}

TABLES: Final[dict[str, tuple[Columns, str]]] = {
    "ratios": (
        {"case": ("case", ""), **_INTEGRATOR, "engine": ("engine", ""), **_BATCH}
        | {"us/step": (lambda row: 1e6 / row["steps_per_second"], ".2f"), **_REAL}
        | {"ratio": ("ratio", ".3f")},
        "ratio: speed relative to bare mj_step on the same model in the same run; medians\n"
        "empty: a native callback that does nothing; native callbacks disable MuJoCo's timers",
    ),
    "accuracy": (
        {"step, ms": _STEP, **_ERROR, **_REAL},
        "RK4 against a step of 0.1 ms; {vehicles} vehicles on {threads} threads, metrics included",
    ),
    "arrays": (
        {"batch": ("batch", ""), "vehicles": _BATCH["vehicles"], **_RATE, **_CPU_RATE, **_REAL}
        | {"compile, s": ("compile_seconds", ".1f")},
        "e3 at 1 ms on {threads} threads; best of three runs, without compilation",
    ),
    "array accuracy": (
        {"batch": ("batch", ""), "step, ms": _STEP, **_ERROR, **_RATE, **_REAL},
        "RK4, {vehicles} vehicles: position error after 8 s, from a step of 0.1 ms",
    ),
    "peer": (
        {"simulator": ("simulator", ""), **_INTEGRATOR, "step, ms": _STEP, **_PRECISION, **_BATCH}
        | {**_RATE, **_CPU_RATE, "ratio": ("ratio", ".1f")},
        "in turns, best of five runs, without compilation; ratio: steps per second to the peer's",
    ),
}
"""Columns of each table and the note below it."""


def run_bench(
    *,
    json: Json = False,
    vehicles: int | None = None,
    accuracy: bool = False,
    arrays: bool = False,
    peer: Literal["crazyflow", "rotorpy"] | None = None,
    duration: float = 10.0,
    timestep: float = 0.001,
    integrator: Literal["RK4", "implicitfast", "implicit", "Euler"] = "implicitfast",
    quiet: Quiet = False,
) -> int:
    """Measure the speed of the closed loop, for one vehicle and for batches.

    The speed is a fraction of bare mj_step on the same model in flight; medians of interleaved
    runs.

    Args:
        vehicles (N): instead simulate N whole flights with metrics; print time and memory
        accuracy: instead print RK4's position error and speed for several time steps
        arrays: instead time batches of 1 to 262144 vehicles on the thesis plant
        peer: instead time another simulator and our batches in turns, where it is installed
        duration (S): with --vehicles, s
        timestep (S): with --vehicles, s
        integrator: with --vehicles
        quiet: print only the results
    """
    refuse_both(vehicles=vehicles is not None, accuracy=accuracy, arrays=arrays, peer=peer)
    if vehicles is not None and vehicles < 1:
        raise InputError(f"--vehicles {vehicles}: must be at least 1")

    with show_progress(shown=not quiet) as progress:
        from tiltsim.studies import benchmark

        progress.begin("measuring")
        if vehicles is not None:
            rows = benchmark.bench_flights(vehicles, duration, integrator, timestep)
        elif accuracy:
            rows = benchmark.bench_accuracy()
        elif arrays:
            from tiltsim.studies.array_benchmark import bench_array_accuracy, bench_arrays

            rows = bench_arrays() + bench_array_accuracy()
        elif peer is not None:
            from tiltsim.studies.array_benchmark import bench_peer

            rows = bench_peer(peer)
        else:
            rows = benchmark.run_benchmark(partial(progress.tell, "comparisons"))
    if json:
        print(json_text(rows))
    elif vehicles is not None:
        print(_flights_text(rows[0]))
    elif arrays:
        for name in ("arrays", "array accuracy"):
            print(_table(name, [row for row in rows if row["case"] == name]))
    else:
        print(_table("accuracy" if accuracy else "peer" if peer else "ratios", rows))
    return 0


def _table(name: str, rows: list[dict[str, Any]]) -> str:
    columns, note = TABLES[name]
    return f"{table(columns, rows)}\n\n{note.format_map(rows[-1])}\n"


def _flights_text(row: dict[str, Any]) -> str:
    memory = row["memory"]
    return (
        f"{row['vehicles']} flights, {row['completed']} completed, {row['integrator']} at "
        f"{1e3 * row['timestep']:g} ms on {row['threads']} threads: {row['seconds']:.1f} s, "
        f"{row['steps_per_second']:.4g} steps/s, {row['realtime_factor']:.0f} x real time"
        + (f", peak memory {memory / 2**20:.0f} MiB" if memory else "")
    )
