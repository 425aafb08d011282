"""Objects on taut cables as the pendulums that they are, in the motion of MuJoCo's model.

In flights a stiff tendon holds an object, which may also rise: a step of a difference would make it
slack. Here each object is put back to where its cables keep their lengths, and their tensions are
the multipliers that hold it there.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING, Final, NamedTuple

import mujoco
import numpy as np

from tiltsim.linear.coordinates import BODY_RATES, LOAD, POSITION, SWING_RATES, VELOCITY
from tiltsim.vehicles.rotorcraft.others import SWING
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.body import ROTATION_NAMES

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import Scenario

TRIALS: Final = 20
"""Steps of Newton's method at most to put an object between its cables."""

ROUNDING: Final = 1e-15  # m


class Hung(NamedTuple):
    """An object and the cables that hold it for good, by their names in the model."""

    prefix: str  # of the names of its coordinates; `LOAD` for the load
    cables: tuple[str, ...]
    lengths: tuple[float, ...]  # m

    @property
    def swings(self) -> tuple[str, ...]:
        """Names of the angles of its first cable, and of their rates."""
        prefix = "" if self.prefix == LOAD else self.prefix
        return tuple(prefix + name for name in (*SWING, *SWING_RATES))

    @property
    def places(self) -> set[str]:
        """Names of its coordinates that the cables bind."""
        return {self.prefix + name for name in (*POSITION, *VELOCITY)}

    @property
    def turning(self) -> set[str]:
        """Names of its turn and rates, which no cable to its center changes."""
        return {self.prefix + name for name in (*ROTATION_NAMES, *BODY_RATES)}


def hung_in(scenario: Scenario) -> tuple[Hung, ...]:
    """The load and the objects that hang on cables which hold from some time on."""
    load, found = scenario.payload, []
    if load is not None and not load.rigid:
        found.append(Hung(LOAD, ("cable",), (load.length,)))
    for table in scenario.object:
        own = [each for each in scenario.cable if each.object == table.name and each.end is None]
        if own:
            names, lengths = zip(*((each.name, each.length) for each in own), strict=True)
            found.append(Hung(f"{table.name}_", names, lengths))
    return tuple(found)


