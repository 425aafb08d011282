"""The ``[controller]`` tables of feedback linearization: tiltrotor, quadrotor, multirotor."""

from typing import Any, ClassVar

from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.controller_table import (
    ControllerTable,
    FailureAwareController,
    GaitFollowingController,
)
from tiltsim.scenario.messages import InvalidValueError
from tiltsim.scenario.table import example
from tiltsim_controllers.analysis.stability import (
    ErrorLoop,
    error_loops,
    feedforward_loops,
    linear_loop,
)
from tiltsim_controllers.analysis.torque_free import (
    TorqueFreeForces,
    hover_direction,
    torque_free_forces,
)
from tiltsim_controllers.gaits.plans import Gait, fixed
from tiltsim_controllers.laws.attitude_altitude import (
    DECOUPLINGS,
    PUBLISHED_DECOUPLING,
    AttitudeAltitude,
)
from tiltsim_controllers.laws.full_pose import FullPose, pose_rank
from tiltsim_controllers.laws.multirotor_keys import RESTORING, AttitudeForce, Form
from tiltsim_controllers.laws.quadrotor import QuadrotorAttitudeAltitude, Switching, YawPosition
from tiltsim_controllers.mathematics.scalar import Floats, Triple
from tiltsim_controllers.vehicle.parameters import Vehicle
from tiltsim_controllers.vehicle.rotors import force_and_torque


def check_decoupler(scenario: Any, decoupler: str) -> None:
    """Refuse a decoupler of positions without a position to track, and the reverse."""
    needs_none = scenario.reference.kind == "attitude_altitude"
    if needs_none != (decoupler == "none"):
        needs = "none" if needs_none else "conventional, modified or exact"
        reason = f"reference.type = {scenario.reference.type!r} needs {needs}"
        raise scenario.mistake("controller.decoupler", reason)


class AttitudeAltitudeController(AttitudeAltitude, GaitFollowingController):
    """Attitude-altitude control of the tiltrotor under a planned gait (ch. 3 to 9)."""

    model_config = example(law="attitude_altitude", decoupler="modified")

    vehicle_models = ("tiltrotor",)
    reference_kinds = ("position", "attitude_altitude")
    only_with: ClassVar = {
        ("leave_out", "anticipation", "rotor_inertia_feedforward"): ("gait_rate_feedforward", True),
        ("max_acceleration", "max_angular_acceleration"): ("gait_rate_feedforward", True),
    }

    def _check_values(self) -> None:
        if not self.gait_rate_feedforward:
            if any(self.resolve_integral_gains()):
                needs = "integral action needs controller.gait_rate_feedforward = true"
                raise self.mistake("gains", needs)
            return
        for key, choices in (("decoupling", ("exact",)), ("decoupler", ("exact", "none"))):
            if getattr(self, key) not in choices:
                needs = f"gait_rate_feedforward = true needs {' or '.join(choices)}"
                raise self.mistake(key, needs)

    def check_scenario(self, scenario: Any) -> None:
        check_decoupler(scenario, self.decoupler)

    def error_loops(self, vehicle: Vehicle) -> list[ErrorLoop]:
        if self.gait_rate_feedforward:
            return feedforward_loops(self.resolve_gains(), self.resolve_integral_gains())
        speed = vehicle.hover_rotor_speed
        return error_loops(self.resolve_gains(), speed, DECOUPLINGS[self.decoupling])

    @property
    def loop_name(self) -> str:
        return "gait_feedforward" if self.gait_rate_feedforward else self.law

    @property
    def omits_reference_acceleration(self) -> bool:  # type: ignore[override]
        return not self.gait_rate_feedforward


