"""ASF/AMC: the known walk is reproduced, CMU's AMC equals CMU's BVH, and damage names its line."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples.asf_amc import files
from samples.motion import rigid_walk

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.euler import rotations_of_channels, world_positions
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.mocap import asf_amc, bvh
from kinemimic.pipeline.readers.recognise import read

FRAMES = 40
# Joints of the skeleton file and the nodes of the known walk that they are.
SAME = {
    "root": "hip_center",
    "thorax": "spine",
    "upperneck": "shoulder_center",
    "upperneck_end": "head",
    **{
        f"{side[0]}{bone}": f"{node}_{side}"
        for side in ("left", "right")
        for bone, node in {
            "femur": "hip",
            "tibia": "knee",
            "foot": "ankle",
            "foot_end": "foot",
            "humerus": "shoulder",
            "radius": "elbow",
            "wrist": "wrist",
            "wrist_end": "hand",
        }.items()
    },
}


def sample(
    folder: Path, amc: Callable[[str], str] = lambda t: t, asf: Callable[[str], str] = lambda t: t
) -> Path:
    """The sample's two files, changed, in a folder; the motion's path."""
    for (name, content), change in zip(files(FRAMES).items(), (amc, asf), strict=True):
        text = content.decode()
        (folder / name).write_bytes(change(text).encode())
    return folder / "07_01.amc"


def test_the_known_walk_comes_back(tmp_path: Path) -> None:
    clip, walk = read(sample(tmp_path)), rigid_walk(FRAMES)
    for joint, node in SAME.items():
        ours = clip.positions[:, clip.skeleton.index(joint)]
        np.testing.assert_allclose(ours, walk.joints[:, walk.skeleton.index(node)], atol=1e-5, err_msg=joint)
    np.testing.assert_allclose(clip.times, np.arange(FRAMES) / 120.0)
    assert list(clip.provenance["sidecar_files"]) == ["07.asf"]
    assert "120 Hz" in clip.provenance["reading"]["notes"][0]


def test_the_channels_are_the_files_own_and_make_the_positions(tmp_path: Path) -> None:
    text = files(FRAMES)["07_01.amc"].decode()
    line = next(row for row in text.split("\n") if row.startswith("rfemur"))
    clip = read(sample(tmp_path))
    assert clip.euler is not None and clip.orders is not None and clip.translations is not None
    femur = clip.skeleton.index("rfemur")
    rx, ry, rz = (float(word) for word in line.split()[1:])
    assert clip.orders[femur] == "ZYX"
    np.testing.assert_allclose(np.degrees(clip.euler[0, femur]), [rz, ry, rx])
    rotations = rotations_of_channels(clip.euler, clip.orders, clip.world_from_file, clip.rests)
    again = world_positions(clip.skeleton, clip.translations, rotations, clip.world_from_file)
    np.testing.assert_allclose(again, clip.positions, atol=1e-9)


def knees_agree(clip: Clip) -> None:
    """The file's own knee is that of the positions within 0.01 degrees."""
    assert clip.angles is not None and set(clip.angles) == {"knee_left", "knee_right"}
    measured = leg_angles(to_nodes(clip)[0])
    for name, curve in clip.angles.items():
        np.testing.assert_allclose(np.degrees(measured[name]), np.degrees(curve), atol=0.01)


def test_knees_of_the_sample(tmp_path: Path) -> None:
    knees_agree(read(sample(tmp_path)))


