"""The signals of a flight in panels over time, for its page, its plots in Rerun and its videos.

Panels follow from the columns: components of a vector and numbered columns of one name share a
panel, ``NAME_ref`` is the reference of ``NAME``, ``NAME_lower`` and ``NAME_upper`` bound it. So a
column of a new law, vehicle or sensor has its panel at once. `_chosen` adds titles, limits and
signals computed from several columns.
"""

import re
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final, NamedTuple

import numpy as np

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.flight.flight import FIRST, VECTORS, Flight, components
from tiltsim.laws.law import SUPERVISION
from tiltsim.scenario.vehicle import VehicleTable
from tiltsim.system.text import Quantity, in_words, subscript
from tiltsim.views.attitude_plane import margin_threshold
from tiltsim_controllers.mathematics.scalar import Floats

FLOORS: Final = {"m": 0.02, "rad": 0.02, "m/s": 0.02, "rad/s": 0.02, "N": 0.02}
"""Smallest range of an axis by its unit: smaller differences are as good as none."""

SMALLEST: Final = 1e-3  # smallest range in any other unit
END_FRACTION: Final = 0.02  # of a diverged flight's samples: its end, of any magnitude
MAX_WIDENING: Final = 4.0  # factor by which this end may widen the range of a panel
AXES: Final = "xyz"
ANGLES: Final = ("roll", "pitch", "yaw")


CONTACT: Final = "contact_force"
TENSION: Final = "cable_tension"
OF_OBJECTS: Final = (CONTACT, "push_force", TENSION, "swing")
OF_WORLD: Final = (f"{CONTACT}s", *OF_OBJECTS[1:])
"""Panels of columns that objects and loads add; and of these beside panels of several vehicles."""


class Signal(NamedTuple):
    """A line of a panel."""

    name: str  # of its entity in Rerun, below the panel's
    label: str
    values: str | Callable[[Flight], Floats]  # a column, or computed from several
    reference: str = ""  # the column of its reference

    def of(self, flight: Flight) -> Floats:
        """Its values, one per sample."""
        return flight[self.values] if isinstance(self.values, str) else self.values(flight)


class Level(NamedTuple):
    """A horizontal line of a panel."""

    name: str
    label: str
    value: float


@dataclass(frozen=True)
class Signals:
    """Signals of one unit, which share a panel."""

    name: str  # name of the panel, and of its entity in Rerun, see `path`
    title: str  # title of the panel
    unit: str  # unit of its axis
    lines: Sequence[Signal]  # lines over time
    levels: Sequence[Level] = ()  # horizontal lines
    bounds: Sequence[str] = ()  # columns of the lowest and highest admissible value
    compared: Sequence[Signal] = ()  # signals that Rerun compares between flights, one plot each
    detail: str = ""  # description of the lines, between title and unit
    floor: float = 0.0  # smallest range of the axis; 0 for the default in `FLOORS`
    settling: float = 0.0  # time (s) at the start that the range ignores
    latest: float = 0.0  # part (s) of flights more than twice as long that pages show; 0 for all
    moves: bool = False  # whether it moves with the gait
    on_request: bool = False  # whether pages show it only on request
    plotted: bool = True  # whether the first tab of Rerun's plots has it
    of_vehicles: bool = False  # whether each line is a vehicle's, in its color

    @property
    def path(self) -> str:
        """The entity of the panel in Rerun."""
        return "singularity" if self.name == "margin" else self.name

    @property
    def text(self) -> str:
        """Title and unit."""
        return Quantity(f"{self.title} {self.detail}".strip(), self.unit).text

    @property
    def least(self) -> float:
        """Smallest range of the axis."""
        return self.floor or FLOORS.get(self.unit, SMALLEST)


def range_of(shown: Sequence[tuple[Signals, Flight]]) -> tuple[float, float]:
    """The range of an axis for a panel of each of some flights, with levels and references."""
    drawn, ended = [], []
    for panel, flight in shown:
        whole = flight["time"] >= min(panel.settling, 0.5 * flight["time"][-1])
        names = [*filter(None, (line.reference for line in panel.lines)), *panel.bounds]
        values = [line.of(flight) for line in panel.lines] + [flight[name] for name in names]
        drawn += [one[whole] for one in values]
        ended += [flight.end.kind != "completed"] * len(values)
    first = shown[0][0]
    drawn += [np.array([level.value]) for level in first.levels]
    return scale(drawn, [*ended, *[False] * len(first.levels)], first.least)[:2]


def scale(
    drawn: Sequence[Floats], ended: Sequence[bool], least: float
) -> tuple[float, float, bool]:
    """Lower and upper end of an axis, and whether a line ends off its scale.

    The last samples of lines whose flights ``ended`` early can be of any magnitude, which would
    make all others a flat line. ``least`` is the smallest range.
    """
    before = [
        line[: -max(1, round(END_FRACTION * len(line)))] if early and len(line) > 1 else line
        for line, early in zip(drawn, ended, strict=True)
    ]
    (low, high), (lowest, highest) = _ends(before), _ends(drawn)
    tolerance = max(high - low, 1e-3 * max(abs(low), abs(high)), 1e-6)
    off = any(ended) and highest - lowest > MAX_WIDENING * tolerance
    low, high = (low, high) if off else (lowest, highest)
    pad = 0.3 * max(high - low, 0.1 * abs(high), 1e-2) if off else 0.05 * (high - low)
    # Differences in the last digits of equal numbers are rounding.
    short = 0.5 * max(least, 1e-6 * max(abs(low), abs(high))) - (0.5 * (high - low) + pad)
    return low - pad - max(short, 0.0), high + pad + max(short, 0.0), off


