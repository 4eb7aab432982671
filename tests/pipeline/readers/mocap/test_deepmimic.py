"""The stock motions as clips: axes, signs and human measures; damage is named."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples import source_of
from samples.deepmimic import files
from samples.motion import rigid_walk

from kinemimic.pipeline.errors import CaptureError, KinemimicError
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.readers.mocap.deepmimic import read_deepmimic, stock_motion
from kinemimic.pipeline.readers.recognise import read_source


def test_the_walk_goes_forward_upright_with_its_feet_on_the_ground() -> None:
    clip = read_deepmimic(stock_motion("walk"))
    assert clip.positions.shape == (39, 20, 3)
    way = clip.positions[-1, 0] - clip.positions[0, 0]
    assert way[0] == pytest.approx(1.23859) and abs(way[1]) < 1e-9
    assert clip.times[-1] == pytest.approx(38 * 0.033332)
    assert np.all(clip.positions[:, N["head"], 2] > 1.3)
    left = clip.positions[:, N["hip_left"]] - clip.positions[:, N["hip_right"]]
    assert np.all(left[:, 1] > 0.1), "the left hip is on the left of one who walks along +X"
    ankles = clip.positions[:, [N["ankle_left"], N["ankle_right"]], 2]
    assert np.all((ankles.min(axis=1) > 0.04) & (ankles.min(axis=1) < 0.12))
    thigh = np.linalg.norm(clip.positions[:, N["knee_left"]] - clip.positions[:, N["hip_left"]], axis=-1)
    assert 0.40 < thigh[0] < 0.45 and np.ptp(thigh) < 1e-12


@pytest.mark.parametrize("motion", ["walk", "run"])
def test_knee_flexion_is_the_files_own_angle_with_its_sign_turned(motion: str) -> None:
    path = stock_motion(motion)
    frames = np.array(json.loads(path.read_text())["Frames"])
    clip = read_deepmimic(path)
    assert clip.rotations is not None
    angles = leg_angles(clip.positions, pelvis=clip.rotations[:, 0])
    np.testing.assert_allclose(angles["knee_right"], -frames[:, 20], atol=1e-9)
    np.testing.assert_allclose(angles["knee_left"], -frames[:, 34], atol=1e-9)


def test_elbows_bend_forward() -> None:
    clip = read_deepmimic(stock_motion("run"))
    for side in ("left", "right"):
        shoulder, elbow, wrist = (clip.positions[:, N[f"{j}_{side}"]] for j in ("shoulder", "elbow", "wrist"))
        lateral = clip.positions[:, N["shoulder_left"]] - clip.positions[:, N["shoulder_right"]]
        bend = np.cross(elbow - shoulder, wrist - elbow)
        assert np.all(np.sum(bend * lateral, axis=-1) < 0)


def test_the_wheel_is_found_without_loading_pybullet() -> None:
    before = set(sys.modules)
    stock_motion("walk")
    assert "pybullet" not in set(sys.modules) - before
    with pytest.raises(KinemimicError, match=r"stock motion .*walk.*found 'stroll'"):
        stock_motion("stroll")


def _walk() -> dict[str, list[list[float]]]:
    return json.loads(stock_motion("walk").read_text())  # type: ignore[no-any-return]


def _short_row(content: dict[str, list[list[float]]]) -> None:
    content["Frames"][3] = content["Frames"][3][:-1]


def _no_step(content: dict[str, list[list[float]]]) -> None:
    content["Frames"][2][0] = 0.0


def _no_quaternion(content: dict[str, list[list[float]]]) -> None:
    content["Frames"][5][8:12] = [0.0] * 4


def _nan(content: dict[str, list[list[float]]]) -> None:
    content["Frames"][7][1] = float("nan")


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (_short_row, "frame 3: expected 44 numbers, found 43"),
        (_no_step, "frame 2: expected a positive time step"),
        (_no_quaternion, "frame 5: expected a unit quaternion at spine"),
        (_nan, "frame 7: expected finite numbers"),
        (lambda content: content.clear(), 'expected "Frames"'),
    ],
)
def test_damage_is_named(tmp_path: Path, damage: object, message: str) -> None:
    content = _walk()
    damage(content)  # type: ignore[operator]
    path = tmp_path / "motion.txt"
    path.write_text(json.dumps(content))
    with pytest.raises(CaptureError, match=message):
        read_deepmimic(path)


@pytest.mark.parametrize("name", ["backflip", "cartwheel", "crawl", "kick", "punch", "roll", "spin"])
def test_every_stock_motion_is_read(name: str) -> None:
    """Some of their quaternions are shorter than one: told, and normalised."""
    clip = read_deepmimic(stock_motion(name))
    assert clip.rotations is not None
    np.testing.assert_allclose(np.linalg.norm(clip.rotations, axis=-1), 1.0, atol=1e-12)
    told = any("normalised" in note for note in clip.provenance["reading"]["notes"])
    assert told == (name != "crawl")


def test_the_known_walk_comes_back() -> None:
    (content,) = files(40).values()
    clip, walk = read_source(source_of(content.decode(), Path("walk.txt"))), rigid_walk(40, 30.0)
    np.testing.assert_allclose(clip.positions, walk.joints, atol=1e-8)
    np.testing.assert_allclose(clip.times, walk.times, atol=1e-8)
    assert clip.angles is not None
    measured = leg_angles(clip.positions)
    for knee, curve in clip.angles.items():
        np.testing.assert_allclose(measured[knee], curve, atol=1e-8)


@pytest.mark.parametrize("indent", [None, 1])
def test_any_layout_of_the_same_json_gives_the_same(indent: int | None) -> None:
    (content,) = files(12).values()
    value = json.loads(content)
    last = {"Frames": value["Frames"], "Loop": "wrap", "Note": "[1, 2]"}
    plain = read_source(source_of(content.decode(), Path("walk.txt")))
    for other in (json.dumps(value, indent=indent), json.dumps(last, indent=indent)):
        clip = read_source(source_of(other, Path("walk.txt")))
        assert np.array_equal(clip.positions, plain.positions)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t[:-40], "expected JSON.*cut off there"),
        (lambda t: t.replace("],", "]],", 1), "expected JSON"),
        (lambda t: t.replace("[\n[", "[\n[[", 1), "expected JSON"),
        (lambda t: t.replace("-0.", "true, -0.", 1), "expected 44 numbers, found 45"),
        (lambda t: t.replace("0.0333333333", '"0.03"', 1), "expected numbers only"),
        (lambda t: t.replace("0.0333333333", "1e300", 1), "frame 0: expected finite numbers below 10000"),
        (lambda t: t[: t.index("],") + 1] + "]}", 'expected "Frames" with two frames or more, found one'),
        (lambda t: '{"Frames": ' + "[" * 100_000, "nested hundreds deep"),
    ],
)
def test_damaged_text_is_named(change: Callable[[str], str], message: str) -> None:
    (content,) = files(12).values()
    with pytest.raises(CaptureError, match=message) as caught:
        read_source(source_of(change(content.decode()), Path("walk.txt")))
    assert "\n" not in str(caught.value)


def test_a_file_that_is_missing_or_no_json(tmp_path: Path) -> None:
    with pytest.raises(CaptureError, match="found no file"):
        read_deepmimic(tmp_path / "none.txt")
    (tmp_path / "text.txt").write_text("walk")
    with pytest.raises(CaptureError, match="JSON"):
        read_deepmimic(tmp_path / "text.txt")


def test_without_pybullet_the_message_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    with pytest.raises(KinemimicError, match=r"found no pybullet; install it .* datasets fetch 'deepmimic_"):
        stock_motion("walk")


def test_an_unknown_stock_motion_names_the_known_ones() -> None:
    with pytest.raises(KinemimicError, match=r"stock motion \(.*run.*walk.*\), found 'moonwalk'"):
        stock_motion("moonwalk")
