"""Azure Kinect JSON, written here from a known motion as the SDK's sample writes it."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples import azure_kinect as sample
from samples import source_of
from samples.motion import in_sight, walk

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip, forward_kinematics
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.kinematics.rotations import angle_between, multiply
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.kinect import azure_kinect
from kinemimic.pipeline.readers.kinect.azure_joints import AZURE_JOINTS

Document = dict[str, Any]
FRAMES = 30
LOST = [5, 6, 7]
TAKE = sample.document(FRAMES)


def read(document: object) -> Clip:
    return recognise.read_source(source_of(json.dumps(document), Path("walk.json")))


def test_the_written_walk_comes_back_within_a_tenth_of_a_millimetre() -> None:
    content = sample.files(FRAMES)["walk.json"]
    clip = recognise.read_source(source_of(content.decode(), Path("walk.json")))
    expected = sample.joints(in_sight(walk(FRAMES))) - sample.CAMERA
    seen = np.delete(np.arange(FRAMES), LOST)
    assert clip.provenance["format"] == azure_kinect.FORMAT.name
    assert clip.skeleton.names == AZURE_JOINTS
    assert np.abs(clip.positions[seen] - expected[seen]).max() < 1e-4
    assert np.abs(clip.times - 0.266744 - np.arange(FRAMES) / 30).max() < 1e-6
    assert (clip.states[seen] == 2).all()


def test_frames_without_the_person_are_missing() -> None:
    clip = read(TAKE)
    assert clip.rotations is not None
    assert (clip.states[LOST] == 0).all()
    assert np.isnan(clip.positions[LOST]).all()
    assert np.isnan(clip.rotations[LOST]).all()


def test_orientations_come_back() -> None:
    clip = read(TAKE)
    assert clip.rotations is not None
    seen = np.delete(np.arange(FRAMES), LOST)
    world = forward_kinematics(clip.skeleton, np.zeros_like(clip.positions), clip.rotations)[1]
    places = sample.camera_axes(sample.joints(in_sight(walk(FRAMES))) - sample.CAMERA)
    written = multiply(clip.world_from_file, sample.orientations(places))
    assert angle_between(world[seen], written[seen]).max() < 1e-5


def test_the_20_nodes_are_found() -> None:
    nodes, _ = to_nodes(read(TAKE))
    expected = in_sight(walk(FRAMES)).joints - sample.CAMERA
    for node in ("hip_center", "shoulder_center", "head", "knee_left", "ankle_right", "hand_left"):
        at = NODE_INDEX[node]
        assert np.nanmax(np.abs(nodes[:, at] - expected[:, at])) < 1e-4


def test_the_bystander_is_dropped_and_counted() -> None:
    (defect,) = read(TAKE).provenance["reading"]["defects"]
    assert (defect["rule"], defect["count"], defect["action"]) == ("several_people", 1, "repaired")
    assert "1 more in 10 frames" in defect["text"]


def test_a_person_lost_and_found_elsewhere_under_another_number_is_flagged() -> None:
    document = changed(lambda d: [bodies_of(d, k).pop(0) for k in range(10, 20)])
    for number in range(20, FRAMES):
        (body,) = bodies_of(document, number)
        body["body_id"] = 99
        body["joint_positions"] = np.add(body["joint_positions"], [2500.0, 0.0, 0.0]).tolist()
    for frame in document["frames"]:
        frame["num_bodies"] = len(frame["bodies"])
    clip = read(document)
    (defect,) = clip.provenance["reading"]["defects"]
    assert defect["action"] == "flagged"
    assert "lost and found again" in defect["text"]
    assert (clip.states[20:] == 0).all()


def test_old_spelling_another_sequence_and_confidence() -> None:
    document = copy.deepcopy(TAKE)
    order = np.random.default_rng(1).permutation(len(AZURE_JOINTS))
    document["joint_names"] = [AZURE_JOINTS[j].replace("NAVEL", "NAVAL") for j in order]
    levels = np.arange(len(AZURE_JOINTS)) % 4
    for frame in document["frames"]:
        for body in frame["bodies"]:
            for key in ("joint_positions", "joint_orientations"):
                body[key] = [body[key][j] for j in order]
            body["joint_confidence"] = [[int(levels[j])] for j in order]
    clip, plain = read(document), read(TAKE)
    assert np.array_equal(clip.states[0], np.array([0, 1, 2, 2])[levels])
    known = clip.states[0] > 0
    assert np.array_equal(clip.positions[:, known], plain.positions[:, known], equal_nan=True)
    assert np.isnan(clip.positions[:, ~known]).all()


def test_null_is_how_the_samples_library_writes_nan() -> None:
    document = changed(lambda d: bodies_of(d, 2)[0]["joint_positions"].__setitem__(4, [None, None, None]))
    clip = read(document)
    assert np.flatnonzero(clip.states[2] == 0).tolist() == [4]


def test_a_list_of_frames_and_no_orientations() -> None:
    plain = read(TAKE)
    assert np.array_equal(read(TAKE["frames"]).positions, plain.positions, equal_nan=True)
    without = changed(
        lambda d: [body.pop("joint_orientations") for frame in d["frames"] for body in frame["bodies"]]
    )
    clip = read(without)
    assert np.array_equal(clip.positions, plain.positions, equal_nan=True)
    assert clip.rotations is None
    assert clip.provenance["reading"]["notes"] == ["no orientations: rotations follow from positions"]


def bodies_of(document: Document, frame: int) -> list[Document]:
    bodies: list[Document] = document["frames"][frame]["bodies"]
    return bodies


def changed(change: Callable[[Document], object]) -> Document:
    document = copy.deepcopy(TAKE)
    change(document)
    return document


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda d: d.pop("frames"), 'expected a list "frames"'),
        (lambda d: d.update(frames=[]), 'expected a list "frames"'),
        (lambda d: d["joint_names"].pop(), "32 joint_names of the Azure Kinect, each once, found 31"),
        (lambda d: d["joint_names"].__setitem__(3, "TAIL"), "including 'TAIL'"),
        (lambda d: d["frames"].__setitem__(3, 7), "frame 3: expected a timestamp_usec, found none"),
        (lambda d: d["frames"][3].update(timestamp_usec="1"), "frame 3: .* timestamp_usec, found a str"),
        (lambda d: d["frames"][3].update(timestamp_usec=10**30), "frame 3: expected a timestamp_usec"),
        (lambda d: d["frames"][3].update(bodies=3), 'frame 3: expected a list "bodies" of objects, found 3'),
        (lambda d: d["frames"][3].update(num_bodies=10**9), "frame 3: expected 1000000000 bodies"),
        (lambda d: bodies_of(d, 12)[0].update(body_id=3), "frame 12: .* for each body"),
        (lambda d: bodies_of(d, 3)[0].pop("body_id"), "frame 3: expected a different whole number"),
        (
            lambda d: bodies_of(d, 3)[0].pop("joint_positions"),
            "joint_positions of 32 x 3 numbers, found none",
        ),
        (lambda d: bodies_of(d, 3)[0].pop("joint_orientations"), "frame 3: .* of 32 x 4 numbers, found none"),
        (lambda d: bodies_of(d, 3)[0]["joint_positions"].pop(), "32 x 3 numbers, found 31 x 3"),
        (lambda d: bodies_of(d, 3)[0]["joint_positions"][0].pop(), "frame 3: expected joint_positions"),
        (lambda d: bodies_of(d, 3)[0]["joint_positions"][0].__setitem__(1, 1e9), "frame 3: .* Y of PELVIS"),
        (lambda d: bodies_of(d, 3)[0]["joint_positions"][0].__setitem__(1, "2"), "found a list"),
        (
            lambda d: bodies_of(d, 3)[0]["joint_orientations"][1].__setitem__(0, 9),
            "frame 3: expected a unit quaternion of SPINE_NAVEL",
        ),
        (lambda d: [frame.update(bodies=[], num_bodies=0) for frame in d["frames"]], "expected a person"),
    ],
)
def test_damage(change: Callable[[Document], object], says: str) -> None:
    with pytest.raises(CaptureError, match=says):
        read(changed(change))
