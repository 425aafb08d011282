"""Gaits after the cat: walk, run, transverse gallop, rotary gallop (ch. 5).

The figures with the keyframes of ch. 5 are missing. These gaits are a reconstruction: the order of
the feet from published footfalls, and a timing and a swing chosen so that the remaining statements
of ch. 5 hold (`SWINGS`). Many others would satisfy them as well, so numbers flown with these gaits
are ours, not the thesis's.

A pod corresponds to a leg. The references of ch. 4 and 5 move toward +X and +Y alike, so the pods
of the +X, +Y, -X and -Y arms (1 to 4) are the right fore, left fore, left hind and right hind leg.
A leg at the angle ``f`` forward of the vertical tilts its pod so that the thrust points forward,
which is ``alpha = (-f, f, f, -f)`` with the signs of ``F(alpha)`` in ch. 3. During stance a leg
moves from ``lean + amplitude`` at touchdown to ``lean - amplitude`` at lift-off, at a constant
rate, and then swings back. A gait is four touchdown phases, one duty factor (the fraction of the
stride during which a foot is on the ground), and a swing. The continuous trot of ch. 4, Eq. (34),
is such a gait, with duty factor 1/2, no lean, and the diagonal pairs half a stride apart.

Sources of the order and the rules:

* Symmetrical gaits. The feet of a pair fall evenly; cats walk in lateral sequence (left hind, left
  fore, right hind, right fore), with the fore foot a quarter of a stride behind the hind foot of
  its side, and half a stride in the trot; a duty factor above one half is a walk, below it a run:
  M. Hildebrand, "Analysis of tetrapod gaits: general considerations and symmetrical gaits", in
  Neural Control of Locomotion (1976).
* Gallops. The second foot of a pair lands shortly after the first, the fore pair half a stride
  after the hind pair; the leading feet of both pairs are on one side in the transverse gallop, on
  opposite sides in the rotary gallop: R. McN. Alexander, "The gaits of bipedal and quadrupedal
  animals", Int. J. Robotics Research 3 (1984); C. M. Biancardi and A. E. Minetti, "Biomechanical
  determinants of transverse and rotary gallop in cursorial mammals", J. Exp. Biol. 215 (2012).

Within these rules the numbers are chosen: with the walk's long stance and the run's late fore feet
no rotor reverses its direction (ch. 5, Sec. 2); see `SWINGS` for the rest.
"""

from typing import Final, NamedTuple

FORWARD: Final = (-1.0, 1.0, 1.0, -1.0)
"""Sign with which the tilt angle of each pod tips its thrust forward, toward +X and +Y."""


class Footfall(NamedTuple):
    """Timing of one stride, as fractions of the period."""

    touchdown: tuple[float, float, float, float]  # of pods 1 to 4: RF, LF, LH, RH
    duty_factor: float


FOOTFALLS: Final = {
    "walk": Footfall((0.75, 0.25, 0.00, 0.50), duty_factor=0.95),
    "run": Footfall((0.875, 0.375, 0.00, 0.50), duty_factor=0.45),
    "transverse_gallop": Footfall((0.60, 0.50, 0.00, 0.10), duty_factor=0.30),
    "rotary_gallop": Footfall((0.50, 0.60, 0.00, 0.10), duty_factor=0.30),
}
"""Cat gaits by their name in a scenario."""


class Swing(NamedTuple):
    """Swing of the legs, rad, before scaling."""

    lean: float  # forward, mean of touchdown and lift-off
    amplitude: float


SWINGS: Final = {
    "walk": Swing(lean=1.055, amplitude=1.25),
    "run": Swing(lean=0.5, amplitude=0.5),
    "transverse_gallop": Swing(lean=1.3, amplitude=0.4),
    "rotary_gallop": Swing(lean=1.3, amplitude=0.4),
}
"""The swings with which the statements of ch. 5 hold, with the timing of `FOOTFALLS`.

* An error of 2.47 m under the conventional decoupler at T = 1 s, nearly independent of the period,
  requires a mean side force: 2.47 m times the position gain is an acceleration of 0.25 g. Legs that
  swing evenly about the vertical have almost none. It determines the walk's lean, and the error of
  0.19 m under the modified decoupler its amplitude.
* Unscaled, walk and gallops reach a singular matrix; scaled by 1/2 and 1/3 their distance from it
  grows. The determinant decreases with the lean of the hind legs relative to the fore legs, ``R = 4
  + (1/r - 2 r) (f_1 + f_2 - f_3 - f_4)`` to first order: this bounds all amplitudes, especially in
  the gallops, whose fore and hind pairs are half a stride apart.
* The run flies unscaled; its errors are the largest, the walk's the smallest, and the two gallops'
  similar.
"""


def leg_angle(phase: float, touchdown: float, duty_factor: float) -> float:
    """Angle of a leg in units of its amplitude, +1 at touchdown and -1 at lift-off.

    ``phase``, ``touchdown`` and ``duty_factor`` are fractions of the period.
    """
    since = (phase - touchdown) % 1.0
    if since <= duty_factor:
        return 1.0 - 2.0 * since / duty_factor
    return -1.0 + 2.0 * (since - duty_factor) / (1.0 - duty_factor)


def cat_keyframes(
    footfall: Footfall, amplitude: float, lean: float = 0.0
) -> list[tuple[float, ...]]:
    """Rows ``(phase, alpha_1, ..., alpha_4)`` (rad) at every touchdown and lift-off.

    ``amplitude`` and forward ``lean`` are in rad.
    """
    duty = footfall.duty_factor
    events = {0.0}
    for touchdown in footfall.touchdown:
        # Rounded, so that coinciding events make one keyframe.
        events |= {round(touchdown % 1.0, 12), round((touchdown + duty) % 1.0, 12)}
    legs = tuple(zip(FORWARD, footfall.touchdown, strict=True))
    return [
        (
            phase,
            *(sign * (lean + amplitude * leg_angle(phase, start, duty)) for sign, start in legs),
        )
        for phase in (*sorted(events), 1.0)
    ]
