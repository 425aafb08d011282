"""A supervisor around the controllers that follow a planned gait."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup
from tiltsim.engines.sample_evaluation import evaluate_over_samples
from tiltsim.laws.layers.layer import Layer, Samples, wrap_loop
from tiltsim.laws.tiltrotor import (
    TILT_REFERENCE_COLUMNS,
    reference_columns,
    rotor_thrust_controls,
    singularity_columns,
    tiltrotor_state,
)
from tiltsim.models.parts import ExtraActuators
from tiltsim.scenario.tiltrotor_controllers import AttitudeAltitudeController
from tiltsim.vehicles.rotorcraft.layout import QW, QX, QY, QZ
from tiltsim_controllers.gaits.parameters import GaitParameters
from tiltsim_controllers.gaits.tilts import planned_jets, tilt_reference
from tiltsim_controllers.laws.supervisor import (
    HOLD,
    Supervisor,
    gait_time,
    supervised_derivative,
    supervised_gait_scale,
    supervised_tilts,
)
from tiltsim_controllers.mathematics.rotation import euler_from_quaternion
from tiltsim_controllers.mathematics.scalar import Floats, Quad, Triple, Values, Vector, scalar
from tiltsim_controllers.vehicle.parameters import drag_ratio
from tiltsim_controllers.vehicle.states import PITCH, ROLL

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan

SUPERVISION: Final = "supervision"
"""A column: how much the supervisor intervenes, from 0 to 1.

