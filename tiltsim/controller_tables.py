"""The ``[controller]`` table of a scenario: one model a law, with the keys that the law knows."""

from __future__ import annotations

from abc import ABC, abstractmethod
from math import inf, pi
from typing import Annotated, Any, ClassVar, Final, Literal, Self

from pydantic import Discriminator, Field, Tag, model_validator

import controllers.full_pose as full_pose
import controllers.quadrotor_attitude_altitude as quadrotor_attitude_altitude
import controllers.yaw_position as yaw_position
from controllers.attitude_altitude import DECOUPLINGS, Gains
from controllers.gains import GAIN_SETS, gains_from_rows
from controllers.stability import Loop, closed_loops, linear_loop
from controllers.switching import PUBLISHED_ZONE
from controllers.vehicle import Vehicle
from tiltsim.messages import InvalidValueError
from tiltsim.tables import Gains2, NonNegative, Positive, Table, Vector3

DEFAULT_LAW: Final = "attitude_altitude"

ReferenceKind = Literal["position", "attitude_altitude", "pose"]
"""What a law can follow: position and yaw, attitude and altitude, or position and attitude."""


class LawTable(Table, ABC):
    """What every law can be told."""

    vehicle_model: ClassVar[str]
    reference_kinds: ClassVar[tuple[ReferenceKind, ...]]

    allow_unstable: bool = Field(False, description="fly gains that fail the Routh condition")

    @abstractmethod
    def closed_loops(self, vehicle: Vehicle) -> list[Loop]:
        """The linear closed loops that the gains make."""

    @property
    def linearization(self) -> str:
        """Under what the closed loops are linear, in words."""
        return "the exact decoupling matrix"


def _gain_kind(value: object) -> str:
    return "named" if isinstance(value, str) else "table"


# --- tiltrotor ---------------------------------------------------------------------------------


class GainTable(Table):
    """Gains written out; see `controllers.gains.gains_from_rows`."""

    attitude: Annotated[tuple[Vector3, Vector3, Vector3], Field(strict=False)] = Field(
        description="diagonals of K_P1, K_P2, K_P3, each roll, pitch, yaw"
    )
    altitude: Vector3 = Field(description="K_PZ1, K_PZ2, K_PZ3")
    position: Gains2 = Field((1.0, 1.0), description="K_X1, K_X2")


class AttitudeAltitudeController(LawTable):
    """Attitude-altitude control of the tiltrotor, the gait planned (ch. 3 to 9)."""

    vehicle_model = "tiltrotor"
    reference_kinds = ("position", "attitude_altitude")

    law: Literal["attitude_altitude"] = "attitude_altitude"
    decoupling: Literal["published", "exact"] = "published"
    decoupler: Literal["none", "conventional", "modified", "exact"] = "modified"
    gains: Annotated[
        Annotated[Literal["ch03", "ch04", "exact"], Tag("named")]
        | Annotated[GainTable, Tag("table")],
        Discriminator(_gain_kind),
    ] = "ch04"
    gait_rate_feedforward: Literal[False] = False
    allocation: Literal["inversion", "prioritized"] = Field(
        "inversion", description="within rotor limits: each for itself, or attitude first"
    )
    allocation_horizon: Positive = Field(
        0.02, description="s for which prioritized allocation keeps within the limits"
    )

    def resolve_gains(self) -> Gains:
        """The numbers behind a named set or a table."""
        if isinstance(self.gains, GainTable):
            return gains_from_rows(self.gains.attitude, self.gains.altitude, self.gains.position)
        return GAIN_SETS[self.gains]

    def closed_loops(self, vehicle: Vehicle) -> list[Loop]:
        """See `LawTable.closed_loops`."""
        return closed_loops(self.resolve_gains(), vehicle, DECOUPLINGS[self.decoupling])

    @property
    def linearization(self) -> str:
        """See `LawTable.linearization`."""
        return f"the {self.decoupling} decoupling matrix"


class FullPoseGainTable(Table):
    """Gains of full-pose control written out."""

    position: Vector3 = Field(description="on acceleration, velocity and position")
    attitude: Vector3 = Field(description="on angular acceleration, body rates and attitude")


