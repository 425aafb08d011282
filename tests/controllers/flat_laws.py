"""Laws as functions of plain vectors that return all their numbers in one."""

from __future__ import annotations

from tiltsim_controllers.code.arrays import traceable, xp
from tiltsim_controllers.laws.attitude_altitude import attitude_altitude
from tiltsim_controllers.laws.gait_feedforward import tiltrotor_law_of
from tiltsim_controllers.laws.observed import Seen


def numbers(step, signals=None):
    """Rotor accelerations, rates of states, and the first signals or all."""
    return xp.hstack([step.inputs, step.rates, step.signals[:signals]])


def flat(law, signals=None):
    """A law of the time, the vehicle's state, its tilt rates, the law's states, and parameters."""

    @traceable
    def inputs(time, state, tilt_rates, states, parameters, knots=()):
        return numbers(law(Seen(time, state, tilt_rates, states), parameters, knots), signals)

    return inputs


@traceable
def attitude_altitude_inputs(time, state, parameters, knots=()):
    return numbers(attitude_altitude(Seen(time, state), parameters, knots))


tracking_inputs = flat(tiltrotor_law_of(), 3)
