"""The option of XLA that makes flights on arrays faster; the command line sets it.

Loaded at every start: imports the standard library only.
"""

import os
from typing import Final

MERGES_LOOPS: Final = "xla_cpu_use_multi_output_fusion"
"""With it XLA computes an intermediate value once for several results."""


def merges_loops() -> bool:
    """Whether ``XLA_FLAGS`` names the option."""
    return MERGES_LOOPS in os.environ.get("XLA_FLAGS", "")


def let_xla_merge_loops() -> None:
    """Have JAX compute values once for several results, in this process and those it starts.

    The option doubles the speed of flights on arrays. It is not set where tiltsim is a library:
    XLA may fail with it on programs that are not ours.
    """
    flags = os.environ.get("XLA_FLAGS", "")
    if "xla_backend_extra_options" not in flags:
        os.environ["XLA_FLAGS"] = f"{flags} --xla_backend_extra_options={MERGES_LOOPS}=true"
