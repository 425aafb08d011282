"""Scenarios: one flight, table by table, validated before anything is simulated.

`Scenario` mirrors the file. Every key has its unit, bounds and default in its table, and nowhere
else. `tiltsim.scenario.loading` reads the files, `tiltsim.scenario.messages` words the mistakes.
"""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import ConfigDict, Field, model_validator

from tiltsim.scenario.consistency import check_consistency
from tiltsim.scenario.scenario_tables import ScenarioTables
from tiltsim.scenario.table import Table
from tiltsim.scenario.time_steps import check_time_steps


class Scenario(ScenarioTables):
    """One flight, fully specified and consistent."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        check_consistency(self)
        check_time_steps(self)
        return self


class Variant(Table):
    """One member of a family: a name, the keys that differ, and its own expectations."""

    model_config = ConfigDict(extra="allow")

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9_.-]+$")]
