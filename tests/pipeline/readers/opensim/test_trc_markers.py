"""OpenSim's marker files: joints from markers of any naming, hidden markers, and OpenSim's own angles."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples import source_of
from samples.motion import in_sight, walk
from samples.trc import RATE, files, markers, text

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import derived_nodes, to_nodes
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.optical.marker_names import landmarks

TEXT = files(30)["walk.trc"].decode()


def read(content: str) -> Clip:
    return recognise.read_source(source_of(content, Path("walk.trc")))


def notes(clip: Clip) -> str:
    return " / ".join(clip.provenance["reading"]["notes"])


@pytest.mark.parametrize(
    ("thigh", "shank"),
    [("TH{}", "TB{}"), (".TH{}", ".SH{}"), ("_thigh{}_study", "_sh{}_study"), ("Thigh{}", "Shank{}")],
)
def test_clusters_by_any_naming_give_the_same_knees(captures: Path, thigh: str, shank: str) -> None:
    path = captures / "lab_opensim_gait" / "Gait2354_Simbody__subject01_walk1.trc"
    content = path.read_text()
    true = read(content)
    for name, cluster in (("Thigh", thigh), ("Shank", shank)):
        for number, where in enumerate(("Upper", "Front", "Rear"), 1):
            for side in "LR":
                content = content.replace(f"{side}.{name}.{where}", side + cluster.format(number))
    assert "Thigh.Upper" not in content
    assert np.array_equal(read(content).positions, true.positions, equal_nan=True)


def test_the_markers_of_opensims_examples_and_of_opencap_are_known() -> None:
    """Labels as in exampleMocoTrack, Rajagopal's walk, a sandbox trial of Moco, and OpenCap."""
    sets = {
        "moco": "R.ASIS L.ASIS R.PSIS L.PSIS R.TH1 R.TH2 R.TH3 R.Knee R.SH1 R.SH2 R.SH3 R.SH4 R.Ankle R.Heel",
        "rajagopal": "RASI LASI RPSI LPSI RTH1 RTH2 RTH3 RLFC RMFC RTB1 RTB2 RTB3 RLMAL RMMAL RCAL RTOE RMT5",
        "sandbox": "RASI LASI SACR RLEPI RMEPI RLMAL RMMAL RHEEL RMFS RMFL RSH RELB RWR",
        "balance": "RASI LASI RPSI LPSI RLKN RMKN RTH1 RTH2 RTH3 RLAK RMAK RSH1 RSH2 RSH3 RSHL RULN RRAD",
        "opencap": "r.ASIS_study L.ASIS_study r.PSIS_study L.PSIS_study r_knee_study r_mknee_study "
        "r_ankle_study r_mankle_study r_thigh1_study r_thigh2_study r_thigh3_study r_sh1_study r_sh2_study "
        "r_sh3_study r_shoulder_study r_lelbow_study r_melbow_study r_lwrist_study r_mwrist_study",
    }
    both = {"asis_right", "asis_left", "knee_lateral_right", "ankle_lateral_right"}
    medial, clusters = {"knee_medial_right", "ankle_medial_right"}, {"thigh_right", "shank_right"}
    arms = {"acromion_right", "wrist_right"}
    expected = {
        "moco": both | clusters,
        "rajagopal": both | medial | clusters,
        "sandbox": both | medial | arms | {"sacrum", "foot_right", "elbow_right"},
        "balance": both | medial | clusters | arms,
        "opencap": both | medial | clusters | arms | {"elbow_right"},
    }
    for name, labels in sets.items():
        assert expected[name] <= landmarks(labels.split()).keys(), name
    words = sets["opencap"].split()
    found = landmarks(words)
    assert [words[k] for k in found["knee_medial_right"]] == ["r_mknee_study"]
    assert [words[k] for k in found["elbow_right"]] == ["r_lelbow_study", "r_melbow_study"]
    assert [words[k] for k in found["shank_right"]] == ["r_sh1_study", "r_sh2_study", "r_sh3_study"]


@pytest.mark.parametrize("nothing", [0.0, 9999.0, -999.0])
def test_a_missing_marker_leaves_a_gap_in_the_nodes_computed_from_it(nothing: float) -> None:
    shown = in_sight(walk(30, RATE))
    places = markers(shown)
    points = 1000.0 * np.stack(list(places.values()), axis=1)[..., [0, 2, 1]] * [1.0, 1.0, -1.0]
    labels = list(places)
    points[4, labels.index("L.Knee.Med")] = np.nan
    points[5, labels.index("Top.Head")] = np.nan  # the last cells of its line
    points[6, labels.index("R.Toe.Tip")] = nothing
    clip = read(text(labels, shown.times, points))
    missing = {
        (int(frame), clip.skeleton.names[joint])
        for frame, joint in zip(*np.nonzero(clip.states == 0), strict=True)
    }
    # Without the knee there is no direction of the shank either, but its ankle has two markers of its own.
    assert missing == {(4, "knee_left"), (5, "head"), (6, "foot_right")}
    assert np.array_equal(np.isnan(clip.positions).any(axis=-1), clip.states == 0)


