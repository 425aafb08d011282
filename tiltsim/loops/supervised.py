"""A supervisor around the laws that fly a planned gait: loops with its states and its column."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import Final

import numpy as np

from controllers.gaits import tilt_reference
from controllers.supervisor import HOLD, STRATEGIES, Supervisor, gait_share
from tiltsim.loop import ControlSetup, Floats, Loop
from tiltsim.loops.gait_feedforward import GAIT_FEEDFORWARD, SUPERVISED_GAIT_FEEDFORWARD
from tiltsim.loops.tiltrotor import SUPERVISED_TILTROTOR, SUPERVISOR_FIELDS, TILTROTOR

SUPERVISION: Final = "supervision"
"""A column: how much the supervisor does, 0 nothing to 1 all it can."""

_WITH_STATES: Final = {
    TILTROTOR: SUPERVISED_TILTROTOR,
    GAIT_FEEDFORWARD: SUPERVISED_GAIT_FEEDFORWARD,
}

_STATE_UNITS: Final = {"hold": ("s", "1"), "return_to_red": ("1", "1/s")}


@cache
def with_supervisor(loop: Loop, strategy: str) -> Loop:
    """The loop of a law under a supervisor with the given strategy.

    Raises KeyError where the law flies no planned gait.
    """
    units = dict(zip(SUPERVISOR_FIELDS, _STATE_UNITS.get(strategy, ())))
    inner = _WITH_STATES[loop] if units else loop

    def derive(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
        return inner.derive(samples, setup) | {SUPERVISION: _supervision(samples, setup)}

    return replace(
        inner, derive=derive, extra_columns={**inner.extra_columns, **units, SUPERVISION: "1"}
    )


def _supervision(samples: Mapping[str, Floats], setup: ControlSetup) -> Floats:
    """The share of the gait's speed, of the way to red, or of its angles that is taken away."""
    law = setup.parameters.law
    supervisor: Supervisor = getattr(law, "supervisor", None) or setup.parameters.supervisor
    if supervisor.strategy != STRATEGIES["scale"]:
        held, rate = (samples[name] for name in SUPERVISOR_FIELDS)
        return rate if supervisor.strategy == HOLD else held
    attitudes = zip(samples["time"].tolist(), samples["roll"].tolist(), samples["pitch"].tolist())
    shares = [
        gait_share(
            tilt_reference(time, law.gait, setup.table), roll, pitch, supervisor, law.vehicle
        )
        for time, roll, pitch in attitudes
    ]
    return 1.0 - np.array(shares)
