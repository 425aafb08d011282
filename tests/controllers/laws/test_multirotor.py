"""One law for any number of rotors: the four-rotor laws are cases of it, and it flies the rest."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

from tests.controllers.flat_laws import attitude_altitude_inputs, flat, tracking_inputs
from tests.controllers.laws.test_gait_feedforward import parameters as gait_parameters
from tests.controllers.multirotors import (
    FOUR,
    HEXAROTOR,
    SMALL,
    Vehicle,
    fly,
    octorotor,
    parameters_of,
    random_states,
    ring,
    tiltrotor,
)
from tiltsim_controllers.analysis.singularity import world_up
from tiltsim_controllers.analysis.torque_free import (
    controlled_axes,
    hover_direction,
    torque_free_forces,
)
from tiltsim_controllers.gaits import plans
from tiltsim_controllers.laws import attitude_altitude
from tiltsim_controllers.laws.allocation import RotorRange
from tiltsim_controllers.laws.feedback import DECOUPLERS
from tiltsim_controllers.laws.gains import GAIN_SETS, Poles, gains_from_poles
from tiltsim_controllers.laws.gait_feedforward import multirotor_law_of
from tiltsim_controllers.laws.multirotor import (
    Tracking,
    independence,
    rotation_control,
    side_control,
    turned,
)
from tiltsim_controllers.laws.multirotor_keys import EULER_ANGLES, FeedforwardTerms, Form
from tiltsim_controllers.laws.observed import Failure
from tiltsim_controllers.laws.supervisor import Supervisor
from tiltsim_controllers.mathematics.attitude import attitude_error, rotation_matrix
from tiltsim_controllers.mathematics.moving import Moving
from tiltsim_controllers.references.trajectories import CIRCLE, SETPOINT, ReferenceParameters
from tiltsim_controllers.vehicle.rotors import (
    CONSTANT,
    ROTOR_FLOATS,
    force_and_torque,
    tilt_of_rotor,
)

ON_CIRCLE = ReferenceParameters(
    CIRCLE, (0.3, -0.2, 0.1), radius=2.0, angular_frequency=0.5, yaw=0.4,
    acceleration_feedforward=1.0,
)  # fmt: skip
AS_PUBLISHED = FeedforwardTerms(0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
"""Only the reference's acceleration: the four-rotor law of ch. 4 has none of the other terms."""


def differences(todays, general):
    """Relative differences of the two laws at random states, the four accelerations together."""
    found = []
    for time, state in random_states(80):
        expected, value = np.array(todays(time, state)), np.array(general(time, state))
        found.append(np.abs(value[: len(expected)] - expected).max() / np.abs(expected).max())
    return np.array(found)


@pytest.mark.parametrize("decoupling", attitude_altitude.DECOUPLINGS)
@pytest.mark.parametrize("decoupler", DECOUPLERS)
def test_the_law_of_chapters_3_and_4_is_a_case(decoupler, decoupling):
    vehicle, gait = tiltrotor(), plans.fixed((0.0,) * 4)
    gains = GAIN_SETS["ch04" if decoupling == "published" else "exact"]
    codes = DECOUPLERS[decoupler], attitude_altitude.DECOUPLINGS[decoupling]
    special = attitude_altitude.Parameters(
        FOUR,
        gains,
        gait.parameters,
        ON_CIRCLE,
        Supervisor(),
        RotorRange(),
        decoupler=codes[0],
        decoupling=codes[1],
    )
    law, knots = parameters_of(
        vehicle, gait, ON_CIRCLE, gains=gains, terms=AS_PUBLISHED, decoupler=codes[0],
        decoupling=codes[1], attitude_error=EULER_ANGLES,
    )  # fmt: skip
    inputs, rest = flat(multirotor_law_of(tilt_of_rotor(vehicle.table), Form(1))), (0.0,) * 4
    found = differences(
        lambda time, state: attitude_altitude_inputs(time, state, special)[:4],
        lambda time, state: inputs(time, state, rest, (0.0,) * 3, law, knots),
    )
    # Beside a singular attitude rounding grows without bound; it is rare among these states.
    assert np.median(found) < 2e-15
    assert found.max() < 1e-9