class FullPoseController(FullPose, FailureAwareController):
    """Position and attitude control with the tilt angles as inputs (ch. 3)."""

    vehicle_models = ("tiltrotor", "multirotor")
    reference_kinds = ("position", "pose", "attitude_altitude")
    loop_gains = ("gains",)
    damps_swing = True
    commands_tilts = True
    follows_turns = True

    @property
    def position_stiffness(self) -> float:  # type: ignore[override]
        on_acceleration, _, on_position = self.resolve_gains().position
        return on_position / on_acceleration

    def check_scenario(self, scenario: Any) -> None:
        """Refuse inputs that do not move six outputs."""
        super().check_scenario(scenario)
        vehicle, failed = scenario.vehicle.resolve(), self.failed_rotor
        if isinstance(vehicle, Multirotor):
            gait = scenario.gait.plan(vehicle)
            w = [spin * (rotor != failed) for rotor, spin in enumerate(vehicle.spins, start=1)]
            rank = pose_rank(vehicle.table, gait.angles(0.0).tolist(), w)
            if rank < 6:
                reason = f"at the initial tilt angles the inputs move {rank} of six outputs"
                raise scenario.mistake("controller.law", reason)


class YawPositionController(YawPosition, ControllerTable):
    """Yaw-position control of the quadrotor with dynamic extension (ch. 2)."""

    vehicle_models = ("quadrotor",)
    reference_kinds = ("position",)
    loop_gains = ("gains",)


class SwitchingController(Switching, ControllerTable):
    """Yaw-position control that switches to attitude-altitude control in a zone (ch. 2)."""

    vehicle_models = ("quadrotor",)
    reference_kinds = ("pose",)
    loop_gains = ("gains", "attitude_gains")

    def _check_values(self) -> None:
        for key in ("roll", "pitch"):
            low, high = getattr(self.zone, key)
            if low > high:
                raise self.mistake(f"zone.{key}", "the first must not exceed the second")


class QuadrotorAttitudeAltitudeController(QuadrotorAttitudeAltitude, ControllerTable):
    """Attitude-altitude control of the quadrotor (ch. 2, Appendix B)."""

    vehicle_models = ("quadrotor",)
    reference_kinds = ("attitude_altitude",)
    loop_gains = ("gains",)


