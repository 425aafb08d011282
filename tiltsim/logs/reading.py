"""Reading logs: MCAP, ULog, CSV and Parquet become columns in tiltsim's names and frames.

Maps from the signals of a log to tiltsim's columns are TOML files, or the map of PX4's topics.
"""

from os import PathLike
from pathlib import Path
from typing import Final, Literal

import numpy as np
from pydantic import Field
from scipy.spatial.transform import Rotation

from tiltsim.errors import InputError
from tiltsim.flight.flight import VECTORS
from tiltsim.flight.reading import flight_file
from tiltsim.logs import formats
from tiltsim.logs.formats import Signals
from tiltsim.logs.log import LOG_SUFFIXES, UNITS, Log
from tiltsim.scenario.library import read_toml
from tiltsim.scenario.messages import choose, did_you_mean
from tiltsim.scenario.table import NotTiny, Table, default, in_one_line, required
from tiltsim.scenario.time_table import csv_fields, csv_rows
from tiltsim.system.files import is_file, is_folder
from tiltsim.system.parquet import open_parquet
from tiltsim.system.text import printable, short_repr
from tiltsim_controllers.mathematics.attitude import FLIP
from tiltsim_controllers.mathematics.scalar import Floats

SUFFIXES: Final = (*LOG_SUFFIXES, ".parquet")

WORLD_VECTORS: Final = (VECTORS["position"], VECTORS["velocity"])
BODY_VECTORS: Final = (VECTORS["body_rates"], tuple(f"accelerometer_{axis}" for axis in "xyz"))


class Signal(Table):
    """A signal of the log, times a scale, plus an offset."""

    signal: str = required("name in the log, such as actuator_motors.control[0]")
    scale: float = default(1.0, "factor to tiltsim's unit")
    offset: float = default(0.0, "added after the factor, in tiltsim's unit")


class LogMap(Table):
    """Where the columns of a log come from, and its frames."""

    world: Literal["z_up", "ned"] = default(
        "z_up", "axes of position and velocity: z up, or north, east, down"
    )
    body: Literal["flu", "frd"] = default(
        "flu", "axes of body rates and accelerations: forward, left, up, or forward, right, down"
    )
    attitude: tuple[str, ...] = Field(
        (),
        strict=False,
        description="signals of the rotation from body to world: four of a quaternion, w x y z, "
        "or three of roll, pitch and yaw in rad",
    )
    max_gap: NotTiny = default(
        0.2, "longest time between samples of a signal that is interpolated [s]"
    )
    columns: dict[str, str | Signal] = Field(
        default_factory=dict,
        description="a signal, or a table of signal, scale and offset, for each column",
    )

    def _check_values(self) -> None:
        if len(self.attitude) not in {0, 3, 4}:
            allowed = "three signals (roll, pitch, yaw) or four (w, x, y, z)"
            raise self.mistake("attitude", allowed)
        angles = {"roll", "pitch", "yaw"} & {*self.columns}
        if angles:
            raise self.mistake("columns", f"give {min(angles)} by the key attitude")
        for name in self.columns:
            if name not in UNITS or name == "time":
                raise self.mistake("columns", f"column {name!r} is unknown; {choose(name, UNITS)}")


PX4: Final = LogMap(
    world="ned",
    body="frd",
    attitude=tuple(f"vehicle_attitude.q[{i}]" for i in range(4)),
    columns={
        **{name: f"vehicle_local_position.{name}" for each in WORLD_VECTORS for name in each},
        **{rate: f"vehicle_angular_velocity.xyz[{i}]" for i, rate in enumerate("pqr")},
        **{
            f"accelerometer_{axis}": f"sensor_combined.accelerometer_m_s2[{i}]"
            for i, axis in enumerate("xyz")
        },
        **{f"rotor_command_{i + 1}": f"actuator_motors.control[{i}]" for i in range(12)},
        **{f"alpha_command_{i + 1}": f"actuator_servos.control[{i}]" for i in range(8)},
    },
)
"""PX4's topics as they are; commands are fractions of full speed and of full travel."""


def read_map(file: Path) -> LogMap:
    """Read a map from a TOML file. Raises `InputError` in one line: file, key, value, allowed."""
    if not is_file(file):
        raise InputError(f"{file}: no such file")
    document = read_toml(file)
    with in_one_line(f"{file}", document, LogMap):
        return LogMap.model_validate(document)


