"""Tables of joints that nobody described are read as the same body, whatever their layout, or refused."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from samples.joint_table import NAMES
from samples.motion import kinect_v2_joints, walk, y_up

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.angles import ANGLES, leg_angles
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.quality.check import check_capture
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.custom_table.suggest_orders import ORDERS
from kinemimic.pipeline.readers.kinect.kinect_v2 import SDK_JOINTS

FRAMES = 60
POINTS = y_up(walk(FRAMES).joints)
TIMES = walk(FRAMES).times
AXES = [f"{name}_{axis}" for name in NAMES for axis in "XYZ"]


def table(header: Sequence[str], rows: Sequence[Sequence[object]], separator: str = ",") -> str:
    cells = [[f"{cell:.6f}" if isinstance(cell, float) else f"{cell}" for cell in row] for row in rows]
    return "\n".join(separator.join(row) for row in [*([header] if header else []), *cells]) + "\n"


def wide(points: Array = POINTS, scale: float = 1.0) -> list[list[object]]:
    return [[float(scale * t), *map(float, frame.ravel())] for t, frame in zip(TIMES, points, strict=True)]


def by_joint(points: Array = POINTS) -> list[list[object]]:
    return [
        [float(1000 * t), k, NAMES[k], *map(float, frame[k])]
        for t, frame in zip(TIMES, points, strict=True)
        for k in range(len(NAMES))
    ]


def places(form: str) -> list[list[object]]:
    return [
        [float(t), *(f'"{form.format(*place)}"' for place in frame.tolist())]
        for t, frame in zip(TIMES, POINTS, strict=True)
    ]


def groups() -> str:
    joints = ["time", *(cell for name in NAMES for cell in (name, "", ""))]
    return ",".join(joints) + "\n" + table(["", *("x", "y", "z") * len(NAMES)], wide())


def multi_index() -> str:
    upper = [["joint", *np.repeat(NAMES, 3)], ["axis", *("x", "y", "z") * len(NAMES)]]
    index = ["frame", *[""] * len(AXES)]
    rows = [[k, *row[1:]] for k, row in enumerate(wide())]
    return "".join(",".join(row) + "\n" for row in upper) + table(index, rows)


def axis_studio() -> str:
    """A line with a number, frame numbers, and velocities and quaternions beside the places."""
    parts = [
        (part, axis)
        for part, axes in (("Joint-Velo", "xyz"), ("Joint-Posi", "xyz"), ("Bone-Quat", "xyzw"))
        for axis in axes
    ]
    header = ["Frame-No", *(f"{name}-{part}-{axis}" for name in NAMES for part, axis in parts)]
    rows = [
        [k, *(value for place in frame.tolist() for value in (0.5, 0.5, 0.5, *place, 0.0, 0.0, 0.0, 1.0))]
        for k, frame in enumerate(POINTS)
    ]
    return f"{FRAMES}\n{table(header, rows)}"


def visual3d() -> str:
    """The file, the type and the folder of every column beside its joint and axis; TABs end the lines."""
    heads = [
        ["walk.c3d"] * len(AXES),
        np.repeat(NAMES, 3),
        ["LANDMARK"] * len(AXES),
        ["ORIGINAL"] * len(AXES),
    ]
    rows = [[k + 1, *row[1:], ""] for k, row in enumerate(wide())]
    above = "".join("\t".join(["", *head, ""]) + "\n" for head in heads)
    return above + table(["ITEM", *("X", "Y", "Z") * len(NAMES), ""], rows, "\t")


def in_rows(form: str, header: str = "") -> str:
    lines = [
        f"{number},{int(1000 * time)},"
        + ",".join(form.format(*joint) for joint in zip(NAMES, *frame.T, strict=True))
        for number, (time, frame) in enumerate(zip(TIMES, POINTS, strict=True))
    ]
    return "\n".join([*([header] if header else []), *lines, ""])


LAYOUTS: dict[str, Callable[[], str]] = {
    "a column for each coordinate": lambda: table(["Time", *AXES], wide()),
    "glued names": lambda: table(["Time", *(name.replace("_", "") for name in AXES)], wide()),
    "millimetres": lambda: table(["t (s)", *AXES], wide(np.hstack([1000 * POINTS]))),
    "units behind the names": lambda: table(["t_s", *(f"{name}_mm" for name in AXES)], wide(1000 * POINTS)),
    "no times": lambda: table(AXES, [row[1:] for row in wide()]),
    "decimal commas": lambda: table(["Zeit", *AXES], wide(), ";").replace(".", ","),
    "Z up": lambda: table(["Time", *AXES], wide(walk(FRAMES).joints)),
    "Y down": lambda: table(["Time", *AXES], wide(POINTS * [1, -1, -1])),
    "left-handed": lambda: table(["Time", *AXES], wide(POINTS * [-1, 1, 1])),
    "a row for each joint": lambda: table(["ms", "id", "joint", "x", "y", "z"], by_joint()),
    "numbered joints": lambda: table(
        ["ms", "JointID", "X", "Y", "Z"], [[*row[:2], *row[3:]] for row in by_joint()]
    ),
    "the joint above the axis": groups,
    "an index of several levels": multi_index,
    "Visual3D's text": visual3d,
    "units below the names": lambda: table(
        ["Time", *AXES], [["s", *["mm"] * len(AXES)], *wide(1000 * POINTS)]
    ),
    "velocities and quaternions": axis_studio,
    "tuples": lambda: table(["Time", *NAMES], places("({}, {}, {})")),
    "arrays": lambda: table(["Time", *NAMES], places("[{} {}  {}]"), ";"),
    "dictionaries": lambda: table(["Time", *NAMES], places("{{'x': {}, 'y': {}, 'z': {}}}")),
    "names in every row": lambda: in_rows("{}: {} {} {}"),
    "names in every row, in brackets": lambda: in_rows("({},Tracked,{},{},{},960.5,540.5)", "Version0.1"),
    "names in every row, under a header": lambda: in_rows(
        "{},TRACKED,{},{},{},0.5,0.5,0.5,0.5",
        "Index,Time"
        + ",Joint,Status,PositionX,PositionY,PositionZ,RotationW,RotationX,RotationY,RotationZ" * 20,
    ),
    "no names": lambda: table([], wide(scale=1000)),
}


def angles(path: Path) -> dict[str, Array]:
    checked = check_capture(recognise.read(path))
    assert checked.refused is None
    clip = checked.clip
    assert clip.provenance["format"] == "joint table"
    assert clip.times[-1] - clip.times[0] == pytest.approx(TIMES[-1], rel=1e-3)
    points = to_nodes(clip)[0]
    assert (points[:, 3, 2] > points[:, 0, 2] + 0.3).all(), "the head is above the hips"
    return leg_angles(points, times=clip.times)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_same_body_from_every_layout(layout: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(LAYOUTS[layout]())
    notes = recognise.read(tmp_path / "a.csv").provenance["reading"]["notes"]
    assert ("named in" in notes[0]) == (layout not in ("no names", "numbered joints"))
    truth = leg_angles(walk(FRAMES).joints, times=TIMES)
    for name, found in angles(tmp_path / "a.csv").items():
        assert np.degrees(np.abs(found - truth[name])).max() < 0.1, name


def test_a_joint_beside_the_one_that_is_the_node_of_its_name(tmp_path: Path) -> None:
    """LARa's segments: head beside head_end, and angles beside the places."""
    names = [name.lower() for name in NAMES]
    names[NAMES.index("Head")] = "head_end"
    header = [f"{name}_{part}{axis}" for name in [*names, "head"] for part in "RT" for axis in "XYZ"]
    places = np.concatenate([POINTS, POINTS[:, [NAMES.index("Head")]] - [0.0, 0.1, 0.0]], axis=1)
    rows = [
        [float(t), *np.insert(frame, [0], [10.0, 20.0, 30.0], axis=1).ravel()]
        for t, frame in zip(TIMES, places, strict=True)
    ]
    (tmp_path / "a.csv").write_text(table(["time", *header], rows))
    truth = leg_angles(walk(FRAMES).joints, times=TIMES)
    for name, found in angles(tmp_path / "a.csv").items():
        assert np.degrees(np.abs(found - truth[name])).max() < 0.1, name


