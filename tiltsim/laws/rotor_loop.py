"""Closed loops with any number of rotors: one for every control law.

Programs are made for the number of rotors, which of them tilt together and which way they turn, so
a loop is made for each such `RotorLayout`. All other numbers of the vehicle are data. The rotors'
speeds are states whose accelerations a law commands.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Final, NamedTuple

import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup
from tiltsim.equations.actuator_level import MATRIX, as_printed
from tiltsim.equations.thesis import airframe_of, body_fields, initial_state
from tiltsim.laws.law import Law, Margins, Tilts, VehicleFunctions, parts, servo_lead, tilts_of_gait
from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.scenario import FlightPlan
from tiltsim.vehicles.rotorcraft import CROSS, initial_rotor_speeds, rotorcraft_kind
from tiltsim.vehicles.rotorcraft import Layout as Places
from tiltsim.vehicles.rotorcraft.others import FELT, FELT_SIZE
from tiltsim_controllers.analysis.singularity import world_up
from tiltsim_controllers.analysis.torque_free import (
    controlled_axes,
    decoupling_condition,
    margin_over_flight,
    torque_free_forces,
)
from tiltsim_controllers.code.arrays import traceable, xp
from tiltsim_controllers.laws.observed import UNHARMED, Failure, Seen
from tiltsim_controllers.mathematics.attitude import euler_angles
from tiltsim_controllers.mathematics.scalar import Floats, Values, Vector
from tiltsim_controllers.references.trajectories import reference_attitude, reference_motion
from tiltsim_controllers.vehicle.body import BODY_FIELDS, BODY_STATES
from tiltsim_controllers.vehicle.craft import craft_record, equations_of_motion
from tiltsim_controllers.vehicle.parameters import Vehicle
from tiltsim_controllers.vehicle.rotors import ROTOR_FLOATS, force_and_torque


class RotorLayout(NamedTuple):
    """Layout of a rotorcraft, for which its programs are made."""

    tilt_of_rotor: tuple[int, ...]  # from 0; -1 for a fixed rotor
    spins: Values
    cross: str = ""  # ``vehicle.model`` of rotors on a cross, whose layout it is

    @property
    def places(self) -> Places:
        """Where its numbers lie."""
        return Places(len(self.spins), max(self.tilt_of_rotor) + 1)

    @property
    def shown(self) -> Places:
        """Places in a sample, which may have tilts that are idle."""
        return CROSS if self.cross else self.places

    @property
    def name(self) -> str:
        """For files and models."""
        if self.cross:
            return self.cross
        tilts = "_".join(str(tilt) if tilt >= 0 else "f" for tilt in self.tilt_of_rotor)
        return f"multirotor_{tilts}_{''.join('p' if spin > 0.0 else 'm' for spin in self.spins)}"


def layout_of_vehicle(vehicle: Multirotor, cross: str = "") -> RotorLayout:
    """The layout of a vehicle."""
    return RotorLayout(vehicle.tilt_of_rotor, vehicle.spins, cross)


def table_of(places: Places, setup: ControlSetup) -> Values:
    """The table of the rotors, in the knots after the data of gait and reference."""
    first = int(setup.parameters.law.rotors)
    return setup.knots[first : first + ROTOR_FLOATS * places.rotors]


def margins_of(layout: RotorLayout, dimension: int | None = None) -> Margins:
    """`torque_free_columns` for a law that knows of failures or not."""
    places = layout.places

    def margins(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
        failure = getattr(setup.parameters.law, "failure", UNHARMED)
        table = table_of(places, setup)
        return torque_free_columns(places, table, samples, dimension, failure)

    return margins


@dataclass(frozen=True, eq=False)
class RotorFunctions(VehicleFunctions):
    """The functions of a law's loop on arrays, for N rotors, M tilts and S states."""

    layout: RotorLayout
    tilts: Tilts
    commands_thrusts: ClassVar[bool] = False

    @property
    def sizes(self) -> tuple[int, int, int]:
        """N, M and S."""
        return (*self.layout.places, len(self.law.states))

    @property
    def idle(self) -> int:
        """Number of tilts in a sample that the vehicle does not have."""
        return self.layout.shown.tilts - self.layout.places.tilts

    # --- states of the vehicle, from the vectors that hold them

    def in_mujoco(self, time: Any, qpos: Any, qvel: Any, act: Any) -> Seen:
        """From MuJoCo's vectors.

        Args:
            time: s.
            qpos, qvel, act: May have further entries, of layers.
        """
        N, M, S = self.sizes
        q = parts(qpos, position=3, quaternion=4, tilts=M)
        v = parts(qvel, velocity=3, omega=3, tilt_rates=M, measured=3)
        a = parts(act, speeds=N, states=S)
        body = q.position, v.velocity, euler_angles(q.quaternion), v.omega
        measured = v.measured if self.law.measured else None
        state = xp.hstack([*body, q.tilts, a.speeds])
        readings = qvel[6 + M :]  # where none is measured
        return Seen(time, state, v.tilt_rates, a.states, measured, readings=readings)

    def in_sample(self, time: Any, values: Any) -> Seen:
        """From a sample."""
        N, M, S = self.sizes
        idle, body = self.idle, len(BODY_FIELDS)
        v = parts(values, body=body, tilts=M, _1=idle, speeds=N, tilt_rates=M, _2=idle, states=S)
        state = xp.hstack([v.body, v.tilts, v.speeds])
        return Seen(time, state, v.tilt_rates, v.states, recorded=True)

    def in_equations(self, time: Any, state: Any, rates: Any, p: Any, knots: Any) -> Seen:
        """From a state of the equations, whose pods follow their commands exactly.

        Args:
            time: s.
            state: `BODY_STATES` numbers, N rotor speeds and S states of the controller.
            rates: Rates of these, which move commanded tilts; zeros for rates yet to be commanded.
            p, knots: Parameters of the law, and table data of the flight.
        """
        N, M, S = self.sizes
        now, body = parts(state, body=BODY_STATES, speeds=N, states=S), body_fields(state)
        still = Seen(time, xp.hstack([body, xp.zeros(M), now.speeds]), xp.zeros(M), now.states)
        moving = self.tilts(still, rates, p, knots)
        whole = xp.hstack([body, moving[:, 0], now.speeds])
        return still._replace(state=whole, tilt_rates=moving[:, 1])

    def sample(self, seen: Seen) -> Any:
        """The values of a sample."""
        end, idle = len(BODY_FIELDS) + self.layout.places.tilts, xp.zeros(self.idle)
        body_and_tilts, speeds = seen.state[:end], seen.state[end:]
        return xp.hstack([body_and_tilts, idle, speeds, seen.tilt_rates, idle, seen.states])

    # --- in MuJoCo

    def initial_speeds(self, plan: FlightPlan) -> Vector:
        """Rotor speeds among the activations at time zero."""
        return initial_rotor_speeds(plan)

    def thrusts(self, act: Any) -> Any:
        """Controls of the thrusts: ``s varpi |varpi|`` with the spins s."""
        spins = xp.array(self.layout.spins)
        speeds = act[: len(spins)]
        return spins * speeds * abs(speeds)

    def controls(
        self, time: Any, qpos: Any, qvel: Any, act: Any, parameters: Any, knots: Any
    ) -> Any:
        """Tilt servos, ahead by their lag; thrusts; rotor accelerations; rates of the states."""
        seen, p = self.in_mujoco(time, qpos, qvel, act), parameters.law
        if self.law.feels:
            shift = xp.hstack([act[FELT.shift].reshape(3, 2), xp.zeros((3, 1))])
            force, swing = act[FELT.contact_force], act[FELT.swing]
            seen = seen._replace(contact_force=force, swing=swing, shift=shift)
        step = self.law.step(seen, p, knots)
        moving = self.tilts(seen, step.rates, p, knots)
        servos = moving[:, 0] + parameters.servo_lead * moving[:, 1]
        return xp.hstack([servos, self.thrusts(act), step.inputs, step.rates])

    def hold(self, time: Any, qpos: Any, qvel: Any, act: Any, ctrl: Any, parameters: Any) -> Any:
        """Held controls with the thrusts of the present rotor speeds."""
        places = self.layout.places
        return xp.hstack([ctrl[: places.tilts], self.thrusts(act), ctrl[places.acceleration_1 :]])

    def observe(self, qpos: Any, qvel: Any, act: Any, ctrl: Any) -> Any:
        """A sample."""
        sample = self.sample(self.in_mujoco(0.0, qpos, qvel, act))
        if self.law.records_commands:
            sample = xp.hstack([sample, ctrl[: self.layout.places.tilts]])
        return sample

    # --- of a sample

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns of `references`."""
        signals = REFERENCE_COLUMNS[3:] if self.law.signals is None else self.law.signals
        return (*REFERENCE_COLUMNS[:3], *signals, *self.layout.shown.names("alpha_ref"))

    def references(self, time: Any, values: Any, parameters: Any, knots: Any) -> Any:
        """Position, attitude, further signals and tilts to track."""
        seen, p, law = self.in_sample(time, values), parameters.law, self.law
        position = reference_motion(time, p.reference, knots)[0]
        if law.signals is None:
            signals = reference_attitude(time, p.reference, knots)[0]
        else:
            signals = law.step(seen, p, knots).signals[: len(law.signals)]
        tilts = self.tilts(seen, xp.zeros(len(law.states)), p, knots)[:, 0]
        return xp.hstack([position, signals, tilts, xp.zeros(self.idle)])

    # --- on equations of motion

    @property
    def state_names(self) -> tuple[str, ...]:
        """The body with a matrix of its rotation, and the rotor speeds."""
        return (*as_printed(MATRIX, 0).names, *self.layout.places.names("rotor_speed"))

    @property
    def input_names(self) -> tuple[str, ...]:
        """Rotor accelerations; then rates that integrate to commands of tilts."""
        commands = (state for state in self.law.states if state.startswith("tilt_command"))
        rates = (command.replace("tilt_command", "alpha_rate") for command in commands)
        return (*self.layout.places.names("rotor_acceleration"), *rates)

    def initial_state(self, plan: FlightPlan) -> Vector:
        """Motion, rotor speeds and the states of the law."""
        speeds, states = initial_rotor_speeds(plan), self.law.initial_states(plan)
        return (*initial_state(plan.scenario, speeds), *states)

    def equation_inputs(self, time: Any, state: Any, parameters: Any, knots: Any) -> Any:
        """Rotor accelerations, then rates of the states."""
        p, still = parameters.law, xp.zeros(len(self.law.states))
        step = self.law.step(self.in_equations(time, state, still, p, knots), p, knots)
        return xp.hstack([step.inputs, step.rates])

    def equation_tilts(self, time: Any, state: Any, parameters: Any, knots: Any) -> Any:
        """Tilt angles, rad."""
        N, M, S = self.sizes
        states = parts(state, _=BODY_STATES + N, states=S).states
        seen = Seen(time, state, xp.zeros(M), states)
        return self.tilts(seen, xp.zeros(S), parameters.law, knots)[:, 0]

    def equation_rates(
        self, time: Any, state: Any, inputs: Any, parameters: Any, knots: Any, disturbance: Any
    ) -> Any:
        """Rates of the vehicle's and the controller's states.

        The thesis's equations have no gyroscopic torque but the quadrotor's.
        """
        N, _, S = self.sizes
        body, rotors = airframe_of(parameters.law, knots, self.layout.tilt_of_rotor)
        gyroscopic = float(self.layout.cross != "" and not self.layout.places.tilts)
        tilts = self.equation_tilts(time, state, parameters, knots)
        moved = equations_of_motion(state, tilts, inputs, body, rotors, disturbance, gyroscopic)
        return xp.hstack([moved, inputs[N : N + S]])

    def observe_equations(
        self, time: Any, state: Any, inputs: Any, parameters: Any, knots: Any
    ) -> Any:
        """A sample."""
        rates = inputs[self.layout.places.rotors :]
        return self.sample(self.in_equations(time, state, rates, parameters.law, knots))


def rotor_loop(
    layout: RotorLayout, law: Law, functions: type[RotorFunctions] = RotorFunctions
) -> ClosedLoop:
    """The closed loop of a control law with all vehicles of a layout.

    Args:
        layout: Layout of the vehicles.
        law: The law.
        functions: How the inputs of the law move a vehicle.
    """
    places = layout.places
    flown = functions(law, layout, law.tilts or tilts_of_gait(places.tilts))
    loop = flown.closed_loop(
        rotorcraft_kind(layout.shown, law.columns),
        {"servo_lead": lambda plan: servo_lead(plan.scenario.any_rotorcraft.tilt_servo)},
        places.rotors + len(law.states),
        places.names("tilt_command") if law.records_commands else (),
        model=layout.name,
        motion=places.motion,
        sizes=places.sizes(len(law.states))._replace(history=FELT_SIZE if law.feels else 0),
        initial_activations=lambda plan, _: (
            *flown.initial_speeds(plan),
            *law.initial_states(plan),
        ),
        controller_states=len(law.states),
        spins=layout.spins,
        tilt_of_rotor=layout.tilt_of_rotor,
        vehicle_record=Vehicle if layout.cross else craft_record(*places),
        commands_thrusts=functions.commands_thrusts,
        observe_reads_controls=functions.commands_thrusts,
    )
    if law.measured or law.records_commands:  # they need a plant with servos
        return replace(loop, equations=None)
    assert loop.equations is not None
    tilts = replace(loop.equations, tilts=traceable(flown.equation_tilts))
    return replace(loop, equations=tilts, uses_gait=places.tilts > 0 and law.uses_gait)


REFERENCE_COLUMNS: Final = ("x_ref", "y_ref", "z_ref", "roll_ref", "pitch_ref", "yaw_ref")

CONDITION: Final = "decoupling_condition"
"""A column: smallest over largest singular value of the decoupling matrix."""


def torque_free_columns(
    layout: Places,
    table: Vector,
    samples: Mapping[str, Floats],
    dimension: int | None = None,
    failure: Failure = UNHARMED,
) -> dict[str, Floats]:
    """Angle (rad) to the nearest singular attitude, and how well the decoupling matrix inverts.

    Args:
        layout: Places of the vehicle.
        table: Table of its rotors.
        samples: By field.
        dimension: How many components of force the controller controls; None for a controller
            without a decoupling matrix.
        failure: A rotor that the controller knows to have failed, which is left out from then on.
    """
    names = layout.names("alpha")
    angles = np.reshape([samples[name] for name in names], (len(names), len(samples["time"]))).T
    time, rotors = samples["time"], np.arange(1, layout.rotors + 1)
    known = time >= failure.known_from
    lost = known[:, np.newaxis] & (rotors == np.reshape(failure.rotor, (-1, 1)))
    works = ~lost[:, np.newaxis]
    force, torque = force_and_torque(table, angles)
    pushing, up = (force * works, torque * works), world_up(samples["roll"], samples["pitch"])
    forces = torque_free_forces(*pushing)
    begins = (time == time[:1]) | (known != np.roll(known, 1))
    columns = {"singularity_margin": margin_over_flight(forces, up, begins)}
    if dimension is not None:
        axes = controlled_axes(forces, up, dimension)
        columns[CONDITION] = decoupling_condition(*pushing, axes)
    return columns


def rotor_stops(rotors: int, remedy: str = "") -> tuple[str, ...]:
    """Causes of an end where the speed of a rotor reaches zero, one per rotor; a key may help."""
    remedies = ["vehicle.min_rotor_speed = 100", *[remedy] * bool(remedy)]
    advice = ", ".join(remedies) + ", or a smaller step of the reference may help"
    return tuple(
        f"the decoupling matrix became singular: rotor {rotor} came to a stop; {advice}"
        for rotor in range(1, rotors + 1)
    )


def singular_attitude(sample: Mapping[str, float], tilts: tuple[str, ...]) -> str:
    """Cause of an end at an attitude and tilt angles, which have these names."""
    angles = ", ".join(f"{sample[name]:.3g}" for name in tilts)
    return (
        f"the decoupling matrix became singular at roll = {sample['roll']:.3g} rad, "
        f"pitch = {sample['pitch']:.3g} rad" + (f", tilt angles ({angles}) rad" if tilts else "")
    )
