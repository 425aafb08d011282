"""What the ``[controller]`` tables of laws that follow a planned gait have in common."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field

from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.controller_table import ControllerTable, SupervisorTable
from tiltsim.scenario.table import Gains2, NonNegative, Positive, Table, Vector3, example
from tiltsim_controllers.laws.attitude_altitude import Gains
from tiltsim_controllers.laws.failures import Failure
from tiltsim_controllers.laws.gains import (
    GAIN_SETS,
    IntegralGains,
    Poles,
    gains_from_poles,
    gains_from_rows,
)
from tiltsim_controllers.laws.keys import gain_kind
from tiltsim_controllers.laws.multirotor_steps import FeedforwardTerms
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


FeedforwardTerm = Literal[
    "gait_rates",
    "attitude_rates",
    "reference_derivatives",
    "euler_rates",
    "gyroscopic_torque",
    "integral_action",
]


GivenGains = str | GainTable | PolePlacementTable
"""The name of a set of gains, gains, or poles."""


class GaitFollowingController(ControllerTable):
    """A law whose rotor speeds control attitude and force while the tilt angles follow a gait."""

    gains: GivenGains
    decoupling: str

    allocation: Literal["inversion", "prioritized"] = Field(
        "inversion",
        description="at rotor limits: inversion saturates each rotor alone, prioritized gives up "
        "the least important outputs first: side forces, then lift, then yaw, then roll and "
        "pitch",
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
    max_acceleration: Positive = Field(
        3.0,
        description="limit on the horizontal acceleration of the position feedback, at which its "
        "integrators stop; law attitude_altitude needs gait_rate_feedforward [m/s^2]",
    )
    max_angular_acceleration: Positive = Field(
        60.0,
        description="limit on the demanded angular acceleration of each axis; law "
        "attitude_altitude needs gait_rate_feedforward [rad/s^2]",
    )
    anticipation: NonNegative = Field(
        0.12,
        description="time before and after a corner of the gait in which the body turns, at most "
        "half of the gait's shortest segment; law attitude_altitude needs gait_rate_feedforward "
        "[s]",
    )
    leave_out: Annotated[tuple[FeedforwardTerm, ...], Field(strict=False)] = Field(
        (),
        description="terms of the feed-forward to omit, for comparison; law attitude_altitude "
        "needs gait_rate_feedforward",
        examples=[["integral_action"]],
    )

    def resolve_gains(self) -> Gains:
        gains = self.gains
        if isinstance(gains, GainTable):
            return gains_from_rows(gains.attitude, gains.altitude, gains.position)
        return gains.resolve()[0] if isinstance(gains, PolePlacementTable) else GAIN_SETS[gains]

    def in_full(self) -> Self:
        if not isinstance(self.gains, str):
            return self
        values = (*self.resolve_gains(),)
        first, second, third = zip(values[:3], values[3:6], values[6:9], strict=True)
        attitude = (first, second, third)
        table = GainTable(attitude=attitude, altitude=values[9:12], position=values[12:])
        return self.model_copy(update={"gains": table})

    def resolve_integral_gains(self) -> IntegralGains:
        """The gains on the integrals, zero unless given by poles."""
        gains = self.gains
        return gains.resolve()[1] if isinstance(gains, PolePlacementTable) else IntegralGains()

    def resolve_supervisor(self, vehicle: Vehicle | Multirotor) -> Supervisor:
        """The supervisor's parameters for a vehicle, thresholds of zero without one."""
        return self.supervisor.resolve(vehicle) if self.supervisor else Supervisor()

    def resolve_feedforward_terms(self, *, gyroscopic_torque: bool) -> FeedforwardTerms:
        """The terms of the law on a plant with or without gyroscopic torque."""
        terms = FeedforwardTerms(gyroscopic_torque=float(gyroscopic_torque))
        return terms._replace(**dict.fromkeys(self.leave_out, 0.0))

    @property
    def linearization(self) -> str:
        return f"the {self.decoupling} decoupling matrix"

    @property
    def supervision(self) -> SupervisorTable | None:
        return self.supervisor

    @property
    def measures_angular_acceleration(self) -> bool:
        return self.angular_acceleration == "measured"

    @property
    def prioritizes_attitude(self) -> bool:
        return self.allocation == "prioritized"


class FailureAwareController(ControllerTable):
    """A law that can do without a rotor."""

    failed_rotor: Annotated[int, Field(ge=1)] | None = Field(
        None,
        description="a rotor that the law knows to have failed and does not use; default: none",
        examples=[2],
    )
    failure_known_from: NonNegative = Field(
        0.0, description="time from which failed_rotor is known [s]", examples=[10.0]
    )

    def resolve_failure(self) -> Failure:
        """The failed rotor that the law knows of."""
        if self.failed_rotor is None:
            return Failure()
        return Failure(float(self.failed_rotor), self.failure_known_from)
