"""Closed loops with any number of rotors: one factory for every control law.

Native code wants to know how many rotors there are, which tilt together and which way they turn, so
a loop is made for each such `RotorLayout`, once. All other numbers of the vehicle are data. The
rotors' speeds are states whose accelerations a law commands; tilts follow the gait, or are commands
that a law integrates as its states.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from tiltsim.closed_loop.loop import (
    ClosedLoop,
    Columns,
    ControlSetup,
    Dynamics,
    Equations,
    Sampling,
)
from tiltsim.equations.tiltrotor import body_fields, initial_state
from tiltsim.laws.parameters import head_of
from tiltsim.laws.rotorcraft import (
    REFERENCE_COLUMNS,
    ahead,
    held_controls_of,
    observed_of,
    reference_columns,
    seen_of,
    servo_lead,
    thrust_controls_of,
    torque_free_columns,
)
from tiltsim.models.rotor_table import Multirotor
from tiltsim.vehicles.rotorcraft import initial_rotor_speeds, rotorcraft_kind
from tiltsim.vehicles.rotorcraft.layout import CROSS
from tiltsim.vehicles.rotorcraft.layout import Layout as Places
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.code.traceable import traceable
from tiltsim_controllers.gaits.motion import tilt_motion_of
from tiltsim_controllers.mathematics.scalar import Floats, Values, Vector
from tiltsim_controllers.references.trajectories import attitude_reference, position_reference
from tiltsim_controllers.vehicle.body import Body, body_of
from tiltsim_controllers.vehicle.effectiveness import ROTOR_FLOATS
from tiltsim_controllers.vehicle.motion import BODY_STATES, equations_of_motion_of

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan

Margins = Callable[[Mapping[str, Floats], ControlSetup], dict[str, Floats]]
"""``(samples by field, setup) -> columns`` that a sample's state alone decides."""


class RotorLayout(NamedTuple):
    """Layout of a rotorcraft, for which its programs are made."""

    tilt_of_rotor: tuple[int, ...]  # from 0; -1 for a fixed rotor
    spins: Values
    model: str = "multirotor"  # ``vehicle.model``; of others the layout is known

    @property
    def places(self) -> Places:
        """Where its numbers lie."""
        return Places(len(self.spins), max(self.tilt_of_rotor) + 1)

    @property
    def shown(self) -> Places:
        """Places in a sample, which may have tilts that are idle."""
        return self.places if self.model == "multirotor" else CROSS

    @property
    def name(self) -> str:
        """For files and models."""
        if self.model != "multirotor":
            return self.model
        tilts = "_".join(str(tilt) if tilt >= 0 else "f" for tilt in self.tilt_of_rotor)
        return f"multirotor_{tilts}_{''.join('p' if spin > 0.0 else 'm' for spin in self.spins)}"


def layout_of_vehicle(vehicle: Multirotor, model: str = "multirotor") -> RotorLayout:
    """The layout of a vehicle."""
    return RotorLayout(vehicle.tilt_of_rotor, vehicle.spins, model)


def _no_states(_plan: FlightPlan) -> Values:
    return ()


class RotorLaw(NamedTuple):
    """A control law with rotor accelerations as inputs, and the parts of its loop.

    Its parameters have ``reference``, where the tilts follow the gait ``gait``, and for the general
    margins and motion ``vehicle`` and ``rotors``, the index of the rotors' table in the knots.
    """

    name: str  # of compiled code
    inputs: Callable[..., Values]
    """``(time, state, tilt_rates, states, parameters, knots)``: rotor accelerations
    (rad/s^2), then rates of the controller's ``states``. ``state`` is the vehicle's (`seen_of`),
    ``parameters`` the whole record."""
    parameters: type[tuple[Any, ...]]
    setup: Callable[[FlightPlan], tuple[Any, Values]]  # parameters, and knots to append
    states: Mapping[str, str] = {}  # the controller's, with their units; part of a sample
    initial: Callable[[FlightPlan], Values] = _no_states  # these states at time zero
    commands: int | None = None  # which of them is the first commanded tilt; None: the gait's
    references: Callable[..., Values] | None = None
    """``(time, values, parameters, knots)`` of the columns ``names``, from a sample;
    None for the position and attitude of the reference."""
    names: tuple[str, ...] = REFERENCE_COLUMNS
    margins: Margins | None = None  # None for the angle to the nearest singular attitude
    units: Mapping[str, str] = {}  # further columns of a flight
    measured: bool = False
    """Whether ``tilt_rates`` end with the plant's angular acceleration (rad/s^2, body axes), of
    `tiltsim.laws.layers.measured_acceleration`."""
    motion: Callable[..., Values] | None = None
    """``(state, tilts, inputs, parameters, knots, disturbance)`` of the derivative of
    body and rotor speeds on the thesis's equations; None for the equations of a rotor table."""


