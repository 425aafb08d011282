"""The tables of a scenario that describe the vehicle: ``[vehicle]`` and ``[model_error]``."""

from dataclasses import replace
from math import sqrt
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

import numpy as np
from pydantic import Field

from tiltsim.models.parts import SERVO_ARMATURE, Pod
from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario import rotorcraft
from tiltsim.scenario.gait import FixedGait
from tiltsim.scenario.kinds import KINDS, tables_of, union_of
from tiltsim.scenario.messages import InvalidValueError
from tiltsim.scenario.rotorcraft import AnyVehicleTable, RotorcraftTable, TiltServoTable
from tiltsim.scenario.simulation_table import InitialTable
from tiltsim.scenario.table import NotTiny, Positive, Table, default, example
from tiltsim_controllers.mathematics.scalar import Values
from tiltsim_controllers.vehicle.parameters import PRESETS, Vehicle

MOMENTS: Final = ("inertia_xx", "inertia_yy", "inertia_zz")
"""The principal moments among the fields of `Vehicle`."""


class PodTable(Pod, Table):
    """Mass properties of one rotor pod; nearly massless by default, as in the thesis."""

    model_config = example(mass=0.02, inertia=1e-5)


MIN_GYRATION: Final = 1e-3
MAX_GYRATION: Final = 10.0
"""Radii of gyration over the arms' length; beyond them a unit is mistaken. Vehicles have 0.3."""


def require_physical_inertia(key: str, value: object, moments: tuple[float, ...]) -> None:
    """Raise `InvalidValueError` for principal moments (kg m^2) that no body can have."""
    a, b, c = sorted(moments)
    if a + b < c:
        raise InvalidValueError(
            key,
            value,
            "not physically realizable: principal moments must satisfy the triangle inequality",
        )


class VehicleTable(RotorcraftTable):
    """Four rotors on a cross: a preset, and the parameters that differ from it."""

    model_config = example(model="tiltrotor", mass=0.5)

    model: Literal["tiltrotor", "quadrotor"] = default(
        "tiltrotor", "tiltrotor: each of the four rotors tilts about its arm; quadrotor: none does"
    )
    preset: Literal["ar_drone_2", "ar_drone_2_unrounded", "luukkonen"] = default(
        "ar_drone_2",
        "parameters that are not given: ch. 3's vehicle, ch. 2's (the same with its inertia "
        "unrounded), or ch. 12's",
    )
    mjcf: str | None = default(
        None,
        "an MJCF file, relative to the scenario's folder, in place of the shipped one; parameters "
        "that are not given here are the file's instead of the preset's",
        "my_tiltrotor.xml",
    )
    mass: Positive | None = default(None, "pods included; default: the preset's [kg]", 0.5)
    inertia: Annotated[tuple[Positive, Positive, Positive], Field(strict=False)] | None = default(
        None,
        "principal moments about the center of mass, along the body axes, pods included; default: "
        "the preset's [kg m^2]",
        [2e-3, 3e-3, 5e-3],
    )
    arm_length: NotTiny | None = default(
        None, "from the center of mass to a rotor; default: the preset's [m]", 0.2
    )
    thrust_coefficient: NotTiny | None = default(
        None, "K_f, thrust per square of the rotor speed; default: the preset's [N s^2/rad^2]", 8e-6
    )
    drag_coefficient: NotTiny | None = default(
        None,
        "K_m, torque about the rotor's axis per square of its speed; default: the preset's [N m "
        "s^2/rad^2]",
        2.4e-7,
    )
    gravity: Positive | None = default(None, "default: the preset's [m/s^2]", 9.81)
    pod: PodTable = default(PodTable(), "mass properties of the tilting part of an arm")

    def resolve(self) -> Vehicle:
        """The physical parameters: the preset's or the file's, overridden by the keys given."""
        known = {k: value for k, value in self if k in Vehicle._fields and value is not None}
        if self.inertia is not None:
            known |= zip(MOMENTS, self.inertia, strict=True)
        user_vehicle = self.user_vehicle
        measured = None if user_vehicle is None else user_vehicle.vehicle
        base = measured if isinstance(measured, Vehicle) else PRESETS[self.preset]
        return base._replace(**known)

    @property
    def rotor_count(self) -> int:
        return 4

    @property
    def tilt_count(self) -> int:
        return 4 if self.model == "tiltrotor" else 0

    @property
    def cross(self) -> str:
        return self.model

    @property
    def hinge_inertias(self) -> Values:
        user_vehicle, shipped = self.user_vehicle, SERVO_ARMATURE + self.pod.inertia
        of_file = () if user_vehicle is None else user_vehicle.hinge_inertias
        return of_file or (shipped,) * 4

    @property
    def pod_inertias(self) -> Values:
        user_vehicle = self.user_vehicle
        return (self.pod.inertia,) * 4 if user_vehicle is None else user_vehicle.pod_inertias

    @property
    def has_standard_layout(self) -> bool:
        """Whether the rotors are at the ends of four equal arms at right angles."""
        return self.user_vehicle is None or not self.user_vehicle.layout_mismatch

    @property
    def has_actuators(self) -> bool:  # type: ignore[override]
        return self.has_tilting_rotors

    def check_scenario(self, scenario: Any) -> None:
        """Without hinges the rotors produce the commanded thrust at once."""
        if self.has_actuators:
            return
        keys = {"gait.type": "fixed", "gait": FixedGait()}
        keys |= {"vehicle.tilt_servo": TiltServoTable(), "vehicle.pod": PodTable()}
        if not scenario.controller.rotors_have_speeds:
            keys |= {"vehicle.min_rotor_speed": None, "vehicle.max_rotor_speed": None}
            keys["initial.rotor_speed"] = InitialTable().rotor_speed
        if not scenario.controller.is_external:
            keys["vehicle.rotor_inertia"] = 0.0
        reason = f"not supported for the {self.model}, whose rotors do not tilt and produce the"
        for key, ideal in keys.items():
            scenario.require(key, ideal, f"{reason} commanded thrust at once; remove it")

    def _check_values(self) -> None:
        if self.mjcf is not None:
            self.require_defaults(("arm_length", "pod"), "defined by vehicle.mjcf; remove it")
        vehicle = self.resolve()
        moments = vehicle[1:4]
        require_physical_inertia("vehicle.inertia", sorted(moments), moments)
        radius = sqrt(max(moments) / vehicle.mass)  # of gyration, m
        if not MIN_GYRATION < radius / vehicle.arm_length < MAX_GYRATION:
            raise InvalidValueError(
                "vehicle.inertia",
                moments,
                f"is in kg m^2, arms in m: mass this far out, {radius:.3g} m on average, does not "
                f"belong to arms of {vehicle.arm_length:g} m; check inertia, mass and arm_length",
            )
        self._check_rotor_inertia(moments[2] / self.rotor_count)
        self._check_limits()


