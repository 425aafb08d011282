"""Random numbers as functions: the same seed, channel and index always give the same draw.

A generator with hidden state could not be evaluated at every integrator stage, restarted from a
saved state or compiled unchanged. A hash of counters can (Salmon et al., "Parallel random numbers:
as easy as 1, 2, 3", 2011). The hash is the 32-bit multiply-and-shift permutation with C. Wellons'
constants ("Prospecting for hash functions", 2018).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

WORD: Final = 0xFFFFFFFF


def hash_word(word: Any, whole: Callable[[int], Any] = int) -> Any:
    """Permute the 32-bit words so that the bits of neighbors are uncorrelated.

    Args:
        word: From 0 to 2^32 - 1.
        whole: Its type, of at least 32 bits; overflow is ignored.
    """
    word = word ^ (word >> 16)
    word = (word * whole(0x7FEB352D)) & whole(WORD)
    word = word ^ (word >> 15)
    word = (word * whole(0x846CA68B)) & whole(WORD)
    return word ^ (word >> 16)


def uniform(seed: float, channel: float, index: float) -> float:
    """A uniform draw from (0, 1): the middle of one of 2^32 equal intervals.

    The arguments are integers, of which the lowest 32 bits are used.
    """
    word = hash_word(int(seed) & WORD)
    word = hash_word((word + int(channel)) & WORD)
    word = hash_word((word + int(index)) & WORD)
    return float((word + 0.5) / 4294967296.0)