def _ends(lines: Sequence[Floats]) -> tuple[float, float]:
    known = [line for line in lines if line.size] or [np.zeros(1)]
    return min(float(line.min()) for line in known), max(float(line.max()) for line in known)


def signals_of(assembly: Assembly) -> dict[str, Signals]:
    """All panels over time of a flight by their names; panels on request come last."""
    chosen = {panel.name: panel for panel in _chosen(assembly)}
    drawn: set[Any] = {"time"}
    for panel in chosen.values():
        drawn |= {*panel.bounds}.union(*((line.values, line.reference) for line in panel.lines))
    # The columns of companions are their own flights'.
    hidden = [f"{table.name}_" for table in assembly.scenario.companion]
    hidden += [] if assembly.scenario.vehicle.has_tilting_rotors else ["alpha"]
    left = {name for name in assembly.loop.units if not name.startswith((*hidden,))} - drawn
    others = {
        name: vector_signals(assembly, name, columns)
        for name, columns in stems(assembly.loop.units).items()
        if left & {*columns} and name not in chosen
    }
    return chosen | others


def stems(columns: Collection[str]) -> dict[str, list[str]]:
    """Columns by the name that they share, as ``air_v`` of ``air_vx``; references left out."""
    vector_of = {part: name for name, parts in VECTORS.items() for part in parts}
    found: dict[str, list[str]] = {}
    for column in columns:
        name = vector_of.get(column) or re.sub(r"(_[xyz]|(?<=v)[xyz]|_\d+)$", "", column)
        if not (column.endswith("_ref") and column.removesuffix("_ref") in columns):
            found.setdefault(name, []).append(column)
    return {name if len(parts) > 1 else parts[0]: parts for name, parts in found.items()}


def reference_of(assembly: Assembly, column: str) -> str:
    """The column with the reference of another; empty for none, as for an unrecorded lean."""
    scenario, name = assembly.scenario, f"{column}_ref"
    unrecorded = column in ("roll", "pitch") and not scenario.controller.records_attitude(scenario)
    return name if name in assembly.loop.units and not unrecorded else ""


def vector_signals(assembly: Assembly, name: str, columns: Sequence[str]) -> Signals:
    """The panel of some columns, shown on request."""
    known = [assembly.loop.label(column) for column in columns]
    lines = [
        Signal(column, label, column, reference_of(assembly, column))
        for column, (label, _) in zip(columns, known, strict=True)
    ]
    title = in_words(name) if len(columns) > 1 else known[0].label
    title = title[:1].upper() + title[1:] if title.isascii() else title
    about: dict[str, Any] = {"moves": True, "on_request": True, "plotted": False}
    return Signals(name, title, known[0].unit, lines, **about)


