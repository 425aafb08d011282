"""The tilt-car of ch. 10 and 11: the tables of its vehicle, its gaits and its laws."""

from abc import abstractmethod
from math import pi
from typing import Annotated, Any, Final, Literal

from pydantic import Field

from tiltsim.scenario.controller_table import ControllerTable
from tiltsim.scenario.gait import GaitTable
from tiltsim.scenario.rotorcraft import PlanarTable, ServoTable
from tiltsim.scenario.table import Angle, Period, Positive, default, required
from tiltsim_controllers.gaits import plans
from tiltsim_controllers.gaits.plans import Gait as PlannedGait
from tiltsim_controllers.tilt_car.laws import FourthDerivative, PlannedDirection, ThirdDerivative
from tiltsim_controllers.tilt_car.vehicle import THESIS_CAR, TiltCar, turn_per_tilt


class TiltCarTable(PlanarTable):
    """The tilt-car of ch. 10; defaults: `tiltsim_controllers.tilt_car.vehicle.THESIS_CAR`."""

    model: Literal["tilt_car"] = required(
        "two discs on one axis that slide on a plane: the top one carries two rotors and turns "
        "against the bottom one"
    )
    mass: Positive = default(THESIS_CAR.mass, "the thesis does not give it [kg]")
    top_inertia: Positive = default(
        THESIS_CAR.top_inertia, "I_T, of the top disc about the axis [kg m^2]"
    )
    bottom_inertia: Positive = default(
        THESIS_CAR.bottom_inertia,
        "of the bottom disc alone about the axis; I_B is that of both discs [kg m^2]",
    )
    half_angle: Annotated[float, Field(gt=0.0, lt=pi / 2)] = default(
        THESIS_CAR.half_angle, "theta, between the mean thrust direction and either thrust [rad]"
    )
    thrust_coefficient: Positive = default(
        THESIS_CAR.thrust_coefficient, "K_F, thrust per square of the rotor speed [N s^2/rad^2]"
    )
    tilt_servo: ServoTable = default(ServoTable(), "the servo that turns the top disc")

    @property
    def rotor_count(self) -> int:
        return 2

    @property
    def tilt_count(self) -> int:
        return 1

    def resolve(self) -> TiltCar:
        return TiltCar(**{key: value for key, value in self if key in TiltCar._fields})


class TiltCarGait(GaitTable):
    """Base of the tilt-car's gaits, which plan the direction of the thrusts."""

    @property
    def tilts(self) -> None:
        return None

    def _unscaled(self, vehicle: Any) -> PlannedGait:
        if not isinstance(vehicle, TiltCar):
            number = "four" if vehicle.tilts == 4 else vehicle.tilts
            reason = f"is a gait of the tilt_car; this vehicle has {number} tilt angles"
            raise self.mistake("type", reason)
        # The bottom disc counter-rotates, so that the tilt exceeds the thrusts' rotation.
        return self._tilt(1.0 / turn_per_tilt(vehicle))

    @abstractmethod
    def _tilt(self, per_direction: float) -> PlannedGait:
        """The gait of the tilt angle, given the tilt for a thrust direction of 1 rad."""


PENGUIN_SWINGS: Final = {"penguin_small": pi / 8, "penguin_large": pi / 3}
"""Directions of the thrusts (rad) between which the penguins swing (ch. 11, Figs. 7 and 8)."""


class PenguinGait(TiltCarGait):
    """The penguin-inspired gaits of ch. 11: half a period on one side, half on the other."""

    size_key = "amplitude"
    alternates = True

    type: Literal["penguin_small", "penguin_large"] = required(
        "a penguin's waddle: the thrusts jump between two directions"
    )
    amplitude: Angle | None = default(
        None,
        "either direction, from straight ahead; default: pi/8 (small), pi/3 (large) [rad]",
        0.4,
    )
    period: Period = default(2.0, "T, of the whole cycle [s]")

    def _tilt(self, per_direction: float) -> PlannedGait:
        swing = PENGUIN_SWINGS[self.type] if self.amplitude is None else self.amplitude
        return plans.penguin(self.type, swing * per_direction, self.period)


class RotatingGait(TiltCarGait):
    """Thrusts that rotate at a constant rate (ch. 10, Eq. 18)."""

    size_key = "rate"

    type: Literal["rotating"] = required("the thrusts turn without end")
    rate: Annotated[float, Field(ge=-1e3, le=1e3)] = required(
        "of the thrusts' direction [rad/s]", 1.0
    )
    start: Angle = default(0.0, "the thrusts' direction at time zero [rad]")

    def _tilt(self, per_direction: float) -> PlannedGait:
        return plans.rotating(self.start * per_direction, self.rate * per_direction)


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
