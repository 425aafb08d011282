"""The plant's angular acceleration, measured for a controller of the tiltrotor that feeds it back.

Thrusts, servos, air and lagging rotors depend on the state and not on the rotor accelerations that
a controller commands, so the angular acceleration is known at the instant of a control step: the
controls are computed once to find it, and once more with it.
"""

from __future__ import annotations

from functools import cache
from math import inf
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from tiltsim.closed_loop.loop import ClosedLoop
from tiltsim.equations.actuator_level import (
    Loads,
    mechanics,
    mechanics_record,
    servo_accelerations_of,
)
from tiltsim.laws.layers.layer import Layer, wrap_loop
from tiltsim.laws.layers.on_equations import read_actuators
from tiltsim.laws.tiltrotor import four
from tiltsim.models.parts import SERVO_ARMATURE
from tiltsim.vehicles.rotorcraft import rotor_limits
from tiltsim.vehicles.rotorcraft.layout import CROSS, TILT_1, TILT_RATE_1
from tiltsim_controllers.mathematics.scalar import Triple, Values, Vector, clipped, scalar
from tiltsim_controllers.vehicle.decoupling_matrix import (
    body_torque,
    sines_and_cosines,
    torque_entries,
)
from tiltsim_controllers.vehicle.parameters import Vehicle, drag_ratio
from tiltsim_controllers.vehicle.rigid_body import cross

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan


CROSS_THRUSTS: Final = CROSS.thrust_1


class Motion(NamedTuple):
    """What the angular acceleration depends on besides state and controls."""

    mechanics: mechanics_record(Vehicle, CROSS.tilts)  # type: ignore[valid-type]
    least_thrust: float  # (rad/s)^2, limits of the thrusts' controls
    greatest_thrust: float
    gyroscopic: float  # factor of the gyroscopic torque, 0 on the thesis plant
    pod_inertia: float  # kg m^2, 0 of massless pods, which only MuJoCo does not have
    pod_share: float  # of a pod's inertia in that of its hinge, which has the servo's armature


_servo_accelerations: Final = servo_accelerations_of(CROSS.tilts)


@scalar
def plant_angular_acceleration(
    qpos: Vector, qvel: Vector, ctrl: Vector, loads: Loads, motion: Motion
) -> Triple:
    """Angular acceleration (rad/s^2, body axes) of the simulated tiltrotor.

    Euler's equation with the momentum of the pods, ``I omega' + sum J alpha_i'' a_i + omega x
    (I omega + sum J alpha_i' a_i) = torque``, and for each hinge with the servo's armature ``A``
    ``(J + A) alpha_i'' + J a_i . omega' = servo torque``. Impacts on stops or ground are left out.

    Args:
        qpos, qvel, ctrl: MuJoCo's.
        loads: Of air and spinning rotors.
        motion: The parameters.
    """
    vehicle, pod, share = motion.mechanics.vehicle, motion.pod_inertia, motion.pod_share
    ixx, iyy, izz = vehicle.inertia_xx, vehicle.inertia_yy, vehicle.inertia_zz
    low, high = motion.least_thrust, motion.greatest_thrust
    tilts, rates = four(qpos, TILT_1), four(qvel, TILT_RATE_1)
    thrusts = four(ctrl, CROSS_THRUSTS)
    trig = sines_and_cosines(tilts[0], tilts[1], tilts[2], tilts[3])
    # The controls are s varpi |varpi| with s = (-1, 1, -1, 1), the matrix's are without s.
    tx, ty, tz = body_torque(
        torque_entries(trig, drag_ratio(vehicle)),
        -clipped(thrusts[0], low, high),
        clipped(thrusts[1], low, high),
        -clipped(thrusts[2], low, high),
        clipped(thrusts[3], low, high),
    )
    per_torque = vehicle.arm_length * vehicle.thrust_coefficient

    # The hinges lie along x, y, -x and -y.
    omega = (qvel[3], qvel[4], qvel[5])
    servo_1, servo_2, servo_3, servo_4 = _servo_accelerations(
        ctrl, tilts, rates, loads, motion.mechanics
    )
    momentum = (
        ixx * omega[0] + pod * (rates[0] - rates[2]),
        iyy * omega[1] + pod * (rates[1] - rates[3]),
        izz * omega[2],
    )
    gx, gy, gz = cross(omega, momentum)
    x, y, z = loads[3], loads[4], loads[5]
    gyroscopic, carried = motion.gyroscopic, 2.0 * pod * share
    return (
        (per_torque * tx + x - gyroscopic * gx - pod * (servo_1 - servo_3)) / (ixx - carried),
        (per_torque * ty + y - gyroscopic * gy - pod * (servo_2 - servo_4)) / (iyy - carried),
        (per_torque * tz + z - gyroscopic * gz) / izz,
    )


def _motion(plan: FlightPlan) -> Motion:
    scenario = plan.scenario
    least, greatest = rotor_limits(scenario).thrust_range or (-inf, inf)
    plant = scenario.simulation.plant
    pod = scenario.rotorcraft.pod.inertia if plant == "mujoco" else 0.0
    return Motion(
        mechanics=mechanics(plan),
        least_thrust=least,
        greatest_thrust=greatest,
        gyroscopic=float(plant != "thesis"),
        pod_inertia=pod,
        pod_share=pod / (pod + SERVO_ARMATURE),
    )


@cache
def with_measured_acceleration(loop: ClosedLoop) -> ClosedLoop:
    """A loop whose controller reads, after MuJoCo's velocities, the angular acceleration.

    It goes around all other layers, whose controls move the plant.
    """
    inner_controls = loop.sampling.controls
    _, loads = read_actuators(loop.dynamics)

    @scalar
    def controls(
        time: float, qpos: Vector, qvel: Vector, act: Vector, parameters: Any, knots: Vector
    ) -> Values:
        inner = parameters.inner
        ctrl = inner_controls(time, qpos, (*qvel, 0.0, 0.0, 0.0), act, inner, knots)
        p_rate, q_rate, r_rate = plant_angular_acceleration(
            qpos, qvel, ctrl, loads(ctrl), parameters.layer
        )
        return inner_controls(time, qpos, (*qvel, p_rate, q_rate, r_rate), act, inner, knots)

    return wrap_loop(loop, Layer("with_measured_acceleration", Motion, _motion, controls=controls))
