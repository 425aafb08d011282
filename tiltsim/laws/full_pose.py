"""Full-pose control of the tiltrotor: the tilt angles are inputs, too (ch. 3, Sec. 6.3)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final, NamedTuple

from tiltsim.closed_loop.loop import (
    ClosedLoop,
    Columns,
    ControlSetup,
    Equations,
    Monitoring,
    Sampling,
)
from tiltsim.equations.tiltrotor import FURTHER, equations_of_motion, law_state
from tiltsim.laws.quadrotor import constant_attitude_references
from tiltsim.laws.tiltrotor import (
    ROTOR_STOPS,
    TILT_REFERENCE_COLUMNS,
    four,
    initial_equation_state,
    observe_tiltrotor,
    refreshed_controls,
    rotor_speeds_along_spin,
    rotor_thrust_controls,
    servo_lead,
    singularity_columns,
    tiltrotor_dynamics,
    tiltrotor_state,
)
from tiltsim.scenario.tiltrotor_controllers import FullPoseController
from tiltsim.vehicles.rotorcraft import ROTORCRAFT, initial_tilts
from tiltsim.vehicles.rotorcraft.layout import CROSS
from tiltsim_controllers.laws.full_pose import Parameters, full_pose_inputs, limited_tilt_rate
from tiltsim_controllers.mathematics.scalar import Floats, Quad, Triple, Values, Vector, scalar
from tiltsim_controllers.vehicle.states import ROTORS

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan

TILT_COMMANDS: Final = tuple(f"tilt_command_{rotor}" for rotor in ROTORS)
"""The controller's states: the commands of the servos (rad) without their lead."""

COMMAND_1: Final = CROSS.rotors
"""Of ``act``: the commands follow the rotor speeds."""

TILT_RATES: Final = 4
"""Index of the first tilt rate among the control law's inputs."""


class LoopParameters(NamedTuple):
    """The head of `userdata`."""

    signature: float  # see `tiltsim.closed_loop.loop.ClosedLoop.signature`
    servo_lead: float  # s, rate feed-forward of the tilt servos, 2 zeta / omega_n
    law: Parameters


@scalar
def _full_pose_controls(
    time: float, qpos: Vector, qvel: Vector, act: Vector, parameters: LoopParameters, knots: Vector
) -> Values:
    """All sixteen controls: tilt servos, thrusts, rotor accelerations, tilt rates.

    The control law gives tilt rates. Four states integrate them to the commands of the servos, with
    rate feed-forward as for a planned gait.
    """
    lead, limits = parameters.servo_lead, parameters.law.limits
    state = tiltrotor_state(qpos, qvel, act)
    u1, u2, u3, u4, rate_1, rate_2, rate_3, rate_4 = full_pose_inputs(
        time, state, parameters.law, knots
    )
    # The law's limit sees a pod that stops at its servo's stop, but not the command beyond it.
    a1, a2, a3, a4 = four(act, COMMAND_1)
    rate_1 = limited_tilt_rate(rate_1, a1, limits)
    rate_2 = limited_tilt_rate(rate_2, a2, limits)
    rate_3 = limited_tilt_rate(rate_3, a3, limits)
    rate_4 = limited_tilt_rate(rate_4, a4, limits)
    servos = (a1 + lead * rate_1, a2 + lead * rate_2, a3 + lead * rate_3, a4 + lead * rate_4)
    thrusts = rotor_thrust_controls(act)
    return (*servos, *thrusts, u1, u2, u3, u4, rate_1, rate_2, rate_3, rate_4)


@scalar
def _observe_full_pose(qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector) -> Values:
    """The tiltrotor and the commands of its servos."""
    return (*observe_tiltrotor(qpos, qvel, act, ctrl), *four(act, COMMAND_1))


@scalar
def sign_check_values(
    time: float, values: Vector, parameters: LoopParameters, knots: Vector
) -> Quad:
    """The rotor speeds along their spin."""
    return rotor_speeds_along_spin(values)


def _setup(plan: FlightPlan, signature: float) -> ControlSetup:
    controller, rotorcraft = plan.scenario.controller, plan.scenario.rotorcraft
    assert isinstance(controller, FullPoseController)
    vehicle = rotorcraft.resolve()
    law = Parameters(
        vehicle,
        controller.resolve_gains(),
        plan.reference,
        controller.resolve_limits(),
        controller.resolve_tilt_weight(vehicle),
        controller.resolve_failure(),
    )
    lead = servo_lead(rotorcraft.tilt_servo)
    return ControlSetup(LoopParameters(signature, lead, law), plan.knots)


def _derive(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
    law = setup.parameters.law
    commands = zip(TILT_REFERENCE_COLUMNS, TILT_COMMANDS, strict=True)
    return {
        **constant_attitude_references(samples, law.reference, setup.knots),
        **{column: samples[name] for column, name in commands},
        **singularity_columns(samples, law.vehicle),
    }


@scalar
def tilt_states(time: float, state: Vector, parameters: LoopParameters, knots: Vector) -> Quad:
    """The tilt angles (rad) on the thesis's equations: states of their own."""
    return four(state, FURTHER)


@scalar
def _equation_inputs(
    time: float, state: Vector, parameters: LoopParameters, knots: Vector
) -> Values:
    """Rotor accelerations and tilt rates on the thesis's equations."""
    tilts = four(state, FURTHER)
    return full_pose_inputs(time, law_state(state, tilts), parameters.law, knots)


@scalar
def equation_rates(
    time: float,
    state: Vector,
    inputs: Vector,
    parameters: LoopParameters,
    knots: Vector,
    disturbance: Triple,
) -> Values:
    """The thesis's equations, the tilt angles being states whose rates are inputs."""
    tilts, accelerations, vehicle = four(state, FURTHER), four(inputs, 0), parameters.law.vehicle
    body = equations_of_motion(state, tilts, accelerations, vehicle, disturbance)
    return (*body, *four(inputs, TILT_RATES))


@scalar
def observe_equations(
    time: float, state: Vector, inputs: Vector, parameters: LoopParameters, knots: Vector
) -> Values:
    """A sample of the thesis's equations, with the tilt rates in force."""
    tilts = four(state, FURTHER)
    return (*law_state(state, tilts), *four(inputs, TILT_RATES), *tilts)


FULL_POSE: Final = ClosedLoop(
    kind=ROTORCRAFT,
    parameters=LoopParameters,
    setup=_setup,
    dynamics=tiltrotor_dynamics(len(TILT_COMMANDS), lambda plan: initial_tilts(plan)[0]),
    sampling=Sampling(_full_pose_controls, refreshed_controls),
    columns=Columns(
        _observe_full_pose, _derive, fields=TILT_COMMANDS, units=dict.fromkeys(TILT_COMMANDS, "rad")
    ),
    monitoring=Monitoring(sign_check_values, lambda _sample, _setup: ROTOR_STOPS),
    equations=Equations(
        inputs=_equation_inputs,
        inputs_size=8,
        rates=equation_rates,
        initial=lambda plan, _setup: (*initial_equation_state(plan), *initial_tilts(plan)[0]),
        observe=observe_equations,
        tilts=tilt_states,
    ),
)
"""Full-pose control of the tiltrotor."""
