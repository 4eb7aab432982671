"""`kinemimic batch` against single runs: overhead, memory, a second call; and many synthetic captures.

Single runs: the same stages on the same captures, one after the other in one process, without isolation, rows
or data set; with several cores, that many such processes at once, each with its share of the captures. All
processes use one thread each. Synthetic captures: the virtual Kinect with a seed for each; rate and memory of
the batch (all its processes) are those of the first and of the last tenth of the captures.

    python tests/bench/bench_batch.py [FOLDER] [--files 60] [--synthetic 200]
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from multiprocessing.synchronize import Barrier
from pathlib import Path
from unittest.mock import patch

from kinemimic.evaluate.batch.batch import batch
from kinemimic.evaluate.workflow.run import RUN_STAGES, run
from kinemimic.pipeline.catalog.local_files import captures_folder
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import read_json
from kinemimic.pipeline.parallel.executor import LocalProcesses
from kinemimic.pipeline.parallel.task_pool import parallel_map
from kinemimic.pipeline.readers.search import find_files
from kinemimic.pipeline.virtual_kinect.recorder import record_virtual

PROGRAM = "import sys; from kinemimic.pipeline.cli.main import main; main(sys.argv[1:])"


def memory_of(root: int) -> int:
    """Resident bytes of a process and all that come from it."""
    parents, sizes = {}, {}
    for place in Path("/proc").iterdir():
        if place.name.isdigit():
            try:
                fields = (place / "stat").read_text().rpartition(")")[2].split()
                sizes[int(place.name)] = int((place / "statm").read_text().split()[1])
                parents[int(place.name)] = int(fields[1])
            except (OSError, IndexError):
                continue
    wanted = {root}
    while more := {child for child, parent in parents.items() if parent in wanted} - wanted:
        wanted |= more
    return sum(sizes.get(one, 0) for one in wanted) * os.sysconf("SC_PAGE_SIZE")


class Peak:
    """The largest memory of a process and its children while it runs, looked at ten times a second."""

    def __init__(self, root: int) -> None:
        self.bytes, self._root, self._over = 0, root, threading.Event()
        threading.Thread(target=self._watch, daemon=True).start()

    def _watch(self) -> None:
        while not self._over.wait(0.1):
            self.bytes = max(self.bytes, memory_of(self._root))

    def end(self) -> int:
        self._over.set()
        return self.bytes


def command(*arguments: object) -> tuple[float, int]:
    """Seconds, and peak memory, of a command line in a process of its own."""
    begin = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, *map(str, arguments)], stdout=subprocess.DEVNULL
    )
    peak = Peak(process.pid)
    status = process.wait()
    assert status in (0, 2), status
    return time.perf_counter() - begin, peak.end()


def single_runs(captures: Sequence[Path], out: Path, jobs: int) -> float:
    """Seconds of the stages, one capture after the other in each of `jobs` processes."""
    context = multiprocessing.get_context("spawn")
    ready, start = context.Barrier(jobs + 1), context.Barrier(jobs + 1)
    processes = [
        context.Process(target=_single_runs, args=(captures[k::jobs], out / str(k), ready, start))
        for k in range(jobs)
    ]
    with patch.dict(os.environ, OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1"):
        for process in processes:
            process.start()
        ready.wait()
    begin = time.perf_counter()
    start.wait()
    for process in processes:
        process.join()
        assert process.exitcode == 0
    return time.perf_counter() - begin


def _single_runs(captures: Sequence[Path], out: Path, ready: Barrier, start: Barrier) -> None:
    ready.wait()
    start.wait()
    for number, capture in enumerate(captures):
        try:
            run(capture, out / str(number), stages=RUN_STAGES[:3], quiet=True)
        except (KinemimicError, OSError):
            continue


def recordings(folder: Path, most: int, place: Path) -> None:
    files = find_files([folder])
    chosen = files[:: max(1, len(files) // most)][:most]
    listed = place / "captures.txt"
    listed.write_text("".join(f"{file}\n" for file in chosen))
    total = None
    for jobs in sorted({1, len(os.sched_getaffinity(0))}):
        alone = single_runs(chosen, place / f"single{jobs}", jobs)
        total = total or alone
        out = place / f"out{jobs}"
        seconds, peak = command("batch", f"@{listed}", "--out", out, "-j", jobs)
        again, _ = command("batch", f"@{listed}", "--out", out, "-j", jobs)
        rows = read_json(out / "batch.json")["captures"]
        frames = sum(row["frames"] or 0 for row in rows)
        print(f"{len(chosen)} files, {len(rows)} captures, {frames} frames, {jobs} processes")
        print(f"  single runs   {alone:7.1f} s  {frames / alone:6.0f} frames/s, {jobs} at once")
        print(f"  batch         {seconds:7.1f} s  {frames / seconds:6.0f} frames/s")
        print(f"  overhead      {100 * (seconds / alone - 1):+7.1f} %")
        print(f"  against one   {100 * (jobs * seconds / total - 1):+7.1f} % of processor time")
        print(f"  peak memory   {peak / 2**20:7.0f} MiB, all processes")
        print(f"  second call   {again:7.2f} s", flush=True)


def _made(task: tuple[int, Path]) -> None:
    """A capture of the virtual Kinect, as its recorder writes it; without its truth."""
    seed, place = task
    made = place / f"made{seed}"
    record_virtual(made, seed=seed)
    (made / "kinect_walk.skl").replace(place / "in" / f"p{seed:05d}_walk.skl")
    shutil.rmtree(made)


def synthetic(count: int, place: Path) -> None:
    (place / "in").mkdir()
    parallel_map(_made, [(seed, place) for seed in range(count)])
    begin = time.perf_counter()
    times: list[float] = []
    sizes: list[int] = []

    class Watched(LocalProcesses):
        def map(self, work, tasks):  # type: ignore[no-untyped-def]
            for outcome in super().map(work, tasks):
                times.append(time.perf_counter() - begin)
                sizes.append(memory_of(os.getpid()))
                yield outcome

    batch([place / "in"], place / "out", executor=Watched(len(os.sched_getaffinity(0)), 300.0, 4 << 30))
    tenth = max(1, len(times) // 10)
    accepted = read_json(place / "out" / "batch.json")["counts"]["accepted"]
    print(f"{len(times)} synthetic captures, {accepted} accepted, {time.perf_counter() - begin:.1f} s")
    for title, part in (("first", slice(0, tenth)), ("last", slice(-tenth, None))):
        span, size = times[part], sizes[part]
        rate = (len(span) - 1) / (span[-1] - span[0]) if len(span) > 1 else float("nan")
        print(f"  {title:5} tenth  {rate:6.2f} captures/s, {max(size) / 2**20:6.0f} MiB")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?", help="recordings; default: KINEMIMIC_CAPTURES")
    parser.add_argument("--files", type=int, default=60, help="at most so many files, spread over the folder")
    parser.add_argument("--synthetic", type=int, default=200, help="captures of the virtual Kinect")
    given = parser.parse_args()
    folder = given.folder or captures_folder()
    with tempfile.TemporaryDirectory() as place:
        if folder.is_dir() and given.files:
            recordings(folder, given.files, Path(place))
        elif given.files:
            print(f"no recordings at {folder}: set KINEMIMIC_CAPTURES")
    with tempfile.TemporaryDirectory() as place:
        if given.synthetic:
            synthetic(given.synthetic, Path(place))


if __name__ == "__main__":
    main()
