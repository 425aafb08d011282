"""The ``[claim.NAME]`` tables of a scenario file: what the thesis says of its flights."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field

from tiltsim.scenario.table import Table

Origin = Literal[
    "path", "gains", "keyframes", "parameters", "flight", "start", "limits", "feedback"
]
"""What of a flight does not come from its source."""

NAME: Final = r"^[a-z0-9]+(-[a-z0-9]+)+$"
ClaimName = Annotated[str, Field(pattern=NAME)]
Words = Annotated[str, Field(min_length=1)]


class ClaimTable(Table):
    """A statement that a scenario's ``source`` makes; expectations refer to it by its name."""

    table_name = "claim"

    statement: Words = Field(
        description="the statement in one sentence", examples=["The error at rest is -0.38 m."]
    )
    thesis: Words = Field(
        description="the sentence that makes it, quoted or paraphrased, or what the figure shows",
        examples=["Fig. 4 shows A at -0.38 m."],
    )
    criterion: Words = Field(
        description="what counts as reproduced, and what would not, in words",
        examples=["The same to two digits."],
    )
    note: str = Field(
        "",
        description="what a reader must know to judge it, shown with every row",
        examples=["The thesis does not give the mass."],
    )
    fitted: bool = Field(False, description="parameters were chosen so that it holds")
    missing: str = Field(
        "",
        description="what the text leaves open, so that the statement is not testable",
        examples=["the figure with the path is not available"],
    )
    finding: str = Field(
        "",
        description="key of the finding that settles it, if one does",
        examples=["exact-decoupler"],
    )
