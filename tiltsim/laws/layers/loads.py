"""Forces and torques at a time and a point around any rotorcraft: a layer that adds them.

They act through six actuators on the body, force and torque in body axes, which only models with
loads have.
"""

from functools import cache
from math import inf
from typing import Any, Final

import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup
from tiltsim.engines.sample_evaluation import evaluate_over_samples
from tiltsim.laws.layers.layer import Layer, Samples, wrap_loop
from tiltsim.models.parts import ExtraActuators
from tiltsim.scenario.surroundings import Force, Torque
from tiltsim.vehicles.rotorcraft.layout import QW, TILT_1
from tiltsim_controllers.code.traceable import traceable
from tiltsim_controllers.mathematics.attitude import rotation_matrix, rotation_of_quaternion
from tiltsim_controllers.mathematics.records import make_record_type
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.loads import Load, wrench_of_loads

LOAD_COLUMNS: Final = tuple(f"load_{kind}_{axis}" for kind in ("force", "torque") for axis in "xyz")


@cache
def with_loads(loop: ClosedLoop, count: int) -> ClosedLoop:
    """A loop on whose vehicle a number of loads act."""
    record = make_record_type("Loads", **{f"load_{i + 1}": Load for i in range(count)})

    def forces(time: Any, qpos: Any, qvel: Any, act: Any, ctrl: Any, loads: Any) -> Any:
        return wrench_of_loads(time, rotation_of_quaternion(qpos[QW:TILT_1]), loads)

    layer = Layer(
        record,
        lambda plan: record(*map(_load, plan.scenario.loads)),
        adds=forces,
        actuators=ExtraActuators(wrench=True),
        derive=_derive,
        units={name: "N" if "force" in name else "N m" for name in LOAD_COLUMNS},
    )
    return wrap_loop(loop, layer)


def _load(table: Force | Torque) -> Load:
    end, in_body = table.end or inf, float(table.frame == "body")
    load = Load(table.start, end, in_body)
    if isinstance(table, Torque):
        return load._replace(torque=table.value)
    return load._replace(force=table.value, point=table.point)


def _derive(samples: Samples, setup: ControlSetup) -> dict[str, Floats]:
    attitude = np.stack([samples[name] for name in ("roll", "pitch", "yaw")], axis=-1)
    loads = ControlSetup(setup.parameters.layer)
    wrenches = evaluate_over_samples(_acting, 6, samples["time"], attitude, loads)
    return dict(zip(LOAD_COLUMNS, wrenches.T, strict=True))


@traceable
def _acting(time: Any, attitude: Any, loads: Any, knots: Any) -> Any:
    """Force and torque of a sample, body axes."""
    return wrench_of_loads(time, rotation_matrix(attitude), loads)
