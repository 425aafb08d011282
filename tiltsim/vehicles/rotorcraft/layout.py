"""Where the numbers of a rotorcraft lie: in a sample, and in MuJoCo's vectors."""

from __future__ import annotations

from typing import Final

from tiltsim_controllers.vehicle.states import TILTROTOR_FIELDS

ROTORS: Final = (1, 2, 3, 4)

OBSERVED_FIELDS: Final = (*TILTROTOR_FIELDS, *(f"alpha_rate_{rotor}" for rotor in ROTORS))
"""A sample of any rotorcraft after its time: rigid body, tilts, rotor speeds, tilt rates."""

# Of a sample; the control laws' state begins alike.
ROLL, PITCH, YAW, P, Q, R = range(6, 12)
ALPHA_1, ALPHA_2, ALPHA_3, ALPHA_4 = range(12, 16)
SPEED_1, SPEED_2, SPEED_3, SPEED_4 = range(16, 20)

# Of ``qpos`` and ``qvel``, which end with the rigid body where there are no pods.
QW, QX, QY, QZ, TILT_1, TILT_2, TILT_3, TILT_4 = range(3, 11)
TILT_RATE_1, TILT_RATE_2, TILT_RATE_3, TILT_RATE_4 = range(6, 10)

# Of ``act``: the rotor speeds, then the states of the controller and of the layers around it.
ROTOR_STATES: Final = 4

# Of the tiltrotor's ``ctrl``: tilt servos, thrusts, rotor accelerations, rates of further states;
# the quadrotor's is the same without servos.
TILTROTOR_THRUSTS, QUADROTOR_THRUSTS = 4, 0
ACCELERATION_1, ACCELERATION_2, ACCELERATION_3, ACCELERATION_4, FURTHER_RATES = range(8, 13)
