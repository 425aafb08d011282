"""The ``[controller]`` table of a multirotor."""

from typing import Self

from pydantic import model_validator

from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.gait_following import FailureAwareController, GaitFollowingController
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
from tiltsim_controllers.gaits.plans import Gait
from tiltsim_controllers.laws.attitude_altitude import PUBLISHED_DECOUPLING
from tiltsim_controllers.laws.multirotor_steps import RESTORING, AttitudeForce, Form
from tiltsim_controllers.mathematics.scalar import Floats, Triple
from tiltsim_controllers.vehicle.rotors import force_and_torque


class AttitudeForceController(AttitudeForce, GaitFollowingController, FailureAwareController):
    """Attitude and one, two or three components of force of a multirotor."""

    model_config = example(law="attitude_force", dimension=1)

    vehicle_models = ("multirotor",)
    reference_kinds = ("position", "pose", "attitude_altitude")
    follows_turns = True

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.norm == "speed":
            self.require_defaults(("slowest_rotor",), 'needs controller.norm = "thrust"')
        return self

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
    return gait.angles(times).reshape(len(times), vehicle.tilts)


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
