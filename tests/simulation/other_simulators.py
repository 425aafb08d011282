"""One vehicle, two flights, three simulators: ours, RotorPy and crazyflow.

With pods at zero the tiltrotor is a plain quadrotor. Mass, inertia, coefficients and rotor lag are
equal in all three; nothing has drag. Commands are held for `SAMPLE`.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from tiltsim_controllers.vehicle.parameters import PRESETS

VEHICLE = PRESETS["ar_drone_2"]
GRAVITY = 9.81  # m/s^2, fixed in RotorPy
SAMPLE = 0.01  # s, between commands
LAG = 0.03  # s, time constant of the rotors
START = np.array([0.3, -0.2, 1.0])  # m
START_SPEED = 362.0  # rad/s
GOAL = np.array([1.3, 0.3, 1.5])  # m


def given_speeds(time, *_state):
    """Rotor speeds (rad/s) over time that turn the vehicle and carry it 9 m away in 2 s."""
    return START_SPEED + 6.0 * np.sin(np.array([5.0, 6.0, 4.0, 7.0]) * time + [0.0, 1.0, 2.0, 3.0])


def hover_speeds(_time, position, velocity, attitude, body_rates):
    """Rotor speeds (rad/s) of a quadrotor's controller that leans toward `GOAL`."""
    ax, ay, az = GOAL - position - 1.6 * velocity
    attitude_error = np.array([-ay, ax, 0.0]) / GRAVITY - attitude
    torque = np.array(VEHICLE[1:4]) * (64.0 * attitude_error - 16.0 * body_rates)
    roll, pitch = torque[:2] / (2.0 * VEHICLE.arm_length)
    yaw = torque[2] * VEHICLE.thrust_coefficient / (4.0 * VEHICLE.drag_coefficient)
    thrusts = np.array([yaw - pitch, roll - yaw, yaw + pitch, -yaw - roll])
    thrusts += VEHICLE.mass * (GRAVITY + az) / 4.0
    return np.sqrt(thrusts / VEHICLE.thrust_coefficient)


FLIGHTS = {"given_speeds": (given_speeds, 2.0), "hover_step": (hover_speeds, 5.0)}
"""Rotor speeds ``(time, position, velocity, attitude, body_rates)``, duration (s)."""


def fly_tiltsim(name):
    """Positions (m) at each sample, shape (samples + 1, 3)."""
    import tiltsim

    speeds, duration = FLIGHTS[name]
    simulation = {"timestep": 0.001, "control_timestep": SAMPLE, "record_timestep": SAMPLE}
    scenario = tiltsim.parse_scenario(
        {
            "simulation": simulation | {"duration": duration},
            "vehicle": {"gravity": GRAVITY, "rotor_time_constant": LAG},
            "initial": {"position": START.tolist(), "rotor_speed": START_SPEED},
            "controller": {"decoupling": "exact", "gains": "exact"},  # admit the sample time
        }
    )

    def command(seen):
        state = seen.position, seen.velocity, seen.attitude, seen.body_rates
        return tiltsim.Command(rotor_speeds=speeds(seen.time, *state), tilt_angles=np.zeros(4))

    flight = tiltsim.simulate(scenario, controller=command)
    assert flight.end.kind == "completed"
    return np.column_stack([flight[axis] for axis in "xyz"])


def fly_rotorpy(name):
    """The flight in RotorPy, integrated to 1e-11."""
    from rotorpy.vehicles.multirotor import Multirotor

    speeds, duration = FLIGHTS[name]
    arm = VEHICLE.arm_length
    places = [(arm, 0.0, 0.0), (0.0, arm, 0.0), (-arm, 0.0, 0.0), (0.0, -arm, 0.0)]
    parameters = {
        "mass": VEHICLE.mass,
        **dict(zip(("Ixx", "Iyy", "Izz"), VEHICLE[1:4], strict=True)),
        **dict.fromkeys(("Ixy", "Ixz", "Iyz"), 0.0),
        "num_rotors": 4,
        "rotor_pos": {f"r{rotor}": np.array(place) for rotor, place in enumerate(places)},
        "rotor_directions": np.array([1, -1, 1, -1]),
        "rotor_speed_min": 0.0,
        "rotor_speed_max": 1e4,
        "tau_m": LAG,
        "k_eta": VEHICLE.thrust_coefficient,
        "k_m": VEHICLE.drag_coefficient,
    }
    tight = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-11}
    vehicle = Multirotor(parameters, aero=False, integrator_kwargs=tight)
    at_rest = {"x": START, "v": np.zeros(3), "w": np.zeros(3), "wind": np.zeros(3)}
    upright = np.array([0.0, 0.0, 0.0, 1.0])
    state = at_rest | {"q": upright, "rotor_speeds": np.full(4, START_SPEED)}
    positions = [START]
    for sample in range(round(duration / SAMPLE)):
        attitude = Rotation.from_quat(state["q"]).as_euler("ZYX")[::-1]
        command = speeds(sample * SAMPLE, state["x"], state["v"], attitude, state["w"])
        state = vehicle.step(state, {"cmd_motor_speeds": command}, SAMPLE)
        positions.append(state["x"])
    return np.array(positions)


