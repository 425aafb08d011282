"""Minimal coordinates of states with a rotation."""

from __future__ import annotations

import re

import numpy as np
import pytest

from tiltsim import load_scenario
from tiltsim.laws.assembling import assemble
from tiltsim.linear.coordinates import (
    MATRIX,
    QUATERNION,
    ROTATION_NAMES,
    Coordinates,
    Input,
    equation_coordinates,
    equation_inputs,
    mujoco_coordinates,
    vehicles_of,
)
from tiltsim.resources import shipped_folder
from tiltsim_controllers.mathematics.attitude import rotation_of_quaternion

NAMES = ("x", *ROTATION_NAMES, "speed")


def random_states(entries, count):
    """Coordinates, states with a rotation of ``entries`` numbers, and vectors of coordinates."""
    generator = np.random.default_rng(7)
    coordinates = Coordinates(NAMES, ("",) * len(NAMES), entries, (1,))
    for _ in range(count):
        quaternion = generator.normal(size=4)
        quaternion /= np.linalg.norm(quaternion)
        rotation = quaternion
        if entries == MATRIX:
            rotation = rotation_of_quaternion(quaternion).ravel()
        state = np.array((generator.normal(), *rotation, generator.normal()))
        yield coordinates, state, generator.uniform(-1.7, 1.7, size=5)


@pytest.mark.parametrize("entries", [MATRIX, QUATERNION])
def test_between_undoes_moved(entries):
    for coordinates, state, by in random_states(entries, 20):
        moved = coordinates.moved(state, by)
        assert coordinates.between(state, moved) == pytest.approx(by, abs=1e-12)
        assert coordinates.between(state, state) == pytest.approx(np.zeros(5), abs=1e-15)


def test_both_forms_of_a_rotation_turn_alike():
    for (matrix, state, by), (quaternion, other, _) in zip(
        random_states(MATRIX, 5), random_states(QUATERNION, 5), strict=True
    ):
        turned = quaternion.moved(other, by)[1:5]
        expected = rotation_of_quaternion(turned).ravel()
        assert matrix.moved(state, by)[1:10] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("entries", [MATRIX, QUATERNION])
def test_rates_are_derivatives_of_the_coordinates(entries):
    """A turn in body axes for a short time has its rates."""
    step = 1e-6
    for coordinates, state, by in random_states(entries, 5):
        ahead, behind = coordinates.moved(state, step * by), coordinates.moved(state, -step * by)
        derivative = (ahead - behind) / (2.0 * step)
        assert coordinates.rates(state, derivative) == pytest.approx(by, abs=1e-9)


def test_a_vehicle_with_fewer_tilts_than_rotors_has_one_rate_per_tilt(tmp_path):
    """Six rotors, of which the sixth does not tilt."""
    folder, file = shipped_folder("mjcf"), tmp_path / "five_tilts.xml"
    text = (folder / "tilt_hexarotor.xml").read_text().replace("scene.xml", f"{folder}/scene.xml")
    text = re.sub(r'(?s)<\w+ name="(tilt_|tilt_angle_)6".*?/>|<keyframe>.*</keyframe>', "", text)
    file.write_text(text)
    tables = {
        "title": "Full pose",
        "source": "test",
        "vehicle": {"model": "multirotor", "mjcf": str(file)},
        "controller": {"law": "full_pose"},
        "reference": {"type": "setpoint"},
        "simulation": {"duration": 1.0, "plant": "thesis"},
    }
    assembly = assemble(load_scenario(tables))
    names = equation_inputs(assembly)
    rates = [f"alpha_rate_{arm}" for arm in range(1, 6)]
    expected = [f"rotor_acceleration_{rotor}" for rotor in range(1, 7)] + rates
    assert names == tuple(Input(name, index) for index, name in enumerate(expected))


def test_a_quadrotor_under_a_law_of_rotor_speeds_has_their_states_on_the_thesis_equations():
    tables = {"vehicle": {"model": "quadrotor"}, "controller": {"law": "geometric"}}
    assembly = assemble(load_scenario({**tables, "simulation": {"plant": "thesis"}}))
    size = len(assembly.loop.equations.initial(assembly, assembly.setup))
    found = equation_coordinates(assembly, size)
    assert found.size == size - 6  # nine entries for the rotation's three
    assert [found.names.index(f"rotor_speed_{rotor}") for rotor in (1, 4)] == [12, 15]
    names = [name for name, *_ in equation_inputs(assembly)]
    assert names == [f"rotor_acceleration_{rotor}" for rotor in (1, 2, 3, 4)]


def test_states_of_laws_and_layers_have_the_names_of_their_signals():
    """In MuJoCo's order; states that no signal shows are numbered behind the layer's name."""

    def names_of(address):
        assembly = assemble(load_scenario(address))
        found = mujoco_coordinates(assembly.loop, vehicles_of(assembly), assembly.scenario)
        return assembly.loop, found.names

    loop, names = names_of("interaction/carry#held")
    own = names.index("rotor_speed_6") + 1
    assert names[own] == "state_modeled_position_x"
    assert names[-4:] == loop.fields[loop.controller_states :][:4]
    assert names[own : own + loop.controller_states] == loop.fields[: loop.controller_states]
    _, filtered = names_of("beyond/estimator")
    assert filtered[-1].startswith(("estimation_state_", "instruments_"))
    assert len({*filtered}) == len(filtered)
