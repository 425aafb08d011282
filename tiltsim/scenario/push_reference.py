"""The ``[reference]`` of a push: a motion up to an object, a force on it, a path along it."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, NamedTuple

import numpy as np
from pydantic import Field

from tiltsim.models.objects import distance_ahead
from tiltsim.scenario.messages import choose
from tiltsim.scenario.reference_table import PositionReference
from tiltsim.scenario.table import NonNegative, Positive, Table, Vector3
from tiltsim_controllers.mathematics.attitude import rotation_matrix
from tiltsim_controllers.references.trajectories import (
    COEFFICIENTS,
    REFERENCE_TYPES,
    ReferenceParameters,
    minimum_snap_knots,
)

if TYPE_CHECKING:
    from tiltsim_controllers.mathematics.scalar import Floats, Triple, Values

SPEEDING_UP: Final = 1.0
"""s, to the speed of the approach; less where the object is near."""

FROM_REST: Final = (0.0, 1.0, -3.0, 2.5, 0.0, 0.0, 0.0, 0.0)
"""A motion from rest to the speed 1 in the time 1, without a jerk at either end."""


class Slide(Table):
    """A path along the object while the vehicle pushes."""

    table_name = "reference.slide"

    positions: Annotated[tuple[Vector3, ...], Field(min_length=2, max_length=50, strict=False)] = (
        Field(
            description="points from where the tool touches, along the world's axes; the first is "
            "[0, 0, 0] [m]",
            examples=[[[0.0, 0.0, 0.0], [0.0, 0.2, 0.0]]],
        )
    )
    times: Annotated[tuple[float, ...], Field(strict=False)] = Field(
        description="when it is there, one per point [s]", examples=[[8.0, 12.0]]
    )

    def _check_values(self) -> None:
        if any(self.positions[0]):
            raise self.mistake("positions", "the first must be [0, 0, 0], where the tool touches")
        if len(self.times) != len(self.positions):
            raise self.mistake("times", f"{len(self.positions)} positions need as many times")
        if any(later <= before for before, later in pairwise(self.times)):
            raise self.mistake("times", "must increase")


class ImpedanceTable(Table):
    """How the contact gives way to errors of the force: ``m x'' + d x' + k x = error``."""

    table_name = "reference.impedance"

    mass: Positive = Field(description="virtual [kg]", examples=[2.0])
    damping: NonNegative = Field(description="virtual [N s/m]", examples=[40.0])
    stiffness: NonNegative = Field(
        description="of the vehicle's place against the object; 0 holds the force [N/m]",
        examples=[20.0],
    )


class Touch(NamedTuple):
    """Where and when a push touches its object."""

    direction: Triple  # unit vector of the push, world
    distance: float  # m, from the position at the start
    speeding_up: float  # s
    time: float  # s


