"""The ``[gait]`` table of a scenario: one model per type, which plans its gait."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import lru_cache
from math import pi
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final, Literal

from pydantic import Field

from tiltsim.models.vehicle_parts import MAX_ROTORS
from tiltsim.scenario.table import (
    Angle,
    Angles2,
    AnglesEach,
    Factor,
    Many,
    Period,
    Positive,
    Row,
    Table,
    default,
    example,
    required,
)
from tiltsim.scenario.time_table import Rows, TimeTable
from tiltsim_controllers.analysis.two_color_planner import (
    Circle,
    Leg,
    Path,
    Polyline,
    four_angle_gait,
    rectangle,
)
from tiltsim_controllers.code.arrays import is_known
from tiltsim_controllers.gaits import plans
from tiltsim_controllers.gaits.plans import Gait as PlannedGait
from tiltsim_controllers.vehicle.parameters import Vehicle

SIGN: Final = (
    "positive turns the rotor counterclockwise, seen from outside along its arm, so that rotor 1, "
    "on +x, pushes to -y"
)
"""The sign of a tilt angle, for descriptions."""

COLOR: Final = (
    "red: opposite rotors have equal angles, and the force at zero torque is vertical; blue: "
    "alpha_3 = 2 delta - alpha_1, alpha_4 = -2 delta - alpha_2, where the thesis claims the same "
    "and the matrix is singular"
)
"""The two colors of ch. 6, for descriptions."""


class GaitTable(Table, ABC):
    """The keys of every gait: a common scale, and a bias on the two rear angles."""

    table_name = "gait"
    size_key: ClassVar[str]
    alternates: ClassVar[bool] = False  # between two sides, half a period on each
    if TYPE_CHECKING:
        type: str

    scale: Annotated[float, Field(ge=1e-3, le=1e3)] = default(
        1.0, "multiplies all tilt angles (ch. 5: 1/n) [-]", 0.5
    )
    bias: Factor = default(1.0, "eta, multiplies alpha_3 and alpha_4 (ch. 6) [-]", 0.8)

    def plan(self, vehicle: Any) -> PlannedGait:
        """The gait for a vehicle's parameters. Raises ValueError if these numbers make none."""
        needed = vehicle.tilts
        if self.tilts not in {None, needed}:
            raise ValueError(f"has {self.tilts} tilt angles; the vehicle has {needed}")
        if needed not in {1, 4} and self.bias != 1.0:
            raise ValueError(f"gait.bias needs four tilt angles; the vehicle has {needed}")
        return self._unscaled(vehicle).scaled(1.0 / self.scale).biased(self.bias)

    @property
    def tilts(self) -> int | None:
        """Number of tilt angles; None for a gait of any number."""
        return 4

    @abstractmethod
    def _unscaled(self, vehicle: Any) -> PlannedGait:
        """The gait before scale and bias."""

    @property
    def size(self) -> tuple[str, object]:
        """The key that sets how far the gait tilts, and its value."""
        return self.size_key, dict(self)[self.size_key]


class FixedGait(GaitTable):
    """Constant tilt angles."""

    model_config = example(type="fixed", angles=[-0.65, -0.65, 0.65, 0.65])
    size_key = "angles"

    type: Literal["fixed"] = default("fixed", "constant angles")
    angles: AnglesEach = default(
        (0.0, 0.0, 0.0, 0.0),
        f"alpha_1..4; {SIGN}; a multirotor has one for each of its tilts [rad]",
        [-0.65, -0.65, 0.65, 0.65],
    )

    @property
    def tilts(self) -> int | None:
        some = any(not is_known(angle) or angle for angle in self.angles)
        return len(self.angles) if some else None

    def _unscaled(self, vehicle: Any) -> PlannedGait:
        if self.tilts is None:
            return plans.fixed((0.0,) * vehicle.tilts)
        return plans.fixed(self.angles)


