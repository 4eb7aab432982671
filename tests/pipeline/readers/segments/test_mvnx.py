"""MVNX, written here from the known walk, and the published file."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples import mvnx as sample
from samples import source_of
from samples.motion import rigid_walk

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.clip import Clip, forward_kinematics
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.kinematics.orientation.rest_pose import node_rotations_of
from kinemimic.pipeline.kinematics.rotations import angle_between, conjugate, rotate
from kinemimic.pipeline.kinematics.skeleton import INFERRED, NODE_INDEX
from kinemimic.pipeline.kinematics.vectors import unit
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.segments.mvnx_text import parse_mvnx

FRAMES = 60
TEXT = "\n".join(sample.document(FRAMES))


def read(text: str) -> Clip:
    return recognise.read_source(source_of(text, Path("walk.mvnx")))


def test_without_orientations_the_positions_are_read() -> None:
    clip = read(re.sub(r"<orientation>.*?</orientation>", "", TEXT, flags=re.DOTALL))
    assert clip.rotations is None
    assert np.array_equal(clip.positions, read(TEXT).positions)


def test_the_walk() -> None:
    clip, shown = read(TEXT), rigid_walk(FRAMES, sample.RATE)
    positions = to_nodes(clip)[0]
    assert np.abs(clip.times - shown.times).max() < 1e-9
    for node in ("hip_left", "knee_right", "ankle_left", "foot_right", "shoulder_left", "wrist_right"):
        assert np.abs(positions[:, NODE_INDEX[node]] - shown.joints[:, NODE_INDEX[node]]).max() < 1e-8
    assert clip.angles is not None
    own = leg_angles(shown.joints)
    for name, curve in clip.angles.items():
        assert np.abs(curve - own[name]).max() < 1e-7
    recorded = node_rotations_of(clip)
    assert {"hip_left", "knee_left", "elbow_right", "hip_center"} <= recorded.sources.keys()
    for node in ("hip_left", "knee_left", "elbow_right"):
        apart = angle_between(recorded.rotations[:, NODE_INDEX[node]], shown.rotations[:, NODE_INDEX[node]])
        assert apart.max() < np.radians(1.0)


def test_the_pelvis_and_the_legs_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    legs = ("Pelvis", "UpperLeg", "LowerLeg", "Foot", "Toe")
    monkeypatch.setattr(sample, "TREE", tuple(row for row in sample.TREE if row[0].endswith(legs)))
    clip, own = read("\n".join(sample.document(FRAMES))), leg_angles(rigid_walk(FRAMES, sample.RATE).joints)
    assert "no segments of the trunk" in clip.provenance["reading"]["notes"][-1]
    points, states = to_nodes(clip)
    assert (states[:, NODE_INDEX["spine"]] == INFERRED).all()
    for name, curve in leg_angles(points).items():
        assert np.degrees(np.abs(curve - own[name])).max() < 0.1, name


def test_fingers_are_left_out_and_a_namespace_is_no_matter() -> None:
    fingers = (
        "</joints><fingerTrackingSegmentsLeft><segment label='LeftCarpus' id='1'><points><point label='j'>"
        "<pos_b>0 0 0</pos_b></point></points></segment></fingerTrackingSegmentsLeft>"
        "<fingerTrackingJointsLeft><joint label='jLeftFirstCMC'><connector1>LeftCarpus/j</connector1>"
        "<connector2>LeftFirstMC/j</connector2></joint></fingerTrackingJointsLeft>"
    )
    clip = read(TEXT.replace("</joints>", fingers))
    assert np.array_equal(clip.positions, read(TEXT).positions)
    spaced = re.sub(r"<(/?)(?=[a-z])", r"<\1x:", TEXT).replace("<x:mvnx", "<x:mvnx xmlns:x='urn:x'")
    assert np.array_equal(read(spaced).positions, clip.positions)


def with_points(text: str, places: dict[str, Array]) -> str:
    """The file without positions, with the places (3,) of the joints on the segments above them."""
    text = re.sub(r"<position>.*?</position>", "", text, flags=re.DOTALL)
    points: dict[str, list[str]] = {name: [] for name, *_ in sample.TREE}
    for name, joint, above, *_ in sample.TREE[1:]:
        for segment, place in ((above, places[name]), (name, np.zeros(3))):
            at = " ".join(f"{x:.6f}" for x in place)
            points[segment].append(f'<point label="{joint}"><pos_b>{at}</pos_b></point>')
    for name, lines in points.items():
        text = re.sub(f'(<segment label="{name}"[^>]*>)', rf"\1<points>{''.join(lines)}</points>", text)
    return text


def test_without_positions_the_segments_hang_together() -> None:
    places = {
        name: np.round(place, 6)
        for name, place in zip(
            (name for name, *_ in sample.TREE), np.random.default_rng(7).normal(0, 0.2, (23, 3)), strict=True
        )
    }
    clip, whole = read(with_points(TEXT, places)), read(TEXT)
    assert clip.rotations is not None and whole.rotations is not None
    assert np.array_equal(clip.rotations, whole.rotations)
    turns = forward_kinematics(clip.skeleton, np.zeros_like(clip.positions), clip.rotations)[1]
    for segment, parent in enumerate(clip.skeleton.parents):
        if parent >= 0:
            apart = clip.positions[:, segment] - clip.positions[:, parent]
            on_segment = rotate(conjugate(turns[:, parent]), apart)
            assert np.abs(on_segment - places[clip.skeleton.names[segment]]).max() < 1e-9
    assert np.ptp(clip.positions[:, 0], axis=0).max() == 0.0
    assert 0.0 < clip.positions[..., 2].min() < 0.05
    assert "the pelvis stays in place" in clip.provenance["reading"]["notes"][0]


def test_without_positions_and_places_of_the_joints_it_is_refused() -> None:
    text = re.sub(r"<position>.*?</position>", "", TEXT, flags=re.DOTALL)
    with pytest.raises(CaptureError, match=r"neither at 'jL5S1'; export the segments' positions from MVN"):
        read(text)
    with pytest.raises(CaptureError, match="expected 69 numbers in <position>, found none"):
        read(re.sub(r"<orientation>.*?</orientation>", "", text, flags=re.DOTALL))


def test_frames_before_the_movement_are_left_out_and_old_versions_have_no_types() -> None:
    assert len(read(TEXT).times) == FRAMES
    head, _, rest = TEXT.partition('<frame time="0" type="tpose">')
    old = head + rest.partition("</frame>\n")[2].replace(' type="normal"', "")
    assert np.array_equal(read(old).positions, read(TEXT).positions)


def test_a_second_subject_is_left_out_and_counted() -> None:
    subject = TEXT[TEXT.index("<subject") : TEXT.index("</mvnx>")]
    clip = read(TEXT.replace("</mvnx>", f"{subject}</mvnx>"))
    assert len(clip.times) == FRAMES
    (defect,) = clip.provenance["reading"]["defects"]
    assert (defect["rule"], defect["count"]) == ("several_people", 1)


def exchanged(old: str, new: str) -> Callable[[str], str]:
    return lambda whole: whole.replace(old, new, 1)


def bomb(text: str) -> str:
    return text.replace("<mvnx", '<!DOCTYPE mvnx [<!ENTITY a "aaaa">]>\n<mvnx', 1)


def cut_number(text: str) -> str:
    at = text.index("<position>", text.index('type="normal"'))
    return text[: at + 10] + text[text.index(" ", at) :]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda text: text[: len(text) // 2], r"line \d+: expected XML, found .*; the file is cut off there"),
        (bomb, "line 2: expected XML without entities, found one"),
        (cut_number, r"line \d+: expected 69 numbers in <position>, found 68"),
        (
            lambda text: " ouch</position>".join(text.rsplit("</position>", 1)),
            "expected numbers in <position>, found something else",
        ),
        (exchanged('label="L5"', 'label="L3"'), "expected segments with labels of their own"),
        (
            exchanged("<connector1>L5/", "<connector1>Tail/"),
            "expected joints between the segments, found one at 'Tail'",
        ),
        (
            lambda text: text.replace('type="normal"', 'type="other"'),
            'expected frames of type "normal", found none',
        ),
        (exchanged('time="17"', 'time="soon"'), "expected a time in ms, found 'soon'"),
    ],
)
def test_damage_is_named(change: Callable[[str], str], says: str) -> None:
    with pytest.raises(CaptureError, match=says):
        read(change(TEXT))


def test_mvn_s_own_positions_follow_from_its_orientations(sensors: Path) -> None:
    path = sensors / "xsens_mvnx" / "test_mocap.mvnx"
    own = recognise.read(path).positions
    text = re.sub(r"<position>.*?</position>", "", path.read_text(), flags=re.DOTALL)
    computed = read(text).positions
    assert np.abs(computed - computed[:, :1] - (own - own[:, :1])).max() < 0.002


def test_published_file(sensors: Path) -> None:
    """An upper body's: MVN keeps the legs straight, and so do we; elbows bend as MVN says."""
    path = sensors / "xsens_mvnx" / "test_mocap.mvnx"
    clip = recognise.read(path)
    assert len(clip.times) == 112
    assert clip.rate == pytest.approx(60.0)
    assert clip.angles is not None
    positions = to_nodes(clip)[0]
    pelvis = forward_kinematics(clip.skeleton, np.zeros((112, 23, 3)), clip.rotations)[1][:, 0]
    ours = leg_angles(positions, pelvis)
    for name, own in clip.angles.items():
        assert np.abs(ours[name] - own).max() < np.radians(0.1)
    # The elbow moves. Abduction and flexion, of a rotation in the order ZXY, bend the forearm by this much.
    content = parse_mvnx(Source.open(path))
    joint = [joint.label for joint in content.joints].index("jRightElbow")
    own = np.radians([frame.values["jointAngle"][3 * joint :][:3] for frame in content.frames])
    upper, lower = (
        unit(positions[:, NODE_INDEX[f"{end}_right"]] - positions[:, NODE_INDEX[f"{start}_right"]])
        for start, end in (("shoulder", "elbow"), ("elbow", "wrist"))
    )
    bend = np.arccos(np.sum(upper * lower, axis=-1))
    assert np.ptp(bend) > np.radians(3.0)
    assert np.abs(bend - np.arccos(np.cos(own[:, 0]) * np.cos(own[:, 2]))).max() < np.radians(0.5)
