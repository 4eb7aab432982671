"""Reading Parquet starts no thread: one that still holds a file when the interpreter exits can abort it."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.files.store import write_clip, write_table
from kinemimic.pipeline.files.validation.tables import read_table
from kinemimic.pipeline.kinematics.clip import Clip

# Counted in a process of its own: pyarrow keeps threads that other tests have started.
COUNT = """
import os, sys
from pathlib import Path
from kinemimic.pipeline.files.store import read_clip
from kinemimic.pipeline.files.validation.tables import read_table

kind, path = sys.argv[1], Path(sys.argv[2])
before = len(os.listdir("/proc/self/task"))
read_clip(path) if kind == "clip" else read_table(path, kind="a table", advice="none")
print(len(os.listdir("/proc/self/task")) - before)
"""


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="counts threads in /proc")
@pytest.mark.parametrize("kind", ["clip", "table"])
def test_reading_starts_no_thread(kind: str, tmp_path: Path, node_clip: Callable[..., Clip]) -> None:
    path = tmp_path / f"{kind}.parquet"
    if kind == "clip":
        write_clip(path, node_clip())
    else:
        write_table(path, {"name": ["a", "b"], "number": [1.0, 2.0]}, {})
    command = [sys.executable, "-c", COUNT, kind, str(path)]
    counted = subprocess.run(command, capture_output=True, text=True, check=True)
    assert counted.stdout == "0\n"


def test_what_is_no_parquet_is_said_in_our_words(tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    for content in (b"", b"a walk", b"PAR1 a walk PAR1"):
        path.write_bytes(content)
        with pytest.raises(CaptureError) as error:
            read_table(path, kind="a table", advice="make it again")
        assert str(error.value) == (
            f"{path}: expected a table, found a damaged file, or no Parquet; make it again"
        )
