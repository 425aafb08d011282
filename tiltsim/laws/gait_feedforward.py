"""The attitude-altitude controller with tilt-rate feed-forward in a closed loop (ch. 4)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from tiltsim.closed_loop.loop import (
    ClosedLoop,
    Columns,
    ControlSetup,
    Equations,
    Monitoring,
    Sampling,
)
from tiltsim.equations.tiltrotor import FURTHER, law_state
from tiltsim.laws.attitude_altitude import follows_position
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
from tiltsim.scenario.multirotor_controllers import AttitudeForceController
from tiltsim.scenario.tiltrotor_controllers import AttitudeAltitudeController
from tiltsim.vehicles.rotorcraft import ROTORCRAFT
from tiltsim.vehicles.rotorcraft.layout import TILT_RATE_1
from tiltsim_controllers.gaits.tilts import tilt_reference
from tiltsim_controllers.laws.decouplers import DECOUPLERS
from tiltsim_controllers.laws.gait_feedforward import INTEGRAL_FIELDS, Parameters, tracking_inputs
from tiltsim_controllers.laws.supervisor import SUPERVISOR_AT_REST
from tiltsim_controllers.mathematics.scalar import Floats, Triple, Values, Vector, scalar
from tiltsim_controllers.references.trajectories import position_reference
from tiltsim_controllers.vehicle.states import ROTORS, TILTROTOR_FIELDS

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan

TILT_RATE_COLUMNS: Final = tuple(f"alpha_rate_{rotor}" for rotor in ROTORS)


class LoopParameters(NamedTuple):
    """The head of `userdata`."""

    signature: float  # see `tiltsim.closed_loop.loop.ClosedLoop.signature`
    servo_lead: float  # s, rate feed-forward of the tilt servos, 2 zeta / omega_n
    law: Parameters


@scalar
def _supervised_controls(
    time: float,
    state: Values,
    qvel: Vector,
    act: Vector,
    motion: Triple,
    parameters: LoopParameters,
    knots: Vector,
) -> Values:
    """Rotor accelerations and rates of the integrals, as `SupervisedLaw.controls`."""
    tilt_rates, integrals = four(qvel, TILT_RATE_1), (act[4], act[5], act[6])
    return tracking_inputs(time, state, tilt_rates, integrals, parameters.law, knots, motion)[:7]


@scalar
def _measured_inputs(
    time: float,
    state: Values,
    qvel: Vector,
    act: Vector,
    motion: Triple,
    parameters: LoopParameters,
    knots: Vector,
) -> Values:
    """`_supervised_controls` by the measured angular acceleration."""
    tilt_rates, integrals = four(qvel, TILT_RATE_1), (act[4], act[5], act[6])
    measured = measured_acceleration(qvel)
    law = parameters.law
    return tracking_inputs(time, state, tilt_rates, integrals, law, knots, motion, measured)[:7]


@scalar
def _gait_feedforward_controls(
    time: float, qpos: Vector, qvel: Vector, act: Vector, parameters: LoopParameters, knots: Vector
) -> Values:
    """All fifteen controls: tilt servos, thrusts, rotor accelerations, rates of the integrals."""
    law = parameters.law
    state = tiltrotor_state(qpos, qvel, act)
    return (
        *gait_servo_commands(time, parameters.servo_lead, law.gait, knots),
        *rotor_thrust_controls(act),
        *_supervised_controls(time, state, qvel, act, SUPERVISOR_AT_REST, parameters, knots),
    )


def tracking_fields(plan: FlightPlan) -> dict[str, Any]:
    """The parameters that controllers with feed-forward of the gait share, by name."""
    controller, gait = plan.scenario.controller, plan.gait
    assert isinstance(controller, (AttitudeAltitudeController, AttitudeForceController))
    # The thesis's equations omit the gyroscopic torque.
    gyroscopic_torque = plan.scenario.simulation.plant != "thesis"
    return {
        "gains": controller.resolve_gains(),
        "integral": controller.resolve_integral_gains(),
        "max_acceleration": controller.max_acceleration,
        "max_angular_acceleration": controller.max_angular_acceleration,
        "anticipation": min(controller.anticipation, 0.5 * gait.min_segment_time),
        "terms": controller.resolve_feedforward_terms(gyroscopic_torque=gyroscopic_torque),
        "gait": gait.parameters,
        "reference": plan.reference,
        "decoupler": DECOUPLERS[controller.decoupler],
    }


def _setup(plan: FlightPlan, signature: float) -> ControlSetup:
    scenario, controller = plan.scenario, plan.scenario.controller
    assert isinstance(controller, AttitudeAltitudeController)
    vehicle, spin_inertia = scenario.rotorcraft.resolve(), scenario.rotorcraft.rotor_inertia
    law = Parameters(
        vehicle=vehicle,
        **tracking_fields(plan),
        supervisor=controller.resolve_supervisor(vehicle),
        rotor_inertia=spin_inertia if controller.rotor_inertia_feedforward else 0.0,
    )
    lead = servo_lead(scenario.rotorcraft.tilt_servo)
    return ControlSetup(LoopParameters(signature, lead, law), plan.knots)


@scalar
def _supervised_reference_values(
    time: float, state: Vector, motion: Triple, parameters: LoopParameters, knots: Vector
) -> tuple[float, float, float, float, float, float]:
    """Position (m) and attitude (rad) to track; ``state`` has the `REFERENCE_FIELDS`."""
    law = parameters.law
    x, y, z, _, _, _, _, _, _ = position_reference(time, law.reference, knots)
    _, _, _, _, _, _, _, roll, pitch, yaw = tracking_inputs(
        time,
        (*four(state, 0), *four(state, 4), *four(state, 8), *four(state, 12), *four(state, 16)),
        four(state, 20),
        (state[24], state[25], state[26]),
        law,
        knots,
        motion,
    )
    return x, y, z, roll, pitch, yaw


@scalar
def _reference_values(
    time: float, state: Vector, parameters: LoopParameters, knots: Vector
) -> Values:
    """Columns of references; ``state`` has the `REFERENCE_FIELDS`."""
    a1, a2, a3, a4, _, _, _, _ = tilt_reference(time, parameters.law.gait, knots)
    return (
        *_supervised_reference_values(time, state, SUPERVISOR_AT_REST, parameters, knots),
        a1,
        a2,
        a3,
        a4,
    )


REFERENCE_FIELDS: Final = (*TILTROTOR_FIELDS, *TILT_RATE_COLUMNS, *INTEGRAL_FIELDS)
"""Fields of a sample that the references depend on."""


def _derive(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
    columns = reference_columns(_reference_values, REFERENCE_FIELDS, samples, setup)
    return columns | singularity_columns(samples, setup.parameters.law.vehicle)


@scalar
def _observe_gait_feedforward(qpos: Vector, qvel: Vector, act: Vector, ctrl: Vector) -> Values:
    """The tiltrotor and the integrals."""
    return (*observe_tiltrotor(qpos, qvel, act, ctrl), act[4], act[5], act[6])


@scalar
def _equation_inputs(
    time: float, state: Vector, parameters: LoopParameters, knots: Vector
) -> Values:
    """Rotor accelerations and rates of the integrals on the thesis's equations."""
    law = parameters.law
    a1, a2, a3, a4, rate_1, rate_2, rate_3, rate_4 = tilt_reference(time, law.gait, knots)
    u1, u2, u3, u4, x_rate, y_rate, z_rate, _roll, _pitch, _yaw = tracking_inputs(
        time,
        law_state(state, (a1, a2, a3, a4)),
        (rate_1, rate_2, rate_3, rate_4),
        (state[FURTHER], state[FURTHER + 1], state[FURTHER + 2]),
        law,
        knots,
    )
    return u1, u2, u3, u4, x_rate, y_rate, z_rate