@pytest.mark.parametrize(("name", "frames"), [("02_01", 343), ("02_03", 173)])
def test_cmu_amc_is_cmu_bvh(captures: Path, name: str, frames: int) -> None:
    """The same recording in both formats. The BVH leaves out the thorax' and the wrists' bones, so that above
    them places differ and the directions of the bones must do."""
    amc = read(captures / "cmu_asfamc" / f"{name}.amc")
    other = bvh.read(Source.open(captures / "cmu_bvh" / f"{name}.bvh"))  # its T-pose is dropped
    assert len(amc.times) == len(other.times) == frames
    knees_agree(amc)

    def both(bone: str, joint: str) -> tuple[Array, Array]:
        return amc.positions[:, amc.skeleton.index(bone)], other.positions[:, other.skeleton.index(joint)]

    places = {"root": "Hips", "upperback": "Spine", "thorax": "Spine1"}
    for letter, side in (("l", "Left"), ("r", "Right")):
        places |= {f"{letter}femur": f"{side}UpLeg", f"{letter}tibia": f"{side}Leg"}
        places |= {f"{letter}foot": f"{side}Foot", f"{letter}toes": f"{side}ToeBase"}
        for start, end in (("clavicle", "humerus"), ("humerus", "radius"), ("radius", "wrist")):
            joints = {"clavicle": "Shoulder", "humerus": "Arm", "radius": "ForeArm", "wrist": "Hand"}
            (a, b), (c, d) = (both(letter + bone, side + joints[bone]) for bone in (start, end))
            np.testing.assert_allclose(c - a, d - b, atol=1e-5, err_msg=start)
    for bone, joint in places.items():
        np.testing.assert_allclose(*both(bone, joint), atol=1e-5, err_msg=bone)


def test_nodes_of_cmu_have_human_lengths(captures: Path) -> None:
    positions, states = to_nodes(read(captures / "cmu_asfamc" / "02_01.amc"))
    assert np.isfinite(positions).all() and states.all()


@pytest.mark.parametrize("skeleton", ["07.asf", "07_01.asf", "Other.ASF"])
def test_the_skeleton_is_found_beside(tmp_path: Path, skeleton: str) -> None:
    path = sample(tmp_path)
    (tmp_path / "07.asf").rename(tmp_path / skeleton)
    assert list(read(path).provenance["sidecar_files"]) == [skeleton]


def test_among_several_skeletons_the_one_of_its_name(tmp_path: Path) -> None:
    path = sample(tmp_path)
    for other in ("0.asf", "08.asf", "071.asf"):
        (tmp_path / other).write_text("no skeleton")
    assert list(read(path).provenance["sidecar_files"]) == ["07.asf"]
    (tmp_path / "07.asf").unlink()
    with pytest.raises(CaptureError, match=r"07_01.asf or 07.asf, found 0.asf, 071.asf, 08.asf"):
        read(path)


def test_alone(tmp_path: Path) -> None:
    path = sample(tmp_path)
    with pytest.raises(CaptureError, match=r"a motion, found a skeleton \(ASF\) alone; pass the .amc file"):
        read(tmp_path / "07.asf")
    (tmp_path / "07.asf").unlink()
    with pytest.raises(CaptureError, match=r"07_01.asf or 07.asf, found no .asf file"):
        read(path)


def last_bone_first(text: str) -> str:
    """In the second frame the sequence of two bones is the other one."""
    head, second = text.split("\n2\n")
    lines = second.split("\n")
    return head + "\n2\n" + "\n".join([lines[1], lines[0], *lines[2:]])


@pytest.mark.parametrize(
    "change",
    [
        lambda t: t.replace("\n", "\r\n"),
        lambda t: t.replace("\n", "\n\n"),
        lambda t: t.replace("rtibia", "# a remark\nrtibia", 3),
        lambda t: t.replace(" ", "\t "),
        lambda t: t.rstrip("\n"),
        lambda t: t.split("\n", 2)[2],
        last_bone_first,
    ],
)
def test_layout_does_not_matter(tmp_path: Path, change: Callable[[str], str]) -> None:
    first, second = tmp_path / "a", tmp_path / "b"
    first.mkdir(), second.mkdir()  # type: ignore[func-returns-value]
    plain, changed = read(sample(first)), read(sample(second, change))
    assert np.array_equal(plain.positions, changed.positions)


