"""Compiled integration of the equations of motion."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop
from tiltsim.engines.cache import announce_native_code
from tiltsim.engines.compiling import callable_natively, compiled, register_scalar_functions
from tiltsim.engines.recorder import record_sample, recording_is_over
from tiltsim.equations.solvers import make_stepper
from tiltsim.system.locks import one_thread_at_a_time
from tiltsim_controllers.mathematics.records import record_dtype
from tiltsim_controllers.mathematics.scalar import Floats


@one_thread_at_a_time
@cache
def compile_stepper(loop: ClosedLoop, plant: str, solver: str) -> Any:
    """Compile a solver of a loop's equations, or load it from the cache on disk.

    Args:
        loop: A closed loop with equations.
        plant, solver: As in `tiltsim.closed_loop.loop.ClosedLoop.native_name`.

    Returns:
        ``(recorder, samples, step_index, state, held, steps, integration) -> state, held``: the
        stepper of `tiltsim.equations.solvers.make_stepper` with an array for the state, so many
        times over. ``recorder`` is the address of a `Recorder`, which takes a sample after each
        time and stops when the recording is over; 0 for none. Python's lock is not held.
    """
    announce_native_code(loop.native_name(plant, solver))
    assert loop.equations is not None
    stepper = make_stepper(loop.equations, solver)  # defines a scalar function
    register_scalar_functions()
    callable_natively(stepper)
    inputs, observe = loop.equations.inputs, loop.equations.observe
    watch = loop.monitoring.sign_check_values
    limit_exceeded = loop.kind.limit_exceeded

    # One function with and without a recorder: each would compile the whole loop.
    @compiled
    def advance(  # type: ignore[no-untyped-def]
        recorder, samples, step_index, state, held, steps, integration
    ):
        timestep, control_steps, parameters, knots, _ = integration
        values = list(state)
        for _ in range(samples):
            values, held = stepper(step_index, values, held, steps, integration)
            step_index += steps
            if recorder == 0:
                continue
            time = step_index * timestep
            force = held
            if control_steps == 0 or step_index % control_steps == 0:
                force = inputs(time, values, parameters, knots)
            sample = observe(time, values, force, parameters, knots)
            checked = watch(time, sample, parameters, knots)
            record_sample(recorder, time, sample, checked, limit_exceeded, knots)
            if recording_is_over(recorder):
                break
        return np.array(values), held

    return advance


def native_record(loop: ClosedLoop, userdata: Floats) -> tuple[Any, Floats]:
    """The parameter record and the knots of a flight as compiled code reads them."""
    head = loop.record_size
    return userdata[:head].view(record_dtype(loop.parameters))[0], userdata[head:]