@scalar
def equation_rates(
    time: float,
    state: Vector,
    inputs: Vector,
    parameters: LoopParameters,
    knots: Vector,
    disturbance: Triple,
) -> Values:
    """`gait_equation_rates`, followed by the integrals."""
    body = gait_equation_rates(time, state, inputs, parameters, knots, disturbance)
    return (*body, inputs[4], inputs[5], inputs[6])


@scalar
def observe_equations(
    time: float, state: Vector, inputs: Vector, parameters: LoopParameters, knots: Vector
) -> Values:
    """`observe_gait_equations`, followed by the integrals."""
    body = observe_gait_equations(time, state, inputs, parameters, knots)
    return (*body, state[FURTHER], state[FURTHER + 1], state[FURTHER + 2])


GAIT_FEEDFORWARD: Final = ClosedLoop(
    kind=ROTORCRAFT,
    parameters=LoopParameters,
    setup=_setup,
    dynamics=tiltrotor_dynamics(len(INTEGRAL_FIELDS), lambda _plan: (0.0, 0.0, 0.0)),
    sampling=Sampling(_gait_feedforward_controls, refreshed_controls),
    columns=Columns(
        _observe_gait_feedforward,
        _derive,
        fields=INTEGRAL_FIELDS,
        units=dict.fromkeys(INTEGRAL_FIELDS, "m s"),
    ),
    monitoring=Monitoring(determinant_and_speeds, determinant_and_speed_causes),
    equations=Equations(
        inputs=_equation_inputs,
        inputs_size=7,
        rates=equation_rates,
        initial=lambda plan, _setup: (*initial_equation_state(plan), 0.0, 0.0, 0.0),
        observe=observe_equations,
        tilts=gait_tilts,
    ),
    supervised=supervised_law(_supervised_controls, _supervised_reference_values, REFERENCE_FIELDS),
    follows_position=follows_position,
)
"""The attitude-altitude controller with tilt-rate feed-forward, of the tiltrotor."""

MEASURED_GAIT_FEEDFORWARD: Final = with_measured_inputs(GAIT_FEEDFORWARD, _measured_inputs)
"""The same with the angular acceleration of the plant in place of the model's."""
