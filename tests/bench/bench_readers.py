"""Readers of text captures, a 10 MB file of each, against pandas' C parser on the same numbers.

One process, one thread, from files in the page cache; the best of five, ours and pandas' by turns. "read" is
all of it: from the path to the clip with its checks, its units and (BVH, ASF/AMC, MOT, UI-PRMD) its
kinematics; "parse" is text to numbers alone, where a format has a step of its own for that. pandas gets the
numbers of the same file as a plain table, one line a frame, and does nothing more than parse them. The peer
is the package `bvh`, which most Python code that reads BVH builds on.
"""

from __future__ import annotations

import gzip
import importlib
import io
import pkgutil
import re
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import pandas as pd

sys.path.insert(0, str(Path(__file__).parents[1]))
import samples

from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.mocap import bvh_text
from kinemimic.pipeline.readers.recognise import read

SIZE = 10 * 2**20
REPEATS = 5
NUMBER = re.compile(rb"(?<![A-Za-z_])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![A-Za-z_])")
NO_FORMATS = {"motion", "mutate", "depth_scene"}


def best(*calls: Callable[[], object]) -> list[float]:
    """The least seconds of each call, taken by turns."""
    least = [float("inf")] * len(calls)
    for _ in range(REPEATS):
        for index, call in enumerate(calls):
            begin = time.perf_counter()
            call()
            least[index] = min(least[index], time.perf_counter() - begin)
    return least


def grown(name: str) -> tuple[dict[str, bytes], int]:
    """The files of a sample, unpacked, with about SIZE bytes in all of the tables of frames; frames."""
    module = importlib.import_module(f"samples.{name}")

    def unpacked(frames: int) -> dict[str, bytes]:
        return {
            file: gzip.decompress(data) if data[:2] == b"\x1f\x8b" else data
            for file, data in module.files(frames).items()
        }

    few, many = (sum(map(len, unpacked(frames).values())) for frames in (100, 200))
    frames = 200 + round((SIZE - many) / ((many - few) / 100))
    return unpacked(frames), frames


def table_of(content: bytes, frames: int) -> bytes:
    """All the numbers of the text as a table, one line a frame; what is left over at the head is left out."""
    numbers = NUMBER.findall(content)
    width = len(numbers) // frames
    numbers = numbers[len(numbers) - width * frames :]
    return b"\n".join(b" ".join(numbers[k : k + width]) for k in range(0, len(numbers), width)) + b"\n"


def with_pandas(tables: list[bytes]) -> None:
    for table in tables:
        pd.read_csv(io.BytesIO(table), sep=" ", header=None, engine="c", dtype=float).to_numpy()


def line(name: str, what: str, seconds: float, size: int, frames: int, pandas: float) -> None:
    print(
        f"{name:20s} {what:6s} {1e3 * seconds:7.0f} ms {size / 2**20 / seconds:7.0f} MB/s "
        f"{frames / seconds:10,.0f} frames/s   {pandas / seconds:5.2f} x pandas"
    )


def peer(text: str) -> None:
    from bvh import Bvh

    [[float(number) for number in frame] for frame in Bvh(text).frames]


def main() -> None:
    print(f"{'format':20s} {'':6s} {'time':>10s} {'':12s} {'':19s}   (0.5 x pandas is the target)")
    for _, name, _ in pkgutil.iter_modules(samples.__path__):
        if name in NO_FORMATS:
            continue
        if samples.reader(name).FORMAT.binary:
            continue
        files, frames = grown(name)
        # Files that do not grow with the recording (a skeleton, labels) are not parsed in bulk.
        tables = [table_of(content, frames) for content in files.values() if len(content) > SIZE // 10]
        size = sum(map(len, files.values()))
        with tempfile.TemporaryDirectory() as folder:
            for file, content in files.items():
                (Path(folder) / file).write_bytes(content)
            capture = Path(folder) / next(iter(files))
            ours, pandas = best(lambda c=capture: read(c), lambda t=tables: with_pandas(t))
            line(name, "read", ours, size, frames, pandas)
            if name == "bvh":
                text = capture.read_text()
                parse, theirs = best(lambda c=capture: bvh_text.parse(Source.open(c)), lambda t=text: peer(t))
                line(name, "parse", parse, size, frames, pandas)
                line("  the package bvh", "parse", theirs, size, frames, pandas)
                print(f"{'':20s} kinemimic parses {theirs / parse:.1f} times as fast as the package bvh")


if __name__ == "__main__":
    main()
