"""Objects, tools and loads: forces against momentum, pushes, and refusals."""

from __future__ import annotations

from itertools import pairwise

import mujoco
import numpy as np
import pytest

import tiltsim
from tests.refusals import refusal
from tiltsim.laws.assembling import assemble
from tiltsim.laws.rotor_loop import layout_of_vehicle
from tiltsim.plants.mujoco_plant import flight_model
from tiltsim.vehicles.rotorcraft.others import CONTACT_FORCE, motion_at_start

PUSH = "interaction/push#hold"
BOX = {
    "name": "box",
    "type": "box",
    "position": [0.1, 0.62, 0.02],
    "attitude": [0.3, 0.2, 1.3],
    "size": [0.2, 0.3, 0.4],
    "joint": "free",
    "mass": 0.7,
    "floating": True,
    "velocity": [0.0, -0.5, 0.1],
}
GEOMETRIC = {"law": "geometric", "tilts": "free", "position_bandwidth": 4.0}
FREE = {"reference": {"type": "setpoint"}, "simulation.duration": 1.0, "expect": []}
NEAR = {
    "reference.position": [0.0, 0.5, 0.0],
    "initial.position": [0.0, 0.5, 0.0],
    "reference.start": 0.0,
    "reference.approach": 0.2,
    "simulation.duration": 0.6,
    "expect": [],
}
"""A tool that touches the wall after 0.4 s."""


def push(**changes):
    return tiltsim.load_scenario(PUSH, {name.replace("__", "."): v for name, v in changes.items()})


def beside_a_box(**changes):
    """The vehicle hovers, and a box without weight flies against its tool."""
    return tiltsim.load_scenario(PUSH, {**FREE, "object": [BOX], **changes})


def test_the_force_is_the_rate_of_the_momentum_of_a_free_box():
    """Newton's second law of a free box, at every step, in all components."""
    simulation = tiltsim.Simulation(beside_a_box())
    speeds, forces = [simulation.data.qvel[-6:-3].copy()], []
    for _ in range(400):
        simulation.step()
        speeds.append(simulation.data.qvel[-6:-3].copy())
        forces.append(simulation.observation().contact_force)
    rates = BOX["mass"] * np.diff(speeds, axis=0) / 0.001
    assert np.abs(forces).max(axis=0).min() > 0.5, "it hits in all directions"
    np.testing.assert_allclose(forces, rates, atol=1e-9)


def test_samples_and_observations_have_the_same_force_and_its_peak_at_every_step():
    flight = tiltsim.simulate(beside_a_box(**{"simulation.record_timestep": 0.001}))
    force = np.linalg.norm([flight[name] for name in CONTACT_FORCE], axis=0)
    np.testing.assert_allclose(flight["peak_contact_force"][2:], np.maximum.accumulate(force)[1:-1])
    rare = tiltsim.simulate(beside_a_box(**{"simulation.record_timestep": 0.05}))
    assert rare.metrics()["peak_force"] == flight.metrics()["peak_force"] > 1.2 * force[::50].max()
    touched = np.count_nonzero(force[:-1]) * 0.001
    assert flight.metrics()["time_in_contact"] == pytest.approx(touched, abs=1e-9)


@pytest.mark.parametrize("load", [{}, {"payload": {"mass": 0.2, "length": 0.4, "swing": 0.3}}])
def test_vehicle_load_and_objects_keep_their_momentum(load):
    """Without gravity and thrust, through impacts on tool and body."""
    assembly = assemble(beside_a_box(**load))
    model = flight_model(assembly)
    model.opt.gravity[:] = 0.0
    data, sizes = mujoco.MjData(model), assembly.loop.sizes
    data.qpos[: sizes.qpos], _ = assembly.loop.kind.initial_motion(assembly)
    data.qpos[sizes.qpos :], data.qvel[sizes.qvel :] = motion_at_start(assembly)
    momenta, contacts = [], 0
    for _ in range(1500):
        mujoco.mj_step(model, data)
        contacts += data.ncon > 0
        mujoco.mj_subtreeVel(model, data)
        momenta.append(data.subtree_linvel[0] * model.body_subtreemass[0])
    assert contacts > 5
    assert np.ptp(momenta, axis=0).max() < 1e-6 * np.abs(momenta).max()