class TrotGait(GaitTable):
    """The cat trots of ch. 4, which differ in how they switch sides."""

    size_key = "amplitude"

    type: Literal["trot_instant", "trot_continuous"] = required(
        "a trot: rotors 1 and 2 tilt by -rho, 3 and 4 by rho, so that diagonal legs move "
        "together, and rho changes its sign twice a period: at once, or at a constant rate"
    )
    amplitude: Angle = required(
        "largest rho, with which the period begins; at positive rho rotors 1 and 3 push to +y, 2 "
        "and 4 to -x [rad]",
        0.65,
    )
    period: Period = required("T, of the whole cycle [s]", 2.0)

    def _unscaled(self, vehicle: Any) -> PlannedGait:
        trot = plans.instant_trot if self.type == "trot_instant" else plans.continuous_trot
        return trot(self.amplitude, self.period)


class CatGait(GaitTable):
    """The cat gaits of ch. 5, reconstructed from published footfalls and the results of ch. 5."""

    size_key = "amplitude"

    type: Literal["walk", "run", "transverse_gallop", "rotary_gallop"] = required(
        "how a cat moves its legs; a rotor is a leg: 1 right fore, 2 left fore, 3 left hind, 4 "
        "right hind"
    )
    amplitude: Angle = required("swing of a leg to either side of its lean [rad]", 0.5)
    lean: Angle = default(0.0, "mean angle of the legs, forward, toward +x and +y [rad]", 0.5)
    period: Period = required("T, of one stride [s]", 1.0)

    def _unscaled(self, vehicle: Any) -> PlannedGait:
        return plans.cat(self.type, self.amplitude, self.period, self.lean)


class WaypointGait(GaitTable):
    """A closed gait through given angles, linear in between."""

    size_key = "angles"

    type: Literal["waypoints"] = required("your own gait")
    angles: Annotated[Many[AnglesEach], Field(min_length=2)] = required(
        f"alpha_1..4 of each waypoint; {SIGN}; a multirotor has one for each of its tilts [rad]",
        [[-0.3, -0.1, 0.1, 0.3], [-0.1, -0.3, 0.3, 0.1]],
    )
    period: Period = required("time to return to the first waypoint [s]", 2.0)
    phases: Many[float] | None = default(
        None,
        "time of each waypoint as a fraction of the period, from 0; default: evenly spaced [-]",
        [0.0, 0.4],
    )

    @property
    def tilts(self) -> int:
        return len(self.angles[0])

    def _unscaled(self, vehicle: Any) -> PlannedGait:
        return plans.waypoints(self.angles, self.period, self.phases, self.tilts)


class TableGait(GaitTable, TimeTable):
    """Tilt angles through the rows of a table, along cubic splines."""

    model_config = example(
        type="table", rows=[[0.0, 0.0, 0.0, 0.0, 0.0], [1.0, 0.3, -0.3, 0.3, -0.3]]
    )
    columns = ("time", "alpha_1", "alpha_2", "alpha_3", "alpha_4")
    largest = pi

    type: Literal["table"] = required("your own gait, as a table over time")
    file: str | None = default(
        None,
        "CSV or Parquet file with the columns time and alpha_1 to alpha_4, in s and rad, relative "
        "to the scenario's folder; times from 0, at least 1e-4 s apart; 2 to 10,000 rows",
        "my_gait.csv",
    )
    rows: Many[Row] | None = default(
        None,
        f"the table itself in place of a file: time and alpha_1..4 of each row; {SIGN} "
        "[s, rad, rad, rad, rad]",
        [[0.0, 0.0, 0.0, 0.0, 0.0], [1.0, 0.3, -0.3, 0.3, -0.3]],
    )
    interpolation: Literal["cubic"] = default(
        "cubic", "cubic splines, whose angular accelerations are continuous"
    )
    repeat: bool = default(
        False,
        "start over after the last row, which must then have the angles of the first; otherwise "
        "the angles of the last row hold",
    )

    def _check_values(self) -> None:
        super()._check_values()
        (_, *first), (_, *last) = self.table[0], self.table[-1]
        if self.repeat and first != last:
            reason = f"the angles of the last row, {last}, must equal the first, {first}"
            raise self.mistake("repeat", reason)

    @classmethod
    def columns_among(cls, names: Sequence[str]) -> tuple[str, ...]:
        tilts = [i for i in range(1, MAX_ROTORS + 1) if f"alpha_{i}" in names]
        return cls.columns_of_width(1 + max(tilts, default=4))

    @classmethod
    def columns_of_width(cls, width: int) -> tuple[str, ...]:
        every = ("time", *(f"alpha_{i}" for i in range(1, MAX_ROTORS + 1)))
        return every[:width] if 1 < width <= len(every) else cls.columns

    @property
    def tilts(self) -> int:
        return len(self.table[0]) - 1

    def _unscaled(self, vehicle: Any) -> PlannedGait:
        return _table_gait(self.table, self.repeat)

    @property
    def size(self) -> tuple[str, object]:
        return ("rows", len(self.table)) if self.file is None else ("file", self.file)