def hidden(label: str, frames: slice) -> Clip:
    """The walk without medial markers, and without this marker in these frames."""
    shown = in_sight(walk(90, RATE))
    places = {name: at for name, at in markers(shown).items() if "Med" not in name}
    points = 1000.0 * np.stack(list(places.values()), axis=1)[..., [0, 2, 1]] * [1.0, 1.0, -1.0]
    points[frames, list(places).index(label)] = np.nan
    return read(text(list(places), shown.times, points))


def test_an_ankle_is_seen_while_its_knee_is_hidden() -> None:
    clip, whole = (hidden("L.Knee.Lat", frames) for frames in (slice(30, 60), slice(0)))
    missing = {clip.skeleton.names[joint] for joint in np.nonzero(clip.states == 0)[1]}
    assert missing == {"knee_left"}
    ankle = clip.skeleton.index("ankle_left")
    assert np.linalg.norm(clip.positions[:, ankle] - whole.positions[:, ankle], axis=-1).max() < 0.006


def with_hips(outward: float) -> Clip:
    """The walk with markers named like joints, those of the hips this far outside their centres, metres."""
    shown = in_sight(walk(30, RATE))
    places = {label.replace(".Lat", ""): at for label, at in markers(shown).items()}
    left, right = (shown.joints[:, NODE_INDEX[f"hip_{side}"]] for side in ("left", "right"))
    aside = outward * (left - right) / np.linalg.norm(left - right, axis=-1, keepdims=True)
    places |= {"L.Hip": left + aside, "R.Hip": right - aside}
    points = 1000.0 * np.stack(list(places.values()), axis=1)[..., [0, 2, 1]] * [1.0, 1.0, -1.0]
    return read(text(list(places), shown.times, points))


def test_hips_on_the_skin_are_no_joints_beside_the_markers_of_a_pelvis() -> None:
    clip, shown = with_hips(0.08), in_sight(walk(30, RATE))
    for node in ("hip_left", "hip_right", "knee_left", "ankle_right"):
        off = clip.positions[:, clip.skeleton.index(node)] - shown.joints[:, NODE_INDEX[node]]
        assert np.abs(off).max() < 1e-5
    assert "named like joints are markers on the skin: the hips are 0.33 m apart, the ASIS 0.24" in notes(
        clip
    )


def test_hips_within_the_pelvis_are_joints() -> None:
    clip = with_hips(0.01)
    apart = (
        clip.positions[:, clip.skeleton.index("hip_left")]
        - clip.positions[:, clip.skeleton.index("hip_right")]
    )
    shown = in_sight(walk(30, RATE)).joints
    true = np.linalg.norm(shown[:, NODE_INDEX["hip_left"]] - shown[:, NODE_INDEX["hip_right"]], axis=-1)
    assert np.abs(np.linalg.norm(apart, axis=-1) - true - 0.02).max() < 1e-5
    assert "points named like joints are taken as their centres" in notes(clip)


def test_a_hidden_marker_of_the_head_is_filled_and_named() -> None:
    shown = in_sight(walk(90, RATE))
    head = shown.joints[:, NODE_INDEX["head"]]
    corners = {"LFHD": [0.08, 0.06, 0.0], "RFHD": [0.08, -0.06, 0.0], "LBHD": [-0.08, 0.06, 0.02],
               "RBHD": [-0.08, -0.06, 0.02]}  # fmt: skip
    places = {label: at for label, at in markers(shown).items() if label != "Top.Head"}
    places |= {label: head + corner for label, corner in corners.items()}
    points = 1000.0 * np.stack(list(places.values()), axis=1)[..., [0, 2, 1]] * [1.0, 1.0, -1.0]
    whole = read(text(list(places), shown.times, points))
    points[20:70, list(places).index("LBHD")] = np.nan
    clip = read(text(list(places), shown.times, points))
    assert np.abs(clip.positions - whole.positions).max() < 1e-6
    assert "hidden markers filled from others on the same segment: LBHD in 50 frames" in notes(clip)


