"""Measured values of the claims that need no flight."""

from __future__ import annotations

import json
from pathlib import Path

from tiltsim.report.claim import AnalysisClaim, Value, plain
from tiltsim.report.claims import registered_claims
from tiltsim.report.store import code_digest, sources_digest, store
from tiltsim.report.workers import results


def analyze(folder: Path, jobs: int) -> dict[str, Value]:
    """The measured values of all computed claims, by `AnalysisClaim.key`.

    They are stored in the folder until the core or the report changes.

    Raises
    ------
    InputError
        If a claim cannot be computed or a process dies.
    """
    digest = sources_digest([*Path(__file__).parent.rglob("*.py")], code_digest().hex()).hex()
    path = folder / f"analysis-{digest[:24]}.json"
    try:
        stored = json.loads(path.read_bytes())
    except (OSError, ValueError):
        stored = {}
    values: dict[str, Value] = {
        key: tuple(value) if isinstance(value, list) else value for key, value in stored.items()
    }
    missing = [key for key in _claims() if key not in values]
    if missing:
        values |= dict(results(_measure, missing, jobs, str))
        folder.mkdir(parents=True, exist_ok=True)
        store(path, json.dumps(values, indent=1).encode())
    return values


def _claims() -> dict[str, AnalysisClaim]:
    return {claim.key: claim for claim in registered_claims() if isinstance(claim, AnalysisClaim)}


def _measure(key: str) -> Value:
    return plain(_claims()[key].measure())
