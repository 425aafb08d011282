"""Statements of the thesis, their cases, and verdicts on measured values."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from decimal import Decimal
from enum import Enum
from math import isfinite
from typing import Any, Final, Self, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from tiltsim.flight.metrics import Verdict
from tiltsim.scenario.expectation import Expectation

CHAPTER: Final = re.compile(r"ch\. (\d+)")
ID: Final = re.compile(r"ch(\d+)(-[a-z0-9]+)+")

_SPELLED: Final = {
    "α": "alpha", "δ": "delta", "Δ": "delta", "η": "eta", "θ": "theta", "π": "pi", "ρ": "rho",
    "τ": "tau", "φ": "phi", "ψ": "psi", "ω": "omega", "−": "minus ", "<": "below",
}  # fmt: skip


class Described(Enum):
    """Words for readers, with their meaning in one sentence."""

    meaning: str

    def __new__(cls, words: str, meaning: str) -> Self:
        """A member with its words as value."""
        member = object.__new__(cls)
        member._value_ = words
        member.meaning = meaning
        return member


class Origin(Described):
    """A part of a test that does not come from the thesis; a row may have several."""

    PATH = "path ours", "the thesis's figure with the gait's path is not available: we drew one"
    GAINS = "gains ours", "the thesis prints no gains: we chose them"
    KEYFRAMES = (
        "keyframes fitted",
        "its keyframes are not available: ours were fitted to its statements",
    )
    PARAMETERS = (
        "parameters ours",
        "the thesis does not give all masses or coefficients: we chose them",
    )
    FLIGHT = (
        "flight ours",
        "the thesis flies nothing here: the flight tests what its statement implies",
    )
    START = "start ours", "the thesis does not print the initial state: we chose it"
    LIMITS = "no rotor limits", "the flight ignores the rotor limits that its chapter states"
    FEEDBACK = (
        "feedback ours",
        "the thesis does not say whether a derivative is measured or modeled",
    )


def origins_of(ours: Iterable[str]) -> tuple[Origin, ...]:
    """The origins that a file names: "gains"."""
    return tuple(Origin[name.upper()] for name in ours)


@dataclass(frozen=True, kw_only=True)
class Statement:
    """One statement of the thesis; its rows are the cases in which it is tested.

    Raises `ValueError` if a field is empty or the fields contradict each other.
    """

    id: str  # anchor on the page, never changed once published: "ch4-period"
    source: str  # chapter first, then section, figure or equation: "ch. 3, Sec. 4, Eq. (19)".
    text: str  # the statement in one sentence of ours
    thesis: str  # the sentence that makes it, quoted or paraphrased, or a description of the figure
    criterion: str = ""
    """Criterion of reproduction, and of failure, in words; none if it is not testable."""
    note: str = ""  # note that a reader needs to judge it, shown with every row
    origins: tuple[Origin, ...] = ()
    """Our own choices in every row, in addition to ``ours`` of its flights."""
    fitted: bool = False  # whether parameters were chosen so that it holds
    finding: str = ""
    """Key of the finding that settles it; rows refuted by one finding are one error."""
    missing: str = ""  # information that the text omits, so that the statement is not testable
    pictures: tuple[str, ...] = ()
    """Names of pictures that show it, in addition to the pictures of its flights."""
    tests: tuple[str, ...] = ()
    """Tests beside the row's own: "controllers/analysis/test_x.py::test_y"."""

    @classmethod
    def of_table(cls, name: str, *, statement: str, ours: Iterable[str] = (), **more: Any) -> Self:
        """From a TOML table: of a scenario file or of a file beside a module of claims.

        Args:
            name: Its id.
            statement: The text.
            ours: Names of its origins: "gains".
            more: The other fields under their names.
        """
        return cls(id=name, text=statement, origins=origins_of(ours), **more)

    def __post_init__(self) -> None:
        for name in ("text", "thesis", "criterion"):
            if not (getattr(self, name).strip() or (name == "criterion" and self.missing)):
                raise ValueError(f"{self.id}: {name} is empty")
        chapter, named = CHAPTER.match(self.source), ID.fullmatch(self.id)
        if chapter is None:
            raise ValueError(f"source {self.source!r}: must begin with a chapter: 'ch. 3, Sec.'")
        if named is None or named[1] != chapter[1]:
            raise ValueError(f"id {self.id!r}: must be like 'ch{chapter[1]}-two-words'")

    @property
    def chapter(self) -> int:
        """The chapter's number."""
        found = CHAPTER.match(self.source)
        assert found is not None
        return int(found[1])

    @property
    def place(self) -> tuple[int, ...]:
        """Numbers of its first section, for the order of the text; an appendix comes last."""
        if "App." in self.source:
            return (99,)
        section = re.search(r"Secs?\. ([\d.]*\d)", self.source)
        return tuple(map(int, section[1].split("."))) if section else ()


