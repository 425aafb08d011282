"""Flights of a turned, renumbered, mirrored or scaled world are the same flights.

The vehicle has two symmetries: half a turn about its vertical axis exchanges rotors 1 and 3, and 2
and 4; the mirror through the plane between the arms of rotors 1 and 2 exchanges 1 and 2, and 3 and
4, whose spins are opposite. (A quarter turn alone does not permute the rotors: their spins would
not fit.) Half a turn commutes with roll, pitch and yaw, so the control law shares it. The mirror
swaps roll and pitch, which their order does not allow: it holds for given rotor speeds.
"""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tiltsim
from tiltsim.engines import steppers
from tiltsim.laws import assembling
from tiltsim.laws.assembling import loop_of
from tiltsim_controllers.vehicle.parameters import PRESETS, SPIN

VEHICLE = PRESETS["ar_drone_2"]
SCENARIO = {
    "simulation": {"duration": 0.4, "timestep": 0.002, "engine": "python"},
    "vehicle": {"inertia": list(VEHICLE[1:4])},
    "initial": {
        "position": [0.3, -0.2, 0.1],
        "velocity": [0.5, 0.1, -0.2],
        "attitude": [0.1, -0.06, 0.3],
        "angular_velocity": [0.2, -0.1, 0.3],
        "rotor_speed": 361.0,
    },
    "controller": {"decoupling": "exact", "decoupler": "exact", "gains": "exact"},
    "gait": {
        "type": "waypoints",
        "period": 0.6,
        "angles": [[-0.3, -0.1, 0.1, 0.3], [-0.1, -0.3, 0.2, 0.25], [-0.2, -0.25, 0.3, 0.1]],
    },
    "reference": {
        "type": "line",
        "position": [0.2, 0.4, 0.1],
        "velocity": [0.5, -0.3, 0.1],
        "yaw": 0.2,
    },
    "disturbance": [{"type": "acceleration", "value": [0.4, -0.2, 0.1]}],
}
QUADROTOR = {
    "simulation": SCENARIO["simulation"],
    "vehicle": {"model": "quadrotor"},
    "controller": {"law": "yaw_position"},
    "initial": {"attitude": [0.1, -0.06, 0.3], "velocity": [0.5, 0.1, -0.2]},
    "reference": SCENARIO["reference"],
    "disturbance": SCENARIO["disturbance"],
}
QUARTER_TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
MIRROR = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])

each_plant = pytest.mark.parametrize("plant", ["mujoco", "thesis"])


@dataclass(frozen=True)
class Symmetry:
    """Signed permutations of the world's and the body's axes, and of the rotors."""

    world: np.ndarray
    body: np.ndarray
    rotors: tuple[int, ...] = (0, 1, 2, 3)  # which one takes the place of each
    tilt_sign: float = 1.0

    def vector(self, vectors):
        return vectors @ self.world.T

    def rotation(self, rotations):
        return self.world @ rotations @ self.body.T

    def rates(self, rates):
        return np.linalg.det(self.body) * rates @ self.body.T

    def rotors_of(self, columns):
        return columns[..., self.rotors]

    def tilts(self, tilts):
        return self.tilt_sign * self.rotors_of(tilts)

    def euler(self, attitude):
        return euler_from_matrix(self.rotation(matrix_from_euler(attitude)))

    def scenario(self, scenario):
        new = deepcopy(scenario)

        def change(table, key, transformation):
            table[key] = transformation(np.array(table[key])).tolist()

        for key in ("position", "velocity"):
            change(new["initial"], key, self.vector)
            change(new["reference"], key, self.vector)
        change(new["initial"], "attitude", self.euler)
        change(new["initial"], "angular_velocity", self.rates)
        change(new["vehicle"], "inertia", lambda moments: np.abs(self.body) @ moments)
        change(new["gait"], "angles", self.tilts)
        change(new["disturbance"][0], "value", self.vector)
        new["reference"]["yaw"] = self.euler([0.0, 0.0, new["reference"]["yaw"]])[2]
        return new


IDENTITY = np.eye(3)
QUARTER = Symmetry(world=QUARTER_TURN, body=IDENTITY)
RENUMBERED = Symmetry(world=IDENTITY, body=QUARTER_TURN @ QUARTER_TURN, rotors=(2, 3, 0, 1))
MIRRORED = Symmetry(world=MIRROR, body=MIRROR, rotors=(1, 0, 3, 2), tilt_sign=-1.0)


def matrix_from_euler(attitudes):
    return Rotation.from_euler("ZYX", np.asarray(attitudes)[..., ::-1]).as_matrix()


def euler_from_matrix(rotations):
    return Rotation.from_matrix(rotations).as_euler("ZYX")[..., ::-1]


def fly(scenario, plant, controller=None):
    simulation = scenario["simulation"] | {"plant": plant}
    desired = tiltsim.parse_scenario(scenario | {"simulation": simulation})
    flight = tiltsim.simulate(desired, controller=controller)
    assert flight.end.kind == "completed"
    return flight


@cache
def original(plant):
    """The closed-loop flight that others are compared with, flown once."""
    return fly(SCENARIO, plant)