class AttitudeForceController(AttitudeForce, GaitFollowingController, FailureAwareController):
    """Attitude and one, two or three components of force of a multirotor."""

    model_config = example(law="attitude_force", dimension=1)

    vehicle_models = ("multirotor",)
    reference_kinds = ("position", "pose", "attitude_altitude")
    follows_turns = True
    only_with: ClassVar = {("slowest_rotor",): ("norm", "thrust")}

    def resolve_force(self, vehicle: Multirotor, gait: Gait) -> Form:
        """The form of the law, whose components of force are checked over the gait."""
        lost = self.failed_rotor
        least, where = self.least_dimension(vehicle, gait)
        if least == 0 and where.endswith(f"rotor {lost}"):
            raise self.mistake("failed_rotor", "the others are singular at every attitude")
        if least == 0:
            raise InvalidValueError("gait.type", gait.name, f"singular at every attitude, {where}")
        if self.dimension is not None and self.dimension > least:
            raise self.mistake("dimension", f"the vehicle has {least} only, {where}")
        forward = self.dimension == 2 and least == 3
        return Form(
            self.dimension or least,
            self.norm,
            forward,
            lost is not None,
            self.supervisor is not None,
        )

    def least_dimension(self, vehicle: Multirotor, gait: Gait) -> tuple[int, str]:
        """The `force_dimension`, with and without the failed rotor."""
        return min(force_dimension(vehicle, gait, lost) for lost in {None, self.failed_rotor})

    def check_scenario(self, scenario: Any) -> None:
        """Refuse more components of force than the vehicle has, and a pose that it cannot take."""
        super().check_scenario(scenario)
        vehicle, reference = scenario.vehicle.resolve(), scenario.reference
        dimension = self.resolve_force(vehicle, scenario.gait.plan(vehicle)).dimension
        self._check_scaling(vehicle, dimension)
        check_decoupler(scenario, self.decoupler)
        if reference.turns:
            reason = "not supported where roll, pitch and yaw vary"
            self.require_defaults(("attitude_error", "turn_time"), reason)
        if reference.kind == "pose" and dimension < 3:
            key = "type" if reference.turns else "roll" if reference.roll else "pitch"
            reason = (
                f"roll and pitch are no outputs: a vehicle that controls {dimension} of 3 "
                "components of force leans to move; leave them out, or take a vehicle with 3"
            )
            raise scenario.mistake(f"reference.{key}", reason)
        for key in ("decoupling", "decoupler"):
            value = getattr(self, key)
            if dimension > 1 and value != "exact":
                reason = f"the vehicle has {dimension}; controller.{key} = {value!r} needs 1"
                raise self.mistake("dimension", reason)

    def _check_scaling(self, vehicle: Multirotor, dimension: int) -> None:
        """Refuse to scale a gait toward angles without the force that is controlled."""
        supervisor = self.supervisor
        if supervisor is None or supervisor.strategy != "scale":
            return
        supervisor.resolve(vehicle)  # refuses a vehicle that has no lift there with all its rotors
        untilted, where = self.least_dimension(vehicle, fixed((0.0,) * vehicle.tilts))
        if untilted < dimension:
            or_less = f", or set controller.dimension = {untilted}" if untilted else ""
            reason = f"the vehicle has {untilted} of the {dimension} components of force {where}"
            raise supervisor.mistake("strategy", f"{reason}; choose hold{or_less}")

    def resolve_restoring(self, rotors: int, dimension: int, gait: Gait) -> float:
        """The restoring rate, 1/s."""
        if self.restoring is not None:
            return self.restoring
        return RESTORING if rotors > 3 + dimension and not gait.is_constant else 0.0

    def error_loops(self, vehicle: Multirotor) -> list[ErrorLoop]:
        gains = self.resolve_gains()
        if self.decoupling == "published":
            speed = vehicle.hover_rotor_speed
            return error_loops(gains, speed, PUBLISHED_DECOUPLING)
        side = linear_loop("side", self.side_gains)
        return [*feedforward_loops(gains, self.resolve_integral_gains()), side]


def _gait_angles(vehicle: Multirotor, gait: Gait) -> Floats:
    times = gait.sample_times()
    return gait.angles(times)[:, : vehicle.tilts]


def _torque_free_forces(vehicle: Multirotor, gait: Gait, lost: int | None) -> TorqueFreeForces:
    """Those over a gait, without a rotor that is lost."""
    works = [float(rotor != lost) for rotor in range(1, len(vehicle.spins) + 1)]
    force, torque = force_and_torque(vehicle.table, _gait_angles(vehicle, gait))
    return torque_free_forces(force * works, torque * works)


def upper_side(vehicle: Multirotor, gait: Gait, lost: int | None = None) -> Triple:
    """The side (unit vector, body axes) on which level attitude starts, if there are two.

    That is so where the singular directions of world up are a great circle all over the gait;
    zero elsewhere. Arguments as of `force_dimension`.
    """
    forces = _torque_free_forces(vehicle, gait, lost)
    if not (forces.dimension == 1).all():
        return 0.0, 0.0, 0.0
    x, y, z = hover_direction(forces)[0].tolist()
    return x, y, z


def force_dimension(vehicle: Multirotor, gait: Gait, lost: int | None = None) -> tuple[int, str]:
    """The least dimension of the torque-free forces over a gait, and where, in words.

    Args:
        vehicle: The vehicle.
        gait: Its gait.
        lost: A rotor that does not work, from 1.
    """
    dimension = _torque_free_forces(vehicle, gait, lost).dimension
    first = int(dimension.argmin())
    at = ", ".join(f"{angle:.3g}" for angle in _gait_angles(vehicle, gait)[first])
    where = f"at tilt angles ({at}) rad" if vehicle.tilts else "as its rotors are placed"
    return int(dimension[first]), where if lost is None else f"{where}, without rotor {lost}"
