"""Random numbers as functions: the same seed, channel and index always give the same draw.

A generator with hidden state could not be evaluated at every integrator stage, restarted from a
saved state or compiled unchanged. A hash of counters can (Salmon et al., "Parallel random numbers:
as easy as 1, 2, 3", 2011). The hash is the 32-bit multiply-and-shift permutation with C. Wellons'
constants ("Prospecting for hash functions", 2018).
"""

from __future__ import annotations

from math import cos, log, sqrt
from typing import Final

from tiltsim_controllers.mathematics.scalar import scalar

TWO_PI: Final = 6.283185307179586
_WORD: Final = 0xFFFFFFFF


@scalar
def hash_word(word: int) -> int:
    """Permute the 32-bit words so that the bits of neighbours are uncorrelated."""
    word = word ^ (word >> 16)
    word = (word * 0x7FEB352D) & _WORD
    word = word ^ (word >> 15)
    word = (word * 0x846CA68B) & _WORD
    return word ^ (word >> 16)


@scalar
def uniform(seed: float, channel: float, index: float) -> float:
    """A uniform draw from (0, 1): the middle of one of 2^32 equal intervals.

    The arguments are integers, of which the lowest 32 bits are used.
    """
    word = hash_word(int(seed) & _WORD)
    word = hash_word((word + int(channel)) & _WORD)
    word = hash_word((word + int(index)) & _WORD)
    return (word + 0.5) / 4294967296.0


@scalar
def normal(seed: float, channel: float, index: float) -> float:
    """A draw from the standard normal distribution (Box and Muller, 1958), below 6.7 in magnitude.

    The arguments are integers; it uses the channels ``2 channel`` and ``2 channel + 1`` of
    `uniform`.
    """
    radius = sqrt(-2.0 * log(uniform(seed, 2.0 * channel, index)))
    return radius * cos(TWO_PI * uniform(seed, 2.0 * channel + 1.0, index))
