"""Recognition of a video by its first bytes."""

from __future__ import annotations

import os
from pathlib import Path

from kinemimic.pipeline.readers.video.container import is_video


def test_a_video_is_known_by_its_first_bytes(tmp_path: Path) -> None:
    for name, head, found in (("a.mp4", b"\0\0\0 ftypisom", True), ("walk.skl", b"0 0.1 0.2 0.3", False)):
        (tmp_path / name).write_bytes(head)
        assert is_video(tmp_path / name) == found


def test_a_pipe_is_not_opened(tmp_path: Path) -> None:
    # Opening it would wait for someone to write.
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    assert not is_video(pipe)
