"""UI-PRMD's Kinect files: the order of its angles, feet that stay on the ground, pairs of files."""

from __future__ import annotations

import gzip
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from samples import source_of
from samples.motion import in_sight, walk
from samples.uiprmd import files, joints

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.euler import positions_of_channels
from kinemimic.pipeline.kinematics.joint_names import joints_by_name
from kinemimic.pipeline.kinematics.nodes import derived_nodes, to_nodes
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.public_datasets import uiprmd
from kinemimic.pipeline.readers.public_datasets.uiprmd import ORDER, UIPRMD_JOINTS


def put(folder: Path, content: dict[str, bytes]) -> Path:
    for name, data in content.items():
        (folder / name).write_bytes(data)
    return folder / next(iter(content))


def table(content: bytes) -> Array:
    return np.loadtxt(gzip.decompress(content).decode().splitlines(), delimiter=",")


def text(values: Array) -> bytes:
    return "\n".join(",".join(f"{x:.6f}" for x in row) for row in values).encode()


def test_the_known_walk_comes_back(tmp_path: Path) -> None:
    clip = recognise.read(put(tmp_path, files(40)))
    assert clip.provenance["format"] == "UI-PRMD Kinect"
    assert clip.rate == pytest.approx(30.0)
    assert (clip.skeleton.names, set(clip.orders or ())) == (UIPRMD_JOINTS, {"ZXY"})
    truth = joints(in_sight(walk(40, 30.0)))[..., [2, 0, 1]]
    assert np.abs(clip.positions - truth).max() < 2e-6
    positions, states = to_nodes(clip)
    for node in (
        "hip_left",
        "knee_left",
        "ankle_right",
        "foot_right",
        "shoulder_left",
        "elbow_right",
        "head",
    ):
        place = in_sight(walk(40, 30.0)).joints[:, NODE_INDEX[node]]
        assert np.abs(positions[:, NODE_INDEX[node]] - place).max() < 2e-6
    assert derived_nodes(clip) == ("hand_left", "hand_right")
    assert (states > 0).all()


def test_either_file_is_the_recording(tmp_path: Path) -> None:
    put(tmp_path, files(10))
    one, two = (recognise.read(tmp_path / name) for name in files(10))
    assert np.array_equal(one.positions, two.positions)
    assert one.euler is not None
    assert two.euler is not None
    assert np.array_equal(one.euler, two.euler)
    assert one.provenance["sidecar_files"] == {"kinect_m01_s01_e01_angles.txt.gz": two.provenance["sha256"]}


def test_the_halves_in_folders_beside_each_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    positions, angles = files(10)
    for folder, name in (("Positions", positions), ("Angles", angles), ("Other", angles)):
        (tmp_path / folder).mkdir()
        put(tmp_path / folder, {name: files(10)[name]})
    together = recognise.read(put(tmp_path, files(10)))
    monkeypatch.chdir(tmp_path / "Angles")
    for path in (tmp_path / "Positions" / positions, Path(angles)):
        clip = recognise.read(path)
        assert np.array_equal(clip.positions, together.positions)
        (beside,) = clip.provenance["sidecar_files"]
        assert beside in (f"../Angles/{angles}", f"../Positions/{positions}")
    # No other folder is searched.
    Path(angles).unlink()
    with pytest.raises(CaptureError, match=rf"expected {angles} or \.\./Angles/{angles} with the angles"):
        recognise.read(tmp_path / "Positions" / positions)


def test_a_missing_sidecar_file_is_named(tmp_path: Path) -> None:
    for name, data in files(10).items():
        alone = tmp_path / name
        alone.write_bytes(data)
        other = next(n for n in files(10) if n != name)
        with pytest.raises(CaptureError, match=f"expected {other} with the .* found no such file"):
            recognise.read(alone)
        alone.unlink()
    (tmp_path / "squat.txt").write_bytes(next(iter(files(10).values())))
    with pytest.raises(CaptureError, match=r"expected 'positions' in the name .*, found 'squat\.txt'"):
        recognise.read(tmp_path / "squat.txt")


def test_the_halves_are_distinguished_by_their_numbers(tmp_path: Path) -> None:
    positions, angles = files(10).values()
    put(tmp_path, {"a_angles.txt": positions, "a_positions.txt": angles})
    with pytest.raises(CaptureError, match="expected 'positions' in the name of this file of positions"):
        recognise.read(tmp_path / "a_angles.txt")
    put(tmp_path, {"b_angles.txt": positions, "b_positions.txt": positions})
    with pytest.raises(CaptureError, match="found positions in both"):
        recognise.read(tmp_path / "b_positions.txt")