def slug(text: str) -> str:
    """A text as part of an address: "ρ = -0.65, circle" is "rho-minus-0-65-circle"."""
    spelled = re.sub(r"-(?=\d)", " minus ", "".join(_SPELLED.get(c, c) for c in text))
    plain = unicodedata.normalize("NFKD", spelled).encode("ascii", "ignore").decode().lower()
    return re.sub(r"[^a-z0-9]+", "-", plain).strip("-")


Value: TypeAlias = "float | bool | tuple[float, ...]"
"""A measured value: a number, yes or no, or several numbers."""

Published: TypeAlias = "float | str | bool | tuple[float | str, ...]"
"""A printed value. A number written as a string keeps its digits: "4.000" is good to 0.0005."""

Metrics: TypeAlias = Mapping[str, float | bool]

_FAULTS: Final = {"REFUTED", "MISPRINT", "ROUNDING"}

ROUNDING: Final = 1.0 + 1e-9  # 0.345 is not exact in binary, but should round to 0.35


class ClaimVerdict(Described):
    """The verdict on a claim, from best to worst, with its meaning."""

    REPRODUCED = "reproduced", "equal within the printed digits, or the same yes/no answer"
    QUALITATIVE = "reproduced qualitatively", "the statement holds, but the number differs"
    FITTED = (
        "consistent with a fit",
        "it holds, but parameters were chosen so that it does: no evidence",
    )
    NOT_TESTABLE = (
        "not testable",
        "the text leaves open what it depends on; no evidence for the statement or against it",
    )
    NOT_REPRODUCED = "not reproduced", "the result differs; the reason is given"
    ROUNDING = (
        "rounding artifact",
        "true of the printed digits, not of the exact quantity: another row tests it as published",
    )
    MISPRINT = "misprint", "the formula or number has a slip; the list of errors has the mended one"
    REFUTED = "refuted", "the statement is false, by proof; the list of errors has it"

    @property
    def rank(self) -> int:
        """Position in the order, 0 for the best."""
        return list(ClaimVerdict).index(self)

    @property
    def css(self) -> str:
        """Name in the style sheet and in addresses."""
        return self.name.lower().replace("_", "-")