@lru_cache(maxsize=64)
def _table_gait(rows: Rows, repeats: bool) -> PlannedGait:
    times, *columns = zip(*rows, strict=True)
    return plans.table(times, [*zip(*columns, strict=True)], repeats=repeats)


class TwoColorLeg(Table):
    """A part of a two-color path: line segments in one color."""

    color: Literal["red", "blue"] = required(COLOR)
    vertices: Annotated[Many[Angles2], Field(min_length=2)] = required(
        "points (alpha_1, alpha_2) [rad]", [[-0.2, 0.2], [-0.1, 0.3]]
    )


class TwoColorGait(GaitTable):
    """A path on the Two Color Map (ch. 6 to 8): a rectangle, a circle, or a path of legs.

    The color gives alpha_3 and alpha_4, on the exact lines of the scenario's vehicle;
    delta = atan(K_m / (L K_f)).
    """

    model_config = example(rectangle=[[-0.3, -0.1], [0.1, 0.3]])

    type: Literal["two_color"] = required(
        "a closed curve of alpha_1 and alpha_2; its color gives the other two angles"
    )
    period: Period = required("time once around [s]", 4.0)
    color: Literal["red", "blue"] = default("red", COLOR)
    rectangle: Annotated[tuple[Angles2, Angles2], Field(strict=False)] | None = default(
        None,
        "the curve is a rectangle: ranges of alpha_1 and of alpha_2 [rad]",
        [[-0.3, -0.1], [0.1, 0.3]],
    )
    centre: Angles2 | None = default(
        None, "the curve is a circle about this point; needs radius [rad]", [-0.2, 0.2]
    )
    radius: Positive | None = default(None, "of the circle [rad]", 0.1)
    path: Many[TwoColorLeg] = default(
        (),
        "the curve consists of legs, each in one color; colors may change where the two meet, at "
        "the point P = (delta, -delta)",
    )

    def _check_values(self) -> None:
        circle = (self.centre is not None) + (self.radius is not None)
        given = (self.rectangle is not None, circle > 0, bool(self.path))
        if sum(given) != 1 or circle == 1:
            raise self.mistake("type", "give one of rectangle, centre with radius, and path")

    @property
    def curve(self) -> Path:
        """The closed curve in the alpha_1-alpha_2 plane."""
        if self.rectangle is not None:
            return rectangle(*self.rectangle, self.color)
        if self.centre is not None and self.radius is not None:
            return Circle(self.color, self.centre, self.radius)
        return Polyline(tuple(Leg(leg.color, leg.vertices) for leg in self.path))

    def _unscaled(self, vehicle: Any) -> PlannedGait:
        if not isinstance(vehicle, Vehicle):
            raise self.mistake("type", "is a gait of the tiltrotor")
        return four_angle_gait(self.curve, self.period, vehicle)

    @property
    def size(self) -> tuple[str, object]:
        if self.rectangle is not None:
            return "rectangle", self.rectangle
        return ("radius", self.radius) if self.radius is not None else ("path", len(self.path))
