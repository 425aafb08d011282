"""``tiltsim bench``: closed-loop speed as a ratio to bare MuJoCo."""

from __future__ import annotations

import argparse
import json
from typing import Any


def add_parser(subparsers: Any) -> None:
    """Declare the command."""
    parser = subparsers.add_parser(
        "bench",
        help="measure the closed loop against bare MuJoCo",
        description=(
            "Measure the speed of the closed loop as a share of bare mj_step on the same model, "
            "flying, in one interleaved run; medians."
        ),
    )
    parser.add_argument("--json", action="store_true", help="machine-readable")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Measure and print."""
    from tiltsim.benchmark import run_benchmark

    rows = run_benchmark()
    if arguments.json:
        print(json.dumps(rows, indent=2))
        return 0
    print(
        f"{'case':<8}{'integrator':<14}{'engine':<9}{'us/step':>9}{'x real time':>13}{'ratio':>8}"
    )
    for row in rows:
        print(
            f"{row['case']:<8}{row['integrator']:<14}{row['engine']:<9}"
            f"{1e6 / row['steps_per_second']:>9.2f}{row['realtime_factor']:>13.0f}"
            f"{row['ratio']:>8.3f}"
        )
    print("\nratio: share of the speed of bare mj_step on the same model in the same run; medians")
    return 0