def test_radians_and_a_stated_rate(tmp_path: Path) -> None:
    def radians(text: str) -> str:
        rows = []
        for row in text.replace(":DEGREES", ":RADIANS\n:SAMPLES-PER-SECOND 60").split("\n"):
            words = row.split()
            if len(words) > 1 and words[0][0] not in ":#":
                places = words[1:4] if words[0] == "root" else []
                angles = [f"{np.radians(float(word)):.12g}" for word in words[1 + len(places) :]]
                rows.append(" ".join([words[0], *places, *angles]))
            else:
                rows.append(row)
        return "\n".join(rows)

    (tmp_path / "r").mkdir()
    plain, turned = read(sample(tmp_path)), read(sample(tmp_path / "r", radians))
    np.testing.assert_allclose(turned.positions, plain.positions, atol=1e-9)
    np.testing.assert_allclose(turned.times, 2.0 * plain.times)


def test_repeated_frames_are_dropped_and_reported(tmp_path: Path) -> None:
    clip = read(sample(tmp_path, lambda t: t.replace("\n5\n", "\n4\n").replace("\n9\n", "\n2\n")))
    assert len(clip.times) == FRAMES - 2
    (defect,) = clip.provenance["reading"]["defects"]
    assert (defect["rule"], defect["count"]) == ("duplicate_frames", 2)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t[: t.index("\n1\n")], "expected frames of motion, found none"),
        (
            lambda t: t.replace(":DEGREES", "DEGREES"),
            "line 3: expected a keyword or the first frame",
        ),
        (lambda t: t[: t.rindex("lwrist")], r"found none for lwrist, .*cut off there"),
        (lambda t: t.replace("rtibia", "rshin"), "line .*: expected a frame's number or a bone.*'rshin'"),
        (lambda t: t.replace("rtibia", "rtibia 1"), "expected 1 values for rtibia, found 2"),
        (lambda t: t.replace("rtibia", "rtibia 1x #", 1), "expected numbers for rtibia, found '1x'"),
        (lambda t: t.replace("\nrtibia", "\nltibia", 1), "expected each bone once per frame"),
        (lambda t: t.replace("rtibia", "rtibia nan #", 1), "expected finite numbers below 1e.09, found nan"),
        (lambda t: t.replace("rtibia", "rtibia 1e300 #", 1), "below 1e.09, found 1e.300"),
        (
            lambda t: t.replace("\n40\n", "\n99999999999999999999999999\n"),
            "frame 40: expected finite numbers below",
        ),
    ],
)
def test_damage_of_the_motion_is_named(tmp_path: Path, change: Callable[[str], str], message: str) -> None:
    with pytest.raises(CaptureError, match=message) as caught:
        read(sample(tmp_path, change))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t[: t.index(":hierarchy")], "a section :hierarchy, found none"),
        (lambda t: t[: t.rindex("end")], "expected an end, found none"),
        (lambda t: t.replace("name rtibia", "name ltibia"), "each bone once, found 'ltibia' twice"),
        (lambda t: t.replace("lfemur ltibia", "lfemur lshin"), "a bone of :bonedata, found 'lshin'"),
        (lambda t: t.replace("lfemur ltibia", "lfemur rtibia"), "one parent per bone, found 'rtibia' again"),
        (
            lambda t: t.replace("    lfemur ltibia\r\n", ""),
            "every bone in :hierarchy below root, found no lt",
        ),
        (
            lambda t: t.replace("dof rx\r", "dof rx rw\r", 1),
            "degrees of freedom among rx ry rz .*, each once",
        ),
        (lambda t: t.replace("  XYZ", "  XYW", 1), "an order of axes such as XYZ, found 'XYW'"),
        (lambda t: t.replace("length 0.45", "length 0"), "a length scale of 0.0001 to 10000, found 0"),
        (lambda t: t.replace("direction ", "direction nan ", 1), "a bone's direction, found 'nan"),
        (lambda t: t.replace("direction ", "direction 9", 1), "a direction of length 1"),
        (lambda t: t.replace("tibia", "Xtibia"), "joints named as legs"),
        (lambda t: "x\n" * 40, "a skeleton .ASF., found something else"),
    ],
)
def test_damage_of_the_skeleton_is_named(tmp_path: Path, change: Callable[[str], str], message: str) -> None:
    with pytest.raises(CaptureError, match=message) as caught:
        read(sample(tmp_path, lambda t: t.replace("tibia", "Xtibia") if "legs" in message else t, change))
    assert "07.asf" in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("dofs", ["rx tx ty tz", "tx rx l", "rx l"])
