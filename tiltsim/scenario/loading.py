"""Reading scenarios: files, variants and overrides merged into one `Scenario`; and writing them."""

from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from os import PathLike, fsdecode
from pathlib import Path
from typing import Any, Final

import tomli_w

from tiltsim.errors import InputError
from tiltsim.models.mjcf_editing import check_mjcf
from tiltsim.scenario.documents import (
    KIND_KEYS,
    check_keys,
    check_no_other,
    has_other_keys,
    merge,
    own_title,
    plain,
    refuse_replaced,
    split_key,
    value_at,
)
from tiltsim.scenario.library import check_limits, find_scenario_file, library_name, read_toml
from tiltsim.scenario.messages import choose, did_you_mean, show
from tiltsim.scenario.own_parts import (
    controller_table,
    drop_what_own_controllers_ignore,
    given_parts,
    is_trusted,
    kept_functions,
    replace_tables,
    sample_functions,
    with_trust,
)
from tiltsim.scenario.scenario import Scenario, Variant
from tiltsim.scenario.scenario_tables import DESCRIPTIVE
from tiltsim.scenario.table import in_one_line
from tiltsim.system.text import short_repr, shortened, valid_unicode

FILE_KEYS: Final = (
    ("controller", "function", ".py:"),
    ("vehicle", "mjcf", ""),
    ("reference", "file", ""),
    ("gait", "file", ""),
    ("object", "file", ""),
    ("companion", "scenario", ".toml"),
)
"""Keys that name files: table, key, and a string that marks the value as a file name."""


def load_scenario(
    source: Scenario | str | PathLike[str] | Mapping[str, Any],
    overrides: Mapping[str, Any] | None = None,
    *,
    controller: object = None,
    reference: object = None,
    gait: object = None,
    trusted: bool = False,
) -> Scenario:
    """Read a scenario.

    Args:
        source: The name of a scenario in the library or a TOML file, with ``#variant`` for a member
            of a family, for example ``"ch04_tracking/setpoint#rho_065_modified"``; or the tables of
            a file as a dict; or a scenario, to change it.
        overrides: Values by dotted key in the units of docs/scenario.md, for example
            ``{"gait.period": 2.0, "gait.angles[0]": 0.1}``. Arrays are taken as lists, here and in
            a dict. A family without ``#variant`` needs them or a controller, and is its base then.
        controller: A custom controller, which replaces the scenario's before anything is
            checked; the overrides then have no other law or function. It is a function from
            `tiltsim.Observation` to `tiltsim.Command`, an object with ``__call__`` and maybe
            ``reset(scenario)``, a class of these, or ``"FILE.py:NAME"``; or a function marked
            `tiltsim.law`, or an object or subclass of `tiltsim.LawController`.
        reference: A custom motion in place of the scenario's ``[reference]``, of which roll,
            pitch, yaw and acceleration_feedforward stay: a function of time (s) that returns a
            position ``(x, y, z)`` (m), or these with roll, pitch and yaw (rad), sampled every 0.01
            s over the duration of the flight, also of one with another duration that is made of
            this scenario; or a table with the columns time, x, y and z, maybe roll, pitch and yaw:
            of pandas or Arrow, a dict of arrays, or the name of a CSV or Parquet file. The
            overrides are keys of the new table, such as ``{"reference.interpolation": "cubic"}``.
        gait: A custom gait in place of the scenario's ``[gait]``, as the reference: a function
            that returns four tilt angles (rad), or a table with the columns time and alpha_1 to
            alpha_4.
        trusted: Whether the Python file that the scenario names may be executed, by whatever takes
            the scenario. The file of ``controller`` may in any case.

    Raises:
        InputError: In one line: the file, the key, the value and the allowed values.
    """
    overrides = {} if overrides is None else overrides
    check_keys("overrides", overrides)
    given = given_parts(controller=controller, reference=reference, gait=gait)
    document, address = _document(source, with_base=bool(overrides) or controller is not None)
    check_no_other(overrides, given)
    title_before = own_title(document)
    if controller is not None:
        document["controller"] = controller_table(controller)
    replace_tables(document, given)
    if given and document.get("title", "") in (title_before, _title_in_file(source, address)):
        document["title"] = own_title(document)
        document.pop("source", None)
    emptied = apply_overrides(document, overrides, address)
    if controller is not None or "controller.law" in emptied:
        drop_what_own_controllers_ignore(document, overrides)
    own = kept_functions(source, overrides, given)
    sample_functions(document, own)
    locate_named_files(document, Path())
    scenario = _parse(document, address, emptied)
    scenario._own = own
    named = controller is not None or (isinstance(source, Scenario) and source._trusted)
    return with_trust(scenario, named or is_trusted(trusted))


def _title_in_file(source: object, address: str) -> object:
    """The title in the file of a scenario; empty without a file, as for a dict."""
    if not isinstance(source, Mapping):
        with suppress(InputError):
            return _document(address, with_base=True)[0].get("title", "")
    return ""


