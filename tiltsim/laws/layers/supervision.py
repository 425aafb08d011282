"""A supervisor around the controllers that follow a planned gait."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup, SupervisedLaw
from tiltsim.engines.sample_evaluation import evaluate_over_samples
from tiltsim.laws.layers.layer import Layer, Samples, wrap_loop
from tiltsim.laws.rotorcraft import reference_columns, thrust_controls_of
from tiltsim.models.parts import ExtraActuators
from tiltsim.scenario.gait_following import GaitFollowingController
from tiltsim.vehicles.rotorcraft.layout import QW, TILT_1, layout_of
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.code.traceable import traceable
from tiltsim_controllers.gaits.motion import planned_tilts
from tiltsim_controllers.gaits.parameters import GaitParameters
from tiltsim_controllers.laws.supervisor import HOLD, Supervisor, gait_time
from tiltsim_controllers.mathematics.attitude import euler_angles
from tiltsim_controllers.mathematics.scalar import Floats
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
    assert isinstance(controller, GaitFollowingController)
    return controller.resolve_supervisor(plan.scenario.any_rotorcraft.resolve())


def _supervised(loop: ClosedLoop) -> SupervisedLaw:
    assert loop.supervised is not None  # other controllers have no supervisor in their tables
    return loop.supervised


def _scaling(loop: ClosedLoop) -> Layer:
    """A supervisor that scales the gait, without states."""
    inner_controls, law = loop.sampling.controls, _supervised(loop)
    layout = layout_of(loop.dynamics)
    names, tilts = layout.names("alpha_ref"), layout.tilts
    gait_scale, vehicle_of = law.code.gait_scale, law.vehicle

    @traceable
    def scale_of(time: Any, attitude: Any, parameters: Any, knots: Any) -> Any:
        """The factor of the planned gait at an attitude (rad), shape (1,)."""
        inner, (roll, pitch) = parameters.inner, attitude[:2]
        planned = planned_tilts(time, inner.law.gait, knots, tilts)[:, 0]
        vehicle = vehicle_of(time, inner)
        return xp.array([gait_scale(planned, roll, pitch, parameters.layer, vehicle, knots)])

    @traceable
    def controls(time: Any, qpos: Any, qvel: Any, act: Any, parameters: Any, knots: Any) -> Any:
        ctrl = inner_controls(time, qpos, qvel, act, parameters.inner, knots)
        scale = scale_of(time, euler_angles(qpos[QW:TILT_1]), parameters, knots)
        return xp.hstack([scale * ctrl[:tilts], ctrl[tilts:]])

    def derive(
        inner: Callable[[], dict[str, Floats]], samples: Samples, setup: ControlSetup
    ) -> dict[str, Floats]:
        columns, attitude = inner(), np.stack([samples["roll"], samples["pitch"]], axis=-1)
        (scale,) = evaluate_over_samples(scale_of, 1, samples["time"], attitude, setup).T
        scaled_tilts = {name: scale * columns[name] for name in names}
        return {**columns, **scaled_tilts, SUPERVISION: 1.0 - scale}

    return Layer(
        "scaling",
        Supervisor,
        _read,
        controls=controls,
        derive=derive,
        units={SUPERVISION: "1"},
        of_controller=True,
    )


def _servo_commands_of(law: SupervisedLaw, tilts: int) -> Callable[..., Any]:
    """Commands (rad) of the tilt servos under a supervisor with states, shape (tilts,).

    It is ``(time, motion, gait, knots, supervisor, vehicle, lead)``: s, and the supervisor's state
    with its rate and acceleration; ``lead`` in s, of the servos.
    """
    supervised_tilts = law.code.tilts

    def servo_commands(
        time: Any,
        motion: Any,
        gait: GaitParameters,
        knots: Any,
        supervisor: Supervisor,
        vehicle: Any,
        lead: Any,
    ) -> Any:
        planned = planned_tilts(gait_time(time, motion, supervisor), gait, knots, tilts)
        moving = supervised_tilts(planned, 1.0, motion, supervisor, vehicle)
        return moving[:, 0] + lead * moving[:, 1]

    return servo_commands


def _with_states(loop: ClosedLoop, units: tuple[str, ...]) -> Layer:
    """A supervisor that holds the gait or returns to red; its two states have these units."""
    law, layout = _supervised(loop), layout_of(loop.dynamics)
    inputs, references, vehicle_of, seen_in = law.inputs, law.references, law.vehicle, law.seen
    derivative, servo_commands = law.code.derivative, _servo_commands_of(law, layout.tilts)
    thrusts = thrust_controls_of(loop.dynamics.spins)
    first, seen = loop.dynamics.sizes.act, len(law.fields)

    @traceable
    def controls(time: Any, qpos: Any, qvel: Any, act: Any, parameters: Any, knots: Any) -> Any:
        inner, supervisor = parameters.inner, parameters.layer
        state, moving, states = seen_in(qpos, qvel, act)
        gait, lead, vehicle = inner.law.gait, inner.servo_lead, vehicle_of(time, inner)
        roll, pitch, delay, rate = state[ROLL], state[PITCH], act[first], act[first + 1]
        motion = derivative(time, roll, pitch, delay, rate, gait, knots, supervisor, vehicle)
        commands = servo_commands(time, motion, gait, knots, supervisor, vehicle, lead)
        own = inputs(time, state, moving, states, inner, knots, motion)
        return xp.hstack([commands, thrusts(act), own, motion[1], motion[2]])

    @traceable
    def reference_values(time: Any, state: Any, parameters: Any, knots: Any) -> Any:
        inner, supervisor = parameters.inner, parameters.layer
        motion = xp.array([state[seen], state[seen + 1], 0.0])
        gait, vehicle = inner.law.gait, vehicle_of(time, inner)
        tracked = references(time, state, inner, knots, motion)
        commands = servo_commands(time, motion, gait, knots, supervisor, vehicle, 0.0)
        return xp.hstack([tracked, commands])

    def derive(
        _inner: Callable[[], dict[str, Floats]], samples: Samples, setup: ControlSetup
    ) -> dict[str, Floats]:
        layer = setup.parameters.layer
        state, rate = SUPERVISOR_FIELDS
        fields, names = (*law.fields, *SUPERVISOR_FIELDS), (*law.names, *layout.names("alpha_ref"))
        return {
            **reference_columns(reference_values, fields, samples, setup, names),
            **law.margins(samples, setup._replace(parameters=setup.parameters.inner)),
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
        of_controller=True,
    )


@cache
def with_supervisor(loop: ClosedLoop, strategy: str) -> ClosedLoop:
    """A loop under a supervisor with one of `tiltsim_controllers.laws.supervisor.STRATEGIES`."""
    units = _STATE_UNITS.get(strategy)
    return wrap_loop(loop, _scaling(loop) if units is None else _with_states(loop, units))
