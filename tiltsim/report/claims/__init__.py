"""Claims that need more than one flight, or none: computed, or derived from several flights.

One module per chapter, found by its name, with a tuple ``CLAIMS`` of rows in the order of the text.
What the thesis states is in the TOML file beside it, like the ``[claim.NAME]`` of scenarios::

    [ch6-blue-offset]
    source = "ch. 6, Sec. 3, Eq. (13)"
    statement = "On blue α₁ + α₃ is"
    ...

    AnalysisClaim(THESIS["ch6-blue-offset"], lambda: 2.0 * delta(AR_DRONE_2), published="0.334198")

A number written as a string keeps its digits: this one is good to 0.0000005. ``published`` is True
by default: the thesis says yes. ``measure`` returns a number, several numbers or a bool, always
computed, never a constant, within about a second; that of a `FlightClaim` gets {address: metrics}
of one plant. A flight that terminates early has ``diverged`` true in its metrics and may lack
others. A statement with several cases has one row for each, with different ``case``. Import heavy
modules (scipy, mujoco) inside the functions.
"""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tiltsim.report.claim import AnalysisClaim, FlightClaim


def registered_claims() -> list[AnalysisClaim | FlightClaim]:
    """All claims of the modules of this package, chapter by chapter."""
    claims = []
    for module in sorted(iter_modules(__path__), key=lambda found: found.name):
        claims += import_module(f"{__name__}.{module.name}").CLAIMS
    return claims