def body_of_vehicle(vehicle: Multirotor) -> Body:
    """The rigid body that a law knows of a vehicle."""
    return body_of(vehicle.mass, np.reshape(vehicle.inertia, (3, 3)), vehicle.gravity)


def _tilts_of(law: RotorLaw, tilts: int, state_1: int, rate_1: int) -> Callable[..., Any]:
    """Function for the tilts (rad) and their rates (rad/s), the gait's or a law's commands.

    It is ``(time, state, inputs, parameters, knots) -> angles, rates``; commanded tilts are states
    whose rates are inputs.

    Args:
        law: Its ``commands`` tell which.
        tilts: Number of tilts.
        state_1, rate_1: Where the controller's states begin in a state, and their rates in inputs.
    """
    moving, first = tilt_motion_of(tilts).moving, law.commands
    if first is None:

        def planned(time: Any, state: Any, inputs: Any, parameters: Any, knots: Any) -> Any:
            return moving(time, parameters.law.gait, knots)

        return planned
    angle_1, moving_1 = state_1 + first, rate_1 + first

    def commanded(time: Any, state: Any, inputs: Any, parameters: Any, knots: Any) -> Any:
        return state[angle_1 : angle_1 + tilts], inputs[moving_1 : moving_1 + tilts]

    return commanded


def _sampling_of(layout: RotorLayout, law: RotorLaw) -> Sampling:
    """The control step in MuJoCo."""
    rotors, tilts = layout.places
    seen, inputs_of = seen_of(layout.places, len(law.states), law.measured), law.inputs
    thrusts = thrust_controls_of(layout.spins)
    tilt_motion = _tilts_of(law, tilts, rotors, rotors)

    @traceable
    def controls(time: Any, qpos: Any, qvel: Any, act: Any, parameters: Any, knots: Any) -> Any:
        state, moving, states = seen(qpos, qvel, act)
        inputs = inputs_of(time, state, moving, states, parameters, knots)
        angles, rates = tilt_motion(time, act, inputs, parameters, knots)
        return xp.hstack([ahead(angles, rates, parameters.servo_lead), thrusts(act), inputs])

    return Sampling(controls, held_controls_of(layout.spins, tilts))


def _pose(time: Any, values: Any, parameters: Any, knots: Any) -> Any:
    """Position and attitude of the reference, `REFERENCE_COLUMNS`."""
    reference = parameters.law.reference
    position = position_reference(time, reference, knots)[:3]
    return xp.hstack([position, attitude_reference(time, reference, knots)])