def test_a_marker_that_was_never_seen_does_not_count() -> None:
    with pytest.raises(
        CaptureError, match=r"found none for left ASIS \(L\.ASIS never seen\) among V\.Sacral"
    ):
        hidden("L.ASIS", slice(None))
    clip = hidden("L.Toe.Tip", slice(None))
    assert "foot_left" in derived_nodes(clip)
    assert "never seen: L.Toe.Tip" in notes(clip)


def test_missing_markers_are_named() -> None:
    with pytest.raises(CaptureError) as error:
        read(TEXT.replace("L.Knee.Lat", "L.Pocket").replace("V.Sacral", "V.Belt"))
    assert str(error.value).startswith(
        "walk.trc: expected markers from which hips, knees and ankles can be computed, found none for "
        "sacrum or both PSIS; left knee (at the joint, or three each on thigh and shank) among V.Belt, "
        "L.ASIS, L.Pocket, "
    )


def test_joints_by_their_own_names_are_taken_as_they_are() -> None:
    shown = in_sight(walk(20, RATE))
    labels = [
        f"{s}{j}" for s in "RL" for j in ("Hip", "Knee", "Ankle", "BigToe", "Shoulder", "Elbow", "Wrist")
    ]
    nodes = [f"{j}_{s}" for s in ("right", "left")
             for j in ("hip", "knee", "ankle", "foot", "shoulder", "elbow", "wrist")]  # fmt: skip
    points = shown.joints[:, [NODE_INDEX[node] for node in nodes]]
    clip = read(text(labels, shown.times, 1000.0 * points[..., [0, 2, 1]] * [1.0, 1.0, -1.0]))
    positions, _ = to_nodes(clip)
    for node in ("hip_left", "knee_right", "ankle_left", "shoulder_right", "wrist_left"):
        assert np.allclose(positions[:, NODE_INDEX[node]], shown.joints[:, NODE_INDEX[node]], atol=1e-8)


def mot(path: Path) -> dict[str, Array]:
    """Columns of an OpenSim motion file by name."""
    rows = path.read_text().splitlines()
    start = next(k for k, row in enumerate(rows) if row.strip() == "endheader") + 1
    values = np.array([[float(x) for x in row.split()] for row in rows[start + 1 :] if row.strip()])
    return dict(zip(rows[start].split(), values.T, strict=True))


@pytest.mark.parametrize(
    ("capture", "solved"),
    [
        ("Gait2354_Simbody__subject01_walk1.trc", "Gait2354_Simbody__subject01_walk1_ik.mot"),
        ("Gait2354_Simbody__subject01_walk1.trc", "Gait10dof18musc__subject01_walk_IK.mot"),
        ("Hamner__subject02_running.trc", "Hamner__subject02_running_ik.mot"),
    ],
)
def test_knee_and_hip_agree_with_inverse_kinematics(captures: Path, capture: str, solved: str) -> None:
    # Their markers are clusters only: knees and ankles are centres of rotation.
    clip = recognise.read(captures / "lab_opensim_gait" / capture)
    curves = leg_angles(to_nodes(clip)[0])
    truth = mot(captures / "lab_opensim_gait" / solved)
    inside = (clip.times >= truth["time"][0] - 1e-6) & (clip.times <= truth["time"][-1] + 1e-6)
    for side in ("left", "right"):
        # These models' knees are negative in flexion.
        for name, column in (
            (f"knee_{side}", f"knee_angle_{side[0]}"),
            (f"hip_{side}", f"hip_flexion_{side[0]}"),
        ):
            sign = -1.0 if name.startswith("knee") else 1.0
            wanted = np.interp(clip.times, truth["time"], sign * truth[column])[inside]
            got = np.degrees(curves[name][inside])
            assert np.corrcoef(got, wanted)[0, 1] >= 0.98, name
            assert abs(float(np.mean(got - wanted))) < 8.0, name


def test_a_lab_walk_without_arms(captures: Path) -> None:
    clip = recognise.read(captures / "lab_angle_curves" / "bmc_walk1.trc")
    assert "elbow_left" in derived_nodes(clip)
    positions, states = to_nodes(clip)
    assert (states > 0).all()
    thigh = np.linalg.norm(
        positions[:, NODE_INDEX["knee_left"]] - positions[:, NODE_INDEX["hip_left"]], axis=-1
    )
    assert 0.35 < np.median(thigh) < 0.55
    # The file is mirrored (its left is on the right): bent the wrong way until the rules repair that.
    knee = np.degrees(leg_angles(positions)["knee_right"])
    assert 45.0 < np.abs(knee).max() < 75.0
