"""The ``[controller]`` tables of the tiltrotor."""

from __future__ import annotations

from math import inf, pi
from typing import Annotated, Final, Literal, Self, TypeVar

from pydantic import Discriminator, Field, Tag, model_validator

import tiltsim_controllers.laws.full_pose as full_pose
from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.controller_table import (
    ControllerTable,
    NamedGains,
    SupervisorTable,
    gain_kind,
)
from tiltsim.scenario.table import Gains2, NonNegative, Positive, Table, Vector3, example
from tiltsim_controllers.analysis.stability import ErrorLoop, error_loops, feedforward_loops
from tiltsim_controllers.laws.attitude_altitude import DECOUPLINGS, Gains
from tiltsim_controllers.laws.gains import (
    GAIN_SETS,
    IntegralGains,
    Poles,
    gains_from_poles,
    gains_from_rows,
)
from tiltsim_controllers.laws.gait_feedforward import FeedforwardTerms
from tiltsim_controllers.laws.supervisor import Supervisor
from tiltsim_controllers.vehicle.parameters import Vehicle


def attitude_altitude_gain_kind(value: object) -> str:
    """The tag of gains that may also be given by poles."""
    if isinstance(value, PolePlacementTable):
        return "poles"
    loops = value.values() if isinstance(value, dict) else ()
    return "poles" if any(isinstance(loop, dict) for loop in loops) else gain_kind(value)


class GainTable(Table):
    """Explicit gains; see `tiltsim_controllers.laws.gains.gains_from_rows`."""

    attitude: Annotated[tuple[Vector3, Vector3, Vector3], Field(strict=False)] = Field(
        description="diagonals of K_P1, K_P2 and K_P3, each roll, pitch, yaw: on the errors of "
        "angular acceleration, rate and angle [1/s, 1/s^2, 1/s^3]",
        examples=[[[40, 40, 40], [600, 600, 600], [4000, 4000, 4000]]],
    )
    altitude: Vector3 = Field(
        description="K_PZ1, K_PZ2, K_PZ3: on the errors of vertical acceleration, velocity and "
        "altitude [1/s, 1/s^2, 1/s^3]",
        examples=[[10.0, 15.0, 10.0]],
    )
    position: Gains2 = Field(
        (1.0, 1.0),
        description="K_X1, K_X2: on the errors of horizontal velocity and position [1/s, 1/s^2]",
    )


class PoleTable(Table):
    """The poles of one closed loop: a pair, and for third order a real one at its bandwidth."""

    bandwidth: Positive = Field(description="natural frequency [rad/s]", examples=[10.0])
    damping: Positive = Field(1.0, description="damping ratio of the pair [-]", examples=[0.7])

    @property
    def poles(self) -> Poles:
        """The poles as `gains_from_poles` takes them."""
        return Poles(self.bandwidth, self.damping)


class IntegralPoleTable(PoleTable):
    """The poles of a loop that may have integral action."""

    integral: NonNegative = Field(
        0.0,
        description="pole of integral action; 0 disables it; needs gait_rate_feedforward [rad/s]",
        examples=[0.5],
    )

    @property
    def poles(self) -> Poles:
        return Poles(self.bandwidth, self.damping, self.integral)


class PolePlacementTable(Table):
    """Gains by pole placement; see `tiltsim_controllers.laws.gains.gains_from_poles`."""

    model_config = example(attitude={"bandwidth": 25.0}, altitude={"bandwidth": 10.0})

    attitude: PoleTable = Field(description="the loops of roll and pitch")
    yaw: PoleTable | None = Field(None, description="the loop of yaw; default: as attitude")
    altitude: IntegralPoleTable = Field(description="the loop of the altitude")
    position: IntegralPoleTable = Field(
        IntegralPoleTable(bandwidth=1.0, damping=0.5), description="the loops of x and y"
    )

    def resolve(self) -> tuple[Gains, IntegralGains]:
        """The gains of the control law and of its integrals."""
        yaw = self.yaw or self.attitude
        return gains_from_poles(
            self.attitude.poles, yaw.poles, self.altitude.poles, self.position.poles
        )


def resolved_gains(gains: str | GainTable | PolePlacementTable) -> Gains:
    """Gains from the name of a set, or a table."""
    if isinstance(gains, GainTable):
        return gains_from_rows(gains.attitude, gains.altitude, gains.position)
    return gains.resolve()[0] if isinstance(gains, PolePlacementTable) else GAIN_SETS[gains]


Named = TypeVar("Named", bound=ControllerTable)


def with_numbers(controller: Named, gains: str | GainTable | PolePlacementTable) -> Named:
    """The same controller with numbers in place of the name of a set."""
    if not isinstance(gains, str):
        return controller
    values = (*GAIN_SETS[gains],)
    first, second, third = zip(values[:3], values[3:6], values[6:9], strict=True)
    attitude = (first, second, third)
    table = GainTable(attitude=attitude, altitude=values[9:12], position=values[12:])
    return controller.model_copy(update={"gains": table})


def resolved_integral_gains(gains: str | GainTable | PolePlacementTable) -> IntegralGains:
    """Gains on the integrals, zero unless given by poles."""
    return gains.resolve()[1] if isinstance(gains, PolePlacementTable) else IntegralGains()


