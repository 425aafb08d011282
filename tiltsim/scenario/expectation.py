"""The tables ``[[expect]]`` and ``[claim.NAME]``: bounds on metrics, statements of the thesis."""

from typing import Annotated, Final, Literal

from pydantic import Field

from tiltsim.scenario.messages import choose
from tiltsim.scenario.metric_names import METRICS, is_boolean, is_metric, split_metric
from tiltsim.scenario.simulation_table import PlantName
from tiltsim.scenario.table import NonNegative, Range, Table, default, example, required

Origin = Literal[
    "path", "gains", "keyframes", "parameters", "flight", "start", "limits", "feedback"
]
"""Parts of a flight that do not come from its source."""

NAME: Final = r"^[a-z0-9]+(-[a-z0-9]+)+$"
ClaimName = Annotated[str, Field(pattern=NAME)]
Words = Annotated[str, Field(min_length=1)]


class ClaimTable(Table):
    """A statement that a scenario's ``source`` makes; expectations refer to it by its name."""

    table_name = "claim"

    statement: Words = required("the statement in one sentence", "The error at rest is -0.38 m.")
    thesis: Words = required(
        "the sentence that makes it, quoted or paraphrased, or what the figure shows",
        "Fig. 4 shows A at -0.38 m.",
    )
    criterion: Words = required(
        "what counts as reproduced, and what would not, in words", "The same to two digits."
    )
    note: str = default(
        "",
        "what a reader must know to judge it, shown with every row",
        "The thesis does not give the mass.",
    )
    fitted: bool = default(False, "parameters were chosen so that it holds")
    missing: str = default(
        "",
        "what the text leaves open, so that the statement is not testable",
        "the figure with the path is not available",
    )
    finding: str = default("", "key of the finding that settles it, if one does", "exact-decoupler")


class Expectation(Table):
    """A bound on a metric, evaluated after the flight."""

    model_config = example(min=-0.4, max=-0.36)
    table_name = "expect"

    # An editor completes the names; the message on an unknown one is ours.
    metric: str = Field(
        description="a number that summarizes the flight; docs/metrics.md defines them all; a "
        "companion's after its name and a dot, such as wing.max_rotor_speed",
        json_schema_extra={
            "anyOf": [{"enum": list(METRICS)}, {"type": "string", "pattern": r"^\w+\.\w+$"}]
        },
    )
    claim: str = default(
        "", "name of the [claim.NAME] table with the thesis's statement, or a sentence", "your-name"
    )
    case: str = default(
        "", "label among the claim's rows, if a flight has several; default: its title", "along x"
    )
    published: float | bool | None = default(
        None,
        "the thesis's value, shown beside the measured one; true or false: whether the metric, or "
        "the statement that it lies within holds, is true in the thesis [the metric's]",
        -0.38,
    )
    holds: Range | None = default(
        None,
        "where the thesis's statement is true; default: from min to max, which are narrower "
        "bounds around our own value [the metric's]",
        [-0.5, 0.0],
    )
    published_tolerance: NonNegative | None = default(
        None,
        "largest deviation that counts as reproduced; default: half a unit of the last digit [the "
        "metric's]",
        0.005,
    )
    in_kind: Range | None = default(
        None,
        "range in which the claim holds qualitatively although the number differs [the metric's]",
        [-0.5, -0.3],
    )
    why: str = default("", "the reason why the claim is not reproduced", "the thesis gives no mass")
    min: float | None = default(None, "smallest value that holds [the metric's]", -0.4)
    max: float | None = default(None, "largest value that holds [the metric's]", 0.1)
    equals: bool | None = default(None, "for metrics that are true or false", False)
    plant: PlantName | None = default(
        None, "evaluate on this plant only; default: on all", "thesis"
    )

    def _check_values(self) -> None:
        if not is_metric(self.metric):
            raise self.mistake("metric", choose(split_metric(self.metric)[1], METRICS))
        boolean = is_boolean(self.metric)
        bounded = self.min is not None or self.max is not None
        if boolean and (bounded or self.equals is None):
            raise self.mistake("metric", "is true or false: give equals only")
        if not boolean and (self.equals is not None or not bounded):
            raise self.mistake("metric", "is a number: give min, max or both")
        if self.min is not None and self.max is not None and self.min > self.max:
            raise self.mistake("min", f"must not exceed max = {self.max}")
        self._check_claim(boolean)

    def _check_claim(self, boolean: bool) -> None:
        published = self.published
        if boolean and published is not None and not isinstance(published, bool):
            raise self.mistake("published", f"{self.metric} is true or false")
        if published is None:
            needs = "needs published: a number, true or false"
            self.require_defaults(("claim", "case", "why"), needs)
        if published is None or isinstance(published, bool):
            self.require_defaults(("published_tolerance", "in_kind"), "needs a published number")
        if boolean or not isinstance(published, bool):
            self.require_defaults(("holds",), "needs a metric with a number, and true or false")
        for key in ("holds", "in_kind"):
            bounds = getattr(self, key)
            if bounds is not None and not bounds[0] <= bounds[1]:
                raise self.mistake(key, "write [low, high]")
