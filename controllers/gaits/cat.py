"""Gaits after the cat: walk, run, transverse gallop, rotary gallop (ch. 5).

The figures that hold ch. 5's keyframes are lost, so these gaits are rebuilt from published
footfall timing, and numbers flown with them are ours, not the thesis'. A pod is a leg: it sweeps
from ``+amplitude`` at touchdown to ``-amplitude`` at lift-off during stance, at a constant rate,
and back during swing. Each gait is then four touchdown phases and one duty factor (the share of
the stride that a foot is on the ground). The continuous trot of ch. 4, Eq. (34), is exactly such a
gait, with duty factor 1/2 and the diagonal pairs half a stride apart; it fixes which pods are
diagonal: 1 with 2, 3 with 4. We take pods 1, 2, 3, 4 for left fore, right hind, right fore, left
hind.

Sources of the timing:

* Symmetrical gaits. Cats walk in lateral sequence (left hind, left fore, right hind, right fore)
  with even intervals; a duty factor above one half is a walk, below it a run: M. Hildebrand,
  "Analysis of tetrapod gaits: general considerations and symmetrical gaits", in Neural Control of
  Locomotion (1976). Ch. 5 asks the same of its run: symmetrical, and not the trot.
* Gallops. The second foot of a pair lands shortly after the first, the fore pair half a stride
  after the hind pair; the leading feet of both pairs are on one side in the transverse gallop, on
  opposite sides in the rotary gallop: R. McN. Alexander, "The gaits of bipedal and quadrupedal
  animals", Int. J. Robotics Research 3 (1984); C. M. Biancardi and A. E. Minetti, "Biomechanical
  determinants of transverse and rotary gallop in cursorial mammals", J. Exp. Biol. 215 (2012).

From these come the order of the feet and the rules above; phases and duty factors are round numbers
within them.
"""

from __future__ import annotations

from typing import Final, NamedTuple


class Footfall(NamedTuple):
    """Timing of one stride, as shares of the period."""

    touchdown: tuple[float, float, float, float]  # of pods 1 to 4
    duty_factor: float


FOOTFALLS: Final = {
    "walk": Footfall((0.25, 0.50, 0.75, 0.00), duty_factor=0.65),
    "run": Footfall((0.25, 0.50, 0.75, 0.00), duty_factor=0.40),
    "transverse_gallop": Footfall((0.50, 0.10, 0.60, 0.00), duty_factor=0.30),
    "rotary_gallop": Footfall((0.60, 0.10, 0.50, 0.00), duty_factor=0.30),
}
"""Cat gaits by the name a scenario gives them."""


def leg_angle(phase: float, touchdown: float, duty_factor: float) -> float:
    """Angle of a leg in units of its amplitude, +1 at touchdown and -1 at lift-off."""
    since = (phase - touchdown) % 1.0
    if since <= duty_factor:
        return 1.0 - 2.0 * since / duty_factor
    return -1.0 + 2.0 * (since - duty_factor) / (1.0 - duty_factor)


def cat_keyframes(footfall: Footfall, amplitude: float) -> list[tuple[float, ...]]:
    """Rows ``(phase, alpha_1, ..., alpha_4)`` (rad) at every touchdown and lift-off."""
    duty = footfall.duty_factor
    events = {0.0}
    for touchdown in footfall.touchdown:
        # Rounded, so that one event reached in two ways is one keyframe.
        events |= {round(touchdown % 1.0, 12), round((touchdown + duty) % 1.0, 12)}
    return [
        (phase, *(amplitude * leg_angle(phase, start, duty) for start in footfall.touchdown))
        for phase in (*sorted(events), 1.0)
    ]
