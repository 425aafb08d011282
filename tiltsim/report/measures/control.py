"""Gains and decouplers of the attitude-altitude law (ch. 4 and 5)."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from tiltsim_controllers.analysis.stability import third_order_loop
from tiltsim_controllers.laws.feedback import conventional_decoupler, modified_decoupler
from tiltsim_controllers.laws.gains import GAIN_SETS
from tiltsim_controllers.vehicle.cross import torque_free_force
from tiltsim_controllers.vehicle.parameters import PRESETS, drag_ratio

_VEHICLE: Final = PRESETS["ar_drone_2"]


def routh_holds(rows: Sequence[str]) -> bool:
    """Whether ch. 4's gains satisfy Routh's condition as printed, without another loop gain."""
    gains = GAIN_SETS["ch04"]._asdict()
    triples = [tuple(gains[f"{row}_{i}"] for i in (1, 2, 3)) for row in rows]
    return all(third_order_loop("", triple, 1.0).stable for triple in triples)


def position_gains_are_positive() -> bool:
    """Whether both gains of ch. 4's position loop are positive."""
    gains = GAIN_SETS["ch04"]
    return min(gains.position_1, gains.position_2) > 0.0


def decouplers_agree_without_tilt() -> bool:
    """Whether both decouplers demand the same roll and pitch of the untilted vehicle."""
    n = torque_free_force(np.zeros(4), drag_ratio(_VEHICLE))
    desired = (1.3, -0.7, 0.4, _VEHICLE.gravity)  # m/s^2, m/s^2, rad, m/s^2
    pair = zip(modified_decoupler(*desired, n), conventional_decoupler(*desired), strict=True)
    return max(abs(modified - conventional) for modified, conventional in pair) < 1e-12
