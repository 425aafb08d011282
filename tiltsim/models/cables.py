"""Cables between a vehicle and an object, which hold from one time to another.

A cable is a spatial tendon with a largest length: taut or slack. The limit of a tendon belongs to
the model, so a plant switches its own model between steps, on every engine.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import inf
from typing import TYPE_CHECKING, Final

from tiltsim_controllers.laws.keys import (
    ZEROS,
    Keys,
    Name,
    NonNegative,
    Positive,
    Vector3,
    default,
    required,
)
from tiltsim_controllers.mathematics.scalar import Values

if TYPE_CHECKING:
    import mujoco

CABLE_READING: Final = 4
"""Numbers in the memory of a sensor of tension: two of MuJoCo, the time and the force."""

IMPEDANCE: Final = (0.95, 0.99, 0.001, 0.5, 2.0)
"""MuJoCo's ``solimp``: how firmly contacts and cables hold."""

ROUNDING: Final = 1e-9  # s


class Cable(Keys):
    """The keys of a cable from a vehicle to the center of an object."""

    name: Name = required("its name, which begins the name of its column", "sling")
    object: str = required("the name of a free object", "parcel")
    vehicle: str = default(
        "", "the name of the companion that it hangs on; default: the first vehicle", "wing"
    )
    attachment: Vector3 = default(ZEROS, "in body axes [m]", [0.0, 0.0, -0.05])
    length: Positive = required("to the center of the object [m]", 1.0)
    start: NonNegative = default(0.0, "from when it holds [s]", 5.0)
    end: Positive | None = default(None, "when it releases; default: never [s]", 8.0)

    def holds(self, time: float) -> bool:
        """Whether it holds in the step that begins at a time (s)."""
        return self.start - ROUNDING <= time < (inf if self.end is None else self.end) - ROUNDING

    def switches(self, timestep: float) -> Values:
        """The steps before which it begins to hold, and releases."""
        return tuple(round(time / timestep) for time in (self.start, self.end) if time)


def add_cable(spec: mujoco.MjSpec, cable: Cable) -> None:
    """Add a cable and the sensor of its tension to a world with its vehicle and object."""
    vehicle = f"{cable.vehicle}_vehicle" if cable.vehicle else "vehicle"
    spec.body(vehicle).add_site(name=f"{cable.name}_attachment", pos=cable.attachment)
    spec.body(f"object_{cable.object}").add_site(name=f"{cable.name}_load")
    stretch(spec, cable.name, (f"{cable.name}_attachment", f"{cable.name}_load"), cable.length)


def stretch(spec: mujoco.MjSpec, name: str, sites: tuple[str, str], length: float) -> None:
    """Join two sites by a tendon, whose tension a sensor measures.

    Args:
        spec: The world.
        name: The name of tendon and sensor.
        sites: Names of both sites.
        length: The largest length, m.
    """
    import mujoco

    cable = spec.add_tendon(name=name, limited=1, range=(0.0, length), width=0.003)
    for site in sites:
        cable.wrap_site(site)
    cable.solref_limit = (2.0 * spec.option.timestep, 1.0)  # as stiff as MuJoCo allows
    cable.solimp_limit = IMPEDANCE
    kind, tendon = mujoco.mjtSensor.mjSENS_TENDONLIMITFRC, mujoco.mjtObj.mjOBJ_TENDON
    spec.add_sensor(name=name, type=kind, objtype=tendon, objname=name, nsample=1)


def switch(model: mujoco.MjModel, cables: Iterable[Cable], time: float) -> None:
    """Let the cables that hold at a time (s) hold, and hide the others."""
    for cable in cables:
        tendon = model.tendon(cable.name).id
        model.tendon_limited[tendon] = cable.holds(time)
        model.tendon_rgba[tendon, 3] = float(cable.holds(time))