@dataclass(frozen=True)
class Claim:
    """One case of a statement of the thesis, with a number or a yes/no answer: a row.

    Raises `ValueError` if the fields contradict each other.
    """

    statement: Statement
    _: KW_ONLY
    flights: tuple[str, ...] = ()
    """Addresses in the scenario library; a claim without flights is computed."""
    measure: Callable[[Sequence[Metrics]], ArrayLike] | None = None
    """From the metrics of the flights, in order, none if it is computed, to the value."""
    expectation: Expectation | None = None
    """The bound in a scenario file on a metric of its only flight, in place of a measure."""
    published: Published = True
    """The published value; True if the thesis says that the statement holds."""
    case: str = ""  # label, if the statement has several rows
    key: str = ""  # end of the row's id; default: from its label
    where: str = ""  # place in the thesis, if it differs from the statement's
    unit: str = ""
    tolerance: float | None = None
    """Difference up to which numbers count as equal; default: half of the last printed digit."""
    in_kind: tuple[float, float] | None = None
    """Range in which the statement still holds although the number differs."""
    why: str = ""  # the reason if it is not reproduced
    fault: str = ""
    """Verdict if it does not hold and a proof says why: ``refuted``, ``misprint``, ``rounding``."""
    thresholds: tuple[str, ...] = ()  # names of the numbers of ours in its criterion
    missing: str = ""  # information that the text omits, so that this row is not testable
    error: str = ""
    """Key of the entry in the list of errors that a refuted or misprinted row belongs to."""
    note: str = ""  # note that a reader needs to judge the row, whatever its verdict
    origins: tuple[Origin, ...] = ()
    """Our own choices in this row, in addition to ``ours`` of its statement and flights."""
    fitted: bool = False  # whether parameters were chosen so that this row holds
    finding: str = ""  # key of the finding that settles it; default: the statement's

    def __post_init__(self) -> None:
        yes_or_no = isinstance(self.published, bool)
        chapter = CHAPTER.match(self.source)
        if chapter is None or int(chapter[1]) != self.chapter:
            raise ValueError(f"source {self.source!r}: must begin with 'ch. {self.chapter}'")
        if yes_or_no and (self.tolerance is not None or self.in_kind is not None):
            raise ValueError(f"{self.id}: yes or no has neither tolerance nor in_kind")
        if self.fault and (self.fault.upper() not in _FAULTS or not self.why):
            raise ValueError(f"{self.id}: fault is one of {sorted(_FAULTS)} and needs why")
        if bool(self.error) != (self.fault in {"refuted", "misprint"}):
            raise ValueError(f"{self.id}: error names the entry of a refuted or misprinted row")
        if not yes_or_no:
            self.numbers()

    @property
    def id(self) -> str:
        """Anchor on the page, unique among all claims."""
        return "-".join(filter(None, (self.statement.id, self.key or slug(self.case))))

    @property
    def source(self) -> str:
        """Chapter, section, figure or equation."""
        return self.where or self.statement.source

    @property
    def chapter(self) -> int:
        """The chapter's number."""
        return self.statement.chapter

    @property
    def section(self) -> str:
        """The source without its chapter."""
        return CHAPTER.sub("", self.source, count=1).lstrip(", ")

    @property
    def is_fit(self) -> bool:
        """Whether parameters were chosen so that it holds."""
        return self.fitted or self.statement.fitted

    @property
    def settled_by(self) -> str:
        """Key of the finding that settles it, empty if none does."""
        return self.finding or self.statement.finding

    @property
    def tolerances(self) -> str:
        """Differences up to which numbers count as equal; empty for yes or no."""
        if isinstance(self.published, bool):
            return ""
        return ", ".join(dict.fromkeys(f"{tolerance:g}" for _, tolerance in self.numbers()))

    def numbers(self) -> list[tuple[float, float]]:
        """The published numbers with their tolerances. Raises `ValueError` for other values."""
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

    def measured(self, flown: Sequence[Metrics] = ()) -> Value | None:
        """The value, from the metrics of the flights on one plant; None if there is none.

        For an expectation whose published value is true or false: whether the bounds hold.
        """
        if self.expectation is None:
            if self.measure is None:
                return None
            try:
                return plain(self.measure(flown))
            except KeyError:  # a flight that terminates early has no final values
                if not self.flights:
                    raise
                return None
        value = flown[0].get(self.expectation.metric)
        if value is None or isinstance(value, bool) or not isinstance(self.published, bool):
            return value
        if self.expectation.holds is None:
            return Verdict(self.expectation, value).holds
        low, high = self.expectation.holds
        return low <= value <= high


def verdict_on(claim: Claim, measured: Value | None, widened: float = 1.0) -> ClaimVerdict:
    """The verdict on a claim.

    Args:
        claim: The statement of the thesis.
        measured: The measured value; None if there is none.
        widened: Factor on the tolerances of numbers.
    """
    if claim.missing or claim.statement.missing:
        return ClaimVerdict.NOT_TESTABLE
    if measured is not None and _agrees(claim, measured, widened):
        return ClaimVerdict.FITTED if claim.is_fit else ClaimVerdict.REPRODUCED
    if claim.fault:
        return ClaimVerdict[claim.fault.upper()]
    if claim.in_kind is not None and measured is not None:
        low, high = claim.in_kind
        values = measured if isinstance(measured, tuple) else (measured,)
        if all(low <= value <= high for value in values):
            return ClaimVerdict.FITTED if claim.is_fit else ClaimVerdict.QUALITATIVE
    # A failure with settings fitted by us is no evidence against the thesis, either.
    return ClaimVerdict.NOT_TESTABLE if claim.is_fit else ClaimVerdict.NOT_REPRODUCED


def _agrees(claim: Claim, measured: Value, widened: float) -> bool:
    if isinstance(claim.published, bool) or isinstance(measured, bool):
        return claim.published is measured
    values = measured if isinstance(measured, tuple) else (measured,)
    numbers = claim.numbers()
    return len(values) == len(numbers) and all(
        isfinite(value) and abs(value - printed) <= tolerance * widened * ROUNDING
        for value, (printed, tolerance) in zip(values, numbers)
    )


def plain(measured: ArrayLike) -> Value:
    """A measured value, or several, in plain Python types; an array of one value is this value."""
    values = np.ravel(measured).tolist()
    if len(values) > 1 or isinstance(measured, tuple | list):
        return tuple(map(float, values))
    return values[0] if isinstance(values[0], bool) else float(values[0])


def worst(verdicts: list[ClaimVerdict]) -> ClaimVerdict:
    """The worst of several verdicts."""
    return max(verdicts, key=lambda verdict: verdict.rank)
