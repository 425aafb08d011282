"""Options of ``tiltsim gait``."""

from dataclasses import dataclass
from typing import Annotated, Literal

from tiltsim.commands.angles import (
    Acceleration,
    Pitch,
    Roll,
    SpeedLimits,
    VehicleOption,
    parse_angles,
)
from tiltsim.commands.declaring import Option, mistakes_in
from tiltsim.commands.options import Names, PlotOptions
from tiltsim.errors import InputError

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
        speed_limits (MIN,MAX): rotor speeds in rad/s: for --figure attainable (default: as in
            ch. 9), and with --mjcf (default: as in the file)
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