FeedforwardTerm = Literal[
    "gait_rates",
    "attitude_rates",
    "reference_derivatives",
    "euler_rates",
    "gyroscopic_torque",
    "integral_action",
]


class AttitudeAltitudeController(ControllerTable):
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
    allocation: Literal["inversion", "prioritized"] = Field(
        "inversion",
        description="at rotor limits: inversion saturates each rotor alone, prioritized gives up "
        "altitude first, then yaw, then roll and pitch",
    )
    allocation_horizon: Positive = Field(
        0.02, description="time for which prioritized allocation keeps within the limits [s]"
    )
    supervisor: SupervisorTable | None = Field(
        None,
        description="acts on the gait before the decoupling matrix becomes singular; default: none",
    )
    angular_acceleration: Literal["model", "measured"] = Field(
        "model",
        description="fed back as second derivatives of roll, pitch and yaw: that of the law's "
        "model, I^-1 tau w, or the simulated vehicle's, as ch. 4, Eq. (26), is written",
    )
    gait_rate_feedforward: bool = Field(
        False,
        description="use the planned tilt rates as well as the angles; needs decoupling and "
        "decoupler exact, and allows integral action",
    )
    max_acceleration: Positive = Field(
        3.0,
        description="limit on the horizontal acceleration of the position feedback, at which its "
        "integrators stop; needs gait_rate_feedforward [m/s^2]",
    )
    max_angular_acceleration: Positive = Field(
        60.0,
        description="limit on the demanded angular acceleration of each axis; needs "
        "gait_rate_feedforward [rad/s^2]",
    )
    anticipation: NonNegative = Field(
        0.12,
        description="time before and after a corner of the gait in which the body turns, at most "
        "half of the gait's shortest segment; needs gait_rate_feedforward [s]",
    )
    leave_out: Annotated[tuple[FeedforwardTerm, ...], Field(strict=False)] = Field(
        (),
        description="terms of gait_rate_feedforward to omit, for comparison",
        examples=[["integral_action"]],
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

    def resolve_gains(self) -> Gains:
        return resolved_gains(self.gains)

    def in_full(self) -> Self:
        return with_numbers(self, self.gains)

    def resolve_integral_gains(self) -> IntegralGains:
        """The gains on the integrals, zero unless given by poles."""
        return resolved_integral_gains(self.gains)

    def resolve_supervisor(self, vehicle: Vehicle) -> Supervisor:
        """The supervisor's parameters for a vehicle, thresholds of zero without one."""
        return self.supervisor.resolve(vehicle) if self.supervisor else Supervisor()

    def resolve_feedforward_terms(self, *, gyroscopic_torque: bool) -> FeedforwardTerms:
        """The terms of the law on a plant with or without gyroscopic torque."""
        terms = FeedforwardTerms(gyroscopic_torque=float(gyroscopic_torque))
        return terms._replace(**dict.fromkeys(self.leave_out, 0.0))

    def error_loops(self, vehicle: Vehicle) -> list[ErrorLoop]:
        if self.gait_rate_feedforward:
            return feedforward_loops(self.resolve_gains(), self.resolve_integral_gains())
        speed = vehicle.hover_rotor_speed
        return error_loops(self.resolve_gains(), speed, DECOUPLINGS[self.decoupling])

    @property
    def loop_name(self) -> str:
        return "gait_feedforward" if self.gait_rate_feedforward else self.law

    @property
    def linearization(self) -> str:
        return f"the {self.decoupling} decoupling matrix"

    @property
    def supervision(self) -> SupervisorTable | None:
        return self.supervisor

    @property
    def omits_reference_acceleration(self) -> bool:
        return not self.gait_rate_feedforward

    @property
    def measures_angular_acceleration(self) -> bool:
        return self.angular_acceleration == "measured"

    @property
    def prioritizes_attitude(self) -> bool:
        return self.allocation == "prioritized"

    @property
    def allocation_window(self) -> float:
        return self.allocation_horizon


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


class FullPoseController(ControllerTable):
    """Position and attitude control with the tilt angles as inputs (ch. 3)."""

    vehicle_models = ("tiltrotor", "multirotor")
    reference_kinds = ("position", "pose", "attitude_altitude")
    loop_gains = (("position", 3), ("attitude", 3))
    commands_tilts = True

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
    failed_rotor: Annotated[int, Field(ge=1)] | None = Field(
        None,
        description="a rotor that the law knows to have failed and does not use; default: none",
        examples=[2],
    )
    failure_known_from: NonNegative = Field(
        0.0, description="time from which failed_rotor is known [s]", examples=[10.0]
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

    def resolve_failure(self) -> full_pose.Failure:
        """The failed rotor that the law knows of."""
        if self.failed_rotor is None:
            return full_pose.Failure()
        return full_pose.Failure(float(self.failed_rotor), self.failure_known_from)

    def resolve_limits(self) -> full_pose.Limits:
        """The limits that the law enforces, infinite where there are none."""
        rate, angle = self.max_tilt_rate, self.max_tilt_angle
        return full_pose.Limits(inf if rate is None else rate, inf if angle is None else angle)
