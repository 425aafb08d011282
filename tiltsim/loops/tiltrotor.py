"""The attitude-altitude law around the tiltrotor.

The control step goes from MuJoCo's state to MuJoCo's controls, as scalar code. One step serves
every engine. It is a pure function of time, `qpos`, `qvel`, `act` and the parameters in
`userdata`, so that a saved state restarts exactly and an integrator may call it at every stage.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from controllers.attitude_altitude import (
    DECOUPLINGS,
    EXACT_DECOUPLING,
    STATE_FIELDS,
    Parameters,
    State,
    attitude_reference,
    rotor_accelerations,
)
from controllers.decouplers import DECOUPLERS
from controllers.decoupling_matrix import sines_and_cosines, torque_entries, torque_free_force
from controllers.gaits import GaitParameters, tilt_reference
from controllers.references import position_reference
from controllers.rotation import euler_from_quaternion, world_up_in_body
from controllers.scalar import Quad, Triple, scalar
from controllers.singularity import determinant, margin_over_gait
from controllers.supervisor import Supervisor
from controllers.vehicle import SPIN, Vehicle, drag_ratio
from tiltsim.controller_tables import AttitudeAltitudeController
from tiltsim.equations.tiltrotor import equations_of_motion, initial_state, law_state
from tiltsim.kinds.rotorcraft import OBSERVED_FIELDS
from tiltsim.loop import (
    ControlSetup,
    Equations,
    Floats,
    Loop,
    Sizes,
    Watched,
)
from tiltsim.rows import evaluate_rows

if TYPE_CHECKING:
    from tiltsim.scenario import Scenario
    from tiltsim.vehicle_tables import ServoTable

REFERENCE_COLUMNS: Final = ("x_ref", "y_ref", "z_ref", "roll_ref", "pitch_ref", "yaw_ref")
TILT_COLUMNS: Final = ("alpha_1", "alpha_2", "alpha_3", "alpha_4")
TILT_REFERENCE_COLUMNS: Final = tuple(f"alpha_ref_{rotor}" for rotor in (1, 2, 3, 4))


class ControlParameters(NamedTuple):
    """The head of `userdata`: what the control step of a flight needs to know."""

    signature: float  # see `tiltsim.loop.Loop.signature`
    servo_lead: float  # s, rate feed-forward of the tilt servos, 2 zeta / omega_n
    law: Parameters
    supervisor: Supervisor = Supervisor()


@scalar
def tiltrotor_state(qpos: Sequence[float], qvel: Sequence[float], act: Sequence[float]) -> State:
    """The law's state (`controllers.attitude_altitude.STATE_FIELDS`) from MuJoCo's.

    MuJoCo gives the body's position, its quaternion and the tilt angles in ``qpos``, the velocity
    in world axes, the body rates in body axes and the tilt rates in ``qvel``.
    """
    x, y, z, qw, qx, qy, qz, alpha_1, alpha_2, alpha_3, alpha_4 = qpos
    vx, vy, vz, p, q, r, _, _, _, _ = qvel
    roll, pitch, yaw = euler_from_quaternion(qw, qx, qy, qz)
    # One tuple: to join two costs Python a third of this function.
    return (
        x, y, z, vx, vy, vz, roll, pitch, yaw, p, q, r,
        alpha_1, alpha_2, alpha_3, alpha_4, act[0], act[1], act[2], act[3],
    )  # fmt: skip


@scalar
def rotor_thrust_controls(act: Sequence[float]) -> Quad:
    """Controls of the thrust actuators, ``s_i varpi_i |varpi_i|`` with ``s = (-1, 1, -1, 1)``."""
    speed_1, speed_2, speed_3, speed_4 = act[0], act[1], act[2], act[3]
    return (
        -speed_1 * abs(speed_1),
        speed_2 * abs(speed_2),
        -speed_3 * abs(speed_3),
        speed_4 * abs(speed_4),
    )


@scalar
def planned_servo_commands(
    time: float, lead: float, gait: GaitParameters, table: Sequence[float]
) -> Quad:
    """What the tilt servos are told (rad) to follow the planned gait, their lag allowed for."""
    a1, a2, a3, a4, rate_1, rate_2, rate_3, rate_4 = tilt_reference(time, gait, table)
    return a1 + lead * rate_1, a2 + lead * rate_2, a3 + lead * rate_3, a4 + lead * rate_4


@scalar
def tiltrotor_controls(
    time: float,
    qpos: Sequence[float],
    qvel: Sequence[float],
    act: Sequence[float],
    parameters: ControlParameters,
    table: Sequence[float],
) -> tuple[float, ...]:
    """All twelve controls of the tiltrotor: tilt servos, thrusts, rotor accelerations.

    The servo commands lead the planned angles by the servo's own lag, so that a stiff servo
    follows a moving gait and not only a resting one.
    """
    law = parameters.law
    state = tiltrotor_state(qpos, qvel, act)
    return (
        *planned_servo_commands(time, parameters.servo_lead, law.gait, table),
        *rotor_thrust_controls(act),
        *rotor_accelerations(time, state, law, table),
    )


@scalar
def law_rates(
    time: float,
    state: State,
    qvel: Sequence[float],
    act: Sequence[float],
    governor: Triple,
    parameters: ControlParameters,
    table: Sequence[float],
) -> Quad:
    """The law's part of the controls, for `tiltsim.loops.supervised`: rotor accelerations."""
    return rotor_accelerations(time, state, parameters.law, table)


