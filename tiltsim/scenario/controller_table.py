"""The common parts of the tables of controllers, and of laws that follow a planned gait."""

from math import atan, pi
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field

from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.table import Many, NonNegative, Positive, Table, default, example
from tiltsim_controllers.analysis.stability import ErrorLoop, linear_loop
from tiltsim_controllers.analysis.two_color_map import red_residual
from tiltsim_controllers.code.arrays import is_known
from tiltsim_controllers.laws.gains import (
    GAIN_SETS,
    Gains,
    GainTable,
    GivenGains,
    IntegralGains,
    PolePlacementTable,
)
from tiltsim_controllers.laws.keys import GainSets, number_of, table_of
from tiltsim_controllers.laws.multirotor_keys import FeedforwardTerms
from tiltsim_controllers.laws.observed import Failure
from tiltsim_controllers.laws.supervised_vehicles import untilted_volume
from tiltsim_controllers.laws.supervisor import STRATEGIES, UNTILTED, Supervisor
from tiltsim_controllers.vehicle.parameters import Vehicle, drag_ratio

ReferenceKind = Literal["position", "attitude_altitude", "pose"]
"""Tracked outputs: position and yaw, attitude and altitude, or position and attitude."""


class SupervisorTable(Table):
    """Keeps a gait away from singular matrices; see `tiltsim_controllers.laws.supervisor`."""

    model_config = example(strategy="hold", min_margin=0.3)
    table_name = "controller.supervisor"
    only_with: ClassVar = {
        ("horizon",): ("strategy", "hold", "return_to_red"),
        ("max_tilt_rate", "clearance"): ("strategy", "return_to_red"),
    }

    strategy: Literal["scale", "hold", "return_to_red"] = default(
        "scale",
        "what it does where the limits require it: scale shrinks the gait as little as possible, "
        "hold stops its clock, return_to_red goes to the nearest red gait, in which opposite "
        "rotors have equal angles",
    )
    min_margin: Annotated[float, Field(ge=0.0, lt=pi / 2)] = default(
        0.2,
        "smallest singularity margin to allow: the rotation to the nearest attitude at which the "
        "decoupling matrix is singular, where tilted rotors cannot carry the weight without a "
        "torque; 0 disables the limit [rad]",
    )
    min_determinant: Annotated[float, Field(ge=0.0, lt=UNTILTED)] = default(
        0.5,
        "smallest determinant of the decoupling matrix to allow, which relates rotor speeds to "
        "torques and vertical force: 4 for a level untilted vehicle, 0 where it is singular, and "
        "of multirotors less where components of side force depend on the others; 0 disables the "
        "limit [-]",
    )
    horizon: Annotated[float, Field(gt=0.0, le=10.0)] = default(
        0.5,
        "how far to look ahead along the gait, at eight instants; needs strategy hold or "
        "return_to_red [s]",
        1.0,
    )
    max_tilt_rate: Positive = default(
        1.0,
        "tilt rate on the way to red and back, on top of the gait's; needs strategy return_to_red "
        "[rad/s]",
    )
    clearance: Annotated[float, Field(gt=0.0, lt=pi / 4)] = default(
        0.1,
        "distance on red from angles at which two rotors stop, below delta = atan(K_m / (L K_f)); "
        "needs strategy return_to_red [rad]",
    )

    def resolve(self, vehicle: Vehicle | Multirotor) -> Supervisor:
        """The supervisor's parameters for a vehicle.

        Raises `InvalidValueError` if red gaits at the clearance have too small a determinant, not
        even the untilted vehicle keeps the clearance, or a multirotor has nothing to supervise.
        """
        if isinstance(vehicle, Multirotor):
            self._check_multirotor(vehicle)
        elif self.strategy == "return_to_red" and all(
            map(is_known, (ratio := drag_ratio(vehicle), self.clearance, self.min_determinant))
        ):
            delta = atan(ratio)
            corner = delta - self.clearance  # next to P, of the allowed region
            reached = float(red_residual(corner, -corner, vehicle))
            if self.clearance >= delta:
                reason = f"must be below {delta:.4g}, which the untilted vehicle keeps"
                raise self.mistake("clearance", reason)
            if reached < self.min_determinant:
                raise self.mistake(
                    "clearance",
                    f"the determinant is only {reached:.3g} there, below min_determinant = "
                    f"{self.min_determinant:g}; use a larger clearance",
                )
        return Supervisor(
            self.min_margin,
            self.min_determinant,
            STRATEGIES[self.strategy],
            self.horizon,
            self.max_tilt_rate,
            self.clearance,
        )

    def _check_multirotor(self, vehicle: Multirotor) -> None:
        if self.strategy == "return_to_red":
            reason = "only the tiltrotor has red gaits; choose scale or hold"
            raise self.mistake("strategy", reason)
        if not vehicle.tilts:
            raise self.mistake("strategy", "vehicle.mjcf has no tilts; remove the supervisor")
        if untilted_volume(vehicle.table) == 0.0:
            raise self.mistake(
                "min_determinant", "level and untilted the vehicle has no lift without torque"
            )


