"""MSR-Action3D lines: their own joint order, confidence as state, image coordinates refused."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples import source_of
from samples.motion import in_range, walk
from samples.msr_action3d import UNSEEN, files

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import INFERRED, NODE_INDEX, NODES, TRACKED
from kinemimic.pipeline.readers.public_datasets import msr_action3d
from kinemimic.pipeline.readers.recognise import read, read_source

PATH = Path("walk.txt")


def sample(frames: int = 8) -> str:
    return files(frames)["a16_s01_e01_skeleton3D.txt"].decode()


def clip_of(text: str) -> Clip:
    return read_source(source_of(text, PATH))


def test_the_written_walk_is_read() -> None:
    clip = clip_of(sample())
    assert clip.provenance["format"] == "MSR-Action3D lines"
    assert np.abs(clip.positions - in_range(walk(8, rate=15.0))).max() < 1e-6
    assert clip.times == pytest.approx(np.arange(8) / 15.0)
    for node in NODES:
        assert (clip.states[:, NODE_INDEX[node]] == (INFERRED if node in UNSEEN else TRACKED)).all()


def test_half_confidence_is_the_border_and_zeros_are_missing() -> None:
    lines = sample().split("\n")
    lines[39] = lines[39].replace("1.000000", "0.499")  # the head, last of its frame
    lines[59] = lines[59].replace("1.000000", "0.5")
    lines[60:80] = ["0 0 0 0"] * 20
    clip = clip_of("\n".join(lines))
    assert clip.states[1:4, NODE_INDEX["head"]].tolist() == [1, 2, 0]
    assert [d["frames"] for d in clip.provenance["reading"]["defects"]] == [[[3, 3]]]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda n: n.pop(70),
            "line 159: expected 20 lines per frame, found 19 in the last one; the file is cut",
        ),
        (
            lambda n: n.__setitem__(70, "1 2 3"),
            "line 71: expected 4 numbers, found 3; mend or delete that line$",
        ),
        (lambda n: n.__setitem__(70, "1 2 3 1.5"), "line 71: expected a confidence from 0 to 1, found 1.5"),
        (lambda n: n.__setitem__(70, "1 2 30 1"), "line 71: expected metres, at most 20, in the wrist_right"),
        (lambda n: n.__setitem__(70, "1 2 x 1"), "line 71: expected a number, found 'x'"),
    ],
)
def test_damage_names_its_line(change: Callable[[list[str]], object], message: str) -> None:
    lines = sample().rstrip("\n").split("\n")
    change(lines)
    with pytest.raises(CaptureError, match=message):
        clip_of("\n".join(lines) + "\n")


def pixels(frames: int) -> str:
    """The set's other form: columns and rows of a picture of 320 by 240, depth in mm, rows counted down."""
    table = np.array([[float(x) for x in line.split()] for line in sample(frames).split("\n") if line])
    x, y, z, confidence = table.T
    columns = [160 + 285 * x / z, 120 - 285 * (y - 1) / z, 1000 * z, confidence]
    return "\n".join(" ".join(f"{value:.3f}" for value in row) for row in np.stack(columns, axis=1)) + "\n"


def test_image_coordinates_are_known_and_refused() -> None:
    with pytest.raises(CaptureError, match=r"expected metres, .* these may be image coordinates"):
        clip_of(pixels(4))


def test_four_numbers_without_a_body_are_not_claimed() -> None:
    rng = np.random.default_rng(4)
    text = "\n".join(" ".join(f"{x:.4f}" for x in row) for row in rng.uniform(0, 1, size=(80, 4)))
    assert not msr_action3d.recognises(source_of(text, PATH))
    with pytest.raises(CaptureError, match="formats of that width: MSR-Action3D lines"):
        clip_of(text)


def test_real_recordings(captures: Path) -> None:
    # SOURCE.txt: a fitted model, whose shank never changes; thighs of 0.50 to 0.57 m, some clips below.
    paths = sorted((captures / "kinect1_msraction3d").glob("*_skeleton3D.txt"))
    assert len(paths) == 29
    empty: dict[str, int] = {}
    forward = 0
    for path in paths:
        clip = read(path)
        assert 22 <= len(clip.times) <= 60
        seen = (clip.states > 0).any(axis=1)
        hip, knee, ankle = (
            clip.positions[seen][:, NODE_INDEX[f"{j}_left"]] for j in ("hip", "knee", "ankle")
        )
        assert 0.48 < np.median(np.linalg.norm(knee - hip, axis=-1)) < 0.60
        # Where the tracker lost its model, it fitted another one afterwards.
        models = set(np.round(np.linalg.norm(ankle - knee, axis=-1), 3))
        assert len(models) == 1 if seen.all() else len(models) <= 2
        # Seen from above, the left foot's toes point clockwise of the line from the right hip to the left.
        across = clip.positions[seen, NODE_INDEX["hip_left"]] - clip.positions[seen, NODE_INDEX["hip_right"]]
        toes = clip.positions[seen, NODE_INDEX["foot_left"]] - ankle
        forward += bool(np.median(across[:, 0] * toes[:, 1] - across[:, 1] * toes[:, 0]) < 0)
        if not seen.all():
            empty[path.name[:11]] = int((~seen).sum())
    # All but one, in which the model's feet are turned round after it was lost.
    assert forward == 28
    assert empty == {"a13_s06_e01": 15, "a14_s03_e01": 9}
