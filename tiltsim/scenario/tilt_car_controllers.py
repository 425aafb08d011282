"""The ``[controller]`` tables of the tilt-car."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

import tiltsim_controllers.tilt_car.fourth_derivative as fourth_derivative
import tiltsim_controllers.tilt_car.planned_direction as planned_direction
import tiltsim_controllers.tilt_car.third_derivative as third_derivative
from tiltsim.scenario.controller_table import ControllerTable, NamedGains
from tiltsim.scenario.table import Gains2, Gains4, NonNegative, Table, Vector3


class ThirdDerivativeController(ControllerTable):
    """Third-derivative feedback linearization of the tilt-car (ch. 10, Sec. 3.1)."""

    vehicle_models = ("tilt_car",)
    reference_kinds = ("position",)
    loop_gains = (("position", 3),)

    law: Literal["tilt_car_third_derivative"] = Field(
        description="the tilt-car's rotor speeds and tilt control the third derivative of x and y"
    )
    gains: NamedGains[Literal["ch10"], Vector3] = Field(
        "ch10",
        description="poles at -2, or three gains on the errors of acceleration, velocity and "
        "position [1/s, 1/s^2, 1/s^3]",
        examples=[[6.0, 12.0, 8.0]],
    )
    restoring_rate: NonNegative = Field(
        0.0,
        description="rate of turning the mean thrust direction towards the acceleration; "
        "0 as published [1/s]",
        examples=[1.0],
    )

    def resolve_gains(self) -> third_derivative.Gains:
        if isinstance(self.gains, str):
            return third_derivative.GAIN_SETS[self.gains]
        return third_derivative.Gains(*self.gains)


class FourthDerivativeController(ControllerTable):
    """Fourth-derivative feedback linearization of the tilt-car (ch. 10, Sec. 6.1)."""

    vehicle_models = ("tilt_car",)
    reference_kinds = ("position",)
    loop_gains = (("position", 4),)

    law: Literal["tilt_car_fourth_derivative"] = Field(
        description="the tilt-car's rotor speeds and tilt control the fourth derivative of x and y"
    )
    decoupling: Literal["published", "exact"] = Field(
        "exact",
        description="effect of the tilt in the decoupling matrix: as published, or with the yaw's "
        "reaction",
    )
    anti_windup: bool = Field(
        False, description="stop the rotor speeds that the law integrates at zero"
    )
    gains: NamedGains[Literal["ch10"], Gains4] = Field(
        "ch10",
        description="poles at -3, or four gains on the errors of jerk, acceleration, velocity and "
        "position [1/s, 1/s^2, 1/s^3, 1/s^4]",
        examples=[[12.0, 54.0, 108.0, 81.0]],
    )

    def resolve_gains(self) -> fourth_derivative.Gains:
        if isinstance(self.gains, str):
            return fourth_derivative.GAIN_SETS[self.gains]
        return fourth_derivative.Gains(*self.gains)

    @property
    def rotors_stop_at_zero(self) -> bool:
        return self.anti_windup


class PlannedDirectionGainTable(Table):
    """Explicit gains of the planned-direction law."""

    x: Gains2 = Field(
        description="K_X1, K_X2, on the errors of velocity and position along x [1/s, 1/s^2]",
        examples=[[12.0, 6.0]],
    )
    y: Gains2 = Field(
        description="K_Y1, K_Y2, on the errors of velocity and position along y [1/s, 1/s^2]",
        examples=[[9.0, 18.0]],
    )


class PlannedDirectionController(ControllerTable):
    """Control of the tilt-car under a planned thrust direction (ch. 10, Sec. 5; ch. 11)."""

    vehicle_models = ("tilt_car",)
    reference_kinds = ("position",)
    gait_types = ("penguin_small", "penguin_large", "rotating")
    loop_gains = (("x", 2), ("y", 2))

    law: Literal["tilt_car_planned_direction"] = Field(
        description="the tilt-car's rotor speeds control x and y; the tilt follows the gait"
    )
    gains: NamedGains[Literal["ch10", "ch11"], PlannedDirectionGainTable] = Field(
        "ch11",
        description="ch11 is the thesis's set, ch10 has its poles at -2; or a table of gains",
    )

    def resolve_gains(self) -> planned_direction.Gains:
        if isinstance(self.gains, PlannedDirectionGainTable):
            return planned_direction.Gains(*self.gains.x, *self.gains.y)
        return planned_direction.GAIN_SETS[self.gains]
