"""Fixtures of commands that process many captures."""

from __future__ import annotations

import pytest

from kinemimic.pipeline.parallel import executor


@pytest.fixture
def inline(monkeypatch: pytest.MonkeyPatch) -> None:
    """In this process, which spares the start of others."""
    monkeypatch.setattr(executor, "isolated_map", lambda work, tasks, **_: enumerate(map(work, tasks)))
