"""A film shows the figures where they are, and says when the simulated one has fallen."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from kinemimic.evaluate.film.camera import AIM, camera_path
from kinemimic.evaluate.film.film import Scene, render_frames, scene_of
from kinemimic.evaluate.film.loops import filmstrip, loop_webp
from kinemimic.evaluate.film.render import Picture
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, multiply
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.rollout.trajectory import Trajectory

SIZE = (320, 180)


@pytest.fixture(scope="module")
def scene(walk: Motion, performance: Callable[..., Trajectory]) -> Scene:
    return scene_of(performance(1, 60, offset=0.2), walk)


def draw(scene: Scene, frame: int, **options: object) -> Picture:
    return next(render_frames(scene, [frame], **{"size": SIZE, "labels": False, **options}))  # type: ignore[arg-type]


def orange(picture: Picture) -> np.ndarray:
    red, green, blue = (picture[..., k].astype(int) for k in range(3))
    return (red > green + 25) & (green > blue + 15)


def bluish(picture: Picture) -> np.ndarray:
    return picture[..., 2].astype(int) > picture[..., 0].astype(int) + 40


@pytest.mark.parametrize("camera", ["follow", "side"])
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_the_head_is_drawn_where_the_camera_sees_it(scene: Scene, camera: str, theme: str) -> None:
    picture = draw(scene, 20, camera=camera, theme=theme)
    assert picture.shape == (180, 320, 3)
    assert picture.dtype == np.uint8
    seen = camera_path(camera, scene.figure, scene.ghost, scene.rate, SIZE, scene.fallen_at)[20]
    head = scene.figure.positions[20, NODE_INDEX["head"]]
    rows, _ = np.nonzero(orange(picture))
    # The head's sphere: 0.15 m across.
    top = seen.project(head + np.array([0, 0, 0.075]))[1]
    assert abs(rows.min() - top) < 3
    column, row = np.round(seen.project(head)).astype(int)
    assert orange(picture)[row, column]
    # Standing on the floor, with some room at the picture's edges.
    assert rows.min() > 5
    assert 150 < rows.max() < 178


def test_a_ghost_that_coincides_is_an_outline_and_one_that_deviates_is_a_figure(scene: Scene) -> None:
    covered = draw(replace(scene, ghost=scene.figure), 20)
    away = replace(scene.ghost, positions=scene.ghost.positions + np.array([0.45, 0.0, 0.0]))
    apart = draw(replace(scene, ghost=away), 20, camera="side")
    assert 0 < bluish(covered).sum() < 0.5 * bluish(apart).sum()
    assert orange(covered).sum() > 1000


def test_after_a_fall_the_figure_is_grey_and_the_picture_says_when(
    walk: Motion, performance: Callable[..., Trajectory]
) -> None:
    played = performance(1, 60, fall=30)
    fallen = scene_of(replace(played, fallen_at=np.array([30])), walk)
    assert orange(draw(fallen, 29)).sum() > 1000
    assert not orange(draw(fallen, 30)).any()

    def alert(frame: int, theme: str) -> int:
        """Pixels in the red of an alert."""
        picture = draw(fallen, frame, labels=True, theme=theme)[:90].astype(int)
        return int(
            ((picture[..., 0] - picture[..., 1] > 100) & (abs(picture[..., 1] - picture[..., 2]) < 30)).sum()
        )

    for theme in ("light", "dark"):
        assert alert(29, theme) == 0
        assert alert(30, theme) > 40


def test_a_simulated_capture_is_marked(walk: Motion, performance: Callable[..., Trajectory]) -> None:
    made = scene_of(performance(1, 5), walk)
    assert "simulated capture" in made.note
    real = scene_of(performance(1, 5), replace(walk, provenance={}))
    assert real.note == ""
    low = np.s_[150:, :160]  # where the note is written
    marked, plain = (draw(one, 2, labels=True)[low] for one in (made, real))
    assert (marked != plain).any()
    np.testing.assert_array_equal(plain, draw(real, 2)[low])


def test_the_camera_keeps_the_figure_in_the_middle_and_does_not_sway(scene: Scene) -> None:
    """The hips sway by some centimetres around a straight path; the camera moves along the path."""
    sway = 0.04 * np.sin(2 * np.pi * np.arange(60) / 30)
    positions = scene.figure.positions + np.stack([0 * sway, sway, 0 * sway], axis=-1)[:, None]
    figure = replace(scene.figure, positions=positions)
    path = camera_path("side", figure, scene.ghost, 30.0, SIZE, 60)
    speeds = np.diff([camera.position for camera in path], axis=0) * 30
    walked = (positions[-1, 0] - positions[0, 0]) * 30 / 59
    np.testing.assert_allclose(speeds[15:-15, 0], walked[0], rtol=0.02)
    assert np.abs(speeds[15:-15, 1]).max() < 0.3 * np.abs(np.diff(sway) * 30).max()
    for frame, camera in enumerate(path):
        column, row = camera.project(np.array([*positions[frame, 0, :2], AIM]))
        assert abs(column - 160) < 12
        assert abs(row - 90) < 6


def test_the_side_view_turns_with_the_walk(scene: Scene) -> None:
    quarter = from_axis_angle("Z", np.pi / 2)
    turned = replace(
        scene.ghost,
        positions=scene.ghost.positions[..., [1, 0, 2]] * [-1, 1, 1],
        rotations=multiply(quarter, scene.ghost.rotations),
    )
    before = camera_path("side", scene.ghost, scene.ghost, 30.0, SIZE, 60)[10]
    after = camera_path("side", turned, turned, 30.0, SIZE, 60)[10]
    assert after.yaw - before.yaw == pytest.approx(np.pi / 2)


def test_pictures_are_deterministic(scene: Scene) -> None:
    np.testing.assert_array_equal(draw(scene, 7, labels=True), draw(scene, 7, labels=True))


def test_a_filmstrip_has_its_frames_side_by_side(scene: Scene) -> None:
    strip = filmstrip(scene, [0, 10, 20], size=(100, 140))
    assert strip.shape == (140, 300, 3)
    np.testing.assert_array_equal(strip[:, 100:200], draw(scene, 10, camera="side", size=(100, 140)))


def test_a_loop_plays_in_real_time_and_for_ever(scene: Scene) -> None:
    pictures = list(render_frames(scene, range(0, 60, 2), size=(120, 120)))
    with Image.open(io.BytesIO(loop_webp(pictures, 15))) as loop:
        assert (loop.format, loop.n_frames, loop.info["loop"]) == ("WEBP", 30, 0)
        lasted = 0
        for frame in range(loop.n_frames):
            loop.seek(frame)
            loop.load()
            lasted += loop.info["duration"]
        assert lasted == 2000
        shown = np.asarray(loop.convert("RGB")).astype(int)
    assert np.abs(shown - pictures[-1]).mean() < 4
    with pytest.raises(ValueError, match="at least one"):
        loop_webp([], 15)


def test_other_cameras_and_sizes_are_refused(scene: Scene) -> None:
    for options in ({"camera": "top"}, {"theme": "pink"}, {"size": (8, 100)}):
        with pytest.raises(ValueError, match="no picture"):
            draw(scene, 0, **options)