It is the share of the gait's angles or of its speed that is removed, or of the way to red.
"""

SUPERVISOR_FIELDS: Final = ("supervisor_state", "supervisor_rate")
"""States of a supervisor that has any: see `tiltsim_controllers.laws.supervisor`."""

_STATE_UNITS: Final = {"hold": ("s", "1"), "return_to_red": ("1", "1/s")}


def _read(plan: FlightPlan) -> Supervisor:
    controller = plan.scenario.controller
    assert isinstance(controller, AttitudeAltitudeController)
    return controller.resolve_supervisor(plan.scenario.rotorcraft.resolve())


@scalar
def supervised_servo_commands(
    time: float,
    motion: Triple,
    gait: GaitParameters,
    knots: Vector,
    supervisor: Supervisor,
    ratio: float,
    lead: float,
) -> Quad:
    """Commands (rad) of the tilt servos under a supervisor with states.

    Args:
        time: s.
        motion: The supervisor's state with its rate and acceleration.
        gait, knots, supervisor: See `tiltsim_controllers.laws.supervisor.supervised_tilts`.
        ratio: The vehicle's drag ratio.
        lead: s, of the servos.
    """
    clock = gait_time(time, motion, supervisor)
    planned = planned_jets(clock, gait, knots)
    a1, a2, a3, a4 = supervised_tilts(planned, 1.0, motion, supervisor, ratio)
    return (a1[0] + lead * a1[1], a2[0] + lead * a2[1], a3[0] + lead * a3[1], a4[0] + lead * a4[1])


@scalar
def _gait_scale(time: float, roll: float, pitch: float, parameters: Any, knots: Vector) -> float:
    """`supervised_gait_scale` of the planned gait at an attitude (rad)."""
    law = parameters.inner.law
    planned = tilt_reference(time, law.gait, knots)
    return supervised_gait_scale(planned, roll, pitch, parameters.layer, law.vehicle)


@scalar
def _scale(time: float, attitude: Vector, parameters: Any, knots: Vector) -> tuple[float]:
    """`_gait_scale` of a sample."""
    return (_gait_scale(time, attitude[0], attitude[1], parameters, knots),)


def _scaling(loop: ClosedLoop) -> Layer:
    """A supervisor that scales the gait, without states."""
    inner_controls = loop.sampling.controls

    @scalar
    def controls(
        time: float, qpos: Vector, qvel: Vector, act: Vector, parameters: Any, knots: Vector
    ) -> Values:
        planned = inner_controls(time, qpos, qvel, act, parameters.inner, knots)
        roll, pitch, _yaw = euler_from_quaternion(qpos[QW], qpos[QX], qpos[QY], qpos[QZ])
        scale = _gait_scale(time, roll, pitch, parameters, knots)
        return (
            scale * planned[0],
            scale * planned[1],
            scale * planned[2],
            scale * planned[3],
            *planned[4:],
        )

    def derive(
        inner: Callable[[], dict[str, Floats]], samples: Samples, setup: ControlSetup
    ) -> dict[str, Floats]:
        columns, attitude = inner(), np.stack([samples["roll"], samples["pitch"]], axis=-1)
        (scale,) = evaluate_over_samples(_scale, 1, samples["time"], attitude, setup).T
        scaled = {name: scale * columns[name] for name in TILT_REFERENCE_COLUMNS}
        return {**columns, **scaled, SUPERVISION: 1.0 - scale}

    return Layer(
        "scaling", Supervisor, _read, controls=controls, derive=derive, units={SUPERVISION: "1"}
    )


def _with_states(loop: ClosedLoop, units: tuple[str, ...]) -> Layer:
    """A supervisor that holds the gait or returns to red; its two states have these units."""
    assert loop.supervised is not None  # other controllers have no supervisor in their tables
    law_controls, references, fields = loop.supervised
    first, seen = loop.dynamics.sizes.act, len(fields)

    @scalar
    def controls(
        time: float, qpos: Vector, qvel: Vector, act: Vector, parameters: Any, knots: Vector
    ) -> Values:
        inner, supervisor = parameters.inner, parameters.layer
        state = tiltrotor_state(qpos, qvel, act)
        gait, lead, ratio = inner.law.gait, inner.servo_lead, drag_ratio(inner.law.vehicle)
        roll, pitch, delay, rate = state[ROLL], state[PITCH], act[first], act[first + 1]
        motion = supervised_derivative(
            time, roll, pitch, delay, rate, gait, knots, supervisor, ratio
        )
        return (
            *supervised_servo_commands(time, motion, gait, knots, supervisor, ratio, lead),
            *rotor_thrust_controls(act),
            *law_controls(time, state, qvel, act, motion, inner, knots),
            motion[1],
            motion[2],
        )

    @scalar
    def reference_values(time: float, state: Vector, parameters: Any, knots: Vector) -> Values:
        inner, supervisor = parameters.inner, parameters.layer
        motion = (state[seen], state[seen + 1], 0.0)
        gait, ratio = inner.law.gait, drag_ratio(inner.law.vehicle)
        return (
            *references(time, state, motion, inner, knots),
            *supervised_servo_commands(time, motion, gait, knots, supervisor, ratio, 0.0),
        )

    def derive(
        _inner: Callable[[], dict[str, Floats]], samples: Samples, setup: ControlSetup
    ) -> dict[str, Floats]:
        layer, inner = setup.parameters.layer, setup.parameters.inner
        state, rate = SUPERVISOR_FIELDS
        names = (*fields, *SUPERVISOR_FIELDS)
        return {
            **reference_columns(reference_values, names, samples, setup),
            **singularity_columns(samples, inner.law.vehicle),
            SUPERVISION: samples[rate if layer.strategy == HOLD else state],
        }

    return Layer(
        "supervised",
        Supervisor,
        _read,
        controls=controls,
        actuators=ExtraActuators(states=len(SUPERVISOR_FIELDS)),
        initial_activations=lambda _plan, _parameters, _inner: (0.0, 0.0),
        derive=derive,
        fields=SUPERVISOR_FIELDS,
        units={**dict(zip(SUPERVISOR_FIELDS, units, strict=True)), SUPERVISION: "1"},
    )


@cache
def with_supervisor(loop: ClosedLoop, strategy: str) -> ClosedLoop:
    """A loop under a supervisor with one of `tiltsim_controllers.laws.supervisor.STRATEGIES`."""
    units = _STATE_UNITS.get(strategy)
    layer = _scaling(loop) if units is None else _with_states(loop, units)
    return replace(wrap_loop(loop, layer), within=None)
