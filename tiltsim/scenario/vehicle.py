"""The tables of a scenario that describe the vehicle: ``[vehicle]`` and ``[model_error]``."""

from __future__ import annotations

from math import inf, pi
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from pydantic import Discriminator, Field, Tag, model_validator

from tiltsim.models.parts import Pod, TiltServo
from tiltsim.scenario.messages import InvalidValueError
from tiltsim.scenario.table import NonNegative, NotTiny, Positive, Table
from tiltsim_controllers.tilt_car.vehicle import THESIS_CAR, TiltCar
from tiltsim_controllers.vehicle.parameters import PRESETS, Vehicle

if TYPE_CHECKING:
    from tiltsim.models.user_vehicle import UserVehicle


class ServoTable(Table):
    """A position servo: second order, ideal but for what is given here."""

    natural_frequency: Positive = Field(TiltServo.natural_frequency, description="rad/s")
    damping_ratio: Positive = TiltServo.damping_ratio

    @property
    def stops(self) -> bool:
        """Whether the servo has mechanical stops."""
        return False


class TiltServoTable(ServoTable):
    """The servos that tilt the pods."""

    max_rate: Positive | None = Field(None, description="rad/s")
    max_angle: Annotated[float, Field(gt=0.0, le=pi)] | None = Field(
        None, description="rad; the gait must stay within"
    )

    @property
    def stops(self) -> bool:
        """Whether the servo has mechanical stops."""
        return self.max_angle is not None


class PodTable(Table):
    """Mass properties of one rotor pod; nearly massless by default, as in the thesis."""

    # MuJoCo refuses moving bodies a decade below.
    mass: Annotated[float, Field(ge=1e-14)] = Field(Pod.mass, description="kg")
    inertia: Annotated[float, Field(ge=1e-14)] = Field(
        Pod.inertia, description="kg m^2, about each axis of the pod"
    )


class VehicleTable(Table):
    """A rotorcraft: a preset and what differs from it."""

    model: Literal["tiltrotor", "quadrotor"] = "tiltrotor"
    preset: Literal["ar_drone_2", "ar_drone_2_unrounded", "luukkonen"] = "ar_drone_2"
    mjcf: str | None = Field(
        None,
        description="a file with the vehicle, beside the scenario's, in place of the shipped one; "
        "it has the parameters that are not given here, and the preset none",
    )
    mass: Positive | None = Field(None, description="kg, pods included")
    inertia: Annotated[tuple[Positive, Positive, Positive], Field(strict=False)] | None = Field(
        None, description="principal moments about the centre of mass, kg m^2, pods included"
    )
    arm_length: NotTiny | None = Field(None, description="m")
    thrust_coefficient: NotTiny | None = Field(None, description="N s^2/rad^2")
    drag_coefficient: NotTiny | None = Field(None, description="N m s^2/rad^2")
    gravity: Positive | None = Field(None, description="m/s^2")
    min_rotor_speed: NonNegative | None = Field(
        None, description="rad/s, absolute value; at 0 a rotor may stop, but not reverse"
    )
    max_rotor_speed: Positive | None = Field(None, description="rad/s, absolute value")
    rotor_time_constant: Positive | None = Field(
        None, description="s, of the lag between the speed a rotor is told and its own"
    )
    tilt_servo: TiltServoTable = TiltServoTable()
    pod: PodTable = PodTable()

    def resolve(self) -> Vehicle:
        """The physical parameters: the preset's or the file's, but for the keys given."""
        given = {
            key: getattr(self, key)
            for key in ("mass", "arm_length", "thrust_coefficient", "drag_coefficient", "gravity")
        }
        if self.inertia is not None:
            given |= dict(
                zip(("inertia_xx", "inertia_yy", "inertia_zz"), self.inertia, strict=True)
            )
        known = {key: value for key, value in given.items() if value is not None}
        own = self.user_vehicle
        base = PRESETS[self.preset] if own is None else own.vehicle
        return base._replace(**known)

    @property
    def speeds_along_spin(self) -> tuple[float, float]:
        """Least and greatest speed (rad/s) of a rotor along its spin; infinite without limits."""
        low, high = self.min_rotor_speed, self.max_rotor_speed
        greatest = inf if high is None else high
        return -greatest if low is None else low, greatest

    @property
    def user_vehicle(self) -> UserVehicle | None:
        """The user's own file as measured; None for the shipped vehicles."""
        if self.mjcf is None:
            return None
        from tiltsim.models.user_vehicle import read_user_vehicle

        try:
            return read_user_vehicle(self.mjcf, self.model)
        except ValueError as error:
            raise InvalidValueError("vehicle.mjcf", self.mjcf, str(error)) from None

    def _check_own(self) -> None:
        for key, value, default in (
            ("arm_length", self.arm_length, None),
            ("pod", self.pod.model_dump(), PodTable().model_dump()),
        ):
            if value != default:
                raise InvalidValueError(
                    f"vehicle.{key}", value, "vehicle.mjcf has its own; leave it out"
                )

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.mjcf is not None:
            self._check_own()
        a, b, c = sorted(self.resolve()[1:4])
        if a + b < c:
            raise InvalidValueError(
                "vehicle.inertia", [a, b, c], "no body has it: two moments must exceed the third"
            )
        low, high = self.min_rotor_speed, self.max_rotor_speed
        if low is not None and high is not None and low >= high:
            raise InvalidValueError(
                "vehicle.min_rotor_speed", low, f"must be below max_rotor_speed = {high}"
            )
        return self


