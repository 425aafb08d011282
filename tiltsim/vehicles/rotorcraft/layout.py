"""Where the numbers of a rotorcraft lie: in a sample, and in MuJoCo's vectors."""

from __future__ import annotations

from typing import Final

from tiltsim_controllers.vehicle.states import ROTORS, TILTROTOR_FIELDS

OBSERVED_FIELDS: Final = (*TILTROTOR_FIELDS, *(f"alpha_rate_{rotor}" for rotor in ROTORS))
"""A sample of any rotorcraft after its time: rigid body, tilts, rotor speeds, tilt rates.

It begins as `tiltsim_controllers.vehicle.states` counts.
"""

# Of ``qpos`` and ``qvel``: the quaternion, and the first tilt and tilt rate.
QW, QX, QY, QZ, TILT_1 = range(3, 8)
TILT_RATE_1: Final = 6

ROTOR_STATES: Final = 4
"""Of ``act``: rotor speeds, before the states of the controller and of the layers around it."""

# Of ``ctrl``: tilt servos, thrusts, rotor accelerations, rates of further states; the quadrotor has
# the same without servos.
TILTROTOR_THRUSTS, QUADROTOR_THRUSTS, ACCELERATION_1, FURTHER_RATES = 4, 0, 8, 12
