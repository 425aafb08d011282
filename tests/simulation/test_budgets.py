"""Momentum and energy of flights against the work of their rotors, found from positions alone."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import simpson
from scipy.spatial.transform import Rotation

import tiltsim
from tests.laws.layers.test_loaded_hinges import LAG, tables, vehicle_file
from tiltsim.models.cross import as_multirotor

INERTIA = 1e-5  # kg m^2, of a rotor
TROT = {"type": "trot_continuous", "amplitude": 0.4, "period": 1.0}


def tiltrotor(plant, vehicle):
    """Ch. 4's vehicle in a smooth part of its trot, turning about all axes."""
    return {
        "vehicle": vehicle,
        "controller": {"decoupling": "exact", "decoupler": "exact", "gains": "exact"},
        "gait": TROT,
        "initial": {"attitude": [0.1, -0.05, 0.2], "angular_velocity": [0.5, -0.4, 0.6]},
        "simulation": {
            **{"duration": 0.2, "timestep": 0.001, "record_timestep": 0.001},
            **{"plant": plant, "engine": "python"},
        },
    }


def budgets(flight, inertia):
    """Changes of momentum, angular momentum and energy, and the rotors' contributions.

    Rotors are turned about their hinges one by one; the angular momentum includes their spin.
    """
    vehicle = flight.scenario.vehicle.resolve()
    vehicle = as_multirotor(vehicle, tilting=True)
    matrix, weight = np.reshape(vehicle.inertia, (3, 3)), vehicle.mass * vehicle.gravity
    time, speeds, omega = flight["time"], flight["rotor_speeds"], flight["body_rates"]
    force, torque, spin = np.zeros((3, len(time), 3))
    for i, rotor in enumerate(vehicle.rotors):
        hinge, turn = np.zeros(3), Rotation.from_rotvec(np.zeros((len(time), 3)))
        if rotor.tilt >= 0:
            hinge = np.array(rotor.hinge)
            angles = flight["tilt_angles"][:, rotor.tilt, np.newaxis]
            turn = Rotation.from_rotvec(angles * rotor.hinge_axis)
        axes, places = turn.apply(rotor.axis), hinge + turn.apply(rotor.place - hinge)
        speed = speeds[:, i, np.newaxis]
        push = rotor.spin * rotor.thrust * speed * np.abs(speed) * axes
        force += push
        torque += np.cross(places, push) - rotor.drag * speed * np.abs(speed) * axes
        spin += inertia * speed * axes
    attitude = Rotation.from_euler("ZYX", flight["attitude"][:, ::-1])
    carried = omega @ matrix
    pushed = attitude.apply(force) - (0.0, 0.0, weight)
    turned = torque
    if flight.scenario.simulation.plant == "thesis":  # without the body's gyroscopic torque
        turned = torque + np.cross(omega, carried)
    velocity, height = flight["velocity"], flight["position"][:, 2]
    energy = 0.5 * vehicle.mass * np.sum(velocity**2, axis=1) + weight * height
    energy += 0.5 * np.sum(omega * carried, axis=1)
    power = np.sum(attitude.apply(force) * velocity + torque * omega, axis=1)
    kept = vehicle.mass * velocity, attitude.apply(carried + spin), energy
    flows = pushed, attitude.apply(turned), power
    return [
        (held[-1] - held[0], simpson(flow, x=time, axis=0), np.ptp(held))
        for held, flow in zip(kept, flows, strict=True)
    ]


@pytest.mark.parametrize("plant", ["mujoco", "rigid_body", "thesis"])
@pytest.mark.parametrize(("kind", "inertia"), [("tiltrotor", 0.0), ("loaded hinges", INERTIA)])
def test_rotors_make_all_changes_of_momentum_and_energy(kind, inertia, plant, tmp_path):
    if kind == "tiltrotor":
        desired = tiltrotor(plant, {**LAG, "rotor_inertia": inertia})
    else:
        file = vehicle_file(tmp_path, beside=0.004, inclined=0.1, seed=4)
        often = {"record_timestep": 0.001}
        vehicle = {**file, **LAG, "rotor_inertia": inertia}
        desired = tables(vehicle, plant, tilts=5, simulation=often)
    flight = tiltsim.simulate(desired)
    assert flight.end.kind == "completed"
    momentum, turning, energy = budgets(flight, inertia)
    for change, made, scale in (momentum, turning, energy)[: 2 if inertia else 3]:
        np.testing.assert_allclose(change, made, rtol=0.0, atol=2e-5 * scale)
        assert scale > 1e-4
