"""The ``[reference]`` table of a scenario: the motion to track."""

from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from math import acos, cos, pi
from typing import Annotated, Any, Literal

from pydantic import Field

from tiltsim.errors import InputError
from tiltsim.scenario.controller_table import ReferenceKind
from tiltsim.scenario.reference_table import PositionReference, PushReference, ReferenceTable, Tilt
from tiltsim.scenario.table import (
    ZEROS,
    Angle,
    Angles3,
    Many,
    Positive,
    Vector3,
    default,
    example,
    required,
)
from tiltsim.scenario.time_table import (
    POSE_COLUMNS,
    QUATERNION_COLUMNS,
    REFERENCE_COLUMNS,
    Rows,
    TimeTable,
    rows_with_angles,
)
from tiltsim_controllers.mathematics.scalar import Values
from tiltsim_controllers.references.trajectories import (
    POSES,
    ReferenceParameters,
    minimum_snap_knots,
    table_knots,
)

ReferenceRow = Annotated[Many[float], Field(min_length=4, max_length=8)]


class SetpointReference(PositionReference):
    """A point to hold."""

    model_config = example(type="setpoint", position=[1.0, 0.0, 0.5])

    type: Literal["setpoint"] = default("setpoint", "a point to hold")
    position: Vector3 = default(ZEROS, "the point, z up [m]", [1.0, 0.0, 0.5])


class LineReference(PositionReference):
    """Motion along a straight line, uniform or at a constant acceleration."""

    type: Literal["line"] = required("a straight line")
    position: Vector3 = default(ZEROS, "at time zero [m]", [0.0, 0.0, 1.0])
    velocity: Vector3 = required("at time zero [m/s]", [0.5, 0.0, 0.0])
    acceleration: Vector3 = default(ZEROS, "constant [m/s^2]", [0.1, 0.0, 0.0])


class CircleReference(PositionReference):
    """Uniform motion on a horizontal circle, from +x toward +y; from -x where radius < 0."""

    type: Literal["circle"] = required("a horizontal circle")
    position: Vector3 = default(ZEROS, "the center [m]", [0.0, 0.0, 1.0])
    radius: float = required("negative to start on the other side [m]", 5.0)
    angular_frequency: float = required("positive is counterclockwise seen from above [rad/s]", 0.1)

    def _check_values(self) -> None:
        if self.radius == 0.0:
            raise self.mistake("radius", "must not be 0")


class LissajousReference(PositionReference):
    """A sine along each axis: ``position + amplitude sin(angular_frequency t + phase)``."""

    type: Literal["lissajous"] = required("a sine along each axis")
    position: Vector3 = default(ZEROS, "the center [m]", [0.0, 0.0, 1.0])
    amplitude: Vector3 = required("along x, y and z [m]", [2.0, 1.0, 0.0])
    angular_frequency: Vector3 = required("along x, y and z [rad/s]", [0.5, 1.0, 0.0])
    phase: Angles3 = default(ZEROS, "at time zero [rad]", [1.5708, 0.0, 0.0])

    def _motion(self) -> dict[str, Any]:
        motion = super()._motion()
        motion["frequency"] = motion.pop("angular_frequency")
        return motion


class FigureEightReference(PositionReference):
    """A horizontal figure eight, from its crossing toward +x and +y; a 1:2 lissajous."""

    type: Literal["figure_eight"] = required("a horizontal figure eight")
    position: Vector3 = default(ZEROS, "where it crosses itself [m]", [0.0, 0.0, 1.0])
    length: Positive = required("along x [m]", 4.0)
    width: Positive = required("along y [m]", 2.0)
    angular_frequency: Positive = required("2 pi over the time once around [rad/s]", 0.5)

    def _motion(self) -> dict[str, Any]:
        once = self.angular_frequency
        return {
            "position": self.position,
            "amplitude": (0.5 * self.length, 0.5 * self.width, 0.0),
            "frequency": (once, 2.0 * once, 0.0),
        }


class WaypointReference(PositionReference):
    """Minimum-snap motion from rest to rest through points at given times."""

    type: Literal["waypoints"] = required(
        "a smooth motion through given points; it leaves the straight lines between them, by half "
        "a side of a square in even times; further points on a line keep it closer"
    )
    positions: Annotated[Many[Vector3], Field(min_length=2, max_length=50)] = required(
        "the points; the first is the start [m]", [[0.0, 0.0, 0.0], [1.0, 0.0, 0.5]]
    )
    times: Many[float] = required(
        "one per point, from 0; after the last the reference rests [s]", [0.0, 5.0]
    )

    def _motion(self) -> dict[str, Any]:
        return {"segments": float(len(self.times))}

    @property
    def knots(self) -> Values:
        """Polynomials; see `tiltsim_controllers.references.trajectories.minimum_snap_knots`."""
        return _minimum_snap_knots(self.positions, self.times)

    def _check_values(self) -> None:
        try:
            _ = self.knots
        except ValueError as error:
            raise self.mistake("times", str(error)) from None


