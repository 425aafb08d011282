"""Types and parameters of the gaits."""

from __future__ import annotations

from typing import Final, NamedTuple

from tiltsim_controllers.mathematics.scalar import Octet

TiltsAndRates = Octet
"""``(alpha_1, ..., alpha_4, rate_1, ..., rate_4)``, rad and rad/s."""

NO_KNOTS: Final = (0.0, 0.0)
"""The knots of gaits without keyframes; not empty, so that native code can give them a type."""

FIXED: Final = 0.0
TROT_INSTANT: Final = 1.0
TROT_CONTINUOUS: Final = 2.0
KEYFRAMES: Final = 3.0
TWO_COLOR_CIRCLE: Final = 4.0
PENGUIN: Final = 5.0
ROTATING: Final = 6.0
TABLE: Final = 7.0

GAIT_TYPES: Final = {
    "fixed": FIXED,
    "trot_instant": TROT_INSTANT,
    "trot_continuous": TROT_CONTINUOUS,
    "walk": KEYFRAMES,
    "run": KEYFRAMES,
    "transverse_gallop": KEYFRAMES,
    "rotary_gallop": KEYFRAMES,
    "two_color": KEYFRAMES,  # a circular path is a TWO_COLOR_CIRCLE
    "waypoints": KEYFRAMES,
    "penguin_small": PENGUIN,
    "penguin_large": PENGUIN,
    "rotating": ROTATING,
    "table": TABLE,
}
"""How a gait is evaluated, by its name in a scenario."""


class GaitParameters(NamedTuple):
    """Parameters of a gait; each type reads the fields it needs."""

    type: float
    angle_1: float = 0.0  # rad, fixed; the tilt-car's gaits move only the first angle
    angle_2: float = 0.0
    angle_3: float = 0.0
    angle_4: float = 0.0
    amplitude: float = 0.0  # rad, trots and penguins
    period: float = 1.0  # s, all but fixed; of a table its last time
    scale: float = 1.0  # factor of all four angles (ch. 5, Eq. 16: 1/n)
    bias: float = 1.0  # [eta] factor of alpha_3 and alpha_4 (ch. 6, Eqs. 12-15)
    keyframes: float = 0.0  # number of keyframes, or of segments of a table, in the knots
    centre_1: float = 0.0  # rad, circle in the alpha_1-alpha_2 plane
    centre_2: float = 0.0
    radius: float = 0.0
    color: float = 0.0
    drag_ratio: float = 0.0  # [r] sets the offset of the blue lines
    rate: float = 0.0  # rad/s, rotating
    repeats: float = 0.0  # 1 or 0: whether a table starts over after its period
