"""The common part of the ``[reference]`` tables, and the reference of a push.

A push is a motion up to an object, a force on it, and a path along it.
"""

from abc import ABC, abstractmethod
from itertools import pairwise
from math import acos, cos, pi
from typing import Annotated, Any, Final, Literal, NamedTuple

import numpy as np
from pydantic import Field

from tiltsim.models.objects import distance_ahead
from tiltsim.scenario.controller_table import ReferenceKind
from tiltsim.scenario.messages import choose
from tiltsim.scenario.table import (
    ZEROS,
    Angle,
    Many,
    NonNegative,
    Positive,
    Table,
    Vector3,
    default,
    required,
)
from tiltsim_controllers.gaits.motion import NO_KNOTS
from tiltsim_controllers.mathematics.attitude import rotation_matrix
from tiltsim_controllers.mathematics.scalar import Floats, Triple, Values
from tiltsim_controllers.references.trajectories import (
    COEFFICIENTS,
    REFERENCE_TYPES,
    ReferenceParameters,
    minimum_snap_knots,
)

Tilt = Annotated[float, Field(gt=-pi / 2, lt=pi / 2)]


class ReferenceTable(Table, ABC):
    """The keys and properties of every reference."""

    table_name = "reference"

    @property
    @abstractmethod
    def kind(self) -> ReferenceKind:
        """The kind of motion that a controller must be able to track."""

    @property
    def parameters(self) -> ReferenceParameters:
        """The record that the law reads: keys by their names."""
        given = dict(self)
        return ReferenceParameters(
            REFERENCE_TYPES[given["type"]],
            **self._motion(),
            **{angle: given[angle] for angle in ("roll", "pitch", "yaw")},
            acceleration_feedforward=float(self.adds_acceleration),
        )

    def _motion(self) -> dict[str, Any]:
        """The parameters of the motion: by default all keys of the reference's own type."""
        shared = PositionReference.model_fields
        return {key: value for key, value in self if key not in shared}

    @property
    def knots(self) -> Values:
        """Table data of references of any length, which the record does not hold."""
        return NO_KNOTS

    @property
    def adds_acceleration(self) -> bool:
        """Whether the reference has ``acceleration_feedforward``, and it is set."""
        return getattr(self, "acceleration_feedforward", False)

    @property
    def turns(self) -> bool:
        """Whether roll, pitch and yaw vary with time."""
        return False

    @property
    def lean(self) -> float:
        """The largest angle between the body's z axis and up, rad."""
        return 0.0

    def after_gait(self, gait: Values, scenario: Any) -> tuple[ReferenceParameters, Values]:
        """The record, and the table data of a flight: the gait's, then the reference's.

        Args:
            gait: The gait's.
            scenario: The scenario of the flight.
        """
        if self.knots == NO_KNOTS:
            return self.parameters, gait
        return self.parameters._replace(offset=float(len(gait))), (*gait, *self.knots)


class PositionReference(ReferenceTable):
    """A position, and the attitude at it."""

    roll: Angle = default(
        0.0,
        "angle to hold; for controller.law attitude_force, which alone takes pi/2 and more, "
        "full_pose, switching, vectoring or python [rad]",
        0.2,
    )
    pitch: Tilt = default(0.0, "as roll [rad]", 0.2)
    yaw: Angle = default(0.0, "heading to hold [rad]", 0.5)
    acceleration_feedforward: bool = default(
        False,
        "also demand the reference's acceleration; ch. 4 omits it, laws of higher order always "
        "include it",
    )
    type: str

    @property
    def lean(self) -> float:
        return acos(cos(self.roll) * cos(self.pitch))

    @property
    def kind(self) -> ReferenceKind:
        return "position" if self.roll == self.pitch == 0.0 else "pose"


SPEEDING_UP: Final = 1.0  # s, to the speed of the approach; less where the object is near

FROM_REST: Final = (0.0, 1.0, -3.0, 2.5, 0.0, 0.0, 0.0, 0.0)
"""A motion from rest to the speed 1 in the time 1, without a jerk at either end."""


class Slide(Table):
    """A path along the object while the vehicle pushes."""

    table_name = "reference.slide"

    positions: Annotated[Many[Vector3], Field(min_length=2, max_length=50)] = required(
        "points from where the tool touches, along the world's axes; the first is [0, 0, 0] [m]",
        [[0.0, 0.0, 0.0], [0.0, 0.2, 0.0]],
    )
    times: Many[float] = required("when it is there, one per point [s]", [8.0, 12.0])

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

    mass: Positive = required("virtual [kg]", 2.0)
    damping: NonNegative = required("virtual [N s/m]", 40.0)
    stiffness: NonNegative = required(
        "of the vehicle's place against the object; 0 holds the force [N/m]", 20.0
    )


class Touch(NamedTuple):
    """Where and when a push touches its object."""

    direction: Triple  # unit vector of the push, world
    distance: float  # m, from the position at the start
    speeding_up: float  # s
    time: float  # s


class PushReference(PositionReference):
    """Up to an object along the tool, then a force on it, and a path along it."""

    type: Literal["push"] = required("a push against an object")
    position: Vector3 = default(
        ZEROS, "where the approach begins; it goes along the tool [m]", [0.0, 0.0, 1.0]
    )
    object: str = required("the name of the object", "wall")
    force: NonNegative = required("on the object, along the tool [N]", 5.0)
    approach: Positive = default(0.1, "speed toward the object [m/s]")
    start: NonNegative = default(1.0, "when the approach begins [s]")
    ramp: Positive = default(1.0, "from the touch to the full force [s]")
    gain: NonNegative = default(
        4.0, "integral gain from the error of the force to the commanded force [1/s]"
    )
    proportional_gain: NonNegative = default(
        0.5, "gain from the error of the force to the commanded force [-]"
    )
    slide: Slide | None = default(None, "a path along the object; default: none")
    impedance: ImpedanceTable | None = default(
        None, "an impedance in place of the loop of force; default: none"
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
        bodies = {table.name: table for table in scenario.object}
        if self.object not in bodies:
            reason = choose(self.object, bodies) if bodies else "there is no [[object]]"
            raise self.mistake("object", reason)
        if bodies[self.object].type == "mesh":
            raise self.mistake("object", "is a mesh; a push needs a wall, box or sphere")
        if scenario.tool is None:
            raise self.mistake("object", "needs a [tool] to push with")
        turn = rotation_matrix((self.roll, self.pitch, self.yaw))
        unit = turn @ scenario.tool.unit
        tip = np.array(self.position) + turn @ scenario.tool.tip
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

    def _motion(self) -> dict[str, Any]:
        return {}

    @property
    def parameters(self) -> ReferenceParameters:
        return super().parameters._replace(type=REFERENCE_TYPES["waypoints"])
