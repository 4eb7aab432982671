"""The motion library: samples at and between frames, over the ends, and its two files."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.rotations import from_rotvec
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.library import library_file
from kinemimic.retarget.library.library_file import ARRAYS, MANIFEST, read_library, write_library
from kinemimic.retarget.library.motion_library import Entry, MotionLibrary, Split

KNEE = NODE_INDEX["knee_left"]


def _motion(frames: int, rate: float, *, cyclic: bool, bend: float = 0.0) -> Motion:
    """A slide along x by 0.1 m a frame that turns the left knee by 0.1 rad a frame."""
    steps = np.arange(frames)
    rotations = np.zeros((frames, len(NODES), 4))
    rotations[..., 3] = 1.0
    rotations[:, KNEE] = from_rotvec(np.stack([0 * steps, bend + 0.1 * steps, 0 * steps], axis=-1))
    return Motion(
        rate=rate,
        root=np.stack([0.1 * steps, 0 * steps, np.full(frames, 0.9)], axis=-1),
        rotations=rotations,
        contacts=np.zeros((frames, 2), dtype=bool),
        cyclic=cyclic,
        cycle_offset=np.array([0.1 * frames, 0.0, 0.0]) if cyclic else np.zeros(3),
    )


MOTIONS = [
    _motion(5, 10.0, cyclic=True),
    _motion(4, 20.0, cyclic=False, bend=1.0),
    _motion(1, 2.0, cyclic=True),
]


def _entry(motion: Motion, name: str, subject: str, split: Split) -> Entry:
    x, y, z = motion.cycle_offset.tolist()
    return Entry(name, subject, "walk", split, motion.rate, len(motion.root), motion.cyclic, (x, y, z))


@pytest.fixture
def library() -> MotionLibrary:
    rows = (("a", "ann", "train"), ("b", "bob", "test"), ("c", "ann", "train"))
    return MotionLibrary.of(MOTIONS, [_entry(m, *row) for m, row in zip(MOTIONS, rows, strict=True)])


def _knee(rotations: np.ndarray) -> np.ndarray:
    return 2.0 * np.arctan2(rotations[..., KNEE, 1], rotations[..., KNEE, 3])


def test_each_motion_comes_back_as_it_was(library: MotionLibrary) -> None:
    assert [library.motion(k).identity for k in range(len(library))] == [m.identity for m in MOTIONS]
    assert [entry.duration for entry in library.entries] == [m.duration for m in MOTIONS]


@pytest.mark.parametrize("index", range(len(MOTIONS)))
def test_samples_at_the_frames_are_the_frames(library: MotionLibrary, index: int) -> None:
    motion = MOTIONS[index]
    times = np.arange(len(motion.root)) / motion.rate
    root, rotations = library.sample(np.full(len(times), index), times)
    assert np.allclose(root, motion.root, atol=1e-12)
    assert np.allclose(rotations, motion.rotations, atol=1e-12)


def test_a_sample_between_two_frames_is_between_them(library: MotionLibrary) -> None:
    root, rotations = library.sample(np.array([0, 1]), np.array([0.25, 0.025]))
    assert root[:, 0] == pytest.approx([0.25, 0.05])
    assert _knee(rotations) == pytest.approx([0.25, 1.05], abs=1e-6)


def test_a_cycle_goes_on_in_both_directions(library: MotionLibrary) -> None:
    # 1.3 s are two cycles of 0.5 s and 3 frames; -0.2 s is frame 3 of the cycle before.
    root, rotations = library.sample(np.array([0, 0]), np.array([1.3, -0.2]))
    assert root[:, 0] == pytest.approx([1.3, -0.2])
    assert _knee(rotations) == pytest.approx([0.3, 0.3], abs=1e-9)


def test_between_the_last_frame_and_the_first_of_the_next_cycle(library: MotionLibrary) -> None:
    root, rotations = library.sample(np.array([0]), np.array([0.45]))
    assert root[0, 0] == pytest.approx(0.45)
    assert _knee(rotations)[0] == pytest.approx(0.2, abs=1e-4)  # midway from 0.4 rad back to 0


def test_a_closing_cycle_may_change_the_sign_of_a_quaternion() -> None:
    motion = MOTIONS[0]
    rotations = motion.rotations.copy()
    rotations[-1] *= -1.0
    flipped = replace(motion, rotations=rotations)
    entry = _entry(flipped, "a", "ann", "train")
    times = np.linspace(0.0, 0.5, 21)
    found = MotionLibrary.of([flipped], [entry]).sample(np.zeros(21, dtype=np.intp), times)[1]
    wanted = MotionLibrary.of([motion], [entry]).sample(np.zeros(21, dtype=np.intp), times)[1]
    assert np.abs(np.sum(found * wanted, axis=-1)) == pytest.approx(1.0)


def test_any_other_motion_holds_its_ends(library: MotionLibrary) -> None:
    root, rotations = library.sample(np.array([1, 1]), np.array([-5.0, 5.0]))
    assert np.array_equal(root, MOTIONS[1].root[[0, -1]])
    assert np.allclose(rotations, MOTIONS[1].rotations[[0, -1]], atol=1e-12)


def test_a_batch_has_the_shape_of_motions_and_times(library: MotionLibrary) -> None:
    root, rotations = library.sample(np.array([0, 1, 2])[:, None], np.linspace(0.0, 1.0, 7))
    assert root.shape == (3, 7, 3)
    assert rotations.shape == (3, 7, len(NODES), 4)
    assert np.linalg.norm(rotations, axis=-1) == pytest.approx(1.0)


def test_splits_are_by_subject(library: MotionLibrary) -> None:
    assert library.select("train").tolist() == [0, 2]
    assert library.subjects("test") == {"bob"}
    entries = [replace(entry, subject="ann") for entry in library.entries]
    with pytest.raises(ValueError, match="'ann' in both splits"):
        MotionLibrary.of(MOTIONS, entries)


def test_names_are_unique(library: MotionLibrary) -> None:
    with pytest.raises(ValueError, match="unique"):
        MotionLibrary.of(MOTIONS, [replace(entry, name="a") for entry in library.entries])


def test_files_hold_every_number(library: MotionLibrary, tmp_path: Path) -> None:
    write_library(tmp_path, library, {"motions": [{"file": name} for name in "abc"]})
    found = read_library(tmp_path)
    assert found.entries == library.entries
    for name in ("root", "rotations", "contacts"):
        assert np.array_equal(getattr(found, name), getattr(library, name))


def _damage(folder: Path, **keys: object) -> None:
    manifest = json.loads((folder / MANIFEST).read_text())
    (folder / MANIFEST).write_text(json.dumps(manifest | keys))


def _in_first_motion(folder: Path, **keys: object) -> None:
    motions = json.loads((folder / MANIFEST).read_text())["motions"]
    _damage(folder, motions=[motions[0] | keys, *motions[1:]])


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda folder: (folder / MANIFEST).unlink(), "found no file; run `kinemimic library` first"),
        (lambda folder: (folder / MANIFEST).write_text("[]"), "found other JSON"),
        (lambda folder: (folder / ARRAYS).unlink(), "expected the arrays of .*, found no file"),
        (lambda folder: (folder / ARRAYS).write_bytes(b"\0" * 40), "expected the arrays of .*, found others"),
        (lambda folder: _damage(folder, schema=2), "written by a later version"),
        (lambda folder: _damage(folder, motions=[]), "root of shape"),
        (lambda folder: _in_first_motion(folder, frames=-3), "root of shape"),
        (lambda folder: _in_first_motion(folder, rate=0.0), "without frames or rate"),
        (lambda folder: _in_first_motion(folder, rate=1e-9), "fps: expected 1 to 1000"),
        (lambda folder: _in_first_motion(folder, split="both"), "split"),
        (lambda folder: _in_first_motion(folder, split="test"), "'ann' in both splits"),
        (lambda folder: _in_first_motion(folder, cycle_offset=[1e6, 0, 0]), "cycle_offset: expected less"),
    ],
)
def test_damaged_files_are_one_line(library, tmp_path, damage, message) -> None:
    write_library(tmp_path, library, {})
    damage(tmp_path)
    with pytest.raises(KinemimicError, match=message) as caught:
        read_library(tmp_path)
    assert "\n" not in str(caught.value)


def test_a_quaternion_that_is_none(library: MotionLibrary, tmp_path: Path) -> None:
    rotations = library.rotations.copy()
    rotations[3, KNEE] *= 2.0
    write_library(tmp_path, replace(library, rotations=rotations), {})
    with pytest.raises(KinemimicError, match="a: expected unit quaternions, found length 2"):
        read_library(tmp_path)


def test_a_library_too_large_to_be_read_back_is_not_written(
    tmp_path: Path, library: MotionLibrary, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_library(tmp_path, library, {})
    size = (tmp_path / ARRAYS).stat().st_size
    monkeypatch.setattr(library_file, "_LIMIT", size)
    write_library(tmp_path, library, {})
    monkeypatch.setattr(library_file, "_LIMIT", size - 1)
    with pytest.raises(KinemimicError, match="of 3 motions; make several libraries"):
        write_library(tmp_path / "other", library, {})
    assert not (tmp_path / "other").exists()
