"""All rules applied to whole captures: defects, refusals and planned steps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from samples import motion

from kinemimic.pipeline.kinematics.clip import Clip, scaled
from kinemimic.pipeline.kinematics.rotations import IDENTITY, from_axis_angle
from kinemimic.pipeline.kinematics.skeleton import NODES, Skeleton, node_skeleton
from kinemimic.pipeline.quality.check import check_capture, planned_steps
from kinemimic.pipeline.quality.passes import find_passes
from kinemimic.pipeline.quality.rules.defect import RULES, Defect
from kinemimic.pipeline.quality.rules.wrong_up_axis import rotated_clip
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.kinect.nui_skl import FORMAT
from kinemimic.pipeline.readers.recognise import read
from kinemimic.pipeline.virtual_kinect.recorder import record_virtual

Build = Callable[..., Clip]


def walk(
    frames: int = 120, *, kind: str = "walk", noise: float = 0.008, defects: tuple[Defect, ...] = ()
) -> Clip:
    """The known motion as a reader gives it."""
    shown = motion.walk(frames, motion=kind)
    joints = shown.joints + noise * np.random.default_rng(0).standard_normal(shown.joints.shape)
    known = reading(units="m", units_rule="the format's", defects=defects)
    clip = clip_of_points(
        node_skeleton(), shown.times, joints, None, format=FORMAT, reading=known, world_from_file=IDENTITY
    )
    return replace(clip, provenance={**clip.provenance, "source": "made.skl", "sha256": "0" * 64})


@pytest.mark.parametrize("kind", ["walk", "run"])
def test_a_sound_capture_comes_through_untouched(kind: str) -> None:
    clip = walk(240, kind=kind)
    checked = check_capture(clip)
    assert checked.defects == () and checked.refused is None
    assert np.array_equal(checked.clip.positions, clip.positions)
    assert planned_steps(checked) == [
        "1 pass, 240 frames, 8.0 s",
        "positions: Kalman-RTS smoother, cut-offs by likelihood, outliers rejected",
    ]


def test_many_faults_at_once() -> None:
    """In millimetres, lying on its side, mirrored, with swapped legs, jumps and repeated frames."""
    clip = walk(240)
    p = clip.positions.copy()
    p[100:102][:, 12:20] = p[100:102][:, [16, 17, 18, 19, 12, 13, 14, 15]]
    p[150, 10, 2] += 0.5
    p[200] = p[199]
    broken = replace(clip, positions=p * [1.0, -1.0, 1.0])
    checked = check_capture(scaled(rotated_clip(broken, from_axis_angle("X", 0.5 * np.pi)), 1000.0))
    found = {defect.rule: (defect.count, defect.action) for defect in checked.defects}
    assert found == {
        "duplicate_frames": (1, "repaired"),
        "dropped_frames": (1, "flagged"),
        "wrong_units": (20, "repaired"),
        "wrong_up_axis": (240, "repaired"),
        "mirrored": (240, "repaired"),
        "swapped_sides": (2, "repaired"),
        "jumps": (1, "repaired"),
    }
    assert [defect.rule for defect in checked.defects] == [rule for rule in RULES if rule in found]
    heights = np.delete(clip.positions[..., 2], 200, axis=0)
    seen = np.isfinite(checked.clip.positions[..., 2])
    assert seen.sum() == seen.size - 1
    np.testing.assert_allclose(checked.clip.positions[..., 2][seen], heights[seen], atol=1e-9)


def test_the_readers_defects_come_first_and_stay() -> None:
    reported = (Defect("several_people", 2, "people", "flagged", "two people; the first is taken"),)
    assert check_capture(walk(defects=reported)).defects == reported


def test_frames_are_named_as_they_are_numbered_in_the_clip() -> None:
    """Defects of the reader, found before a T-pose and a repeat were dropped, and of the rules after that."""
    reported = Defect("zero_frames", 3, "frames", "repaired", "nobody", frames=((0, 1), (30, 40), (99, 101)))
    clip = walk(120, noise=0.0, defects=(reported,))
    p = clip.positions
    p[:2] = p[2]
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for k, joint in enumerate(("elbow", "wrist", "hand"), start=1):
            p[:2, NODES.index(f"{joint}_{side}")] = p[2, NODES.index(f"shoulder_{side}")] + [
                0,
                0.3 * k * sign,
                0,
            ]
    p[1, :, 2] += 0.01
    p[50] = p[49]
    p[80, NODES.index("hand_left")] += 0.5
    checked = check_capture(clip)
    frames = {defect.rule: defect.frames for defect in checked.defects}
    assert frames == {
        "zero_frames": ((28, 38), (96, 98)),
        "calibration_frames": (),
        "duplicate_frames": ((47, 47),),
        "dropped_frames": ((47, 47),),
        "jumps": ((77, 77),),
    }
    assert len(checked.clip.times) == 117
    assert np.isnan(checked.clip.positions[77, NODES.index("hand_left")]).all()


def test_frames_keep_their_names_where_a_t_pose_is_dropped_and_the_clock_changed() -> None:
    reported = Defect("zero_frames", 3, "frames", "repaired", "nobody", frames=((0, 1), (30, 40), (99, 101)))
    clip = walk(240, noise=0.0, defects=(reported,))
    p = clip.positions
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for k, joint in enumerate(("elbow", "wrist", "hand"), start=1):
            p[:2, NODES.index(f"{joint}_{side}")] = p[2, NODES.index(f"shoulder_{side}")] + [
                0.0, 0.3 * k * sign, 0.0,
            ]  # fmt: skip
    p[1] = p[0] + 0.001
    # Read at 15 Hz, at which nobody walks like this, of 30 that the file declares.
    doubt = {"assumed_rate": {"rate": 15.0, "declared": 30.0, "sensor": "Kinect"}}
    reading = {**clip.provenance["reading"], **doubt}
    slow = replace(clip, times=2.0 * clip.times, provenance={**clip.provenance, "reading": reading})
    # The clip's own pose repeats nothing: `zero_frames` are two frames later in the file.
    frames = {defect.rule: defect.frames for defect in check_capture(slow).defects}
    assert {"calibration_frames", "wrong_rate"} <= frames.keys()
    assert frames["zero_frames"] == ((28, 38), (97, 99))


def test_a_clip_too_short_without_its_repeats_is_refused() -> None:
    clip = walk(18)
    clip.positions[13:] = clip.positions[12]
    checked = check_capture(clip)
    assert checked.refused is not None and "shorter than 0.5 s" in checked.refused.text
    assert planned_steps(checked)[0].startswith("refused")


def test_a_wrong_unit_is_the_reason_where_everybody_jumps() -> None:
    (found,) = check_capture(scaled(walk(), 5.0)).defects  # and nothing is said of its limbs
    assert (found.rule, found.action) == ("wrong_units", "refused")


def test_no_subject_and_short_passes_are_refused(node_clip: Build) -> None:
    clip = walk()
    empty = replace(clip, positions=np.full_like(clip.positions, np.nan), states=np.zeros_like(clip.states))
    refused = check_capture(empty).refused
    assert refused is not None and refused.text == "no subject in any of 120 frames"
    refused = check_capture(walk(10)).refused
    assert refused is not None and refused.text == "the only pass is shorter than 0.5 s"
    assert planned_steps(check_capture(empty)) == ["refused: no subject in any of 120 frames"]


def test_a_body_without_legs_is_refused_with_the_names() -> None:
    clip = walk()
    names = tuple(name.replace("knee", "thing") for name in NODES)
    nameless = replace(clip, skeleton=Skeleton(names, clip.skeleton.parents, clip.skeleton.offsets))
    refused = check_capture(nameless).refused
    assert refused is not None and refused.rule == "wrong_names"
    assert "knee_left" in refused.text and "thing_left" in refused.text


def test_planned_steps_list_gaps() -> None:
    clip = walk()
    clip.positions[50:53, 7], clip.states[50:53, 7] = np.nan, 0
    sentences = planned_steps(check_capture(clip))
    assert any("of up to 0.2 s will be filled" in sentence for sentence in sentences)


def test_clips_of_one_frame_and_of_two(node_clip: Build) -> None:
    for frames in (1, 2, 3, 5):
        clip = walk(frames)
        assert check_capture(clip).refused is not None
        assert find_passes(clip).count == 0


@pytest.mark.parametrize("kind", ["walk", "run"])
def test_a_virtual_kinect_has_only_its_simulated_defects(tmp_path: Path, kind: str) -> None:
    """Missing frames and joints, swapped legs and outliers are in it; nothing else may be found."""
    recording = record_virtual(tmp_path, motion=kind)
    for path in (recording.skl, recording.euler):
        found = {defect.rule for defect in check_capture(read(path)).defects}
        assert found <= {"dropped_frames", "swapped_sides", "knee_sign", "jumps", "gaps"}, path.name


def test_real_recordings(captures: Path) -> None:
    sound = [*(captures / "cmu_bvh").glob("*.bvh"), *(captures / "bandai_bvh_ccbync").glob("*.bvh")]
    for path in sorted(sound):
        assert {defect.rule for defect in check_capture(read(path)).defects} <= {"calibration_frames"}, (
            path.name
        )
    for path in sorted((captures / "kinect1_bernstein_skl").glob("*.skl")):
        checked = check_capture(read(path))
        assert checked.refused is None
        assert not {"turning_camera", "mirrored", "wrong_units", "wrong_up_axis", "wrong_rate"} & {
            defect.rule for defect in checked.defects
        }, path.name


ANDERSSON = [
    f"Person{number}.txt" for number in ("001_1", "003_2", "017_2", "020_2", "077_2", "083_2", "097_2")
]
REFUSED = {
    "kinect1_treadmill_c3d/skeleton_3d_20h17m38.txt": "thigh 0.32 m and shank 0.22 m",
    "kinect2_kimore/JointPositionExercise5.csv": "as in a small child, but leg 2.2",
}


@pytest.mark.parametrize("name", REFUSED)
def test_real_limbs_that_no_human_has(captures: Path, name: str) -> None:
    refused = check_capture(read(captures / name)).refused
    assert refused is not None and refused.rule == "impossible_limbs"
    assert REFUSED[name] in refused.text


@pytest.mark.parametrize(
    "folder",
    [
        "kinect1_msraction3d",
        "kinect1_utkinect",
        "kinect2_bernstein_skl",
        "kinect2_labanotation",
        "kinect2_khokhlova_orient",
        "kinect2_brekel_bvh",
        "shum_gait_bvh",
    ],
)
def test_real_bodies_pass(captures: Path, folder: str) -> None:
    """Long thighs, short thighs, many people: none is refused, mirrored, in wrong units or on its side."""
    for path in sorted((captures / folder).iterdir()):
        if path.name in ("SOURCE.txt", "actionLabel.txt"):
            continue
        found = {defect.rule for defect in check_capture(read(path)).defects}
        wrong = {
            "impossible_limbs",
            "mirrored",
            "wrong_units",
            "wrong_up_axis",
            "turning_camera",
            "wrong_rate",
        }
        assert not wrong & found, path.name


@pytest.mark.parametrize("name", ANDERSSON)
def test_the_camera_on_the_spinning_dish(captures: Path, name: str) -> None:
    checked = check_capture(read(captures / "kinect1_andersson_gait" / name))
    assert checked.refused is None
    assert "turning_camera" in {defect.rule for defect in checked.defects}


def test_a_treadmill_is_no_turning_camera(captures: Path) -> None:
    clip = read(captures / "kinect1_treadmill_c3d" / "skeleton_3d_19h58m42.txt")
    assert "turning_camera" not in {defect.rule for defect in check_capture(clip).defects}


def test_nothing_that_a_clip_may_hold_raises() -> None:
    """Holes, frozen frames, points in one place, other scales, axes, orders and clocks, three at a time."""
    rng = np.random.default_rng(0)
    for _ in range(200):
        clip = walk(int(rng.choice([1, 2, 3, 5, 12, 40, 90])), noise=0.0)
        p, times = clip.positions, clip.times
        for kind in rng.integers(0, 8, size=3):
            if kind == 0:
                p[rng.random(p.shape[:2]) < rng.random()] = np.nan
            elif kind == 1:
                p[len(p) // 2 :] = p[len(p) // 2]
            elif kind == 2:
                p[:] = p[:, :1]
            elif kind == 3:
                p *= 10.0 ** rng.integers(-5, 5)
            elif kind == 4:
                p[:] = p[..., rng.permutation(3)]
            elif kind == 5:
                p += rng.standard_normal(p.shape) * 10.0 ** rng.integers(-3, 2)
            elif kind == 6:
                times = np.cumsum(rng.random(len(p)) * rng.choice([0.001, 0.03, 10.0]) + 1e-6)
            else:
                p[:] = p[:, rng.permutation(20)]
        states = np.where(np.isnan(p).any(axis=-1), 0, 2).astype(np.uint8)
        p[states == 0] = np.nan
        assert planned_steps(check_capture(replace(clip, times=times, states=states)))
