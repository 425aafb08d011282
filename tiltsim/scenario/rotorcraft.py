"""Vehicles in general, and with any number of rotors, in a scenario's ``[vehicle]`` table."""

from abc import ABC, abstractmethod
from math import inf, pi
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final, Literal

from pydantic import Field

from tiltsim.models.cross import as_multirotor
from tiltsim.models.parts import RotorLimits, TiltServo
from tiltsim.models.rotor_table import Multirotor
from tiltsim.models.user_vehicle import UserVehicle
from tiltsim.scenario.gait import FixedGait
from tiltsim.scenario.table import NonNegative, Positive, Table, default, example, required
from tiltsim_controllers.mathematics.scalar import Values
from tiltsim_controllers.vehicle.parameters import Vehicle
from tiltsim_controllers.vehicle.rotors import Rotor

SPATIAL_KEYS: Final = ("position", "velocity", "acceleration", "amplitude")
"""Keys of references that hold a vector in the world."""


class ServoTable(Table):
    """A position servo of second order, ideal except for the given keys."""

    model_config = example(natural_frequency=30.0)

    natural_frequency: Positive = default(
        TiltServo.natural_frequency, "bandwidth of the servo [rad/s]", 30.0
    )
    damping_ratio: Positive = default(TiltServo.damping_ratio, "1 is critically damped [-]")

    @property
    def angle_limit(self) -> float | None:
        """Largest tilt angle either way, rad; None without mechanical stops."""
        return None


class TiltServoTable(ServoTable):
    """The servos that tilt the pods."""

    model_config = example(natural_frequency=30.0, max_rate=2.0)

    max_rate: Positive | None = default(None, "largest tilt rate; default: unlimited [rad/s]", 2.0)
    max_angle: Annotated[float, Field(gt=0.0, le=pi)] | None = default(
        None,
        "mechanical stop to either side, within which the gait must stay; default: none [rad]",
        1.0,
    )

    @property
    def angle_limit(self) -> float | None:
        return self.max_angle


class AnyVehicleTable(Table, ABC):
    """The keys and properties of every vehicle."""

    table_name = "vehicle"
    is_planar: ClassVar[bool] = False  # moves on a plane, without gravity, air or ground
    has_actuators: ClassVar[bool] = False  # which may lag, have limits and fail

    model: str
    if TYPE_CHECKING:
        tilt_servo: ServoTable

    @property
    @abstractmethod
    def rotor_count(self) -> int:
        """Number of rotors."""

    @property
    @abstractmethod
    def tilt_count(self) -> int:
        """Number of servos that tilt rotors."""

    @property
    def has_tilting_rotors(self) -> bool:
        """Whether servos tilt the rotors."""
        return self.tilt_count > 0

    @abstractmethod
    def resolve(self) -> Any:
        """The physical parameters."""

    @property
    def spins(self) -> Values:
        """Signs of the rotor speeds."""
        return (1.0,) * self.rotor_count

    @property
    def rotor_range(self) -> tuple[float | None, float | None]:
        """Smallest and largest speed (rad/s) of a rotor along its spin; None without limit."""
        return 0.0, None  # thrusts push and cannot pull

    def check_scenario(self, scenario: Any) -> None:
        """Refuse a scenario that contradicts its vehicle. Raises `InvalidValueError`."""


class PlanarTable(AnyVehicleTable, ABC):
    """A vehicle that moves in the plane of x and y, whose laws control these two."""

    is_planar = True

    def check_scenario(self, scenario: Any) -> None:
        """Refuse motion out of the plane, a reference of yaw, and a gait that the law ignores."""
        initial, controller, gait = scenario.initial, scenario.controller, scenario.gait
        out_of_plane: dict[str, tuple[float, ...]] = {
            "initial.position": initial.position[2:],
            "initial.velocity": initial.velocity[2:],
            "initial.attitude": initial.attitude[:2],
            "initial.angular_velocity": initial.angular_velocity[:2],
        }
        spatial = ((key, vector) for key, vector in scenario.reference if key in SPATIAL_KEYS)
        out_of_plane |= {f"reference.{key}": vector[2:] for key, vector in spatial}
        for key, components in out_of_plane.items():
            if any(components):
                scenario.refuse(
                    key, f"the {self.model} stays in its plane: only x, y and yaw may be nonzero"
                )
        scenario.require("reference.yaw", 0.0, f"yaw is not an output of the {self.model}'s laws")
        law, allowed = f"the {controller.law} law", controller.gait_types
        if allowed != ("fixed",):
            if gait.type not in allowed:
                scenario.refuse("gait.type", f"{law} needs one of {', '.join(allowed)}")
            return
        if gait.type != "fixed":
            scenario.refuse("gait.type", f"{law} does not use a gait; remove [gait]")
        scenario.require("gait", FixedGait(), f"{law} commands the tilt itself; remove [gait]")