def as_scenario(source: Scenario | str | PathLike[str] | Mapping[str, Any]) -> Scenario:
    """A scenario itself, or the one that `load_scenario` reads."""
    return source if isinstance(source, Scenario) else load_scenario(source)


def _document(source: object, *, with_base: bool) -> tuple[dict[str, Any], str]:
    """The tables of a source, free to change, and its name; ``with_base`` allows a family."""
    if isinstance(source, Scenario):
        # Without defaults, as a change of one key may change the default of another.
        given = source.model_dump(mode="json", exclude_unset=True)
        return without_none(given), source.address or "scenario"
    if isinstance(source, Mapping):
        check_keys("scenario", source)
        return plain(source), "scenario"
    if not isinstance(source, str | PathLike):
        raise InputError(
            f"scenario = {short_repr(source)}: must be a name of the library, a TOML file, a dict "
            "or a tiltsim.Scenario"
        )
    name, _, variant = fsdecode(source).partition("#")
    file = find_scenario_file(name)
    document = read_toml(file)
    address = library_name(file) + (f"#{variant}" if variant else "")
    if {"axis", "bisect"} & document.keys():
        raise InputError(f"{address}: this is a sweep: tiltsim sweep {library_name(file)}")
    names = variant_names(file, document)
    if variant:
        document = _select_variant(file, document, variant)
    elif names and not with_base:
        raise InputError(f"{address}: choose a variant with #: {', '.join(names)}")
    document.pop("variant", None)
    locate_named_files(document, file.parent, address)
    return document, address


def as_in_file(path: str | Path) -> Scenario | None:
    """The scenario of a file without changes; None if only changes complete it, as a base."""
    with suppress(InputError):
        return load_scenario(path, trusted=True)
    return None


def is_changed_from_library(path: str | Path, scenario: Scenario, in_file: Scenario | None) -> bool:
    """Whether a scenario read from a path is one of the library, but not flown as it is there.

    Plant and engine may differ, and keys that only describe and judge the flight. ``in_file`` is
    the result of `as_in_file`.
    """
    file = find_scenario_file(str(path).partition("#")[0])
    if library_name(file) == str(file):
        return False
    return in_file is None or _flown(scenario) != _flown(in_file)


def _flown(scenario: Scenario) -> dict[str, Any]:
    """The keys that decide a flight on any plant and engine."""
    document = scenario.model_dump(exclude={*DESCRIPTIVE})
    return document | {"simulation": document["simulation"] | {"plant": None, "engine": None}}


def locate_named_files(
    document: Mapping[str, Any], folder: Path, address: str | None = None
) -> None:
    """Make the file names in a document absolute.

    Args:
        document: Changed in place.
        folder: Folder to which they are relative.
        address: Name of the document in messages, if it is a file in that folder; the Python code
            that it names must then also lie there. None allows any place.

    Raises:
        InputError: If the code lies elsewhere.
    """
    for keys, table, key, is_code in _file_keys(document):
        name = keys[key]
        if address is not None and is_code and not _lies_in(folder, name.rpartition(":")[0]):
            raise InputError(
                f"{address}: {table}.{key} = {show(name)}: must lie in the folder of the "
                "scenario file, by a relative path; for other files use tiltsim run "
                "--controller FILE.py:NAME"
            )
        keys[key] = str((folder / name).absolute())


def named_files(document: Mapping[str, Any]) -> set[Path]:
    """The files that a document names, with all files that its MJCF can include and name."""
    files: set[Path] = set()
    for keys, _, key, is_code in _file_keys(document):
        file = Path(keys[key].rpartition(":")[0] if is_code else keys[key])
        files.add(file)
        with suppress(ValueError, OSError):  # where it is flown, it is refused
            files |= check_mjcf(file) if key == "mjcf" else set()
    return files


def _file_keys(document: Mapping[str, Any]) -> Iterator[tuple[dict[str, Any], str, str, bool]]:
    """The tables of a document that name a file: their names, the key, and whether it is code."""
    for table, key, mark in FILE_KEYS:
        found = document.get(table)
        for keys in found if isinstance(found, list) else [found]:
            if not isinstance(keys, dict):
                continue
            name = keys.get(key)
            if isinstance(name, str) and mark in name:
                yield keys, table, key, mark == ".py:"


def _lies_in(folder: Path, name: str) -> bool:
    """Whether a relative path stays in a folder, links followed."""
    try:
        inside = (folder / name).resolve().is_relative_to(folder.resolve())
    except (OSError, RuntimeError, ValueError):  # links in a circle, a NUL in the name
        return False
    return inside and not Path(name).is_absolute()


