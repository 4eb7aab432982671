"""Retargeting: frames per second on one core against the same work frame by frame, and an hour end to end.

The closed form is compared with scipy's Rotation, called for each joint of each frame as most code that
retargets does; the refinement with scipy's least_squares on each frame by itself, with the same terms (feet,
ground, rest) and the same analytic Jacobians but nothing that ties the frames together. Ours and the peer in
one process, the best of three. The hour is 108,000 frames of a virtual Kinect's passes as `.skl` text,
through ingest, convert and retarget, each a process of its own whose peak memory is printed.
`python tests/bench/bench_retarget.py --no-hour` leaves that out.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from kinemimic.pipeline.convert import on_nodes
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import NODE_PARENTS, NODES
from kinemimic.pipeline.readers.recognise import read
from kinemimic.pipeline.virtual_kinect.recorder import record_virtual
from kinemimic.retarget.feet.contact import find_stances
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.noncyclic import fit_noncyclic
from kinemimic.retarget.optimise.leg_chain import UNKNOWNS, leg_chain, leg_jacobian, leg_points
from kinemimic.retarget.optimise.refine import refine
from kinemimic.retarget.strides.excerpt import Excerpt, excerpt_of_pass

FRAMES = 20_000
PEER_FRAMES = 150
HOUR = 108_000
REPEATS = 3


def best(call: Callable[[], object], repeats: int = REPEATS) -> float:
    """The least seconds of a call."""
    least = float("inf")
    for _ in range(repeats):
        begin = time.perf_counter()
        call()
        least = min(least, time.perf_counter() - begin)
    return least


def long_pass(recorded: Clip, frames: int) -> tuple[Clip, Excerpt]:
    """One pass of `frames` frames, from the recording's own repeated at an even rate."""
    clip = on_nodes(recorded)
    rows = np.resize(np.flatnonzero(np.isfinite(clip.positions).all(axis=(1, 2))), frames)
    made = replace(
        clip,
        times=np.arange(frames) / 60.0,
        positions=clip.positions[rows],
        states=clip.states[rows],
        passes=np.zeros(frames, dtype=np.int32),
    )
    return made, excerpt_of_pass(made, 0)


# For each node the bone along its frame's own axis: what hangs from it.
_BONES = {
    "hip_center": ("hip_center", "spine"),
    "spine": ("spine", "shoulder_center"),
    "shoulder_center": ("shoulder_center", "head"),
    **{
        f"{a}_{side}": (f"{a}_{side}", f"{b}_{side}")
        for side in ("left", "right")
        for a, b in (
            ("shoulder", "elbow"),
            ("elbow", "wrist"),
            ("wrist", "hand"),
            ("hip", "knee"),
            ("knee", "ankle"),
            ("ankle", "foot"),
        )
    },
}


def by_rotation_calls(positions: np.ndarray) -> np.ndarray:
    """Local quaternions (T, 20, 4), one scipy Rotation a joint and frame."""
    out = np.zeros((len(positions), len(NODES), 4))
    for t, p in enumerate(positions):
        lateral = p[N["hip_left"]] - p[N["hip_right"]]
        world = []
        for node, name in enumerate(NODES):
            if name not in _BONES:
                world.append(world[NODE_PARENTS[node]])
                continue
            start, end = _BONES[name]
            up = p[N[end]] - p[N[start]]
            up = up / np.linalg.norm(up)
            ahead = np.cross(lateral, up)
            ahead = ahead / np.linalg.norm(ahead)
            world.append(Rotation.from_matrix(np.stack([ahead, np.cross(up, ahead), up], axis=1)))
        for node, parent in enumerate(NODE_PARENTS):
            turn = world[node] if parent < 0 else world[parent].inv() * world[node]
            out[t, node] = turn.as_quat()
    return out


