"""The closed loops that can be flown: one module a law, found by the name of the law."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from tiltsim.loops.full_pose import FULL_POSE
from tiltsim.loops.quadrotor_attitude_altitude import QUADROTOR_ATTITUDE_ALTITUDE
from tiltsim.loops.switching import SWITCHING
from tiltsim.loops.tiltrotor import TILTROTOR
from tiltsim.loops.yaw_position import YAW_POSITION

if TYPE_CHECKING:
    from tiltsim.loop import ControlSetup, Loop
    from tiltsim.scenario import Scenario

LOOPS: Final[dict[str, Loop]] = {
    "attitude_altitude": TILTROTOR,
    "full_pose": FULL_POSE,
    "yaw_position": YAW_POSITION,
    "switching": SWITCHING,
    "quadrotor_attitude_altitude": QUADROTOR_ATTITUDE_ALTITUDE,
}
"""Loops by the name a scenario gives their law."""


def loop_of(scenario: Scenario) -> Loop:
    """The loop that a scenario flies."""
    return LOOPS[scenario.controller.law]


def control_setup(scenario: Scenario) -> ControlSetup:
    """Everything the control step of a scenario needs to know."""
    loop = loop_of(scenario)
    return loop.setup(scenario, loop.signature)