class PushReference(PositionReference):
    """Up to an object along the tool, then a force on it, and a path along it."""

    type: Literal["push"] = Field(description="a push against an object")
    position: Vector3 = Field(
        (0.0, 0.0, 0.0),
        description="where the approach begins; it goes along the tool [m]",
        examples=[[0.0, 0.0, 1.0]],
    )
    object: str = Field(description="the name of the object", examples=["wall"])
    force: NonNegative = Field(description="on the object, along the tool [N]", examples=[5.0])
    approach: Positive = Field(0.1, description="speed toward the object [m/s]")
    start: NonNegative = Field(1.0, description="when the approach begins [s]")
    ramp: Positive = Field(1.0, description="from the touch to the full force [s]")
    gain: NonNegative = Field(
        4.0, description="integral gain from the error of the force to the commanded force [1/s]"
    )
    proportional_gain: NonNegative = Field(
        0.5, description="gain from the error of the force to the commanded force [-]"
    )
    slide: Slide | None = Field(None, description="a path along the object; default: none")
    impedance: ImpedanceTable | None = Field(
        None, description="an impedance in place of the loop of force; default: none"
    )

    def _check_values(self) -> None:
        super()._check_values()
        if self.impedance is not None:
            needs = "is of the loop of force; remove it, or reference.impedance"
            self.require_defaults(("gain", "proportional_gain"), needs)

    def softness(self, scenario: Any) -> float:
        """How far a force that the law does not know pushes the vehicle from its place, m/N."""
        controller = scenario.controller
        if controller.observes_forces or controller.position_stiffness is None:
            return 0.0
        mass: float = scenario.any_rotorcraft.resolve().mass
        return 1.0 / (mass * controller.position_stiffness)

    def check_impedance(self, scenario: Any) -> None:
        """Refuse an impedance that the law cannot have. Raises `mistake`."""
        own, softness = self.impedance, self.softness(scenario)
        if own is not None and softness * own.stiffness >= 0.9:
            most = f"must be below {0.9 / softness:.4g}, 0.9 of the law's own stiffness"
            raise own.mistake("stiffness", most)

    def touch(self, scenario: Any) -> Touch:
        """Where and when it touches. Raises `mistake` for an object that it cannot touch."""
        bodies = {table.name: table.body for table in scenario.object}
        if self.object not in bodies:
            reason = choose(self.object, bodies) if bodies else "there is no [[object]]"
            raise self.mistake("object", reason)
        if bodies[self.object].shape == "mesh":
            raise self.mistake("object", "is a mesh; a push needs a wall, box or sphere")
        if scenario.tool is None:
            raise self.mistake("object", "needs a [tool] to push with")
        turn = rotation_matrix((self.roll, self.pitch, self.yaw))
        tool = scenario.tool.tool
        unit, tip = turn @ tool.unit, np.array(self.position) + turn @ tool.tip
        distance = distance_ahead(bodies[self.object], tip, unit)
        if distance is None:
            x, y, z = unit
            ahead = f"tip of the tool, which points along ({x:.3g}, {y:.3g}, {z:.3g})"
            raise self.mistake("object", f"is not ahead of the {ahead}")
        rise = min(SPEEDING_UP, distance / self.approach)
        time = self.start + 0.5 * rise + distance / self.approach
        x, y, z = unit.tolist()
        return Touch((x, y, z), distance, rise, time)

    def after_gait(self, gait: Values, scenario: Any) -> tuple[ReferenceParameters, Values]:
        rows = self._rows(self.touch(scenario))
        knots = tuple(float(value) for row in rows for value in row)
        parameters = self.parameters._replace(segments=float(len(rows)), offset=float(len(gait)))
        return parameters, (*gait, *knots)

    def _rows(self, touch: Touch) -> list[Floats]:
        """Segments of the motion: their times and polynomials, as `minimum_snap_knots` has them."""
        at_start, unit, rise = np.array(self.position), np.array(touch.direction), touch.speeding_up

        def segment(time: float, along: Any, begin: Any) -> Floats:
            coefficients = np.outer(unit, along)
            coefficients[:, -1] += begin
            return np.array([time, *coefficients.ravel()])

        rest, moving = np.zeros(COEFFICIENTS), np.zeros(COEFFICIENTS)
        powers = np.arange(COEFFICIENTS)[::-1]
        speeding = self.approach * rise * np.array(FROM_REST) / rise**powers
        moving[-2] = self.approach
        half_way = at_start + 0.5 * rise * self.approach * unit
        at_object = at_start + touch.distance * unit
        rows = [
            *([segment(0.0, rest, at_start)] if self.start > 0.0 else []),
            segment(self.start, speeding, at_start),
            segment(self.start + rise, moving, half_way),
            segment(touch.time, rest, at_object),
        ]
        if self.slide is None:
            return rows
        first = self.slide.times[0]
        if first < touch.time:
            reason = f"must begin after the touch at {touch.time:.4g} s"
            raise self.slide.mistake("times", reason)
        points = (at_object + np.array(self.slide.positions)).tolist()
        path = minimum_snap_knots(points, [time - first for time in self.slide.times])
        further = np.reshape(path, (len(points), -1))
        further[:, 0] += first
        return [*rows, *further]

    def _motion(self) -> dict[str, float | Triple]:
        return {}

    @property
    def parameters(self) -> ReferenceParameters:
        return super().parameters._replace(type=REFERENCE_TYPES["waypoints"])