class FullPoseController(LawTable):
    """Position and attitude of the tiltrotor at once, the tilt angles inputs, too (ch. 3)."""

    vehicle_model = "tiltrotor"
    reference_kinds = ("position", "pose", "attitude_altitude")

    law: Literal["full_pose"]
    gains: Annotated[
        Annotated[Literal["ch03"], Tag("named")] | Annotated[FullPoseGainTable, Tag("table")],
        Discriminator(_gain_kind),
    ] = "ch03"
    tilt_weight: Literal["even", "published"] = Field(
        "even",
        description="of tilt rates in the norm: by the force they move, or number for number",
    )
    failed_rotor: Annotated[int, Field(ge=1, le=4)] | None = Field(
        None, description="a rotor that the law knows to be lost and does not count on"
    )
    failure_known_from: NonNegative = Field(0.0, description="s, since when failed_rotor is known")
    max_tilt_rate: Positive | None = Field(None, description="rad/s, held by the law")
    max_tilt_angle: Annotated[float, Field(gt=0.0, le=pi)] | None = Field(
        None, description="rad, held by the law"
    )

    def resolve_gains(self) -> full_pose.Gains:
        """The numbers behind a named set or a table."""
        if isinstance(self.gains, FullPoseGainTable):
            return full_pose.Gains(*self.gains.position, *self.gains.attitude)
        return full_pose.GAIN_SETS[self.gains]

    def resolve_tilt_weight(self, vehicle: Vehicle) -> float:
        """The number behind a weight's name, (rad/s)^2/rad."""
        if self.tilt_weight == "published":
            return full_pose.PUBLISHED_TILT_WEIGHT
        return full_pose.even_tilt_weight(vehicle)

    def resolve_failure(self) -> full_pose.Failure:
        """What the law knows of a lost rotor."""
        if self.failed_rotor is None:
            return full_pose.Failure()
        return full_pose.Failure(float(self.failed_rotor), self.failure_known_from)

    def resolve_limits(self) -> full_pose.Limits:
        """The limits that the law holds, infinite where there are none."""
        rate, angle = self.max_tilt_rate, self.max_tilt_angle
        return full_pose.Limits(
            inf if rate is None else rate,
            inf if angle is None else angle,
        )

    def closed_loops(self, vehicle: Vehicle) -> list[Loop]:
        """See `LawTable.closed_loops`."""
        gains = self.resolve_gains()
        return [linear_loop("position", gains[:3]), linear_loop("attitude", gains[3:])]


# --- quadrotor ---------------------------------------------------------------------------------


class YawPositionGainTable(Table):
    """Gains of yaw-position control written out."""

    position: Annotated[tuple[float, float, float, float], Field(strict=False)] = Field(
        description="k_1 to k_4, on jerk, acceleration, velocity and position"
    )
    yaw: Gains2 = Field((5.0, 5.0), description="on the rate and on yaw")


YawPositionGains = Annotated[
    Annotated[Literal["ch02", "stable"], Tag("named")]
    | Annotated[YawPositionGainTable, Tag("table")],
    Discriminator(_gain_kind),
]


class YawPositionController(LawTable):
    """Yaw-position control of the quadrotor with dynamic extension (ch. 2)."""

    vehicle_model = "quadrotor"
    reference_kinds = ("position",)

    law: Literal["yaw_position"]
    gains: YawPositionGains = "stable"

    def resolve_gains(self) -> yaw_position.Gains:
        """The numbers behind a named set or a table."""
        return _yaw_position_gains(self.gains)

    def closed_loops(self, vehicle: Vehicle) -> list[Loop]:
        """See `LawTable.closed_loops`."""
        return _yaw_position_loops(self.resolve_gains())


class QuadrotorAttitudeGainTable(Table):
    """Gains of the quadrotor's attitude-altitude control written out."""

    altitude: Gains2 = Field(description="on the rate and on the altitude")
    attitude: Gains2 = Field(description="on the rates and on roll, pitch and yaw")


QuadrotorAttitudeGains = Annotated[
    Annotated[Literal["ch02"], Tag("named")] | Annotated[QuadrotorAttitudeGainTable, Tag("table")],
    Discriminator(_gain_kind),
]


