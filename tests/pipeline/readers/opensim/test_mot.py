"""OpenSim motions: the file's own curves equal those of the positions; signs and sides; damage."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from samples import source_of
from samples.mot import columns, files, written
from samples.motion import rigid_walk

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.angles import ANGLES, leg_angles
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.readers.recognise import read, read_source

FRAMES = 60
PATH = Path("walk_ik.mot")


def sample() -> str:
    return files(FRAMES)["walk_ik.mot"].decode()


def clip_of(text: str) -> Clip:
    return read_source(source_of(text, PATH))


def curves_agree(clip: Clip, tolerance: float = 1e-9) -> None:
    """Knees and hips from the positions are the file's own (radians)."""
    assert clip.angles is not None and set(clip.angles) == set(ANGLES)
    measured = leg_angles(to_nodes(clip)[0])
    for name, curve in clip.angles.items():
        np.testing.assert_allclose(measured[name], curve, atol=tolerance, err_msg=name)


def test_the_columns_alone_and_as_csv() -> None:
    """The unit of the angles is then told from their size."""
    body = sample().partition("endheader\n")[2]
    rows = [[cell.strip() for cell in line.split("\t")] for line in body.splitlines()]
    csv = "\n".join(",".join(row) for row in rows)
    for text in (body, csv, csv.replace("time", '"time"')):
        np.testing.assert_array_equal(clip_of(text).positions, clip_of(sample()).positions)


def test_the_known_walk_comes_back() -> None:
    clip, walk = clip_of(sample()), rigid_walk(FRAMES, 60.0)
    curves_agree(clip)
    np.testing.assert_allclose(clip.times, walk.times, atol=1e-8)
    # Lengths are a standard adult's; the directions of the bones are the walker's.
    for start, end in (("hip", "knee"), ("knee", "ankle")):
        for side in ("left", "right"):
            ours, theirs = (
                _unit(p[:, names.index(f"{end}_{side}")] - p[:, names.index(f"{start}_{side}")])
                for p, names in (
                    (clip.positions, clip.skeleton.names),
                    (walk.joints, walk.skeleton.names),
                )
            )
            np.testing.assert_allclose(ours, theirs, atol=1e-7, err_msg=f"{end}_{side}")
    hips = clip.positions[:, clip.skeleton.index("hip_center")]
    np.testing.assert_allclose(hips, walk.root, atol=1e-7)


def _unit(v):  # type: ignore[no-untyped-def]
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def posed(rotation: float) -> Clip:
    """A figure with both legs in the same pose, by the file's numbers; the pelvis is level."""
    table = {name: np.zeros(3) for name in columns(3)}
    for s in "rl":
        for name, degrees in {"flexion": 30.0, "adduction": -12.0, "rotation": rotation}.items():
            table[f"hip_{name}_{s}"] = np.full(3, degrees)
        table[f"knee_angle_{s}"] = np.full(3, -50.0)
    return clip_of(written(table).decode())


def test_sides_are_mirror_images() -> None:
    """The same numbers left and right are a figure that is its own mirror image."""

    def place(clip: Clip, joint: str, side: str = "left") -> NDArray[np.float64]:
        return clip.positions[0, clip.skeleton.index(f"{joint}_{side}")]

    clip = posed(20.0)
    for joint in ("hip", "knee", "ankle", "foot"):
        np.testing.assert_allclose(place(clip, joint), place(clip, joint, "right") * [1, -1, 1], atol=1e-12)
    assert place(clip, "knee")[1] > place(clip, "hip")[1] + 0.05, "a negative adduction moves the leg out"
    assert place(clip, "knee")[0] > place(clip, "hip")[0] + 0.1, "the thigh is in front"
    assert place(clip, "ankle")[0] < place(clip, "knee")[0] - 0.1, "the shank is turned back"
    toes = [place(turned, "foot")[1] - place(turned, "ankle")[1] for turned in (posed(0.0), clip)]
    assert toes[1] < toes[0] - 0.01, "a positive rotation turns the toes in"


def test_a_model_whose_knee_is_positive_in_flexion_gives_the_same() -> None:
    table = columns(FRAMES)
    other = {name: -values if name.startswith("knee") else values for name, values in table.items()}
    clip, same = clip_of(written(table).decode()), clip_of(written(other).decode())
    np.testing.assert_allclose(same.positions, clip.positions, atol=1e-9)
    notes = [c.provenance["reading"]["notes"][1] for c in (clip, same)]
    assert "negative in flexion" in notes[0] and "positive in flexion" in notes[1]


def in_radians(table: dict[str, Array]) -> dict[str, Array]:
    return {name: v if "_t" in name and name[-2] == "t" else np.radians(v) for name, v in table.items()}


def test_radians_and_state_paths() -> None:
    table = columns(FRAMES)
    text = written(in_radians(table), degrees=False).decode()
    named = text.replace("\tknee_angle_r\t", "\t/jointset/knee_r/knee_angle_r/value\t")
    for other in (text, named, text.replace("inDegrees=no\n", ""), sample().replace("inDegrees=yes\n", "")):
        np.testing.assert_allclose(clip_of(other).positions, clip_of(sample()).positions, atol=1e-6)


@pytest.mark.parametrize("degrees", [True, False])
def test_angles_in_another_unit_than_the_header_says(degrees: bool) -> None:
    table = columns(FRAMES)
    if degrees:
        table = in_radians(table)
    clip = clip_of(written(table, degrees=degrees).decode())
    np.testing.assert_allclose(clip.positions, clip_of(sample()).positions, atol=1e-6)
    (defect,) = clip.provenance["reading"]["defects"]
    assert (defect["rule"], defect["action"]) == ("wrong_units", "repaired")
    said, read_in = ("degrees", "radians") if degrees else ("radians", "degrees")
    assert f"declared in {said}" in defect["text"] and f"read in {read_in}" in defect["text"]