@pytest.mark.parametrize(
    "gait",
    [
        plans.continuous_trot(0.5, 2.0),
        plans.table(
            [0.0, 1.0, 2.5], [(0.1, 0.2, 0.3, 0.4), (0.3, 0.1, 0.2, 0.0), (0.1, 0.2, 0.3, 0.4)],
            repeats=True,
        ),
    ],
    ids=["trot", "table"],
)  # fmt: skip
def test_gait_feedforward_is_a_case(gait):
    vehicle = tiltrotor()
    gains, integral = gains_from_poles(
        Poles(25.0), Poles(10.0), Poles(10.0, 1.0, 0.5), Poles(1.5, 1.0, 0.3)
    )
    terms, rates, integrals = FeedforwardTerms(), (0.1, -0.3, 0.2, 0.5), (0.1, 0.2, -0.1)
    special = gait_parameters(
        vehicle=FOUR, gains=gains, integral=integral, max_angular_acceleration=200.0,
        anticipation=0.05, terms=terms, gait=gait.parameters, reference=ON_CIRCLE,
        decoupler=DECOUPLERS["exact"],
    )  # fmt: skip
    law, knots = parameters_of(
        vehicle, gait, ON_CIRCLE, gains=gains, integral=integral, max_acceleration=3.0,
        max_angular_acceleration=200.0, anticipation=0.05, attitude_error=EULER_ANGLES,
    )  # fmt: skip
    inputs = flat(multirotor_law_of(tilt_of_rotor(vehicle.table), Form(1)))
    found = differences(
        lambda time, state: tracking_inputs(time, state, rates, integrals, special, knots),
        lambda time, state: inputs(time, state, rates, integrals, law, knots),
    )
    assert np.median(found) < 2e-15
    assert found.max() < 1e-9


CANTED = Vehicle(ring(6, 0.44), HEXAROTOR, 3)


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_independence_is_what_the_other_outputs_leave_of_the_force(dimension):
    vehicle = (tiltrotor(), Vehicle(ring(6, 0.35, along=(1.0, 0.0, 0.0)), HEXAROTOR, 2), CANTED)
    table = vehicle[dimension - 1].table
    tilts = (0.3, -0.2, 0.1, 0.4) if dimension == 1 else ()
    force, torque = force_and_torque(table, tilts)
    forces = torque_free_forces(force, torque)
    wrench, form, side = np.vstack([force, torque]), Form(dimension), hover_direction(forces)
    for up in np.random.default_rng(2).normal(size=(5, 3)):
        up /= np.linalg.norm(up)
        axes, rows, expected = controlled_axes(forces, up, dimension), torque, 1.0
        for lift in axes @ force:
            left = lift - np.linalg.pinv(rows) @ rows @ lift
            expected *= np.linalg.norm(left) / np.linalg.norm(lift)
            rows = np.vstack([rows, lift])
        sign = np.sign(up @ side) if dimension == 1 else 1.0
        found = independence(wrench, up, side, form)
        assert found == pytest.approx(sign * expected, abs=1e-12)
    singular = independence(wrench, np.cross(side, (0.6, 0.8, 0.0)), side, form)
    assert abs(singular) < 1e-15 if dimension == 1 else singular > 0.1


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_a_rotor_known_to_have_failed_is_as_if_it_were_not_there(dimension):
    angles = [[0.3, -0.2, 0.3, -0.3, 0.1, -0.3, 0.2], [0.1, -0.4, 0.2, -0.2, 0.3, -0.1, 0.3]]
    gait, failure = plans.waypoints(angles, 2.0, tilts=7), Failure(3.0, 2.0)
    vehicle = Vehicle(ring(7, hinged=True), HEXAROTOR, dimension)
    layout, forward = tilt_of_rotor(vehicle.table), dimension == 2
    law, knots = parameters_of(vehicle, gait, ON_CIRCLE, restoring=0.5, failure=failure)
    lost = list(knots)
    first = int(law.rotors) + 2 * ROTOR_FLOATS + CONSTANT
    lost[first : first + ROTOR_FLOATS - CONSTANT] = [0.0] * (ROTOR_FLOATS - CONSTANT)
    aware = flat(multirotor_law_of(layout, Form(dimension, "speed", forward, True)))
    unaware = flat(multirotor_law_of(layout, Form(dimension, "speed", forward)))
    body = 0.2 * np.random.default_rng(5).normal(size=12)
    speeds = 450.0 * (-1.0) ** np.arange(1, 8)
    state = (*body.tolist(), *angles[0], *speeds.tolist())

    def at(time, inputs, floats):
        return inputs(time, state, (0.1,) * 7, (0.1, 0.2, 0.3), law, tuple(floats))[:-1]

    assert at(1.9, aware, knots) == at(1.9, unaware, knots)
    found, expected = np.array(at(2.0, aware, knots)), np.array(at(2.0, unaware, lost))
    others = np.arange(len(found)) != 2
    np.testing.assert_allclose(found[others], expected[others], rtol=1e-12)
    assert found[2] == 0.0
    assert np.abs(found[:7] - at(2.0, unaware, knots)[:7]).max() > 100.0


