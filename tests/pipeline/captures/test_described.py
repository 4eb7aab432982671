"""Captures read by a description: layouts written from the known walk, damage, and where descriptions lie."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from samples.described import files
from samples.motion import walk, y_up
from scipy.spatial.transform import Rotation

from kinemimic.pipeline.captures import recognise
from kinemimic.pipeline.captures.description_file import parse
from kinemimic.pipeline.captures.toml_keys import Keys
from kinemimic.pipeline.clip import Clip
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.euler import local_rotations, world_positions
from kinemimic.pipeline.rotations import angle_between, conjugate, multiply
from kinemimic.pipeline.skeleton import NODE_INDEX, NODES

Array = NDArray[np.float64]
FRAMES = 40
NODE_LIST = "joints = [" + ", ".join(f'"{node}"' for node in NODES) + "]\n"


def table(rows: Array, separator: str = ",", decimals: int = 6) -> str:
    return "".join(separator.join(f"{v:.{decimals}f}" for v in row) + "\n" for row in rows)


def read(folder: Path, capture: str, description: str) -> Clip:
    (folder / "walk.csv").write_text(capture)
    (folder / "walk.toml").write_text(description)
    return recognise.read(folder / "walk.csv")


def joints() -> Array:
    return walk(FRAMES).joints


def test_the_sample(tmp_path: Path) -> None:
    for name, content in files(FRAMES).items():
        (tmp_path / name).write_bytes(content)
    clip = recognise.read(tmp_path / "aufnahme.csv")
    assert clip.skeleton.names == NODES
    lost = np.zeros((FRAMES, 20), dtype=bool)
    lost[3::10, NODE_INDEX["hand_left"]] = True
    assert np.array_equal(np.isnan(clip.positions[..., 0]), lost)
    assert np.nanmax(np.abs(clip.positions - joints())) < 1e-6
    assert np.array_equal(clip.states == 0, lost)
    assert (clip.states[:, NODE_INDEX["foot_right"]] == 1).all()
    assert (clip.states[:, NODE_INDEX["head"]] == 2).all()
    assert clip.times == pytest.approx(walk(FRAMES).times, abs=1e-5)
    assert set(clip.provenance["companions"]) == {"aufnahme.toml"}
    assert clip.provenance["reading"]["units"] == "mm"


def test_column_numbers_and_a_rate(tmp_path: Path) -> None:
    rows = np.hstack([np.full((FRAMES, 2), 7.0), y_up(joints()).reshape(FRAMES, -1)])
    clip = read(
        tmp_path,
        "# a remark\n" + table(rows, " "),
        f"kinemimic = 1\n{NODE_LIST}[table]\ncomment = '#'\n[columns]\nposition = [3, 4, 5]\nstep = 3\n"
        "[time]\nrate = 30\n",
    )
    assert clip.positions == pytest.approx(joints(), abs=1e-6)
    assert clip.times == pytest.approx(np.arange(FRAMES) / 30)


@pytest.mark.parametrize("by", ["frame", "time", "joint"])
def test_a_row_for_each_joint(tmp_path: Path, by: str) -> None:
    order = [*reversed(NODES)]
    lines = ["frame,t,joint,x,y,z,confidence"]
    for frame, places in enumerate(y_up(joints())):
        for node in order:
            if (frame, node) == (5, "knee_left"):
                continue
            x, y, z = places[NODE_INDEX[node]]
            sure = 0.2 if node == "hand_right" else 0.9
            lines.append(f"{frame},{frame / 30:.6f},{node},{x:.6f},{y:.6f},{z:.6f},{sure}")
        lines.append(f"{frame},{frame / 30:.6f},a fly,0,0,0,1")
    description = (
        f'kinemimic = 1\n{NODE_LIST}[table]\nheader = 1\nrows = "joint"\n[columns]\njoint = "joint"\n'
        + ('frame = "frame"\n' if by == "frame" else "")
        + 'position = ["x", "y", "z"]\nstate = "confidence"\n'
        + "[states]\ninferred_from = 0.1\ntracked_from = 0.5\n"
        + ('[time]\ncolumn = "t"\n' if by == "time" else "[time]\nrate = 30\n")
    )
    clip = read(tmp_path, "\n".join(lines), description)
    expected = joints()
    expected[5, NODE_INDEX["knee_left"]] = np.nan
    assert clip.positions == pytest.approx(expected, abs=1e-6, nan_ok=True)
    assert clip.times == pytest.approx(np.arange(FRAMES) / 30, abs=1e-6)
    assert clip.states[5, NODE_INDEX["knee_left"]] == 0
    assert (clip.states[:, NODE_INDEX["hand_right"]] == 1).all()


def test_rows_of_joints_without_names(tmp_path: Path) -> None:
    description = (
        f'kinemimic = 1\n{NODE_LIST}[table]\nrows = "joint"\n[columns]\nposition = [1, 2, 3]\n'
        "[time]\nrate = 30\n"
    )
    capture = table(y_up(joints()).reshape(-1, 3))
    assert read(tmp_path, capture, description).positions == pytest.approx(joints(), abs=1e-6)
    with pytest.raises(
        CaptureError, match=r"expected 20 rows a frame.*found 799 rows: the last frame lacks 1"
    ):
        read(tmp_path, "".join(capture.splitlines(keepends=True)[:-1]), description)


# Right, up, forward as Unity has them: a left-handed system. Our left is its -X.
UNITY = 'up = "Y"\nforward = "Z"\nleft = "-X"\n'


def unity(points: Array) -> Array:
    return np.stack([-points[..., 1], points[..., 2], points[..., 0]], axis=-1)


def test_left_handed_axes_are_mirrored(tmp_path: Path) -> None:
    description = (
        f"kinemimic = 1\n{NODE_LIST}[columns]\nposition = [1, 2, 3]\nstep = 3\n[time]\nrate = 30\n[space]\n"
    )
    capture = table(unity(joints()).reshape(FRAMES, -1))
    clip = read(tmp_path, capture, description + UNITY)
    assert clip.positions == pytest.approx(joints(), abs=1e-6)
    assert "left-handed axes, mirrored" in clip.provenance["reading"]["notes"]
    # Without a word about the third axis, the axes are right-handed, and this walker is his mirror image.
    mirrored = read(tmp_path, capture, description + 'up = "Y"\nforward = "Z"\n')
    assert mirrored.positions[..., 1] == pytest.approx(-joints()[..., 1], abs=1e-6)


LIMB = ("pelvis", "thigh", "shank")
OFFSETS = np.array([[0.0, 0.0, 0.0], [0.0, -0.1, 0.09], [0.02, -0.44, 0.0]])


def turning(order: str) -> tuple[Array, Array, Array]:
    """Euler angles in degrees (T, 3, 3), world matrices (T, 3, 3, 3), root (T, 3) of three joints."""
    t = np.linspace(0.0, 1.0, FRAMES)[:, None, None]
    degrees = np.array([[40.0, 25.0, -30.0], [60.0, -35.0, 20.0], [-70.0, 10.0, 15.0]]) * np.sin(
        3.0 * t + 0.4
    )
    local = Rotation.from_euler(order, degrees.reshape(-1, 3), degrees=True).as_matrix().reshape(-1, 3, 3, 3)
    world = local.copy()
    for joint in (1, 2):
        world[:, joint] = world[:, joint - 1] @ local[:, joint]
    root = np.stack([t[:, 0, 0], 0.9 + 0.1 * t[:, 0, 0], 2.0 - t[:, 0, 0]], axis=-1)
    return degrees, world, root


def positions_of(world: Array, root: Array) -> Array:
    places = [root]
    for joint in (1, 2):
        places.append(places[-1] + world[:, joint - 1] @ OFFSETS[joint])
    return np.stack(places, axis=1)


def limb(columns: Sequence[str]) -> str:
    offsets = {name: f"offset = {offset.tolist()}, " for name, offset in zip(LIMB, OFFSETS, strict=True)}
    offsets["pelvis"] = "position = [1, 2, 3], "
    parents = {"pelvis": "", "thigh": "pelvis", "shank": "thigh"}
    lines = [
        f'{name} = {{ {offsets[name]}parent = "{parents[name]}", {column} }}\n'
        for name, column in zip(LIMB, columns, strict=True)
    ]
    return "[joints]\n" + "".join(lines)


@pytest.mark.parametrize("order", ["ZXY", "XYZ", "YXY"])
def test_euler_angles_and_offsets(tmp_path: Path, order: str) -> None:
    degrees, world, root = turning(order)
    rows = np.hstack([root, degrees.reshape(FRAMES, -1)])
    description = f'kinemimic = 1\n[time]\nrate = 30\n[rotations]\norder = "{order}"\n' + limb(
        [f"euler = [{4 + 3 * k}, {5 + 3 * k}, {6 + 3 * k}]" for k in range(3)]
    )
    clip = read(tmp_path, table(rows, decimals=9), description)
    assert clip.orders == (order,) * 3
    assert clip.euler == pytest.approx(np.radians(degrees), abs=1e-9)
    # Y up, Z forward, X left to ours.
    expected = positions_of(world, root)[..., [2, 0, 1]]
    assert clip.positions == pytest.approx(expected, abs=1e-8)
    assert clip.translations is not None and clip.euler is not None
    rotations = local_rotations(clip.euler, clip.orders or (), clip.world_from_file)
    again = world_positions(clip.skeleton, clip.translations, rotations, clip.world_from_file)
    assert again == pytest.approx(clip.positions, abs=1e-9)


@pytest.mark.parametrize("order", ["wxyz", "xyzw"])
@pytest.mark.parametrize("relative", ["parent", "world"])
def test_quaternions_in_either_order_and_frame(tmp_path: Path, order: str, relative: str) -> None:
    _, world, root = turning("ZXY")
    absolute = Rotation.from_matrix(world.reshape(-1, 3, 3)).as_quat().reshape(FRAMES, 3, 4)
    local = absolute.copy()
    for joint in (1, 2):
        local[:, joint] = multiply(conjugate(absolute[:, joint - 1]), absolute[:, joint])
    written = absolute if relative == "world" else local
    written = written[..., [3, 0, 1, 2]] if order == "wxyz" else written
    rows = np.hstack([root, written.reshape(FRAMES, -1)])
    description = (
        f'kinemimic = 1\n[time]\nrate = 30\n[rotations]\norder = "{order}"\nrelative_to = "{relative}"\n'
        + limb([f"quaternion = [{4 + 4 * k}, {5 + 4 * k}, {6 + 4 * k}, {7 + 4 * k}]" for k in range(3)])
    )
    clip = read(tmp_path, table(rows, decimals=9), description)
    assert clip.rotations is not None and clip.euler is None
    assert angle_between(clip.rotations[:, 1:], local[:, 1:]).max() < 1e-7
    assert angle_between(clip.rotations[:, 0], multiply(clip.world_from_file, local[:, 0])).max() < 1e-7
    assert clip.positions == pytest.approx(positions_of(world, root)[..., [2, 0, 1]], abs=1e-7)
    assert (np.sum(clip.rotations[1:] * clip.rotations[:-1], axis=-1) >= 0).all()


def test_left_handed_rotations_give_the_same_motion(tmp_path: Path) -> None:
    """Mirroring x in a right-handed motion M R M gives the numbers that Unity would write."""
    degrees, world, root = turning("ZXY")
    mirror = np.diag([-1.0, 1.0, 1.0])
    left = mirror @ world @ mirror
    local = left.copy()
    for joint in (1, 2):
        local[:, joint] = left[:, joint - 1].swapaxes(1, 2) @ left[:, joint]
    angles = Rotation.from_matrix(local.reshape(-1, 3, 3)).as_euler("ZXY", degrees=True).reshape(FRAMES, 9)
    quats = Rotation.from_matrix(local.reshape(-1, 3, 3)).as_quat().reshape(FRAMES, 12)
    flipped = OFFSETS * [-1.0, 1.0, 1.0]
    for kind, width, values, order in (("euler", 3, angles, "ZXY"), ("quaternion", 4, quats, "xyzw")):
        columns = [f"{kind} = {[4 + width * k + i for i in range(width)]}" for k in range(3)]
        text = limb(columns)
        for offset, other in zip(OFFSETS, flipped, strict=True):
            text = text.replace(f"offset = {offset.tolist()}", f"offset = {other.tolist()}")
        description = (
            f'kinemimic = 1\n[time]\nrate = 30\n[rotations]\norder = "{order}"\n[space]\n{UNITY}{text}'
        )
        rows = np.hstack([root * [-1.0, 1.0, 1.0], values])
        clip = read(tmp_path, table(rows, decimals=9), description)
        assert clip.positions == pytest.approx(positions_of(world, root)[..., [2, 0, 1]], abs=1e-7), kind
        if clip.euler is not None:
            assert clip.euler == pytest.approx(np.radians(degrees), abs=1e-7)


def test_positions_in_the_parents_frame(tmp_path: Path) -> None:
    """UI-PRMD's layout: every joint's place in its parent's frame, in columns, beside Euler angles."""
    degrees, world, root = turning("ZXY")
    places = np.broadcast_to(100.0 * OFFSETS, (FRAMES, 3, 3)).copy()
    places[:, 0] = 100.0 * root
    rows = np.concatenate([places, degrees], axis=-1).reshape(FRAMES, -1)
    description = (
        'kinemimic = 1\n[time]\nrate = 30\n[rotations]\norder = "ZXY"\n[space]\nunit = "cm"\n'
        'relative_to = "parent"\n[columns]\nposition = [1, 2, 3]\neuler = [4, 5, 6]\nstep = 6\n'
        '[joints]\npelvis = { parent = "" }\nthigh = { parent = "pelvis" }\nshank = { parent = "thigh" }\n'
    )
    clip = read(tmp_path, table(rows, decimals=9), description)
    assert clip.positions == pytest.approx(positions_of(world, root)[..., [2, 0, 1]], abs=1e-9)