def fly_crazyflow(name, steps_per_second, folder):
    """The flight in crazyflow, with its RK4, in a separate process.

    It needs an environment variable before SciPy is imported.
    """
    file = Path(folder) / f"{name}_{steps_per_second}.npy"
    arguments = ["-W", "ignore", "-m", __name__, name, str(steps_per_second), str(file)]
    environment = os.environ | {"SCIPY_ARRAY_API": "1", "JAX_ENABLE_X64": "1"}
    root = Path(__file__).parents[2]
    subprocess.run([sys.executable, *arguments], env=environment, cwd=root, check=True)
    return np.load(file)


def _fly_crazyflow(name, steps_per_second):
    import jax.numpy as jnp
    from crazyflow import Sim

    speeds, duration = FLIGHTS[name]
    vehicle = Sim(
        dynamics="first_principles", control="rotor_vel", integrator="rk4", freq=steps_per_second
    )
    for limit in ("clip_rotor_vel_cmd", "clip_floor_pos"):
        del vehicle.step_pipeline[limit]
    vehicle.build_step_fn()
    rpm = 60.0 / (2.0 * np.pi)
    inertia = np.diag(VEHICLE[1:4])
    parameters = {
        "mass": [VEHICLE.mass],
        "L": [VEHICLE.arm_length],
        "prop_inertia": [0.0],
        "gravity_vec": [0.0, 0.0, -GRAVITY],
        "J": inertia,
        "J_inv": np.linalg.inv(inertia),
        "rpm2thrust": [[0.0, 0.0, VEHICLE.thrust_coefficient / rpm**2]],
        "rpm2torque": [[0.0, 0.0, VEHICLE.drag_coefficient / rpm**2]],
        "mixing_matrix": [[0.0, 1.0, 0.0, -1.0], [-1.0, 0.0, 1.0, 0.0], [1.0, -1.0, 1.0, -1.0]],
        "drag_matrix": np.zeros((3, 3)),
        "rotor_dyn_coef": [[1.0 / LAG, 0.0, 1.0 / LAG, 0.0]],
    }
    arrays = {key: jnp.asarray(value) for key, value in parameters.items()}
    state = vehicle.data.states.replace(
        pos=jnp.asarray(START).reshape(1, 1, 3), rotor_vel=jnp.full((1, 1, 4), START_SPEED * rpm)
    )
    vehicle.data = vehicle.data.replace(params=vehicle.data.params.replace(**arrays), states=state)
    positions = [START]
    for sample in range(round(duration / SAMPLE)):
        state = vehicle.data.states
        position, velocity, quaternion, body_rates = (
            np.asarray(part)[0, 0] for part in (state.pos, state.vel, state.quat, state.ang_vel)
        )
        attitude = Rotation.from_quat(quaternion).as_euler("ZYX")[::-1]
        command = speeds(sample * SAMPLE, position, velocity, attitude, body_rates)
        vehicle.rotor_vel_control(jnp.asarray(command * rpm).reshape(1, 1, 4))
        vehicle.step(round(SAMPLE * steps_per_second))
        positions.append(np.asarray(vehicle.data.states.pos)[0, 0])
    return np.array(positions)


if __name__ == "__main__":
    np.save(sys.argv[3], _fly_crazyflow(sys.argv[1], int(sys.argv[2])))
