"""All claims: of scenario files, and of the files of this folder, one per chapter.

Claims here need no flight, or several. A table is a statement, like the ``[claim.NAME]`` of
scenarios, with the keys of its row::

    [ch6-blue-offset]
    source = "ch. 6, Sec. 3, Eq. (13)"
    statement = "On blue α₁ + α₃ is"
    ...
    value = "offset_over(1)"      # with functions of `tiltsim.report.measures`
    published = "0.334198"        # digits as printed: good to 0.0000005; default: true, yes
    unit = "rad"

A row with ``flights``, addresses in the scenario library, is measured on them: in its ``value`` the
name of a metric stands for an array with a number per flight, as in ``all(diff(duration) > 0)``. A
statement with several rows has them in ``[[ch6-blue-offset.row]]``; keys of the table are their
defaults. ``each`` repeats a row over lists of values, whose names stand in braces in its texts.
Braces also stand for the words of the file's table ``[shared]``, of ``shared.toml``, and for the
numbers of ``thresholds.toml``; ``{a,b}`` in an address for both.
"""

import re
from collections.abc import Iterator, Mapping
from functools import cache, partial
from itertools import product
from pathlib import Path
from typing import Any, Final

from tiltsim.report.claim import CHAPTER, Claim, Statement, origins_of, slug
from tiltsim.report.measures import evaluate
from tiltsim.scenario.expectation import Expectation
from tiltsim.scenario.library import read_toml
from tiltsim.scenario.metric_names import metric_of, unit_of
from tiltsim.scenario.scenario import Scenario

_NAME: Final = re.compile(r"{(\w+)(?:\.(\w+))?}")
_OF_ROWS: Final = (
    "case", "each", "error", "fault", "flights", "in_kind", "key", "published", "tolerance", "unit",
    "value", "where", "why",
)  # fmt: skip
"""Keys of rows that a statement's table may also have, as defaults."""


@cache
def registered_claims(scaled: str = "", factor: float = 1.0) -> tuple[Claim, ...]:
    """All claims of the files of this folder, chapter by chapter.

    Args:
        scaled: Name of a threshold of ``thresholds.toml`` to change.
        factor: By which it is multiplied, or its distance from the number ``from``.
    """
    values = {name: one["value"] for name, one in words("thresholds").items()}
    if scaled:
        start = words("thresholds")[scaled].get("from", 0.0)
        values[scaled] = start + (values[scaled] - start) * factor
    files = sorted(Path(__file__).parent.glob("ch*.toml"))
    shared = words("shared") | values
    return tuple(claim for file in files for claim in _chapter(words(file.stem), shared))


@cache
def words(name: str) -> dict[str, Any]:
    """A file of this folder."""
    return read_toml(Path(__file__).parent / f"{name}.toml")


def _chapter(tables: dict[str, Any], shared: Mapping[str, Any]) -> Iterator[Claim]:
    known = {**shared, **tables.get("shared", {})}
    for name, full in tables.items():
        if name == "shared":
            continue
        table = dict(full)
        rows = table.pop("row", [{}])
        defaults = {key: table.pop(key) for key in _OF_ROWS if key in table}
        statement = Statement.of_table(name, **_filled(table, known))
        for row in rows:
            row = defaults | row
            each = _filled(row.pop("each", {}), known)
            used = tuple(n for n in words("thresholds") if f"{{{n}}}" in row.get("value", ""))
            for values in product(*each.values()):
                filled = _filled(row, {**known, **dict(zip(each, values))})
                yield _claim(statement, filled | {"thresholds": used})


def _filled(value: Any, known: Mapping[str, Any]) -> Any:
    """A value with the words that stand for names in braces; lists become tuples."""
    if isinstance(value, dict):
        return {key: _filled(one, known) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return tuple(_filled(one, known) for one in value)
    if not isinstance(value, str):
        return value

    def word(found: re.Match[str]) -> Any:
        return known[found[1]][found[2]] if found[2] else known[found[1]]

    alone = _NAME.fullmatch(value)
    if alone:
        return _filled(word(alone), known)
    return _NAME.sub(lambda found: str(_filled(word(found), known)), value)


def _claim(statement: Statement, row: dict[str, Any]) -> Claim:
    if "value" in row or not statement.missing:
        row["measure"] = partial(evaluate, row.pop("value"))
    flights = tuple(one for pattern in row.pop("flights", ()) for one in _expanded(pattern))
    return Claim(statement, flights=flights, origins=origins_of(row.pop("ours", ())), **row)


def _expanded(pattern: str) -> list[str]:
    """The addresses that a pattern with ``{a,b}`` stands for, in order."""
    parts = re.split(r"{([^{}]*,[^{}]*)}", pattern)
    choices = (part.split(",") if index % 2 else [part] for index, part in enumerate(parts))
    return ["".join(chosen) for chosen in product(*choices)]


def scenario_claims(scenario: Scenario) -> list[Claim]:
    """The claims of a scenario, in order: its expectations with a ``published`` value.

    A scenario beyond the thesis, whose ``source`` names no chapter, has none.
    """
    if CHAPTER.match(scenario.source) is None:
        return []
    return [
        Claim(
            statement=_statement(scenario, expectation),
            case=", ".join(filter(None, (scenario.title, case := _case(scenario, expectation)))),
            key=slug(f"{_short(scenario.address)} {case}"),
            where=scenario.source,
            published=expectation.published,
            unit=unit_of(expectation.metric),
            tolerance=expectation.published_tolerance,
            in_kind=expectation.in_kind,
            why=expectation.why,
            origins=origins_of(scenario.ours),
            flights=(scenario.address,),
            expectation=expectation,
        )
        for expectation in scenario.expect
        if expectation.published is not None
    ]


def _case(scenario: Scenario, expectation: Expectation) -> str:
    """The label; the metric, if the flight has the claim for several and the file has no label."""
    metrics = {other.metric for other in scenario.expect if other.claim == expectation.claim}
    return expectation.case or (expectation.metric.replace("_", " ") if len(metrics) > 1 else "")


def _short(address: str) -> str:
    """File and variant, without folders: "line walk_third"."""
    file, _, variant = address.partition("#")
    return f"{Path(file).stem} {variant}"


def _statement(scenario: Scenario, expectation: Expectation) -> Statement:
    """From the table that the expectation names; otherwise its own words are the statement."""
    table = scenario.claim.get(expectation.claim)
    if table is not None:
        return Statement.of_table(expectation.claim, source=scenario.source, **table.model_dump())
    measured = metric_of(expectation.metric).described.capitalize()
    words = expectation.claim or measured
    chapter = CHAPTER.match(scenario.source)
    assert chapter is not None
    return Statement(
        id=f"ch{chapter[1]}-{slug(words)[:50].strip('-')}",
        source=scenario.source,
        text=words,
        thesis=words,
        criterion=f"{measured}, compared with the published value.",
    )
