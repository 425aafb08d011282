"""The plant's angular acceleration, measured for a controller of rotor speeds that feeds it back.

Thrusts, servos, air and lagging rotors depend on the state and not on the rotor accelerations that
a controller commands, so the angular acceleration is known at the instant of a control step: the
controls are computed once to find it, and once more with it.
"""

from collections.abc import Callable
from functools import cache
from math import inf
from typing import Any

from tiltsim.closed_loop.loop import ClosedLoop
from tiltsim.equations.actuator_level import mechanics, mechanics_record, servo_accelerations
from tiltsim.laws.layers.layer import Layer, wrap_loop
from tiltsim.laws.layers.on_equations import read_actuators
from tiltsim.scenario.scenario import FlightPlan
from tiltsim.vehicles.rotorcraft import rotor_limits
from tiltsim.vehicles.rotorcraft.layout import TILT_1, TILT_RATE_1, layout_of, tilt_of_rotor
from tiltsim.vehicles.rotorcraft.rotors import body_less, rotors_record
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.code.traceable import traceable
from tiltsim_controllers.mathematics.linear import cross
from tiltsim_controllers.mathematics.records import make_record_type, vector_of
from tiltsim_controllers.vehicle.body import Body, inertia_matrix, inverse_inertia_matrix
from tiltsim_controllers.vehicle.craft import craft_of
from tiltsim_controllers.vehicle.rotors import wrench_map


@cache
def motion_record(loop: ClosedLoop) -> Any:
    """The type of the parameters of the angular acceleration."""
    tilts = layout_of(loop).tilts
    return make_record_type(
        "Motion",
        mechanics=mechanics_record(rotors_record(loop), tilts),
        least_thrust=float,  # (rad/s)^2, limits of the thrusts' controls
        greatest_thrust=float,
        gyroscopic=float,  # factor of this torque, 0 of tilting vehicles on the thesis plant
        pod_inertias=vector_of(tilts),  # kg m^2, about the hinges; 0 of massless pods
        turning=Body,  # the body that turns where pods and the servos' armatures give way
    )


@cache
def plant_acceleration_of(loop: ClosedLoop) -> Callable[..., Any]:
    """The accelerations of a simulated vehicle by all forces but gravity, shape (6,).

    It is ``(qpos, qvel, ctrl, loads, motion) -> acceleration``: MuJoCo's vectors, the loads of air
    and spinning rotors, and a `motion_record`. In body axes, first the acceleration of the center
    of mass (m/s^2), then the angular one (rad/s^2) by Euler's equation with the momentum of the
    pods, ``I omega' + sum J alpha_i'' a_i + omega x (I omega + sum J alpha_i' a_i) = torque``, and
    for each hinge with the servo's armature ``A`` ``(J + A) alpha_i'' + J a_i . omega' = servo
    torque``. Impacts on stops or ground are left out.
    """
    layout, tilted = layout_of(loop), tilt_of_rotor(loop)

    @traceable
    def plant_acceleration(qpos: Any, qvel: Any, ctrl: Any, loads: Any, motion: Any) -> Any:
        own, pods = motion.mechanics, motion.pod_inertias
        craft, omega, tilts = craft_of(own.vehicle, tilted), qvel[3:6], qpos[TILT_1:]
        tilt_rates = qvel[TILT_RATE_1 : TILT_RATE_1 + layout.tilts]
        thrusts = xp.clip(ctrl[layout.thrusts], motion.least_thrust, motion.greatest_thrust)
        # The controls are s varpi |varpi| with the spins s, the map's factors are without s.
        turned = wrench_map(craft.rotors, tilts) @ (xp.array(loop.spins) * thrusts)
        wrench = turned + loads[:6]
        momentum = inertia_matrix(craft.body) @ omega + (pods * tilt_rates) @ craft.hinges
        servos = servo_accelerations(craft, ctrl, thrusts, tilts, tilt_rates, loads, own)
        remaining = wrench[3:] - motion.gyroscopic * cross(omega, momentum)
        turning = inverse_inertia_matrix(motion.turning)
        angular = turning @ (remaining - (pods * servos) @ craft.hinges)
        return xp.hstack([wrench[:3] / craft.body.mass, angular])

    return plant_acceleration


def read_motion(plan: FlightPlan, loop: ClosedLoop) -> Any:
    """The `motion_record` of a planned flight."""
    scenario = plan.scenario
    plant, vehicle = scenario.simulation.plant, scenario.any_rotorcraft
    least, greatest = rotor_limits(scenario).thrust_range or (-inf, inf)
    tilts = layout_of(loop).tilts
    hinges = vehicle.hinge_inertias[:tilts]
    pods = vehicle.pod_inertias[:tilts] if plant == "mujoco" else (0.0,) * tilts
    # The share of a pod that its reaction turns; the rest of the hinge is the servo's armature.
    carried = tuple(pod * (pod / hinge) for pod, hinge in zip(pods, hinges, strict=True))
    return motion_record(loop)(
        mechanics=mechanics(plan),
        least_thrust=least,
        greatest_thrust=greatest,
        gyroscopic=float(plant != "thesis" or scenario.vehicle.model == "quadrotor"),
        pod_inertias=pods,
        turning=body_less(scenario, carried),
    )


@cache
def with_measured_acceleration(loop: ClosedLoop) -> ClosedLoop:
    """A loop whose controller reads, after MuJoCo's velocities, the angular acceleration.

    It goes around all other layers, whose controls move the plant.
    """
    _, loads = read_actuators(loop)
    plant_acceleration = plant_acceleration_of(loop)

    def controls(
        within: Any, time: Any, qpos: Any, qvel: Any, act: Any, own: Any, knots: Any
    ) -> Any:
        ctrl = within(qpos, xp.hstack([qvel, xp.zeros(3)]), act)
        measured = plant_acceleration(qpos, qvel, ctrl, loads(ctrl), own)[3:]
        return within(qpos, xp.hstack([qvel, measured]), act)

    layer = Layer(motion_record(loop), lambda plan: read_motion(plan, loop), controls=controls)
    return wrap_loop(loop, layer)
