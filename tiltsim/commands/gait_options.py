"""Options of commands that analyze gaits: angles, vehicles, figures."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite, pi
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from tiltsim.commands.declaring import Option, mistakes_in
from tiltsim.commands.options import Names, PlotOptions
from tiltsim.errors import InputError

if TYPE_CHECKING:
    from tiltsim_controllers.vehicle.parameters import Vehicle


MIN_PARAMETER: Final = 1e-12
MAX_PARAMETER: Final = 1e9  # range of a parameter (SI units), far from underflow and overflow
DEFAULT_VEHICLE: Final = "ar_drone_2"

_ROLL: Final = "roll angle of the attitude to analyze (default: level)"
_VEHICLE: Final = "ar_drone_2 (default), luukkonen, KEY=VALUE,..., or a preset with KEY=VALUE,..."


def parse_angles(text: str, count: int) -> tuple[float, ...]:
    """Angles in rad, separated by commas; raises ValueError unless each is at most half a turn."""
    parts = text.split(",") if count > 1 else [text]
    if len(parts) != count:
        raise ValueError(f"needs {count} angles separated by commas, has {len(parts)}")
    try:
        values = tuple(float(part) for part in parts)
    except ValueError:
        expected = "a number" if count == 1 else f"{count} numbers"
        raise ValueError(f"must be {expected}, in rad") from None
    for value in values:
        if not isfinite(value):
            raise ValueError("must be finite")
        if abs(value) > pi:
            raise ValueError(
                f"{value:g} is more than half a turn; angles are in rad"
                f" ({value:g} degrees would be {value * pi / 180:.4f})"
            )
    return values


def _angle(text: str) -> float:
    return parse_angles(text, 1)[0]


def _acceleration(text: str) -> tuple[float, float, float]:
    try:
        ax, ay, az = (float(part) for part in text.split(","))
    except ValueError:
        raise ValueError("must be three numbers, m/s^2") from None
    if not all(map(isfinite, (ax, ay, az))):
        raise ValueError("must be finite")
    return ax, ay, az


def _speed_limits(text: str) -> tuple[float, float]:
    parts = text.split(",")
    if len(parts) != 2:
        raise ValueError("needs MIN,MAX in rad/s")
    low, high = (_positive("limit", part) for part in parts)
    if low >= high:
        raise ValueError("the first must be less than the second")
    return low, high


def parse_vehicle(text: str) -> Vehicle:
    """A vehicle: a preset's name, ``KEY=VALUE`` in place of its parameters, or both.

    The parts are separated by commas, the preset first; without one it is `DEFAULT_VEHICLE`. Raises
    ValueError, which lists the choices.
    """
    from tiltsim_controllers.vehicle.parameters import PRESETS

    parts = [part.strip() for part in text.split(",")]
    name = DEFAULT_VEHICLE if "=" in parts[0] else parts.pop(0)
    if name not in PRESETS:
        choices = f"{', '.join(PRESETS)}, or KEY=VALUE"
        raise ValueError(f"{name!r} is not a vehicle; choose {choices}")
    vehicle = PRESETS[name]
    changes: dict[str, float] = {}
    for part in parts:
        key, equals, value = part.partition("=")
        if not equals:
            raise ValueError(f"{part!r}: write KEY=VALUE after the preset")
        if key not in vehicle._fields:
            choices = ", ".join(vehicle._fields)
            raise ValueError(f"{key!r} is not a parameter; choose {choices}")
        if key in changes:
            raise ValueError(f"{key} is given twice")
        changes[key] = _positive(key, value)
    return vehicle._replace(**changes)


def vehicle_text(vehicle: str | dict[str, float]) -> str:
    """A report's vehicle as `parse_vehicle` reads it: the closest preset and the differences."""
    from tiltsim_controllers.vehicle.parameters import PRESETS

    if isinstance(vehicle, str):
        return vehicle
    differing = {
        name: [
            f"{key}={value!r}" for key, value in vehicle.items() if getattr(preset, key) != value
        ]
        for name, preset in PRESETS.items()
    }
    name = min(differing, key=lambda name: len(differing[name]))
    none_shared = len(differing[name]) == len(vehicle)
    return ",".join(differing[name] if none_shared else [name, *differing[name]])


