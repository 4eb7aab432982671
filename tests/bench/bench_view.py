"""Writing view.rrd: 10,000 frames with all that a playback holds, against the same rows logged one by one.

Ours is `write_recording`: kinematics, both scenes, curves, to the closed file. The peer is what rerun's
examples do, a `set_time` and a `log` for every row: both skeletons of both scenes, all bodies and all curves,
their kinematics computed before the clock starts. It writes a share of the frames, and its time is scaled.
Both by turns in one process, the best of three; the target is a second.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import rerun as rr

from kinemimic.evaluate.film.figures import NAMES, REFERENCE, Humanoid, humanoids
from kinemimic.evaluate.view.command import write_recording
from kinemimic.evaluate.view.scene import SCENES, frame_times
from kinemimic.pipeline.kinematics.rotations import IDENTITY, from_axis_angle
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES
from kinemimic.retarget.humanoid.body import BODIES, BODY_INDEX, BODY_NODES, node_offsets
from kinemimic.retarget.humanoid.motion import joint_angles
from kinemimic.train.rollout.trajectory import Trajectory

FRAMES, PEER_FRAMES = 10_000, 200
REPEATS = 3
TARGET = 1.0  # s


def made_up(frames: int) -> Trajectory:
    """Someone whose legs swing, with a foot on the ground all the time."""
    phase = frame_times(frames) / 1.2
    rotations = np.tile(IDENTITY, (1, frames, len(NODES), 1))
    forces = np.zeros((1, frames, len(BODIES), 3))
    for side, shift in (("left", 0.0), ("right", 0.5)):
        swing = np.sin(2 * np.pi * (phase + shift))
        rotations[0, :, NODE_INDEX[f"hip_{side}"]] = from_axis_angle("Y", -0.1 - 0.35 * swing)
        rotations[0, :, NODE_INDEX[f"knee_{side}"]] = from_axis_angle("Y", 0.5 + 0.4 * swing)
        forces[0, swing > 0, BODY_INDEX[f"foot_{side}"], 2] = 480.0
    root = np.stack([1.3 * phase, np.zeros(frames), np.full(frames, 0.9)], axis=-1)[None]
    random = np.random.default_rng(0)
    return Trajectory(
        start_phases=np.zeros(1),
        phases=phase[None],
        root=root,
        rotations=rotations,
        reference_root=root,
        reference_rotations=rotations,
        rewards=random.random((1, frames, 5)),
        reward_names=np.array(["pose", "velocity", "ends", "root", "height"]),
        fallen_at=np.array([frames]),
        torques=200.0 * random.random((1, frames, len(BODIES) - 1)),
        contacts=np.ones((1, frames, 2), dtype=bool),
        contact_forces=forces,
    )


def row_by_row(path: Path, trajectory: Trajectory, pair: tuple[Humanoid, Humanoid], frames: int) -> None:
    """The first frames as one writes them without thinking of columns."""
    stream = rr.RecordingStream("peer", recording_id="peer")
    stream.save(path)
    curves = {
        **{
            f"angles/{name}": np.degrees(values)
            for name, values in joint_angles(trajectory.rotations[0]).items()
        },
        **{f"reward/{k}": trajectory.rewards[0, :, k] for k in range(trajectory.rewards.shape[-1])},
        **{f"torque/{k}": trajectory.torques[0, :, k] for k in range(trajectory.torques.shape[-1])},
    }
    for frame, seconds in enumerate(frame_times(frames)):
        stream.set_time("time", duration=seconds)
        stream.set_time("frame", sequence=frame)
        for scene in SCENES:
            for humanoid in pair:
                place = f"{scene}/{NAMES[humanoid.kind]}"
                stream.log(f"{place}/skeleton", rr.Points3D(humanoid.positions[frame]))
                if scene == "overlaid" and humanoid.kind == REFERENCE:
                    continue
                for body, node in zip(BODIES, BODY_NODES, strict=True):
                    pose = rr.Transform3D(
                        translation=humanoid.positions[frame, node],
                        quaternion=rr.Quaternion(xyzw=humanoid.rotations[frame, node]),
                    )
                    stream.log(f"{place}/bodies/{body.name}", pose)
        for name, values in curves.items():
            stream.log(name, rr.Scalars(values[frame]))
    stream.disconnect()


def seconds_of(call: Callable[[], object]) -> float:
    begin = time.perf_counter()
    call()
    return time.perf_counter() - begin


def main() -> None:
    """Print seconds of both and their ratio."""
    trajectory, offsets = made_up(FRAMES), node_offsets()
    pair = humanoids(trajectory, 0, offsets)
    ours, peer = [], []
    with tempfile.TemporaryDirectory() as folder:
        written, other = Path(folder) / "view.rrd", Path(folder) / "peer.rrd"

        def write() -> None:
            write_recording(written, trajectory, humanoids(trajectory, 0, offsets), "made up")

        for _ in range(REPEATS):
            ours.append(seconds_of(write))
            peer.append(seconds_of(lambda: row_by_row(other, trajectory, pair, PEER_FRAMES)))
        megabytes = written.stat().st_size / 2**20
    scaled = min(peer) * FRAMES / PEER_FRAMES
    print(
        f"{FRAMES:,} frames, ours          {min(ours):6.2f} s   {megabytes:.1f} MB   (target {TARGET:.0f} s)"
    )
    print(f"{FRAMES:,} frames, row by row    {scaled:6.2f} s   (from {PEER_FRAMES} of them)")
    print(f"ours is {scaled / min(ours):.0f} times as fast")


if __name__ == "__main__":
    main()