@scalar
def refreshed_controls(ctrl: Sequence[float], act: Sequence[float]) -> tuple[float, ...]:
    """Held controls, however many, with the thrusts that belong to the present rotor speeds."""
    return (*ctrl[:4], *rotor_thrust_controls(act), *ctrl[8:])


def servo_lead(servo: ServoTable) -> float:
    """By how much (s) a tilt servo lags behind a command that moves evenly."""
    return 2.0 * servo.damping_ratio / servo.natural_frequency


def _setup(scenario: Scenario, signature: float) -> ControlSetup:
    controller = scenario.controller
    assert isinstance(controller, AttitudeAltitudeController)
    vehicle = scenario.rotorcraft.resolve()
    gait = scenario.gait.plan(vehicle)
    reference, table = scenario.reference_and_table()
    parameters = ControlParameters(
        signature,
        servo_lead(scenario.rotorcraft.tilt_servo),
        law=Parameters(
            vehicle=vehicle,
            gains=controller.resolve_gains(),
            gait=gait.parameters,
            reference=reference,
            decoupler=DECOUPLERS[controller.decoupler],
            decoupling=DECOUPLINGS[controller.decoupling],
        ),
        supervisor=controller.resolve_supervisor(vehicle),
    )
    return ControlSetup(parameters, table)


def initial_rotor_speeds(scenario: Scenario) -> tuple[float, ...]:
    """The signed rotor speeds (rad/s) at time zero."""
    return tuple(s * speed for s, speed in zip(SPIN, scenario.initial.rotor_speeds(4), strict=True))


@scalar
def observe_tiltrotor(
    qpos: Sequence[float], qvel: Sequence[float], act: Sequence[float], ctrl: Sequence[float]
) -> tuple[float, ...]:
    """Rigid body, tilts, rotor speeds and tilt rates: all of them states of the simulation."""
    return (*tiltrotor_state(qpos, qvel, act), qvel[6], qvel[7], qvel[8], qvel[9])


def gait_singularity(samples: Mapping[str, Floats], vehicle: Vehicle) -> dict[str, Floats]:
    """Determinant of the attitude-altitude law at the present tilts, and the margin to zero."""
    tilts = np.stack([samples[name] for name in TILT_COLUMNS], axis=-1)
    attitude = samples["roll"], samples["pitch"]
    return {
        "singularity_margin": margin_over_gait(tilts, vehicle, *attitude),
        "determinant": determinant(tilts, *attitude, vehicle),
    }


@scalar
def references_in_force(
    time: float, state: State, parameters: ControlParameters, table: Sequence[float]
) -> tuple[float, ...]:
    """`REFERENCE_COLUMNS` and `TILT_REFERENCE_COLUMNS` at a time and state of the law."""
    law = parameters.law
    ratio = drag_ratio(law.vehicle)
    trig = sines_and_cosines(state[12], state[13], state[14], state[15])
    torque = torque_entries(trig, ratio)
    x, y, z, _, _, _, _, _, _ = position_reference(time, law.reference, table)
    roll, pitch, yaw, _, _, _ = attitude_reference(time, state, trig, torque, law, table)
    a1, a2, a3, a4, _, _, _, _ = tilt_reference(time, law.gait, table)
    return x, y, z, roll, pitch, yaw, a1, a2, a3, a4


@scalar
def references_under(
    time: float,
    state: State,
    governor: Triple,
    parameters: ControlParameters,
    table: Sequence[float],
) -> tuple[float, ...]:
    """`REFERENCE_COLUMNS`, for `tiltsim.loops.supervised`."""
    return references_in_force(time, state, parameters, table)[:6]


def reference_columns(
    in_force: Callable[..., tuple[float, ...]],
    fields: Sequence[str],
    samples: Mapping[str, Floats],
    setup: ControlSetup,
) -> dict[str, Floats]:
    """The columns that a function such as `references_in_force` tells of samples' ``fields``."""
    states = np.stack([samples[name] for name in fields], axis=-1)
    names = (*REFERENCE_COLUMNS, *TILT_REFERENCE_COLUMNS)
    rows = evaluate_rows(in_force, len(names), samples["time"], states, setup)
    return dict(zip(names, rows.T, strict=True))


