"""Reading sweep files, and checking them before any flight."""

import json
from collections.abc import Mapping
from contextlib import suppress
from copy import deepcopy
from dataclasses import replace
from os import PathLike, fsdecode
from pathlib import Path
from typing import Any, Final

from tiltsim.errors import InputError
from tiltsim.scenario.documents import check_keys, leaves, plain
from tiltsim.scenario.interaction import unknown_vehicle
from tiltsim.scenario.library import find_scenario_file, library_name, read_toml
from tiltsim.scenario.loading import (
    FILE_KEYS,
    apply_overrides,
    load_scenario,
    locate_named_files,
    named_files,
    parse_scenario,
    without_none,
)
from tiltsim.scenario.metric_names import METRICS, split_metric
from tiltsim.scenario.scenario import Scenario
from tiltsim.scenario.table import in_one_line
from tiltsim.sweeps.definition import UNUSED, VERSIONS, SweepDefinition, installed_versions
from tiltsim.sweeps.expressions import names
from tiltsim.sweeps.points import SweepPoints
from tiltsim.sweeps.tables import (
    Axis,
    AxisTable,
    CasesAxis,
    LinspaceAxis,
    ListAxis,
    NormalAxis,
    SeedAxis,
    Sweep,
    UniformAxis,
)
from tiltsim.system.files import file_digests, is_file
from tiltsim.system.text import short_repr, valid_unicode

_FILE_KEYS: Final = frozenset(f"{table}.{key}" for table, key, _ in FILE_KEYS)
"""Keys of a scenario that name files."""

MAX_SEARCH: Final = 1_000_000  # maximum steps of a search at one point
VALUES_TRIED: Final = 1000  # maximum values of an axis that are checked before any is flown
RESERVED: Final = ("index", "end", "end_time", "cause", "scenario", "flights")
"""Columns of every dataset, in addition to metrics and versions."""


def load_sweep(
    source: str | PathLike[str] | Mapping[str, Any],
    overrides: Mapping[str, Any] | None = None,
    *,
    name: str = "sweep",
) -> SweepDefinition:
    """Read a sweep.

    Args:
        source: A TOML file, the name of a sweep in the library, or the tables of a file as a dict,
            whose ``scenario`` may be a `tiltsim.Scenario`.
        overrides: Values by dotted key of the scenario, on top of the file's ``[set]``.
        name: Name of a dict in messages.

    Raises:
        InputError: In one line: the file, the key, the value and the allowed values. The base
            scenario and every value of every axis are tried.
    """
    if overrides is not None:
        check_keys("overrides", overrides)
    document, address, folder = _document(source, name)
    fixed = document.setdefault("set", {})
    if isinstance(fixed, dict):
        document["set"] = _located(dict(leaves(fixed)), folder, address) | plain(overrides or {})
    if "scenario" not in document and not {"axis", "bisect"} & document.keys():
        raise InputError(f"{address}: a scenario, not a sweep: it has no [[axis]]; use tiltsim run")
    with in_one_line(address, document, Sweep):
        sweep = Sweep.model_validate(document)
    axes = tuple(_with_located_files(axis, folder, address) for axis in sweep.axis)
    sweep = sweep.model_copy(update={"axis": axes})
    base = _base(sweep, folder, address)
    definition = SweepDefinition(
        address,
        json.loads(sweep.model_dump_json(exclude_none=True)),
        json.loads(json.dumps(base)),
        installed_versions(),
    )
    check_points(SweepPoints(definition))
    return replace(definition, files=file_digests(sorted(_named_files(sweep, base))))


def _locate(document: dict[str, Any], folder: Path | None, address: str) -> None:
    """Make file names absolute. Raises `InputError` for code outside the folder of a file."""
    if folder is None:
        locate_named_files(document, Path())
    else:
        locate_named_files(document, folder, address)