class EstimatorTable(Table):
    """The estimator on which the law flies; see docs/estimator.md."""

    model_config = example(type="ekf", initial_position=0.2)
    table_name = "controller.estimator"

    type: Literal["ekf"] = default("ekf", "an error-state Kalman filter")
    gate: Annotated[float, Field(gt=0.5, lt=1.0)] = default(
        0.9999,
        "share of good readings that it accepts: it leaves out a reading whose innovation is "
        "beyond this quantile of the chi-square distribution [-]",
        0.999,
    )
    initial_position: Positive = default(
        0.05, "standard deviation of its error at time zero, which is drawn [m]"
    )
    initial_velocity: Positive = default(
        0.05, "standard deviation of its error at time zero, which is drawn [m/s]"
    )
    initial_attitude: Annotated[float, Field(gt=0.0, le=0.5)] = default(
        0.02, "standard deviation of its error about each axis at time zero, which is drawn [rad]"
    )


class ControllerTable(Table):
    """Base of every controller; properties are neutral where a controller lacks the feature."""

    table_name = "controller"
    vehicle_models: ClassVar[tuple[str, ...]]
    reference_kinds: ClassVar[tuple[ReferenceKind, ...]]
    gait_types: ClassVar[tuple[str, ...]] = ("fixed",)  # of laws of vehicles in a plane
    loop_gains: ClassVar[tuple[str, ...]] = ()  # keys of the gains of independent linear loops
    is_external: ClassVar[bool] = False  # commands come from Python code, not from a built-in law
    commands_tilts: ClassVar[bool] = False  # the tilt angles are inputs, not planned by a gait
    rotors_have_speeds: ClassVar[bool] = False  # also of the quadrotor, whose laws make thrusts
    follows_turns: ClassVar[bool] = False  # roll, pitch and yaw that vary with time
    needs_four_rotors: ClassVar[bool] = True  # or tilts that the law commands
    models_latency: ClassVar[bool] = False  # the law knows its commands on their way
    observes_forces: ClassVar[bool] = False  # and holds its place against them
    damps_swing: ClassVar[bool] = False  # of a load, by a moving reference; see layers/swing.py
    leans_unrecorded: ClassVar[bool] = False  # toward a position; no column has this attitude
    omits_reference_acceleration: ClassVar[bool] = False  # unless the reference says so
    prioritizes_attitude: ClassVar[bool] = False  # within rotor limits
    measures_angular_acceleration: ClassVar[bool] = False  # feeds the plant's back, not its model's
    rotors_stop_at_zero: ClassVar[bool] = True  # where the law integrates their speeds
    linearization: ClassVar[str] = "the exact decoupling matrix"  # where its loops are linear
    supervision: ClassVar[SupervisorTable | None] = None  # the supervisor of the gait
    position_stiffness: ClassVar[float | None] = None
    """Force per mass and per error of position that a vehicle at rest makes, 1/s^2.

    A force loop pushes through it, see `tiltsim.laws.layers.contact`; None for a law that cannot.
    """
    gain_sets: ClassVar[GainSets] = {}

    allow_unstable: bool = default(
        False, "accept gains that fail the Routh-Hurwitz criterion of stability"
    )
    estimator: Literal["ekf"] | EstimatorTable | None = default(
        None,
        "the law flies on the estimate of a filter, which is driven by sensors.imu; default: "
        "none, on the true state",
        "ekf",
    )
    law: str

    @property
    def estimator_table(self) -> EstimatorTable | None:
        """The estimator with all its keys; None without one."""
        return EstimatorTable() if self.estimator == "ekf" else self.estimator

    def resolve_gains(self) -> Any:
        """The gains as the law reads them: of a named set, or as given."""
        return number_of(self, "gains")

    def error_loops(self, vehicle: Any) -> list[ErrorLoop]:
        """The linear closed loops that the gains make around a vehicle's parameters."""
        loops: list[ErrorLoop] = []
        for key in self.loop_gains:
            gains = number_of(self, key)
            named = gains._asdict() if hasattr(gains, "_asdict") else {"position": gains}
            loops += [linear_loop(name, values) for name, values in named.items()]
        return loops

    def check_scenario(self, scenario: Any) -> None:
        """Refuse the controller in a scenario, otherwise consistent. Raises `mistake`."""

    def records_attitude(self, scenario: Any) -> bool:
        """Whether ``roll_ref`` and ``pitch_ref`` are the desired attitude of the law."""
        leans = self.leans_unrecorded and not self.commands_tilts
        return not leans or scenario.reference.kind != "position"

    @property
    def loop_name(self) -> str:
        """The name of the controller's closed loop in `tiltsim.laws.assembling.LOOPS`."""
        return self.law

    def in_full(self) -> Self:
        """The table with numbers in place of the names of sets of gains."""
        named = [key for key in self.gain_sets if isinstance(getattr(self, key), str)]
        return self.model_copy(
            update={
                key: table_of(type(self).model_fields[key].annotation, number_of(self, key))
                for key in named
            }
        )


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
            return Gains(*gains.attitude, gains.altitude, gains.position)
        return gains.resolve()[0] if isinstance(gains, PolePlacementTable) else GAIN_SETS[gains]

    def in_full(self) -> Self:
        if not isinstance(self.gains, str):
            return self
        *attitude, altitude, position = self.resolve_gains()
        table = GainTable(attitude=tuple(attitude), altitude=altitude, position=position)
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

    def check_scenario(self, scenario: Any) -> None:
        rotors = scenario.vehicle.rotor_count
        if self.failed_rotor is not None and self.failed_rotor > rotors:
            raise self.mistake("failed_rotor", f"the vehicle has {rotors} rotors")
        super().check_scenario(scenario)

    def resolve_failure(self) -> Failure:
        """The failed rotor that the law knows of."""
        if self.failed_rotor is None:
            return Failure()
        return Failure(float(self.failed_rotor), self.failure_known_from)