def apply_overrides(
    document: dict[str, Any], overrides: Mapping[str, Any], address: str
) -> list[str]:
    """Set values in a document. Returns the kind keys, dotted, that emptied their table.

    Args:
        document: Changed in place.
        overrides: Values by dotted key; entries of lists as ``gait.angles[0]``.
        address: Name of the document in messages.

    Raises:
        InputError: If a key does not exist, or one would replace the table or list of another.
    """
    # A copy, as entries of lists are set in it; kinds first, since a new one empties its table.
    items = plain(overrides).items()
    given = sorted(items, key=lambda item: item[0].rpartition(".")[2] not in KIND_KEYS)
    refuse_replaced(given, address)
    return [key for key, value in given if _override(address, document, key, value)]


def parse_scenario(document: Mapping[str, Any], address: str = "scenario") -> Scenario:
    """Validate a scenario's document.

    Args:
        document: Plain dicts and lists, as read from TOML.
        address: Name of the document in messages.

    Raises:
        InputError: See `load_scenario`.
    """
    if not isinstance(document, Mapping):
        raise InputError(f"scenario = {short_repr(document)}: must be a dict")
    if not isinstance(address, str):
        raise InputError(f"address = {short_repr(address)}: must be text")
    return _parse(document, address)


def _parse(document: Mapping[str, Any], address: str, emptied: Collection[str] = ()) -> Scenario:
    """Validate a document; ``emptied`` is the result of `apply_overrides`."""
    check_limits(document := plain(document), address)
    scenario = Scenario.model_validate(document, address=address, emptied=emptied)
    scenario._address = valid_unicode(address)
    return scenario


def variant_names(file: Path, document: Mapping[str, Any]) -> list[str]:
    """The names of a file's variants, in order. Raises `InputError` if one is bad or repeated."""
    names: list[str] = []
    variants = document.get("variant", [])
    if not isinstance(variants, list):
        raise InputError(f"{file}: variant = {show(variants)}: write [[variant]] tables")
    for table in variants:
        with in_one_line(f"{file}: variant", table, Variant):
            names.append(Variant.model_validate(table).name)
        if names[-1] in names[:-1]:
            raise InputError(f"{file}: variant.name = {names[-1]!r}: used twice")
    return names


def _select_variant(file: Path, document: dict[str, Any], name: str) -> dict[str, Any]:
    names = variant_names(file, document)
    if name not in names:
        allowed = choose(name, names) if names else "the file has no variants"
        raise InputError(f"{library_name(file)}#{shortened(name)}: no such variant; {allowed}")
    base = {key: value for key, value in document.items() if key != "variant"}
    chosen = dict(document["variant"][names.index(name)])
    del chosen["name"]
    expectations = [base.pop("expect", []), chosen.pop("expect", [])]
    merged = merge(base, chosen)
    # A value that is not a list is passed on, to be refused under its own key.
    wrong = [value for value in expectations if not isinstance(value, list)]
    merged["expect"] = wrong[0] if wrong else [*expectations[0], *expectations[1]]
    return merged


def _override(address: str, document: dict[str, Any], key: str, value: object) -> bool:
    """Set one value. Returns whether it emptied its table, which has other keys for it."""
    *path, last = split_key(key)
    target: Any = document
    for step in path:
        target = _enter(target, step)
    if isinstance(last, int):
        if not isinstance(target, list) or last >= len(target):
            raise InputError(
                f"{address}: {key} = {show(value)}: no such entry; "
                f"{_entries_instead(document, key.rpartition('[')[0])}"
            )
    elif not isinstance(target, dict):
        name = key.rpartition(".")[0]
        is_list = isinstance(target, list)
        reason = f"is a list; write {name}[{last}]" if is_list else "is not a table"
        raise InputError(f"{address}: {key} = {show(value)}: {name} {reason}")
    empties = last in KIND_KEYS and has_other_keys(target.get(last, KIND_KEYS[last]), value)
    if empties:
        target.clear()
    target[last] = value
    return empties


def _entries_instead(document: dict[str, Any], whole: str) -> str:
    """Advice for an entry beyond the end of a list, or of a list that does not exist."""
    above, _, name = whole.rpartition(".")
    table = value_at(document, above)
    lists = table.items() if isinstance(table, dict) else ()
    lengths = {key: len(value) for key, value in lists if isinstance(value, list)}
    if name in lengths:
        return f"{whole} has {lengths[name]}, from {whole}[0]"
    hint = "" if "[" in name else did_you_mean(name, lengths)
    return f"{hint}give the whole list {whole}"


def _enter(target: object, step: str | int) -> object:
    """The value under one step of a key; a missing table is created empty."""
    if isinstance(step, int):
        return target[step] if isinstance(target, list) and step < len(target) else None
    return target.setdefault(step, {}) if isinstance(target, dict) else None


def scenario_toml(scenario: Scenario) -> str:
    """A scenario with all defaults filled in, as TOML that reads back to the same scenario."""
    return tomli_w.dumps(without_none(scenario.model_dump(mode="json")))


def without_none(value: Any) -> Any:
    """A document without the keys whose value is None, which TOML cannot express."""
    if isinstance(value, dict):
        return {key: without_none(item) for key, item in value.items() if item is not None}
    if isinstance(value, list | tuple):
        return [without_none(item) for item in value]
    return value