def _chosen(assembly: Assembly) -> Iterator[Signals]:
    """Panels whose titles, limits or signals the columns alone do not give."""
    units, scenario = assembly.loop.units, assembly.scenario
    if "roll" in units:
        angles = [Signal(name, name, name, reference_of(assembly, name)) for name in ANGLES]
        compared = [angle._replace(label=angle.name.capitalize()) for angle in angles[:2]]
        yield Signals("attitude", "Attitude", "rad", angles, compared=compared, moves=True)
    if "alpha_1" in units and scenario.vehicle.has_tilting_rotors:
        tilts = enumerate(components("tilt_angles", units), start=1)
        lines = [Signal(name, f"α{subscript(i)}", name, f"alpha_ref_{i}") for i, name in tilts]
        yield Signals("tilt_angles", "Tilt angles", "rad", lines, moves=True)
    if "direction" in units:
        yield from _direction(assembly)
    elif rotors := assembly.loop.kind.rotors:
        limits = zip(("min", "max"), scenario.vehicle.rotor_range, strict=True)
        levels = [Level(name, f"{name} limit", at) for name, at in limits if at is not None]
        lines = [Signal(f"rotor_{i}", f"{i}", partial(along_spin, rotor=i)) for i in rotors]
        slowest = [Signal("slowest", "Slowest rotor and limits", along_spin)]
        about: dict[str, Any] = {"detail": "along the spin", "floor": 20.0, "moves": True}
        yield Signals("rotor_speeds", "Rotor speeds", "rad/s", lines, levels, (), slowest, **about)
    if "singularity_margin" in units:
        threshold = margin_threshold(scenario)
        line = Signal("margin", "margin", "singularity_margin")
        lines = [line, Signal(SUPERVISION, "supervisor, 0 to 1", SUPERVISION)]
        levels = [Level("threshold", f"threshold {threshold:g}", threshold)]
        levels.append(Level("singular", "singular", 0.0))
        compared = [line._replace(label="Singularity margin and threshold")]
        lines = lines if SUPERVISION in units else [line]
        yield Signals("margin", "Singularity margin", "rad", lines, levels, compared=compared)
    axes = [axis for axis in AXES if f"{axis}_ref" in units]
    axes = axes if assembly.follows_position else [axis for axis in axes if axis == "z"]
    lines = [Signal(axis, axis, partial(error, axis=axis)) for axis in axes]
    compared = [Signal("distance", "Distance from the reference", partial(distance, axes=axes))]
    yield Signals("position_error", "Position error", "m", lines, compared=compared)
    if "z" in units:
        lines = [Signal("z", "actual", "z", "z_ref")]
        yield Signals("altitude", "Altitude", "m", lines, floor=0.1, plotted=False)
    if "lyapunov" in units:
        lines = [Signal("candidate", "candidate", "lyapunov")]
        title = "Lyapunov candidate, ½ ė² + ½ K e², along y"
        yield Signals("lyapunov", title, "m^2/s^2", lines, floor=1e-6, moves=True)
    cables = [f"{table.name}_tension" for table in scenario.cable]
    for name in OF_OBJECTS:
        own = (name, *(f"{name}_{axis}" for axis in AXES))
        columns = [each for each in (*own, *cables * (name == TENSION)) if each in units]
        if columns:
            panel = vector_signals(assembly, name, columns)
            about = {"moves": False, "on_request": False, "plotted": True}
            yield replace(panel, title=in_words(name).capitalize(), **about)
    if scenario.companion and f"{CONTACT}_x" in units:
        vehicles = (FIRST, ""), *((table.name, f"{table.name}_") for table in scenario.companion)
        lines = [Signal(name, name, partial(contact, prefix=prefix)) for name, prefix in vehicles]
        about = {"on_request": True, "plotted": False, "of_vehicles": True}
        yield Signals(f"{CONTACT}s", "Contact force", "N", lines, **about)


def _direction(assembly: Assembly) -> Iterator[Signals]:
    """The panels of thrusts in a plane, which push and cannot pull."""
    middle = Signal("middle", "middle of the thrusts", "direction")
    lines = [middle, Signal("desired", "desired acceleration", "direction_ref")]
    compared = [middle._replace(label="Direction of the thrusts")]
    bounds = ("direction_lower", "direction_upper")
    yield Signals("direction", "Direction", "rad", lines, (), bounds, compared, latest=10.0)
    half = assembly.scenario.vehicle.resolve().half_angle
    lines = [Signal("error", "desired minus middle", lambda f: f["direction_ref"] - f["direction"])]
    levels = [Level("low", "admissible", -half), Level("high", "admissible", half)]
    # At the start they may be far larger.
    about: dict[str, Any] = {"settling": 2.0, "plotted": False}
    yield Signals("direction_error", "Direction error", "rad", lines, levels, **about)
    lines = [
        Signal(f"square_{i}", f"ω{subscript(i)}²", partial(squared_speed, rotor=i))
        for i in assembly.loop.kind.rotors
    ]
    levels = [Level("minimum", "minimum", 0.0)]
    compared = [Signal("split", "ω₁² - ω₂²", "input_split")]
    about = {"compared": compared, "moves": True, "settling": 2.0}
    yield Signals("inputs", "Inputs squared", "rad^2/s^2", lines, levels, **about)
    lines = [Signal("alpha", "tilt", "alpha", "alpha_ref"), Signal("yaw", "yaw", "yaw")]
    yield Signals("discs", "Tilt and yaw", "rad", lines, on_request=True)


def error(flight: Flight, axis: str) -> Floats:
    """The position error along an axis: reference minus actual, m."""
    return flight[f"{axis}_ref"] - flight[axis]


def distance(flight: Flight, axes: Sequence[str]) -> Floats:
    """The norm of the position error along some axes, m."""
    return np.asarray(np.linalg.norm([error(flight, axis) for axis in axes], axis=0))


def contact(flight: Flight, prefix: str) -> Floats:
    """The norm of the force on objects (N) of the vehicle whose columns have a prefix."""
    force = [flight[f"{prefix}{CONTACT}_{axis}"] for axis in AXES]
    return np.asarray(np.linalg.norm(force, axis=0))


def squared_speed(flight: Flight, rotor: int) -> Floats:
    """The square of a rotor's speed, rad^2/s^2."""
    return np.asarray(flight[f"rotor_speed_{rotor}"] ** 2)


def along_spin(flight: Flight, rotor: int = 0) -> Floats:
    """The speed of a rotor, or else of the slowest one, along its spin, rad/s."""
    speeds = np.array(flight.scenario.vehicle.spins) * flight["rotor_speeds"]
    return np.asarray(speeds[:, rotor - 1] if rotor else speeds.min(axis=1))


def has_attitude_plane(assembly: Assembly) -> bool:
    """Whether its singular attitudes are a curve of the roll-pitch plane: of rotors on a cross."""
    on_a_cross = isinstance(assembly.scenario.vehicle, VehicleTable)
    return on_a_cross and "singularity_margin" in assembly.loop.units
