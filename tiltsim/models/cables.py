"""Cables between a vehicle and an object, which hold from one time to another.

A cable is a spatial tendon with a largest length: taut or slack. The limit of a tendon belongs to
the model, so a plant switches its own model between steps, on every engine.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    import mujoco

    from tiltsim_controllers.mathematics.scalar import Triple, Values

CABLE_READING: Final = 4
"""Numbers in the memory of a sensor of tension: two of MuJoCo, the time and the force."""

IMPEDANCE: Final = (0.95, 0.99, 0.001, 0.5, 2.0)
"""MuJoCo's ``solimp``: how firmly contacts and cables hold."""

ROUNDING: Final = 1e-9  # s


@dataclass(frozen=True)
class Cable:
    """A cable from a vehicle to the center of an object.

    Attributes:
        name: Its name.
        vehicle: The companion, empty for the first vehicle.
        object: The object's name.
        attachment: On the vehicle, m, body axes.
        length: m.
        start, end: The times between which it holds, s.
    """

    name: str
    vehicle: str
    object: str
    attachment: Triple
    length: float
    start: float = 0.0
    end: float = inf

    def holds(self, time: float) -> bool:
        """Whether it holds in the step that begins at a time (s)."""
        return self.start - ROUNDING <= time < self.end - ROUNDING

    def switches(self, timestep: float) -> Values:
        """The steps before which it begins to hold, and releases."""
        times = (time for time in (self.start, self.end) if 0.0 < time < inf)
        return tuple(round(time / timestep) for time in times)


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
