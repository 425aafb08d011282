"""The ``[reference]`` table of a scenario: the motion to track."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import lru_cache
from math import pi
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from tiltsim.scenario.controller_table import ReferenceKind
from tiltsim.scenario.messages import InvalidValueError
from tiltsim.scenario.table import Angle, Angles3, Positive, Table, Vector3
from tiltsim_controllers.gaits.parameters import NO_KNOTS
from tiltsim_controllers.mathematics.scalar import Values
from tiltsim_controllers.references.trajectories import REFERENCE_TYPES, ReferenceParameters
from tiltsim_controllers.references.waypoints import minimum_snap_knots

Tilt = Annotated[float, Field(gt=-pi / 2, lt=pi / 2)]


class _Reference(Table, ABC):
    """What every reference has."""

    @property
    @abstractmethod
    def kind(self) -> ReferenceKind:
        """What a controller must be able to track."""

    @property
    @abstractmethod
    def parameters(self) -> ReferenceParameters:
        """The record that the law reads."""

    @property
    def knots(self) -> Values:
        """The numbers of references of any length, which the record does not hold."""
        return NO_KNOTS

    @property
    def adds_acceleration(self) -> bool:
        """Whether ``acceleration_feedforward`` is set."""
        return False

    def after_gait(self, gait: Values) -> tuple[ReferenceParameters, Values]:
        """The record, and the knots of a flight: those of its gait, then the reference's own."""
        if self.knots == NO_KNOTS:
            return self.parameters, gait
        return self.parameters._replace(offset=float(len(gait))), (*gait, *self.knots)


class _PositionReference(_Reference):
    """A position, and the attitude at it."""

    roll: Tilt = Field(0.0, description="rad; needs a law that tracks the full pose, or switching")
    pitch: Tilt = Field(0.0, description="rad; as roll")
    yaw: Angle = 0.0
    acceleration_feedforward: bool = Field(
        False, description="ch. 4 omits it; laws of higher order always include it"
    )

    @property
    def adds_acceleration(self) -> bool:
        """See `_Reference.adds_acceleration`."""
        return self.acceleration_feedforward

    @property
    def kind(self) -> ReferenceKind:
        """See `_Reference.kind`."""
        return "position" if self.roll == self.pitch == 0.0 else "pose"

    def _parameters(self, kind: str, position: Vector3, **own: float) -> ReferenceParameters:
        return ReferenceParameters(
            REFERENCE_TYPES[kind],
            *position,
            roll=self.roll,
            pitch=self.pitch,
            yaw=self.yaw,
            acceleration_feedforward=float(self.acceleration_feedforward),
            **own,
        )


class SetpointReference(_PositionReference):
    """A point to hold."""

    type: Literal["setpoint"] = "setpoint"
    position: Vector3 = Field((0.0, 0.0, 0.0), description="m")

    @property
    def parameters(self) -> ReferenceParameters:
        """The record that the law reads."""
        return self._parameters(self.type, self.position)


class LineReference(_PositionReference):
    """Motion along a line, uniform or at a constant acceleration."""

    type: Literal["line"]
    position: Vector3 = Field((0.0, 0.0, 0.0), description="m, at time zero")
    velocity: Vector3 = Field(description="m/s, at time zero")
    acceleration: Vector3 = Field((0.0, 0.0, 0.0), description="m/s^2")

    @property
    def parameters(self) -> ReferenceParameters:
        """The record that the law reads."""
        return self._parameters(
            self.type,
            self.position,
            **_by_axis("velocity", self.velocity),
            **_by_axis("acceleration", self.acceleration),
        )


class CircleReference(_PositionReference):
    """Uniform motion on a horizontal circle, from +x towards +y; from -x where radius < 0."""

    type: Literal["circle"]
    position: Vector3 = Field((0.0, 0.0, 0.0), description="the centre, m")
    radius: float = Field(description="m; negative to start on the other side")
    angular_frequency: float = Field(description="rad/s")

    @property
    def parameters(self) -> ReferenceParameters:
        """The record that the law reads."""
        own = {"radius": self.radius, "angular_frequency": self.angular_frequency}
        return self._parameters(self.type, self.position, **own)

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.radius == 0.0:
            raise InvalidValueError("reference.radius", self.radius, "must not be 0")
        return self


