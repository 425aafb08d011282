"""MuJoCo as the plant: the model that a flight integrates, its start and its steps."""

from collections.abc import Sequence
from functools import cache, partial
from itertools import pairwise
from math import nan
from typing import Final

import mujoco
import numpy as np

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.closed_loop.userdata import (
    CONTROL_PERIOD,
    EVALUATIONS,
    HEADER_SIZE,
    RECORDER,
    TIMESTEP,
    Header,
    evaluation_time,
    steps_taken,
)
from tiltsim.engines.base import EngineName, vectors_of
from tiltsim.engines.control import control_callback, control_step, make_callback
from tiltsim.engines.programs import Recorder
from tiltsim.errors import InputError
from tiltsim.models.cables import switch
from tiltsim.models.parts import Visuals
from tiltsim.plants.plant import Plant, choose_engine
from tiltsim.scenario.interaction import objects_of
from tiltsim.scenario.scenario import Scenario
from tiltsim.scenario.scenario_tables import DESCRIPTIVE
from tiltsim.vehicles.rotorcraft.others import motion_at_start
from tiltsim_controllers.mathematics.scalar import Floats

_TABLES_WITHOUT_EFFECT: Final = frozenset(
    (*DESCRIPTIVE, "simulation", "initial", "gait", "reference", "sensors")
)
"""Tables of a scenario that do not change the model, except for two keys of ``simulation``."""


def flight_model(
    assembly: Assembly, knots: int | None = None, *, visuals: bool = False
) -> mujoco.MjModel:
    """The model that a flight integrates; see `build_model`.

    With ``visuals`` the flight is equal bit for bit and the model also has drawn and measured
    parts, unless there is something to touch.
    """
    visuals = visuals and not assembly.scenario.has_contacts
    model = build_model(assembly, knots=knots, visuals=visuals)
    if visuals:
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    # A diverged state must stay visible; by default MuJoCo would silently start over.
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    return model


def model_cache_key(scenario: Scenario) -> str:
    """Equal only for scenarios whose models are equal, provided that they fly the same loop."""
    simulation = scenario.simulation
    tables = [value for name, value in scenario if name not in _TABLES_WITHOUT_EFFECT]
    return repr((tables, simulation.timestep, simulation.integrator))


def evaluations_per_step(model: mujoco.MjModel) -> int:
    """Number of evaluations of the controls per step of MuJoCo's integrator."""
    return 4 if model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4 else 1


def build_model(
    assembly: Assembly, *, knots: int | None = None, visuals: Visuals = False
) -> mujoco.MjModel:
    """Compile the vehicle of a flight. Raises `InputError` if MuJoCo cannot.

    Args:
        assembly: The flight.
        knots: Room for knots in ``userdata``, where several flights share the model; default: its
            own.
        visuals: Whether the model has the parts that are only drawn; see `Visuals`.
    """
    loop, scenario = assembly.loop, assembly.scenario
    size = HEADER_SIZE + loop.record_size + (len(assembly.setup.knots) if knots is None else knots)
    try:
        model = loop.kind.compile(
            scenario, loop.controller_states, loop.extra_actuators, size, visuals
        )
    except ValueError as error:
        raise InputError(f"{scenario.address or 'scenario'}: vehicle: {error}") from error
    model.opt.gravity += scenario.disturbance_acceleration
    return model


OVERLAP: Final = 1e-4  # depth (m) from which shapes count as lying in each other