def _columns_of(layout: RotorLayout, law: RotorLaw) -> Columns:
    """Samples of flights, and the columns of references and margin."""
    places, shown, references = layout.places, layout.shown, law.references or _pose
    fields, names = (*shown.observed_fields, *law.states), (*law.names, *shown.names("alpha_ref"))
    observed, idle = observed_of(places, shown, len(law.states)), np.zeros(shown[1] - places[1])
    first = len(shown.observed_fields)
    tilts, at_rest = _tilts_of(law, places.tilts, first, 0), np.zeros(len(law.states))

    @traceable
    def observe(qpos: Any, qvel: Any, act: Any, ctrl: Any) -> Any:
        return observed(qpos, qvel, act)

    @traceable
    def requested(time: Any, values: Any, parameters: Any, knots: Any) -> Any:
        own = references(time, values, parameters, knots)
        angles, _ = tilts(time, values, at_rest, parameters, knots)
        return xp.hstack([own, angles, idle])

    def margins(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
        return torque_free_columns(places, table_of(places, setup), samples)

    def derive(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
        found = reference_columns(requested, fields, samples, setup, names)
        return {**found, **(law.margins or margins)(samples, setup)}

    return Columns(observe, derive, fields=tuple(law.states), units={**law.states, **law.units})


def table_of(places: Places, setup: ControlSetup) -> Values:
    """The table of the rotors, in the knots after the data of gait and reference."""
    first = int(setup.parameters.law.rotors)
    return setup.knots[first : first + ROTOR_FLOATS * places.rotors]


@cache
def _motion_of(layout: RotorLayout) -> Callable[..., Values]:
    """`RotorLaw.motion` by a table of rotors."""
    motion_of_body = equations_of_motion_of(layout.tilt_of_rotor)
    # The thesis's equations have no gyroscopic torque but the quadrotor's.
    gyroscopic = float(layout.model == "quadrotor")

    def motion(
        state: Any, tilts: Any, inputs: Any, parameters: Any, knots: Any, disturbance: Any
    ) -> Any:
        own = parameters.law
        body, at = own.vehicle, int(own.rotors)
        return motion_of_body(state, tilts, inputs, body, knots, at, disturbance, gyroscopic)

    return motion


def _equations_of(layout: RotorLayout, law: RotorLaw) -> Equations:
    """The law on the equations of motion, with pods that follow their commands exactly."""
    rotors, tilts = layout.places
    own, inputs_of, motion = len(law.states), law.inputs, law.motion or _motion_of(layout)
    idle, at_rest = np.zeros(layout.shown.tilts - tilts), np.zeros(rotors + own)
    speeds = slice(BODY_STATES, BODY_STATES + rotors)
    states = slice(speeds.stop, speeds.stop + own)
    moving_tilts = _tilts_of(law, tilts, BODY_STATES + rotors, rotors)

    @traceable
    def tilts_of(time: Any, state: Any, parameters: Any, knots: Any) -> Any:
        return moving_tilts(time, state, at_rest, parameters, knots)[0]

    @traceable
    def inputs(time: Any, state: Any, parameters: Any, knots: Any) -> Any:
        # Rates that the law is yet to command count as none.
        angles, moving = moving_tilts(time, state, at_rest, parameters, knots)
        seen = xp.hstack([body_fields(state), angles, state[speeds]])
        return inputs_of(time, seen, moving, state[states], parameters, knots)

    @traceable
    def rates(
        time: Any, state: Any, inputs: Any, parameters: Any, knots: Any, disturbance: Any
    ) -> Any:
        angles = tilts_of(time, state, parameters, knots)
        body = motion(state, angles, inputs, parameters, knots, disturbance)
        return xp.hstack([body, inputs[rotors : rotors + own]])

    @traceable
    def observe(time: Any, state: Any, inputs: Any, parameters: Any, knots: Any) -> Any:
        angles, moving = moving_tilts(time, state, inputs, parameters, knots)
        seen = body_fields(state), angles, idle, state[speeds]
        return xp.hstack([*seen, moving, idle, state[states]])

    def initial(plan: FlightPlan, _setup: ControlSetup) -> Vector:
        return (*initial_state(plan.scenario, initial_rotor_speeds(plan)), *law.initial(plan))

    return Equations(inputs, rotors + own, rates, initial, observe, tilts=tilts_of)


def rotor_loop(layout: RotorLayout, law: RotorLaw) -> ClosedLoop:
    """The closed loop of a control law with all vehicles of a layout."""
    places, record = layout.places, head_of(law.parameters, servo_lead=float)
    sampling, equations = _sampling_of(layout, law), None
    if not law.measured:  # the equations have no other acceleration than the law's
        equations = _equations_of(layout, law)

    def setup(plan: FlightPlan, signature: float) -> ControlSetup:
        parameters, further = law.setup(plan)
        lead = servo_lead(plan.scenario.any_rotorcraft.tilt_servo)
        return ControlSetup(record(signature, lead, parameters), (*plan.knots, *further))

    return ClosedLoop(
        kind=rotorcraft_kind(layout.shown, ("singularity_margin",)),
        parameters=record,
        setup=setup,
        dynamics=Dynamics(
            layout.name,
            places.sizes(len(law.states)),
            lambda plan, _setup: (*initial_rotor_speeds(plan), *law.initial(plan)),
            len(law.states),
            layout.spins,
            layout.tilt_of_rotor if layout.model == "multirotor" else (),
        ),
        sampling=sampling,
        columns=_columns_of(layout, law),
        equations=equations,
        uses_gait=places.tilts > 0 and law.commands is None,
    )