def test_unnamed_joints_of_a_kinect_v2_are_not_those_of_a_v1(tmp_path: Path) -> None:
    points = y_up(kinect_v2_joints(walk(FRAMES)))
    (tmp_path / "a.txt").write_text(table([], wide(points), " "))
    clip = recognise.read(tmp_path / "a.txt")
    assert len(clip.skeleton.names) == len(SDK_JOINTS)
    assert set(angles(tmp_path / "a.txt")) == set(ANGLES)


def test_a_second_person_of_zeros_behind_the_first(tmp_path: Path) -> None:
    """As in PKU-MMD; a joint at the end that was never seen is the first person's."""
    points = y_up(kinect_v2_joints(walk(FRAMES)))
    alone, never = (np.where(np.arange(25)[:, None] >= last, 0.0, points) for last in (25, 24))
    for places in (alone, never):
        (tmp_path / "a.txt").write_text(table([], wide(np.hstack([places, np.zeros_like(places)])), " "))
        clip = recognise.read(tmp_path / "a.txt")
        assert len(clip.skeleton.names) == len(SDK_JOINTS)
        truth = leg_angles(walk(FRAMES).joints, times=TIMES)
        for name, found in angles(tmp_path / "a.txt").items():
            assert np.degrees(np.abs(found - truth[name])).max() < 0.1