def test_a_hexarotor_with_canted_rotors_flies_a_circle_level():
    reference = ReferenceParameters(CIRCLE, radius=2.0, angular_frequency=0.5)
    law, knots = parameters_of(CANTED, reference=reference)
    start = (2.0, 0.0, 0.0, 0.0, 1.0, 0.0, -0.5, 0.0, 0.0)
    flight = fly(CANTED, law, knots, 0.5, step=0.0025, start=start)
    time = flight.time
    circle = np.stack([2.0 * np.cos(0.5 * time), 2.0 * np.sin(0.5 * time), 0.0 * time], axis=1)
    # RK4's error, 1e-11 m at steps of 5 ms, falls with their fourth power.
    assert np.abs(flight.position - circle).max() < 1e-12
    assert np.abs(flight.up[:, :2]).max() < 1e-12


@pytest.mark.slow
def test_a_vehicle_stays_level_in_a_side_wind_which_its_integrators_cancel():
    law, knots = parameters_of(CANTED)
    flight = fly(CANTED, law, knots, 3.0, wind=(0.0, 1.0, 0.0))
    assert flight.position[-1, 1] == pytest.approx(12.0 / 64.0, abs=1e-3)  # wind k1 / k3
    assert np.abs(flight.up[:, :2]).max() < 1e-12
    # Four poles at -4 rad/s: k4 = 256.
    law = law._replace(side_gains=(16.0, 96.0, 256.0), side_integral=256.0)
    flight = fly(CANTED, law, knots, 5.0, wind=(0.0, 1.0, 0.0))
    assert abs(flight.position[-1, 1]) < 1e-3


def test_with_two_force_components_it_leans_only_across_them():
    vehicle = Vehicle(ring(6, 0.35, along=(1.0, 0.0, 0.0)), HEXAROTOR, 2)
    law, knots = parameters_of(vehicle)
    aside = fly(vehicle, law, knots, 1.0, wind=(0.0, 1.0, 0.0))
    assert np.abs(aside.up[:, :2]).max() < 1e-8
    ahead = fly(vehicle, law, knots, 1.0, wind=(1.0, 0.0, 0.0))
    assert np.abs(ahead.up[:, 0]).max() > 0.05
    assert np.abs(ahead.up[:, 1]).max() < 1e-8


def sway(tilts, periods=48):
    """Tilting arms that sway by 0.1 rad about a cant of 0.25 rad to either side, at 2 rad/s."""
    times = np.linspace(0.0, pi, periods + 1)
    phases, cants = 2.0 * pi * np.arange(tilts) / tilts, 0.25 * (-1.0) ** np.arange(tilts)
    angles = cants + 0.1 * np.sin(2.0 * times[:, np.newaxis] + phases)
    angles[-1] = angles[0]
    return plans.table(times.tolist(), angles.tolist(), repeats=True)


@pytest.mark.slow
def test_restoring_stops_the_drift_that_position_and_attitude_do_not_show():
    vehicle, gait = Vehicle(ring(7, hinged=True), HEXAROTOR, 3), sway(7)
    drifting, restored = (
        fly(vehicle, *parameters_of(vehicle, gait, restoring=rate), 3.0, gait=gait, step=0.01)
        for rate in (0.0, 1.0)
    )
    for flight in (drifting, restored):
        assert np.abs(flight.position).max() < 1e-8
    assert drifting.null_part[-30:].min() > 3.0 * restored.null_part[-30:].max()