def by_least_squares(motion: Motion, frames: int) -> None:
    """Each of the first frames' legs by itself."""
    chain = leg_chain(motion.root, motion.rotations)
    corners = leg_points(chain, np.zeros((len(motion.root), UNKNOWNS)))[:, :, 2:]
    standing = find_stances(motion.contacts, corners, rate=motion.rate, cyclic=False)
    anchors = standing.anchors(corners, np.zeros(3))
    rest = np.full(UNKNOWNS, 1.0 / np.radians(4.0))
    for t in range(frames):
        one = slice(t, t + 1)
        here, hold = chain.window(one), np.sqrt(standing.weight[one])[..., None] / 0.002

        def residual(x: np.ndarray, here=here, hold=hold, one=one) -> np.ndarray:
            points = leg_points(here, x[None])[:, :, 2:].copy()
            points[..., :2] -= anchors[one]
            return np.concatenate([(hold * points).ravel(), rest * x])

        def jacobian(x: np.ndarray, here=here, hold=hold) -> np.ndarray:
            legs = hold[..., None] * leg_jacobian(here, x[None])[1][:, :, 2:]
            rows = np.zeros((2, 12, UNKNOWNS))
            for leg, begin in enumerate((6, 13)):
                rows[leg][:, :6] = legs[0, leg].reshape(12, 13)[:, :6]
                rows[leg][:, begin : begin + 7] = legs[0, leg].reshape(12, 13)[:, 6:]
            return np.concatenate([rows.reshape(24, UNKNOWNS), np.diag(rest)])

        least_squares(residual, np.zeros(UNKNOWNS), jacobian)


def hour(capture: Path, folder: Path) -> Path:
    """A recording of HOUR frames: the passes of a `.skl` again and again, the clock going on."""
    header, *rows = capture.read_text().splitlines()
    split = [row.split("\t", 2) for row in rows]
    span = int(split[-1][0]) - int(split[0][0]) + 5000
    numbers = int(split[-1][1]) - int(split[0][1]) + 150
    path = folder / "hour.skl"
    with path.open("w") as stream:
        stream.write(header + "\n")
        for written in range(HOUR):
            again, row = divmod(written, len(split))
            time_, number, rest = split[row]
            stream.write(f"{int(time_) + again * span}\t{int(number) + again * numbers}\t{rest}\n")
    return path


def end_to_end(capture: Path, folder: Path) -> None:
    run = folder / "run"
    total = 0.0
    for stage in (["ingest", str(capture)], ["convert"], ["retarget"]):
        code = (
            "import resource, sys; from kinemimic.pipeline.cli.main import _status; "
            "status = _status(sys.argv[1:]); "
            "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, file=sys.stderr); sys.exit(status)"
        )
        begin = time.perf_counter()
        done = subprocess.run(
            [sys.executable, "-c", code, *stage, "--run", str(run), "--json"],
            capture_output=True,
            text=True,
            check=False,
        )
        seconds = time.perf_counter() - begin
        total += seconds
        if done.returncode:
            sys.exit(done.stderr)
        memory = int(done.stderr.splitlines()[-1]) / 2**20
        print(f"  {stage[0]:10s} {seconds:7.1f} s  {memory:5.2f} GiB")
    print(f"  {'an hour':10s} {total:7.1f} s (target 90 s, 2 GiB)")


def line(what: str, ours: float, peer: float, name: str) -> None:
    """Seconds a frame, ours and the peer's, as frames per second and their ratio."""
    print(f"{what:12s} {1 / ours:9,.0f} frames/s  {peer / ours:6.1f} x {name} ({1 / peer:,.0f} frames/s)")


def main() -> None:
    if os.environ.get("OMP_NUM_THREADS") != "1":
        # Read when numpy is loaded, which has happened: once more, on one core.
        os.execve(sys.executable, [sys.executable, *sys.argv], {**os.environ, "OMP_NUM_THREADS": "1"})
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        capture = record_virtual(folder).skl
        clip, one = long_pass(read(capture), FRAMES)
        ours = best(lambda: fit_noncyclic(clip, one)) / FRAMES
        peer = best(lambda: by_rotation_calls(clip.positions[:PEER_FRAMES])) / PEER_FRAMES
        print(
            f"closed form  {1 / ours:9,.0f} frames/s  {peer / ours:6.1f} x Rotation calls ({1 / peer:,.0f}/s)"
        )
        motion = fit_noncyclic(clip, one).motion
        motion = replace(motion, contacts=np.ones_like(motion.contacts))
        ours = best(lambda: refine(motion)) / len(motion.root)
        peer = best(lambda: by_least_squares(motion, PEER_FRAMES), 1) / PEER_FRAMES
        print(
            f"refinement   {1 / ours:9,.0f} frames/s  {peer / ours:6.1f} x least_squares ({1 / peer:,.0f}/s)"
        )
        if "--no-hour" not in sys.argv:
            end_to_end(hour(capture, folder), folder)


if __name__ == "__main__":
    main()