@pytest.mark.parametrize("long", [False, True])
def test_of_several_people_the_one_seen_in_most_rows(long: bool, tmp_path: Path) -> None:
    """The others stand beside, or are rows of zeros; their numbers are no states."""
    header = ["ms", "body", "joint", "x", "y", "z"] if long else ["ms", "trackingId", *AXES]
    rows: list[list[object]] = []
    for number, time in enumerate(TIMES):
        shown = {0: 0 * POINTS[number], 1: POINTS[number], 2: POINTS[number] + [1.5, 0.0, 0.3]}
        for person, points in shown.items():
            if person == 2 and number > FRAMES / 2:
                continue
            moment = [float(1000 * time), 100 + person]
            if long:
                rows += [[*moment, NAMES[k], *map(float, points[k])] for k in range(len(NAMES))]
            else:
                rows.append([*moment, *map(float, points.ravel())])
    (tmp_path / "a.csv").write_text(table(header, rows))
    truth = leg_angles(walk(FRAMES).joints, times=TIMES)
    for name, found in angles(tmp_path / "a.csv").items():
        assert np.degrees(np.abs(found - truth[name])).max() < 0.1
    (defect,) = recognise.read(tmp_path / "a.csv").provenance["reading"]["defects"]
    assert (defect["rule"], defect["count"]) == ("several_people", 1)
    assert "body 101 is seen in most" in defect["text"]


def test_one_person_among_rows_of_zeros_for_everybody_else(tmp_path: Path) -> None:
    """Six bodies in every frame, as an SDK has them; no two rows of one have the same time."""
    rows = [
        [float(1000 * time), body, *map(float, points.ravel() * (body == 3))]
        for time, points in zip(TIMES, POINTS, strict=True)
        for body in range(6)
    ]
    (tmp_path / "a.csv").write_text(table(["timestamp", "BodyIndex", *AXES], rows))
    assert len(recognise.read(tmp_path / "a.csv").times) == FRAMES
    truth = leg_angles(walk(FRAMES).joints, times=TIMES)
    for name, found in angles(tmp_path / "a.csv").items():
        assert np.degrees(np.abs(found - truth[name])).max() < 0.1


@pytest.mark.parametrize("nothing", ["0", "", "NaN"])
def test_somebody_who_comes_late(nothing: str, tmp_path: Path) -> None:
    """After more rows than a draft looks at."""
    early = [[k / 30.0, *[nothing] * len(AXES)] for k in range(2500)]
    late = [[2500 / 30.0 + row[0], *row[1:]] for row in wide()]  # type: ignore[operator]
    (tmp_path / "a.csv").write_text(table(["Time", *AXES], [*early, *late]))
    truth = leg_angles(walk(FRAMES).joints, times=TIMES)
    for name, found in angles(tmp_path / "a.csv").items():
        assert np.degrees(np.abs(found - truth[name])).max() < 0.1


@pytest.mark.parametrize("order", [name for name in ORDERS if "Ni" in name or "NI" in name])
def test_fifteen_joints_without_names(order: str, tmp_path: Path) -> None:
    """OpenNI's joints in millimetres, in the four orders in which data sets list them."""
    points = POINTS[:, [NODE_INDEX[node] for node in ORDERS[order]]]
    (tmp_path / "a.txt").write_text(table([], wide(1000 * points, scale=1000), " "))
    truth = leg_angles(walk(FRAMES).joints, times=TIMES)
    for name, found in angles(tmp_path / "a.txt").items():
        assert np.degrees(np.abs(found - truth[name])).max() < (0.1 if "knee" in name else 15.0), name


@pytest.mark.parametrize(
    ("name", "step", "seconds"),
    [("time", 5, 0.005), ("frame", 30, 1.0), ("stamp", 33, 0.033), ("no", 2, 2 / 30)],
)
def test_whole_numbers_are_what_their_name_says(name: str, step: int, seconds: float, tmp_path: Path) -> None:
    rows = [[step * k, *row[1:]] for k, row in enumerate(wide())]
    (tmp_path / "a.csv").write_text(table([name, *AXES], rows))
    assert np.diff(recognise.read(tmp_path / "a.csv").times) == pytest.approx(seconds)