def test_a_missing_quaternion_is_nan_and_one_that_is_none_is_refused(tmp_path: Path) -> None:
    rows = np.tile([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], (4, 3))
    rows[2, 10:14] = 0.0
    description = (
        "kinemimic = 1\n[time]\nrate = 30\n[columns]\n"
        "position = [1, 2, 3]\nquaternion = [4, 5, 6, 7]\nstep = 7\n"
        '[joints]\na = { parent = "" }\nb = { parent = "a" }\nc = { parent = "b" }\n'
    )
    clip = read(tmp_path, table(rows), description)
    assert clip.rotations is not None
    assert np.isnan(clip.rotations[2, 1]).all() and np.isfinite(clip.rotations[2, 0]).all()
    rows[:, 3:7] *= 37.0
    rows[:, 10:14] *= 37.0
    with pytest.raises(CaptureError, match=r"whose length is 1, found a usual length of 37"):
        read(tmp_path, table(rows), description)


def test_repeated_times_are_dropped_and_counted(tmp_path: Path) -> None:
    rows = np.hstack([np.arange(FRAMES)[:, None] / 30, y_up(joints()).reshape(FRAMES, -1)])
    rows = np.insert(rows, 7, rows[6], axis=0)
    description = f"kinemimic = 1\n{NODE_LIST}[columns]\nposition = [2, 3, 4]\nstep = 3\n[time]\ncolumn = 1\n"
    clip = read(tmp_path, table(rows), description)
    (defect,) = clip.provenance["reading"]["defects"]
    assert (defect["rule"], defect["count"]) == ("duplicate_frames", 1)
    assert clip.positions == pytest.approx(joints(), abs=1e-6)


