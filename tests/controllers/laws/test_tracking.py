"""How the gait feed-forward's attitude references move: against the motion of the vehicle itself.

The vehicle flies without torque along its torque-free force, so that its acceleration, and with it
every error and every feedback, is known as a function of time, and the references of roll and pitch
are the exact decoupler's answer to it. Their derivatives, by differences, must equal the
derivatives in the law.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.controllers.flat_laws import tracking_inputs
from tests.controllers.laws.test_gait_feedforward import (
    GAINS,
    INTEGRAL,
    VEHICLE,
    differences,
    outputs_second_derivatives,
    parameters,
    third_derivatives,
)
from tests.thesis import force_matrix, torque_matrix
from tiltsim_controllers.gaits.plans import keyframes
from tiltsim_controllers.laws.feedback import DECOUPLERS, attitude_jerk, exact_decoupler
from tiltsim_controllers.laws.multirotor_keys import FeedforwardTerms
from tiltsim_controllers.mathematics.moving import Moving
from tiltsim_controllers.references.trajectories import REFERENCE_TYPES, ReferenceParameters

TIME = 0.7
GAIT = keyframes(
    [(0.0, 0.1, 0.3, -0.3, 0.2), (0.6, 0.5, -0.2, 0.2, -0.3), (1.0, 0.1, 0.3, -0.3, 0.2)], 3.0
)
PATH = ReferenceParameters(
    REFERENCE_TYPES["lissajous"],
    (0.2, -0.1, 0.3),
    yaw=0.2,
    amplitude=(0.8, 0.6, 0.3),
    frequency=(1.1, 1.4, 0.9),
    phase=(0.3, 1.2, -0.5),
)


def reference(t, order):
    """A derivative of the reference's position."""
    amplitude, frequency, phase = map(np.array, (PATH.amplitude, PATH.frequency, PATH.phase))
    wave = amplitude * frequency**order * np.sin(frequency * t + phase + order * np.pi / 2)
    return wave + (np.array(PATH.position) if order == 0 else 0.0)


def direction(t):
    """The unit torque-free force of the gait, and the squared speeds that make it."""
    alpha = np.array(GAIT.angles(t))
    squares = np.linalg.svd(torque_matrix(VEHICLE, alpha))[2][-1]
    force = force_matrix(VEHICLE, alpha) @ squares
    scale = np.sign(force[2]) / np.linalg.norm(force)
    return scale * force, scale * squares


class Motion:
    """A vehicle in flight without torque, its force a constant times the gait's direction."""

    def __init__(self, seed):
        random = np.random.default_rng(seed)
        self.position, self.velocity = random.uniform(-0.3, 0.3, (2, 3))
        self.attitude, self.omega = random.uniform(-0.2, 0.2, 3), random.uniform(-0.6, 0.6, 3)
        self.force = VEHICLE.mass * VEHICLE.gravity * random.uniform(0.9, 1.1)
        self.integrals = random.uniform(-0.3, 0.3, 3)

    def acceleration(self, t):
        turn = Rotation.from_euler("ZYX", self.attitude[::-1]) * Rotation.from_rotvec(
            t * self.omega
        )
        push = turn.apply(self.force / VEHICLE.mass * direction(TIME + t)[0])
        return push - [0.0, 0.0, VEHICLE.gravity]

    def state(self):
        squares = self.force * direction(TIME)[1]
        speeds = np.sign(squares) * np.sqrt(np.abs(squares))
        state = [*self.position, *self.velocity, *self.attitude, *self.omega]
        return tuple(float(value) for value in (*state, *GAIT.angles(TIME), *speeds))

    def errors(self, t, terms):
        """Integral, error and rate of the error, the third derivative of the motion held."""
        now, jerk, _ = differences(self.acceleration, 1e-3)
        known = terms.reference_derivatives
        error = [reference(TIME, 0) - self.position, reference(TIME, 1) - self.velocity]
        error += [known * reference(TIME, 2) - now, known * reference(TIME, 3) - jerk]
        powers = [1.0, t, t**2 / 2.0, t**3 / 6.0, t**4 / 24.0]
        series = [self.integrals, *error]
        return [
            sum(derivative * power for derivative, power in zip(series[order:], powers))
            for order in (0, 1, 2)
        ]


def attitude_references(motion, law, euler_yaw):
    """Roll and pitch references as jets, from the exact decoupler's answer along the motion."""
    terms = law.terms

    def demanded(t):
        integral, error, rate = motion.errors(t, terms)
        gains = law.gains
        back = gains.position[0] * rate + gains.position[1] * error
        back = (back + terms.integral_action * law.integral.position * integral)[:2]
        length = np.linalg.norm(back)
        if length > law.max_acceleration:
            back = back * law.max_acceleration / length
        ax, ay, az = terms.reference_derivatives * reference(TIME + t, 2)
        yaw = euler_yaw[0] + euler_yaw[1] * t + 0.5 * euler_yaw[2] * t * t
        n = tuple(direction(TIME + t)[0])
        return exact_decoupler(ax + back[0], ay + back[1], az, yaw, VEHICLE.gravity, n)

    value, rate, acceleration = differences(demanded, 2e-3)
    counted = terms.attitude_rates
    return np.transpose([value, counted * rate, counted * acceleration])