def test_left_handed_axes_are_told(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(LAYOUTS["left-handed"]())
    (defect,) = recognise.read(tmp_path / "a.csv").provenance["reading"]["defects"]
    assert (defect["rule"], defect["action"]) == ("mirrored", "repaired")


@pytest.mark.parametrize("points", [POINTS, POINTS * [1, -1, -1], walk(FRAMES).joints])
def test_up_without_a_head_and_a_pelvis(points: Array, tmp_path: Path) -> None:
    """As of networks that find joints in pictures; axes that point down are not left-handed ones."""
    kept = [k for k, name in enumerate(NAMES) if name not in ("Head", "HipCenter", "Spine", "ShoulderCenter")]
    header = ["Time", *(f"{NAMES[k]}_{axis}" for k in kept for axis in "XYZ")]
    (tmp_path / "a.csv").write_text(table(header, wide(points[:, kept])))
    clip = recognise.read(tmp_path / "a.csv")
    assert clip.provenance["reading"]["defects"] == []
    found, truth = to_nodes(clip)[0], walk(FRAMES).joints
    for bone in (("hip_left", "shoulder_left"), ("hip_right", "hip_left"), ("ankle_left", "foot_left")):
        start, end = (NODE_INDEX[node] for node in bone)
        assert found[:, end] - found[:, start] == pytest.approx(truth[:, end] - truth[:, start], abs=2e-6)


@pytest.mark.parametrize("joints", [20, 25])
@pytest.mark.parametrize("state", [False, True])
def test_milliseconds_are_neither_frame_numbers_nor_ticks(joints: int, state: bool, tmp_path: Path) -> None:
    """Of tables that are as wide as those of UTKinect and KinectReader."""
    points = POINTS if joints == 20 else y_up(kinect_v2_joints(walk(FRAMES)))
    if state:
        points = np.concatenate([points, np.full((*points.shape[:2], 1), 2.0)], axis=-1)
    rows = [[round(1000 * time), *map(float, p.ravel())] for time, p in zip(TIMES, points, strict=True)]
    (tmp_path / "a.csv").write_text(table([], rows))
    assert recognise.read(tmp_path / "a.csv").times[-1] == pytest.approx(TIMES[-1], abs=2e-3)


@pytest.mark.parametrize("lacking", ["KneeLeft", "AnkleRight"])
def test_without_a_leg_a_table_is_no_capture(lacking: str, tmp_path: Path) -> None:
    kept = [k for k, name in enumerate(AXES) if not name.startswith(lacking)]
    rows = [[row[0], *(row[1 + k] for k in kept)] for row in wide()]
    (tmp_path / "a.csv").write_text(table(["Time", *(AXES[k] for k in kept)], rows))
    with pytest.raises(CaptureError, match="describe its columns"):
        recognise.read(tmp_path / "a.csv")


def test_joints_that_lack_rows(tmp_path: Path) -> None:
    """Unity's scripts for Kinects leave out joints that are not tracked, and misspell a name."""
    rows = [row for number, row in enumerate(by_joint()) if row[2] != "HandLeft" or number % 3]
    header = ["time", "joint", "pos_x", "pos_y", "poz_z"]
    (tmp_path / "a.csv").write_text(table(header, [[row[0], *row[2:]] for row in rows]))
    hand = NAMES.index("HandLeft")
    assert 0.2 < np.mean(recognise.read(tmp_path / "a.csv").states[:, hand] == 0) < 0.5
    assert len(angles(tmp_path / "a.csv")["knee_left"]) == FRAMES


def test_a_damaged_row_is_named(tmp_path: Path) -> None:
    rows = wide()
    rows[7][5] = "oops"
    (tmp_path / "a.csv").write_text(table(["Time", *AXES], rows))
    assert len(recognise.read(tmp_path / "a.csv").times) == FRAMES  # a mark of a missing value
    rows = wide()
    rows[9][0] = "1e300"
    (tmp_path / "a.csv").write_text(table(["Time", *AXES], rows))
    with pytest.raises(CaptureError, match=r"line 11: expected a time, found 1e\+300"):
        recognise.read(tmp_path / "a.csv")
    (tmp_path / "a.csv").write_text(table(["Time", *AXES], [*wide()[:-1], wide()[-1][:9]]))
    with pytest.raises(CaptureError, match=f"line {FRAMES + 1}: expected 61 columns, found 9"):
        recognise.read(tmp_path / "a.csv")


@pytest.mark.parametrize(
    "times", [[f"{k} min" for k in range(FRAMES)], [float(k // 30) for k in range(FRAMES)]]
)
def test_times_that_are_not_understood_are_flagged(tmp_path: Path, times: Sequence[object]) -> None:
    """Before, such a file was said to have no times."""
    path = tmp_path / "walk.csv"
    path.write_text(
        table(["timestamp", *AXES], [[t, *row[1:]] for t, row in zip(times, wide(), strict=True)])
    )
    clip = recognise.read(path)
    (found,) = (one for one in clip.provenance["reading"]["defects"] if one["rule"] == "wrong_rate")
    assert found["action"] == "flagged"
    assert "the times in the column 'timestamp' are not understood: 30 Hz assumed" in found["text"]
    path.write_text(table(["timestamp", *AXES], [["", *row[1:]] for row in wide()]))
    assert recognise.read(path).provenance["reading"]["defects"] == []