BASE = (
    f"kinemimic = 1\n{NODE_LIST}[columns]\nposition = [1, 2, 3]\nstep = 3\n"
    '[time]\nrate = 30\n[space]\nup = "Y"\n'
)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (BASE.replace("= 1\n", "= 2\n", 1), "key kinemimic: expected 1, the version .*found 2"),
        (BASE + "forwards = 1\n", "key space.forwards: expected one of unit, up.*did you mean 'forward'"),
        (BASE + "[colums]\n", "key colums: .*did you mean 'columns'"),
        (BASE.replace('up = "Y"', 'up = "Z"'), "key space.forward: expected another axis than space.up"),
        (BASE.replace('"Y"', '"north"'), "key space.up: expected X, Y or Z"),
        (BASE + 'left = "Z"\n', "key space.left: expected the third axis, found 'Z'"),
        (BASE + 'unit = "feet"\n', "key space.unit: expected one of m, cm, mm, inch, found 'feet'"),
        (BASE + "unit = -1\n", "key space.unit: expected a number from 1e-06 to 1000, found -1"),
        (BASE.replace("rate = 30", ""), "key time.rate: expected frames per second"),
        (BASE.replace("rate = 30", "rate = 30\ncolumn = 1"), "key time.rate: expected no rate beside"),
        (BASE.replace("step = 3", ""), "key columns.step: expected how many columns further"),
        (BASE.replace("[1, 2, 3]", "[1, 2]"), "key columns.position: expected a list of 3 columns, found 2"),
        (BASE.replace("[1, 2, 3]", "[0, 1, 2]"), "key columns.position: expected a column: .*found 0"),
        (BASE.replace("[1, 2, 3]", "['a', 'b', 'c']"), "key columns.position: expected column numbers"),
        (BASE.replace("step = 3", "step = 3\neuler = [1, 2, 3]"), "rotations.order: expected the intr.*none"),
        (BASE + "[rotations]\norder = 'xyzw'\n", "rotations.order: expected columns.quat"),
        (BASE + "[states]\ntracked_from = 1\nmissing = [0]\n", "key states.tracked_from: expected either"),
        (BASE + "[table]\nseparator = 'comma'\ndecimal = ','\n", r"key table.decimal: expected '\.'"),
        (BASE + "[table]\nencoding = 'klingon'\n", "key table.encoding: expected an encoding"),
        (BASE + "[table]\nheader = 3\nfirst_row = 2\n", "table.first_row: expected a whole number from 4"),
        (BASE.replace("step = 3", "step = 3\njoint = 1"), "columns.joint: expected table.rows ="),
        (BASE.replace(NODE_LIST, ""), "key joints: expected a list or a table of joints, found none"),
        (BASE.replace(NODE_LIST, "joints = ['a', 'a']\n"), "key joints: expected names in quotes, each once"),
        (BASE + "[joints.x]\n", "expected TOML, found"),
        ("kinemimic = 1\n[", "expected TOML, found"),
    ],
)  # fmt: skip
def test_mistakes_in_a_description_name_their_key(tmp_path: Path, wrong: str, message: str) -> None:
    with pytest.raises(CaptureError, match=rf"walk\.toml.*{message}") as caught:
        read(tmp_path, table(y_up(joints()).reshape(FRAMES, -1)), wrong)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("joints", "message"),
    [
        ('a = { parent = "b" }\nb = { parent = "a" }\n', "key joints: expected one joint without a parent"),
        ('a = { parent = "" }\nb = { parent = "c" }\nc = { parent = "b" }\n', "joints.b.parent: .*a ring"),
        ('a = { parent = "x" }\n', "joints.a.parent: expected the name of another joint, found 'x'"),
        ("a = 7\n", "key joints.a: expected the joint's name in the file, or a table"),
        ("a = { positon = [1, 2, 3] }\n", "key joints.a.positon: .*did you mean 'position'"),
    ],
)
def test_mistakes_in_the_tree(tmp_path: Path, joints: str, message: str) -> None:
    description = (
        f"kinemimic = 1\n[columns]\nposition = [1, 2, 3]\nstep = 3\n[time]\nrate = 30\n[joints]\n{joints}"
    )
    with pytest.raises(CaptureError, match=message):
        read(tmp_path, table(np.ones((5, 9))), description)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("gut", "prima", r"aufnahme.csv, line 3: expected a state of hip_center, found 'prima'"),
        ("Becken x", "Becken X", r"line 2: expected a column 'Becken x', found none of that name, but"),
        ("Becken x", "Becken y", r"line 2: expected a column 'Becken x', found none"),
        ("Bauch x", "Becken x", r"line 2: expected a column 'Becken x', found 2 of that name"),
        (";-9999;", ";weg;", r"line 6: expected a number in column 'Hand L .', found 'weg'.*table.missing"),
        ("33,33;", "33,33;0;", r"line 4: expected 81 columns, found 82"),
        ("33,33;", "", r"line 4: expected 81 columns, found 80"),
        ("33,33;", ";", r"line 4: expected a time, found none"),
    ],
)  # fmt: skip
def test_captures_that_are_not_as_described(tmp_path: Path, old: str, new: str, message: str) -> None:
    contents = files(6)
    capture = contents["aufnahme.csv"].decode()
    assert old in capture
    (tmp_path / "aufnahme.csv").write_text(capture.replace(old, new, 1))
    (tmp_path / "aufnahme.toml").write_bytes(contents["aufnahme.toml"])
    with pytest.raises(CaptureError, match=message) as caught:
        recognise.read(tmp_path / "aufnahme.csv")
    assert "\n" not in str(caught.value)


