"""Calls of scalar functions as they occur in flights, to be repeated on arrays."""

from __future__ import annotations

import sys
from collections import defaultdict
from dataclasses import replace
from types import SimpleNamespace

import numpy as np

import tiltsim
from tests.laws.layers.test_actuation import EVERYTHING
from tests.laws.layers.test_air import STORM
from tests.laws.test_laws import LAWS
from tests.laws.test_multirotor import ASIDE, CLIMB, HELD, PRIORITIZED, TILTS, WEAK, document
from tests.simulation.test_batch import EXACT
from tiltsim.laws.assembling import assemble
from tiltsim.scenario.loading import merge
from tiltsim.simulation.simulate import simulate_assembly
from tiltsim_controllers.mathematics.records import record_size, unflatten
from tiltsim_controllers.mathematics.scalar import scalar_functions

LATE = {"control_timestep": 0.004, "control_latency": 0.008}
SUPERVISED = {
    strategy: {
        "controller": {**EXACT, "supervisor": {"strategy": strategy, "min_margin": 1.2}},
        "gait": {"type": "trot_continuous", "amplitude": 0.9, "period": 1.0},
    }
    for strategy in ("scale", "hold", "return_to_red")
}
HINGED = {"vehicle": {"rotor_inertia": 1e-5}}
HEAVY = {"rotor_time_constant": 0.02, "rotor_inertia": 1e-5}
MEASURED = {"angular_acceleration": "measured"}
MODEL = {"angular_acceleration": "model"}
LAYERED = {
    "yaw_position in air": {**LAWS["yaw_position"], "air": STORM},
    "full_pose in air": {**LAWS["full_pose"], "air": STORM},
    "full_pose without rotor 2": merge(
        LAWS["full_pose"], {"controller": {"failed_rotor": 2}, "vehicle": HEAVY}
    ),
} | {
    f"{kind} {name}": merge(LAWS[name], tables)
    for name in ("attitude_altitude", "gait_feedforward")
    for kind, tables in {
        "everything": {**EVERYTHING, "air": STORM},
        "heavy": {"vehicle": HEAVY},
        "measured": {"vehicle": HEAVY, "controller": MEASURED},
    }.items()
}
"""Controllers inside layers."""

REFERENCES = {
    "line": {"velocity": [0.5, 0.0, 0.1]},
    "circle": {"radius": 1.0, "angular_frequency": 0.5},
    "attitude_altitude": {"roll": 0.1, "altitude": 0.2},
    "lissajous": {"amplitude": [1.0, 0.5, 0.1], "angular_frequency": [0.5, 0.7, 0.2]},
    "figure_eight": {"length": 1.0, "width": 0.5, "angular_frequency": 0.6},
    "waypoints": {"positions": [[0, 0, 0], [1, 0, 0], [1, 1, 0.2]], "times": [0.0, 2.0, 4.0]},
    "table": {"rows": [[0, 0, 0, 0], [1, 0.2, 0, 0], [2, 0.3, 0.1, 0], [3, 0.3, 0.2, 0.1]]},
}
"""References by type."""


MULTIROTORS = {
    "leaning": document("hexarotor"),
    "euler angles": document(
        "hexarotor", controller={"law": "attitude_force", "attitude_error": "euler_angles"}
    ),
    "tilting": document("tilt_hexarotor", gait=TILTS),
    "supervised": document("tilt_hexarotor", gait=ASIDE, controller={**HELD, **MODEL}),
    "within limits": document("hexarotor", WEAK, controller=PRIORITIZED, **CLIMB),
    "by thrust": document(
        "cant_hexarotor", controller={"law": "attitude_force", "norm": "thrust", "failed_rotor": 1}
    ),
    "heavy rotors": merge(document("tilt_hexarotor", gait=TILTS), {"vehicle": HEAVY}),
    "turning over": document(
        "omni_octorotor",
        controller={"law": "attitude_force", "norm": "thrust", "turn_time": 2.0},
        reference={"type": "setpoint", "roll": 0.5},
    ),
}
for _tables in MULTIROTORS.values():
    _tables.pop("simulation", None)
"""The controller of multirotors."""


def flown(tables, **simulation):
    """A short flight that calls the scalar functions themselves, as a traced program does not."""
    simulation = {"duration": 0.02, "engine": "python", "record_timestep": 0.01, **simulation}
    scenario = tiltsim.parse_scenario({**tables, "simulation": simulation})
    return simulate_assembly(replace(assemble(scenario), traced=False))


def called_rows(row, _width, time, states, user):
    """In place of `tiltsim.engines.sample_evaluation._in_python`, for the same reason."""
    numbers, size = user.tolist(), record_size(row.record)
    setup = unflatten(row.record, numbers), tuple(numbers[size:])
    return np.array([row.function(t, s, *setup) for t, s in zip(time.tolist(), states.tolist())])


def record(action, calls):
    """Add the arguments of the first call of each scalar function by an action."""
    known, by_code, read = {}, defaultdict(list), 0

    def functions_of(code):
        """Functions with this code object; generated ones may have equal but separate code."""
        nonlocal read
        functions = scalar_functions()
        for function in functions[read:]:  # the flight makes others
            by_code[id(function.__code__)].append(function)
        read = len(functions)
        return by_code[id(code)]

    def notice(frame, event, _argument):
        code = frame.f_code
        if event != "call" or "tiltsim" not in code.co_filename:
            return
        if code not in known:
            known[code] = [*functions_of(code)]
            if all(function in calls for function in known[code]):
                known[code] = []
        if not known[code]:
            return
        here = frame.f_locals
        for function in known[code]:
            cells = [cell.cell_contents for cell in function.__closure__ or ()]
            if all(here.get(n) is c for n, c in zip(code.co_freevars, cells)):
                arguments = [here[name] for name in code.co_varnames[: code.co_argcount]]
                if function not in calls and not any(map(of_many_samples, arguments)):
                    calls[function] = tuple(map(frozen, arguments))
                return

    sys.setprofile(notice)
    try:
        action()
    finally:
        sys.setprofile(None)


def of_many_samples(argument):
    """Whether NumPy's arrays are where one sample has numbers, as in the analysis of a flight."""
    if isinstance(argument, np.ndarray):
        return argument.ndim > 1
    return isinstance(argument, tuple) and any(
        isinstance(entry, np.ndarray) or of_many_samples(entry) for entry in argument
    )


def frozen(value):
    """An argument that later code cannot change, of Python's own numbers."""
    return mapped(lambda number, _: number, value)


def mapped(change, value, name=""):
    """A value with every number changed by ``change(number, name of its field)``."""
    if hasattr(value, "_fields"):
        return type(value)(*(mapped(change, v, n) for n, v in zip(value._fields, value)))
    if hasattr(value, "tolist"):  # arrays of NumPy or JAX
        return mapped(change, value.tolist(), name)
    if hasattr(value, "__slots__") and not isinstance(value, tuple | list | float | int):
        return SimpleNamespace(**{n: mapped(change, getattr(value, n), n) for n in value.__slots__})
    if isinstance(value, tuple | list):
        return type(value)(mapped(change, v, name) for v in value)
    return change(value, name)


def described(function):
    """Key that distinguishes a scalar function from closures of one source.

    Not the functions that it calls: each of them is described on its own.
    """
    cells = [cell.cell_contents for cell in function.__closure__ or ()]
    return function.__code__, *(repr(cell) for cell in cells if not callable(cell))