class TiltCarTable(Table):
    """The tilt-car of ch. 10; defaults: `tiltsim_controllers.tilt_car.vehicle.THESIS_CAR`."""

    model: Literal["tilt_car"]
    mass: Positive = Field(THESIS_CAR.mass, description="kg; the thesis does not give it")
    top_inertia: Positive = Field(
        THESIS_CAR.top_inertia, description="I_T, of the top disc about the axis, kg m^2"
    )
    bottom_inertia: Positive = Field(
        THESIS_CAR.bottom_inertia,
        description="of the bottom disc alone about the axis, kg m^2; I_B is both discs'",
    )
    half_angle: Annotated[float, Field(gt=0.0, lt=pi / 2)] = Field(
        THESIS_CAR.half_angle, description="theta, from the middle of the thrusts to either, rad"
    )
    thrust_coefficient: Positive = Field(
        THESIS_CAR.thrust_coefficient, description="K_F, N s^2/rad^2"
    )
    tilt_servo: ServoTable = ServoTable()

    def resolve(self) -> TiltCar:
        """The physical parameters."""
        return TiltCar(
            self.mass,
            self.top_inertia,
            self.bottom_inertia,
            self.half_angle,
            self.thrust_coefficient,
        )


def _model(value: Any) -> str:
    if isinstance(value, VehicleTable | TiltCarTable):
        return "tilt_car" if isinstance(value, TiltCarTable) else "tiltrotor"
    model = value.get("model", "tiltrotor") if isinstance(value, dict) else "tiltrotor"
    if not isinstance(model, str):
        return ""
    return "tiltrotor" if model == "quadrotor" else model


VehicleUnion = Annotated[
    Annotated[VehicleTable, Tag("tiltrotor")] | Annotated[TiltCarTable, Tag("tilt_car")],
    Discriminator(_model),
]
"""The ``[vehicle]`` table, told apart by its model."""


Share = Annotated[float, Field(ge=0.01, le=100.0)]


class ModelErrorTable(Table):
    """By what factors the vehicle that flies differs from the ``[vehicle]`` that the law knows."""

    mass: Share = 1.0
    inertia: Annotated[tuple[Share, Share, Share], Field(strict=False)] = Field(
        (1.0, 1.0, 1.0), description="one factor a principal moment"
    )
    arm_length: Share = 1.0
    thrust_coefficient: Share = 1.0
    drag_coefficient: Share = 1.0

    def apply(self, vehicle: Vehicle) -> Vehicle:
        """The vehicle that flies, where the law knows ``vehicle``."""
        xx, yy, zz = self.inertia
        return vehicle._replace(
            mass=self.mass * vehicle.mass,
            inertia_xx=xx * vehicle.inertia_xx,
            inertia_yy=yy * vehicle.inertia_yy,
            inertia_zz=zz * vehicle.inertia_zz,
            arm_length=self.arm_length * vehicle.arm_length,
            thrust_coefficient=self.thrust_coefficient * vehicle.thrust_coefficient,
            drag_coefficient=self.drag_coefficient * vehicle.drag_coefficient,
        )
