"""The thesis's matrices, written out as printed, against which the code is checked."""

from __future__ import annotations

import numpy as np


def force_matrix(vehicle, alpha):
    """Ch. 3, Eq. (3)."""
    (s1, s2, s3, s4), (c1, c2, c3, c4) = np.sin(alpha), np.cos(alpha)
    return vehicle.thrust_coefficient * np.array(
        [[0, s2, 0, -s4], [s1, 0, -s3, 0], [-c1, c2, -c3, c4]]
    )


def torque_matrix(vehicle, alpha):
    """Ch. 3, Eq. (5)."""
    lkf, km = vehicle.arm_length * vehicle.thrust_coefficient, vehicle.drag_coefficient
    (s1, s2, s3, s4), (c1, c2, c3, c4) = np.sin(alpha), np.cos(alpha)
    return np.array(
        [
            [0, lkf * c2 - km * s2, 0, -lkf * c4 + km * s4],
            [lkf * c1 + km * s1, 0, -lkf * c3 - km * s3, 0],
            [lkf * s1 - km * c1, -lkf * s2 - km * c2, lkf * s3 - km * c3, -lkf * s4 - km * c4],
        ]
    )
