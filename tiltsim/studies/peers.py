"""Other simulators of quadrotors, each timed in a separate process."""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from time import perf_counter, process_time
from typing import Any, Final, NamedTuple

from tiltsim.errors import InputError

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

    def __init__(self, name: str, process: subprocess.Popen[str]) -> None:
        assert process.stdin is not None
        assert process.stdout is not None
        self.name, self.case = name, PEERS[name]
        self._requests, self._answers = process.stdin, process.stdout
        self.timings: list[Timing] = []
        self.description: Description = self._answer()

    def _answer(self) -> Any:
        line = self._answers.readline()
        if not line:
            raise InputError(f"--peer {self.name}: it failed; its message is above")
        return json.loads(line)

    def time(self) -> None:
        """Fly once."""
        self._requests.write("fly\n")
        self._requests.flush()
        self.timings.append(self._answer())

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


@contextmanager
def running(name: str, devices: int = 1) -> Iterator[Peer]:
    """A peer, ready to fly. Raises `InputError` if it is not installed or fails."""
    if find_spec(name) is None:
        raise InputError(f"--peer {name}: not installed; python -m pip install {name}")
    # Without the option of our command line, which makes crazyflow slower.
    flags = f"--xla_force_host_platform_device_count={devices}"
    with subprocess.Popen(
        [sys.executable, "-W", "ignore", "-m", __name__, name],
        env=os.environ | {"SCIPY_ARRAY_API": "1", "XLA_FLAGS": flags},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,  # keeps Ctrl-C from it
    ) as process:
        try:
            yield Peer(name, process)
        finally:
            process.kill()


def _serve(name: str) -> None:
    """Fly whenever a line comes in; print the timing."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # text that the peer prints is no answer
    case = PEERS[name]
    description, fly = case.setup(case.vehicles, case.steps)
    print(json.dumps(description), file=answers, flush=True)
    for _ in sys.stdin:
        print(json.dumps(timed(fly)), file=answers, flush=True)


if __name__ == "__main__":
    _serve(sys.argv[1])
