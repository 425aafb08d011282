"""The ``[controller]`` tables of the tiltrotor."""

from typing import Final, Self

from pydantic import model_validator

from tiltsim.scenario.gait_following import FailureAwareController, GaitFollowingController
from tiltsim.scenario.table import example
from tiltsim_controllers.analysis.stability import ErrorLoop, error_loops, feedforward_loops
from tiltsim_controllers.laws.attitude_altitude import DECOUPLINGS, AttitudeAltitude
from tiltsim_controllers.laws.full_pose import FullPose
from tiltsim_controllers.vehicle.parameters import Vehicle


class AttitudeAltitudeController(AttitudeAltitude, GaitFollowingController):
    """Attitude-altitude control of the tiltrotor under a planned gait (ch. 3 to 9)."""

    model_config = example(law="attitude_altitude", decoupler="modified")

    vehicle_models = ("tiltrotor",)
    reference_kinds = ("position", "attitude_altitude")

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
    damps_swing = True
    commands_tilts = True
    follows_turns = True

    @property
    def position_stiffness(self) -> float:
        on_acceleration, _, on_position = self.resolve_gains().position
        stiffness: float = on_position / on_acceleration
        return stiffness
