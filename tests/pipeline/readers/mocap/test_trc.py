"""OpenSim's marker files: joints from markers, mistakes in the header, and OpenSim's own angles."""

from __future__ import annotations

import re
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
from kinemimic.pipeline.quality.check import check_capture
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.optical.marker_names import landmarks

TEXT = files(30)["walk.trc"].decode()
LONGER = files(90)["walk.trc"].decode()


def read(content: str) -> Clip:
    return recognise.read_source(source_of(content, Path("walk.trc")))


def notes(clip: Clip) -> str:
    return " / ".join(clip.provenance["reading"]["notes"])


def test_the_known_walk_comes_back() -> None:
    clip = read(TEXT)
    shown = in_sight(walk(30, RATE))
    assert clip.provenance["format"] == "TRC"
    assert np.allclose(clip.times, shown.times, atol=1e-12)
    positions, _ = to_nodes(clip)
    for node in ("hip", "knee", "ankle", "foot", "shoulder", "elbow", "wrist"):
        for side in ("left", "right"):
            index = NODE_INDEX[f"{node}_{side}"]
            assert np.abs(positions[:, index] - shown.joints[:, index]).max() < 1e-7, node
    assert np.abs(positions[:, NODE_INDEX["head"]] - shown.joints[:, NODE_INDEX["head"]]).max() < 1e-7
    assert derived_nodes(clip) == ("shoulder_center", "hand_left", "hand_right")
    # The spine node is where it gives the pelvis' own frame.
    for name, curve in leg_angles(positions).items():
        assert np.abs(curve - shown.angles[name]).max() < 1e-6, name
    assert "Bell et al. 1990" in notes(clip)
    assert "knee centres: midway between the medial and the lateral marker" in notes(clip)


def lines(change: dict[int, str]) -> str:
    return "\n".join(change.get(k, line) for k, line in enumerate(TEXT.split("\n")))


def test_without_the_blank_line_with_crlf_and_closing_tabs() -> None:
    clip = read(TEXT)
    parts = TEXT.split("\n")
    assert np.array_equal(read("\n".join(parts[:5] + parts[6:])).positions, clip.positions)
    assert np.array_equal(read(TEXT.replace("\n", "\r\n")).positions, clip.positions)
    closed = "\n".join([*parts[:6], *(f"{line}\t" for line in parts[6:-1]), ""])
    assert np.array_equal(read(closed).positions, clip.positions)


def test_units_of_the_header() -> None:
    metres = TEXT.split("\n")
    metres[2] = metres[2].replace("mm", "m")
    for k in range(6, len(metres) - 1):
        fields = metres[k].split("\t")
        metres[k] = "\t".join([*fields[:2], *(f"{float(x) / 1000:.9f}" for x in fields[2:])])
    clip = read("\n".join(metres))
    assert np.allclose(clip.positions, read(TEXT).positions, atol=2e-9)
    assert clip.provenance["reading"]["units"] == "m"
    with pytest.raises(
        CaptureError, match="expected Units of mm, cm, m, dm, inch, ft in the header, found 'furlong'"
    ):
        read(TEXT.replace("\tmm\t", "\tfurlong\t"))


def in_metres(word: str) -> str:
    """The file in metres, which its header calls by this word."""
    return in_unit(1.0).replace("\tmm\t", f"\t{word}\t")


@pytest.mark.parametrize("word", ["m", "M", "meters", "Metre", "METERS"])
def test_units_by_their_words(word: str) -> None:
    clip = read(in_metres(word))
    assert clip.provenance["reading"]["units"] == "m"
    assert clip.provenance["reading"]["defects"] == []
    assert np.allclose(clip.positions, read(LONGER).positions, atol=1e-8)
    assert read(LONGER.replace("\tmm\t", "\tMillimeters\t")).provenance["reading"]["units"] == "mm"


def test_spaces_may_separate_the_columns(tmp_path: Path) -> None:
    true = read(TEXT)
    for gap in (" ", "   "):
        clip = read(re.sub("\t", gap, TEXT))
        assert np.array_equal(clip.positions, true.positions)
        assert clip.provenance["reading"]["units"] == "mm"
        assert notes(clip) == notes(true)
    with pytest.raises(CaptureError, match="line 9: expected 68 numbers, found 67"):
        read(lines({8: TEXT.split("\n")[8].rsplit("\t", 1)[0]}).replace("\t", " "))
    # The marker set beside such a file is still recorded.
    (tmp_path / "walk.trc").write_text(TEXT.replace("\t", " "))
    (tmp_path / "walk.markers.toml").write_text('hips = "harrington"\n')
    assert list(recognise.read(tmp_path / "walk.trc").provenance["sidecar_files"]) == ["walk.markers.toml"]


def test_values_and_names_may_be_set_apart_by_any_number_of_tabs() -> None:
    """OpenSim's exampleMocoTrack doubles the TABs between the values: the fifth field is not the unit."""
    parts = TEXT.split("\n")
    doubled = parts.copy()
    doubled[2] = "  " + parts[2].replace("\t", "\t\t ")
    clip = read("\n".join(doubled))
    assert np.array_equal(clip.positions, read(TEXT).positions)
    assert notes(clip) == notes(read(TEXT))
    doubled[1] = parts[1].replace("\t", "\t\t")
    assert np.array_equal(read("\n".join(doubled)).positions, clip.positions)
    single = parts.copy()
    single[3] = re.sub("\t+", "\t", parts[3])
    assert np.array_equal(read("\n".join(single)).positions, clip.positions)
    # A value that is missing is still none.
    missing = parts.copy()
    missing[2] = parts[2].replace("\tmm\t", "\t\t")
    with pytest.raises(
        CaptureError, match="expected Units of mm, cm, m, dm, inch, ft in the header, found none"
    ):
        read("\n".join(missing))


