"""UI-PRMD's Vicon files: markers and Plug-in-Gait's angles, and the Kinect's squats against them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples.motion import in_sight, walk
from samples.uiprmd_vicon import RATE, files, rows

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.nodes import derived_nodes, to_nodes
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers import recognise


def put(folder: Path, content: dict[str, bytes]) -> list[Path]:
    for name, data in content.items():
        (folder / name).write_bytes(data)
    return [folder / name for name in content]


def test_the_known_walk_comes_back_from_either_file(tmp_path: Path) -> None:
    shown = in_sight(walk(40, RATE))
    for path in put(tmp_path, files(40)):
        clip = recognise.read(path)
        assert clip.provenance["format"] == "UI-PRMD Vicon"
        assert clip.rate == pytest.approx(100.0)
        assert derived_nodes(clip) == ()
        positions, _ = to_nodes(clip)
        for node in set(NODE_INDEX) - {"hip_center", "spine"}:
            assert np.abs(positions[:, NODE_INDEX[node]] - shown.joints[:, NODE_INDEX[node]]).max() < 1e-7, (
                node
            )
        curves = leg_angles(positions)
        assert clip.angles is not None
        for name in curves:
            assert np.abs(curves[name] - shown.angles[name]).max() < 1e-6, name
            assert np.abs(clip.angles[name] - shown.angles[name]).max() < 1e-7, name


def test_angles_alone_name_the_missing_file(tmp_path: Path) -> None:
    positions, angles = put(tmp_path, files(5))
    positions.unlink()
    with pytest.raises(CaptureError, match=r"expected vicon_m01_s01_e01_positions\.txt\.gz with the posit"):
        recognise.read(angles)


def test_positions_alone_are_a_capture(tmp_path: Path) -> None:
    positions, angles = put(tmp_path, files(5))
    angles.unlink()
    clip = recognise.read(positions)
    assert clip.angles is None
    assert "no file of angles in the same folder" in " ".join(clip.provenance["reading"]["notes"])


def test_a_cut_sidecar_file_is_reported(tmp_path: Path) -> None:
    positions, angles = put(tmp_path, files(6))
    angles.write_bytes(list(files(5).values())[1])
    with pytest.raises(CaptureError, match="as many frames of angles as of positions, found 5 and 6"):
        recognise.read(positions)


def test_invalid_angles_are_nan(tmp_path: Path) -> None:
    positions, angles = put(tmp_path, files(6))
    values = np.zeros((6, 39, 3))
    values[2, 19, 0] = np.nan
    values[3, 20, 0] = 1e6
    angles.write_bytes(rows(values))
    clip = recognise.read(positions)
    assert clip.angles is not None
    assert np.flatnonzero(np.isnan(clip.angles["knee_left"])).tolist() == [2]
    assert np.flatnonzero(np.isnan(clip.angles["knee_right"])).tolist() == [3]


def test_our_angles_follow_plug_in_gaits(captures: Path) -> None:
    for path in sorted((captures / "kinect2_vicon_uiprmd").glob("vicon_m01_*_positions.txt.gz")):
        clip = recognise.read(path)
        curves = leg_angles(to_nodes(clip)[0])
        assert clip.angles is not None
        for name, own in clip.angles.items():
            assert np.corrcoef(curves[name], own)[0, 1] > 0.995, (path.name, name)
            bias = np.degrees(np.sqrt(np.mean((curves[name] - own) ** 2)))
            assert bias < 5.0, (path.name, name)


# Where the Kinect's peak is over 8 degrees short of Plug-in-Gait's. It falls short in every deep squat, and
# most in the deepest, those of 134 degrees and more.
SHORT = {
    ("m01_s01_e02", "left"),
    ("m01_s01_e03", "left"),
    ("m01_s02_e02", "left"),
    ("m01_s02_e02", "right"),
    ("m01_s02_e03", "left"),
}


def peaks(folder: Path) -> list[tuple[str, str, float, float]]:
    """(clip, side, the Kinect's knee peak, Plug-in-Gait's) in degrees, per correct deep squat and side."""
    table = []
    for path in sorted(folder.glob("kinect_m01_*_positions.txt.gz")):
        kinect, vicon = (
            recognise.read(path),
            recognise.read(path.with_name(path.name.replace("kinect", "vicon"))),
        )
        seen = leg_angles(to_nodes(kinect)[0])
        assert vicon.angles is not None
        for side in ("left", "right"):
            ends = (seen[f"knee_{side}"], vicon.angles[f"knee_{side}"])
            clip = path.name.removeprefix("kinect_").removesuffix("_positions.txt.gz")
            table.append((clip, side, *(float(np.degrees(np.nanmax(curve))) for curve in ends)))
    return table


def test_peaks_of_deep_squats_kinect_against_vicon(captures: Path) -> None:
    table = peaks(captures / "kinect2_vicon_uiprmd")
    print("\nclip         side   Kinect  Vicon  difference")
    for clip, side, kinect, vicon in table:
        print(f"{clip}  {side:5}  {kinect:6.1f} {vicon:6.1f}  {kinect - vicon:+6.1f}")
    assert len(table) >= 14
    assert {(clip, side) for clip, side, kinect, vicon in table if abs(kinect - vicon) > 8.0} == SHORT
    assert all(-13.0 < kinect - vicon < 0.0 for _, _, kinect, vicon in table)
