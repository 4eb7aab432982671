"""FreeMoCap, Nuitrack and ZED: written here as documented; no recordings of them are at hand."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples import freemocap, nuitrack_csv, source_of, zed_json
from samples.joint_array import joints, saved
from samples.motion import Walk, in_range, in_sight, walk

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.quality.check import check_capture
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.landmarks.blaze_pose import LANDMARKS
from kinemimic.pipeline.readers.landmarks.joint_sets import SETS

FRAMES = 30


def read(text: str, name: str) -> Clip:
    return recognise.read_source(source_of(text, Path(name)))


def check(clip: Clip, shown: Walk, precision: float, unseen: tuple[int, ...] = ()) -> None:
    """Every joint is where the walk's node is, but for a constant: where the sensor stands."""
    there = np.delete(np.arange(len(shown.times)), unseen)
    assert np.abs(np.diff(clip.times) - np.diff(shown.times)).max() < 1e-6
    truth = np.stack([shown.joints[:, NODE_INDEX[name]] for name in clip.skeleton.names], axis=1)
    off = (clip.positions - truth)[there]
    assert np.abs(off - off[0, 0]).max() < precision


def test_freemocap_as_table_and_as_folder(tmp_path: Path) -> None:
    shown = in_sight(walk(FRAMES))
    clip = read(freemocap.table(shown).decode(), "body_3d_xyz.csv")
    check(clip, shown, 1e-6)
    assert clip.rate == pytest.approx(30.0)
    older = read(freemocap.table(shown, "").decode(), "mediapipe_body_3d_xyz.csv")
    assert np.array_equal(older.positions, clip.positions)
    inner = tmp_path / "recording" / "output_data"
    inner.mkdir(parents=True)
    with pytest.raises(CaptureError, match=r"expected output_data/body_3d_xyz\.csv, the body of a FreeMoCap"):
        recognise.read(tmp_path / "recording")
    (inner / "body_3d_xyz.csv").write_bytes(freemocap.table(shown))
    for path in (tmp_path / "recording", inner):
        assert np.array_equal(recognise.read(path, rate=60.0).positions, clip.positions)


@pytest.mark.parametrize("name", ["mediapipe_body_3d_xyz.npy", "mediaPipeSkel_3d_body_hands_face.npy"])
def test_arrays_of_freemocap(name: str, tmp_path: Path) -> None:
    """Without a table; the body alone, or before hands and face."""
    shown = in_sight(walk(FRAMES))
    points = 1000.0 * joints(shown, SETS[-1])
    inner = tmp_path / "output_data"
    inner.mkdir()
    (inner / name).write_bytes(saved(points if "face" in name else points[:, : len(LANDMARKS)]))
    clip = check_capture(recognise.read(tmp_path)).clip
    heights = shown.joints[:, [NODE_INDEX[node] for node in clip.skeleton.names], 2]
    assert np.ptp(clip.positions[..., 2] - heights) < 1e-6
    truth = leg_angles(shown.joints, times=shown.times)
    for angle, found in leg_angles(to_nodes(clip)[0], times=clip.times).items():
        if angle.startswith("knee"):
            assert found == pytest.approx(truth[angle], abs=1e-3), angle


def test_freemocap_in_which_nobody_is_seen_at_first() -> None:
    """Without its prefix, and in metres it is MediaPipe's: the legs of the first rows that show them tell."""
    shown = in_sight(walk(FRAMES))
    names, *rows = freemocap.table(shown, "").decode().rstrip().split("\n")
    empty = "," * rows[0].count(",")
    clip = read("\n".join([names, *[empty] * 20, *rows, empty]), "body.csv")
    assert clip.provenance["format"] == "FreeMoCap"
    assert len(clip.times) == FRAMES + 20
    whole = read("\n".join([names, *rows]), "body.csv")
    assert np.array_equal(clip.positions[20:], whole.positions)
    metres = [",".join(f"{float(cell) / 1000:.9f}" for cell in row.split(",")) for row in rows]
    found = read("\n".join([names, *[empty] * 20, *metres]), "body.csv")
    assert found.provenance["format"] == "MediaPipe landmarks CSV"
    assert np.isnan(found.positions[:20]).all() and np.isfinite(found.positions[20:]).all()


@pytest.mark.parametrize(("name", "ticks"), [("timestamp", 1.0), ("time_ms", 1000.0)])
def test_freemocap_with_times(name: str, ticks: float) -> None:
    shown = in_sight(walk(FRAMES))
    names, *rows = freemocap.table(shown).decode().rstrip().split("\n")
    timed = [f"{k * ticks / 60:.6f},{row}" for k, row in enumerate(rows)]
    clip = read("\n".join([f"{name},{names}", *timed]), "body.csv")
    assert clip.provenance["format"] == "FreeMoCap"
    assert clip.times == pytest.approx(np.arange(FRAMES) / 60, abs=1e-5)
    assert np.array_equal(clip.positions, read(freemocap.table(shown).decode(), "body.csv").positions)


