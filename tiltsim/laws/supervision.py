"""A supervisor of the laws that follow a planned gait."""

from dataclasses import replace
from typing import Any, Final

from tiltsim.laws.law import Law
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.laws.gait_feedforward import supervised_gait
from tiltsim_controllers.laws.observed import Seen, Step
from tiltsim_controllers.laws.supervisor import HOLD, Supervision
from tiltsim_controllers.vehicle.states import PITCH, ROLL

SUPERVISION: Final = "supervision"
"""A column: how much the supervisor intervenes, from 0 to 1.

It is the share of the gait's angles or of its speed that is removed, or of the way to red.
"""

SUPERVISOR_FIELDS: Final = ("supervisor_state", "supervisor_rate")
"""States of a supervisor that has any: see `tiltsim_controllers.laws.supervisor`."""

_STATE_UNITS: Final = {"hold": ("s", "1"), "return_to_red": ("1", "1/s")}


def supervised(law: Law, supervision: Supervision, strategy: str) -> Law:
    """A law under a supervisor, whose states follow the law's.

    Args:
        law: Its parameters have ``gait`` and ``supervisor``.
        supervision: The functions of the supervisor.
        strategy: One of `tiltsim_controllers.laws.supervisor.STRATEGIES`, or empty for none.
    """
    if not strategy:
        return law
    assert law.signals is not None
    units, own, tracked = _STATE_UNITS.get(strategy, ()), len(law.states), len(law.signals)

    def watched(seen: Seen, p: Any, knots: Any) -> Seen:
        """The vehicle as the law sees it, with the motion of the supervisor."""
        state, rate = seen.states[own:]
        motion = xp.array([state, rate, 0.0])
        if not seen.recorded:
            vehicle = supervision.watched(seen.time, p)
            attitude = seen.state[ROLL], seen.state[PITCH]
            motion = supervision.derivative(
                seen.time, *attitude, state, rate, p.gait, knots, p.supervisor, vehicle
            )
        return seen._replace(states=seen.states[:own], supervisor=motion)

    def step(seen: Seen, p: Any, knots: Any) -> Step:
        if units:
            seen = watched(seen, p, knots)
            acts = seen.supervisor[1 if p.supervisor.strategy == HOLD else 0]
        else:
            acts = 1.0 - supervised_gait(seen, p, knots, supervision)[1]
        step = law.step(seen, p, knots)
        rates = xp.hstack([step.rates, seen.supervisor[1:]]) if units else step.rates
        return Step(step.inputs, rates, xp.hstack([step.signals[:tracked], acts]))

    def tilts(seen: Seen, rates: Any, p: Any, knots: Any) -> Any:
        if units:
            motion = xp.hstack([seen.states[own], rates[own:]])
            seen = seen._replace(supervisor=motion)
        return supervised_gait(seen, p, knots, supervision)[0][:, :2]

    return replace(
        law,
        step=step,
        states={**law.states, **dict(zip(SUPERVISOR_FIELDS, units, strict=False))},
        initial=lambda plan: (*law.initial(plan), *(0.0,) * len(units)),
        signals=(*law.signals, SUPERVISION),
        units={**law.units, SUPERVISION: "1"},
        tilts=tilts,
    )