class RotorcraftTable(AnyVehicleTable, ABC):
    """The keys and properties of every vehicle that flies."""

    has_actuators = True

    mjcf: str | None
    min_rotor_speed: NonNegative | None = default(
        None,
        "smallest absolute value; at 0 a rotor may stop but not reverse; default: unlimited "
        "[rad/s]",
        200.0,
    )
    max_rotor_speed: Positive | None = default(
        None, "largest absolute value; default: unlimited [rad/s]", 390.0
    )
    rotor_time_constant: Positive | None = default(
        None,
        "time constant of the lag between commanded and actual rotor speed; default: no lag [s]",
        0.04,
    )
    rotor_inertia: NonNegative = default(
        0.0,
        "spin inertia of one rotor about its axis: reaction to its acceleration and gyroscopic "
        "torque [kg m^2]",
        1e-5,
    )
    tilt_servo: TiltServoTable = default(TiltServoTable(), "the servos that tilt the rotors")

    @abstractmethod
    def resolve(self) -> Vehicle | Multirotor: ...

    @property
    def multirotor(self) -> Multirotor:
        """The physical parameters by rotors."""
        return as_multirotor(self.resolve(), tilting=self.has_tilting_rotors)

    @property
    def rotors(self) -> tuple[Rotor, ...]:
        """Places, axes, coefficients and tilts of the rotors."""
        return self.multirotor.rotors

    @property
    def cross(self) -> str:
        """The model of four rotors on a cross, each on its own hinge or fixed; empty for others."""
        return ""

    @property
    def rotor_range(self) -> tuple[float | None, float | None]:
        return self.min_rotor_speed, self.max_rotor_speed

    @property
    def spins(self) -> Values:
        return self.resolve().spins

    @property
    def thrust_coefficients(self) -> Values:
        """K_f of each rotor, N s^2/rad^2."""
        return self.resolve().thrust_coefficients

    def tilt_of_rotor(self, rotor: int) -> int:
        """The number, from 0, of the tilt of a rotor, whose number is from 1; -1: fixed."""
        return self.rotors[rotor - 1].tilt

    @property
    @abstractmethod
    def hinge_inertias(self) -> Values:
        """Inertia (kg m^2) of servo and pod about each tilt hinge."""

    @property
    @abstractmethod
    def pod_inertias(self) -> Values:
        """The pods' own share of `hinge_inertias`."""

    @property
    def hinge_deflections(self) -> Values:
        """Angles (rad) by which thrust and drag at hover turn the hinges against their servos."""
        vehicle, stiffness = self.multirotor, self.tilt_servo.natural_frequency**2
        torques, square = [0.0] * self.tilt_count, vehicle.hover_rotor_speed**2
        for rotor in vehicle.rotors:
            if rotor.tilt >= 0:
                torques[rotor.tilt] += rotor.hinge_load * square
        inertias = self.hinge_inertias
        return tuple(t / (stiffness * i) for t, i in zip(torques, inertias, strict=True))

    @property
    def speeds_along_spin(self) -> tuple[float, float]:
        """Lowest and highest speed (rad/s) of a rotor along its spin; infinite without limits."""
        limits = RotorLimits(self.min_rotor_speed, self.max_rotor_speed)
        return limits.speed_range(1.0) or (-inf, inf)

    @property
    def has_rotor_limits(self) -> bool:
        """Whether the rotor speeds are limited."""
        return self.min_rotor_speed is not None or self.max_rotor_speed is not None

    @property
    def user_vehicle(self) -> UserVehicle | None:
        """The user's MJCF file as measured; None for the shipped vehicles."""
        if self.mjcf is None:
            return None
        from tiltsim.models.user_vehicle import read_user_vehicle

        try:
            return read_user_vehicle(self.mjcf, self.model)
        except ValueError as error:
            raise self.mistake("mjcf", str(error)) from None

    def _check_limits(self) -> None:
        low, high = self.min_rotor_speed, self.max_rotor_speed
        if low is not None and high is not None and low >= high:
            raise self.mistake("min_rotor_speed", f"must be below max_rotor_speed = {high}")

    def _check_rotor_inertia(self, limit: float) -> None:
        if self.rotor_inertia >= limit:
            reason = f"must be below {limit:g}: the vehicle's inertia includes all rotors"
            raise self.mistake("rotor_inertia", reason)


class MultirotorTable(RotorcraftTable):
    """Any number of rotors, each anywhere, fixed or on a hinge, described by an MJCF file alone."""

    model_config = example(model="multirotor", mjcf="mjcf/hexarotor.xml")

    model: Literal["multirotor"] = required(
        "2 to 16 rotors at any places, with any thrust axes, fixed or tilted about hinges of any "
        "axes, of which two may share one"
    )
    mjcf: str = required(
        "an MJCF file, relative to the scenario's folder, with all parameters", "my_hexarotor.xml"
    )

    @property
    def file(self) -> UserVehicle:
        """The file as measured."""
        vehicle = self.user_vehicle
        assert vehicle is not None  # mjcf is required
        return vehicle

    def resolve(self) -> Multirotor:
        vehicle = self.file.vehicle
        assert isinstance(vehicle, Multirotor)  # as read for this model
        return vehicle

    @property
    def rotor_count(self) -> int:
        return self.file.parts.rotors

    @property
    def tilt_count(self) -> int:
        return self.file.parts.tilts

    @property
    def hinge_inertias(self) -> Values:
        return self.file.hinge_inertias

    @property
    def pod_inertias(self) -> Values:
        return self.file.pod_inertias

    def check_scenario(self, scenario: Any) -> None:
        """Refuse servos without tilts, and laws for which the rotors are too few."""
        tilts, controller = self.has_tilting_rotors, scenario.controller
        if not tilts:
            reason = "vehicle.mjcf has no tilts; remove it"
            scenario.require("vehicle.tilt_servo", TiltServoTable(), reason)
        too_few = self.rotor_count < 4 and controller.needs_four_rotors
        if too_few and not controller.commands_tilts:
            reason = f"{self.rotor_count} rotors control attitude and lift only together with"
            if not tilts:
                scenario.refuse("vehicle.mjcf", f"{reason} their tilts, and none of them tilts")
            choice = "choose full_pose, or geometric with tilts = free"
            scenario.refuse("controller.law", f"{reason} their tilts; {choice}")

    def _check_values(self) -> None:
        self._check_rotor_inertia(self.resolve().max_rotor_inertia)
        self._check_limits()