def _derive(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
    columns = reference_columns(references_in_force, STATE_FIELDS, samples, setup)
    return columns | gait_singularity(samples, setup.parameters.law.vehicle)


def rotor_stops(sample: Mapping[str, float]) -> tuple[Watched, ...]:
    """Rotor speeds along their spin: a matrix with the factor ``2 |varpi|`` is singular at zero."""
    return tuple(
        Watched(
            sign * sample[f"rotor_speed_{rotor}"],
            f"the decoupling matrix became singular: rotor {rotor} came to a stop",
        )
        for rotor, sign in enumerate(SPIN, start=1)
    )


@scalar
def rotor_spins(values: Sequence[float]) -> Quad:
    """Rotor speeds along their spin, from what `observe_tiltrotor` gives."""
    return -values[16], values[17], -values[18], values[19]


@scalar
def regularity(values: Sequence[float], vehicle: Vehicle) -> float:
    """The determinant of the decoupling matrix but for the rotor speeds, of a sample's values."""
    ratio = drag_ratio(vehicle)
    trig = sines_and_cosines(values[12], values[13], values[14], values[15])
    nx, ny, nz = torque_free_force(trig, torque_entries(trig, ratio), ratio)
    ux, uy, uz = world_up_in_body(values[6], values[7])
    return nx * ux + ny * uy + nz * uz


@scalar
def watch_tiltrotor(
    values: Sequence[float], parameters: ControlParameters
) -> tuple[float, float, float, float, float]:
    """The determinant of the decoupling matrix, and the rotor speeds where it vanishes with them.

    As published, the factor ``2 |varpi|`` stands in one row alone, and a rotor at rest is harmless.
    """
    law = parameters.law
    matrix = regularity(values, law.vehicle)
    if law.decoupling == EXACT_DECOUPLING:
        spin_1, spin_2, spin_3, spin_4 = rotor_spins(values)
        return matrix, spin_1, spin_2, spin_3, spin_4
    return matrix, 1.0, 1.0, 1.0, 1.0


def singular_matrix(sample: Mapping[str, float], vehicle: Vehicle) -> Watched:
    """The determinant of the attitude-altitude law at the present tilts and attitude."""
    angles = ", ".join(f"{sample[name]:.3g}" for name in TILT_COLUMNS)
    return Watched(
        regularity([sample[name] for name in OBSERVED_FIELDS], vehicle),
        f"the decoupling matrix became singular at roll = {sample['roll']:.3g} rad, "
        f"pitch = {sample['pitch']:.3g} rad, tilt angles ({angles}) rad",
    )


def _watched(sample: Mapping[str, float], setup: ControlSetup) -> tuple[Watched, ...]:
    law = setup.parameters.law
    matrix = singular_matrix(sample, law.vehicle)
    return (matrix, *rotor_stops(sample)) if law.decoupling == EXACT_DECOUPLING else (matrix,)


@scalar
def equation_inputs(
    time: float, state: Sequence[float], parameters: ControlParameters, table: Sequence[float]
) -> Quad:
    """The law's rotor accelerations (rad/s^2) on the thesis' equations."""
    law = parameters.law
    a1, a2, a3, a4, _, _, _, _ = tilt_reference(time, law.gait, table)
    return rotor_accelerations(time, law_state(state, (a1, a2, a3, a4)), law, table)


@scalar
def equation_rates(
    time: float,
    state: Sequence[float],
    inputs: Quad,
    parameters: ControlParameters,
    table: Sequence[float],
    disturbance: Triple,
) -> tuple[float, ...]:
    """The thesis' equations with tilt angles that follow the gait exactly."""
    law = parameters.law
    a1, a2, a3, a4, _, _, _, _ = tilt_reference(time, law.gait, table)
    return equations_of_motion(state, (a1, a2, a3, a4), inputs, law.vehicle, disturbance)


@scalar
def observe_equations(
    time: float,
    state: Sequence[float],
    inputs: Sequence[float],
    parameters: ControlParameters,
    table: Sequence[float],
) -> tuple[float, ...]:
    """What a sample holds, from the state of ch. 3's equations; the tilts are the gait's."""
    a1, a2, a3, a4, rate_1, rate_2, rate_3, rate_4 = tilt_reference(
        time, parameters.law.gait, table
    )
    return (*law_state(state, (a1, a2, a3, a4)), rate_1, rate_2, rate_3, rate_4)


def follows_position(scenario: Scenario) -> bool:
    """Whether a decoupler steers the vehicle to the reference's horizontal position."""
    controller = scenario.controller
    assert isinstance(controller, AttitudeAltitudeController)
    return controller.decoupler != "none"


TILTROTOR: Final = Loop(
    model="tiltrotor",
    sizes=Sizes(qpos=11, qvel=10, act=4, ctrl=12),
    parameters=ControlParameters,
    controls=tiltrotor_controls,
    refresh=refreshed_controls,
    setup=_setup,
    initial_activations=lambda scenario, _setup: initial_rotor_speeds(scenario),
    observe=observe_tiltrotor,
    derive=_derive,
    watched=_watched,
    watch=watch_tiltrotor,
    follows_position=follows_position,
    equations=Equations(
        inputs=equation_inputs,
        inputs_size=4,
        rates=equation_rates,
        initial=lambda s, _setup: initial_state(s, initial_rotor_speeds(s)),
        observe=observe_equations,
    ),
)
"""The attitude-altitude law around the tiltrotor."""
