"""Columns of a flight that are the components of one vector, under the names of `Observation`."""

from collections.abc import Iterable
from typing import Final

from tiltsim.models.vehicle_parts import MAX_ROTORS


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