def check_start(scenario: Scenario, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Refuse an overlap.

    Raises:
        InputError: In one line, if an object lies in another thing, or the tool in a rotor.
    """
    where = scenario.address or "scenario"
    for contact in data.contact:
        if contact.dist < -OVERLAP:
            names = sorted(_name(model, geom) for geom in (contact.geom1, contact.geom2))
            raise InputError(
                f"{where}: {names[0]} and {names[1]} overlap by {-contact.dist:.3g} m at the "
                "start; move one of them"
            )
    for table in scenario.cable:
        tendon = model.tendon(table.name)
        apart = float(data.ten_length[tendon.id])
        if table.start == 0.0 and apart > table.length + OVERLAP:
            raise InputError(
                f"{where}: cable {table.name}: its ends are {apart:.4g} m apart at the start, and "
                f"cable.length = {table.length:g}"
            )
    prefixes = ("", *(f"{table.name}_" for table in scenario.companion))
    for prefix, each in zip(prefixes, (scenario, *scenario.companions), strict=True):
        rotor = None if each.tool is None else _touched_rotor(model, data, prefix)
        if rotor is not None:
            raise InputError(
                f"{where}: tool: touches {rotor} of its own vehicle; change tool.position, "
                "tool.direction or tool.length"
            )


def _touched_rotor(model: mujoco.MjModel, data: mujoco.MjData, prefix: str) -> str | None:
    """A rotor that the tool of a vehicle touches, the names of whose parts have a prefix."""
    tool = model.geom(f"{prefix}tool_collision").id
    for geom in range(model.ngeom):
        name = model.geom(geom).name
        turns = name.startswith((f"{prefix}pod_", f"{prefix}rotor_")) and name.endswith("collision")
        if turns and mujoco.mj_geomDistance(model, data, tool, geom, 1.0, np.zeros(6)) < 0.0:
            return str(name.removesuffix("_collision"))
    return None


def _name(model: mujoco.MjModel, geom: int) -> str:
    """A geom by its body, as scenarios name it."""
    name = model.body(model.geom_bodyid[geom]).name
    if name.startswith("object_"):
        return f"object {name.removeprefix('object_')}"
    if name.endswith("_vehicle"):
        return f"companion {name.removesuffix('_vehicle')}"
    return {"world": "the ground", "vehicle": "the vehicle"}.get(name, name)


class MujocoPlant(Plant):
    """The compiled MJCF model in MuJoCo, with the control step in its control callback.

    Args:
        assembly: The flight.
        model: Its model; default: the one that `flight_model` compiles.
        engine: Default: the one that the scenario requests.
    """

    def __init__(
        self,
        assembly: Assembly,
        model: mujoco.MjModel | None = None,
        engine: EngineName | None = None,
    ) -> None:
        self._assembly, self._loop, self._setup = assembly, assembly.loop, assembly.setup
        self.model = flight_model(assembly) if model is None else model
        self.data = mujoco.MjData(self.model)
        self._evaluations_per_step = evaluations_per_step(self.model)
        self._set_initial_state()
        self.engine: EngineName = choose_engine(assembly, engine)
        self._read_parameters()
        self._prepare_engine()

    def _set_initial_state(self) -> None:
        assembly, data = self._assembly, self.data
        simulation, per_step = assembly.scenario.simulation, self._evaluations_per_step
        data.userdata[:HEADER_SIZE] = Header(
            timestep=simulation.timestep,
            evaluations_per_step=per_step,
            control_period=per_step * simulation.control_steps,
        )
        parameters = self._setup.userdata  # a shared model may have room for more
        data.userdata[HEADER_SIZE : HEADER_SIZE + len(parameters)] = parameters
        sizes = self._loop.sizes
        motion = self._loop.kind.initial_motion(assembly)
        data.qpos[: sizes.qpos], data.qvel[: sizes.qvel] = motion
        if assembly.scenario.has_objects:
            others = motion_at_start(assembly)
            data.qpos[sizes.qpos :], data.qvel[sizes.qvel :] = others
        data.act[:] = self._loop.initial_activations(assembly, self._setup)
        objects = objects_of(assembly.scenario)
        self._cables = () if objects is None else objects.cables
        self._switches = {s for c in self._cables for s in c.switches(simulation.timestep)}
        switch(self.model, self._cables, 0.0)
        with control_callback(None):
            mujoco.mj_forward(self.model, data)
        if assembly.scenario.has_objects or assembly.scenario.companion:
            check_start(assembly.scenario, self.model, data)

    @property
    def time(self) -> float:
        return self.steps_taken * float(self.data.userdata[TIMESTEP])

    @property
    def steps_taken(self) -> int:
        """Physics steps since time zero."""
        return steps_taken(self.data.userdata[:HEADER_SIZE])

    @property
    def state(self) -> Floats:
        """MuJoCo's integration state, the parameters in userdata included."""
        values = np.empty(mujoco.mj_stateSize(self.model, _INTEGRATION))
        mujoco.mj_getState(self.model, self.data, values, _INTEGRATION)
        return values

    @state.setter
    def state(self, value: Floats) -> None:
        mujoco.mj_resetData(self.model, self.data)  # clears the warnings
        mujoco.mj_setState(self.model, self.data, value, _INTEGRATION)
        switch(self.model, self._cables, self.time)
        with control_callback(None):
            mujoco.mj_forward(self.model, self.data)
        self._read_parameters()
        self._prepare_engine()

    def _read_parameters(self) -> None:
        """Bind the parameters in ``userdata`` to the functions of the loop, by name."""
        user = self.data.userdata[HEADER_SIZE:].tolist()
        self._evaluate = cache(partial(control_step, self._assembly, user))

    def _prepare_engine(self) -> None:
        """Build the engine, which reads the parameters in ``userdata`` once."""
        self.callback = make_callback(self.engine, self._assembly, self.model, self.data)

    def advance(self, steps: int) -> None:
        with control_callback(self.callback):
            self._step(steps)

    def _step(self, steps: int) -> None:
        """Take physics steps, between which cables begin to hold and release."""
        first = self.steps_taken
        inside = sorted(step for step in self._switches if first < step < first + steps)
        for begin, end in pairwise((first, *inside, first + steps)):
            switch(self.model, self._cables, begin * self._assembly.scenario.simulation.timestep)
            mujoco.mj_step(self.model, self.data, nstep=end - begin)

    @property
    def evaluation_time(self) -> float:
        """Time (s) for the next evaluation of the control step."""
        timestep, per_step, _, evaluations, _ = self.data.userdata[:HEADER_SIZE].tolist()
        return evaluation_time(evaluations, per_step, timestep)

    @property
    def header_offset(self) -> int:
        """Index in `state` at which the `tiltsim.closed_loop.userdata.Header` begins."""
        before = int(mujoco.mjtState.mjSTATE_USERDATA) - 1
        return int(mujoco.mj_stateSize(self.model, _INTEGRATION & before))

    def record(self, samples: int, steps: int) -> Floats:
        evaluations = steps * self._evaluations_per_step
        checked = self._checks(self.time, self.observe())[1:]
        recorder = Recorder(self._assembly, samples, evaluations, checked)
        self.data.userdata[RECORDER] = recorder.address
        try:
            self.advance(samples * steps)
        finally:
            self.data.userdata[RECORDER] = 0.0
        if recorder.terminated or self.fault():
            return recorder.samples
        return np.vstack([recorder.samples, (self.time, *self.observe())])

    def observe(self) -> tuple[float, ...]:
        data, state = self.data, vectors_of(self._loop, self.data).lists()
        # MuJoCo keeps the controls of its last integrator stage.
        period = data.userdata[CONTROL_PERIOD]
        stale = period == 0.0 or data.userdata[EVALUATIONS] % period == 0.0
        reads_controls = self._loop.observe_reads_controls
        ctrl = self.controls(*state) if reads_controls and stale else data.ctrl.tolist()
        header = data.userdata[:HEADER_SIZE].tolist()
        try:
            return tuple(self._evaluate("observe")(header, *state, ctrl))
        except (ArithmeticError, ValueError):
            return (nan,) * (len(self._loop.sample_fields) - 1)

    def controls(self, *vectors: Sequence[float]) -> Sequence[float]:
        """The controls for a state (`Vectors`) at the present time; NaN where there are none."""
        header = self.data.userdata[:HEADER_SIZE].tolist()
        try:
            return self._evaluate("controls")(header, *vectors, ())
        except (ArithmeticError, ValueError):
            return [nan] * len(self.data.ctrl)

    def fault(self) -> str:
        """MuJoCo resets an unstable state silently but counts its warnings."""
        for warning, text in _WARNINGS.items():
            if self.data.warning[warning].number:
                return text
        return ""


_INTEGRATION: Final = int(mujoco.mjtState.mjSTATE_INTEGRATION)
# MuJoCo checks the state first, and a control law cannot do anything with a bad one.
_WARNINGS: Final = {
    mujoco.mjtWarning.mjWARN_BADQPOS: "positions are NaN or beyond 1e10",
    mujoco.mjtWarning.mjWARN_BADQVEL: "velocities are NaN or beyond 1e10",
    mujoco.mjtWarning.mjWARN_BADCTRL: "the control law returned NaN or a value beyond 1e10",
    mujoco.mjtWarning.mjWARN_BADQACC: "accelerations are NaN or beyond 1e10",
}
