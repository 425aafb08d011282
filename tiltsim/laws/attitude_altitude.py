"""The attitude-altitude controller in a closed loop with the tiltrotor (ch. 3 and 4)."""

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
from tiltsim.equations.tiltrotor import law_state
from tiltsim.laws.tiltrotor import (
    determinant_and_speed_causes,
    determinant_and_speeds,
    four,
    gait_equation_rates,
    gait_servo_commands,
    gait_tilts,
    initial_equation_state,
    measured_acceleration,
    observe_gait_equations,
    observe_tiltrotor,
    reference_columns,
    refreshed_controls,
    rotor_thrust_controls,
    servo_lead,
    singularity_columns,
    supervised_law,
    tiltrotor_dynamics,
    tiltrotor_state,
    with_measured_inputs,
)
from tiltsim.scenario.tiltrotor_controllers import AttitudeAltitudeController
from tiltsim.vehicles.rotorcraft import ROTORCRAFT
from tiltsim_controllers.gaits.tilts import tilt_reference
from tiltsim_controllers.laws.attitude_altitude import (
    DECOUPLINGS,
    EXACT_DECOUPLING,
    Parameters,
    attitude_reference,
    rotor_accelerations,
)
from tiltsim_controllers.laws.decouplers import DECOUPLERS
from tiltsim_controllers.mathematics.scalar import Floats, Quad, Triple, Values, Vector, scalar
from tiltsim_controllers.references.trajectories import position_reference
from tiltsim_controllers.vehicle.decoupling_matrix import sines_and_cosines, torque_entries
from tiltsim_controllers.vehicle.parameters import drag_ratio
from tiltsim_controllers.vehicle.states import ALPHA_1, TILTROTOR_FIELDS

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan, Scenario


class LoopParameters(NamedTuple):
    """The head of `userdata`."""

    signature: float  # see `tiltsim.closed_loop.loop.ClosedLoop.signature`
    servo_lead: float  # s, rate feed-forward of the tilt servos, 2 zeta / omega_n
    law: Parameters


@scalar
def tiltrotor_controls(
    time: float, qpos: Vector, qvel: Vector, act: Vector, parameters: LoopParameters, knots: Vector
) -> Values:
    """All twelve controls of the tiltrotor: tilt servos, thrusts, rotor accelerations.

    The servo commands lead the planned angles by the servo's own lag, so that a stiff servo
    follows a moving gait and not only a resting one.
    """
    law = parameters.law
    state = tiltrotor_state(qpos, qvel, act)
    return (
        *gait_servo_commands(time, parameters.servo_lead, law.gait, knots),
        *rotor_thrust_controls(act),
        *rotor_accelerations(time, state, law, knots),
    )


@scalar
def _supervised_controls(
    time: float,
    state: Values,
    qvel: Vector,
    act: Vector,
    motion: Triple,
    parameters: LoopParameters,
    knots: Vector,
) -> Quad:
    """Rotor accelerations (rad/s^2); see `tiltsim.closed_loop.loop.SupervisedLaw`."""
    return rotor_accelerations(time, state, parameters.law, knots)


@scalar
def _measured_inputs(
    time: float,
    state: Values,
    qvel: Vector,
    act: Vector,
    motion: Triple,
    parameters: LoopParameters,
    knots: Vector,
) -> Quad:
    """`_supervised_controls` by the measured angular acceleration."""
    return rotor_accelerations(time, state, parameters.law, knots, measured_acceleration(qvel))


def _setup(plan: FlightPlan, signature: float) -> ControlSetup:
    controller, rotorcraft = plan.scenario.controller, plan.scenario.rotorcraft
    assert isinstance(controller, AttitudeAltitudeController)
    law = Parameters(
        vehicle=rotorcraft.resolve(),
        gains=controller.resolve_gains(),
        gait=plan.gait.parameters,
        reference=plan.reference,
        decoupler=DECOUPLERS[controller.decoupler],
        decoupling=DECOUPLINGS[controller.decoupling],
    )
    lead = servo_lead(rotorcraft.tilt_servo)
    return ControlSetup(LoopParameters(signature, lead, law), plan.knots)


@scalar
def _reference_values(
    time: float, state: Values, parameters: LoopParameters, knots: Vector
) -> Values:
    """`REFERENCE_COLUMNS` and `TILT_REFERENCE_COLUMNS`."""
    law = parameters.law
    ratio = drag_ratio(law.vehicle)
    a1, a2, a3, a4 = four(state, ALPHA_1)
    trig = sines_and_cosines(a1, a2, a3, a4)
    torque = torque_entries(trig, ratio)
    x, y, z, _, _, _, _, _, _ = position_reference(time, law.reference, knots)
    roll, pitch, yaw, _, _, _ = attitude_reference(time, state, trig, torque, law, knots)
    a1, a2, a3, a4, _, _, _, _ = tilt_reference(time, law.gait, knots)
    return x, y, z, roll, pitch, yaw, a1, a2, a3, a4


@scalar
def _supervised_reference_values(
    time: float, state: Values, motion: Triple, parameters: LoopParameters, knots: Vector
) -> Values:
    """`REFERENCE_COLUMNS`; see `tiltsim.closed_loop.loop.SupervisedLaw`."""
    return _reference_values(time, state, parameters, knots)[:6]


def _derive(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
    columns = reference_columns(_reference_values, TILTROTOR_FIELDS, samples, setup)
    return columns | singularity_columns(samples, setup.parameters.law.vehicle)


@scalar
def sign_check_values(
    time: float, values: Vector, parameters: LoopParameters, knots: Vector
) -> Values:
    """The determinant of the decoupling matrix, and the rotor speeds where it vanishes with them.

    As published, the factor ``2 |varpi|`` is in one row only, and a rotor at rest is harmless.
    """
    numbers = determinant_and_speeds(time, values, parameters, knots)
    if parameters.law.decoupling == EXACT_DECOUPLING:
        return numbers
    return numbers[0], 1.0, 1.0, 1.0, 1.0


@scalar
def _equation_inputs(time: float, state: Vector, parameters: LoopParameters, knots: Vector) -> Quad:
    """Rotor accelerations (rad/s^2) on the thesis's equations."""
    tilts = gait_tilts(time, state, parameters, knots)
    return rotor_accelerations(time, law_state(state, tilts), parameters.law, knots)


def follows_position(scenario: Scenario) -> bool:
    """Whether a decoupler steers the vehicle to the reference's horizontal position."""
    controller = scenario.controller
    assert isinstance(controller, AttitudeAltitudeController)
    return controller.decoupler != "none"


TILTROTOR: Final = ClosedLoop(
    kind=ROTORCRAFT,
    parameters=LoopParameters,
    setup=_setup,
    dynamics=tiltrotor_dynamics(),
    sampling=Sampling(tiltrotor_controls, refreshed_controls),
    columns=Columns(observe_tiltrotor, _derive),
    monitoring=Monitoring(sign_check_values, determinant_and_speed_causes),
    equations=Equations(
        inputs=_equation_inputs,
        inputs_size=4,
        rates=gait_equation_rates,
        initial=lambda plan, _setup: initial_equation_state(plan),
        observe=observe_gait_equations,
        tilts=gait_tilts,
    ),
    supervised=supervised_law(_supervised_controls, _supervised_reference_values, TILTROTOR_FIELDS),
    follows_position=follows_position,
)
"""The attitude-altitude controller of the tiltrotor."""

MEASURED_TILTROTOR: Final = with_measured_inputs(TILTROTOR, _measured_inputs)
"""The same with the angular acceleration of the plant in place of the model's."""
