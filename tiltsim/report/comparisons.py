"""Flights beyond the thesis: each beside the same flight without what it shows.

A scenario whose ``source`` names no chapter says with ``without = "ADDRESS"`` (``"#name"`` within
its file) what to set it beside; what is compared are the metrics of its expectations. Without that
key its own values stand alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from typing import Final

from tiltsim.report.flying import PLANTS, Flights, Plan, Plant, Record
from tiltsim.report.model import CHAPTER
from tiltsim.scenario.metric_names import unit_of

TITLE: Final = "Beyond the thesis"
EXPLANATION: Final = (
    "What the thesis does not have, each flight beside the same flight without it: the value "
    "without, an arrow, the value with. Bounds on all of them are in the scenario files; "
    "`docs/beyond.md` says what they mean."
)


@dataclass(frozen=True)
class Comparison:
    """One metric of a flight, beside that of the flight without what it shows.

    Attributes
    ----------
    address, title
        Of the flight.
    source
        Of its scenario.
    metric
        What is compared.
    without
        Address of the other flight, empty where there is none.
    plants
        What each plant shows, as text; plants on which it does not fly are left out.
    """

    address: str
    title: str
    source: str
    metric: str
    without: str
    plants: dict[Plant, str]

    @property
    def file(self) -> str:
        """Address of the family."""
        return self.address.partition("#")[0]


def compare(plans: list[Plan], flights: Flights) -> list[Comparison]:
    """The comparisons that scenarios ask for, in order; of those that were not flown there is none.

    A flight that was not flown to be set beside leaves its place empty.
    """
    found = []
    others = {plan.address: other_address(plan.address, plan.scenario.without) for plan in plans}
    for plan in plans:
        scenario, without = plan.scenario, others[plan.address]
        shown_beside = not without and plan.address in others.values()
        if CHAPTER.match(scenario.source) is not None or shown_beside:
            continue
        for metric in dict.fromkeys(wanted.metric for wanted in scenario.expect):
            plants: dict[Plant, str] = {}
            for plant in PLANTS:
                record = flights[plan.address, plant]
                if isinstance(record, Record):
                    texts = [_text(record, metric)]
                    other = flights.get((without, plant))
                    if isinstance(other, Record):
                        texts.insert(0, _text(other, metric))
                    plants[plant] = " → ".join(texts)
            found.append(
                Comparison(plan.address, scenario.title, scenario.source, metric, without, plants)
            )
    return found


def other_address(address: str, without: str) -> str:
    """The full address of the flight to be set beside; empty where that is the flight itself."""
    full = address.partition("#")[0] + without if without.startswith("#") else without
    return "" if full == address else full


def families(comparisons: list[Comparison]) -> Iterator[tuple[str, list[Comparison]]]:
    """Comparisons by the file they are from."""
    for file, members in groupby(comparisons, lambda one: one.file):
        yield file, list(members)


def quantity(comparison: Comparison) -> str:
    """What is compared, in words."""
    unit = unit_of(comparison.metric)
    return comparison.metric.replace("_", " ") + (f", {unit}" if unit else "")


def _text(record: Record, metric: str) -> str:
    if record.lost:
        return f"lost at {record.end_time:.3g} s"
    value = record.metrics.get(metric)
    if isinstance(value, bool):
        words = ("flown", "lost") if metric == "diverged" else ("no", "yes")
        return words[value]
    return "no value" if value is None else f"{value:.3g}".replace("-", "−")