@pytest.mark.parametrize("controller", [{}, {"controller": GEOMETRIC}])
def test_a_push_holds_its_force_on_both_engines_with_the_same_bits(controller):
    changes = NEAR | controller | {"reference.ramp": 0.2, "simulation.duration": 1.5}
    flights = [
        tiltsim.simulate(tiltsim.load_scenario(PUSH, changes | {"simulation.engine": engine}))
        for engine in ("python", "native")
    ]
    for name in flights[0]:
        np.testing.assert_array_equal(flights[0][name], flights[1][name], err_msg=name)
    settled = flights[0]["time"] > 1.2
    np.testing.assert_allclose(flights[0]["contact_force_y"][settled], 5.0, atol=0.1)
    np.testing.assert_allclose(flights[0]["push_force"], flights[0]["contact_force_y"])


def test_a_flight_that_is_saved_in_contact_goes_on_with_the_same_bits():
    scenario = beside_a_box(**{"simulation.engine": "native"})
    whole, parts = tiltsim.Simulation(scenario), tiltsim.Simulation(scenario)
    whole.step(600)
    touched = 0
    for _ in range(60):
        parts.step(10)
        plant = parts._plant
        touched += bool(parts.observation().contact_force.any())
        plant.state = plant.state
    np.testing.assert_array_equal(whole.data.qpos, parts.data.qpos)
    np.testing.assert_array_equal(whole.data.history, parts.data.history)
    assert touched > 1


@pytest.mark.parametrize("stiffness", [0.0, 20.0])
def test_an_impedance_gives_way_by_its_stiffness(stiffness):
    """The path goes on into the wall: the force grows by the stiffness times that way."""
    into = {"positions": [[0.0, 0.0, 0.0], [0.0, 0.04, 0.0]], "times": [0.5, 1.5]}
    impedance = {"mass": 1.0, "damping": 20.0, "stiffness": stiffness}
    changes = NEAR | {"simulation.duration": 7.0, "reference.slide": into}
    flight = tiltsim.simulate(
        tiltsim.load_scenario(PUSH, changes | {"reference.impedance": impedance})
    )
    assert flight["push_force"][-1] == pytest.approx(5.0 + 0.04 * stiffness, abs=0.01)
    own = {name: flight[name] for name in ("push_shift", "push_shift_rate")}
    error = flight["push_force_ref"] - flight["filtered_push_force"]
    law = flight.scenario.reference
    softness = law.softness(flight.scenario)
    spring = stiffness / (1.0 - stiffness * softness) * own["push_shift"]
    pushed = error - 20.0 * own["push_shift_rate"] - spring
    step, time = np.diff(own["push_shift_rate"]), flight["time"]
    between = 0.5 * (pushed[1:] + pushed[:-1]) * np.diff(time)
    late = time[1:] > 1.0
    np.testing.assert_allclose(step[late], between[late], atol=2e-4)


@pytest.mark.slow
def test_the_peak_of_an_impact_hardly_depends_on_the_time_step():
    peaks = [
        tiltsim.simulate(push(simulation__timestep=step, simulation__duration=8.0)).metrics()[
            "peak_force"
        ]
        for step in (0.00025, 0.0005, 0.001, 0.002)
    ]
    assert max(peaks) < 1.05 * min(peaks)
    assert all(before < after for before, after in pairwise(peaks))


