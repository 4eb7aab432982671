"""A draft, saved next to its file, makes the file readable, with every joint in its place."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples.motion import kinect_v2_joints, walk, y_up

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.cli.main import main
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.kinematics.orientation.from_positions import node_frames
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.custom_table.suggest import suggest
from kinemimic.pipeline.readers.custom_table.suggest_orders import ORDERS

FRAMES = 60


def drafted(folder: Path, text: str) -> tuple[Clip, str]:
    """What a file's own draft makes of it."""
    path = folder / "mine.csv"
    path.write_text(text)
    draft = suggest(Source.open(path))
    (folder / "mine.toml").write_text(draft)
    return recognise.read(path), draft


def lines(header: list[str] | None, rows: Array, separator: str = ",", decimals: int = 5) -> str:
    body = [separator.join(f"{value:.{decimals}f}" for value in row) for row in rows]
    return "\n".join([*([separator.join(header)] if header else []), *body]) + "\n"


def joints() -> Array:
    return walk(FRAMES).joints


def times(scale: float = 1.0) -> Array:
    return scale * walk(FRAMES).times[:, None]


def flat(points: Array) -> Array:
    return points.reshape(len(points), -1)


def axes(names: tuple[str, ...], pattern: str = "{}_{}", letters: str = "XYZ") -> list[str]:
    return [pattern.format(name, axis) for name in names for axis in letters]


CAMEL = tuple(node.title().replace("_", "") for node in NODES)
SPACED = tuple(
    " ".join(node.split("_") if node.endswith("center") else reversed(node.split("_"))).title()
    for node in NODES
)


def comma_in_millimetres() -> tuple[str, tuple[str, ...]]:
    """Z up, X forward, in millimetres, as most laboratories have it."""
    text = lines(["Time (s)", *axes(CAMEL)], np.hstack([times(), 1000 * flat(joints())]))
    return text, ('unit = "mm"', 'up = "Z"', 'forward = "X"', 'unit = "s"', 'column = "Time (s)"')


def decimal_commas() -> tuple[str, tuple[str, ...]]:
    text = lines(
        ["Zeit", *axes(SPACED, "{} {}", "xyz")], np.hstack([times(1000), 100 * flat(y_up(joints()))]), ";"
    ).replace(".", ",")
    return text, ('separator = "semicolon"', 'decimal = ","', 'unit = "cm"', 'unit = "ms"', 'forward = "Z"')


def dots_and_units_in_names() -> tuple[str, tuple[str, ...]]:
    header = ["frame", *axes(CAMEL, "{}.pos.{} [m]", "xyz")]
    text = "# made by hand\n" + lines(
        header, np.hstack([np.arange(FRAMES)[:, None], flat(y_up(joints()))]), "\t"
    )
    return text, ('separator = "tab"', "header = 2", 'unit = "frame"', "rate = 30.0  # please check")


def numbered_names() -> tuple[str, tuple[str, ...]]:
    header = [f"{axis}{k + 1}" for k in range(25) for axis in "XYZ"]
    text = lines(header, flat(y_up(kinect_v2_joints(walk(FRAMES)))))
    return text, ("the sequence of the Kinect v2 SDK", "header = 1", "position = [1, 2, 3]", "step = 3")


def nui_without_header() -> tuple[str, tuple[str, ...]]:
    text = lines(None, np.hstack([times(1e7), flat(y_up(joints()))]), " ")
    return text, ("the sequence of the Kinect v1 SDK", 'unit = "100ns"', "column = 1", "position = [2, 3, 4]")


def v2_with_states_without_header() -> tuple[str, tuple[str, ...]]:
    points = y_up(kinect_v2_joints(walk(FRAMES)))
    states = np.full((FRAMES, 25, 1), 2.0)
    states[:20, 19] = 1.0
    rows = np.hstack([times(1000), flat(np.concatenate([points, states], axis=-1))])
    return lines(None, rows), ("the sequence of the Kinect v2 SDK", "state = 5", "step = 4", 'unit = "ms"')


def msr_rows() -> tuple[str, tuple[str, ...]]:
    order = [NODE_INDEX[node] for node in ORDERS["MSR-Action3D"]]
    text = lines(None, y_up(joints())[:, order].reshape(-1, 3), " ")
    return text, ("the sequence of the MSR-Action3D", 'rows = "joint"', "rate = 30.0  # frames per second")


def a_row_a_joint() -> tuple[str, tuple[str, ...]]:
    rows = ["frame,t,joint,x,y,z,state"]
    for frame, places in enumerate(y_up(joints())):
        rows += [
            f"{frame},{frame / 30:.5f},{name},{x:.5f},{y:.5f},{z:.5f},{'inferred' if k == 7 else 'tracked'}"
            for k, (name, (x, y, z)) in enumerate(zip(CAMEL, places, strict=True))
        ]
    return "\n".join(rows), ('rows = "joint"', 'joint = "joint"', 'column = "t"', 'inferred = ["inferred"]')


