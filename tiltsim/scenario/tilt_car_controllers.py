"""The ``[controller]`` tables of the tilt-car."""

from tiltsim.scenario.controller_table import ControllerTable
from tiltsim_controllers.tilt_car.integrating import FourthDerivative, ThirdDerivative
from tiltsim_controllers.tilt_car.planned_direction import PlannedDirection


class ThirdDerivativeController(ThirdDerivative, ControllerTable):
    """Third-derivative feedback linearization of the tilt-car (ch. 10, Sec. 3.1)."""

    vehicle_models = ("tilt_car",)
    reference_kinds = ("position",)
    loop_gains = ("gains",)


class FourthDerivativeController(FourthDerivative, ControllerTable):
    """Fourth-derivative feedback linearization of the tilt-car (ch. 10, Sec. 6.1)."""

    vehicle_models = ("tilt_car",)
    reference_kinds = ("position",)
    loop_gains = ("gains",)

    @property
    def rotors_stop_at_zero(self) -> bool:  # type: ignore[override]
        return self.anti_windup


class PlannedDirectionController(PlannedDirection, ControllerTable):
    """Control of the tilt-car under a planned thrust direction (ch. 10, Sec. 5; ch. 11)."""

    vehicle_models = ("tilt_car",)
    reference_kinds = ("position",)
    gait_types = ("penguin_small", "penguin_large", "rotating")
    loop_gains = ("gains",)
