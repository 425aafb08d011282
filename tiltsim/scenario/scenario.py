"""Scenarios: one flight, table by table, validated before anything is simulated.

`Scenario` mirrors the file. Every key has its unit, bounds and default in its table, and nowhere
else. `tiltsim.scenario.loading` reads the files, `tiltsim.scenario.messages` words the mistakes.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Self

from pydantic import ConfigDict, Field

from tiltsim.errors import InputError
from tiltsim.scenario.consistency import check_consistency
from tiltsim.scenario.documents import check_keys, leaves
from tiltsim.scenario.interaction import companions_of
from tiltsim.scenario.messages import show
from tiltsim.scenario.scenario_tables import DESCRIPTIVE, ScenarioTables
from tiltsim.scenario.table import Table, in_one_line, required
from tiltsim.scenario.time_steps import check_time_steps
from tiltsim.system.public import public
from tiltsim.system.text import html_table, short_repr
from tiltsim_controllers.gaits.plans import Gait
from tiltsim_controllers.mathematics.scalar import Values
from tiltsim_controllers.references.trajectories import ReferenceParameters


class Scenario(ScenarioTables):
    """One flight, fully specified and consistent."""

    def __init__(self, **tables: Any) -> None:
        with in_one_line("scenario", tables, Scenario):
            super().__init__(**tables)

    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]  # validation needs no call

    @classmethod
    def model_validate(
        cls, obj: Any, *, address: str = "scenario", emptied: Collection[str] = (), **options: Any
    ) -> Self:
        """Validate as pydantic does, but mistakes raise an `InputError` of one line.

        Args:
            obj: The tables.
            address: Their name in messages.
            emptied: See `one_line_message`.
            options: Pydantic's.
        """
        if not isinstance(obj, Mapping | Scenario):
            raise InputError(f"{address} = {short_repr(obj)}: must be a dict")
        with in_one_line(address, obj, Scenario, emptied):
            return super().model_validate(obj, **options)

    def _check_values(self) -> None:
        self.require_consistency()

    def require_consistency(self) -> None:
        """Raise `InvalidValueError`, worded by validation, if tables contradict each other."""
        check_consistency(self)
        check_time_steps(self)

    @property
    def companions(self) -> tuple[Scenario, ...]:
        """The scenarios of the further vehicles in its world."""
        return companions_of(self)

    def replace(self, changes: Mapping[str, Any]) -> Scenario:
        """This scenario with other values.

        Args:
            changes: Values by dotted key, for example ``{"gait.amplitude": 0.3}``. Another
                ``gait.type``, ``controller.law`` or the like empties its table first, unless both
                kinds have the same keys, as ``trot_instant`` and ``trot_continuous``.

        Raises:
            InputError: In one line: the key, the value and the allowed values.
        """
        check_keys("changes", changes)
        return public("load_scenario")(self, changes)

    def __repr__(self) -> str:
        """Address and title, in one line."""
        return (
            f"<Scenario {': '.join(filter(None, (self.address, self.title))) or 'without title'}>"
        )

    def __str__(self) -> str:
        """Address and title; `model_dump` has all keys."""
        return repr(self)

    def _repr_html_(self) -> str:
        """The keys that are set, as a table for notebooks."""
        given = self.model_dump(mode="json", exclude_unset=True, exclude={*DESCRIPTIVE})
        rows = [(key, show(value)) for key, value in leaves(given) if value is not None]
        return html_table(
            self.title or self.address or "Scenario", [self.address, self.source], rows
        )


class Variant(Table):
    """One member of a family: a name, the keys that differ, and its own expectations."""

    model_config = ConfigDict(extra="allow")

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9_.-]+$")] = required(
        "address of the variant: tiltsim run 'FILE#NAME'", "slow"
    )


@dataclass(frozen=True, eq=False)
class FlightPlan:
    """A scenario with its gait planned and its reference placed."""

    scenario: Scenario
    gait: Gait  # planned for the scenario's vehicle
    reference: ReferenceParameters
    knots: Values  # table data of the gait, then of the reference


def plan_flight(scenario: Scenario) -> FlightPlan:
    """Plan a scenario's gait, and append the table data of its reference to the gait's."""
    gait = scenario.gait.plan(scenario.vehicle.resolve())
    return FlightPlan(scenario, gait, *scenario.reference.after_gait(gait.knots, scenario))
