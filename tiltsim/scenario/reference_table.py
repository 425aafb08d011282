"""The common part of the ``[reference]`` tables."""

from abc import ABC, abstractmethod
from math import acos, cos, pi
from typing import Annotated, Any, Final

from pydantic import Field

from tiltsim.scenario.controller_table import ReferenceKind
from tiltsim.scenario.table import Angle, Table, default
from tiltsim_controllers.gaits.motion import NO_KNOTS
from tiltsim_controllers.mathematics.scalar import Triple, Values
from tiltsim_controllers.references.trajectories import REFERENCE_TYPES, ReferenceParameters

Tilt = Annotated[float, Field(gt=-pi / 2, lt=pi / 2)]
Roll = Annotated[float, Field(ge=-pi, le=pi)]


_PREFIXES: Final = {"position": "", "angular_frequency": "frequency_"}
"""Beginnings of the fields of `ReferenceParameters` that hold a vector, unless they are its key."""


class ReferenceTable(Table, ABC):
    """The keys and properties of every reference."""

    table_name = "reference"

    @property
    @abstractmethod
    def kind(self) -> ReferenceKind:
        """The kind of motion that a controller must be able to track."""

    @property
    def parameters(self) -> ReferenceParameters:
        """The record that the law reads: keys by their names, vectors by their components."""
        given = dict(self)
        fields = {angle: given[angle] for angle in ("roll", "pitch", "yaw")}
        fields["acceleration_feedforward"] = float(self.adds_acceleration)
        for key, value in self._motion().items():
            if isinstance(value, tuple):
                prefix = _PREFIXES.get(key, f"{key}_")
                fields |= {f"{prefix}{axis}": n for axis, n in zip("xyz", value, strict=True)}
            else:
                fields[key] = value
        return ReferenceParameters(REFERENCE_TYPES[given["type"]], **fields)

    def _motion(self) -> dict[str, float | Triple]:
        """The parameters of the motion: by default all keys of the reference's own type."""
        shared = PositionReference.model_fields
        return {key: value for key, value in self if key not in shared}

    @property
    def knots(self) -> Values:
        """Table data of references of any length, which the record does not hold."""
        return NO_KNOTS

    @property
    def adds_acceleration(self) -> bool:
        """Whether ``acceleration_feedforward`` is set."""
        return False

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

    roll: Roll = default(
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
    def adds_acceleration(self) -> bool:
        return self.acceleration_feedforward

    @property
    def lean(self) -> float:
        return acos(cos(self.roll) * cos(self.pitch))

    @property
    def kind(self) -> ReferenceKind:
        return "position" if self.roll == self.pitch == 0.0 else "pose"
