"""Full-pose control around the tiltrotor: the tilt angles are inputs, too (ch. 3, Sec. 6.3)."""

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
from tiltsim.equations.tiltrotor import equations_of_motion, initial_state, law_state
from tiltsim.laws.quadrotor import references
from tiltsim.laws.tiltrotor import (
    initial_signed_rotor_speeds,
    observe_tiltrotor,
    refreshed_controls,
    rotor_speed_checks,
    rotor_speeds_along_spin,
    rotor_thrust_controls,
    servo_lead,
    singularity_columns,
    tiltrotor_dynamics,
    tiltrotor_state,
)
from tiltsim.scenario.tiltrotor_controllers import FullPoseController
from tiltsim.vehicles.rotorcraft import ROTORCRAFT, initial_tilts
from tiltsim_controllers.laws.full_pose import Parameters, full_pose_inputs, limited_tilt_rate
from tiltsim_controllers.mathematics.scalar import Floats, Quad, Triple, Values, Vector, scalar

if TYPE_CHECKING:
    from tiltsim.scenario.flight_plan import FlightPlan

TILT_COMMANDS: Final = tuple(f"tilt_command_{rotor}" for rotor in (1, 2, 3, 4))
"""The law's own states: the tilt angles that the servos are told, but for their lead."""


class LoopParameters(NamedTuple):
    """The head of `userdata`."""

    signature: float  # see `tiltsim.closed_loop.loop.ClosedLoop.signature`
    servo_lead: float  # s, rate feed-forward of the tilt servos, 2 zeta / omega_n
    law: Parameters


@scalar
def full_pose_controls(
    time: float, qpos: Vector, qvel: Vector, act: Vector, parameters: LoopParameters, knots: Vector
) -> Values:
    """All sixteen controls: tilt servos, thrusts, rotor accelerations, tilt rates.

    The law gives tilt rates. Its own four states integrate them to the angles that the servos are
    told, with the rate fed forward as for a planned gait.
    """
    lead = parameters.servo_lead
    state = tiltrotor_state(qpos, qvel, act)
    u1, u2, u3, u4, rate_1, rate_2, rate_3, rate_4 = full_pose_inputs(
        time, state, parameters.law, knots
    )
    # A pod at the stop of its servo is within the law's limit for good: what it is told is not.
    limits = parameters.law.limits
    rate_1 = limited_tilt_rate(rate_1, act[4], limits)
    rate_2 = limited_tilt_rate(rate_2, act[5], limits)
    rate_3 = limited_tilt_rate(rate_3, act[6], limits)
    rate_4 = limited_tilt_rate(rate_4, act[7], limits)
    return (
        *(act[4] + lead * rate_1, act[5] + lead * rate_2),
        *(act[6] + lead * rate_3, act[7] + lead * rate_4),
        *rotor_thrust_controls(act),
        *(u1, u2, u3, u4, rate_1, rate_2, rate_3, rate_4),
    )


@scalar
def observe_full_pose(qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector) -> Values:
    """The tiltrotor and the law's own states."""
    return (*observe_tiltrotor(qpos, qvel, act, ctrl), act[4], act[5], act[6], act[7])


@scalar
def sign_check_values(values: Vector, parameters: LoopParameters) -> Quad:
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
    wanted = law.reference
    attitude = (wanted.roll, wanted.pitch, wanted.yaw)
    return {
        **references(samples, wanted, setup.knots, attitude),
        **{f"alpha_ref_{i}": samples[f"tilt_command_{i}"] for i in (1, 2, 3, 4)},
        **singularity_columns(samples, law.vehicle),
    }


@scalar
def equation_inputs(
    time: float, state: Vector, parameters: LoopParameters, knots: Vector
) -> Values:
    """The law's rotor accelerations and tilt rates on the thesis's equations."""
    tilts = state[22], state[23], state[24], state[25]
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
    tilts = state[22], state[23], state[24], state[25]
    accelerations = inputs[0], inputs[1], inputs[2], inputs[3]
    vehicle = parameters.law.vehicle
    return (
        *equations_of_motion(state, tilts, accelerations, vehicle, disturbance),
        *(inputs[4], inputs[5], inputs[6], inputs[7]),
    )


@scalar
def observe_equations(
    time: float, state: Vector, inputs: Vector, parameters: LoopParameters, knots: Vector
) -> Values:
    """What a sample holds, from the state of ch. 3's equations and the tilt rates in force."""
    return (
        *law_state(state, (state[22], state[23], state[24], state[25])),
        *(inputs[4], inputs[5], inputs[6], inputs[7]),
        *(state[22], state[23], state[24], state[25]),
    )


FULL_POSE: Final = ClosedLoop(
    kind=ROTORCRAFT,
    parameters=LoopParameters,
    setup=_setup,
    dynamics=tiltrotor_dynamics(len(TILT_COMMANDS), lambda plan: initial_tilts(plan)[0]),
    sampling=Sampling(full_pose_controls, refreshed_controls),
    columns=Columns(
        observe_full_pose, _derive, fields=TILT_COMMANDS, units=dict.fromkeys(TILT_COMMANDS, "rad")
    ),
    monitoring=Monitoring(lambda sample, _setup: rotor_speed_checks(sample), sign_check_values),
    equations=Equations(
        inputs=equation_inputs,
        inputs_size=8,
        rates=equation_rates,
        initial=lambda plan, _setup: (
            *initial_state(plan.scenario, initial_signed_rotor_speeds(plan.scenario)),
            *initial_tilts(plan)[0],
        ),
        observe=observe_equations,
    ),
)
"""Full-pose control of the tiltrotor."""
