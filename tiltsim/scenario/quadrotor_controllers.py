"""The ``[controller]`` tables of the quadrotor."""

from typing import Self

from pydantic import model_validator

from tiltsim.scenario.controller_table import ControllerTable
from tiltsim_controllers.laws.quadrotor_attitude_altitude import QuadrotorAttitudeAltitude
from tiltsim_controllers.laws.switching import Switching
from tiltsim_controllers.laws.yaw_position import YawPosition


class YawPositionController(YawPosition, ControllerTable):
    """Yaw-position control of the quadrotor with dynamic extension (ch. 2)."""

    vehicle_models = ("quadrotor",)
    reference_kinds = ("position",)
    loop_gains = ("gains",)


class SwitchingController(Switching, ControllerTable):
    """Yaw-position control that switches to attitude-altitude control in a zone (ch. 2)."""

    vehicle_models = ("quadrotor",)
    reference_kinds = ("pose",)
    loop_gains = ("gains", "attitude_gains")

    @model_validator(mode="after")
    def _check(self) -> Self:
        for key in ("roll", "pitch"):
            low, high = getattr(self.zone, key)
            if low > high:
                raise self.mistake(f"zone.{key}", "the first must not exceed the second")
        return self


class QuadrotorAttitudeAltitudeController(QuadrotorAttitudeAltitude, ControllerTable):
    """Attitude-altitude control of the quadrotor (ch. 2, Appendix B)."""

    vehicle_models = ("quadrotor",)
    reference_kinds = ("attitude_altitude",)
    loop_gains = ("gains",)
