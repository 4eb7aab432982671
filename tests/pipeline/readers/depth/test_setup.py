"""camera.toml: how the camera stands, and mistakes in the file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples import source_of
from samples.depth_scene import HALF, MOUNT, camera_toml, lens_toml, to_camera

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.rotations import rotate
from kinemimic.pipeline.readers.depth.setup import Mount, Setup, read_setup

TEXT = camera_toml(HALF)
MOUNTED = f"height = {MOUNT[0]}\ntilt = {MOUNT[1]}\n"
POINTS = np.random.default_rng(0).uniform(-3, 3, (20, 3))


def setup(text: str) -> Setup:
    return read_setup(source_of(text, Path("camera.toml")))


def test_a_tilted_camera_is_levelled() -> None:
    mount = setup(TEXT).mount
    assert mount.to_camera(POINTS) == pytest.approx(to_camera(POINTS))
    back = rotate(mount.world_from_camera, mount.from_floor(to_camera(POINTS)))
    assert back == pytest.approx(POINTS)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_floor_plane_equals_height_and_tilt(sign: float) -> None:
    height, tilt = MOUNT[0], np.radians(MOUNT[1])
    plane = (sign * 2.5 * np.array([0.0, -np.cos(tilt), -np.sin(tilt), height])).tolist()
    mount = setup(TEXT.replace(MOUNTED, f"floor = {plane}\n")).mount
    assert mount.to_camera(POINTS) == pytest.approx(to_camera(POINTS))


def test_a_rolled_camera_is_levelled_by_its_floor() -> None:
    up = np.array([0.1, -0.95, -0.2])
    up /= np.linalg.norm(up)
    mount = setup(TEXT.replace(MOUNTED, f"floor = {[*up.tolist(), 0.8]}\n")).mount
    assert rotate(mount.world_from_camera, up) == pytest.approx([0.0, 0.0, 1.0])
    on_floor = mount.from_floor(-0.8 * up)
    assert on_floor == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)
    # Forward stays forward: no turn about the vertical.
    assert rotate(mount.world_from_camera, np.array([0.0, 0.0, 1.0]))[1] == pytest.approx(0.0, abs=1e-12)


def test_without_a_mount_the_camera_is_level_at_the_origin() -> None:
    bare = setup(TEXT.split("[mount]")[0])
    assert not bare.leveled
    assert bare.mount == Mount()
    ahead_left_up = rotate(bare.mount.world_from_camera, np.array([-2.0, -3.0, 1.0]))
    assert ahead_left_up == pytest.approx([1.0, 2.0, 3.0])


def test_a_colour_camera_of_its_own() -> None:
    more = (
        "[color]\nwidth = 1920\nheight = 1080\nfx = 904\nfy = 903\ncx = 953\ncy = 555\n"
        "rotation = [0, -1, 0, 1, 0, 0, 0, 0, 1]\ntranslation = [0.1, 0, 0]\n[color.distortion]\nk1 = 0.5\n"
    )
    color = setup(TEXT + more).color
    assert color is not None
    assert (color.camera.width, color.camera.distortion[0]) == (1920, 0.5)
    assert color.from_depth(np.array([1.0, 0.0, 2.0])) == pytest.approx([0.1, 1.0, 2.0])
    assert setup(TEXT).color is None


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("kinemimic_depth = 1", "", "key kinemimic_depth: expected 1, the version"),
        ("kinemimic_depth = 1", "kinemimic_depth = 2", "found 2"),
        ("width = 320", "width = 0", "key width"),
        ("width = 320", "", "key width: expected pixels"),
        ("width = 320\nheight = 288", "width = 8000\nheight = 8000", "expected at most"),
        ("fx = 252.0", "", "key fx: expected pixels"),
        ("fx = 252.0", "fx = nan", "key fx"),
        ("fx = 252.0", 'fx = "252"', "key fx"),
        ("fx = 252.0", "f_x = 252.0", "key f_x: expected one of width, .*did you mean 'fx'"),
        ("rate = 30.0", "rate = 0", "key rate"),
        ("rate = 30.0", "rat = 30.0", "did you mean 'rate'"),
        ("k1 =", "k9 =", "distortion.k9"),
        ("k1 = 3.130577", "k1 = inf", "distortion.k1"),
        ("tilt = 6.0", "tilt = 90", "mount.tilt"),
        ("tilt = 6.0", "floor = [0, -1, 0, 1]", "either floor or height and tilt"),
        (MOUNTED, "floor = [1, 0, 0, 1]\n", "the plane of a floor"),
        (MOUNTED, "floor = [0, 0, 0, 1]\n", "the plane of a floor"),
        (MOUNTED, "floor = [0, -1, 0, 1000]\n", "within 10 m of its floor"),
        ("rate", "= rate", "expected TOML"),
        ("rate = 30.0", "rate = 30.0\nx = " + 2000 * "[", "expected TOML"),
    ],
)
def test_a_mistake_names_its_key(old: str, new: str, message: str) -> None:
    assert old in TEXT
    with pytest.raises(CaptureError, match=message) as error:
        setup(TEXT.replace(old, new, 1))
    assert "\n" not in str(error.value)


def test_an_invalid_rotation_is_refused() -> None:
    mirror = "rotation = [1, 0, 0, 0, 1, 0, 0, 0, -1]\n"
    with pytest.raises(CaptureError, match=r"color\.rotation: expected the nine numbers of a rotation"):
        setup(TEXT + "[color]\n" + mirror + lens_toml(HALF, "color."))
