"""Controller tables of the tiltrotor's laws."""

from __future__ import annotations

from math import atan, inf, pi
from typing import Annotated, Literal, Self

from pydantic import Discriminator, Field, Tag, model_validator

import tiltsim_controllers.laws.full_pose as full_pose
from tiltsim.scenario.controller_table import ControllerTable, _gain_kind
from tiltsim.scenario.messages import InvalidValueError
from tiltsim.scenario.table import Gains2, NonNegative, Positive, Table, Vector3
from tiltsim_controllers.analysis.stability import (
    ErrorLoop,
    error_loops,
    feedforward_loops,
    linear_loop,
)
from tiltsim_controllers.gaits.red_gait import determinant_at_clearance
from tiltsim_controllers.laws.attitude_altitude import DECOUPLINGS, Gains
from tiltsim_controllers.laws.gains import (
    GAIN_SETS,
    IntegralGains,
    Poles,
    gains_from_poles,
    gains_from_rows,
)
from tiltsim_controllers.laws.gait_feedforward import FeedforwardTerms
from tiltsim_controllers.laws.supervisor import STRATEGIES, Supervisor
from tiltsim_controllers.vehicle.parameters import Vehicle, drag_ratio


def _attitude_altitude_gain_kind(value: object) -> str:
    if isinstance(value, PolePlacementTable):
        return "poles"
    loops = value.values() if isinstance(value, dict) else ()
    return "poles" if any(isinstance(loop, dict) for loop in loops) else _gain_kind(value)


class GainTable(Table):
    """Gains written out; see `tiltsim_controllers.laws.gains.gains_from_rows`."""

    attitude: Annotated[tuple[Vector3, Vector3, Vector3], Field(strict=False)] = Field(
        description="diagonals of K_P1, K_P2, K_P3, each roll, pitch, yaw"
    )
    altitude: Vector3 = Field(description="K_PZ1, K_PZ2, K_PZ3")
    position: Gains2 = Field((1.0, 1.0), description="K_X1, K_X2")


class PoleTable(Table):
    """The poles of one closed loop: a pair, and at its bandwidth a real one where third order."""

    bandwidth: Positive = Field(description="natural frequency, rad/s")
    damping: Positive = Field(1.0, description="damping ratio of the pair")

    @property
    def poles(self) -> Poles:
        """The poles as the design takes them."""
        return Poles(self.bandwidth, self.damping, getattr(self, "integral", 0.0))


class IntegralPoleTable(PoleTable):
    """The poles of a loop that may have an integral."""

    integral: NonNegative = Field(
        0.0, description="pole of integral action, rad/s; 0: none. Needs gait_rate_feedforward"
    )


class PolePlacementTable(Table):
    """Gains by pole placement; see `tiltsim_controllers.laws.gains.gains_from_poles`."""

    attitude: PoleTable = Field(description="roll and pitch")
    yaw: PoleTable | None = Field(None, description="default: as attitude")
    altitude: IntegralPoleTable
    position: IntegralPoleTable = IntegralPoleTable(bandwidth=1.0, damping=0.5)

    def resolve(self) -> tuple[Gains, IntegralGains]:
        """The numbers of the law."""
        yaw = self.yaw or self.attitude
        return gains_from_poles(
            self.attitude.poles, yaw.poles, self.altitude.poles, self.position.poles
        )


FeedforwardTerm = Literal[
    "gait_rates",
    "attitude_rates",
    "reference_derivatives",
    "euler_rates",
    "gyroscopic_torque",
    "integral_action",
]