def in_unit(metres: float) -> str:
    """The file, whose header says mm, with its numbers in another unit."""
    rows = LONGER.split("\n")
    for k in range(6, len(rows) - 1):
        fields = rows[k].split("\t")
        rows[k] = "\t".join([*fields[:2], *(f"{float(x) * 0.001 / metres:.9f}" for x in fields[2:])])
    return "\n".join(rows)


@pytest.mark.parametrize(
    ("content", "name"),
    [
        (in_unit(1.0), "metres read as millimetres"),
        (in_unit(0.01), "centimetres read as millimetres"),
        (LONGER.replace("\tmm\t", "\tm\t"), "millimetres"),
    ],
)
def test_a_header_with_another_unit_is_repaired(content: str, name: str) -> None:
    clip = read(content)
    assert np.allclose(clip.positions, read(LONGER).positions, atol=1e-8)
    # There are no other defects: joint centres computed before the repair would look mirrored, too.
    (found,) = check_capture(clip).defects
    assert (found.rule, found.action) == ("wrong_units", "repaired")
    assert f"lengths are {name}; " in found.text


@pytest.mark.parametrize("capture", ["Gait2354_Simbody__subject01_walk1", "Hamner__subject02_running"])
def test_clusters_in_another_unit_are_repaired(captures: Path, tmp_path: Path, capture: str) -> None:
    path = captures / "lab_opensim_gait" / f"{capture}.trc"
    liar = tmp_path / "liar.trc"
    liar.write_bytes(path.read_bytes().replace(b"\tmm\t", b"\tm\t"))
    clip, true = recognise.read(liar), recognise.read(path)
    assert np.allclose(clip.positions, true.positions, atol=1e-9, equal_nan=True)
    assert [defect["rule"] for defect in clip.provenance["reading"]["defects"]] == ["wrong_units"]


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


def test_a_missing_marker_leaves_a_gap_in_the_nodes_computed_from_it() -> None:
    shown = in_sight(walk(30, RATE))
    places = markers(shown)
    points = 1000.0 * np.stack(list(places.values()), axis=1)[..., [0, 2, 1]] * [1.0, 1.0, -1.0]
    labels = list(places)
    points[4, labels.index("L.Knee.Med")] = np.nan
    points[5, labels.index("Top.Head")] = np.nan  # the last cells of its line
    points[6, labels.index("R.Toe.Tip")] = 0.0
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


def test_the_time_column_wins_over_the_header() -> None:
    clip = read(TEXT.replace("100.00", "250.00"))
    assert clip.rate == pytest.approx(100.0)
    assert "the header states 250 Hz" in notes(clip)
    # Three digits of 1/60: frames over the declared rate are the better times.
    shown = walk(30, 60.0)
    places = markers(shown)
    points = 1000.0 * np.stack(list(places.values()), axis=1)[..., [0, 2, 1]] * [1.0, 1.0, -1.0]
    assert np.allclose(np.diff(read(text(list(places), shown.times, points, rate=60.0)).times), 1 / 60)
    wrong = read(text(list(places), shown.times, points, rate=60.0, declared=600))
    (lost,) = wrong.provenance["reading"]["defects"]
    assert (lost["rule"], lost["count"], lost["action"]) == ("dropped_frames", 570, "flagged")
    assert "the header states no rate" in notes(
        read(TEXT.replace("DataRate", "Data").replace("\t0.01", "\t0.02"))
    )


def test_the_first_frame_is_not_mistaken_for_the_line_of_axes() -> None:
    parts = TEXT.split("\n")
    (axes,) = [k for k, line in enumerate(parts) if line.split()[:1] == ["X1"]]
    clip = read("\n".join(parts[:axes] + parts[axes + 1 :]))
    assert np.array_equal(clip.positions, read(TEXT).positions, equal_nan=True)


def test_repeated_times_are_dropped_and_counted() -> None:
    parts = TEXT.split("\n")
    clip = read("\n".join([*parts[:10], parts[9], *parts[10:]]))
    assert len(clip.times) == 30
    assert [(d["rule"], d["count"]) for d in clip.provenance["reading"]["defects"]] == [
        ("duplicate_frames", 1)
    ]


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


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (TEXT.replace("Frame#", "Image"), "expected a line that begins with Frame# and Time, found none"),
        (lines({8: "3\tsoon" + TEXT.split("\n")[8][7:]}), "line 9: expected a number, found 'soon"),
        (lines({8: TEXT.split("\n")[8].rsplit("\t", 5)[0]}), "line 9: expected 68 numbers, found 63"),
        (
            lines({7: TEXT.split("\n")[7].replace("0.010", "nan", 1)}),
            "line 8: expected a time in s, found none",
        ),
        ("\n".join(TEXT.split("\n")[:5]), "expected lines of numbers, found none"),
    ],
)
def test_damage_is_named(content: str, message: str) -> None:
    with pytest.raises(CaptureError, match=message):
        read(content)


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
