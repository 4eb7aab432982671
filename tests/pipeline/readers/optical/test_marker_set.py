"""Marker sets of one's own, the regressions of the hips' centres, and the labels of the Rizzoli institute."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest
from samples import trc as sample
from samples.motion import in_sight, walk

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.optical.joint_centres import hip_centre, pelvis
from kinemimic.pipeline.readers.optical.marker_names import landmarks

FRAMES = 20
SHOWN = in_sight(walk(FRAMES, sample.RATE))
PLACES = sample.markers(SHOWN)
# The walk's markers under labels that nobody knows.
LABELS = {label: f"New {number:04}" for number, label in enumerate(PLACES)}
SET = {
    "sacrum": "V.Sacral",
    **{
        f"{landmark}_{side}": f"{side[0].upper()}.{label}"
        for side in ("left", "right")
        for landmark, label in (
            ("asis", "ASIS"), ("knee_lateral", "Knee.Lat"), ("knee_medial", "Knee.Med"),
            ("ankle_lateral", "Ankle.Lat"), ("ankle_medial", "Ankle.Med"), ("toes", "Toe.Tip"),
            ("acromion", "Acromium"), ("elbow", "Elbow"),
        )
    },
}  # fmt: skip


def put(folder: Path, head: str = "", markers: dict[str, object] | None = None) -> Path:
    """The capture with unknown labels, and a marker set beside it."""
    points = 1000.0 * np.stack(list(PLACES.values()), axis=1)[..., [0, 2, 1]] * [1.0, 1.0, -1.0]
    path = folder / "walk.trc"
    path.write_text(sample.text(list(LABELS.values()), SHOWN.times, points))
    named = {landmark: LABELS[label] for landmark, label in SET.items()} if markers is None else markers
    lines = [f"{landmark} = {label!r}" for landmark, label in named.items()]
    (folder / "walk.markers.toml").write_text("\n".join([head, "[markers]", *lines]) + "\n")
    return path


def test_unknown_labels_are_refused_with_the_way_out(tmp_path: Path) -> None:
    path = put(tmp_path)
    (tmp_path / "walk.markers.toml").unlink()
    with pytest.raises(
        CaptureError, match=r"none for left ASIS.*say which marker is where in NAME\.markers\.toml"
    ):
        recognise.read(path)


def test_named_markers_give_the_walk(tmp_path: Path) -> None:
    clip = recognise.read(put(tmp_path))
    assert list(clip.provenance["sidecar_files"]) == ["walk.markers.toml"]
    for node in ("hip_left", "knee_right", "ankle_left", "shoulder_right"):
        off = clip.positions[:, clip.skeleton.index(node)] - SHOWN.joints[:, NODE_INDEX[node]]
        assert np.abs(off).max() < 1e-5
    (tmp_path / "walk.markers.toml").rename(tmp_path / "markers.toml")
    assert np.array_equal(recognise.read(tmp_path / "walk.trc").positions, clip.positions)


def test_nodes_may_be_named(tmp_path: Path) -> None:
    joints = {
        f"{joint}_{side}": LABELS[f"{side[0].upper()}.{label}"]
        for side in ("left", "right")
        for joint, label in (
            ("hip", "ASIS"),
            ("knee", "Knee.Lat"),
            ("ankle", "Ankle.Lat"),
            ("shoulder", "Acromium"),
        )
    }
    clip = recognise.read(put(tmp_path, markers=joints))
    assert set(clip.skeleton.names) == joints.keys()
    knee = clip.positions[:, clip.skeleton.index("knee_left")]
    assert np.abs(knee - PLACES["L.Knee.Lat"]).max() < 1e-5


def test_the_subjects_widths_count(tmp_path: Path) -> None:
    """Without medial markers, half the knee's width and the marker's lie between marker and centre."""
    markers = {name: LABELS[label] for name, label in SET.items() if "medial" not in name}
    for width in (0.09, 0.12):
        clip = recognise.read(put(tmp_path, f"knee_width = {width}\nmarker_diameter = 0.01", dict(markers)))
        inward = clip.positions[:, clip.skeleton.index("knee_left")] - PLACES["L.Knee.Lat"]
        assert np.abs(np.linalg.norm(inward, axis=-1) - (0.5 * width + 0.005)).max() < 1e-6


def test_regressions_of_the_hips_by_hand() -> None:
    """A pelvis 24 cm wide and 16 cm deep, X forward, Y left, Z up; legs of 90 cm, markers of 14 mm."""
    left, right = np.array([[0.0, 0.12, 0.0]]), np.array([[0.0, -0.12, 0.0]])
    body = pelvis(left, right, np.array([[-0.16, 0.0, 0.0]]), np.array([[0.0, 0.0, -0.5]]))
    by_hand = {
        "bell": (-0.0456, 0.0864, -0.0720),
        "harrington": (-0.0483, 0.0865, -0.0829),
        "davis": (-0.0468, 0.0777, -0.0966),
    }
    for regression, place in by_hand.items():
        for side, sign in (("left", 1.0), ("right", -1.0)):
            found = hip_centre(body, side, regression, leg=0.9, marker=0.007)[0]
            assert found == pytest.approx(np.array(place) * [1.0, sign, 1.0], abs=1e-4)


def test_the_regression_is_said(tmp_path: Path) -> None:
    for name, author in (("davis", "Davis et al. 1991"), ("harrington", "Harrington et al. 2007")):
        clip = recognise.read(put(tmp_path, f'hips = "{name}"'))
        assert author in " ".join(clip.provenance["reading"]["notes"])


def test_davis_regression_needs_the_length_of_the_leg(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The markers of knee and ankle are never seen together.
    for label, odd in (("L.Knee.Lat", 0), ("L.Ankle.Lat", 1)):
        hidden = PLACES[label].copy()
        hidden[odd::2] = np.nan
        monkeypatch.setitem(PLACES, label, hidden)
    with pytest.raises(CaptureError, match=r"expected leg_length in the marker set, or .*, found neither"):
        recognise.read(put(tmp_path, 'hips = "davis"'))
    recognise.read(put(tmp_path, 'hips = "davis"\nleg_length = 0.9'))
    recognise.read(put(tmp_path, 'hips = "bell"'))


def test_labels_of_the_rizzoli_institute() -> None:
    labels = [f"{s}{label}" for s in "LR" for label in ("ASIS", "PSIS", "LE", "ME", "LM", "MM", "FM", "VM")]
    found = landmarks(labels)
    for landmark in ("asis", "psis", "knee_lateral", "knee_medial", "ankle_lateral", "ankle_medial", "toes"):
        assert {f"{landmark}_left", f"{landmark}_right"} <= found.keys()
    assert labels[found["knee_lateral_left"][0]] == "LLE"
    assert labels[found["ankle_medial_right"][0]] == "RMM"


@pytest.mark.parametrize(
    ("head", "markers", "says"),
    [
        ('hips = "guess"', None, r"walk\.markers\.toml, key hips: expected"),
        ("knee_width = 2.0", None, "key knee_width: expected"),
        ("colour = 1", None, "colour"),
        ("", {"tail": "New 0001"}, "key markers.tail: expected a landmark .* found another word"),
        ("", {"thigh_left": ["New 0001", "New 0002"]}, "found 2 markers for it"),
        (
            "",
            {"asis_left": "New 0001", "asis_right": "New 0001"},
            "expected a marker other than that of asis_left",
        ),
        ("", {"asis_left": "New 9999"}, "walk.trc: expected the marker 'New 9999' of asis_left"),
    ],
)
def test_mistakes_are_named(head: str, markers: dict[str, object] | None, says: str, tmp_path: Path) -> None:
    with pytest.raises(CaptureError, match=says):
        recognise.read(put(tmp_path, head, markers))


@pytest.mark.parametrize("name", ["walk", "walk.trc.gz"])
def test_of_a_capture_without_an_ending_and_of_a_packed_one(tmp_path: Path, name: str) -> None:
    content = put(tmp_path).read_bytes()
    (tmp_path / name).write_bytes(gzip.compress(content) if name.endswith(".gz") else content)
    clip = recognise.read(tmp_path / name)
    assert list(clip.provenance["sidecar_files"]) == ["walk.markers.toml"]
