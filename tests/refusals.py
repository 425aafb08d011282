"""Refusals, in one line."""

from __future__ import annotations

import pytest

from tiltsim.errors import InputError


def refusal(function, *arguments, **more):
    """The line with which a call is refused."""
    with pytest.raises(InputError) as caught:
        function(*arguments, **more)
    line = str(caught.value)
    assert len(line.splitlines()) == 1, line
    return line