class SupervisorTable(Table):
    """Keeps a gait away from singular matrices; see `tiltsim_controllers.laws.supervisor`."""

    strategy: Literal["scale", "hold", "return_to_red"] = Field(
        "scale", description="shrink the gait, stop its clock, or go to the nearest red gait"
    )
    min_margin: Annotated[float, Field(ge=0.0, lt=pi / 2)] = Field(
        0.2, description="singularity margin to keep, rad; 0: none"
    )
    min_determinant: Annotated[float, Field(ge=0.0, lt=4.0)] = Field(
        0.5, description="determinant to keep, 4 for a level untilted vehicle; 0: none"
    )
    horizon: Annotated[float, Field(gt=0.0, le=10.0)] = Field(
        0.5, description="s of the gait to look ahead; needs hold or return_to_red"
    )
    max_tilt_rate: Positive = Field(
        1.0, description="rad/s on the way to red and back, the gait's own rate aside; likewise"
    )
    clearance: Annotated[float, Field(gt=0.0, lt=pi / 4)] = Field(
        0.1,
        description="rad to keep on red from where rotors stop, next to the curve L, below "
        "atan(r); needs return_to_red",
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        needs = {
            "horizon": ("hold", "return_to_red"),
            "max_tilt_rate": ("return_to_red",),
            "clearance": ("return_to_red",),
        }
        for key, strategies in needs.items():
            value = getattr(self, key)
            if self.strategy not in strategies and value != type(self).model_fields[key].default:
                raise InvalidValueError(
                    f"controller.supervisor.{key}",
                    value,
                    f"needs controller.supervisor.strategy = {' or '.join(strategies)}",
                )
        return self

    def resolve(self, vehicle: Vehicle) -> Supervisor:
        """The numbers of the law.

        Raises `InvalidValueError` where red gaits at the clearance have too small a determinant,
        or not even the untilted vehicle keeps it.
        """
        if self.strategy == "return_to_red":
            ratio = drag_ratio(vehicle)
            delta, reached = atan(ratio), determinant_at_clearance(self.clearance, ratio)
            mistake = ""
            if self.clearance >= delta:
                mistake = f"must be below {delta:.4g}, which the untilted vehicle keeps"
            elif reached < self.min_determinant:
                mistake = (
                    f"so near to L the determinant is {reached:.3g}, below min_determinant = "
                    f"{self.min_determinant:g}; keep further away"
                )
            if mistake:
                raise InvalidValueError("controller.supervisor.clearance", self.clearance, mistake)
        return Supervisor(
            self.min_margin,
            self.min_determinant,
            STRATEGIES[self.strategy],
            self.horizon,
            self.max_tilt_rate,
            self.clearance,
        )


class AttitudeAltitudeController(ControllerTable):
    """Attitude-altitude control of the tiltrotor, the gait planned (ch. 3 to 9)."""

    vehicle_model = "tiltrotor"
    reference_kinds = ("position", "attitude_altitude")

    law: Literal["attitude_altitude"] = "attitude_altitude"
    decoupling: Literal["published", "exact"] = "published"
    decoupler: Literal["none", "conventional", "modified", "exact"] = "modified"
    gains: Annotated[
        Annotated[Literal["ch03", "ch04", "exact", "feedforward"], Tag("named")]
        | Annotated[GainTable, Tag("table")]
        | Annotated[PolePlacementTable, Tag("poles")],
        Discriminator(_attitude_altitude_gain_kind),
    ] = Field(
        "ch04",
        description="a set by name, gains, or poles; yaw has little torque, and exact stops a "
        "rotor at a step of 0.39 rad: see docs/beyond.md",
    )
    allocation: Literal["inversion", "prioritized"] = Field(
        "inversion", description="within rotor limits: each for itself, or attitude first"
    )
    allocation_horizon: Positive = Field(
        0.02, description="s for which prioritized allocation keeps within the limits"
    )
    supervisor: SupervisorTable | None = Field(
        None, description="acts on the gait before its decoupling matrix becomes singular"
    )
    gait_rate_feedforward: bool = Field(
        False, description="count the gait's rates in: the exact law with integral action"
    )
    max_acceleration: Positive = Field(
        3.0,
        description="m/s^2, horizontal, of the position feedback; integrators stop there; needs "
        "gait_rate_feedforward",
    )
    max_angular_acceleration: Positive = Field(
        60.0,
        description="rad/s^2, each axis, asked of the body; needs gait_rate_feedforward",
    )
    anticipation: NonNegative = Field(
        0.12,
        description="s before and after a corner of the gait in which the body turns, at most half "
        "of the gait's shortest line; needs gait_rate_feedforward",
    )
    leave_out: Annotated[tuple[FeedforwardTerm, ...], Field(strict=False)] = Field(
        (), description="ingredients of gait_rate_feedforward to fly without, for comparison"
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not self.gait_rate_feedforward:
            for key in (
                *("leave_out", "anticipation", "max_acceleration", "max_angular_acceleration"),
            ):
                if getattr(self, key) != type(self).model_fields[key].default:
                    raise InvalidValueError(
                        f"controller.{key}",
                        getattr(self, key),
                        "needs controller.gait_rate_feedforward = true",
                    )
            if any(self.resolve_integral_gains()):
                raise InvalidValueError(
                    "controller.gains",
                    self.model_dump()["gains"],
                    "an integral needs controller.gait_rate_feedforward = true",
                )
            return self
        for key, choices in (("decoupling", ("exact",)), ("decoupler", ("exact", "none"))):
            if getattr(self, key) not in choices:
                raise InvalidValueError(
                    f"controller.{key}",
                    getattr(self, key),
                    f"gait_rate_feedforward = true needs {' or '.join(choices)}",
                )
        return self

    def resolve_gains(self) -> Gains:
        """The numbers behind a named set, a table or poles."""
        if isinstance(self.gains, GainTable):
            return gains_from_rows(self.gains.attitude, self.gains.altitude, self.gains.position)
        if isinstance(self.gains, PolePlacementTable):
            return self.gains.resolve()[0]
        return GAIN_SETS[self.gains]

    def resolve_integral_gains(self) -> IntegralGains:
        """The gains on the integrals, zero unless poles ask for them."""
        if isinstance(self.gains, PolePlacementTable):
            return self.gains.resolve()[1]
        return IntegralGains()

    def resolve_supervisor(self, vehicle: Vehicle) -> Supervisor:
        """The numbers of the supervisor, thresholds of zero without one."""
        return self.supervisor.resolve(vehicle) if self.supervisor else Supervisor()

    def resolve_feedforward_terms(self, *, gyroscopic_torque: bool) -> FeedforwardTerms:
        """What the law counts in, on a plant with or without gyroscopic torque."""
        ingredients = FeedforwardTerms(gyroscopic_torque=float(gyroscopic_torque))
        return ingredients._replace(**dict.fromkeys(self.leave_out, 0.0))

    def error_loops(self, vehicle: Vehicle) -> list[ErrorLoop]:
        """See `ControllerTable.error_loops`."""
        if self.gait_rate_feedforward:
            return feedforward_loops(self.resolve_gains(), self.resolve_integral_gains())
        return error_loops(self.resolve_gains(), vehicle, DECOUPLINGS[self.decoupling])

    @property
    def loop_name(self) -> str:
        """See `ControllerTable.loop_name`."""
        return "gait_feedforward" if self.gait_rate_feedforward else self.law

    @property
    def linearization(self) -> str:
        """See `ControllerTable.linearization`."""
        return f"the {self.decoupling} decoupling matrix"


class FullPoseGainTable(Table):
    """Gains of full-pose control written out."""

    position: Vector3 = Field(description="on acceleration, velocity and position")
    attitude: Vector3 = Field(description="on angular acceleration, body rates and attitude")


class FullPoseController(ControllerTable):
    """Position and attitude of the tiltrotor at once, the tilt angles inputs, too (ch. 3)."""

    vehicle_model = "tiltrotor"
    reference_kinds = ("position", "pose", "attitude_altitude")

    law: Literal["full_pose"]
    gains: Annotated[
        Annotated[Literal["ch03"], Tag("named")] | Annotated[FullPoseGainTable, Tag("table")],
        Discriminator(_gain_kind),
    ] = "ch03"
    tilt_weight: Literal["even", "published"] = Field(
        "even",
        description="of tilt rates in the norm: by the force they move, or number for number",
    )
    failed_rotor: Annotated[int, Field(ge=1, le=4)] | None = Field(
        None, description="a rotor that the law knows to be lost and does not count on"
    )
    failure_known_from: NonNegative = Field(0.0, description="s, since when failed_rotor is known")
    max_tilt_rate: Positive | None = Field(None, description="rad/s, held by the law")
    max_tilt_angle: Annotated[float, Field(gt=0.0, le=pi)] | None = Field(
        None, description="rad, held by the law"
    )

    def resolve_gains(self) -> full_pose.Gains:
        """The numbers behind a named set or a table."""
        if isinstance(self.gains, FullPoseGainTable):
            return full_pose.Gains(*self.gains.position, *self.gains.attitude)
        return full_pose.GAIN_SETS[self.gains]

    def resolve_tilt_weight(self, vehicle: Vehicle) -> float:
        """The number behind a weight's name, (rad/s)^2/rad."""
        if self.tilt_weight == "published":
            return full_pose.PUBLISHED_TILT_WEIGHT
        return full_pose.force_balanced_tilt_weight(vehicle)

    def resolve_failure(self) -> full_pose.Failure:
        """What the law knows of a lost rotor."""
        if self.failed_rotor is None:
            return full_pose.Failure()
        return full_pose.Failure(float(self.failed_rotor), self.failure_known_from)

    def resolve_limits(self) -> full_pose.Limits:
        """The limits that the law holds, infinite where there are none."""
        rate, angle = self.max_tilt_rate, self.max_tilt_angle
        return full_pose.Limits(
            inf if rate is None else rate,
            inf if angle is None else angle,
        )

    def error_loops(self, vehicle: Vehicle) -> list[ErrorLoop]:
        """See `ControllerTable.error_loops`."""
        gains = self.resolve_gains()
        return [linear_loop("position", gains[:3]), linear_loop("attitude", gains[3:])]