def demanded_third_derivatives(motion, law):
    """Demands of roll, pitch, yaw and altitude, by linear laws around references that move."""
    state = motion.state()
    now = outputs_second_derivatives(0.0, state, GAIT.rates(TIME), [0.0] * 4)

    def euler(t):
        turn = Rotation.from_euler("ZYX", motion.attitude[::-1])
        return (turn * Rotation.from_rotvec(t * motion.omega)).as_euler("ZYX")[::-1]

    rates = differences(euler, 1e-3)[1]
    actual = list(zip(motion.attitude, rates, now[:3]))
    roll, pitch = attitude_references(motion, law, actual[2])
    desired = [roll, pitch, (PATH.yaw, 0.0, 0.0)]
    gains = law.gains
    attitude = [
        k1 * (goal[2] - real[2]) + k2 * (goal[1] - real[1]) + k3 * (goal[0] - real[0])
        for goal, real, (k1, k2, k3) in zip(desired, actual, zip(*gains.attitude))
    ]
    integral, error, rate = (value[2] for value in motion.errors(0.0, law.terms))
    known, counted = law.terms.reference_derivatives, law.terms.integral_action
    climb = (
        known * reference(TIME, 3)[2]
        + gains.altitude[0] * (known * reference(TIME, 2)[2] - motion.acceleration(0.0)[2])
        + gains.altitude[1] * rate
        + gains.altitude[2] * error
        + counted * law.integral.altitude * integral
    )
    return np.array([*attitude, climb])


def law_for(**changed):
    base = parameters(gait=GAIT.parameters, reference=PATH, decoupler=DECOUPLERS["exact"])
    return base._replace(**{"max_acceleration": 100.0, **changed})


NO_FEEDBACK = GAINS._replace(position=(0.0, 0.0))
LAWS = {
    "feed-forward alone": law_for(gains=NO_FEEDBACK, integral=INTEGRAL._replace(position=0.0)),
    "with feedback": law_for(),
    "with limited feedback": law_for(max_acceleration=0.5),
    "attitude at rest": law_for(terms=FeedforwardTerms(attitude_rates=0.0)),
    "reference at rest": law_for(terms=FeedforwardTerms(reference_derivatives=0.0)),
    "without integrals": law_for(terms=FeedforwardTerms(integral_action=0.0)),
}


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_the_attitude_follows_references_that_move_with_path_gait_and_error(law):
    for seed in range(4):
        motion = Motion(seed)
        inputs = tracking_inputs(
            *(TIME, motion.state(), tuple(GAIT.rates(TIME).tolist())),
            *(tuple(motion.integrals.tolist()), law, GAIT.knots),
        )
        expected = demanded_third_derivatives(motion, law)
        found = third_derivatives(motion.state(), GAIT.rates(TIME), inputs[:4])
        scale = np.abs(expected).max()
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-5 * scale, err_msg=f"{seed}")
        roll, pitch = attitude_references(motion, law, (motion.attitude[2], 0.0, 0.0))
        np.testing.assert_allclose(inputs[7:], (roll[0], pitch[0], PATH.yaw), rtol=0, atol=1e-12)


# --- limits ------------------------------------------------------------------------------------


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_each_integrator_stops_where_its_own_axis_is_at_its_limit(axis, side):
    limit = 3.0
    at_rest = ReferenceParameters(REFERENCE_TYPES["setpoint"])
    law = law_for(reference=at_rest, max_acceleration=limit)
    gains = law.gains
    bound = (
        limit * gains.altitude[0] / gains.altitude[2] if axis == 2 else limit / gains.position[1]
    )
    for share, moves in ((1.0 - 1e-9, True), (1.0 + 1e-9, False)):
        state = np.zeros(20)
        state[axis] = -side * share * bound
        state[12:16], state[16:20] = GAIT.angles(TIME), 300.0
        rates = tracking_inputs(
            TIME, tuple(state.tolist()), (0.0,) * 4, (0.0,) * 3, law, GAIT.knots
        )[4:7]
        expected = [0.0, 0.0, 0.0]
        expected[axis] = side * share * bound if moves else 0.0
        assert rates == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_far_from_its_reference_the_attitude_turns_at_the_rate_that_it_can_brake_from(side):
    k1, k2, k3, limit = 30.0, 300.0, 1000.0, 8.0
    cruise = side * limit * k1 / k2  # from here the limit stops the body within 1 / (k2 / k1)
    far = Moving(side * 50.0, 0.0, 0.0)
    assert attitude_jerk(far, Moving(0.0, cruise, 0.0), (k1, k2, k3), limit) == pytest.approx(0.0)
    slower = attitude_jerk(far, Moving(0.0, cruise - 0.1 * side, 0.0), (k1, k2, k3), limit)
    assert slower == pytest.approx(side * 0.1 * k2)
    at_limit = attitude_jerk(far, Moving(0.0, -9.0 * side, 0.0), (k1, k2, k3), limit)
    assert at_limit == pytest.approx(side * k1 * limit)
