"""A closed loop in MuJoCo as functions of its state, for derivatives."""

from collections.abc import Callable
from functools import cached_property
from math import ceil
from typing import Any, Final

import mujoco
import numpy as np

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.closed_loop.userdata import EVALUATIONS, EVALUATIONS_PER_STEP, HEADER_SIZE
from tiltsim.engines.base import EngineName
from tiltsim.engines.control import control_callback
from tiltsim.linear import coordinates
from tiltsim.linear.hanging import Hanging
from tiltsim.linear.motion import EquationMotion, Motion
from tiltsim.models.objects import FORCE
from tiltsim.plants.mujoco_plant import MujocoPlant
from tiltsim.plants.plant import Plant
from tiltsim.scenario.scenario import Scenario
from tiltsim_controllers.mathematics.scalar import Floats, Values

READINGS: Final = 3
"""Evaluations in which a controller finds the contact force that it makes."""

SETTLING_TIME: Final = 40.0  # s, flown at most to approach an orbit or a rest point

SLACK: Final = 1e-9  # N


class MujocoMotion(Motion):
    """In MuJoCo; a state is `qpos`, `qvel` and `act`, of hung objects relative to a vehicle."""

    def _names(self) -> tuple[coordinates.Coordinates, tuple[coordinates.Input, ...]]:
        found = coordinates.mujoco_coordinates(self.assembly.loop, self.vehicles, self.scenario)
        inputs = [
            each._replace(name=prefix + each.name, vehicle=number)
            for number, (prefix, own) in enumerate(self.vehicles.items())
            for each in coordinates.control_inputs(own)
        ]
        return found, tuple(inputs)

    @cached_property
    def _hanging(self) -> Hanging:
        return Hanging(self._varied.model, self.hung)

    def _made(self, assembly: Assembly, engine: EngineName | None) -> Plant:
        model = None if assembly is self.assembly else self._varied.model
        return MujocoPlant(assembly, model, engine)

    @cached_property
    def _first(self) -> Floats:
        """The integration state at time zero: time, `qpos`, `qvel`, `act` and more."""
        return np.array(self._varied.state)

    @cached_property
    def initial(self) -> Floats:
        return self._read(self._first)

    @property
    def _part(self) -> slice:
        model = self._varied.model
        return slice(1, 1 + model.nq + model.nv + model.na)

    def _read(self, whole: Floats) -> Floats:
        return self.placed(self._hanging.moved(whole[self._part], self._hanging.of_state, -1.0))

    def _split(self, state: Floats) -> list[Floats]:
        model = self._varied.model
        return np.split(state, (model.nq, model.nq + model.nv))

    def _set(self, state: Floats, lengths: Floats | None = None) -> Any:
        """MuJoCo's data with a state, the objects on cables of given lengths (m) or their own."""
        data = self._varied.data
        whole = self._hanging.moved(state, self._hanging.of_state, 1.0)
        data.qpos[:], data.qvel[:], data.act[:] = self._split(whole)
        self._hanging.place(data, self._hanging.lengths if lengths is None else lengths)
        return data

    def placed(self, state: Floats) -> Floats:
        return self._hanging.moved(self._whole_part(state), self._hanging.of_state, -1.0)

    def _whole_part(self, state: Floats, lengths: Floats | None = None) -> Floats:
        """MuJoCo's `qpos`, `qvel` and `act` of a state; see `_set`."""
        data = self._set(state, lengths)
        return np.concatenate((data.qpos, data.qvel, data.act))

    def swings(self, state: Floats) -> Floats:
        return self._hanging.swings(self._set(state))

    def why_not_held(self, time: float, state: Floats) -> str:
        data, tensions, _, _ = self._forward(time, state)
        touching = self._varied.model.geom_bodyid[data.contact.geom]
        for name, tension in zip(self._hanging.names, tensions, strict=True):
            if tension <= SLACK:
                return f"{name} is slack at rest: let it end, or shorten it"
        for each, body in zip(self.hung, self._hanging.bodies, strict=True):
            if body in touching:
                return f"{each.prefix[:-1]} hangs and touches something at rest; part them"
        return ""

    @cached_property
    def _stretched(self) -> Floats | None:
        """Lengths (m) of stretched cables, after a flight, which is then steady if at rest."""
        if not self.hung:
            return None
        plant = self._plant
        plant.state = self._first
        plant.advance(ceil(SETTLING_TIME / self.scenario.simulation.timestep))
        return None if plant.fault() else self._hanging.distances(plant.data)

    def _seen(self, readings: Floats) -> list[list[float]]:
        """Arguments of the functions of the loop: the vehicles' `qpos` and `qvel`, and `act`."""
        sizes, data = self.assembly.loop.sizes, self._varied.data
        act = np.concatenate((data.act, data.qpos[sizes.qpos :], readings))
        return [each.tolist() for each in (data.qpos[: sizes.qpos], data.qvel[: sizes.qvel], act)]

    def _readings(self, tensions: Floats) -> Floats:
        """The memories of the sensors of contact forces and tensions (N), as of this instant."""
        model, data = self._varied.model, self._varied.data
        found = np.zeros(model.nhistory)
        for sensor in np.flatnonzero(model.sensor_history[:, 0]):
            first, size = model.sensor_historyadr[sensor] + FORCE, model.sensor_dim[sensor]
            found[first : first + size] = data.sensordata[model.sensor_adr[sensor] :][:size]
            if model.sensor_objtype[sensor] == mujoco.mjtObj.mjOBJ_TENDON:
                found[first] = tensions[self._hanging.tendons == model.sensor_objid[sensor]].sum()
        return found

    @cached_property
    def _all_controls(self) -> Callable[..., Values]:
        """The controls at a time and state, and the controller's commands without offsets."""
        loop = self.assembly.loop

        def controls(setup: Any, time: Any, *parts: Any) -> Any:
            values = loop.controls(time[0], *parts, *setup)
            return (*values, *(each for own in self._commanded for each in own))

        qpos, qvel, act, _, *behind = loop.sizes
        return self._evaluated(controls, time=1, qpos=qpos, qvel=qvel, act=act + sum(behind))

    def _controls(self, time: float, readings: Floats) -> Values:
        values, first = self._all_controls((time,), *self._seen(readings)), self._varied.model.nu
        for number, own in enumerate(self._commanded):
            self._commanded[number] = values[first : first + len(own)]
            first += len(own)
        return values[: self._varied.model.nu]

    def rates(self, time: float, state: Floats) -> Floats:
        data, _, accelerations, _ = self._forward(time, state)
        rates = np.concatenate((data.qvel, accelerations, data.act_dot))
        return self._hanging.moved(rates, self._hanging.of_rates, -1.0)

    def _forward(self, time: float, state: Floats) -> tuple[Any, Floats, Floats, Floats]:
        """MuJoCo's data, tensions of the cables (N), accelerations, and readings of the sensors.

        A controller reads the forces of the last step, here of this instant.
        """
        model, data = self._varied.model, self._set(state)
        limited, tensions = model.tendon_limited.copy(), np.zeros(len(self._hanging.tendons))
        data.qacc_warmstart[:] = 0.0
        readings = np.zeros(model.nhistory)
        for _ in range(READINGS):
            data.ctrl[:] = self._controls(time, readings)
            model.tendon_limited[:] = 0  # `Hanging` holds the objects instead
            with control_callback(None):
                mujoco.mj_forward(model, data)
            model.tendon_limited[:] = limited
            before, readings = readings, self._readings(tensions)
            if np.abs(readings - before).max(initial=0.0) <= 1e-12:
                break
        accelerations, tensions = self._hanging.hold(data)
        return data, tensions, accelerations, self._readings(tensions)

    def limited(self, state: Floats) -> Floats:
        model, parts = self._varied.model, self._split(state)
        own = model.actuator_actadr[model.actuator_actlimited > 0]
        low, high = model.actuator_actrange[model.actuator_actlimited > 0].T
        activations = parts[-1].copy()
        activations[own] = np.clip(activations[own], low, high)
        return np.concatenate((*parts[:-1], activations))

    def _whole(self, step: int, state: Floats) -> Floats:
        whole = self._first.copy()
        whole[self._part] = self._whole_part(state, self._stretched)
        if self.scenario.object:
            readings = self._forward(step * self.scenario.simulation.timestep, state)[3]
            memory = whole[self._part.stop :][: len(readings)]
            memory[readings != 0.0] = readings[readings != 0.0]
        header = whole[self._varied.header_offset :][:HEADER_SIZE]
        header[EVALUATIONS] = step * header[EVALUATIONS_PER_STEP]
        return whole

    def observed(self, time: float, state: Floats) -> Floats:
        data, _, _, readings = self._forward(time, state)
        return np.array(self.assembly.loop.observe(*self._seen(readings), data.ctrl.tolist()))


def make_motion(scenario: Scenario, engine: EngineName | None = None, late: bool = False) -> Motion:
    """The motion of a scenario on the plant that it requests; see `Motion`."""
    kind = MujocoMotion if scenario.simulation.plant == "mujoco" else EquationMotion
    return kind(scenario, engine, late)