class LissajousReference(_PositionReference):
    """A sine along each axis: ``position + amplitude sin(angular_frequency t + phase)``."""

    type: Literal["lissajous"]
    position: Vector3 = Field((0.0, 0.0, 0.0), description="the centre, m")
    amplitude: Vector3 = Field(description="m")
    angular_frequency: Vector3 = Field(description="rad/s")
    phase: Angles3 = Field((0.0, 0.0, 0.0), description="rad")

    @property
    def parameters(self) -> ReferenceParameters:
        """The record that the law reads."""
        return self._parameters(
            self.type,
            self.position,
            **_by_axis("amplitude", self.amplitude),
            **_by_axis("frequency", self.angular_frequency),
            **_by_axis("phase", self.phase),
        )


class FigureEightReference(_PositionReference):
    """A horizontal figure eight, from its crossing towards +x and +y; a 1:2 lissajous."""

    type: Literal["figure_eight"]
    position: Vector3 = Field((0.0, 0.0, 0.0), description="where it crosses itself, m")
    length: Positive = Field(description="m, along x")
    width: Positive = Field(description="m, along y")
    angular_frequency: Positive = Field(description="rad/s, once around")

    @property
    def parameters(self) -> ReferenceParameters:
        """The record that the law reads."""
        once = self.angular_frequency
        return self._parameters(
            self.type,
            self.position,
            **_by_axis("amplitude", (0.5 * self.length, 0.5 * self.width, 0.0)),
            **_by_axis("frequency", (once, 2.0 * once, 0.0)),
        )


class WaypointReference(_PositionReference):
    """Minimum-snap motion from rest to rest through points at given times."""

    type: Literal["waypoints"]
    positions: Annotated[tuple[Vector3, ...], Field(min_length=2, max_length=50, strict=False)] = (
        Field(description="m; the first is the start")
    )
    times: Annotated[tuple[float, ...], Field(strict=False)] = Field(
        description="s, one per point, from 0; after the last the reference rests"
    )

    @property
    def parameters(self) -> ReferenceParameters:
        """The record that the law reads."""
        return self._parameters(self.type, (0.0, 0.0, 0.0), segments=float(len(self.times)))

    @property
    def knots(self) -> Values:
        """Polynomials; see `tiltsim_controllers.references.waypoints.minimum_snap_knots`."""
        return _minimum_snap_knots(self.positions, self.times)

    @model_validator(mode="after")
    def _check(self) -> Self:
        try:
            _ = self.knots
        except ValueError as error:
            raise InvalidValueError("reference.times", self.times, str(error)) from None
        return self


_minimum_snap_knots = lru_cache(maxsize=64)(minimum_snap_knots)


def _by_axis(name: str, values: tuple[float, float, float]) -> dict[str, float]:
    return {f"{name}_{axis}": value for axis, value in zip("xyz", values, strict=True)}


class AttitudeAltitudeReference(_Reference):
    """Attitude and altitude to hold (ch. 3); x = y = 0 for laws that control them as well.

    Four rotors under a planned gait, and a quadrotor, leave the horizontal position free; the
    full_pose law has six outputs and controls it.
    """

    type: Literal["attitude_altitude"]
    roll: Tilt = Field(0.0, description="rad")
    pitch: Tilt = Field(0.0, description="rad")
    yaw: Angle = Field(0.0, description="rad")
    altitude: float = Field(0.0, description="m")

    @property
    def kind(self) -> ReferenceKind:
        """See `_Reference.kind`."""
        return "attitude_altitude"

    @property
    def parameters(self) -> ReferenceParameters:
        """The record that the law reads."""
        return ReferenceParameters(
            REFERENCE_TYPES[self.type],
            z=self.altitude,
            roll=self.roll,
            pitch=self.pitch,
            yaw=self.yaw,
        )


Reference = Annotated[
    SetpointReference
    | LineReference
    | CircleReference
    | LissajousReference
    | FigureEightReference
    | WaypointReference
    | AttitudeAltitudeReference,
    Field(discriminator="type"),
]
"""The ``[reference]`` table, discriminated by its type."""
