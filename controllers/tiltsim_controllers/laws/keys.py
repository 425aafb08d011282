"""Keys of a control law: its parameters in a scenario file, with bounds and descriptions.

A description of a number ends with its unit in brackets, ``[m/s]``, or ``[-]`` without one.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, Field

# The outer bounds keep arithmetic far from overflow, and far beyond any real vehicle.
Positive = Annotated[float, Field(gt=0.0, le=1e9)]
NonNegative = Annotated[float, Field(ge=0.0, le=1e9)]
Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
Vector3 = Annotated[tuple[Coordinate, Coordinate, Coordinate], Field(strict=False)]
Gains2 = Annotated[tuple[float, float], Field(strict=False)]


class Keys(BaseModel):
    """Base class of the keys of a law; a law reads tuples as arrays."""
