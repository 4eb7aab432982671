"""Several rollouts in one picture and one video."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image
from rerun.chunk import RrdReader

from kinemimic.evaluate.film.figures import REFERENCE, SIMULATED, Humanoid
from kinemimic.evaluate.film.film import Scene, render_frames
from kinemimic.evaluate.film.tiles import PANEL, render_tiles
from kinemimic.evaluate.view import command as view
from kinemimic.evaluate.view import gallery
from kinemimic.pipeline.cli.main import main
from kinemimic.pipeline.kinematics.clip import forward_kinematics
from kinemimic.pipeline.kinematics.rotations import IDENTITY
from kinemimic.pipeline.kinematics.skeleton import NODES, node_skeleton
from kinemimic.retarget.formats.motion_json import motion_to_json, read_motion_json
from kinemimic.retarget.humanoid.body import STANDING_HEIGHT, node_offsets
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.rollout.trajectory import Trajectory


def scene(frames: int, speed: float) -> Scene:
    """A figure that glides ahead of its reference."""

    def gliding(kind: int, along: float) -> Humanoid:
        translations = np.broadcast_to(node_offsets(), (frames, len(NODES), 3)).copy()
        translations[:, 0] = [0.0, 0.0, STANDING_HEIGHT]
        translations[:, 0, 0] += along + speed * np.arange(frames)
        rotations = np.tile(IDENTITY, (frames, len(NODES), 1))
        return Humanoid(kind, *forward_kinematics(node_skeleton(node_offsets()), translations, rotations))

    return Scene(gliding(SIMULATED, 0.3), gliding(REFERENCE, 0.0), 30.0, frames)


def test_every_panel_is_the_film_of_its_scene() -> None:
    scenes = [("a", scene(5, 0.03)), ("b", scene(3, 0.0)), ("c", scene(5, 0.0))]
    size = (160, 120)
    sheets = list(render_tiles(scenes, [0, 4], columns=2, size=size))
    assert [sheet.shape for sheet in sheets] == [(240, 320, 3)] * 2
    alone = [
        next(
            render_frames(
                one, [min(4, len(one.figure.positions) - 1)], camera="side", size=size, labels=False
            )
        )
        for _, one in scenes
    ]
    for k, picture in enumerate(alone):
        row, column = divmod(k, 2)
        panel = sheets[1][row * 120 : (row + 1) * 120, column * 160 : (column + 1) * 160]
        # The labels are at the top and at the bottom.
        np.testing.assert_array_equal(panel[40:90], picture[40:90])
    assert (sheets[1][120:, 160:] == 255).all()
    with pytest.raises(ValueError, match="no scenes"):
        next(render_tiles([], [0], columns=2))


def test_the_video_is_no_longer_than_the_longest_rollout(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, frames in (("anna", 4), ("bob", 3)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "trajectory.npz").write_text(str(frames))
    monkeypatch.setattr(
        gallery, "read_scene", lambda run: (run.name, scene(int((run / "trajectory.npz").read_text()), 0.0))
    )
    movie = tmp_path / "g.webm"
    arguments = [str(tmp_path / "anna"), str(tmp_path / "bob"), "--video", str(movie), "--seconds", "1e9"]
    assert CliRunner().invoke(gallery.command, arguments).exit_code == 0
    film, shown = cv2.VideoCapture(str(movie)), 0
    while film.grab():
        shown += 1
    assert shown == 4


def test_a_picture_that_would_be_no_png_is_refused(tmp_path: Path) -> None:
    for option, command in (("--picture", gallery.command), ("--screenshot", view.command)):
        run = [str(tmp_path)] if command is gallery.command else ["--run", str(tmp_path)]
        result = CliRunner().invoke(command, [*run, option, str(tmp_path / "x.jpg")])
        assert "expected a picture named .png, found '.jpg'" in str(result.exception)
        assert not (tmp_path / "x.jpg").exists()


def test_the_command_draws_both(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    runs = [tmp_path / name for name in ("anna", "bob")]
    for run in runs:
        run.mkdir()
        (run / "trajectory.npz").touch()
    monkeypatch.setattr(gallery, "read_scene", lambda run: (run.name, scene(4, 0.02)))
    movie, picture = tmp_path / "g.webm", tmp_path / "g.png"
    arguments = ["--video", str(movie), "--picture", str(picture), "--seconds", "0.1"]
    result = CliRunner().invoke(gallery.command, [*map(str, runs), *arguments])
    assert result.exit_code == 0, result.output
    assert Image.open(picture).size == (2 * PANEL[0], PANEL[1])
    film = cv2.VideoCapture(str(movie))
    assert film.get(cv2.CAP_PROP_FRAME_WIDTH) == 2 * PANEL[0]
    assert film.read()[0]


def test_a_recording_has_every_run_in_a_scene_of_its_own(
    walk: Motion, performance: Callable[..., Trajectory], tmp_path: Path
) -> None:
    runs = [tmp_path / name for name in ("anna", "bob")]
    for run in runs:
        run.mkdir()
        (run / "motion.json").write_text(motion_to_json(walk))
        identity = read_motion_json(run / "motion.json").identity
        replace(performance(2, 30), motion=identity).save(run / "trajectory.npz")
    made = tmp_path / "g.rrd"
    result = CliRunner().invoke(gallery.command, [*map(str, runs), "--recording", str(made)])
    assert result.exit_code == 0, result.output
    entities = {str(chunk.entity_path) for chunk in RrdReader(made).store().stream()}
    for scene in ("1-anna", "2-bob"):
        assert {f"/{scene}/simulated/skeleton", f"/{scene}/reference/skeleton"} <= entities


def test_a_run_without_rollouts_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for arguments, found in (
        (["--picture", "g.png"], "expected rollouts, found none; run `kinemimic evaluate` first"),
        ([], "expected --video, --picture or --recording, found none"),
    ):
        with pytest.raises(SystemExit) as exit_:
            main(["gallery", str(tmp_path), *arguments])
        assert exit_.value.code == 2
        assert found in capsys.readouterr().err
