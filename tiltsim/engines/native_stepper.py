"""Integration of the equations of motion as machine code."""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any

import numpy as np

from tiltsim.closed_loop.choices import ProgramKey
from tiltsim.engines.glue import RECORDER, STEPPER, filled
from tiltsim.engines.machine_code import MachineCode
from tiltsim.engines.programs import HEAD_SIZE, SIDES, LoopPrograms
from tiltsim.engines.recorder import Recorder
from tiltsim.system.locks import one_thread_at_a_time
from tiltsim_controllers.code.llvm_text import llvm_functions
from tiltsim_controllers.mathematics.scalar import Floats, Triple


@one_thread_at_a_time
@cache
def _compile(key: ProgramKey, states: int, solver: str, held: bool) -> Any:
    kind = "held" if held else "sampled"
    glue = filled(
        STEPPER + RECORDER,
        step_held=f"step_{kind}",
        sample_held=f"sample_{kind}",
        width=len(key.loop.sample_fields),
        rows_at=HEAD_SIZE + SIDES,
    )
    programs = LoopPrograms(key).on_equations(states, solver, held)
    code = MachineCode(llvm_functions(programs) + glue)
    return code.function("advance", None, *[ctypes.c_int64] * 3, *[ctypes.c_void_p] * 5)


class NativeStepper:
    """Integrates the equations of a flight.

    Args:
        key: Of its programs.
        states: Number of states.
        solver: See `tiltsim.equations.solvers.SOLVERS`.
        timestep: s.
        control_steps: Steps for which the inputs are held; 0: evaluated at every stage.
        user: Parameters and knots, see `tiltsim.closed_loop.loop.ControlSetup.userdata`.
        disturbance: m/s^2, world axes.
    """

    def __init__(
        self,
        key: ProgramKey,
        states: int,
        solver: str,
        timestep: float,
        control_steps: int,
        user: Floats,
        disturbance: Triple,
    ) -> None:
        self._advance = _compile(key, states, solver, control_steps > 0)
        self._every = control_steps or 1
        self._settings = np.array([timestep, *disturbance])
        self._user = np.ascontiguousarray(user)

    def advance(
        self, step_index: int, now: Floats, samples: int, steps: int, recorder: Recorder | None
    ) -> int:
        """Integrate some intervals; a recorder takes a sample after each and may stop it early.

        Args:
            step_index: Number of steps so far.
            now: State and inputs in force, shape (states + inputs,); changed in place.
            samples: Number of intervals.
            steps: Steps of an interval.
            recorder: Takes samples, or None.

        Returns:
            The number of steps so far.
        """
        index = np.array([float(step_index)])
        memory = None if recorder is None else int(recorder.address)
        arrays = (index, now, self._settings, self._user)
        self._advance(samples, steps, self._every, *(a.ctypes.data for a in arrays), memory)
        return int(index[0])