def _with_located_files(axis: Axis, folder: Path | None, address: str) -> Axis:
    """An axis in which file names are absolute."""
    if isinstance(axis, CasesAxis):
        for tables in axis.cases.values():
            _locate(tables, folder, address)
    elif isinstance(axis, ListAxis) and not _FILE_KEYS.isdisjoint(axis.targets):
        rows = [_located(dict(zip(axis.targets, row)), folder, address) for row in axis.rows()]
        values = [tuple(row.values()) if axis.keys else row[axis.name] for row in rows]
        return axis.model_copy(update={"values": tuple(values)})
    return axis


def _located(values: dict[str, Any], folder: Path | None, address: str) -> dict[str, Any]:
    """Values by dotted key in which file names are absolute."""
    located = {}
    for name in _FILE_KEYS & values.keys():
        table, _, key = name.partition(".")
        document = {table: {key: values[name]}}
        _locate(document, folder, address)
        located[name] = document[table][key]
    return values | located


def _named_files(sweep: Sweep, base: dict[str, Any]) -> set[Path]:
    """The files that the scenarios of a sweep name."""
    documents = [base]
    for axis in sweep.axis:
        if isinstance(axis, CasesAxis):
            documents += axis.cases.values()
        for row in axis.rows() if isinstance(axis, ListAxis) else ():
            keys = (target.partition(".") for target in axis.targets)
            documents += [{table: {key: value}} for (table, _, key), value in zip(keys, row)]
    return {file for document in documents for file in named_files(document)}


def _document(source: object, name: str) -> tuple[dict[str, Any], str, Path | None]:
    """The tables of a `load_sweep` source, its name in messages, and the folder of its file."""
    if isinstance(source, Mapping):
        check_keys("sweep", source)
        base = source.get("scenario")
        if isinstance(base, Scenario):
            if base.own_controller is not None:
                raise InputError(
                    "sweep: scenario: has a controller that was given in Python, which no file "
                    "holds; use tiltsim.fly"
                )
            tables = without_none(base.model_dump(mode="json", exclude_unset=True))
            source = {**source, "scenario": tables}
        return plain(source), name, None
    if not isinstance(source, str | PathLike):
        raise InputError(
            f"sweep = {short_repr(source)}: must be a name of the library, a TOML file or a dict"
        )
    file = find_scenario_file(fsdecode(source))
    return read_toml(file), valid_unicode(library_name(file)), file.parent


def _base(sweep: Sweep, folder: Path | None, address: str) -> dict[str, Any]:
    """The base with ``[set]`` and defaults; with first values of axes if it needs their keys."""
    try:
        return _scenario(sweep, sweep.set, folder, address)
    except InputError as error:
        first = _first_values(sweep)
        if error.missing.isdisjoint(first):
            raise
        return _scenario(sweep, sweep.set | first, folder, address)


def _first_values(sweep: Sweep) -> dict[str, Any]:
    """A value of each axis and of the search, by key of the scenario; none of relative axes."""
    first: dict[str, Any] = {**sweep.search}
    for axis in sweep.axis:
        match axis:
            case CasesAxis() | AxisTable(relative=True):
                continue
            case ListAxis():
                first |= zip(axis.targets, axis.rows()[0])
            case UniformAxis():
                first |= dict.fromkeys(axis.targets, axis.low)
            case NormalAxis():
                first |= dict.fromkeys(axis.targets, axis.mean)
            case LinspaceAxis() | SeedAxis():
                first |= dict.fromkeys(axis.targets, axis.start)
    return {key: value for key, value in first.items() if "." in key}


def _scenario(
    sweep: Sweep, values: dict[str, Any], folder: Path | None, address: str
) -> dict[str, Any]:
    """The scenario that a sweep names or contains, with values by dotted key."""
    if isinstance(sweep.scenario, str):
        name, _, variant = sweep.scenario.partition("#")
        beside = (folder or Path()) / name
        path = str(beside) if is_file(beside) else name
        try:
            scenario = load_scenario(path + (f"#{variant}" if variant else ""), values or None)
        except InputError as error:
            raise InputError(f"{address}: scenario: {error}", error.missing) from None
    else:
        document = deepcopy(sweep.scenario)
        _locate(document, folder, f"{address}: scenario")
        apply_overrides(document, values, f"{address}: scenario")
        scenario = parse_scenario(document, f"{address}: scenario")
    return without_none(scenario.model_dump(mode="json", exclude=UNUSED))