class TableReference(PositionReference, TimeTable):
    """Motion through the rows of a table, along polynomials; after the last row it holds that."""

    model_config = example(
        type="table", rows=[[0.0, 0.0, 0.0, 0.0], [2.0, 0.5, 0.0, 0.2], [5.0, 1.0, 1.0, 0.5]]
    )
    columns = REFERENCE_COLUMNS
    largest = 1e6

    type: Literal["table"] = required("your own motion, as a table over time")
    file: str | None = default(
        None,
        "CSV or Parquet file with the columns time, x, y and z, in s and m, and for an attitude "
        "that varies roll, pitch and yaw, in rad without jumps, or qw, qx, qy and qz, relative to "
        "the scenario's folder; times from 0, at least 1e-4 s apart; 2 to 10,000 rows",
        "my_reference.csv",
    )
    rows: Many[ReferenceRow] | None = default(
        None,
        "the table itself in place of a file: time, x, y and z of each row, and roll, pitch and "
        "yaw, or a quaternion, where they vary [s, m, m, m, rad, rad, rad]",
        [[0.0, 0.0, 0.0, 0.0], [2.0, 0.5, 0.0, 0.2]],
    )
    interpolation: Literal["minimum_snap", "cubic"] = default(
        "minimum_snap",
        "minimum_snap: polynomials of degree 7 with six continuous derivatives, of which laws use "
        "up to four; cubic: continuous acceleration only, for rows that are rounded or noisy",
    )

    @classmethod
    def columns_among(cls, names: Sequence[str]) -> tuple[str, ...]:
        turned = (POSE_COLUMNS, QUATERNION_COLUMNS)
        has = [columns for columns in turned if {*columns[4:]} & {*names}]
        if len(has) > 1:
            raise InputError("has roll, pitch or yaw beside a quaternion; remove one of them")
        return has[0] if has else cls.columns

    @classmethod
    def columns_of_width(cls, width: int) -> tuple[str, ...]:
        return {7: POSE_COLUMNS, 8: QUATERNION_COLUMNS}.get(width, cls.columns)

    @property
    def turns(self) -> bool:
        return len(self.table[0]) == len(POSE_COLUMNS)

    @property
    def lean(self) -> float:
        if not self.turns:
            return super().lean
        return max(acos(cos(row[4]) * cos(row[5])) for row in self.table)

    @property
    def kind(self) -> ReferenceKind:
        leans = self.turns and any(row[4] or row[5] for row in self.table)
        return "pose" if leans else super().kind

    @property
    def parameters(self) -> ReferenceParameters:
        return super().parameters._replace(**{"type": POSES} if self.turns else {})

    def _motion(self) -> dict[str, Any]:
        return {"segments": float(len(self.table))}

    @property
    def knots(self) -> Values:
        """Polynomials; see `tiltsim_controllers.references.trajectories.table_knots`."""
        return _reference_table_knots(self.table, self.interpolation)

    def _check_attitude(self) -> None:
        """Refuse angles beside the table's, jumps of angles, and a pitch of pi/2."""
        self.require_defaults(("roll", "pitch", "yaw"), "is a column of the table; remove it")
        for number, (before, row) in enumerate(pairwise((self.table[0], *self.table)), start=1):
            for name, last, angle in zip(POSE_COLUMNS[4:], before[4:], row[4:], strict=True):
                if abs(angle - last) > pi:
                    problem = f"jumps by {abs(angle - last):.3g} rad; unwrap the angles"
                elif name == "pitch" and abs(angle) >= pi / 2:
                    problem = "must be between -pi/2 and pi/2"
                else:
                    continue
                key = "file" if self.rows is None else "rows"
                raise self.mistake(key, f"row {number}, column {name} = {angle!r}: {problem}")

    def _check_values(self) -> None:
        super()._check_values()
        if len(self._rows[0]) == len(QUATERNION_COLUMNS):
            try:
                self._rows = rows_with_angles(self._rows)
            except InputError as error:
                raise self.mistake("file" if self.rows is None else "rows", str(error)) from None
        if self.turns:
            self._check_attitude()
        try:
            _ = self.knots
        except ValueError as error:
            raise self.mistake("file" if self.rows is None else "rows", str(error)) from None


@lru_cache(maxsize=64)
def _reference_table_knots(rows: Rows, interpolation: str) -> Values:
    times, *columns = zip(*rows, strict=True)
    return table_knots(times, [*zip(*columns, strict=True)], interpolation)


_minimum_snap_knots = lru_cache(maxsize=64)(minimum_snap_knots)


class AttitudeAltitudeReference(ReferenceTable):
    """Attitude and altitude to hold (ch. 3); x = y = 0 for laws that control them as well.

    Four rotors under a planned gait, and a quadrotor, leave the horizontal position free; the
    full_pose law has six outputs and controls it.
    """

    model_config = example(altitude=1.0, yaw=0.1)

    type: Literal["attitude_altitude"] = required("an attitude, and an altitude")
    roll: Tilt = default(0.0, "turn about x [rad]", 0.1)
    pitch: Tilt = default(0.0, "turn about y [rad]", 0.1)
    yaw: Angle = default(0.0, "turn about z [rad]", 0.1)
    altitude: float = default(0.0, "z in the world [m]", 1.0)

    @property
    def kind(self) -> ReferenceKind:
        return "attitude_altitude"

    def _motion(self) -> dict[str, Any]:
        return {"position": (0.0, 0.0, self.altitude)}


Reference = Annotated[
    SetpointReference
    | LineReference
    | CircleReference
    | LissajousReference
    | FigureEightReference
    | WaypointReference
    | TableReference
    | AttitudeAltitudeReference
    | PushReference,
    Field(discriminator="type"),
]
"""The ``[reference]`` table, discriminated by its type."""
