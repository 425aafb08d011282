"""Columns over time and the vectors that they make, under the names of `Observation`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.errors import InputError
from tiltsim.models.vehicle_parts import MAX_ROTORS
from tiltsim.scenario.messages import did_you_mean
from tiltsim.system.public import optional_package
from tiltsim.system.text import short_repr
from tiltsim_controllers.mathematics.scalar import Floats

if TYPE_CHECKING:
    import pyarrow


def _each_rotor(name: str) -> tuple[str, ...]:
    return tuple(f"{name}_{rotor}" for rotor in range(1, MAX_ROTORS + 1))


VECTORS: Final = {
    "position": ("x", "y", "z"),
    "velocity": ("vx", "vy", "vz"),
    "attitude": ("roll", "pitch", "yaw"),
    "body_rates": ("p", "q", "r"),
    "tilt_angles": _each_rotor("alpha"),
    "tilt_rates": _each_rotor("alpha_rate"),
    "rotor_speeds": _each_rotor("rotor_speed"),
    "thrusts": _each_rotor("thrust"),
    "reference_position": ("x_ref", "y_ref", "z_ref"),
    "reference_attitude": ("roll_ref", "pitch_ref", "yaw_ref"),
    "reference_tilt_angles": _each_rotor("alpha_ref"),
}
"""Vectors by name and their components; a vehicle in a plane has some of them."""


def components(name: str, columns: Iterable[str]) -> list[str]:
    """The columns of a flight that make a vector, in its order; empty if there are none.

    Args:
        name: The vector, for a companion after its name, such as ``wing_position``.
        columns: All columns of the flight.
    """
    present, own = {*columns}, name if name in VECTORS else ""
    own = own or next((vector for vector in VECTORS if name.endswith(f"_{vector}")), "")
    prefix = name.removesuffix(own)
    return [prefix + part for part in VECTORS.get(own, ()) if prefix + part in present]


class UnknownColumnError(InputError, KeyError):
    """A flight or log has no column or vector of a name."""

    __str__ = Exception.__str__  # a KeyError shows its message in quotes


class ColumnsOverTime:
    """Columns by name, each of shape (N,), and their units: a flight, or the log of another tool.

    It iterates over the names of the columns, as a dict does.
    """

    if TYPE_CHECKING:

        @property
        def columns(self) -> dict[str, Floats]: ...

        @property
        def units(self) -> dict[str, str]: ...

    def __iter__(self) -> Iterator[str]:
        return iter(self.units)

    def __contains__(self, name: object) -> bool:
        """Whether there is a column or vector of this name."""
        return isinstance(name, str) and (name in self.units or bool(components(name, self.units)))

    def __getitem__(self, name: str) -> Floats:
        """A column by name, shape (N,); or a vector of `VECTORS`, shape (N, components).

        ``flight["x"]`` and ``flight["position"]``, both in the units of `units`. Raises
        `UnknownColumnError` for other names.
        """
        known = isinstance(name, str)
        if known and name in self.units:
            return self.columns[name]
        columns = components(name, self.units) if known else []
        if not columns:
            vectors = [vector for vector in VECTORS if components(vector, self.units)]
            hint, kind = did_you_mean(name, [*self.units, *vectors]), type(self).__name__
            raise UnknownColumnError(
                f"{short_repr(name)}: no column of this {kind.lower()}; {hint}see {kind}.units, or "
                f"the vectors {', '.join(vectors)}"
            )
        return np.stack([self.columns[column] for column in columns], axis=-1)

    def to_pandas(self) -> Any:
        """The columns as a pandas DataFrame, whose ``attrs["units"]`` are `units`.

        Raises `InputError` if pandas is not installed.
        """
        pandas = optional_package("pandas", f"{type(self).__name__}.to_pandas")
        frame = pandas.DataFrame(dict(self.columns))
        frame.attrs["units"] = dict(self.units)
        return frame

    def arrow_table(self, metadata: Mapping[str, str]) -> pyarrow.Table:
        """The columns as an Arrow table with units and further metadata."""
        import pyarrow as pa

        fields = [
            pa.field(name, pa.float64(), nullable=False, metadata={"unit": unit})
            for name, unit in self.units.items()
        ]
        # From their bytes, as converting an array would import pandas where it is installed.
        columns = [np.ascontiguousarray(self.columns[name]) for name in self.units]
        memory = [(len(column), [None, pa.py_buffer(column)]) for column in columns]
        arrays = [pa.Array.from_buffers(pa.float64(), *one) for one in memory]
        return pa.table(arrays, schema=pa.schema(fields, metadata=dict(metadata)))