VEHICLES: Final = tables_of(
    AnyVehicleTable,  # type: ignore[type-abstract]
    "model",
    (__name__, rotorcraft.__name__, *KINDS),
)
"""The tables of all vehicles by their models."""

if TYPE_CHECKING:
    VehicleUnion = AnyVehicleTable
else:
    VehicleUnion = union_of(VEHICLES, "model", "tiltrotor")
"""The ``[vehicle]`` table, discriminated by its model."""

ScaleFactor = Annotated[float, Field(ge=0.01, le=100.0)]


class ModelErrorTable(Table):
    """Factors between the simulated vehicle and the ``[vehicle]`` that the controller assumes."""

    model_config = example(mass=1.1)

    mass: ScaleFactor = default(
        1.0, "factor on the mass; 1.1 is 10 % heavier than assumed [-]", 1.1
    )
    inertia: Annotated[tuple[ScaleFactor, ScaleFactor, ScaleFactor], Field(strict=False)] = default(
        (1.0, 1.0, 1.0), "one factor per moment about a body axis [-]", [1.1, 1.1, 1.0]
    )
    arm_length: ScaleFactor = default(1.0, "factor on the arms' length [-]", 1.02)
    thrust_coefficient: ScaleFactor = default(1.0, "factor on every rotor's thrust [-]", 0.9)
    drag_coefficient: ScaleFactor = default(1.0, "factor on every rotor's torque [-]", 0.9)

    def apply(self, vehicle: Vehicle | Multirotor) -> Any:
        """The simulated vehicle, where the controller assumes ``vehicle``.

        Products of inertia of a multirotor get the mean factor of their axes.
        """
        if isinstance(vehicle, Vehicle):
            factors = self.model_dump(exclude={"inertia"})
            factors |= zip(MOMENTS, self.inertia, strict=True)
            known = vehicle._asdict()
            return vehicle._replace(**{key: factor * known[key] for key, factor in factors.items()})
        scale = np.sqrt(self.inertia)
        inertia = np.reshape(vehicle.inertia, (3, 3)) * np.outer(scale, scale)
        return replace(
            vehicle,
            mass=self.mass * vehicle.mass,
            inertia=tuple(inertia.ravel().tolist()),
            rotors=tuple(
                rotor._replace(
                    thrust=self.thrust_coefficient * rotor.thrust,
                    drag=self.drag_coefficient * rotor.drag,
                )
                for rotor in vehicle.rotors
            ),
        )