def check_points(points: SweepPoints) -> list[Scenario]:
    """Check the values of every axis, with the others at their first; return the scenarios.

    An axis with more values is tried at `VALUES_TRIED` of them, spread evenly, both ends included;
    mistakes in others appear in their rows. Raises `InputError` if a scenario is not valid.
    """
    _check_names(points)
    tried = points.along_each_group(VALUES_TRIED)
    for values in tried:
        _check_types(points, tried[0], values)
    for values in tried:
        _check_search(points, values)
    return [points.scenario(values | points.sweep.search) for values in tried]


def _check_types(points: SweepPoints, first: Mapping[str, Any], values: Mapping[str, Any]) -> None:
    """Refuse tables as values, and values of another type than the first."""
    for key, value in values.items():
        if isinstance(value, dict):
            allowed = f"{key} is a table; vary its keys one by one"
            raise points.definition.mistake("axis.values", value, allowed)
    for key, value in values.items():
        if type(value) is not type(first[key]):
            both = [first[key], value]
            raise points.definition.mistake("axis.values", both, f"{key} changes its type")


def _check_search(points: SweepPoints, values: Mapping[str, Any]) -> None:
    """Refuse a search of too many steps."""
    bisect = points.sweep.bisect
    if bisect is None:
        return
    stop = points.stop(values)
    steps = abs(stop - bisect.start) / bisect.step
    if steps > MAX_SEARCH:
        allowed = f"{steps:.3g} steps to stop = {stop:g}; at most {MAX_SEARCH}"
        raise points.definition.mistake("bisect.step", bisect.step, allowed)


def _check_names(points: SweepPoints) -> None:
    """Refuse keys that no result could hold, or that nothing reads."""
    sweep, definition = points.sweep, points.definition
    read: set[str] = set()
    for column in (sweep.plot.x, sweep.plot.y, sweep.plot.lines, sweep.plot.panels):
        with suppress(ValueError):  # the name of a metric, or of no column
            read |= _names_in(column)
    rules: dict[str, Any] = {f"derive.{key}": rule for key, rule in sweep.derive.items()}
    rules |= {} if sweep.bisect is None else {"bisect.stop": sweep.bisect.stop}
    for key, rule in rules.items():
        try:
            read |= _names_in(rule)
        except ValueError as error:
            raise definition.mistake(key, rule, str(error)) from None
    bounds = () if sweep.bisect is None else sweep.bisect.holds
    used = [("metrics", name) for name in sweep.metrics or ()]
    used += [("plot.metrics", name) for name in sweep.plot.metrics]
    used += [("bisect.holds.metric", bound.metric) for bound in bounds]
    for key, name in used:
        vehicle, _ = split_metric(name)
        if reason := unknown_vehicle(vehicle, points.vehicles):
            raise definition.mistake(key, name, f"no vehicle {vehicle}; {reason}")
    taken = {*RESERVED, *METRICS, *(f"{name}_version" for name in VERSIONS)}
    for key in (*sweep.targets, *sweep.derive):
        if key in taken:
            raise definition.mistake("axis.key", key, "is a column of every result; rename it")
    named = {axis.key for axis in points.cases}
    for key in sweep.targets:
        if "." not in key and key not in read | named:
            allowed = (
                "a name without a dot must be used in [derive] or [plot]; keys of the scenario "
                "have one, as gait.period"
            )
            raise definition.mistake("axis.key", key, allowed)
    for key in sweep.derive:
        if "." not in key:
            allowed = "must be a key of the scenario, as gait.angles"
            raise definition.mistake("derive", key, allowed)


def _names_in(rule: Any) -> set[str]:
    if isinstance(rule, list | tuple):
        return {name for entry in rule for name in _names_in(entry)}
    return names(rule) if isinstance(rule, str) else set()
