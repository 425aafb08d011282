"""The plant's angular acceleration, measured for a controller of rotor speeds that feeds it back.

Thrusts, servos, air and lagging rotors depend on the state and not on the rotor accelerations that
a controller commands, so the angular acceleration is known at the instant of a control step: the
controls are computed once to find it, and once more with it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import inf
from typing import TYPE_CHECKING, Any

from tiltsim.closed_loop.loop import ClosedLoop, Dynamics
from tiltsim.equations.actuator_level import (
    Loads,
    mechanics,
    mechanics_record,
    servo_accelerations_of,
)
from tiltsim.laws.layers.layer import Layer, wrap_loop
from tiltsim.laws.layers.on_equations import read_actuators
from tiltsim.vehicles.rotorcraft import rotor_limits
from tiltsim.vehicles.rotorcraft.layout import TILT_1, TILT_RATE_1, layout_of
from tiltsim.vehicles.rotorcraft.rotors import body_less, rotor_code
from tiltsim_controllers.mathematics.records import make_record_type, vector_of
from tiltsim_controllers.mathematics.scalar import Triple, Values, Vector, clipped, scalar
from tiltsim_controllers.mathematics.vectors import componentwise, entries_of
from tiltsim_controllers.vehicle.rigid_body import cross

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan


@cache
def motion_record(dynamics: Dynamics) -> Any:
    """The type of what the angular acceleration depends on besides state and controls."""
    code, (rotors, tilts) = rotor_code(dynamics), layout_of(dynamics)
    return make_record_type(
        "Motion",
        mechanics=mechanics_record(code.record, rotors, tilts),
        least_thrust=float,  # (rad/s)^2, limits of the thrusts' controls
        greatest_thrust=float,
        gyroscopic=float,  # factor of the gyroscopic torque, 0 on the thesis plant
        pod_inertias=vector_of(tilts),  # kg m^2, about the hinges; 0 of massless pods
        turning=code.body,  # the body that turns where pods and the servos' armatures give way
    )


@cache
def plant_angular_acceleration_of(dynamics: Dynamics) -> Callable[..., Triple]:
    """Scalar code of the angular acceleration (rad/s^2, body axes) of a simulated vehicle.

    It is ``(qpos, qvel, ctrl, loads, motion) -> acceleration``: MuJoCo's vectors, the loads of air
    and spinning rotors, and a `motion_record`. Euler's equation with the momentum of the pods, ``I
    omega' + sum J alpha_i'' a_i + omega x (I omega + sum J alpha_i' a_i) = torque``, and for each
    hinge with the servo's armature ``A`` ``(J + A) alpha_i'' + J a_i . omega' = servo torque``.
    Impacts on stops or ground are left out.
    """
    layout, code = layout_of(dynamics), rotor_code(dynamics)
    rotors, tilts = layout
    torque_of, pods_of = code.torque, code.pods
    inertia_times, inverse = code.inertia, code.inverse
    tilts_in, rates_in = entries_of(TILT_1, tilts), entries_of(TILT_RATE_1, tilts)
    limited = componentwise(
        f"limited_thrusts_{layout.thrust_1}",
        "ctrl, low, high",
        f"clipped(ctrl[{layout.thrust_1} + @], low, high)",
        rotors,
        clipped=clipped,
    )
    servo_accelerations = servo_accelerations_of(dynamics.tilt_of_rotor, tilts)

    @scalar
    def plant_angular_acceleration(
        qpos: Vector, qvel: Vector, ctrl: Vector, loads: Loads, motion: Any
    ) -> Triple:
        own = motion.mechanics
        vehicle, pods, gyroscopic = own.vehicle, motion.pod_inertias, motion.gyroscopic
        angles, rates = tilts_in(qpos), rates_in(qvel)
        thrusts = limited(ctrl, motion.least_thrust, motion.greatest_thrust)
        tx, ty, tz = torque_of(angles, thrusts, vehicle)
        omega = (qvel[3], qvel[4], qvel[5])
        ix, iy, iz = inertia_times(omega, vehicle)
        px, py, pz = pods_of(pods, rates, vehicle)
        gx, gy, gz = cross(omega, (ix + px, iy + py, iz + pz))
        servos = servo_accelerations(ctrl, thrusts, angles, rates, loads, own)
        sx, sy, sz = pods_of(pods, servos, vehicle)
        remaining = (
            tx + loads[3] - gyroscopic * gx - sx,
            ty + loads[4] - gyroscopic * gy - sy,
            tz + loads[5] - gyroscopic * gz - sz,
        )
        acceleration: Triple = inverse(remaining, motion.turning)
        return acceleration

    return plant_angular_acceleration


@cache
def with_measured_acceleration(loop: ClosedLoop) -> ClosedLoop:
    """A loop whose controller reads, after MuJoCo's velocities, the angular acceleration.

    It goes around all other layers, whose controls move the plant.
    """
    inner_controls = loop.sampling.controls
    dynamics, record = loop.dynamics, motion_record(loop.dynamics)
    _, loads = read_actuators(dynamics)
    plant_angular_acceleration = plant_angular_acceleration_of(dynamics)

    def read(plan: FlightPlan) -> Any:
        scenario = plan.scenario
        plant, vehicle = scenario.simulation.plant, scenario.any_rotorcraft
        least, greatest = rotor_limits(scenario).thrust_range or (-inf, inf)
        hinges = vehicle.hinge_inertias[: layout_of(dynamics).tilts]
        pods = vehicle.pod_inertias if plant == "mujoco" else (0.0,) * len(hinges)
        # What a pod's reaction turns of itself; the rest of the hinge is the servo's armature.
        carried = tuple(pod * (pod / hinge) for pod, hinge in zip(pods, hinges, strict=True))
        return record(
            mechanics=mechanics(plan),
            least_thrust=least,
            greatest_thrust=greatest,
            gyroscopic=float(plant != "thesis"),
            pod_inertias=pods,
            turning=body_less(scenario, carried),
        )

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

    return wrap_loop(loop, Layer("with_measured_acceleration", record, read, controls=controls))