def read_log(
    path: str | PathLike[str],
    map: str | PathLike[str] | None = None,  # noqa: A002
) -> Log:
    """Read a log of a real vehicle or of another tool, or a flight.

    Args:
        path: FILE.mcap, .ulg, .csv or .parquet, or the folder of a flight.
        map: A TOML file that names a signal for each column, see docs/logs.md. Not needed for
            exported flights, for CSV files with tiltsim's names, and for PX4's topics.

    Returns:
        Columns over the times of the position, or of the attitude where there is none; other
        signals are interpolated, commands held. Defects stand in `Log.notes`, a line each.

    Raises:
        InputError: If the file cannot be read, or the map does not fit it.
    """
    for name, value in {"path": path, "map": map}.items():
        if value is not None and not isinstance(value, str | PathLike):
            raise InputError(f"{name} = {short_repr(value)}: must be the name of a file")
    file = Path(path)
    if is_folder(file):
        file = flight_file(file)
    if not is_file(file):
        raise InputError(f"{file}: no such file")
    suffix = file.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{file}: a log ends with {', '.join(SUFFIXES)}")
    if suffix == ".parquet":
        return _read_parquet(file)
    information: dict[str, str] = {}
    if suffix == ".csv":
        signals = _read_csv(file, needs_time=map is None)
    else:
        signals, information = (formats.read_mcap if suffix == ".mcap" else formats.read_ulog)(file)
    if map is not None:
        return _mapped(file, signals, read_map(Path(map)))
    for sample in (f"{formats.MCAP_SAMPLE}.", f"{formats.ULOG_SAMPLE}."):
        names = [name.removeprefix(sample) for name in signals if name.startswith(sample)]
        if names:
            return _exported(file, {name: signals[sample + name][1] for name in names}, information)
    if suffix == ".csv":
        return _exported(file, {name: values for name, (_, values) in signals.items()}, {})
    if "vehicle_local_position.x" in signals or "vehicle_attitude.q[0]" in signals:
        there = {name: one for name, one in PX4.columns.items() if one in signals}
        attitude = PX4.attitude if PX4.attitude[0] in signals else ()
        chart = PX4.model_copy(update={"columns": there, "attitude": attitude})
        return _mapped(file, signals, chart)
    found = ", ".join(list(signals)[:8]) or "no numbers"
    raise InputError(
        f"{file}: give a map (--map FILE) from its signals, such as {printable(found)}"
    )


def _exported(file: Path, columns: dict[str, Floats], information: dict[str, str]) -> Log:
    """Columns that have tiltsim's names, as they are."""
    columns = {"time": columns["time"], **columns}  # the first one
    columns.pop("timestamp", None)
    _check_times(file, columns["time"])
    units = {name: information.get(f"unit_{name}", UNITS.get(name, "-")) for name in columns}
    origin = {key: text for key, text in information.items() if not key.startswith("unit_")}
    notes = () if origin else tuple(_defects(columns))
    by_name = {name: np.ascontiguousarray(column) for name, column in columns.items()}
    return Log(str(file), by_name, units, notes, origin)


def _mapped(file: Path, signals: Signals, chart: LogMap) -> Log:
    """The columns of a map, in tiltsim's frames, at the times of one of them."""
    sources = {
        name: one if isinstance(one, Signal) else Signal(signal=one)
        for name, one in chart.columns.items()
    }
    named = [*chart.attitude, *(one.signal for one in sources.values())]
    for name in named:
        if name not in signals:
            hint = did_you_mean(name, signals) or f"found {', '.join(list(signals)[:8])} "
            raise InputError(f"{file}: signal {printable(name)}: not in this log; {hint.strip()}")
    if not named:
        raise InputError(f"{file}: the map names no signal")
    base = signals[sources["x"].signal if "x" in sources else named[0]][0]
    time = np.unique(base[np.isfinite(base)])
    notes = []
    if len(time) < len(base):
        notes.append(f"{len(base) - len(time)} of {len(base)} times are repeated, or no numbers")
    _check_times(file, time)
    columns = {"time": time - time[0]}
    for name, one in sources.items():
        held = "command" in name
        column = _at(time, signals[one.signal], chart.max_gap, held=held)
        columns[name] = one.scale * column + one.offset
    world = FLIP if chart.world == "ned" else np.ones(3)
    body = FLIP if chart.body == "frd" else np.ones(3)
    for vectors, signs in ((WORLD_VECTORS, world), (BODY_VECTORS, body)):
        for name, sign in ((name, s) for each in vectors for name, s in zip(each, signs)):
            if name in columns:
                columns[name] = columns[name] * sign + 0.0
    if chart.attitude:
        turned = np.stack(
            [_at(time, one, chart.max_gap) for one in _continuous(signals, chart.attitude)], axis=1
        )
        columns |= _attitude(file, turned, world, body)
    order = [name for name in UNITS if name in columns]
    notes += _defects(columns)
    by_name = {name: columns[name] for name in order}
    return Log(str(file), by_name, {name: UNITS[name] for name in order}, tuple(notes))


def _continuous(signals: Signals, names: tuple[str, ...]) -> list[tuple[Floats, Floats]]:
    """Signals of an attitude without jumps: of a quaternion's sign, or by a full turn."""
    times = signals[names[0]][0]
    values = np.stack([signals[name][1] for name in names], axis=1)
    if len(names) == 3:
        values = np.unwrap(values, axis=0)
    else:
        aligned = np.sum(values[1:] * values[:-1], axis=1) >= 0.0
        values[1:] *= np.cumprod(np.where(aligned, 1.0, -1.0))[:, None]
    return [(times, column) for column in values.T]


