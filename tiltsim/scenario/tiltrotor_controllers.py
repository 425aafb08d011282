"""The ``[controller]`` tables of the tiltrotor."""

from __future__ import annotations

from math import inf, pi
from typing import Annotated, Final, Literal, Self

from pydantic import Discriminator, Field, Tag, model_validator

import tiltsim_controllers.laws.full_pose as full_pose
from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.controller_table import NamedGains
from tiltsim.scenario.gait_following import (
    FailureAwareController,
    GainTable,
    GaitFollowingController,
    PolePlacementTable,
    attitude_altitude_gain_kind,
)
from tiltsim.scenario.table import Positive, Table, Vector3, example
from tiltsim_controllers.analysis.stability import ErrorLoop, error_loops, feedforward_loops
from tiltsim_controllers.laws.attitude_altitude import DECOUPLINGS
from tiltsim_controllers.vehicle.parameters import Vehicle


class AttitudeAltitudeController(GaitFollowingController):
    """Attitude-altitude control of the tiltrotor under a planned gait (ch. 3 to 9)."""

    model_config = example(law="attitude_altitude", decoupler="modified")

    vehicle_models = ("tiltrotor",)
    reference_kinds = ("position", "attitude_altitude")

    law: Literal["attitude_altitude"] = Field(
        "attitude_altitude",
        description="the four rotor speeds control roll, pitch, yaw and altitude by feedback "
        "linearization; the tilt angles follow the gait",
    )
    decoupling: Literal["published", "exact"] = Field(
        "published",
        description="form of the decoupling matrix, which relates rotor accelerations to the third "
        "derivatives of attitude and altitude: as the thesis prints it, without the factor "
        "2 |rotor speed| in its attitude rows, or exact; the gains belong to one of the two",
    )
    decoupler: Literal["none", "conventional", "modified", "exact"] = Field(
        "modified",
        description="how the vehicle leans to control its horizontal position, for which no rotor "
        "speed is left: conventional leans as a quadrotor does, as if no rotor tilted; modified "
        "adds the lean that balances the tilted rotors' side force at hover, to first order; exact "
        "points their whole torque-free force along the desired acceleration; none leaves the "
        "position free, for reference.type attitude_altitude",
        examples=["exact"],
    )
    gains: Annotated[
        Annotated[Literal["ch03", "ch04", "exact", "feedforward"], Tag("named")]
        | Annotated[GainTable, Tag("table")]
        | Annotated[PolePlacementTable, Tag("poles")],
        Discriminator(attitude_altitude_gain_kind),
    ] = Field(
        "ch04",
        description="a named set, or a table of gains or of poles: ch03 and ch04 are the thesis's, "
        "for decoupling published; exact and feedforward are for decoupling exact; with the set "
        "exact a yaw step of 0.39 rad stops a rotor",
    )
    gait_rate_feedforward: bool = Field(
        False,
        description="use the planned tilt rates as well as the angles; needs decoupling and "
        "decoupler exact, and allows integral action",
    )
    rotor_inertia_feedforward: bool = Field(
        False,
        description="include the gyroscopic torque of the rotors' vehicle.rotor_inertia; needs "
        "gait_rate_feedforward",
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not self.gait_rate_feedforward:
            needs = "needs controller.gait_rate_feedforward = true"
            self.require_defaults(_RATE_KEYS, needs)
            if any(self.resolve_integral_gains()):
                raise self.mistake("gains", f"integral action {needs}")
            return self
        for key, choices in (("decoupling", ("exact",)), ("decoupler", ("exact", "none"))):
            if getattr(self, key) not in choices:
                needs = f"gait_rate_feedforward = true needs {' or '.join(choices)}"
                raise self.mistake(key, needs)
        return self

    def error_loops(self, vehicle: Vehicle) -> list[ErrorLoop]:
        if self.gait_rate_feedforward:
            return feedforward_loops(self.resolve_gains(), self.resolve_integral_gains())
        speed = vehicle.hover_rotor_speed
        return error_loops(self.resolve_gains(), speed, DECOUPLINGS[self.decoupling])

    @property
    def loop_name(self) -> str:
        return "gait_feedforward" if self.gait_rate_feedforward else self.law

    @property
    def omits_reference_acceleration(self) -> bool:
        return not self.gait_rate_feedforward


_RATE_KEYS: Final = (
    "leave_out",
    "anticipation",
    "max_acceleration",
    "max_angular_acceleration",
    "rotor_inertia_feedforward",
)
"""Keys of `AttitudeAltitudeController` that only gait_rate_feedforward reads."""


class FullPoseGainTable(Table):
    """Explicit gains of full-pose control."""

    position: Vector3 = Field(
        description="on the errors of acceleration, velocity and position [1/s, 1/s^2, 1/s^3]",
        examples=[[750.0, 1875.0, 1562.0]],
    )
    attitude: Vector3 = Field(
        description="on the errors of angular acceleration, body rates and attitude "
        "[1/s, 1/s^2, 1/s^3]",
        examples=[[750.0, 1500.0, 2577.0]],
    )


class FullPoseController(FailureAwareController):
    """Position and attitude control with the tilt angles as inputs (ch. 3)."""

    vehicle_models = ("tiltrotor", "multirotor")
    reference_kinds = ("position", "pose", "attitude_altitude")
    loop_gains = (("position", 3), ("attitude", 3))
    commands_tilts = True
    follows_turns = True

    law: Literal["full_pose"] = Field(
        description="position and attitude independently: the law commands the tilt angles as "
        "well, of the tiltrotor or of a multirotor whose rotors and tilts move six outputs"
    )
    gains: NamedGains[Literal["ch03"], FullPoseGainTable] = Field(
        "ch03", description="a set by name, or a table of gains; ch03 is the thesis's author's"
    )
    tilt_weight: Literal["even", "published"] = Field(
        "even",
        description="how tilt rates count against rotor accelerations in the least-norm solution: "
        "even by the force that they change, published by number, which turns the rotors fast",
    )
    max_tilt_rate: Positive | None = Field(
        None, description="limit enforced by the law; default: none [rad/s]", examples=[5.0]
    )
    max_tilt_angle: Annotated[float, Field(gt=0.0, le=pi)] | None = Field(
        None, description="limit enforced by the law; default: none [rad]", examples=[1.0]
    )

    def in_full(self) -> Self:
        gains = self.resolve_gains()
        table = FullPoseGainTable(position=gains[:3], attitude=gains[3:])
        return self.model_copy(update={"gains": table})

    def resolve_gains(self) -> full_pose.Gains:
        if isinstance(self.gains, FullPoseGainTable):
            return full_pose.Gains(*self.gains.position, *self.gains.attitude)
        return full_pose.GAIN_SETS[self.gains]

    def resolve_tilt_weight(self, vehicle: Vehicle | Multirotor) -> float:
        """The weight for a vehicle, (rad/s)^2/rad."""
        if self.tilt_weight == "published":
            return full_pose.PUBLISHED_TILT_WEIGHT
        return full_pose.force_balanced_tilt_weight(vehicle)

    def resolve_limits(self) -> full_pose.Limits:
        """The limits that the law enforces, infinite where there are none."""
        rate, angle = self.max_tilt_rate, self.max_tilt_angle
        return full_pose.Limits(inf if rate is None else rate, inf if angle is None else angle)