def columns(flight, *names):
    return np.column_stack([flight[name] for name in names])


def of_rotors(flight, name):
    return columns(flight, *(f"{name}_{rotor}" for rotor in range(1, 5)))


def assert_symmetric(flight, other, symmetry, orthogonality=2e-14):
    """Equal up to rounding.

    Each of 200 steps rounds values around 1 to 1e-16 and rotor speeds to 6e-14 rad/s; the law turns
    1e-16 rad into up to 1e-12 rad/s. The sum of all stays below 200 times that.
    """
    assert len(flight) == len(other) > 40
    position, velocity = ("x", "y", "z"), ("vx", "vy", "vz")
    for names, transformation in ((position, symmetry.vector), (velocity, symmetry.vector)):
        np.testing.assert_allclose(
            columns(other, *names), transformation(columns(flight, *names)), rtol=0, atol=2e-14
        )
    attitude = ("roll", "pitch", "yaw")
    np.testing.assert_allclose(
        matrix_from_euler(columns(other, *attitude)),
        symmetry.rotation(matrix_from_euler(columns(flight, *attitude))),
        rtol=0,
        atol=orthogonality,
    )
    np.testing.assert_allclose(
        columns(other, "p", "q", "r"), symmetry.rates(columns(flight, "p", "q", "r")), atol=1e-12
    )
    np.testing.assert_allclose(
        of_rotors(other, "alpha"), symmetry.tilts(of_rotors(flight, "alpha")), rtol=0, atol=1e-13
    )
    speeds = np.abs(of_rotors(flight, "rotor_speed"))
    np.testing.assert_allclose(
        np.abs(of_rotors(other, "rotor_speed")), symmetry.rotors_of(speeds), rtol=0, atol=2e-10
    )


@each_plant
def test_a_turned_world_and_renumbered_rotors_leave_the_closed_loop_the_same(plant):
    flight = original(plant)
    assert np.ptp(of_rotors(flight, "alpha"), axis=0).min() > 0.1
    for symmetry in (QUARTER, RENUMBERED):
        assert_symmetric(flight, fly(symmetry.scenario(SCENARIO), plant), symmetry)


def accelerations(time):
    """Given rotor accelerations along the spins, rad/s^2."""
    return np.array([300.0 * np.sin(3 * time), -200.0 * np.cos(2 * time), 100.0, -150.0])


def open_loop(monkeypatch, scenario, plant, along_spin):
    """A flight with given rotor accelerations, whatever the state."""

    def loop(*arguments, **options):
        found = loop_of(*arguments, **options)
        given = lambda time, *_: tuple((SPIN * along_spin(time)).tolist())  # noqa: E731
        return replace(found, equations=replace(found.equations, inputs=given))

    if plant == "mujoco":
        commanded = lambda seen: tiltsim.Command(rotor_accelerations=along_spin(seen.time))  # noqa: E731
        return fly(scenario, plant, controller=commanded)
    monkeypatch.setattr(assembling, "loop_of", loop)
    monkeypatch.setattr(steppers.Integrated, "traced", False)  # as plain Python
    return fly(scenario, plant)


@each_plant
def test_a_mirror_image_flies_the_mirror_image(plant, monkeypatch):
    """The thesis's equations integrate the nine entries of the rotation.

    Roll, pitch and yaw are read from some of them, in the mirror from others, and ode3 keeps them
    orthogonal to the third order in the angle of a step, 4e-3 rad.
    """
    flight = open_loop(monkeypatch, SCENARIO, plant, accelerations)
    image = open_loop(
        monkeypatch,
        MIRRORED.scenario(SCENARIO),
        plant,
        lambda time: MIRRORED.rotors_of(accelerations(time)),
    )
    assert max(np.ptp(flight[rate]) for rate in "pqr") < 2.0
    assert_symmetric(flight, image, MIRRORED, 4e-3**3 if plant == "thesis" else 2e-14)


@each_plant
@pytest.mark.parametrize("vehicle", ["tiltrotor", "quadrotor"])
def test_twice_the_mass_inertia_and_thrust_changes_no_bit(plant, vehicle):
    """A factor of two does not round.

    In MuJoCo the pods and servos of the tiltrotor keep their inertia (1e-13 and 1e-6 kg m^2): its
    body turns by less than 5e-11 rad as a pod turns by 1 rad.
    """
    scenario = {"tiltrotor": SCENARIO, "quadrotor": QUADROTOR}[vehicle]
    mass, *inertia, _, thrust, drag, _ = np.multiply(2.0, VEHICLE).tolist()
    coefficients = {"thrust_coefficient": thrust, "drag_coefficient": drag}
    twice = scenario["vehicle"] | {"mass": mass, "inertia": inertia} | coefficients
    one = original(plant) if vehicle == "tiltrotor" else fly(scenario, plant)
    other = fly(scenario | {"vehicle": twice}, plant)
    bound = 5e-11 if (plant, vehicle) == ("mujoco", "tiltrotor") else 0.0
    for names in (("x", "y", "z"), ("roll", "pitch", "yaw"), ("p", "q", "r")):
        assert np.abs(columns(one, *names) - columns(other, *names)).max() <= bound
