"""Flights beyond the thesis, compared with the same flight without the feature that they show.

In a scenario whose ``source`` names no chapter, ``without = "ADDRESS"`` (``"#name"`` within its
file) names the flight to compare with; the metrics of its expectations are compared. Without that
key only its own values are shown.
"""

from dataclasses import dataclass
from typing import Final

from tiltsim.report.flights import PLANTS, FlightRecord, Flights, Plant, ReportEntry
from tiltsim.report.statement import CHAPTER
from tiltsim.scenario.metric_names import METRICS

TITLE: Final = "Beyond the thesis"
EXPLANATION: Final = (
    "Features that the thesis does not have, each flight compared with the same flight without "
    "the feature: the value without it, an arrow, the value with it. Bounds on all of them are in "
    "the scenario files; `docs/beyond.md` explains them."
)


@dataclass(frozen=True)
class Comparison:
    """One metric of a flight and of the flight without the feature."""

    address: str
    title: str
    source: str
    metric: str
    without: str  # address of the other flight, empty if there is none
    plants: dict[Plant, str]  # the values on each supported plant, as text

    @property
    def file(self) -> str:
        """Address of the family."""
        return self.address.partition("#")[0]

    @property
    def quantity(self) -> str:
        """Name and unit of the metric, as text."""
        unit = METRICS[self.metric].unit
        return self.metric.replace("_", " ") + (f", {unit}" if unit else "")


def compare(entries: list[ReportEntry], flights: Flights) -> list[Comparison]:
    """The comparisons of all entries that have a record, in order.

    If there is no record of the flight to compare with, only one value is shown.
    """
    found = []
    others = {e.address: other_address(e.address, e.scenario.without) for e in entries}
    for entry in entries:
        scenario, without = entry.scenario, others[entry.address]
        shown_beside = not without and entry.address in others.values()
        if CHAPTER.match(scenario.source) is not None or shown_beside:
            continue
        for metric in dict.fromkeys(expectation.metric for expectation in scenario.expect):
            plants: dict[Plant, str] = {}
            for plant in PLANTS:
                record = flights[entry.address, plant]
                if isinstance(record, FlightRecord):
                    texts = [_text(record, metric)]
                    other = flights.get((without, plant))
                    if isinstance(other, FlightRecord):
                        texts.insert(0, _text(other, metric))
                    plants[plant] = " → ".join(texts)
            found.append(
                Comparison(entry.address, scenario.title, scenario.source, metric, without, plants)
            )
    return found


def other_address(address: str, without: str) -> str:
    """The full address of the flight to compare with; empty if that is the flight itself."""
    full = address.partition("#")[0] + without if without.startswith("#") else without
    return "" if full == address else full


def _text(record: FlightRecord, metric: str) -> str:
    if record.ended_early:
        return f"terminated at {record.end_time:.3g} s"
    value = record.metrics.get(metric)
    if isinstance(value, bool):
        words = ("completed", "terminated") if metric == "diverged" else ("no", "yes")
        return words[value]
    return "no value" if value is None else f"{value:.3g}".replace("-", "−")