@pytest.mark.parametrize("norm", ["speed", "thrust"])
@pytest.mark.parametrize("dimension", [1, 2, 3])
@pytest.mark.parametrize("rotors", [6, 7, 8])
def test_of_all_inputs_that_do_the_same_it_takes_those_nearest_to_restoring(
    rotors, dimension, norm
):
    """Rotor accelerations, or rates of ``w``; by pseudo-inverses."""
    rng, rate = np.random.default_rng(rotors), 0.7
    vehicle = Vehicle(ring(rotors, hinged=True), HEXAROTOR, dimension, norm)
    law_of = Form(dimension, norm, dimension == 2)
    inputs = flat(multirotor_law_of(tilt_of_rotor(vehicle.table), law_of))
    for senses in (1.0, rng.choice([-1.0, 1.0], rotors)):
        angles = tuple(rng.uniform(-0.5, 0.5, rotors).tolist())
        speeds = rng.uniform(250.0, 600.0, rotors) * (-1.0) ** np.arange(rotors) * senses
        body = 0.2 * rng.normal(size=12)
        state = (*body.tolist(), *angles, *speeds.tolist())
        law, knots = parameters_of(vehicle, plans.fixed(angles), restoring=rate)
        found, plain = (
            np.array(inputs(0.1, state, (0.3,) * rotors, (0.0,) * 3, own, knots)[:rotors])
            for own in (law, law._replace(restoring=0.0))
        )
        force, torque = force_and_torque(vehicle.table, angles)
        up = np.array(world_up(*body[6:8]))
        across = np.cross((0.0, 1.0, 0.0), up)
        axes = {1: up[None], 2: [up, across / np.linalg.norm(across)], 3: np.eye(3)}[dimension]
        rows, w = np.vstack([torque / 1e-6, axes @ force / 1e-5]), speeds * np.abs(speeds)
        turns = 2.0 * np.abs(speeds)  # rates of w per acceleration
        if norm == "speed":
            rows, start = rows * turns, -rate * rotors * w / np.abs(speeds).sum()
        else:
            found, plain, start = turns * found, turns * plain, -rate * w
        seen = np.linalg.pinv(rows) @ rows
        np.testing.assert_allclose(seen @ plain, plain, rtol=1e-7, atol=1e-7)
        np.testing.assert_allclose(found - plain, start - seen @ start, rtol=1e-6, atol=1e-6)


def test_an_octorotor_turns_upside_down_and_hovers_there():
    vehicle = Vehicle(octorotor(), SMALL, 3, "thrust")
    reference = ReferenceParameters(SETPOINT, roll=pi)
    law, knots = parameters_of(vehicle, reference=reference, turn_time=2.0, slowest_rotor=20.0)
    flight = fly(vehicle, law, knots, 3.0)
    assert flight.up[-1, 2] < -1.0 + 1e-6
    assert np.abs(flight.position).max() < 1e-3
    assert (np.diff(np.sign(flight.speeds), axis=0) != 0).any(axis=0).all()  # every rotor reverses


def test_force_control_of_x_and_y_is_third_order_with_an_integrator():
    law, _ = parameters_of(CANTED)
    law = law._replace(
        side_gains=(5.0, 8.0, 6.0), side_integral=2.0, terms=law.terms._replace(integral_action=0.5)
    )
    errors, accelerations, integrals = np.random.default_rng(5).uniform(-0.1, 0.1, (3, 3, 3))
    motion = Tracking(Moving(*errors.T), Moving(*accelerations.T))
    found = np.hstack(side_control(motion, integrals[0], law))
    jerks = accelerations[:, 1] + errors @ (6.0, 8.0, 5.0) + 0.5 * 2.0 * integrals[0]
    np.testing.assert_allclose(found, (*jerks[:2], *errors[:2, 0]), rtol=1e-12)


def test_attitude_control_feeds_the_motion_of_its_reference_forward():
    """Rates by differences of rotations, seen from a body behind its reference."""
    law, _ = parameters_of(CANTED, reference=ReferenceParameters(SETPOINT, yaw=0.5))
    now, step = 0.5, 1e-4

    def desired(time):
        angles = turned(time, 0.8, 1.0), turned(time, -0.6, 1.3), turned(time, 0.9, 1.1)
        return rotation_matrix([angle.value for angle in angles])

    def body(time):
        return desired(time - 0.2)

    def rate(vectors, time):
        return (vectors(time + step) - vectors(time - step)) / (2.0 * step)

    def seen_from_body(rotation):
        """Its rates, in axes of the body, as a function of time."""

        def omega(time):
            skew = rate(rotation, time) @ rotation(time).T
            return body(time).T @ (skew[2, 1], skew[0, 2], skew[1, 0])

        return omega

    present, demand = seen_from_body(body), seen_from_body(desired)
    error = attitude_error(body(now), desired(now))
    gains = law.gains
    expected = (
        np.array(gains.attitude_1) * (rate(demand, now) - rate(present, now))
        + np.array(gains.attitude_2) * (demand(now) - present(now))
        + np.array(gains.attitude_3) * error
    )
    motion = body(now), present(now), rate(present, now)
    references = turned(now, 0.8, 1.0), turned(now, -0.6, 1.3), turned(now, 0.9, 1.1)
    found = rotation_control(references, *motion, law)
    # The differences are wrong by 1e-6 at most, which gains multiply by up to 2e3.
    np.testing.assert_allclose(found, expected, atol=2e-3)
