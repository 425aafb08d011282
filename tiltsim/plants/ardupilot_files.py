"""Files for ArduPilot: parameters, and the script of a frame in six degrees of freedom."""

from typing import Final

import numpy as np

from tiltsim.errors import InputError
from tiltsim.plants.autopilot_mixer import Mixer
from tiltsim.scenario.scenario import Scenario
from tiltsim_controllers.mathematics.attitude import FLIP

PARAMETERS = {
    "FRAME_CLASS": 16,  # motors with six degrees of freedom, from a script
    "SCR_ENABLE": 1,
    "MOT_THST_EXPO": 1,  # pulses are linear in rotor speed
    "MOT_SPIN_MIN": 0,
    "MOT_SPIN_MAX": 1,
    "MOT_PWM_MIN": 1000,
    "MOT_PWM_MAX": 2000,
    "MOT_SPIN_ARM": 0,
    "MOT_YAW_HEADROOM": 0,  # here a dead zone in which outputs keep their sign
    "LOG_BACKEND_TYPE": 0,  # repeated flights differ while its logger runs
}
"""Parameters of every frame; the user's own file of parameters comes after them."""

RATES: Final = {"RLL": (20.0, 1.0, 0.02), "PIT": (20.0, 1.0, 0.02), "YAW": (10.0, 0.1, 0.0)}
"""Rate loops: bandwidth (rad/s), integral and derivative gains per proportional gain."""


def motor_offset(motor: int) -> int:
    """The function of a servo output for a motor, less the motor's number."""
    return 32 if motor <= 8 else 73 if motor <= 12 else 147


def ardupilot_files(scenario: Scenario) -> dict[str, str]:
    """The contents of ``parameters.parm`` and ``frame.lua``, by name.

    Each output has a factor for roll, pitch, yaw, up, forward and right: the least outputs that
    give one unit of it alone, the largest factor of up and the largest of the torques 1: at full
    throttle the first rotor has its full thrust.

    Args:
        scenario: A scenario with ``[autopilot]``.

    Raises:
        InputError: If it has none, or its outputs do not give every force and torque.
    """
    if scenario.autopilot is None:
        raise InputError(f"{scenario.address}: autopilot: this scenario has no [autopilot] table")
    mixer = Mixer(scenario)
    factors = mixer.factors()
    sizes = np.maximum(np.abs(factors).max(axis=1, keepdims=True), 1e-300)
    if np.linalg.matrix_rank(factors / sizes) < 6:
        raise InputError(
            f"{scenario.address}: autopilot.outputs: they do not give every force and torque; fly "
            "one of the firmware's own frames"
        )
    least = np.linalg.pinv(factors)  # (outputs, 6): x forward, y left, z up
    pushes = least[:, :3] * [1.0, -1.0, 1.0] / np.abs(least[:, 2]).max()  # forward, right, up
    forces = pushes[:, [2, 0, 1]]
    turns = least[:, 3:] * FLIP / np.abs(least[:, 3:]).max()
    lines = [
        "Motors_6DoF:add_motor({}, {}, {}, {})".format(
            channel,
            ", ".join(f"{value:.5f}" for value in (*turn, *force)),
            str(bool(mixer.signed[channel])).lower(),
            channel + 1,
        )
        for channel, (turn, force) in enumerate(zip(turns, forces, strict=True))
    ]
    lines.append(f"assert(Motors_6DoF:init({len(lines)}), 'frame')")
    lines.append("motors:set_frame_string('tiltsim')")
    parameters = [f"{name} {value}" for name, value in PARAMETERS.items()]
    inertia = np.diag(np.reshape(mixer.vehicle.inertia, (3, 3)))
    for size, (axis, (bandwidth, *shares)) in zip(inertia, RATES.items(), strict=True):
        gain = bandwidth * size * np.abs(least[:, 3:]).max()  # per unit of the firmware's torque
        for name, share in zip("PID", (1.0, *shares), strict=True):
            parameters.append(f"ATC_RAT_{axis}_{name} {gain * share:.5g}")
    for motor in range(1, len(least) + 1):
        parameters.append(f"SERVO{motor}_FUNCTION {motor + motor_offset(motor)}")
    return {"parameters.parm": "\n".join(parameters) + "\n", "frame.lua": "\n".join(lines) + "\n"}
