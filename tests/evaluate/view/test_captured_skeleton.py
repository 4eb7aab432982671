"""The captured skeleton in a recording: times, positions and missing joints."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import rerun as rr
from rerun.chunk import RrdReader

from kinemimic.evaluate.film.figures import humanoids
from kinemimic.evaluate.view.captured_skeleton import (
    CapturedSkeleton,
    aligned,
    captured_skeleton,
    log_skeleton,
)
from kinemimic.evaluate.view.scene import frame_times
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.files.store import write_clip
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, rotate
from kinemimic.pipeline.kinematics.skeleton import INFERRED, MISSING, NODE_INDEX, TRACKED, node_skeleton
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.trajectory import Trajectory

PERIOD = 1.2  # s, of the made-up walk
HAND = NODE_INDEX["hand_left"]


@pytest.fixture
def played(performance: Callable[..., Trajectory]) -> Trajectory:
    """Twelve seconds: ten cycles."""
    return performance(1, 360)


def write_capture(run: Path, walk: Motion, passes: int, *, begins: float = -0.3, cycles: float = 1.5) -> None:
    """A person half as large again, who walked over the sensor's view on a slant `passes` times, each time
    from the same phase, as `ingest` and `retarget` tell it; one hand is guessed, and lost in the last frame
    of each pass."""
    at = begins + np.arange(round(cycles * PERIOD * 30) + 1) / (30 * PERIOD)
    reference = Reference(walk)
    one, _ = figures_at(reference, walk, at)
    slant = from_axis_angle("Z", np.array(0.7))
    positions = np.concatenate([rotate(slant, 1.5 * one) + np.array([1.0, -2.0, 0.1])] * passes)
    number = np.repeat(np.arange(passes), len(at)).astype(np.int32)
    times = np.concatenate([10.0 * k + PERIOD * (at - at[0]) for k in range(passes)])
    states = np.full(positions.shape[:2], TRACKED, np.uint8)
    states[:, HAND] = INFERRED
    lost = np.flatnonzero(np.append(np.diff(number) != 0, True))
    positions[lost, HAND], states[lost, HAND] = np.nan, MISSING
    write_clip(run / "raw.parquet", Clip(node_skeleton(), times, positions, states, number))
    table = {"time": times, "pass": number, "phase": np.tile(at, passes)}
    pq.write_table(pa.table(table), run / "capture.parquet")


def figures_at(reference: Reference, walk: Motion, phase: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Node positions (N, 20, 3) and world rotations of the reference at phases."""
    return replace(
        walk,
        root=reference.root(phase),
        rotations=reference.nodes(phase),
        contacts=np.zeros((len(phase), 2), dtype=bool),
        cyclic=False,
    ).kinematics()


def shown(run: Path, walk: Motion, played: Trajectory) -> CapturedSkeleton:
    reference, _ = humanoids(played, 0, walk.offsets)
    found = captured_skeleton(run, played.phases[0], frame_times(360), reference, cyclic=walk.cyclic)
    assert found is not None
    return found


def test_a_perfect_capture_coincides_with_its_reference(
    tmp_path: Path, walk: Motion, played: Trajectory
) -> None:
    write_capture(tmp_path, walk, 3)
    found = shown(tmp_path, walk, played)
    # 1.5 cycles from phase 0.7: from 0.7 to 2.2, then from 2.7 to 4.2, from 4.7 to 6.2.
    for k in range(3):
        own = found.times[found.passes == k]
        np.testing.assert_allclose(own[[0, -1]], PERIOD * (np.array([0.7, 2.2]) + 2 * k), atol=1e-9)
    assert found.of == 3 and np.all(np.diff(found.times) > 0)
    expected, _ = figures_at(Reference(walk), walk, found.times / PERIOD)
    seen = found.states != MISSING
    np.testing.assert_allclose(found.positions[seen], expected[seen], atol=2e-3)
    assert np.isnan(found.positions[~seen]).all()
    assert (~seen).sum() == 3 and (found.states[:, HAND] == INFERRED).sum() == len(found.times) - 3


