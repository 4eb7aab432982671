"""Vicon Nexus exports, written here from the known walk, and the published files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples import nexus_csv as sample
from samples import source_of
from samples.motion import rigid_walk

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.clip import Clip, forward_kinematics
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.kinematics.rotations import conjugate, multiply
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.optical.joint_centres import HALF_KNEE

FRAMES = 40
SHOWN = rigid_walk(FRAMES, sample.RATE)
OUTPUTS, TRAJECTORIES = sample.outputs(SHOWN), sample.trajectories(SHOWN)


def read(lines: list[str]) -> Clip:
    return recognise.read_source(source_of("\n".join(lines) + "\n", Path("walk.csv")))


def test_segments_are_joint_centres() -> None:
    clip = read(OUTPUTS)
    assert np.abs(clip.times - SHOWN.times).max() < 1e-9
    for node in (
        "hip_left",
        "knee_right",
        "ankle_left",
        "shoulder_right",
        "elbow_left",
        "wrist_right",
        "head",
    ):
        off = clip.positions[:, clip.skeleton.index(node)] - SHOWN.joints[:, NODE_INDEX[node]]
        # The numbers have six digits.
        assert np.abs(off).max() < 2e-5
    assert clip.angles is not None
    own = leg_angles(SHOWN.joints)
    ours = leg_angles(to_nodes(clip)[0])
    for name, curve in clip.angles.items():
        assert np.abs(curve - own[name]).max() < 1e-5
        if name.startswith("knee"):
            assert np.abs(ours[name] - own[name]).max() < 1e-3
    assert clip.rotations is not None
    world = forward_kinematics(SHOWN.skeleton, np.zeros((FRAMES, 20, 3)), SHOWN.rotations)[1]
    knee = multiply(conjugate(world[:, NODE_INDEX["hip_left"]]), world[:, NODE_INDEX["knee_left"]])
    recorded = clip.rotations[:, clip.skeleton.index("ankle_left")]
    assert np.abs(np.abs(np.sum(knee * recorded, axis=-1)) - 1.0).max() < 1e-6


def test_trajectories_alone_give_what_their_markers_give() -> None:
    clip = read(TRAJECTORIES)
    assert "Bell et al. 1990" in " ".join(clip.provenance["reading"]["notes"])
    knee = clip.positions[:, clip.skeleton.index("knee_left")]
    assert np.abs(np.linalg.norm(knee - SHOWN.joints[:, NODE_INDEX["knee_left"]], axis=-1)).max() < HALF_KNEE
    assert np.isnan(clip.positions[2, clip.skeleton.index("hand_left")]).all()
    assert clip.angles is None


def test_both_sections_in_either_order() -> None:
    both = read([*TRAJECTORIES, "", *OUTPUTS])
    assert np.array_equal(both.positions, read(OUTPUTS).positions)
    angles_only = sample.section(
        "Model Outputs", ["Test:LKneeAngles", "", ""], ["X", "Y", "Z"], ["deg"] * 3, np.full((FRAMES, 3), 7.0)
    )
    clip = read([*TRAJECTORIES, "", *angles_only])
    assert np.array_equal(clip.positions, read(TRAJECTORIES).positions, equal_nan=True)
    assert clip.angles is not None
    assert np.allclose(clip.angles["knee_left"], np.radians(7.0))


@pytest.mark.parametrize("count", [0, 2, 40])
@pytest.mark.parametrize("sections", [OUTPUTS, TRAJECTORIES, [*OUTPUTS, "", *TRAJECTORIES]])
@pytest.mark.parametrize("separator", [",", ";"])
def test_events_before_everything_else(count: int, sections: list[str], separator: str) -> None:
    event = "Test,Left,Foot Strike,{:.3f},The instant the heel strikes the ground"
    events = ["Events", f"{sample.RATE:g}", "Subject,Context,Name,Time (s),Description"]
    events += [event.format(0.4 + 0.5 * k) for k in range(count)]
    clip = read([line.replace(",", separator) for line in [*events, "", *sections]])
    same = read(sections)
    assert clip.rate == pytest.approx(same.rate)
    np.testing.assert_array_equal(clip.positions, same.positions)


@pytest.mark.parametrize("facts", [[], ["Title,,", "Date:,,", "Notes:,,", ",,"]])
def test_the_layout_of_older_programs(facts: list[str]) -> None:
    """Titles in capitals below a few facts, one column of frames, no units, angles among the markers."""
    _, rate, names, components, _, *rows = TRAJECTORIES
    old = [
        f"{rate},Hz",
        names[1:] + ",LKneeAngles,,",
        components.replace("Frame,Sub Frame", "Field #") + ",X,Y,Z",
    ]
    old += [",".join([str(k), *row.split(",")[2:], "9.1", "2", "-3"]) for k, row in enumerate(rows, 1)]
    clip = read([*facts, "TRAJECTORIES,,", *old, "", "ANALOG", "1000,Hz", "Sample #,Fx", "1,0.5"])
    assert np.array_equal(clip.positions, read(TRAJECTORIES).positions, equal_nan=True)
    assert np.abs(clip.times - SHOWN.times).max() < 1e-9
    assert clip.provenance["reading"]["units"] == "mm"


def test_the_unit_by_its_word() -> None:
    """An export that says "in" and means inches: lengths are those of a leg of 0.8 / 0.0254."""
    clip = read([line.replace("mm", "in") if k == 4 else line for k, line in enumerate(TRAJECTORIES)])
    assert clip.provenance["reading"]["units"] == "inch"


def test_a_gap_in_the_frames_is_a_gap_in_the_times() -> None:
    clip = read([*OUTPUTS[:20], *OUTPUTS[25:]])
    assert np.diff(clip.times).max() == pytest.approx(6.0 / sample.RATE)


def test_a_box_and_a_second_subject_do_not_hide_the_person() -> None:
    extra = sample.trajectories(SHOWN, "boite")
    for number in range(len(TRAJECTORIES)):
        # The same columns once more, under names that no marker set has.
        columns = extra[number].split(",")[2:]
        if number == 2:
            columns = [f"boite:corner{k}" if cell else "" for k, cell in enumerate(columns)]
        head, own = TRAJECTORIES[number].split(",")[:2], TRAJECTORIES[number].split(",")[2:]
        extra[number] = ",".join([*head, *columns, *own]) if number > 1 else TRAJECTORIES[number]
    clip = read(extra)
    assert np.array_equal(clip.positions, read(TRAJECTORIES).positions, equal_nan=True)
    assert "1 other subjects or objects are not read" in clip.provenance["reading"]["notes"]


def line(number: int, change: Callable[[str], str]) -> Callable[[list[str]], list[str]]:
    """Changes a line, from 1."""
    return lambda lines: [change(text) if k == number - 1 else text for k, text in enumerate(lines)]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (line(2, lambda _: "fast,,"), "line 2: expected Model Outputs: a rate in Hz, found 'fast,,'"),
        (
            line(4, lambda text: text.replace("Sub Frame", "Time")),
            "line 4: expected Model Outputs: Frame and Sub Frame",
        ),
        (
            line(3, lambda text: "," * text.count(",")),
            "line 3: expected names of markers or outputs, found none",
        ),
        (line(5, lambda text: text.replace("mm", "ell")), "expected a unit of length among .* found 'ell'"),
        (
            line(9, lambda text: text.replace(text.split(",")[7], "oops", 1)),
            "line 9: expected a number, found 'oops'",
        ),
        (line(9, lambda text: text[: len(text) // 2]), r"line 9: expected \d+ numbers, found \d+"),
        (line(9, lambda text: "," + text.partition(",")[2]), "line 9: expected a frame's number, found none"),
        (lambda lines: lines[:4], "expected Model Outputs: four lines of header and frames"),
        (
            line(3, lambda text: text.replace("LFE", "LXX")),
            "expected outputs of the segments LFE, .* found PEL",
        ),
    ],
)
def test_damage_is_named(change: Callable[[list[str]], list[str]], says: str) -> None:
    with pytest.raises(CaptureError, match=says):
        read(change(OUTPUTS))


def test_published_outputs(sensors: Path) -> None:
    """The rotation from thigh to shank is Plug-in-Gait's own knee flexion; lengths are a person's."""
    clip = recognise.read(sensors / "vicon_csv" / "Movement_trial.csv")
    assert clip.rate == pytest.approx(120.0)
    positions = to_nodes(clip)[0]
    assert clip.angles is not None
    assert clip.rotations is not None
    for side in ("left", "right"):
        hip, knee, ankle = (positions[:, NODE_INDEX[f"{joint}_{side}"]] for joint in ("hip", "knee", "ankle"))
        assert 0.38 < np.median(np.linalg.norm(hip - knee, axis=-1)) < 0.48
        assert 0.30 < np.median(np.linalg.norm(ankle - knee, axis=-1)) < 0.42
        # From the thigh's frame to the shank's: flexion is the first of three angles, about Y.
        x, y, z, w = clip.rotations[:, clip.skeleton.index(f"ankle_{side}")].T
        flexion = np.arctan2(2.0 * (x * z + w * y), 1.0 - 2.0 * (x * x + y * y))
        assert np.abs(flexion - clip.angles[f"knee_{side}"]).max() < np.radians(0.01)


def test_published_markers_of_an_arm_are_refused(sensors: Path) -> None:
    with pytest.raises(CaptureError, match=r"found none for left knee .*; left ankle .* among ASISr, ASISl"):
        recognise.read(sensors / "vicon_csv" / "markers.csv")
    with pytest.raises(CaptureError, match="found a table of 155 numbers per line without a header"):
        recognise.read(sensors / "vicon_csv" / "markers_without_header.csv")
