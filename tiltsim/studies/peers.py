"""Other simulators of quadrotors, each timed in a separate process."""

import os
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from time import perf_counter, process_time
from typing import Any, Final, NamedTuple

from tiltsim.errors import InputError
from tiltsim.system.processes import answer, begin, give

Description = dict[str, Any]
Timing = Sequence[float]  # seconds on the clock, and of all processor cores
Setup = Callable[[int, int], tuple[Description, Callable[[], None]]]


def timed(fly: Callable[[], object]) -> Timing:
    """Call a function."""
    wall, cpu = perf_counter(), process_time()
    fly()
    return perf_counter() - wall, process_time() - cpu


def speed(timings: Sequence[Timing], steps: int, timestep: float) -> dict[str, Any]:
    """Columns of a row from the best timing but the first, which compiles; time step in s."""
    (first, _), *others = timings
    wall, cpu = map(min, zip(*others, strict=True))
    return {
        "steps_per_second": steps / wall,
        "steps_per_cpu_second": steps / cpu,
        "ratio": None,
        "realtime_factor": steps * timestep / wall,
        "timestep": timestep,
        # A cached program loads in less time than flights differ by.
        "compile_seconds": max(first - wall, 0.0),
    }


def _crazyflow(vehicles: int, steps: int) -> tuple[Description, Callable[[], None]]:
    """Its cascade of controllers holds a position; all else as by default, control every step."""
    import crazyflow
    import jax
    import numpy as np
    from crazyflow.sim.sharding import world_mesh

    devices = jax.devices()
    mesh = world_mesh(devices) if len(devices) > 1 else None
    simulator = crazyflow.Sim(n_worlds=vehicles, control="state", mesh=mesh)
    command = np.zeros((vehicles, 1, 16), np.float32)
    command[..., 2], command[..., 12] = 0.5, 1.0  # m; no rotation
    simulator.state_control(command)

    def fly() -> None:
        simulator.step(steps)
        jax.block_until_ready(simulator.data)

    return {
        "simulator": f"crazyflow {crazyflow.__version__}",
        "integrator": str(simulator.integrator),
        "precision": str(simulator.data.states.pos.dtype),
        "timestep": 1.0 / simulator.freq,
        "threads": len(devices),
    }, fly


def _rotorpy(vehicles: int, steps: int) -> tuple[Description, Callable[[], None]]:
    """One Hummingbird under its geometric controller; an adaptive solver between commands."""
    from importlib.metadata import version

    import numpy as np
    from rotorpy.controllers.quadrotor_control import SE3Control
    from rotorpy.trajectories.hover_traj import HoverTraj
    from rotorpy.vehicles.hummingbird_params import quad_params
    from rotorpy.vehicles.multirotor import Multirotor

    vehicle, controller, goal = Multirotor(quad_params), SE3Control(quad_params), HoverTraj()
    timestep = 0.01

    def fly() -> None:
        state = vehicle.initial_state
        for step in range(steps):
            time = step * timestep
            state = vehicle.step(state, controller.update(time, state, goal.update(time)), timestep)
        assert np.isfinite(state["x"]).all()

    return {
        "simulator": f"rotorpy {version('rotorpy')}",
        "integrator": "RK45",
        "precision": "float64",
        "timestep": timestep,
        "threads": 1,
    }, fly


class PeerCase(NamedTuple):
    """The flights of a peer that are timed."""

    setup: Setup
    vehicles: int
    steps: int
    devices: tuple[int, ...] = (1,)  # of JAX, each with a core


CORES: Final = os.cpu_count() or 1

PEERS: Final = {
    "crazyflow": PeerCase(_crazyflow, 1024, 500, tuple(sorted({1, CORES}))),
    "rotorpy": PeerCase(_rotorpy, 1, 100),
}
"""By the name of the package."""


class Peer:
    """A peer in a separate process, which flies on request; see `running`."""

    def __init__(self, name: str, process: BaseProcess, connection: Connection) -> None:
        self.name, self.case = name, PEERS[name]
        self._process, self._connection = process, connection
        self.timings: list[Timing] = []
        self.description: Description = self._answer("describe")

    def _answer(self, request: str) -> Any:
        give(self._connection, request)
        future = answer(self._connection, self._process)
        if (error := future.exception()) is not None:
            raise InputError(f"--peer {self.name}: it failed: {error!r}") from error
        return future.result()

    def time(self) -> None:
        """Fly once."""
        self.timings.append(self._answer("fly"))

    def row(self) -> dict[str, Any]:
        """A row as in ``tiltsim bench --json``."""
        steps, timestep = self.case.vehicles * self.case.steps, self.description["timestep"]
        return {
            "case": "peer",
            "engine": self.name,
            "vehicles": self.case.vehicles,
            **self.description,
            **speed(self.timings, steps, timestep),
        }


class _Flyer:
    """The work of a peer's process: to describe it, which prepares it, and then to fly."""

    _fly: Callable[[], None]

    def __init__(self, name: str, devices: int) -> None:
        self._name, self._devices = name, devices

    def __call__(self, request: str) -> Description | Timing:
        if request == "fly":
            return timed(self._fly)
        os.dup2(2, 1)  # text that the peer prints is no result
        warnings.simplefilter("ignore")
        # Without the option of our command line, which makes crazyflow slower.
        flags = f"--xla_force_host_platform_device_count={self._devices}"
        os.environ |= {"SCIPY_ARRAY_API": "1", "XLA_FLAGS": flags}
        case = PEERS[self._name]
        description, self._fly = case.setup(case.vehicles, case.steps)
        return description


@contextmanager
def running(name: str, devices: int = 1) -> Iterator[Peer]:
    """A peer, ready to fly. Raises `InputError` if it is not installed or fails."""
    if find_spec(name) is None:
        raise InputError(f"--peer {name}: not installed; python -m pip install {name}")
    process, connection = begin(_Flyer(name, devices))
    try:
        yield Peer(name, process, connection)
    finally:
        process.kill()
        process.join()
