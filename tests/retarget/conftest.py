"""The synthetic walker."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from samples.walker import Walker
from samples.walker import walker as made


@pytest.fixture
def walker() -> Callable[..., Walker]:
    """See `samples.walker`."""
    return made
