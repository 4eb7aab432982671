"""What tests of fetching share: one file, patience of milliseconds, and what lies in a folder afterwards."""

from __future__ import annotations

from pathlib import Path

from kinemimic.pipeline.catalog.download import RetryPolicy
from kinemimic.pipeline.catalog.entry import Catalog
from kinemimic.pipeline.catalog.fetch import Fetched, fetch
from peers.web import CONTENT, Request, Script

HALF = len(CONTENT) // 2
QUICK = RetryPolicy(connect=2.0, read=0.4, pauses=(0.0, 0.01, 0.02))
ONCE = RetryPolicy(connect=2.0, read=0.4, pauses=())


def one(catalog: Catalog, folder: Path, mirror: str | Path, retry_policy: RetryPolicy = QUICK) -> Fetched:
    """Fetch one file."""
    return fetch(catalog.select(["walks/one.skl"]), folder, mirror=mirror, retry_policy=retry_policy)


def left(folder: Path) -> dict[str, bytes]:
    """Every file below a folder."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def in_turn(*scripts: Script) -> Script:
    """Each request is answered by the next script, the last of them for good."""
    queue = list(scripts)

    def answer(request: Request) -> None:
        script = queue.pop(0) if len(queue) > 1 else queue[0]
        script(request)

    return answer
