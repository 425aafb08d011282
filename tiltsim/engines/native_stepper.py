"""Compiled integration of the equations of motion."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numba import njit
from numba.extending import register_jitable

from tiltsim.closed_loop.loop import ClosedLoop
from tiltsim.engines.cache import (
    announce_native_code,
)
from tiltsim.engines.numba_setup import _INNER, _OPTIONS, _register_scalar_functions, watch_nothing
from tiltsim.engines.recorder import _record, _recording_is_over
from tiltsim.equations.ode3 import make_stepper
from tiltsim_controllers.mathematics.records import record_dtype
from tiltsim_controllers.mathematics.scalar import Floats


@cache
def compile_stepper(loop: ClosedLoop) -> tuple[Any, Any]:
    """Compile the thesis plant's solver for a loop, or load it from the cache on disk.

    Returns ``(advance, record)``. The first takes and returns what
    `tiltsim.equations.ode3.make_stepper` says, but for the state, which is an array. The second
    takes in front of that the address of a `Recorder` and a number of samples; it stops where
    recording is over. Neither holds Python's lock.
    """
    announce_native_code(loop.native_name("thesis"))
    _register_scalar_functions()
    assert loop.equations is not None
    inputs, observe = loop.equations.inputs, loop.equations.observe
    watch = loop.watch or watch_nothing
    limit_exceeded = loop.kind.limit_exceeded
    stepper = register_jitable(**_INNER)(make_stepper(loop.equations))

    @njit(nogil=True, **_OPTIONS)
    def advance(  # type: ignore[no-untyped-def]
        step_index, state, held, timestep, steps, control_steps, parameters, knots, disturbance
    ):
        values, held = stepper(
            *(step_index, list(state), held, timestep, steps),
            *(control_steps, parameters, knots, disturbance),
        )
        return np.array(values), held

    @njit(nogil=True, **_OPTIONS)
    def record(  # type: ignore[no-untyped-def]
        recorder,
        samples,
        step_index,
        state,
        held,
        timestep,
        steps,
        control_steps,
        parameters,
        knots,
        disturbance,
    ):
        values = list(state)
        for _ in range(samples):
            values, held = stepper(
                *(step_index, values, held, timestep, steps),
                *(control_steps, parameters, knots, disturbance),
            )
            step_index += steps
            time = step_index * timestep
            force = held
            if control_steps == 0 or step_index % control_steps == 0:
                force = inputs(time, values, parameters, knots)
            seen = observe(time, values, force, parameters, knots)
            watched = watch(seen, parameters)
            _record(recorder, time, seen, watched, limit_exceeded, knots)
            if _recording_is_over(recorder):
                break
        return np.array(values), held

    return advance, record


def native_record(loop: ClosedLoop, userdata: Floats) -> tuple[Any, Floats]:
    """The parameter record and the knots of a flight as compiled code reads them."""
    head = loop.record_size
    return userdata[:head].view(record_dtype(loop.parameters))[0], userdata[head:]
