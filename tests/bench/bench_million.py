"""A capture of a million frames through `ingest` and `inspect`: seconds, CPU seconds and peak memory.

Each file is a block of the known walk on a treadmill, with a millimetre of noise, repeated until it has
the frames: a recording of three hours, as BVH, TRC, C3D and Kinect v1 text. Each command runs in a process of
its own; the peak is the resident memory of that process or of the largest of its workers.

    python tests/bench/bench_million.py [FRAMES] [FORMAT ...]
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from samples import c3d, nui_skl, trc
from samples.motion import in_range, in_sight, rigid_walk, walk, y_up

from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.pipeline.writers.bvh import write_bvh
from kinemimic.pipeline.writers.poses import Poses

FRAMES = 1_000_000
BLOCK = 10_000
NOISE = 0.001  # m
TICKS = os.sysconf("SC_CLK_TCK")
PROGRAM = "from kinemimic.pipeline.cli.main import main; main()"


def repeated(lines: list[str], frames: int) -> Iterator[str]:
    return (lines[k % len(lines)] for k in range(frames))


def write_as_bvh(path: Path, frames: int) -> None:
    shown = rigid_walk(BLOCK, 100.0)
    root = shown.root - np.linspace(0.0, 1.0, BLOCK)[:, None] * (shown.root[-1] - shown.root[0]) * [1, 1, 0]
    write_bvh(path, Poses.rigid(shown.skeleton, 100.0, root, shown.rotations), order="ZXY")
    head, mark, motion = path.read_text().partition("MOTION\n")
    _, step, *rows = motion.splitlines()
    rng = np.random.default_rng(0)
    values = np.loadtxt(rows) + rng.normal(0.0, 0.1, (BLOCK, len(rows[0].split())))
    rows = [" ".join(f"{value:.2f}" for value in row) for row in values]
    with path.open("w") as stream:
        stream.write(f"{head}{mark}Frames: {frames}\n{step}\n")
        stream.writelines(f"{row}\n" for row in repeated(rows, frames))


def markers() -> tuple[list[str], np.ndarray]:
    """Labels, and places (BLOCK, M, 3) in millimetres, Z up."""
    places = trc.markers(in_sight(walk(BLOCK, trc.RATE)))
    points = np.stack(list(places.values()), axis=1)
    return list(places), 1000.0 * (points + np.random.default_rng(0).normal(0.0, NOISE, points.shape))


def write_as_trc(path: Path, frames: int) -> None:
    labels, points = markers()
    points = points[..., [0, 2, 1]] * [1.0, 1.0, -1.0]
    head = trc.text(labels, np.zeros(1), points[:1], declared=frames).splitlines()[:-1]
    rows = ["\t".join(f"{value:.2f}" for value in frame.ravel()) for frame in points]
    with path.open("w") as stream:
        stream.writelines(f"{line}\n" for line in head)
        stream.writelines(
            f"{k + 1}\t{k / trc.RATE:.2f}\t{row}\n" for k, row in enumerate(repeated(rows, frames))
        )


def write_as_c3d(path: Path, frames: int) -> None:
    labels, points = markers()
    whole = np.concatenate([points] * (frames // BLOCK + 1))[:frames].astype(np.float32)
    path.write_bytes(c3d.written(labels, whole, rate=trc.RATE, units="mm", Y_SCREEN=["+Z"]))


def write_as_skl(path: Path, frames: int) -> None:
    points = y_up(in_range(in_sight(walk(BLOCK))))
    points = points + np.random.default_rng(0).normal(0.0, NOISE, points.shape)
    rows = [
        "\t".join(f"{x:.3f}\t{y:.3f}\t{z:.3f}\t2" for x, y, z in frame) + "\t0.018\t0.9989\t0.0429\t0.6962"
        for frame in points
    ]
    with path.open("w") as stream:
        stream.write(nui_skl.header(tuple(node.title().replace("_", "") for node in NODES)) + "\n")
        stream.writelines(f"{33 * k}\t{k}\t{row}\n" for k, row in enumerate(repeated(rows, frames)))


WRITERS: dict[str, Callable[[Path, int], None]] = {
    "bvh": write_as_bvh,
    "trc": write_as_trc,
    "c3d": write_as_c3d,
    "skl": write_as_skl,
}


def measured(*arguments: str | Path) -> tuple[int, float, float, int]:
    """Exit status, wall and CPU seconds, and peak resident bytes of the largest process of a command."""
    begin = time.perf_counter()
    command = [sys.executable, "-c", PROGRAM, *map(str, arguments)]
    started = subprocess.Popen(command, stdout=subprocess.DEVNULL, start_new_session=True)
    seconds: dict[int, float] = {}
    peaks: dict[int, int] = {}
    while started.poll() is None:
        # Workers belong to a fork server, which waits for them: their parent never learns what they used.
        for pid, used, peak in processes(started.pid):
            seconds[pid], peaks[pid] = used, peak
        time.sleep(0.05)
    return started.returncode, time.perf_counter() - begin, sum(seconds.values()), max(peaks.values())


def processes(session: int) -> Iterator[tuple[int, float, int]]:
    """Number, CPU seconds and peak resident bytes of each process of a session."""
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError, StopIteration):
            values = (folder / "stat").read_text().rpartition(")")[2].split()
            if int(values[3]) == session:
                lines = (folder / "status").read_text().splitlines()
                peak = next(line for line in lines if line.startswith("VmHWM")).split()[1]
                yield int(folder.name), (int(values[11]) + int(values[12])) / TICKS, 1024 * int(peak)


def main() -> None:
    frames = int(sys.argv[1]) if sys.argv[1:] else FRAMES
    print(f"{'':8}{'MiB':>6}  {'':8}{'exit':>5}{'wall s':>9}{'CPU s':>9}{'peak GiB':>10}")
    with tempfile.TemporaryDirectory() as folder:
        for name in sys.argv[2:] or WRITERS:
            capture = Path(folder) / f"long.{name}"
            WRITERS[name](capture, frames)
            size = f"{name:8}{capture.stat().st_size / 2**20:6.0f}"
            for command in (("ingest", capture, "--run", Path(folder) / name), ("inspect", capture)):
                status, wall, cpu, peak = measured(*command)
                print(
                    f"{size}  {command[0]:8}{status:5}{wall:9.1f}{cpu:9.1f}{peak / 2**30:10.2f}", flush=True
                )
            capture.unlink()


if __name__ == "__main__":
    main()
