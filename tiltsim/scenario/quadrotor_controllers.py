"""The ``[controller]`` tables of the quadrotor."""

from __future__ import annotations

from typing import Final, Literal, Self

from pydantic import Field, model_validator

import tiltsim_controllers.laws.quadrotor_attitude_altitude as quadrotor_attitude_altitude
import tiltsim_controllers.laws.yaw_position as yaw_position
from tiltsim.scenario.controller_table import ControllerTable, NamedGains, linear_loops
from tiltsim.scenario.table import Gains2, Gains4, Positive, Table
from tiltsim_controllers.analysis.stability import ErrorLoop
from tiltsim_controllers.laws.switching import PUBLISHED_ZONE
from tiltsim_controllers.vehicle.parameters import Vehicle

_YAW_POSITION_LOOPS: Final = (("position", 4), ("yaw", 2))
_ATTITUDE_LOOPS: Final = (("altitude", 2), ("attitude", 2))


class YawPositionGainTable(Table):
    """Explicit gains of yaw-position control."""

    position: Gains4 = Field(description="k_1 to k_4, on jerk, acceleration, velocity and position")
    yaw: Gains2 = Field((5.0, 5.0), description="on the rate and on yaw")


YawPositionGains = NamedGains[Literal["ch02", "stable"], YawPositionGainTable]


class YawPositionController(ControllerTable):
    """Yaw-position control of the quadrotor with dynamic extension (ch. 2)."""

    vehicle_models = ("quadrotor",)
    reference_kinds = ("position",)
    loop_gains = _YAW_POSITION_LOOPS

    law: Literal["yaw_position"]
    gains: YawPositionGains = "stable"

    def resolve_gains(self) -> yaw_position.Gains:
        return _yaw_position_gains(self.gains)


class QuadrotorAttitudeGainTable(Table):
    """Explicit gains of the quadrotor's attitude-altitude control."""

    altitude: Gains2 = Field(description="on the rate and on the altitude")
    attitude: Gains2 = Field(description="on the rates and on roll, pitch and yaw")


QuadrotorAttitudeGains = NamedGains[Literal["ch02"], QuadrotorAttitudeGainTable]


class QuadrotorAttitudeAltitudeController(ControllerTable):
    """Attitude-altitude control of the quadrotor (ch. 2, Appendix B)."""

    vehicle_models = ("quadrotor",)
    reference_kinds = ("attitude_altitude",)
    loop_gains = _ATTITUDE_LOOPS

    law: Literal["quadrotor_attitude_altitude"]
    gains: QuadrotorAttitudeGains = "ch02"

    def resolve_gains(self) -> quadrotor_attitude_altitude.Gains:
        return _attitude_gains(self.gains)


class ZoneTable(Table):
    """Attitudes at which attitude-altitude control is active, edges included; Eq. (47)."""

    table_name = "controller.zone"

    roll: Gains2 = Field((PUBLISHED_ZONE.roll_min, PUBLISHED_ZONE.roll_max), description="rad")
    pitch: Gains2 = Field((PUBLISHED_ZONE.pitch_min, PUBLISHED_ZONE.pitch_max), description="rad")

    @model_validator(mode="after")
    def _check(self) -> Self:
        for key in ("roll", "pitch"):
            low, high = getattr(self, key)
            if low > high:
                raise self.mistake(key, "the first must not exceed the second")
        return self


class SwitchingController(ControllerTable):
    """Yaw-position control that switches to attitude-altitude control in a zone (ch. 2)."""

    vehicle_models = ("quadrotor",)
    reference_kinds = ("pose",)
    loop_gains = (*_YAW_POSITION_LOOPS, *_ATTITUDE_LOOPS)

    law: Literal["switching"]
    gains: YawPositionGains = Field("stable", description="gains of the yaw-position law")
    attitude_gains: QuadrotorAttitudeGains = "ch02"
    zone: ZoneTable = ZoneTable()
    extension: Literal["bumpless", "held", "running"] = Field(
        "bumpless",
        description="states of the yaw-position law while the other law is active: following the "
        "thrust, held, or running on",
    )
    extension_rate: Positive = Field(
        100.0, description="rate at which bumpless states converge to the actual thrust, 1/s"
    )

    def resolve_gains(self) -> yaw_position.Gains:
        return _yaw_position_gains(self.gains)

    def resolve_attitude_gains(self) -> quadrotor_attitude_altitude.Gains:
        """The gains of the attitude-altitude law."""
        return _attitude_gains(self.attitude_gains)

    def error_loops(self, vehicle: Vehicle) -> list[ErrorLoop]:
        gains = *self.resolve_gains(), *self.resolve_attitude_gains()
        return linear_loops(gains, self.loop_gains)


def _yaw_position_gains(gains: str | YawPositionGainTable) -> yaw_position.Gains:
    if isinstance(gains, YawPositionGainTable):
        return yaw_position.Gains(*gains.position, *gains.yaw)
    return yaw_position.GAIN_SETS[gains]


def _attitude_gains(gains: str | QuadrotorAttitudeGainTable) -> quadrotor_attitude_altitude.Gains:
    if isinstance(gains, QuadrotorAttitudeGainTable):
        return quadrotor_attitude_altitude.Gains(*gains.altitude, *gains.attitude)
    return quadrotor_attitude_altitude.GAIN_SETS[gains]
