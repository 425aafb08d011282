"""Claims, and how a measured value is judged against a published one."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from decimal import Decimal
from enum import Enum
from math import isfinite
from typing import TYPE_CHECKING, Final, TypeAlias

from tiltsim.scenario.metric_names import unit_of

if TYPE_CHECKING:
    from tiltsim.scenario.expectation import Expectation
    from tiltsim.scenario.scenario import Scenario

Value: TypeAlias = "float | bool | tuple[float, ...]"
"""A measured value: a number, yes or no, or several numbers."""

Published: TypeAlias = "float | str | bool | tuple[float | str, ...]"
"""A printed value. A number written as a string keeps its digits: "4.000" is good to 0.0005."""

Metrics: TypeAlias = Mapping[str, float | bool]

CHAPTER: Final = re.compile(r"ch\. (\d+)")
ROUNDING: Final = 1.0 + 1e-9  # 0.345 is not exact in binary, and is meant to round to 0.35


class Outcome(Enum):
    """The verdict on a claim, from best to worst."""

    REPRODUCED = "reproduced"
    IN_KIND = "reproduced in kind"
    NOT_REPRODUCED = "not reproduced"
    WRONG = "published claim is wrong"

    @property
    def rank(self) -> int:
        """0 for the best."""
        return list(Outcome).index(self)


@dataclass(frozen=True, kw_only=True)
class Claim:
    """One statement of the thesis that has a number or a yes or no.

    Raises `ValueError` where the record contradicts itself.
    """

    source: str
    """Chapter first, then section, figure or equation: "ch. 3, Sec. 4, Eq. (19)"."""
    statement: str
    """What the thesis states, one sentence in our words."""
    published: Published
    case: str = ""
    """Which one, where several claims share a statement."""
    unit: str = ""
    tolerance: float | None = None
    """What counts as the same number; default: half a unit of the last printed digit."""
    in_kind: tuple[float, float] | None = None
    """Where the statement still holds though the number differs."""
    wrong: bool = False
    """Refuted, by proof or by the thesis' own equations, and not merely unseen."""
    why: str = ""
    """The reason where it does not come out."""

    def __post_init__(self) -> None:
        yes_or_no = isinstance(self.published, bool)
        if CHAPTER.match(self.source) is None:
            raise ValueError(f"source {self.source!r}: begin with the chapter, as in 'ch. 3, Sec.'")
        if not self.statement:
            raise ValueError(f"{self.source}: a claim needs a statement")
        if yes_or_no and (self.tolerance is not None or self.in_kind is not None):
            raise ValueError(f"{self.statement!r}: yes or no has neither tolerance nor in_kind")
        if self.wrong and not self.why:
            raise ValueError(f"{self.statement!r}: wrong needs why")
        if not yes_or_no:
            self.numbers()

    @property
    def chapter(self) -> int:
        """The chapter's number."""
        found = CHAPTER.match(self.source)
        assert found is not None
        return int(found[1])

    @property
    def section(self) -> str:
        """The source without its chapter."""
        return CHAPTER.sub("", self.source, count=1).lstrip(", ")

    def numbers(self) -> list[tuple[float, float]]:
        """The published numbers, each with its tolerance. Raises `ValueError` where one is none."""
        several = self.published if isinstance(self.published, tuple) else (self.published,)
        return [self._number(printed) for printed in several]

    def _number(self, printed: float | str) -> tuple[float, float]:
        try:
            digits = Decimal(printed if isinstance(printed, str) else repr(float(printed)))
        except ArithmeticError:
            raise ValueError(f"published {printed!r}: not a number") from None
        exponent = digits.as_tuple().exponent
        if not isinstance(exponent, int):
            raise ValueError(f"published {printed!r}: not a finite number")
        half_a_digit = 0.5 * 10.0**exponent
        return float(digits), half_a_digit if self.tolerance is None else self.tolerance


@dataclass(frozen=True, kw_only=True)
class AnalysisClaim(Claim):
    """A claim that is computed, not flown."""

    measure: Callable[[], Value]

    @property
    def key(self) -> str:
        """Tells it from every other claim."""
        return f"{self.source}: {self.statement} [{self.case}]"


@dataclass(frozen=True, kw_only=True)
class FlightClaim(Claim):
    """A claim about several flights, such as that one tracks better than the other."""

    flights: tuple[str, ...]
    """Addresses in the scenario library."""
    measure: Callable[[Mapping[str, Metrics]], Value]
    """From the metrics of the flights, by address, to the measured value; once a plant."""


@dataclass(frozen=True, kw_only=True)
class ExpectationClaim(Claim):
    """A claim in a scenario file, about one metric of one flight."""

    address: str
    expectation: Expectation

    @property
    def key(self) -> tuple[str, str, str]:
        """Equal for expectations that are one claim, judged on one plant each."""
        return self.address, self.expectation.metric, self.statement

    def measure(self, metrics: Metrics) -> Value | None:
        """The measured value, or whether the bounds hold where the thesis says yes or no."""
        from tiltsim.flight.verdicts import Verdict

        value = metrics.get(self.expectation.metric)
        if value is None or isinstance(value, bool) or not isinstance(self.published, bool):
            return value
        return Verdict(self.expectation, value).holds


def judge_value(claim: Claim, measured: Value | None) -> Outcome:
    """The verdict on a claim by a measured value, None where there is none."""
    if measured is not None and _agrees(claim, measured):
        return Outcome.REPRODUCED
    if claim.wrong:
        return Outcome.WRONG
    if claim.in_kind is not None and measured is not None:
        low, high = claim.in_kind
        values = measured if isinstance(measured, tuple) else (measured,)
        if all(low <= value <= high for value in values):
            return Outcome.IN_KIND
    return Outcome.NOT_REPRODUCED


def _agrees(claim: Claim, measured: Value) -> bool:
    if isinstance(claim.published, bool) or isinstance(measured, bool):
        return claim.published is measured
    values = measured if isinstance(measured, tuple) else (measured,)
    numbers = claim.numbers()
    return len(values) == len(numbers) and all(
        isfinite(value) and abs(value - printed) <= tolerance * ROUNDING
        for value, (printed, tolerance) in zip(values, numbers)
    )


def plain(measured: object) -> Value:
    """A measured value in plain Python types: NumPy's own are unwrapped."""
    if isinstance(measured, tuple | list):
        return tuple(float(value) for value in measured)
    value = measured.item() if hasattr(measured, "item") else measured
    return value if isinstance(value, bool) else float(value)  # type: ignore[arg-type]


def worst(outcomes: list[Outcome]) -> Outcome:
    """The least favourable of several verdicts."""
    return max(outcomes, key=lambda outcome: outcome.rank)


def scenario_claims(scenario: Scenario) -> list[ExpectationClaim]:
    """The claims that a scenario's expectations make, in order: those that have ``published``.

    A scenario of our own, whose ``source`` names no chapter, makes none.
    """
    if CHAPTER.match(scenario.source) is None:
        return []
    return [
        ExpectationClaim(
            source=scenario.source,
            statement=wanted.claim or _meaning(wanted.metric),
            case=scenario.title,
            published=wanted.published,
            unit=unit_of(wanted.metric),
            tolerance=wanted.published_tolerance,
            in_kind=wanted.in_kind,
            wrong=wanted.wrong,
            why=wanted.why,
            address=scenario.address,
            expectation=wanted,
        )
        for wanted in scenario.expect
        if wanted.published is not None
    ]


def _meaning(metric: str) -> str:
    name = metric.replace("_", " ")
    return name[0].upper() + name[1:]
