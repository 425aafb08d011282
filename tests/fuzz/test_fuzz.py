"""Five hundred random inputs; ``python -m tests.fuzz --count 20000 --seed N`` runs more."""

from __future__ import annotations

import pytest

from tests.fuzz.running import fuzz


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_no_input_leads_to_a_traceback_or_more_than_a_line(seed):
    assert fuzz(125, seed) == []
