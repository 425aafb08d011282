"""The ``[controller]`` tables of the quadrotor."""

from __future__ import annotations

from typing import Final, Literal, Self

from pydantic import Field, model_validator

import tiltsim_controllers.laws.quadrotor_attitude_altitude as quadrotor_attitude_altitude
import tiltsim_controllers.laws.yaw_position as yaw_position
from tiltsim.scenario.controller_table import ControllerTable, NamedGains, linear_loops
from tiltsim.scenario.table import Gains2, Gains4, Positive, Table, example
from tiltsim_controllers.analysis.stability import ErrorLoop
from tiltsim_controllers.laws.switching import PUBLISHED_ZONE
from tiltsim_controllers.vehicle.parameters import Vehicle

_YAW_POSITION_LOOPS: Final = (("position", 4), ("yaw", 2))
_ATTITUDE_LOOPS: Final = (("altitude", 2), ("attitude", 2))

YAW_POSITION_GAINS: Final = (
    "stable, or ch02 as the thesis prints them, which are unstable, or a table of gains"
)
"""The choices of gains of the yaw-position law, for descriptions."""


class YawPositionGainTable(Table):
    """Explicit gains of yaw-position control."""

    position: Gains4 = Field(
        description="k_1 to k_4, on the errors of jerk, acceleration, velocity and position "
        "[1/s, 1/s^2, 1/s^3, 1/s^4]",
        examples=[[10.0, 37.5, 62.5, 39.0625]],
    )
    yaw: Gains2 = Field(
        (5.0, 5.0), description="on the errors of the yaw rate and of yaw [1/s, 1/s^2]"
    )


YawPositionGains = NamedGains[Literal["ch02", "stable"], YawPositionGainTable]


class YawPositionController(ControllerTable):
    """Yaw-position control of the quadrotor with dynamic extension (ch. 2)."""

    vehicle_models = ("quadrotor",)
    reference_kinds = ("position",)
    loop_gains = _YAW_POSITION_LOOPS

    law: Literal["yaw_position"] = Field(
        description="the quadrotor's thrust and three torques control position and yaw"
    )
    gains: YawPositionGains = Field("stable", description=YAW_POSITION_GAINS)

    def in_full(self) -> Self:
        gains = self.resolve_gains()
        table = YawPositionGainTable(position=gains[:4], yaw=gains[4:])
        return self.model_copy(update={"gains": table})

    def resolve_gains(self) -> yaw_position.Gains:
        return _yaw_position_gains(self.gains)


class QuadrotorAttitudeGainTable(Table):
    """Explicit gains of the quadrotor's attitude-altitude control."""

    altitude: Gains2 = Field(
        description="on the errors of vertical velocity and altitude [1/s, 1/s^2]",
        examples=[[10.0, 10.0]],
    )
    attitude: Gains2 = Field(
        description="on the errors of the rates and of roll, pitch and yaw [1/s, 1/s^2]",
        examples=[[10.0, 10.0]],
    )


QuadrotorAttitudeGains = NamedGains[Literal["ch02"], QuadrotorAttitudeGainTable]


class QuadrotorAttitudeAltitudeController(ControllerTable):
    """Attitude-altitude control of the quadrotor (ch. 2, Appendix B)."""

    vehicle_models = ("quadrotor",)
    reference_kinds = ("attitude_altitude",)
    loop_gains = _ATTITUDE_LOOPS

    law: Literal["quadrotor_attitude_altitude"] = Field(
        description="the quadrotor's thrust and three torques control attitude and altitude"
    )
    gains: QuadrotorAttitudeGains = Field(
        "ch02", description="the thesis's set, or a table of gains"
    )

    def resolve_gains(self) -> quadrotor_attitude_altitude.Gains:
        return _attitude_gains(self.gains)


class ZoneTable(Table):
    """Attitudes at which attitude-altitude control is active, edges included; Eq. (47)."""

    model_config = example(roll=[-1.57, 0.2])
    table_name = "controller.zone"

    roll: Gains2 = Field(
        (PUBLISHED_ZONE.roll_min, PUBLISHED_ZONE.roll_max),
        description="smallest and largest roll [rad]",
        examples=[[-1.57, 0.2]],
    )
    pitch: Gains2 = Field(
        (PUBLISHED_ZONE.pitch_min, PUBLISHED_ZONE.pitch_max),
        description="smallest and largest pitch [rad]",
    )

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

    law: Literal["switching"] = Field(
        description="yaw_position, and quadrotor_attitude_altitude while the attitude is in a zone"
    )
    gains: YawPositionGains = Field(
        "stable", description=f"of the yaw-position law: {YAW_POSITION_GAINS}"
    )
    attitude_gains: QuadrotorAttitudeGains = Field(
        "ch02", description="of the attitude-altitude law: the thesis's set, or a table of gains"
    )
    zone: ZoneTable = Field(
        ZoneTable(), description="the attitudes at which the attitude-altitude law is active"
    )
    extension: Literal["bumpless", "held", "running"] = Field(
        "bumpless",
        description="the yaw-position law's own states, thrust and its rate, while the other law "
        "is active: bumpless follows the actual thrust, held stops them, running goes on",
    )
    extension_rate: Positive = Field(
        100.0, description="rate at which bumpless states converge to the actual thrust [1/s]"
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