def test_the_header_is_believed_of_who_stands_still_and_of_one_damaged_number() -> None:
    still = {name: np.full(FRAMES, 0.9 if "ty" in name else 1.5) for name in columns(FRAMES)}
    still["knee_angle_r"] = 1.5 + 0.2 * np.sin(np.arange(FRAMES))
    assert clip_of(written(still).decode()).provenance["reading"]["defects"] == []
    table = in_radians(columns(FRAMES))
    table["knee_angle_r"][7] = -80.0
    assert clip_of(written(table, degrees=False).decode()).provenance["reading"]["defects"] == []


def test_joints_without_coordinates_are_omitted() -> None:
    wanted = ("pelvis_tilt", "hip_flexion_r", "knee_angle_r", "hip_flexion_l", "knee_angle_l")
    clip = clip_of(
        written({name: values for name, values in columns(FRAMES).items() if name in wanted}).decode()
    )
    assert not {"lumbar", "shoulder_left", "elbow_left"} & set(clip.skeleton.names)
    assert "no pelvis_tx, pelvis_ty, pelvis_tz" in clip.provenance["reading"]["notes"][2]
    assert np.ptp(clip.positions[:, 0], axis=0) == pytest.approx([0, 0, 0])
    curves_agree(clip)


@pytest.mark.parametrize(
    ("name", "frames", "knee"),
    [
        ("Gait10dof18musc__subject01_walk_IK", 151, (-6, 70)),
        ("Gait2354_Simbody__subject01_walk1_ik", 73, (-2, 70)),
        ("Hamner__subject02_running_ik", 599, (9, 112)),
        ("Intro_to_Musculoskeletal_Modeling__normal", 51, (2, 59)),
        ("Intro_to_Musculoskeletal_Modeling__crouch1", 119, (55, 82)),
    ],
)
def test_real_motions(captures: Path, name: str, frames: int, knee: tuple[float, float]) -> None:
    clip = read(captures / "lab_opensim_gait" / f"{name}.mot")
    assert len(clip.times) == frames and clip.angles is not None
    curves_agree(clip)
    knees = np.degrees([clip.angles["knee_left"], clip.angles["knee_right"]])
    assert knee[0] <= knees.min() and knees.max() <= knee[1]
    ankles = [clip.skeleton.index(f"ankle_{side}") for side in ("left", "right")]
    assert -0.05 < clip.positions[:, ankles, 2].min() < 0.2, "the feet are on the floor"


def test_the_runner_carries_his_arms_bent_in_front(captures: Path) -> None:
    clip = read(captures / "lab_opensim_gait" / "Hamner__subject02_running_ik.mot")
    for side in ("left", "right"):
        elbow, wrist = (clip.positions[:, clip.skeleton.index(f"{j}_{side}")] for j in ("elbow", "wrist"))
        assert np.mean(wrist[:, 0] - elbow[:, 0]) > 0.1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t[: t.index("time")], "expected column names below endheader, found none"),
        (lambda t: t[: t.index("endheader") + 9], "expected column names below endheader, found none"),
        (lambda t: t[: t.index("\n", t.index("time")) + 1], "expected lines of numbers, found none"),
        (lambda t: t[:-40], "expected 22 numbers, found .*; the file is cut off there"),
        (
            lambda t: t.replace("knee_angle_", "ground_force_"),
            "no knee_angle_r, knee_angle_l among time, pel",
        ),
        (
            lambda t: t.replace("hip_rotation_r", "hip_flexion_r"),
            "column names once each, found 'hip_flexion_r'",
        ),
        (lambda t: t.replace("time", "frame", 1), "expected time as the first column, found 'frame'"),
        (
            lambda t: re.sub(r"\n *[\d.]+\t", "\nnan\t", t),
            "line 11: expected a finite number in time, found nan",
        ),
        (lambda t: _second_number(t, "9e9"), "line 12: expected at most 100 rad in pelvis_tilt"),
        (lambda t: _second_number(t, "1x"), "line 12: expected a number, found '1x'"),
    ],
)
def test_damage_is_named(change: Callable[[str], str], message: str) -> None:
    with pytest.raises(CaptureError, match=message) as caught:
        clip_of(change(sample()))
    assert "\n" not in str(caught.value)


def test_a_row_without_a_number_is_left_out_and_the_clock_shows_it() -> None:
    whole, clip = clip_of(sample()), clip_of(_second_number(sample().replace("time", "Time", 1), "nan"))
    assert np.array_equal(clip.times, np.delete(whole.times, 1))
    assert np.array_equal(clip.positions, np.delete(whole.positions, 1, axis=0))
    (defect,) = clip.provenance["reading"]["defects"]
    assert (defect["rule"], defect["count"], defect["action"]) == ("dropped_frames", 1, "flagged")
    assert defect["text"] == "1 row without a number in pelvis_tilt or another coordinate, left out"


def _second_number(text: str, word: str) -> str:
    lines = text.split("\n")
    fields = lines[11].split("\t")
    lines[11] = "\t".join([fields[0], word, *fields[2:]])
    return "\n".join(lines)


def test_rows_out_of_order_and_missing_rows_are_reported() -> None:
    lines = sample().split("\n")
    clip = clip_of("\n".join([*lines[:20], lines[15], *lines[20:-5]]))
    assert len(clip.times) == FRAMES - 4
    defects = {d["rule"]: (d["count"], d["action"]) for d in clip.provenance["reading"]["defects"]}
    assert defects == {"duplicate_frames": (1, "repaired"), "dropped_frames": (3, "flagged")}