def _attitude(file: Path, turned: Floats, world: Floats, body: Floats) -> dict[str, Floats]:
    """Roll, pitch and yaw (rad) in tiltsim's frames."""
    finite = np.isfinite(turned).all(axis=1)
    if turned.shape[1] == 4 and (np.linalg.norm(turned[finite], axis=1) < 0.5).any():
        raise InputError(
            f"{file}: attitude: no unit quaternions; are its signals in order w x y z?"
        )
    given = turned[finite]
    rotation = (
        Rotation.from_quat(given[:, [1, 2, 3, 0]])
        if turned.shape[1] == 4
        else Rotation.from_euler("ZYX", given[:, ::-1])
    )
    angles = np.full((len(turned), 3), np.nan)
    own = Rotation.from_matrix(world[:, None] * rotation.as_matrix() * body)
    angles[finite] = np.unwrap(own.as_euler("ZYX")[:, ::-1], axis=0)
    return dict(zip(("roll", "pitch", "yaw"), angles.T, strict=True))


def _at(
    time: Floats, signal: tuple[Floats, Floats], max_gap: float, *, held: bool = False
) -> Floats:
    """A signal at other times, NaN in its gaps and before and after it."""
    known = np.isfinite(signal[0]) & np.isfinite(signal[1])
    stamps, first = np.unique(signal[0][known], return_index=True)
    values = signal[1][known][first]
    if len(stamps) == 0:
        return np.full(len(time), np.nan)
    after = np.searchsorted(stamps, time, side="right").clip(1, len(stamps) - 1)
    before = np.maximum(after - 1, 0)
    found = np.interp(time, stamps, values)
    if held:
        found = values[np.where(time >= stamps[after], after, before)]
    outside = (time < stamps[0] - max_gap) | (time > stamps[-1] + max_gap)
    between = (time > stamps[before]) & (time < stamps[after])
    found[outside | (between & (stamps[after] - stamps[before] > max_gap))] = np.nan
    return found


def _check_times(file: Path, time: Floats) -> None:
    if len(time) < 2:
        raise InputError(f"{file}: {len(time)} samples; at least 2")
    if not np.isfinite(time).all() or (np.diff(time) <= 0.0).any():
        raise InputError(f"{file}: time: must be finite and increase from row to row")


def _defects(columns: dict[str, Floats]) -> list[str]:
    """Gaps, missing values and constant columns, a line each."""
    notes = []
    steps = np.diff(columns["time"])
    usual = float(np.median(steps))
    gaps = np.flatnonzero(steps > 5.0 * usual)
    if len(gaps):
        longest = gaps[np.argmax(steps[gaps])]
        at = columns["time"][longest]
        count = f"{len(gaps)} gap" + "s" * (len(gaps) > 1)
        notes.append(f"{count} between samples, the longest {steps[longest]:.3g} s at {at:.3g} s")
    for name, column in columns.items():
        missing = int(np.count_nonzero(~np.isfinite(column)))
        if missing == len(column):
            notes.append(f"{name}: no values")
        elif missing:
            notes.append(f"{name}: no value in {missing} of {len(column)} samples")
    still = [
        name
        for name, column in columns.items()
        if name in UNITS and "_ref" not in name and len({*column[np.isfinite(column)]}) == 1
    ]
    if still:
        notes.append(f"constant: {', '.join(still)}")
    return notes


def _read_csv(file: Path, *, needs_time: bool) -> Signals:
    """The columns of a CSV file; empty fields are NaN."""
    rows = csv_fields(file)
    if len(rows) < 2:
        raise InputError(f"{file}: {len(rows)} rows; needs a line of names and numbers below it")
    names, *lines = rows
    if "time" not in names:
        found = short_repr(names)
        raise InputError(f"{file}: no column time (s); separate columns by commas; found {found}")
    if len({*names}) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"{file}: column {printable(twice)}: twice")
    if needs_time and not {*names} & {*UNITS} - {"time"}:
        found = short_repr(names)
        raise InputError(f"{file}: no column of tiltsim's; give a map (--map FILE); found {found}")
    try:
        table = np.array([*csv_rows(names, lines, "nan")])
    except InputError as error:
        raise InputError(f"{file}: {error}") from None
    time = table[:, names.index("time")]
    return {name: (time, table[:, place].copy()) for place, name in enumerate(names)}


def _read_parquet(file: Path) -> Log:
    """A flight, or an imported log."""
    with open_parquet(file) as opened:
        table = opened.read()
    metadata = {
        key.decode(errors="replace"): text.decode(errors="replace")
        for key, text in (table.schema.metadata or {}).items()
    }
    if "time" not in table.column_names or not {"scenario", "log"} & {*metadata}:
        raise InputError(f"{file}: neither a flight nor an imported log")
    try:
        columns = {name: table[name].to_numpy() * 1.0 for name in table.column_names}
    except (TypeError, ValueError):
        raise InputError(f"{file}: damaged: a column is not numbers") from None
    _check_times(file, columns["time"])
    units = {
        one.name: (one.metadata or {}).get(b"unit", b"-").decode(errors="replace")
        for one in table.schema
    }
    origin = metadata if "scenario" in metadata else {}
    origin.pop("tiltsim_sha256", None)
    return Log(str(file), columns, units, () if origin else tuple(_defects(columns)), origin)