def test_nuitrack() -> None:
    shown = walk(FRAMES)
    clip = read(nuitrack_csv.files(FRAMES)["skeleton.csv"].decode(), "skeleton.csv")
    check(clip, Walk(shown.times, in_range(shown), {}), 1e-5)
    (defect,) = clip.provenance["reading"]["defects"]
    assert defect["rule"] == "several_people"


@pytest.mark.parametrize("size", [18, 34, 38])
@pytest.mark.parametrize("down", [False, True])
def test_zed(size: int, down: bool) -> None:
    shown = in_sight(walk(FRAMES))
    document = zed_json.document(FRAMES, size, down=down)
    clip = read(json.dumps(document, indent=1), "bodies.json")
    check(clip, shown, 1e-5, (2,))
    assert np.isnan(clip.positions[2]).all()
    assert clip.provenance["reading"]["defects"][0]["rule"] == "several_people"
    # As lists, in a list of frames.
    frames = list(document.values())
    for frame in frames:
        for body in frame["body_list"]:
            body["keypoint"] = [list(point.values()) for point in body["keypoint"]]
        frame["bodies"] = {"body_list": frame.pop("body_list")}
    assert np.array_equal(read(json.dumps(frames), "b.json").positions, clip.positions, equal_nan=True)


def test_millimetres_follow_from_the_leg() -> None:
    (table,) = nuitrack_csv.files(FRAMES).values()
    names, *rows = table.decode().rstrip().split("\n")
    cells = [row.split(",") for row in rows]
    rows = [",".join([*c[:4], *(f"{1000 * float(x):.4f}" for x in c[4:-1]), c[-1]]) for c in cells]
    document = zed_json.document(FRAMES, 34, down=True)
    for frame in document.values():
        for body in frame["body_list"]:
            body["keypoint"] = [{axis: 1000 * x for axis, x in at.items()} for at in body["keypoint"]]
    for clip, expected in (
        (read("\n".join([names, *rows]), "s.csv"), read(table.decode(), "s.csv")),
        (read(json.dumps(document), "b.json"), read(zed_json_down(), "b.json")),
    ):
        checked = check_capture(clip)
        assert "wrong_units" in [defect.rule for defect in checked.defects]
        off = checked.clip.positions - check_capture(expected).clip.positions
        assert np.nanmax(np.abs(off)) < 1e-5


def zed_json_down() -> str:
    return json.dumps(zed_json.document(FRAMES, 34, down=True))


def test_zed_in_which_nobody_is_seen_at_first() -> None:
    frames = list(zed_json.document(FRAMES, 18, down=True).values())
    first, step = frames[0]["timestamp"], frames[1]["timestamp"] - frames[0]["timestamp"]
    empty = [{**frames[0], "body_list": [], "timestamp": first - k * step} for k in range(90, 0, -1)]
    clip = read(json.dumps([*empty, *frames], indent=1), "bodies.json")
    assert np.isnan(clip.positions[:90]).all() and np.isfinite(clip.positions[90:92]).all()


@pytest.mark.parametrize(
    ("sample", "change", "says"),
    [
        (freemocap, lambda text: text.replace("left_knee_x", "other", 1), "no column left_knee_x"),
        (freemocap, lambda text: text[: len(text) - 30], "numbers, found .*cut off"),
        (nuitrack_csv, lambda text: text.replace("JOINT_WAIST.y", "A", 1), r"no column joint_waist\.y"),
        (
            nuitrack_csv,
            lambda text: text.replace("AS3M323001D,1", "AS3M323001D,x", 1),
            "line 2: expected a number",
        ),
        (
            zed_json,
            lambda text: text.replace('"keypoint": [', '"keypoint": [7,', 1),
            "frame 0: expected 18, 34, 38 points",
        ),
        (
            zed_json,
            lambda text: text.replace('"timestamp": 1', '"timestamp": null, "t": 1', 1),
            "expected a time in",
        ),
        (
            zed_json,
            lambda text: re.sub(r'"x": [-\d.]+', '"x": 9e5', text, count=1),
            "frame 0: expected at most 100 m in X of point 0, found 900000",
        ),
    ],
)
def test_damage_is_named(sample: object, change: Callable[[str], str], says: str) -> None:
    ((name, content),) = sample.files(FRAMES).items()  # type: ignore[attr-defined]
    with pytest.raises(CaptureError, match=says):
        read(change(content.decode()), name)