def test_bones_that_move_or_vary_in_length_keep_theirs(tmp_path: Path, dofs: str) -> None:
    """The values are those of a shin, which bends about x alone."""
    same = read(sample(tmp_path))
    row = " ".join(r"\1" if dof == "rx" else "0.25" for dof in dofs.split())

    def moved(text: str) -> str:
        return re.sub(r"^ltibia (\S+)", f"ltibia {row}", text, flags=re.MULTILINE)

    def skeleton(text: str) -> str:
        at = text.index("dof", text.index("name ltibia"))
        return text[:at] + text[at:].replace("dof rx", f"dof {dofs}", 1)

    clip = read(sample(tmp_path, moved, skeleton))
    assert np.array_equal(clip.positions, same.positions)
    assert "translations and lengths of bones are not read (ltibia)" in clip.provenance["reading"]["notes"]


def test_directions_that_are_rounded(tmp_path: Path) -> None:
    same = read(sample(tmp_path))

    def rounded(text: str) -> str:
        return re.sub(r"direction (\S+) (\S+) (\S+)", lambda m: "direction " + _longer(m.groups()), text)

    clip = read(sample(tmp_path, asf=rounded))
    np.testing.assert_allclose(clip.positions, same.positions, atol=1e-6)


def _longer(words: tuple[str, ...]) -> str:
    return " ".join(f"{1.04 * float(word):.9f}" for word in words)


def test_angles_in_radians_that_are_said_to_be_degrees(tmp_path: Path) -> None:
    same = read(sample(tmp_path))

    def in_radians(text: str) -> str:
        lines = []
        for line in text.split("\n"):
            name, *words = line.split() or [""]
            kept = 3 if name == "root" else 0 if name.isalpha() else len(words)
            turned = [f"{np.radians(float(word)):.9f}" for word in words[kept:]]
            lines.append(" ".join([name, *words[:kept], *turned]))
        return "\n".join(lines)

    clip = read(sample(tmp_path, in_radians))
    np.testing.assert_allclose(clip.positions, same.positions, atol=1e-5)
    (defect,) = clip.provenance["reading"]["defects"]
    assert (defect["rule"], defect["action"]) == ("wrong_units", "repaired")
    assert clip.angles is not None
    assert same.angles is not None
    np.testing.assert_allclose(clip.angles["knee_left"], same.angles["knee_left"], atol=1e-6)


def test_recognises_only_its_own(captures: Path) -> None:
    for path in sorted(captures.glob("*/*.*")):
        source = Source.open(path)
        if source.is_text:
            assert asf_amc.recognises(source) == (path.suffix in (".amc", ".asf")), path


def test_a_folder_of_skeletons_beside_the_motions(tmp_path: Path) -> None:
    same = read(sample(tmp_path))
    for name, folder in (("07_01.amc", "amc"), ("07.asf", "Skeletons"), ("07.asf", "other")):
        (tmp_path / "library" / folder).mkdir(parents=True)
        (tmp_path / "library" / folder / name).write_bytes((tmp_path / name).read_bytes())
    clip = read(tmp_path / "library" / "amc" / "07_01.amc")
    assert np.array_equal(clip.positions, same.positions)
    assert list(clip.provenance["sidecar_files"]) == ["../Skeletons/07.asf"]
