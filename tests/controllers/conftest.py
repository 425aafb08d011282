"""What several tests of control laws share."""

from __future__ import annotations

import pytest

from tests.controllers.scalar_sources import compiled


@pytest.fixture(scope="session")
def native():
    """The scalar functions under numba, by the function that each was made from."""
    return compiled()