class QuadrotorAttitudeAltitudeController(LawTable):
    """Attitude-altitude control of the quadrotor (ch. 2, Appendix B)."""

    vehicle_model = "quadrotor"
    reference_kinds = ("attitude_altitude",)

    law: Literal["quadrotor_attitude_altitude"]
    gains: QuadrotorAttitudeGains = "ch02"

    def resolve_gains(self) -> quadrotor_attitude_altitude.Gains:
        """The numbers behind a named set or a table."""
        return _attitude_gains(self.gains)

    def closed_loops(self, vehicle: Vehicle) -> list[Loop]:
        """See `LawTable.closed_loops`."""
        return _attitude_loops(self.resolve_gains())


class ZoneTable(Table):
    """Attitudes at which the attitude-altitude law flies, edges included; Eq. (47)."""

    roll: Gains2 = Field((PUBLISHED_ZONE.roll_min, PUBLISHED_ZONE.roll_max), description="rad")
    pitch: Gains2 = Field((PUBLISHED_ZONE.pitch_min, PUBLISHED_ZONE.pitch_max), description="rad")

    @model_validator(mode="after")
    def _check(self) -> Self:
        for key in ("roll", "pitch"):
            low, high = getattr(self, key)
            if low > high:
                raise InvalidValueError(
                    f"controller.zone.{key}", [low, high], "the first must not exceed the second"
                )
        return self


class SwitchingController(LawTable):
    """Yaw-position control that hands over to attitude-altitude control in a zone (ch. 2)."""

    vehicle_model = "quadrotor"
    reference_kinds = ("pose",)

    law: Literal["switching"]
    gains: YawPositionGains = Field("stable", description="of the yaw-position law")
    attitude_gains: QuadrotorAttitudeGains = "ch02"
    zone: ZoneTable = ZoneTable()
    extension: Literal["bumpless", "held", "running"] = Field(
        "bumpless",
        description="what the yaw-position law's own states do while the other law flies",
    )
    extension_rate: Positive = Field(
        100.0, description="1/s, how fast bumpless states reach the flown thrust"
    )

    def resolve_gains(self) -> yaw_position.Gains:
        """The yaw-position law's numbers."""
        return _yaw_position_gains(self.gains)

    def resolve_attitude_gains(self) -> quadrotor_attitude_altitude.Gains:
        """The attitude-altitude law's numbers."""
        return _attitude_gains(self.attitude_gains)

    def closed_loops(self, vehicle: Vehicle) -> list[Loop]:
        """See `LawTable.closed_loops`."""
        return [
            *_yaw_position_loops(self.resolve_gains()),
            *_attitude_loops(self.resolve_attitude_gains()),
        ]


def _yaw_position_gains(gains: str | YawPositionGainTable) -> yaw_position.Gains:
    if isinstance(gains, YawPositionGainTable):
        return yaw_position.Gains(*gains.position, *gains.yaw)
    return yaw_position.GAIN_SETS[gains]


def _yaw_position_loops(gains: yaw_position.Gains) -> list[Loop]:
    return [linear_loop("position", gains[:4]), linear_loop("yaw", gains[4:])]


def _attitude_gains(gains: str | QuadrotorAttitudeGainTable) -> quadrotor_attitude_altitude.Gains:
    if isinstance(gains, QuadrotorAttitudeGainTable):
        return quadrotor_attitude_altitude.Gains(*gains.altitude, *gains.attitude)
    return quadrotor_attitude_altitude.GAIN_SETS[gains]


def _attitude_loops(gains: quadrotor_attitude_altitude.Gains) -> list[Loop]:
    return [linear_loop("altitude", gains[:2]), linear_loop("attitude", gains[2:])]


# --- the table, told apart by its law ----------------------------------------------------------


def _law(value: Any) -> str:
    if isinstance(value, LawTable):
        return str(getattr(value, "law"))  # noqa: B009
    law = value.get("law", DEFAULT_LAW) if isinstance(value, dict) else DEFAULT_LAW
    return law if isinstance(law, str) else ""


Controller = Annotated[
    Annotated[AttitudeAltitudeController, Tag("attitude_altitude")]
    | Annotated[FullPoseController, Tag("full_pose")]
    | Annotated[YawPositionController, Tag("yaw_position")]
    | Annotated[SwitchingController, Tag("switching")]
    | Annotated[QuadrotorAttitudeAltitudeController, Tag("quadrotor_attitude_altitude")],
    Discriminator(_law),
]
"""The ``[controller]`` table, told apart by its law."""