def _positive(name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not MIN_PARAMETER <= value <= MAX_PARAMETER:
        allowed = f"must be a number from {MIN_PARAMETER:g} to {MAX_PARAMETER:g}"
        raise ValueError(f"{name} = {text}: {allowed}")
    return value


Roll = Annotated[float | None, Option("--roll", _angle, "RAD", _ROLL)]
Pitch = Annotated[float | None, Option("--pitch", _angle, "RAD", "pitch angle of the attitude")]
Acceleration = Annotated[tuple[float, float, float] | None, Option("--balance", _acceleration)]
SpeedLimits = Annotated[tuple[float, float] | None, Option("--speed-limits", _speed_limits)]
VehicleOption = Annotated[Any, Option("--vehicle", parse_vehicle, "VEHICLE", _VEHICLE)]


Kind = Literal["roll_pitch", "comparison", "margin", "attainable", "determinant", "faults"]
Case = Literal["equal", "half", "negative", "negative_half"]


@dataclass(frozen=True, kw_only=True)
class GaitOptions:
    """The gait, its vehicle, and the attitude at which it is analyzed.

    Args:
        angles (A1,A2,A3,A4): tilt angles in rad, instead of a scenario
        mjcf (FILE): the MJCF file of a vehicle of 2 to 16 rotors; --angles has one for each
            tilt hinge
        published (NAME): a gait of the thesis, such as ch06_gait_3
        balance (AX,AY,AZ): the gait of least tilt that hovers level under an acceleration, m/s^2,
            world
        faults: also print which rotor losses allow hovering
    """

    angles: str | None = None
    mjcf: str | None = None
    published: str | None = None
    balance: Acceleration = None
    vehicle: VehicleOption = None
    roll: Roll = None
    pitch: Pitch = None
    faults: bool = False

    def read_angles(self, count: int) -> tuple[float, ...]:
        """The angles of ``--angles`` (rad). Raises `InputError` unless there are ``count``."""
        with mistakes_in(f"--angles {self.angles}"):
            return parse_angles(str(self.angles), count)

    @property
    def acceleration(self) -> str:
        """The value of ``--balance``."""
        return ",".join(f"{part:g}" for part in self.balance or ())


@dataclass(frozen=True, kw_only=True)
class GaitFigure(PlotOptions):
    """The figure of a gait.

    Args:
        kind: roll_pitch (default); comparison, two roll-pitch diagrams, with and without bias;
            margin over a period; attainable torques, thrusts and accelerations (ch. 9); determinant
            surfaces and zero curves (ch. 3), without a gait; faults: rotor speeds that hover needs
            after a rotor loss, for any gait
        case: for --figure determinant: relation of alpha_1 and alpha_3 (default: equal)
        speed_limits (MIN,MAX): rotor speeds in rad/s of hovers and attainable sets (default: as in
            the file; in the figure of the thesis's vehicle as in ch. 9)
        panels: the panels to draw, in this order
    """

    kind: Annotated[Kind | None, Option("--figure")] = None
    case: Case | None = None
    speed_limits: SpeedLimits = None
    panels: Names = ()

    def check_kind(self) -> None:
        """Raise `InputError` for options of no use to this kind of figure."""
        if self.kind is not None and self.plot is None:
            raise InputError(f"--figure {self.kind}: needs --plot FILE")
        if self.case is not None and self.kind != "determinant":
            raise InputError(f"--case {self.case}: needs --figure determinant")
        self.check(panels=self.panels)
        if self.panels and self.kind not in {None, "roll_pitch"}:
            raise InputError("--panels: this figure has no panels to choose from")
