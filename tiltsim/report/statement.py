"""Statements of the thesis, as the report judges them, and our own choices in their tests."""

import re
import unicodedata
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from typing import Any, Final, Self

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
