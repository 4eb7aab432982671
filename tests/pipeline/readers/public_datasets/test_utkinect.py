"""UTKinect lines: frame numbers as clock, repeated numbers, two people, and action labels."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples import source_of
from samples.motion import in_range, walk
from samples.utkinect import FIRST, files, numbers

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip, Label
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers.public_datasets import utkinect
from kinemimic.pipeline.readers.recognise import read, read_source

PATH = Path("walk.txt")


def sample(frames: int = 48) -> str:
    return files(frames)["joints_s02_e01.txt"].decode()


def clip_of(text: str) -> Clip:
    return read_source(source_of(text, PATH))


def defects(clip: Clip) -> dict[str, int]:
    return {defect["rule"]: defect["count"] for defect in clip.provenance["reading"]["defects"]}


def test_the_written_walk_is_read_once_per_number(tmp_path: Path) -> None:
    for name, content in files(48).items():
        (tmp_path / name).write_bytes(content)
    clip = read(tmp_path / "joints_s02_e01.txt")
    assert clip.provenance["format"] == "UTKinect lines"
    number = np.array(numbers(48))
    # Of two updates within one picture the first is nearer to the frame before: the figure walks on.
    kept = np.flatnonzero(np.diff(number, prepend=0) > 0)
    assert len(kept) == 46
    assert np.abs(clip.positions - in_range(walk(48, rate=15.0))[kept]).max() < 1e-6
    assert clip.times == pytest.approx(number[kept] / 60.0)
    assert clip.times[0] == pytest.approx(FIRST / 60.0)
    assert defects(clip) == {"duplicate_frames": 2}
    assert clip.labels == (Label("walk", 200 / 60, 4.0), Label("sitDown", 250 / 60, 260 / 60))
    assert clip.provenance["reading"]["notes"] == ["actionLabel.txt has no frames for 'carry:  NaN NaN'"]
    assert set(clip.provenance["sidecar_files"]) == {"actionLabel.txt"}


def test_odd_numbers_count_the_camera_s_frames() -> None:
    halved = "\n".join(
        f"{int(number) // 2} {rest}"
        for number, _, rest in (line.partition(" ") for line in sample().split("\n")[:-1])
    )
    assert clip_of(halved + "\n").times == pytest.approx(clip_of(sample()).times)


def test_a_label_that_ends_before_it_starts_is_a_note(tmp_path: Path) -> None:
    for name, content in files(48).items():
        (tmp_path / name).write_bytes(content.replace(b"walk: 200 240", b"walk: 240 200"))
    clip = read(tmp_path / "joints_s02_e01.txt")
    assert [label.name for label in clip.labels] == ["sitDown"]
    assert "actionLabel.txt has no frames for 'walk: 240 200'" in clip.provenance["reading"]["notes"]


def test_the_same_person_is_kept_where_there_are_two() -> None:
    lines = sample().split("\n")[:12]
    fields = lines[6].split()
    other = [fields[0], *(f"{float(x) + (0.9 if k % 3 == 0 else 0.0):.6f}" for k, x in enumerate(fields[1:]))]
    clip = clip_of("\n".join([*lines[:6], " ".join(other), *lines[6:]]) + "\n")
    assert np.array_equal(clip.positions, clip_of("\n".join(lines)).positions)
    assert defects(clip) == {"duplicate_frames": 1, "several_people": 1}


def test_each_is_the_nearest_of_its_number_to_the_one_before() -> None:
    rng = np.random.default_rng(8)
    lines = [line for line in sample(60).split("\n") if line.strip()]
    body = np.array([[float(field) for field in line.split()] for line in lines])
    rows = np.repeat(body, rng.integers(1, 6, size=len(body)), axis=0)
    rows[:, 1:] += rng.normal(scale=0.05, size=(len(rows), 60))
    text = "\n".join(" ".join([f"{row[0]:.0f}", *(f"{x:.17g}" for x in row[1:])]) for row in rows)
    clip = clip_of(text + "\n")
    places = rows[:, 1:].reshape(-1, 20, 3)[..., [2, 0, 1]]
    assert np.array_equal(clip.positions[0], places[0])
    for before, kept, number in zip(
        clip.positions, clip.positions[1:], np.unique(rows[:, 0])[1:], strict=False
    ):
        same = places[rows[:, 0] == number]
        distance = np.linalg.norm(same - before, axis=-1).mean(axis=-1)
        assert np.array_equal(kept, same[np.argmin(distance)])


def test_a_second_recording_after_the_first_is_reported() -> None:
    (told,) = clip_of(sample(90) + sample(90)).provenance["reading"]["defects"]
    assert (told["rule"], told["action"]) == ("duplicate_frames", "flagged")
    assert "two recordings joined in one file" in told["text"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t[:-100], "line 48: expected 61 numbers, found .*; the file is cut off there"),
        (lambda t: t.replace("\n194 ", "\n194.5 "), "line 2: expected a frame number, found 194.5"),
        (
            lambda t: t.replace("\n194   ", "\n194   700"),
            "line 2: expected at most 100 m in X of hip_center",
        ),
        (
            lambda t: t.replace("\n194 ", "\n194 x "),
            "line 2: expected 61 numbers, found 62; mend or delete that line$",
        ),
        (lambda t: t.replace("\n194   ", "\n194   x"), "line 2: expected a number, found 'x"),
    ],
)
def test_damage_names_its_line(change: Callable[[str], str], message: str) -> None:
    text = change(sample())
    with pytest.raises(CaptureError, match=message):
        utkinect.read(source_of(text, PATH))


def test_a_table_of_61_numbers_without_a_body_is_not_claimed() -> None:
    rng = np.random.default_rng(3)
    rows = np.column_stack([np.arange(70), rng.normal(size=(70, 60))])
    text = "\n".join(" ".join(f"{x:.5f}" for x in row) for row in rows)
    assert not utkinect.recognises(source_of(text, PATH))
    with pytest.raises(CaptureError, match="formats of that width: UTKinect lines"):
        clip_of(text)
    # Numbers that fall are no frame numbers.
    assert not utkinect.recognises(source_of("\n".join(reversed(sample().split("\n"))), PATH))


def test_real_recordings(captures: Path) -> None:
    lines = {"s01_e01": 560, "s02_e01": 597, "s02_e02": 756, "s03_e01": 763, "s03_e02": 875, "s04_e01": 544}
    twice = {"s01_e01": 15, "s02_e01": 10, "s02_e02": 23, "s03_e01": 21, "s03_e02": 45, "s04_e01": 9}
    for take, count in lines.items():
        clip = read(captures / "kinect1_utkinect" / f"joints_{take}.txt")
        assert len(clip.times) == count - twice[take]
        # Somebody walks past in one of them.
        assert defects(clip) == {"duplicate_frames": twice[take]} | (
            {"several_people": 4} if take == "s03_e01" else {}
        )
        labels = {label.name: label for label in clip.labels}
        assert len(labels) == 10
        assert next(iter(labels)) == "walk"
        span = (clip.times >= labels["walk"].start) & (clip.times <= labels["walk"].end)
        assert 20 < span.sum() < 65
        hips = clip.positions[span, NODE_INDEX["hip_center"]]
        assert 0.8 < np.linalg.norm(hips[-1] - hips[0]) < 2.5
        # As people walk, and as many frames as the authors state.
        speed = np.linalg.norm(hips[-1] - hips[0]) / np.ptp(clip.times[span])
        assert 0.6 < speed < 1.0
        steps = np.diff(clip.times)
        assert 10.0 < 1.0 / steps[steps < 0.5].mean() < 20.0
        hip, knee, ankle = (clip.positions[:, NODE_INDEX[f"{j}_left"]] for j in ("hip", "knee", "ankle"))
        assert 0.42 < np.median(np.linalg.norm(knee - hip, axis=-1)) < 0.51
        assert 0.34 < np.median(np.linalg.norm(ankle - knee, axis=-1)) < 0.40
    first = read(captures / "kinect1_utkinect" / "joints_s01_e01.txt").labels[0]
    assert first == Label("walk", 252 / 60, 390 / 60)