@pytest.mark.slow
def test_rows_of_a_batch_fly_among_objects_as_alone():
    scenarios = [push(reference__force=force, simulation__duration=8.0) for force in (2.0, 5.0)]
    together = tiltsim.fly(scenarios, keep_samples=True)
    for scenario, result in zip(scenarios, together, strict=True):
        alone = tiltsim.simulate(scenario)
        np.testing.assert_array_equal(alone["contact_force_y"], result.flight["contact_force_y"])


STIFF = {"mass": 1.0, "damping": 20.0, "stiffness": 60.0}
WALL = {
    "name": "wall",
    "type": "wall",
    "position": [0.0, 1.0, 0.0],
    "attitude": [0.0, 0.0, 1.5708],
    "size": [2.0, 2.0],
}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"reference.object": "wal"}, "did you mean wall?"),
        ({"reference.object": "door"}, "reference.object = "),
        ({"object": []}, "there is no [[object]]"),
        ({"object": [{**WALL, "position": [0.0, -1.0, 0.0]}]}, "is not ahead of the tip"),
        ({"object": [WALL, WALL]}, "there are two of this name"),
        ({"object": [{**WALL, "mass": 1.0}]}, 'needs object.joint = "hinged" or "free"'),
        ({"object": [{**WALL, "joint": "free"}]}, "must be given"),
        ({"object": [{**WALL, "joint": "free", "mass": -1.0}]}, "object[0].mass = -1.0"),
        ({"object": [{**WALL, "size": [2.0]}]}, "a wall has 2 of them"),
        ({"object": [{**WALL, "softness": 1e-3}]}, "at least two time steps, 0.002"),
        ({"object": [{**WALL, "axis": [1.0, 0.0, 0.0]}]}, 'needs object.joint = "hinged"'),
        ({"object": [{**WALL, "name": "vehicle"}]}, "is taken"),
        ({"object": [{**WALL, "type": "cone"}]}, "wall, box"),
        ({"object": [{**WALL, "type": "mesh", "size": [1.0]}]}, ".stl or .obj"),
        ({"tool": {"length": -0.1}}, "tool.length = -0.1"),
        ({"tool": {"length": 0.3, "mass": -0.1}}, "tool.mass = -0.1"),
        ({"tool": {"length": 0.01}}, "must exceed twice the radius"),
        ({"tool": {"length": 0.3, "direction": [0.0, 0.0, 0.0]}}, "must not be zero"),
        ({"tool": None}, "needs a [tool]"),
        ({"reference.impedance": STIFF}, "0.9 of the law's own stiffness"),
        ({"reference.impedance": STIFF, "reference.gain": 1.0}, "is of the loop of force"),
        ({"simulation.integrator": "RK4"}, 'must be "implicitfast"'),
        ({"simulation.plant": "rigid_body", "simulation.integrator": "RK4"}, "use mujoco"),
        ({"controller": {"law": "attitude_force"}}, "cannot push; choose full_pose"),
        ({"controller": {"law": "geometric"}}, "geometric with tilts = free, numpy with push_"),
        (
            {"reference.slide": {"positions": [[0, 0, 0], [0.1, 0, 0]], "times": [1.0, 2.0]}},
            "after the touch at 7 s",
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_wrong_objects_tools_and_pushes_are_refused(changes, words):
    assert words in refusal(tiltsim.load_scenario, PUSH, changes)


def test_a_mesh_is_touched_where_its_hull_is(tmp_path):
    """A tetrahedron with its right angle at the origin, twice as large; it falls on the tool."""
    corners = ["v 0 0 0", "v 1 0 0", "v 0 1 0", "v 0 0 1"]
    faces = ["f 1 3 2", "f 1 2 4", "f 1 4 3", "f 2 3 4"]
    (tmp_path / "corner.obj").write_text("\n".join(corners + faces) + "\n")
    scenario = """
tool = { direction = [0.0, 1.0, 0.0], length = 0.5 }
simulation = { duration = 0.3, integrator = "implicitfast", record_timestep = 0.001 }

[[object]]
name = "corner"
type = "mesh"
file = "corner.obj"
size = [0.1]
joint = "free"
mass = 0.02
position = [-0.02, 0.4, 0.05]
"""
    (tmp_path / "mesh.toml").write_text(scenario)
    flight = tiltsim.simulate(tmp_path / "mesh.toml")
    touch = np.flatnonzero(flight["contact_time"])[0]
    assert touch > 80
    top = flight["z"] + 0.4 * np.sin(flight["roll"]) + 0.01  # of the tool below the corner
    assert flight["corner_z"][touch] == pytest.approx(top[touch], abs=2e-3)
    missing = scenario.replace("corner.obj", "other.obj")
    (tmp_path / "mesh.toml").write_text(missing)
    assert "other.obj" in refusal(tiltsim.load_scenario, tmp_path / "mesh.toml")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"object": [{**WALL, "position": [0.0, 0.4, 0.0]}]}, "object wall and tool overlap by"),
        ({"object": [{**WALL, "position": [0.0, 0.0, 0.0]}]}, "object wall"),
        ({"tool": {"length": 0.4, "direction": [1.0, 0.577, 0.1]}}, "touches pod_1"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_overlaps_at_the_start_are_refused(changes, words):
    scenario = tiltsim.load_scenario(PUSH, {**FREE, **changes})
    assert words in refusal(tiltsim.simulate, scenario)


def test_the_built_in_command_among_objects_is_the_loop_s():
    """Also while it pushes: the force is the last step's."""
    scenario = push(reference__approach=0.5, reference__start=0.0, simulation__engine="native")
    simulation, layout = tiltsim.Simulation(scenario), layout_of_vehicle(scenario.vehicle.resolve())
    simulation.step(3000)
    assert simulation.observation().contact_force[1] > 1.0
    commanded = simulation.command().rotor_accelerations
    simulation.step()
    sent = simulation.data.ctrl[layout.places.accelerations]
    np.testing.assert_allclose(commanded, np.array(layout.spins) * sent, rtol=1e-9)


def test_a_push_of_a_custom_controller_has_its_columns_and_metric():
    def resting(_observation):
        return tiltsim.Command(thrusts=[4.0] * 6)

    scenario = push(simulation__duration=0.8, reference__position=[0.0, 0.5, 0.0])
    scenario = scenario.replace({"reference.start": 0.0, "initial.position": [0.0, 0.54, 0.0]})
    scenario = scenario.replace({"initial.velocity": [0.0, 0.2, 0.0]})
    flight = tiltsim.simulate(scenario, controller=resting)
    assert flight["push_force_ref"][-1] > 0.0
    assert flight.metrics()["peak_force"] > 1.0
    np.testing.assert_array_equal(flight["push_force"], flight["contact_force_y"])


@pytest.mark.slow
@pytest.mark.parametrize(
    "layers",
    [
        {
            "simulation.control_timestep": 0.004,
            "simulation.control_latency": 0.004,
            "vehicle.rotor_time_constant": 0.01,
        },
        {
            "air": {"wind": [0.5, 0.0, 0.0], "drag": {"linear": [0.1, 0.1, 0.1]}},
            "payload": {"mass": 0.1, "length": 0.3, "swing": 0.2},
            "ground": {"height": -2.0},
            "vehicle.rotor_inertia": 1e-5,
        },
    ],
    ids=["sampled", "loaded"],
)
@pytest.mark.parametrize("pushing", [{}, {"reference.impedance": STIFF}], ids=["force", "soft"])
def test_both_engines_push_with_the_same_bits_through_all_layers(layers, pushing):
    def fly(engine):
        changes = NEAR | pushing | layers | {"simulation.engine": engine}
        return tiltsim.simulate(tiltsim.load_scenario("interaction/push#slide_level", changes))

    plain, native = (fly(engine) for engine in ("python", "native"))
    assert plain.metrics()["time_in_contact"] > 0.01
    for name in plain:
        np.testing.assert_array_equal(plain[name], native[name], err_msg=name)