def test_a_cut_off_file_and_wrong_units(tmp_path: Path) -> None:
    contents = files(6)
    (tmp_path / "aufnahme.csv").write_bytes(contents["aufnahme.csv"][:-300])
    (tmp_path / "aufnahme.toml").write_bytes(contents["aufnahme.toml"])
    with pytest.raises(CaptureError, match=r"line 8: expected 81 columns, found \d+, as the file is cut off"):
        recognise.read(tmp_path / "aufnahme.csv")
    (tmp_path / "aufnahme.csv").write_bytes(contents["aufnahme.csv"])
    (tmp_path / "aufnahme.toml").write_text(contents["aufnahme.toml"].decode().replace('"ms"', '"s"'))
    with pytest.raises(CaptureError, match=r"expected steps of 0.0002 to 2 s, found usually 33.*time.unit"):
        recognise.read(tmp_path / "aufnahme.csv")
    (tmp_path / "aufnahme.toml").write_text(contents["aufnahme.toml"].decode().replace('"mm"', '"m"'))
    with pytest.raises(CaptureError, match=r"line 3: expected at most 1000 m, found \d+.* m;.*space.unit"):
        recognise.read(tmp_path / "aufnahme.csv")


def test_where_descriptions_lie(tmp_path: Path) -> None:
    contents = files(6)
    capture, description = contents["aufnahme.csv"], contents["aufnahme.toml"].decode()
    for name in ("a.csv", "b.txt", "remarks.md"):
        (tmp_path / name).write_bytes(capture)
    with pytest.raises(CaptureError, match="expected a capture"):
        recognise.read(tmp_path / "a.csv")
    # Another program's file is none of ours, and stays out of the provenance.
    (tmp_path / "a.toml").write_text('[project]\nname = "kinemimic"\n')
    with pytest.raises(CaptureError, match="expected a capture"):
        recognise.read(tmp_path / "a.csv")
    (tmp_path / "capture.toml").write_text(
        description.replace("kinemimic = 1", 'kinemimic = 1\nfiles = ["*.csv", "*.txt"]')
    )
    assert set(recognise.read(tmp_path / "a.csv").provenance["companions"]) == {"capture.toml"}
    assert len(recognise.read(tmp_path / "b.txt").times) == 6
    with pytest.raises(CaptureError, match="expected a capture, found text"):
        recognise.read(tmp_path / "remarks.md")
    # The file's own goes before the folder's.
    (tmp_path / "b.toml").write_text(description.replace('"mm"', '"cm"').replace("[time]", "[time]\nx = 1"))
    with pytest.raises(CaptureError, match=r"b\.toml, key time\.x"):
        recognise.read(tmp_path / "b.txt")
    with pytest.raises(CaptureError, match=r"capture\.toml: expected a capture, found a description of one"):
        recognise.read(tmp_path / "capture.toml")


