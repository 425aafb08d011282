"""Keys shared by the ``[controller]`` tables of laws that follow a planned gait."""

from typing import Annotated, Literal, Self

from pydantic import Field

from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.controller_table import ControllerTable, SupervisorTable
from tiltsim.scenario.table import Many, NonNegative, Positive, default
from tiltsim_controllers.laws.gains import (
    GAIN_SETS,
    Gains,
    GainTable,
    GivenGains,
    IntegralGains,
    PolePlacementTable,
    gains_from_rows,
)
from tiltsim_controllers.laws.multirotor_steps import FeedforwardTerms
from tiltsim_controllers.laws.observed import Failure
from tiltsim_controllers.laws.supervisor import Supervisor
from tiltsim_controllers.vehicle.parameters import Vehicle

FeedforwardTerm = Literal[
    "gait_rates",
    "attitude_rates",
    "reference_derivatives",
    "euler_rates",
    "gyroscopic_torque",
    "integral_action",
]


class GaitFollowingController(ControllerTable):
    """A law whose rotor speeds control attitude and force while the tilt angles follow a gait."""

    gains: GivenGains
    decoupling: str

    allocation: Literal["inversion", "prioritized"] = default(
        "inversion",
        "at rotor limits: inversion saturates each rotor alone, prioritized gives up the least "
        "important outputs first: side forces, then lift, then yaw, then roll and pitch",
    )
    allocation_horizon: Positive = default(
        0.02, "time for which prioritized allocation keeps within the limits [s]"
    )
    supervisor: SupervisorTable | None = default(
        None, "acts on the gait before the decoupling matrix becomes singular; default: none"
    )
    angular_acceleration: Literal["model", "measured"] = default(
        "model",
        "fed back as second derivatives of roll, pitch and yaw: that of the law's model, I^-1 tau "
        "w, or the simulated vehicle's, as ch. 4, Eq. (26), is written",
    )
    max_acceleration: Positive = default(
        3.0,
        "limit on the horizontal acceleration of the position feedback, at which its integrators "
        "stop; law attitude_altitude needs gait_rate_feedforward [m/s^2]",
    )
    max_angular_acceleration: Positive = default(
        60.0,
        "limit on the demanded angular acceleration of each axis; law attitude_altitude needs "
        "gait_rate_feedforward [rad/s^2]",
    )
    anticipation: NonNegative = default(
        0.12,
        "time before and after a corner of the gait in which the body turns, at most half of the "
        "gait's shortest segment; law attitude_altitude needs gait_rate_feedforward [s]",
    )
    leave_out: Many[FeedforwardTerm] = default(
        (),
        "terms of the feed-forward to omit, for comparison; law attitude_altitude needs "
        "gait_rate_feedforward",
        ["integral_action"],
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
    def linearization(self) -> str:  # type: ignore[override]
        return f"the {self.decoupling} decoupling matrix"

    @property
    def supervision(self) -> SupervisorTable | None:  # type: ignore[override]
        return self.supervisor

    @property
    def measures_angular_acceleration(self) -> bool:  # type: ignore[override]
        return self.angular_acceleration == "measured"

    @property
    def prioritizes_attitude(self) -> bool:  # type: ignore[override]
        return self.allocation == "prioritized"


class FailureAwareController(ControllerTable):
    """A law that can do without a rotor."""

    failed_rotor: Annotated[int, Field(ge=1)] | None = default(
        None, "a rotor that the law knows to have failed and does not use; default: none", 2
    )
    failure_known_from: NonNegative = default(
        0.0, "time from which failed_rotor is known [s]", 10.0
    )

    def check_failed_rotor(self, rotors: int) -> None:
        """Refuse a failed rotor that is not one of some number. Raises `mistake`."""
        if self.failed_rotor is not None and self.failed_rotor > rotors:
            raise self.mistake("failed_rotor", f"the vehicle has {rotors} rotors")

    def resolve_failure(self) -> Failure:
        """The failed rotor that the law knows of."""
        if self.failed_rotor is None:
            return Failure()
        return Failure(float(self.failed_rotor), self.failure_known_from)
