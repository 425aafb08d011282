"""Damage to files, reproducible in every run."""

from __future__ import annotations

from random import Random

from tiltsim.errors import InputError


def read_with_flipped_bits(file, read, count, seed=0):
    """Yield what ``read`` returns when one bit of a file is flipped, unless it is refused."""
    whole, chance = file.read_bytes(), Random(seed)
    for bit in chance.sample(range(8 * len(whole)), count):
        content = bytearray(whole)
        content[bit // 8] ^= 1 << bit % 8
        file.write_bytes(content)
        try:
            found = read()
        except InputError as error:
            line = str(error)
        else:
            yield found
            continue
        assert str(file) in line
        assert "\n" not in line