DOCUMENT = Path(__file__).parents[3] / "docs" / "describe-your-columns.md"


def test_the_documents_examples_are_true(tmp_path: Path) -> None:
    """The first describes the sample under English names; the second a table without a header."""
    named, numbered, _ = (part.split("```")[0] for part in DOCUMENT.read_text().split("```toml\n")[1:])
    text = files(FRAMES)["aufnahme.csv"].decode()
    english = {
        "Zeit": "Time", "Becken": "Pelvis", "Bauch": "Belly", "Brust": "Chest", "Kopf": "Head", "gut": "good",
        "weg": "lost", "unsicher": "doubtful",
    }  # fmt: skip
    for old, new in english.items():
        text = text.replace(old, new)
    limbs = ("Schulter", "Ellbogen", "Handgelenk", "Hand", "Huefte", "Knie", "Knoechel", "Fuss")
    parts = ("shoulder", "elbow", "wrist", "hand", "hip", "knee", "ankle", "foot")
    for old, new in zip(limbs, parts, strict=True):
        for side in "LR":
            text = text.replace(f";{old} {side} ", f";{side} {new} ")
    clip = read(tmp_path, text, named)
    assert clip.skeleton.names == NODES
    assert np.nanmax(np.abs(clip.positions - joints())) < 1e-6
    states = np.full((FRAMES, 20, 1), 2.0)
    rows = np.concatenate([y_up(joints()), states], axis=-1).reshape(FRAMES, -1)
    clip = read(tmp_path, table(np.hstack([walk(FRAMES).times[:, None], rows])), numbered)
    assert clip.positions == pytest.approx(joints(), abs=1e-6)


def test_every_key_is_documented(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: set[str] = set()

    def get(keys: Keys, key: str) -> object:
        asked.add(keys.full(key))
        return original(keys, key)

    original = Keys.get
    monkeypatch.setattr(Keys, "get", get)
    parse(Path("x.toml"), "kinemimic = 1\n[joints]\nNAME = { position = [1, 2, 3] }\n[time]\nrate = 30\n")
    documented = set(re.findall(r"`([a-z]+(?:\.[A-Za-z_.]+)?)`", DOCUMENT.read_text()))
    tables = {"table", "columns", "time", "space", "rotations", "states"}
    assert asked - tables <= documented
    assert {key for key in documented if "." in key and key.split(".")[0] in {*tables, "joints"}} <= asked