def test_only_passes_that_fit_are_shown_and_counted(tmp_path: Path, walk: Motion, played: Trajectory) -> None:
    write_capture(tmp_path, walk, 8)
    found = shown(tmp_path, walk, played)
    # Ten cycles hold a pass every second one; the fifth, from 8.7, ends with the rollout at 10.
    assert np.unique(found.passes).tolist() == [0, 1, 2, 3, 4]
    assert found.times[-1] <= 12.0
    assert "5 of 8 passes" in found.legend()


def test_a_noncyclic_capture_is_shown_once(tmp_path: Path, walk: Motion, played: Trajectory) -> None:
    write_capture(tmp_path, walk, 1, begins=0.5, cycles=1.0)
    once = replace(walk, cyclic=False)
    found = shown(tmp_path, once, played)
    np.testing.assert_allclose(found.times[[0, -1]], [0.6, 1.8], atol=1e-9)


def test_alignment_removes_rotation_shift_and_speed_and_keeps_jitter() -> None:
    random = np.random.default_rng(0)
    target = random.normal(size=(30, 20, 3))
    seconds = np.arange(30) / 30.0
    moved = rotate(from_axis_angle("Z", np.array(2.5)), target) + np.array([3.0, 1.0, -0.4])
    moved = moved + seconds[:, None, None] * np.array([0.8, -0.3, 0.0])
    trembling = moved.copy()
    trembling[:, HAND] += random.normal(size=(30, 3))
    laid = aligned(target, trembling, seconds)
    legs = [k for k in range(20) if k != HAND]
    np.testing.assert_allclose(laid[:, legs], target[:, legs], atol=1e-9)
    shakes = np.linalg.norm(trembling - moved, axis=-1)
    np.testing.assert_allclose(np.linalg.norm(laid - target, axis=-1), shakes, atol=1e-9)


def test_missing_joints_are_not_drawn_and_passes_end(
    tmp_path: Path, walk: Motion, played: Trajectory
) -> None:
    write_capture(tmp_path, walk, 2)
    found = shown(tmp_path, walk, played)
    stream = rr.RecordingStream("kinemimic", recording_id="captured")
    stream.save(tmp_path / "captured.rrd")
    log_skeleton(stream, found)
    stream.disconnect()
    rows: dict[str, Any] = {}
    for chunk in RrdReader(tmp_path / "captured.rrd").store().stream():
        if str(chunk.entity_path) == "/overlaid/captured/skeleton":
            batch = chunk.to_record_batch()
            rows |= dict(zip(batch.schema.names, batch.columns, strict=True))
    counts = [len(row) for row in rows["Points3D:positions"].to_pylist()]
    frames = len(found.times) // 2
    assert counts == ([20] * frames + [0]) * 2
    radii = rows["Points3D:radii"].to_pylist()
    colors = rows["Points3D:colors"].to_pylist()
    assert colors[0][HAND] != colors[0][0] and len({*colors[0]}) == 2
    assert radii[frames - 1][HAND] == 0.0


def test_a_run_without_its_capture_shows_none(tmp_path: Path, walk: Motion, played: Trajectory) -> None:
    reference, _ = humanoids(played, 0, walk.offsets)
    assert captured_skeleton(tmp_path, played.phases[0], frame_times(360), reference, cyclic=True) is None
    write_capture(tmp_path, walk, 1)
    (tmp_path / "raw.parquet").unlink()
    assert captured_skeleton(tmp_path, played.phases[0], frame_times(360), reference, cyclic=True) is None


def test_frames_of_another_recording_are_refused(tmp_path: Path, walk: Motion, played: Trajectory) -> None:
    other = tmp_path / "other"
    other.mkdir()
    write_capture(tmp_path, walk, 1)
    write_capture(other, walk, 2, begins=-0.31)
    shutil.copy(other / "capture.parquet", tmp_path)
    with pytest.raises(CaptureError, match=r"capture\.parquet.*expected frames of raw\.parquet"):
        shown(tmp_path, walk, played)
    (tmp_path / "capture.parquet").write_bytes(b"no table")
    with pytest.raises(CaptureError, match=r"capture\.parquet.*run retarget again"):
        shown(tmp_path, walk, played)
