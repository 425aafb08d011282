"""The ``[controller]`` tables of the tiltrotor."""

from __future__ import annotations

from typing import Annotated, Final, Literal, Self

from pydantic import Discriminator, Field, Tag, model_validator

from tiltsim.scenario.gait_following import (
    FailureAwareController,
    GainTable,
    GaitFollowingController,
    PolePlacementTable,
    attitude_altitude_gain_kind,
)
from tiltsim.scenario.table import example
from tiltsim_controllers.analysis.stability import ErrorLoop, error_loops, feedforward_loops
from tiltsim_controllers.laws.attitude_altitude import DECOUPLINGS
from tiltsim_controllers.laws.full_pose import FullPose
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


class FullPoseController(FullPose, FailureAwareController):
    """Position and attitude control with the tilt angles as inputs (ch. 3)."""

    vehicle_models = ("tiltrotor", "multirotor")
    reference_kinds = ("position", "pose", "attitude_altitude")
    loop_gains = ("gains",)
    commands_tilts = True
