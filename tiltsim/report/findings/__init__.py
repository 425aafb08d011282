"""Our own findings, each with its proof, what shows it, and the tests that support it.

The texts contain no measured number: functions compute them when the report is made.
"""

from __future__ import annotations

from typing import Final

from tiltsim.report.findings import flights, singularities, tilt_car
from tiltsim.report.findings.finding import Finding

__all__ = ["FINDINGS", "Finding"]

FINDINGS: Final[tuple[Finding, ...]] = (
    *singularities.FINDINGS,
    *flights.FINDINGS,
    *tilt_car.FINDINGS,
)
"""All findings, in the order of the report."""
