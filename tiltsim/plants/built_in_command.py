"""What a built-in controller commands in the present state of its plant."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.laws.layers.actuation import Actuation, allocated_accelerations
from tiltsim.laws.layers.measured_acceleration import Motion, plant_angular_acceleration
from tiltsim.laws.layers.on_equations import read_actuators
from tiltsim.laws.layers.sensing import measured_qpos, measured_qvel
from tiltsim.laws.tiltrotor import four
from tiltsim.plants.command import Command
from tiltsim.plants.mujoco_plant import MujocoPlant
from tiltsim.plants.observing import flip_by_spin
from tiltsim.vehicles.rotorcraft.layout import ACCELERATION_1, QUADROTOR_THRUSTS


def built_in_command(assembly: Assembly, plant: MujocoPlant) -> Command:
    """The command of a rotorcraft's built-in controller now, before latency, servos and motors.

    It goes inwards through the layers of the loop, to what the controller itself reads.
    """
    loop, parameters, knots = assembly.loop, assembly.setup.parameters, assembly.setup.knots
    time, data = plant.evaluation_time, plant.data
    qpos: Sequence[float] = data.qpos.tolist()
    qvel: Sequence[float] = data.qvel.tolist()
    act, allocation = data.act.tolist(), None
    while loop.within is not None:
        layer, within, inner = parameters.layer, loop.within, parameters.inner
        if isinstance(layer, Motion):
            ctrl = within.sampling.controls(time, qpos, (*qvel, 0.0, 0.0, 0.0), act, inner, knots)
            loads = read_actuators(within.dynamics)[1](ctrl)
            qvel = (*qvel, *plant_angular_acceleration(qpos, qvel, ctrl, loads, layer))
        elif isinstance(layer, Actuation):
            qpos = measured_qpos(time, qpos, layer.sensors)
            qvel = measured_qvel(time, qvel, layer.sensors)
            allocation = layer.allocation
        loop, parameters = within, inner
    ctrl = loop.sampling.controls(time, qpos, qvel, act, parameters, knots)
    if loop.dynamics.model == "quadrotor":
        coefficient = assembly.scenario.rotorcraft.resolve().thrust_coefficient
        return Command(thrusts=coefficient * np.array(four(ctrl, QUADROTOR_THRUSTS)))
    rates = four(ctrl, ACCELERATION_1)
    if allocation is not None:
        rates = allocated_accelerations(rates, qpos, act, allocation)
    return Command(
        rotor_accelerations=np.array(flip_by_spin(rates)), tilt_angles=np.array(four(ctrl, 0))
    )
