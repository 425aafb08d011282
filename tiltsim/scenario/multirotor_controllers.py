"""The ``[controller]`` table of a multirotor."""

from __future__ import annotations

from typing import Annotated, Final, Literal, Self

from pydantic import Discriminator, Field, Tag, model_validator

from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.gait_following import (
    FailureAwareController,
    GainTable,
    GaitFollowingController,
    PolePlacementTable,
    attitude_altitude_gain_kind,
)
from tiltsim.scenario.messages import InvalidValueError
from tiltsim.scenario.table import NonNegative, Vector3, example
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
from tiltsim_controllers.laws.multirotor_steps import Form
from tiltsim_controllers.mathematics.scalar import Floats, Triple
from tiltsim_controllers.vehicle.effectiveness import force_and_torque

RESTORING: Final = 0.5
"""1/s, the default where rotor speeds would drift."""


class AttitudeForceController(GaitFollowingController, FailureAwareController):
    """Attitude and one, two or three components of force of a multirotor."""

    model_config = example(law="attitude_force", dimension=1)

    vehicle_models = ("multirotor",)
    reference_kinds = ("position", "pose", "attitude_altitude")
    follows_turns = True

    law: Literal["attitude_force"] = Field(
        description="feedback linearization of a multirotor: its rotor speeds control the attitude "
        "and as many components of the force as it has; the tilt angles follow the gait"
    )
    dimension: Annotated[int, Field(ge=1, le=3)] | None = Field(
        None,
        description="how many components of the force are controlled beside the attitude: 1, lift; "
        "2, one sideways, too, of a vehicle with three that along its x axis; 3, all, so that the "
        "vehicle need not lean; default: as many as the vehicle has at all angles of its gait [-]",
        examples=[1],
    )
    decoupler: Literal["none", "conventional", "modified", "exact"] = Field(
        "exact",
        description="how the vehicle leans to control what its side force leaves of the horizontal "
        "position: as for the tiltrotor; other than exact needs dimension 1 [-]",
    )
    decoupling: Literal["published", "exact"] = Field(
        "exact",
        description="form of the decoupling matrix; published lacks the factor 2 |rotor speed| in "
        "its attitude rows, as the thesis prints it for the tiltrotor",
    )
    attitude_error: Literal["rotation", "euler_angles"] = Field(
        "rotation",
        description="what the attitude's error is: the rotation that remains, without any singular "
        "attitude, or roll, pitch and yaw, as in the thesis",
    )
    gains: Annotated[
        Annotated[Literal["ch03", "ch04", "exact", "feedforward"], Tag("named")]
        | Annotated[GainTable, Tag("table")]
        | Annotated[PolePlacementTable, Tag("poles")],
        Discriminator(attitude_altitude_gain_kind),
    ] = Field("exact", description="a named set, or a table of gains or of poles")
    side_gains: Vector3 = Field(
        (12.0, 48.0, 64.0),
        description="on the errors of acceleration, velocity and position along directions that "
        "side force moves [1/s, 1/s^2, 1/s^3]",
    )
    norm: Literal["speed", "thrust"] = Field(
        "speed",
        description="of all rotor accelerations that do the same, those of least norm: of the "
        "accelerations themselves, for rotors that turn one way, or of the rates of thrust, for "
        "rotors that reverse",
    )
    slowest_rotor: NonNegative = Field(
        5.0,
        description="speed below which norm = thrust accelerates a rotor as if it were that fast "
        "[rad/s]",
    )
    restoring: NonNegative | None = Field(
        None,
        description="rate towards the rotor speeds of least power among those that do the same, "
        "with norm = thrust to those whose thrusts have the least sum of squares; default: "
        f"{RESTORING:g} where they would drift, which is with moving tilts and more rotors than "
        "outputs, else 0 [1/s]",
        examples=[0.5],
    )
    turn_time: NonNegative = Field(
        0.0, description="time in which the reference of roll and pitch is reached, smoothly [s]"
    )

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
            self.prioritizes_attitude,
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
