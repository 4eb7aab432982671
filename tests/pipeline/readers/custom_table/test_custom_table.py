"""Custom tables: layouts written from the known walk, damage, and which description applies."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from msgspec import inspect
from peers.custom_table import FRAMES, NODE_LIST, UNITY, joints, read, table, unity
from samples.custom_table import files
from samples.motion import walk, y_up

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.custom_table.description_file import File, _Joint


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
    assert set(clip.provenance["sidecar_files"]) == {"aufnahme.toml"}
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


@pytest.mark.parametrize("by", ["frame", "time", "date", "joint"])
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
    if by == "date":
        description = description.replace("rate = 30", 'column = "t"\nunit = "date"')
        cells = [line.split(",") for line in lines[1:]]
        lines[1:] = [",".join([c[0], f"2024-05-03 23:59:{float(c[1]) + 10:09.6f}", *c[2:]]) for c in cells]
        lines[-1] = lines[-1].replace("2024-05-03 23", "2024-05-03T23")
    clip = read(tmp_path, "\n".join(lines), description)
    expected = joints()
    expected[5, NODE_INDEX["knee_left"]] = np.nan
    assert clip.positions == pytest.approx(expected, abs=1e-6, nan_ok=True)
    assert clip.times - clip.times[0] == pytest.approx(np.arange(FRAMES) / 30, abs=2e-6)
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
        CaptureError, match=r"expected 20 rows per frame.*found 799 rows: 1 are missing from the last frame"
    ):
        read(tmp_path, "".join(capture.splitlines(keepends=True)[:-1]), description)


def test_left_handed_axes_are_mirrored(tmp_path: Path) -> None:
    description = (
        f"kinemimic = 1\n{NODE_LIST}[columns]\nposition = [1, 2, 3]\nstep = 3\n[time]\nrate = 30\n[space]\n"
    )
    capture = table(unity(joints()).reshape(FRAMES, -1))
    clip = read(tmp_path, capture, description + UNITY)
    assert clip.positions == pytest.approx(joints(), abs=1e-6)
    assert "left-handed axes were mirrored" in clip.provenance["reading"]["notes"]
    # Without the third axis, the axes are assumed right-handed, and the walker is mirrored.
    mirrored = read(tmp_path, capture, description + 'up = "Y"\nforward = "Z"\n')
    assert mirrored.positions[..., 1] == pytest.approx(-joints()[..., 1], abs=1e-6)


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
        (BASE + 'unit = "feet"\n', "key space.unit: expected one of m, .* or a number .*, found 'feet'"),
        (BASE + "unit = -1\n", "key space.unit: expected .* a number from 1e-06 to 1000, found -1"),
        (BASE.replace("rate = 30", ""), "key time.rate: expected frames per second"),
        (BASE.replace("rate = 30", "rate = 30\ncolumn = 1"), "key time.rate: expected no rate in addition"),
        (BASE.replace("step = 3", ""), "key columns.step: expected the number of columns from"),
        (BASE.replace("[1, 2, 3]", "[1, 2]"), r"columns.position: expected a list of 3 columns, found .1"),
        (BASE.replace("[1, 2, 3]", "[0, 1, 2]"), r"key columns.position\[1\]: expected a column: .*found 0"),
        (BASE.replace("[1, 2, 3]", "['a', 'b', 'c']"), "key columns.position: expected column numbers"),
        (BASE.replace("step = 3", "step = 3\neuler = [1, 2, 3]"), "rotations.order: expected the intr.*none"),
        (BASE + "[rotations]\norder = 'xyzw'\n", "rotations.order: expected columns.quat"),
        (BASE + "[states]\ntracked_from = 1\nmissing = [0]\n", "key states.tracked_from: expected either"),
        (BASE + "[table]\nseparator = 'comma'\ndecimal = ','\n", r"key table.decimal: expected '\.'"),
        (BASE + "[table]\nencoding = 'klingon'\n", "key table.encoding: expected an encoding"),
        (BASE + "[table]\nencoding = 'punycode'\n", "key table.encoding: expected an encoding"),
        (BASE + "[table]\nencoding = 'undefined'\n", "key table.encoding: expected an encoding"),
        (BASE + '[table]\nencoding = "a\\u0000b"\n', "key table.encoding: expected an encoding"),
        (BASE + f"[table]\nmissing = [{10**400}]\n", r"key table.missing\[1\]: expected whole numbers from"),
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


@pytest.mark.parametrize("named", ["utf-16", "UTF_16_LE"])
def test_a_table_in_utf_16_may_say_so(tmp_path: Path, named: str) -> None:
    rows = table(y_up(joints()).reshape(FRAMES, -1))
    same = read(tmp_path, rows, BASE)
    (tmp_path / "walk.csv").write_bytes(rows.encode("utf-16"))
    (tmp_path / "walk.toml").write_text(BASE + f'[table]\nencoding = "{named}"\n')
    assert np.array_equal(recognise.read(tmp_path / "walk.csv").positions, same.positions)


@pytest.mark.parametrize(("encoding", "half"), [("utf-7", "+2AA-"), ("unicode_escape", "\\ud800")])
def test_half_a_surrogate_pair_is_refused(tmp_path: Path, encoding: str, half: str) -> None:
    rows = table(y_up(joints()).reshape(FRAMES, -1)).replace("\n", f",{half}\n", 1)
    with pytest.raises(
        CaptureError, match=f"expected text in {encoding}, found other bytes; see table.encoding in walk.toml"
    ):
        read(tmp_path, rows, BASE + f'[table]\nencoding = "{encoding}"\n')


@pytest.mark.parametrize(
    ("joints", "message"),
    [
        ('a = { parent = "b" }\nb = { parent = "a" }\n', "key joints: expected one joint without a parent"),
        ('a = { parent = "" }\nb = { parent = "c" }\nc = { parent = "b" }\n', "joints.b.parent: .*a cycle"),
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
def test_captures_that_contradict_their_description(tmp_path: Path, old: str, new: str, message: str) -> None:
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
    with pytest.raises(CaptureError, match=r"line 8: expected 81 columns, found \d+, the file is cut off"):
        recognise.read(tmp_path / "aufnahme.csv")
    (tmp_path / "aufnahme.csv").write_bytes(contents["aufnahme.csv"])
    (tmp_path / "aufnahme.toml").write_text(contents["aufnahme.toml"].decode().replace('"ms"', '"s"'))
    with pytest.raises(
        CaptureError, match=r"expected steps of 0.0002 to 2 s, found a median of 33.*time.unit"
    ):
        recognise.read(tmp_path / "aufnahme.csv")
    (tmp_path / "aufnahme.toml").write_text(contents["aufnahme.toml"].decode().replace('"mm"', '"m"'))
    with pytest.raises(CaptureError, match=r"line 3: expected at most 1000 m, found \d+.* m;.*space.unit"):
        recognise.read(tmp_path / "aufnahme.csv")


def test_which_description_applies(tmp_path: Path) -> None:
    contents = files(6)
    capture, description = contents["aufnahme.csv"], contents["aufnahme.toml"].decode()
    for name in ("a.csv", "b.txt", "remarks.md"):
        (tmp_path / name).write_bytes(capture)
    assert recognise.read(tmp_path / "a.csv").provenance["format"] == "joint table"
    # Another program's TOML file is ignored, and not in the provenance.
    (tmp_path / "a.toml").write_text('[project]\nname = "kinemimic"\n')
    undescribed = recognise.read(tmp_path / "a.csv").provenance
    assert (undescribed["format"], undescribed["sidecar_files"]) == ("joint table", {})
    (tmp_path / "capture.toml").write_text(
        description.replace("kinemimic = 1", 'kinemimic = 1\nfiles = ["*.csv", "*.txt"]')
    )
    assert set(recognise.read(tmp_path / "a.csv").provenance["sidecar_files"]) == {"capture.toml"}
    assert len(recognise.read(tmp_path / "b.txt").times) == 6
    assert recognise.read(tmp_path / "remarks.md").provenance["format"] == "joint table"
    # The file's own description takes precedence over the folder's.
    (tmp_path / "b.toml").write_text(description.replace('"mm"', '"cm"').replace("[time]", "[time]\nx = 1"))
    with pytest.raises(CaptureError, match=r"b\.toml, key time\.x"):
        recognise.read(tmp_path / "b.txt")
    with pytest.raises(CaptureError, match=r"capture\.toml: expected a capture, found a description of one"):
        recognise.read(tmp_path / "capture.toml")


DOCUMENT = Path(__file__).parents[4] / "docs" / "describe-your-columns.md"


def test_the_examples_of_the_documentation_are_valid(tmp_path: Path) -> None:
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


def test_every_key_is_documented() -> None:
    keys: set[str] = set()
    for field in inspect.type_info(File).fields:  # type: ignore[attr-defined]
        types = getattr(field.type, "types", (field.type,))
        within = [one for kind in types for one in getattr(kind, "fields", ())]
        keys |= {f"{field.encode_name}.{one.encode_name}" for one in within} or {field.encode_name}
    joint = inspect.type_info(_Joint).fields  # type: ignore[attr-defined]
    keys |= {f"joints.NAME.{field.encode_name}" for field in joint}
    documented = set(re.findall(r"`([a-z]+(?:\.[A-Za-z_.]+)?)`", DOCUMENT.read_text()))
    tables = {key.split(".")[0] for key in keys if "." in key}
    assert keys <= documented
    assert {key for key in documented if "." in key and key.split(".")[0] in tables} <= keys
