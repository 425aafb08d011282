"""Random numbers as functions of seed, channel and index."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from tiltsim_controllers.code.arrays import normal, program_of
from tiltsim_controllers.code.jax_function import results_in_jax
from tiltsim_controllers.code.operations import hash_word, uniform

COUNT = 4000


def draws(function, seed=1.0, channel=0.0):
    return np.array([function(seed, channel, float(index)) for index in range(COUNT)])


def test_the_hash_permutes_words():
    words = {hash_word(word) for word in range(20_000)}
    assert len(words) == 20_000
    assert max(words) < 2**32


def published_inverse(word):
    """The inverse of the permutation, from the same source: ``lowbias32_r``."""
    word ^= word >> 16
    word = word * 0x43021123 & 0xFFFFFFFF
    word ^= word >> 15 ^ word >> 30
    word = word * 0x1D69E2A5 & 0xFFFFFFFF
    return word ^ word >> 16


def test_the_published_inverse_undoes_the_hash():
    words = [*range(100), *np.random.default_rng(0).integers(0, 2**32, 1000).tolist(), 2**32 - 1]
    assert [published_inverse(hash_word(word)) for word in words] == words


def test_a_draw_uses_seed_channel_and_index_in_turn():
    word = hash_word((hash_word((hash_word(5) + 7) % 2**32) + 11) % 2**32)
    assert uniform(5.0, 7.0, 11.0) == (word + 0.5) / 2**32
    assert uniform(5.0 + 2.0**32, 7.0, 11.0) == uniform(5.0, 7.0, 11.0)


def test_a_changed_bit_changes_half_of_the_bits():
    flips = [
        bin(hash_word(word) ^ hash_word(word ^ (1 << bit))).count("1")
        for word in range(100)
        for bit in range(32)
    ]
    assert np.mean(flips) == pytest.approx(16.0, abs=0.2)


@pytest.mark.parametrize(("seed", "channel"), [(0.0, 0.0), (1.0, 5.0), (2.0**40 + 1.0, 11.0)])
def test_draws_have_the_distribution_they_claim(seed, channel):
    assert stats.kstest(draws(uniform, seed, channel), "uniform").pvalue > 1e-3
    assert stats.kstest(draws(normal, seed, channel), "norm").pvalue > 1e-3


def test_draws_are_functions():
    assert normal(3.0, 2.0, 7.0) == normal(3.0, 2.0, 7.0)


@pytest.mark.parametrize("other", [{"seed": 2.0}, {"channel": 1.0}])
def test_seeds_and_channels_have_nothing_in_common(other):
    correlation = np.corrcoef(draws(normal), draws(normal, **other))[0, 1]
    assert abs(correlation) < 4.0 / np.sqrt(COUNT)


def test_successive_draws_are_uncorrelated():
    x = draws(normal)
    for lag in (1, 2, 3, 10):
        assert abs(np.corrcoef(x[:-lag], x[lag:])[0, 1]) < 4.0 / np.sqrt(COUNT)


@pytest.mark.parametrize("wide", [True, False])
def test_on_arrays_of_jax_a_draw_is_the_one_in_python(wide):
    jax = pytest.importorskip("jax")
    program = program_of(lambda index: normal(7.0, 3.0, index[0]), index=1)

    def drawn(index):
        dtype = "float64" if wide else "float32"
        return results_in_jax(program, [(index,)], dtype, in_segments=False)[0]

    with jax.enable_x64(wide):
        found = jax.jit(jax.vmap(drawn))(np.arange(50.0))
    expected = [normal(7.0, 3.0, float(index)) for index in range(50)]
    np.testing.assert_allclose(found, expected, rtol=1e-13 if wide else 2e-3)
