"""A cable against the pendulum and Newton's law; doors; friction at rest."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from scipy.special import ellipk

from tiltsim.models.objects import Body, Load, Objects, add_objects, distance_ahead

G, LENGTH, MASS, ANGLE = 9.81, 1.0, 0.2, 0.2

PINNED = """
<mujoco>
  <option timestep="0.001" tolerance="0" integrator="implicitfast" gravity="0 0 -9.81"/>
  <worldbody>
    <body name="vehicle" gravcomp="1">
      <freejoint name="vehicle"/>
      <inertial pos="0 0 0" mass="1e7" diaginertia="1e7 1e7 1e7"/>
      <geom name="ball_collision" type="sphere" size="0.02" contype="1" conaffinity="0" mass="0"/>
    </body>
  </worldbody>
</mujoco>
"""


def body(**changes):
    still = {"name": "box", "type": "box", "position": (1.0, 0.0, 0.0), "size": (0.2, 0.4, 0.6)}
    return Body(**(still | changes))


def pinned(*bodies, load=None):
    """Objects beside a vehicle that nothing can move."""
    spec = mujoco.MjSpec.from_string(PINNED)
    add_objects(spec, Objects(tuple(bodies), load=load))
    model = spec.compile()
    return model, mujoco.MjData(model)


def pendulum(attached=(0.0, 0.0, 0.0)):
    model, data = pinned(load=Load(mass=MASS, length=LENGTH, attachment=attached))
    data.qpos[7:10] = np.array([np.sin(ANGLE), 0.0, -np.cos(ANGLE)]) * LENGTH + attached
    return model, data


def test_a_load_on_a_cable_swings_as_a_pendulum():
    model, data = pendulum()
    times, energies, before = [], [], data.qpos[7]
    for _ in range(20_000):
        mujoco.mj_step(model, data)
        if before > 0.0 >= data.qpos[7]:
            times.append(data.time + 0.001 * data.qpos[7] / (before - data.qpos[7]))
        before = data.qpos[7]
        height = LENGTH + data.qpos[9]
        energies.append(0.5 * MASS * data.qvel[6:9] @ data.qvel[6:9] + MASS * G * height)
    exact = 4.0 * np.sqrt(LENGTH / G) * ellipk(np.sin(0.5 * ANGLE) ** 2)
    assert np.diff(times).mean() == pytest.approx(exact, rel=5e-4)
    assert np.mean(energies[-2000:]) == pytest.approx(
        MASS * G * LENGTH * (1 - np.cos(ANGLE)), rel=0.03
    )


def test_the_tension_follows_newton_s_law():
    model, data = pendulum()
    tensions, expected, before = [], [], data.qvel[6:9].copy()
    for step in range(4000):
        along = -data.qpos[7:10] / np.linalg.norm(data.qpos[7:10])
        mujoco.mj_step(model, data)
        acceleration = (data.qvel[6:9] - before) / 0.001
        before = data.qvel[6:9].copy()
        if step > 100:
            tensions.append(data.history[-1])
            expected.append(MASS * along @ (acceleration + np.array([0.0, 0.0, G])))
    np.testing.assert_allclose(tensions, expected, rtol=1e-9, atol=1e-12)
    swing = MASS * G * (3.0 - 2.0 * np.cos(ANGLE))  # at the lowest point
    assert max(tensions) == pytest.approx(swing, rel=5e-3)


def test_a_slack_cable_pulls_nothing():
    model, data = pendulum()
    data.qpos[7:10] = 0.0, 0.0, -0.5
    mujoco.mj_step(model, data, 100)
    assert data.history[-1] == 0.0
    assert data.qpos[9] == pytest.approx(-0.5 - 0.5 * G * 0.1**2, rel=0.01)


def test_a_hinged_door_turns_about_its_hinge_with_its_inertia():
    model, data = pinned(body(joint="hinged", mass=3.0, hinge=(0.0, 0.2, 0.0), damping=0.5))
    data.qvel[6] = 1.0
    inertia = 3.0 * ((0.2**2 + 0.4**2) / 12.0 + 0.2**2)
    mujoco.mj_step(model, data, 300)
    assert data.qvel[6] == pytest.approx(np.exp(-0.5 * 0.3 / inertia), rel=2e-3)
    place = data.body("object_box").xpos
    assert np.hypot(place[0] - 1.0, place[1] - 0.2) == pytest.approx(0.2)


def test_a_box_on_a_box_does_not_creep():
    """Gravity pulls sideways with a third of the force that friction holds."""
    shelf = body(name="shelf", size=(2.0, 2.0, 0.2), position=(1.0, 0.0, -0.4))
    model, data = pinned(shelf, body(joint="free", mass=1.0))
    model.opt.gravity[0] = 0.15 * G
    mujoco.mj_step(model, data, 500)
    start = data.qpos[7]
    mujoco.mj_step(model, data, 2000)
    assert abs(data.qpos[7] - start) < 2e-3


@pytest.mark.parametrize(
    ("thing", "point", "direction", "distance"),
    [
        (body(), (0.0, 0.1, 0.2), (1.0, 0.0, 0.0), 0.9),
        (body(), (0.0, 0.3, 0.2), (1.0, 0.0, 0.0), None),
        (body(), (2.0, 0.0, 0.0), (1.0, 0.0, 0.0), None),
        (body(), (2.0, 0.0, 0.0), (-1.0, 0.0, 0.0), 0.9),
        (body(type="wall", size=(1.0, 1.0)), (0.0, 0.0, 0.0), (0.8, 0.6, 0.0), None),
        (body(type="wall", size=(2.0, 1.0)), (0.0, 0.0, 0.0), (0.8, 0.6, 0.0), 1.25),
        (body(type="sphere", size=(0.25,)), (0.0, 0.15, 0.0), (1.0, 0.0, 0.0), 0.8),
        (body(type="sphere", size=(0.25,)), (0.0, 0.3, 0.0), (1.0, 0.0, 0.0), None),
        (body(attitude=(0.0, 0.0, 0.5 * np.pi)), (0, 0, 0), (1.0, 0, 0), 0.8),
    ],
)
def test_the_distance_to_an_object_along_a_tool(thing, point, direction, distance):
    found = distance_ahead(thing, np.array(point, float), np.array(direction))
    assert found == (None if distance is None else pytest.approx(distance))
