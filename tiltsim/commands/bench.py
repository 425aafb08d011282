"""``tiltsim bench``: closed-loop speed as a ratio to bare MuJoCo."""

from __future__ import annotations

import argparse
import json
from functools import partial
from typing import Any

from tiltsim.commands.options import Subparsers, add_json, add_quiet
from tiltsim.commands.progress import show_progress
from tiltsim.errors import InputError


def add_parser(subparsers: Subparsers) -> None:
    """Declare the command."""
    description = """Measure the speed of the closed loop, for one vehicle and for batches, as a
    fraction of bare mj_step on the same model in flight; medians of interleaved runs."""
    summary = "measure the speed of the closed loop relative to bare MuJoCo"
    parser = subparsers.add_parser("bench", help=summary, description=description)
    add_json(parser)
    instead = parser.add_mutually_exclusive_group().add_argument
    vehicles = "instead simulate N whole flights with metrics; print time and memory"
    instead("--vehicles", type=int, metavar="N", help=vehicles)
    accuracy = "instead print RK4's position error and speed for several time steps"
    instead("--accuracy", action="store_true", help=accuracy)
    arrays = "instead time batches of 1 to 262144 vehicles in JAX, on the thesis plant"
    instead("--arrays", action="store_true", help=arrays)
    peers = "instead time another simulator and batches in JAX in turns, where it is installed"
    instead("--peer", choices=("crazyflow", "rotorpy"), help=peers)
    add = parser.add_argument
    add("--duration", type=float, default=10.0, help="with --vehicles, s")
    add("--timestep", type=float, default=0.001, help="with --vehicles, s")
    integrators = ("RK4", "implicitfast", "implicit", "Euler")
    add("--integrator", choices=integrators, default="implicitfast", help="with --vehicles")
    add_quiet(parser, "print only the results")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Measure and print."""
    if arguments.vehicles is not None and arguments.vehicles < 1:
        raise InputError(f"--vehicles {arguments.vehicles}: must be at least 1")

    with show_progress(shown=not arguments.quiet) as progress:
        from tiltsim.studies.benchmark import bench_accuracy, bench_flights, run_benchmark

        progress.begin("measuring")
        if arguments.vehicles is not None:
            rows = bench_flights(
                arguments.vehicles, arguments.duration, arguments.integrator, arguments.timestep
            )
        elif arguments.accuracy:
            rows = bench_accuracy()
        elif arguments.arrays:
            from tiltsim.studies.array_benchmark import bench_array_accuracy, bench_arrays

            rows = bench_arrays() + bench_array_accuracy()
        elif arguments.peer:
            from tiltsim.studies.array_benchmark import bench_peer

            rows = bench_peer(arguments.peer)
        else:
            rows = run_benchmark(partial(progress.tell, "comparisons"))
    if arguments.json:
        print(json.dumps(rows, indent=2))
        return 0
    if arguments.vehicles is not None:
        _print_flights(rows[0])
    elif arguments.accuracy:
        _print_accuracy(rows)
    elif arguments.arrays:
        _print_arrays([row for row in rows if row["case"] == "arrays"])
        _print_array_accuracy([row for row in rows if row["case"] == "array accuracy"])
    elif arguments.peer:
        _print_peer(rows)
    else:
        _print_ratios(rows)
    return 0


def _print_ratios(rows: list[dict[str, Any]]) -> None:
    print(
        f"{'case':<10}{'integrator':<14}{'engine':<9}{'vehicles':>9}{'threads':>9}"
        f"{'us/step':>9}{'x real time':>13}{'ratio':>8}"
    )
    for row in rows:
        print(
            f"{row['case']:<10}{row['integrator']:<14}{row['engine']:<9}"
            f"{row['vehicles']:>9}{row['threads']:>9}"
            f"{1e6 / row['steps_per_second']:>9.2f}{row['realtime_factor']:>13.0f}"
            f"{row['ratio']:>8.3f}"
        )
    print("\nratio: speed relative to bare mj_step on the same model in the same run; medians")
    print("empty: a native callback that does nothing; native callbacks disable MuJoCo's timers")


def _print_flights(row: dict[str, Any]) -> None:
    memory = row["memory"]
    print(
        f"{row['vehicles']} flights, {row['completed']} completed, {row['integrator']} at "
        f"{1e3 * row['timestep']:g} ms on {row['threads']} threads: {row['seconds']:.1f} s, "
        f"{row['steps_per_second']:.4g} steps/s, {row['realtime_factor']:.0f} x real time"
        + (f", peak memory {memory / 2**20:.0f} MiB" if memory else "")
    )


def _print_accuracy(rows: list[dict[str, Any]]) -> None:
    print(f"{'step, ms':>9}{'position error, m':>19}{'x real time':>13}")
    for row in rows:
        print(
            f"{1e3 * row['timestep']:>9g}{row['position_error']:>19.1e}"
            f"{row['realtime_factor']:>13.0f}"
        )
    print(
        f"\nRK4 against a step of 0.1 ms; {rows[0]['vehicles']} vehicles on "
        f"{rows[0]['threads']} threads, metrics included"
    )


def _print_arrays(rows: list[dict[str, Any]]) -> None:
    print(
        f"{'precision':<11}{'vehicles':>9}{'steps/s':>12}{'per CPU s':>12}{'x real time':>13}"
        f"{'compile, s':>12}"
    )
    for row in rows:
        print(
            f"{row['precision']:<11}{row['vehicles']:>9}{row['steps_per_second']:>12.3g}"
            f"{row['steps_per_cpu_second']:>12.3g}{row['realtime_factor']:>13.0f}{row['compile_seconds']:>12.1f}"
        )
    print(
        f"\node3 at 1 ms on {rows[-1]['threads']} threads; best of three runs, without compilation"
    )


def _print_array_accuracy(rows: list[dict[str, Any]]) -> None:
    print(f"\n{'step, ms':<11}{'error, m':>9}{'steps/s':>12}{'x real time':>13}")
    for row in rows:
        print(
            f"{1e3 * row['timestep']:<11g}{row['position_error']:>9.1e}"
            f"{row['steps_per_second']:>12.3g}{row['realtime_factor']:>13.0f}"
        )
    print(
        f"\nRK4 in float64, {rows[0]['vehicles']} vehicles: position error after 8 s, from a "
        "step of 0.1 ms"
    )


def _print_peer(rows: list[dict[str, Any]]) -> None:
    print(
        f"{'simulator':<18}{'integrator':<12}{'step, ms':>9}  {'precision':<10}{'vehicles':>9}"
        f"{'threads':>9}{'steps/s':>11}{'per CPU s':>11}{'ratio':>8}"
    )
    for row in rows:
        ratio = "" if row["ratio"] is None else f"{row['ratio']:.1f}"
        print(
            f"{row['simulator']:<18}{row['integrator']:<12}{1e3 * row['timestep']:>9g}  "
            f"{row['precision']:<10}{row['vehicles']:>9}{row['threads']:>9}"
            f"{row['steps_per_second']:>11.3g}{row['steps_per_cpu_second']:>11.3g}{ratio:>8}"
        )
    print(
        "\nin turns, best of five runs, without compilation; ratio: steps per second to the peer's"
    )