def unity() -> tuple[str, tuple[str, ...]]:
    """Left-handed: X right, Y up, Z forward."""
    points = np.stack([-joints()[..., 1], joints()[..., 2], joints()[..., 0]], axis=-1)
    text = lines(["time", *axes(CAMEL)], np.hstack([times(), flat(points)]))
    return text, ('up = "Y"', 'forward = "Z"', 'left = "-X"  # please check')


def missing_marks() -> tuple[str, tuple[str, ...]]:
    points = joints()
    points[5:8, NODE_INDEX["hand_left"]] = points[9, NODE_INDEX["foot_left"]] = -9999.0
    text = lines(["time", *axes(CAMEL)], np.hstack([times(), flat(points)])).replace("-9999.00000", "-9999")
    return text, ("missing = [-9999]",)


def letters_for_sides_and_times_of_day() -> tuple[str, tuple[str, ...]]:
    names = tuple(node.replace("_left", "_l").replace("_right", "_r") for node in NODES)
    head, *rows = lines(["when", *axes(names, letters="xyz")], np.hstack([times(), flat(joints())])).split(
        "\n"
    )
    timed = [row if not row else f"00:00:{float(row[:7]):08.5f},{row.split(',', 1)[1]}" for row in rows]
    said = 'column = "when"', 'unit = "date"  # steps of 33.3 ms', 'hip_right = "hip_r"'
    return "\n".join([head, *timed]), said


LAYOUTS: tuple[Callable[[], tuple[str, tuple[str, ...]]], ...] = (
    comma_in_millimetres, decimal_commas, dots_and_units_in_names, numbered_names, nui_without_header,
    v2_with_states_without_header, msr_rows, a_row_a_joint, unity, missing_marks,
    letters_for_sides_and_times_of_day,
)  # fmt: skip


@pytest.mark.parametrize("layout", LAYOUTS, ids=lambda layout: layout.__name__)
def test_a_draft_makes_its_file_readable(
    tmp_path: Path, layout: Callable[[], tuple[str, tuple[str, ...]]]
) -> None:
    text, said = layout()
    clip, draft = drafted(tmp_path, text)
    for part in said:
        assert part in draft, draft
    positions, states = to_nodes(clip)
    seen = states > 0
    assert seen.mean() > 0.99
    assert np.abs(positions - joints())[seen].max() < 2e-5
    assert clip.times == pytest.approx(walk(FRAMES).times, abs=2e-5)


@pytest.mark.parametrize("order", ["wxyz", "xyzw"])
@pytest.mark.parametrize("named", [True, False])
def test_quaternions(tmp_path: Path, order: str, named: bool) -> None:
    """World frames of the 20 nodes beside their places; the header's letters tell the order for certain."""
    frames = node_frames(joints())
    letters = order.upper()
    written = frames if order == "xyzw" else frames[..., [3, 0, 1, 2]]
    rows = flat(np.concatenate([joints(), written], axis=-1))
    header = [
        *(f"{name}_{part}" for name in CAMEL for part in [*"XYZ", *(f"Q{letter}" for letter in letters)])
    ]
    if named:
        clip, draft = drafted(tmp_path, lines(header, rows))
        assert 'order = "xyzw"\n' in draft
        assert 'relative_to = "world"  # please check' in draft
        assert clip.rotations is not None
        world = clip.rotations[:, 0]
        assert np.abs(np.sum(world * frames[:, 0], axis=-1)) == pytest.approx(1.0, abs=1e-6)
    else:
        clip, draft = drafted(tmp_path, lines(None, rows))
        assert "quaternion = [4, 5, 6, 7]" in draft
        assert f'order = "{order}"  # please check' in draft
    assert to_nodes(clip)[0] == pytest.approx(joints(), abs=2e-5)


def test_euler_angles_in_degrees(tmp_path: Path) -> None:
    angles = 40.0 * np.sin(np.arange(FRAMES)[:, None, None] / 9 + np.arange(60).reshape(20, 3))
    rows = flat(np.concatenate([joints(), angles], axis=-1))
    header = [f"{name} {part} {axis}" for name in CAMEL for part in ("pos", "rot") for axis in "XYZ"]
    clip, draft = drafted(tmp_path, lines(header, rows))
    assert 'euler = ["{joint} rot X", "{joint} rot Y", "{joint} rot Z"]' in draft
    assert 'order = "XYZ"  # please check' in draft and 'unit = "deg"' in draft
    assert to_nodes(clip)[0] == pytest.approx(joints(), abs=2e-5)