class Hanging:
    """Hung objects in a model.

    Args:
        model: The model.
        hung: The objects.
    """

    def __init__(self, model: mujoco.MjModel, hung: Sequence[Hung]) -> None:
        self._model, self.hung = model, hung
        self.names = [name for each in hung for name in each.cables]
        self.tendons = np.array([model.tendon(name).id for name in self.names], dtype=int)
        self.lengths = np.array([length for each in hung for length in each.lengths])
        first = model.tendon_adr[self.tendons]
        self._sites = [*zip(model.wrap_objid[first], model.wrap_objid[first + 1], strict=True)]
        ends = [*accumulate((len(each.cables) for each in hung), initial=0)]
        self._cables = [slice(*both) for both in pairwise(ends)]
        firsts = [self._sites[own][0] for own in self._cables]
        self.bodies = [model.site_bodyid[end] for _, end in firsts]
        carriers = [model.body_rootid[model.site_bodyid[begin]] for begin, _ in firsts]
        joints = model.body_jntadr[np.reshape((self.bodies, carriers), (2, -1)).astype(int)]
        places, speeds = model.jnt_qposadr[joints].T, model.jnt_dofadr[joints].T
        self.of_state = np.vstack((places, model.nq + speeds))
        self.of_rates = np.vstack((speeds, model.nv + speeds))
        """First indices of an object and of its vehicle, in a state and in its rates."""

    def distances(self, data: mujoco.MjData) -> Floats:
        """Distances (m) between the ends of the cables."""
        return np.asarray(data.ten_length[self.tendons])

    def moved(self, vector: Floats, places: Floats, sign: float) -> Floats:
        """A state or rates, the hung objects' numbers less or, by 1, with their vehicles'.

        Args:
            vector: The state or the rates.
            places: ``of_state`` or ``of_rates``.
            sign: -1 or 1.
        """
        found = vector.copy()
        for own, carrier in places:
            found[own : own + 3] += sign * found[carrier : carrier + 3]
        return found

    def place(self, data: mujoco.MjData, lengths: Floats) -> None:
        """Move the objects to where their cables have these lengths (m), which then do not change.

        On one cable an object keeps its direction from the vehicle.
        """
        if not self.hung:
            return
        self._update(data)
        for own, body in zip(self._cables, self.bodies, strict=True):
            ends, joint = self._sites[own], self._model.body_jntadr[body]
            at, dof = self._model.jnt_qposadr[joint], self._model.jnt_dofadr[joint]
            begins = np.array([data.site_xpos[begin] for begin, _ in ends])
            place, speed = data.qpos[at : at + 3], data.qvel[dof : dof + 3]  # views
            for _ in range(TRIALS):
                units, apart = _directions(place - begins)
                excess = apart - lengths[own]
                if np.abs(excess).max() <= ROUNDING:
                    break
                place -= np.linalg.pinv(units) @ excess
            moving = [speed - self._jacobian(data, begin) @ data.qvel for begin, _ in ends]
            speed -= np.linalg.pinv(units) @ (units * moving).sum(axis=1)

    def swings(self, data: mujoco.MjData) -> Floats:
        """Angles (rad) of the first cable of each object from straight down, and their rates."""
        self._update(data)
        found = []
        for own in self._cables:
            begin, end = self._sites[own][0]
            x, y, z = data.site_xpos[end] - data.site_xpos[begin]
            vx, vy, vz = self._relative(data, begin, end) @ data.qvel
            rates = [(vz * u - du * z) / (u * u + z * z) for u, du in ((x, vx), (y, vy))]
            found += [np.arctan2(x, -z), np.arctan2(y, -z), *rates]
        return np.array(found)

    def hold(self, data: mujoco.MjData) -> tuple[Floats, Floats]:
        """Accelerations with cables of fixed length, and their tensions (N), from free ones."""
        model, count = self._model, len(self._sites)
        if not count:
            return data.qacc, np.zeros(0)
        rows, excess = np.zeros((count, model.nv)), np.zeros(count)
        for number, (begin, end) in enumerate(self._sites):
            (unit,), (apart,) = _directions((data.site_xpos[end] - data.site_xpos[begin])[None])
            relative = self._relative(data, begin, end)
            speed, changing = relative @ data.qvel, self._changing(data, begin, end)
            rows[number] = unit @ relative
            turning = (speed @ speed - (unit @ speed) ** 2) / apart
            excess[number] = rows[number] @ data.qacc + unit @ changing + turning
        pulled = np.zeros_like(rows)
        mujoco.mj_solveM(model, data, pulled, rows)
        tensions = np.linalg.lstsq(rows @ pulled.T, excess, rcond=None)[0]
        return data.qacc - tensions @ pulled, tensions

    def _update(self, data: mujoco.MjData) -> None:
        """Compute the places of bodies and sites, and the axes of joints, from ``qpos``."""
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_comPos(self._model, data)

    def _jacobian(self, data: mujoco.MjData, site: int) -> Floats:
        """Derivative of a site's position by the model's speeds, shape (3, nv)."""
        found = np.zeros((3, self._model.nv))
        mujoco.mj_jacSite(self._model, data, found, None, site)
        return found

    def _relative(self, data: mujoco.MjData, begin: int, end: int) -> Floats:
        return self._jacobian(data, end) - self._jacobian(data, begin)

    def _changing(self, data: mujoco.MjData, begin: int, end: int) -> Floats:
        """Relative acceleration (m/s^2) of two sites at constant speeds of the model."""
        found, zero = np.zeros((2, 3, self._model.nv)), np.zeros((3, self._model.nv))
        for site, jacobian in zip((begin, end), found, strict=True):
            body = self._model.site_bodyid[site]
            mujoco.mj_jacDot(self._model, data, jacobian, zero, data.site_xpos[site], body)
        return np.asarray((found[1] - found[0]) @ data.qvel)


def _directions(vectors: Floats) -> tuple[Floats, Floats]:
    """Unit vectors and lengths of vectors, shapes (n, 3) and (n,)."""
    sizes = np.linalg.norm(vectors, axis=1)
    return vectors / sizes[:, None], sizes
