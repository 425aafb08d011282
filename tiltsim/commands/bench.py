"""``tiltsim bench``: closed-loop speed as a ratio to bare MuJoCo."""

from functools import partial
from typing import Any, Final, Literal

from tiltsim.commands.options import Json, Quiet, refuse_both
from tiltsim.commands.text import Columns, json_text, show_progress, table
from tiltsim.errors import InputError

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


def run(
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