@pytest.mark.parametrize(
    ("name", "tolerance"),
    [
        ("nui_skl", 1e-6), ("utkinect", 1e-6), ("msr_action3d", 1e-6), ("andersson", 1e-6), ("kimore", 1e-6),
        ("labanotation", 1e-6), ("khokhlova", 1e-6), ("processing_session", 1e-6), ("kinect2_skl", 1e-6),
    ],
)  # fmt: skip
def test_drafts_of_known_formats_agree_with_their_readers(
    tmp_path: Path, name: str, tolerance: float
) -> None:
    """The same places as the format's own reader gives, but for a turn about the vertical."""
    files = importlib.import_module(f"samples.{name}").files(FRAMES)
    for file, content in files.items():
        (tmp_path / file).write_bytes(content)
    path = tmp_path / next(iter(files))
    check_against_its_reader(path, name, tolerance)


@pytest.mark.parametrize(
    ("file", "order"),
    [
        ("kinect1_utkinect/joints_s01_e01.txt", "Kinect v1 SDK"),
        ("kinect1_msraction3d/a16_s01_e01_skeleton3D.txt", "MSR-Action3D"),
        ("kinect2_kimore/JointPositionExercise3.csv", "Kinect v2 SDK"),
        ("kinect2_labanotation/joints.csv", "Kinect v2 SDK"),
    ],
)
def test_drafts_of_real_recordings(captures: Path, tmp_path: Path, file: str, order: str) -> None:
    path = tmp_path / "copy.txt"
    path.write_bytes((captures / file).read_bytes())
    assert f"the sequence of the {order}" in suggest(Source.open(path))
    check_against_its_reader(path, file, 1e-6)


def check_against_its_reader(path: Path, name: str, tolerance: float) -> None:
    known = recognise.read(path)
    path.with_suffix(".toml").write_text(suggest(Source.open(path)))
    own = recognise.read(path)
    assert own.provenance["format"] == "custom table"
    # The recorder's own reader drops repeated frames.
    same = np.arange(len(own.times))
    if len(own.times) != len(known.times):
        same = np.searchsorted(own.times, known.times - 1e-6)
        assert own.times[same] == pytest.approx(known.times, abs=1e-6)
    places, expected = to_nodes(own)[0][same], to_nodes(known)[0]
    if name == "andersson":
        # No other format names Hip-centro; the draft says so, and the position is derived.
        assert '"Hip-centro" = {}  # please check' in path.with_suffix(".toml").read_text()
        places, expected = (np.delete(p, NODE_INDEX["hip_center"], axis=1) for p in (places, expected))
    turned = [expected @ turn.T for turn in quarter_turns()]
    assert min(np.nanmax(np.abs(places - other)) for other in turned) < tolerance


def quarter_turns() -> list[Array]:
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    return [np.linalg.matrix_power(quarter, k) for k in range(4)]


@pytest.mark.parametrize(
    ("content", "found"),
    [
        (b"", "an empty file"),
        (b"\x00\x01" * 500, "a binary file"),
        (b"once upon a time\nthere was a file\n", "no two rows of numbers"),
        (b"a,b,c\n1,2,3\nx,y,z\n", "no two rows of numbers"),
        ("\n".join(f"{k},{k % 7},{k % 3}" for k in range(99)).encode(), "a table of 3 columns with neither"),
    ],
)  # fmt: skip
def test_files_without_a_draft(tmp_path: Path, content: bytes, found: str) -> None:
    (tmp_path / "file").write_bytes(content)
    with pytest.raises(CaptureError, match=found) as caught:
        suggest(Source.open(tmp_path / "file"))
    assert "\n" not in str(caught.value)


def test_the_command_prints_a_draft_and_names_a_known_format(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, _ = comma_in_millimetres()
    (tmp_path / "mine.csv").write_text(text)
    assert called("inspect", "--suggest", str(tmp_path / "mine.csv")) == 0
    printed = capsys.readouterr()
    assert printed.out == suggest(Source.open(tmp_path / "mine.csv"))
    assert "needs no description: it is read as joint table" in printed.err
    name, content = next(iter(importlib.import_module("samples.utkinect").files(FRAMES).items()))
    (tmp_path / name).write_bytes(content)
    assert called("inspect", "--suggest", str(tmp_path / name)) == 0
    printed = capsys.readouterr()
    assert "needs no description: it is read as UTKinect" in printed.err
    assert printed.out.startswith("# Draft for")
    assert called("inspect", "--suggest", str(tmp_path), str(tmp_path)) == 2
    assert "expected one file with --suggest, found 2" in capsys.readouterr().err


def called(*arguments: str) -> int:
    with pytest.raises(SystemExit) as ended:
        main(list(arguments))
    assert isinstance(ended.value.code, int)
    return ended.value.code
