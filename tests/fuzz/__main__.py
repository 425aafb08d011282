"""Random inputs, each fine or refused: ``python -m tests.fuzz --count 20000 --seed 1``."""

from __future__ import annotations

import argparse
import faulthandler
import sys

from tests.fuzz.running import fuzz

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--count", type=int, default=20_000)
parser.add_argument("--seed", type=int, default=0)
options = parser.parse_args()
faulthandler.enable()


def report(done, mistake):
    """Show each mistake at once, and the progress."""
    if mistake:
        sys.stdout.write(f"{mistake}\n")
        sys.stdout.flush()
    if done % 500 == 0:
        sys.stderr.write(f"{done} of {options.count}\n")


mistakes = fuzz(options.count, options.seed, report)
sys.stdout.write(f"{len(mistakes)} mistakes in {options.count} inputs\n")
sys.exit(bool(mistakes))