def test_damage_is_named(tmp_path: Path) -> None:
    positions, angles = (table(content) for content in files(10).values())
    names = ("x_positions.txt", "x_angles.txt")

    def refused(first: Array, second: Array, message: str) -> None:
        path = put(tmp_path, dict(zip(names, (text(first), text(second)), strict=True)))
        with pytest.raises(CaptureError, match=message):
            recognise.read(path)

    refused(positions, angles[:-1], r"expected as many frames as in x_angles\.txt, 9, found 10; one of the")
    broken = positions.copy()
    broken[4, 3 * UIPRMD_JOINTS.index("LHand") + 1] = np.nan
    refused(broken, angles, "line 5: expected a finite number, found nan in LHand")
    broken[4, 3 * UIPRMD_JOINTS.index("LHand") + 1] = 1e9
    refused(broken, angles, r"line 5: expected at most 10000 cm in Y of LHand, found 1e\+09")
    turned = angles.copy()
    turned[2, 0] = 1e5
    refused(
        positions, turned, r"x_angles\.txt, line 3: expected degrees, at most 3600, in Waist, found 100000"
    )
    path = put(tmp_path, {names[0]: text(positions)[:-30], names[1]: text(angles)})
    with pytest.raises(
        CaptureError, match=r"line 10: expected 66 numbers, found 6\d; the file is cut off there"
    ):
        recognise.read(path)


def test_lines_of_zeros_are_left_out(tmp_path: Path) -> None:
    positions, angles = (table(content) for content in files(10).values())
    positions[3] = 0.0
    path = put(tmp_path, {"x_positions.txt": text(positions), "x_angles.txt": text(angles)})
    clip = recognise.read(path)
    assert np.allclose(clip.times * 30.0, [0, 1, 2, 4, 5, 6, 7, 8, 9])
    assert [d["rule"] for d in clip.provenance["reading"]["defects"]] == ["zero_frames"]


def test_other_tables_of_66_numbers_are_not_claimed() -> None:
    rng = np.random.default_rng(1)
    assert not uiprmd.recognises(source_of(text(rng.normal(size=(20, 66))).decode(), Path("t.csv")))


def sway(clip: Clip, order: str) -> float:
    """Standard deviation over the frames of both ankles' coordinates, their mean, metres, with an order."""
    assert clip.euler is not None
    assert clip.translations is not None
    read_as = clip.euler[..., [ORDER.index(axis) for axis in order]]
    places = positions_of_channels(
        clip.skeleton, clip.translations, read_as, (order,) * len(UIPRMD_JOINTS), clip.world_from_file
    )
    return float(places[:, [UIPRMD_JOINTS.index(f"{side}Foot") for side in "LR"]].std(axis=0).mean())


def squats(captures: Path) -> list[Path]:
    return sorted((captures / "kinect2_vicon_uiprmd").glob("kinect_m01_*_positions*.txt.gz"))


def test_feet_of_a_squat_stay_put_in_one_order_only(captures: Path) -> None:
    assert len(squats(captures)) >= 7
    for path in squats(captures):
        clip = recognise.read(path)
        assert 0.004 < sway(clip, ORDER) < 0.04, path.name
        for order in ("".join(axes) for axes in permutations("XYZ")):
            if order != ORDER:
                assert 0.10 < sway(clip, order) < 0.40, (path.name, order)


def test_every_real_recording_stands_upright_and_looks_forward(captures: Path) -> None:
    for path in sorted((captures / "kinect2_vicon_uiprmd").glob("kinect_*_positions*.txt.gz")):
        clip = recognise.read(path)
        positions, _ = to_nodes(clip)
        assert {"hip_left", "knee_right", "ankle_left"} <= joints_by_name(clip.skeleton.names).keys()
        p = {node: np.median(positions[:, k], axis=0) for node, k in NODE_INDEX.items()}
        assert p["head"][2] > p["shoulder_center"][2] > p["hip_center"][2] > p["ankle_left"][2], path.name
        assert p["hip_left"][1] > p["hip_right"][1], path.name
        assert p["foot_left"][0] > p["ankle_left"][0], path.name
