"""Published policies match their recipes."""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from msgspec import structs
from peers.ray_nodes import RayNodes
from peers.shelf import write_run

from kinemimic.evaluate.policies.recipe import Recipe, recipes, recording
from kinemimic.evaluate.policies.shipped import RECORD, SCORES, motion_summary
from kinemimic.evaluate.workflow import packed_recipe
from kinemimic.evaluate.workflow import reproduce as module
from kinemimic.evaluate.workflow.packed_recipe import TrainedRecipe, stage_options, train_recipes_on
from kinemimic.evaluate.workflow.reproduce import LARGEST, capture_of, command, publish, reproduce
from kinemimic.evaluate.workflow.run import run as run_stages
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import file_hash, read_json, write_json
from kinemimic.pipeline.parallel.packed_files import PackedFiles
from kinemimic.pipeline.readers.mocap.deepmimic import stock_motion
from kinemimic.retarget.formats.motion_json import MOTION, read_motion_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.from_tracker import NAMES
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.rollout.policy import POLICY

WALK = Recipe("walk", "a made-up walk", "default", 5, 3)
RUN = structs.replace(WALK, name="run", stock="run")
POLISHED = structs.replace(WALK, start="tracker")
KINECT = structs.replace(WALK, name="kinect_walk", recording="kinect1_bernstein_skl/r2.skl")


def recorded(walk: Motion, **capture: str) -> Motion:
    return replace(walk, provenance={"simulated": False, "capture": capture})


def test_every_recipe_can_be_followed() -> None:
    made = recipes()
    assert list(made) == [recipe.name for recipe in made.values()]
    for recipe in made.values():
        assert recipe.preset in (NAMES if recipe.start else PRESETS)
        if recipe.stock is not None:
            assert stock_motion(recipe.stock).is_file()
        if recipe.recording is not None:
            assert recording(recipe.recording).url.startswith("https://")


def test_a_malformed_recipe_is_a_one_line_error(tmp_path: Path) -> None:
    for text, found in (
        ("[[policy]]\nname = 'x'\nnoise = 3", "noise"),
        ("x", "expected TOML"),
        ("x = 1", "policy"),
    ):
        (tmp_path / "recipes.toml").write_text(text)
        with pytest.raises(KinemimicError, match=rf"recipes\.toml[:,] .*{found}"):
            recipes(tmp_path)


def test_a_run_is_published_unchanged(tmp_path: Path, walk: Motion) -> None:
    run = write_run(tmp_path / "run", walk)
    folder = publish(run, WALK, tmp_path / "shelf")
    assert folder == tmp_path / "shelf" / "walk"
    assert {path.name for path in folder.iterdir()} == {MOTION, POLICY, RECORD, SCORES}
    for name in (MOTION, POLICY, SCORES):
        assert (folder / name).read_bytes() == (run / name).read_bytes()
    assert read_json(folder / RECORD)["imitates"] == motion_summary(walk)


def test_the_motion_of_a_recording_is_not_published(tmp_path: Path, walk: Motion) -> None:
    sha256 = recording(KINECT.recording or "").sha256
    run = write_run(tmp_path / "run", recorded(walk, sha256=sha256, source="r2.skl"))
    (tmp_path / "kinect_walk").mkdir()
    (tmp_path / "kinect_walk" / MOTION).write_text("of an earlier recipe")
    folder = publish(run, KINECT, tmp_path)
    assert {path.name for path in folder.iterdir()} == {POLICY, RECORD, SCORES}
    assert (run / MOTION).exists()


@pytest.mark.parametrize(
    ("recipe", "spoil", "found"),
    [
        (structs.replace(WALK, seed=4), None, "seed: expected 4.*found 3"),
        (structs.replace(WALK, budget=6), None, "budget: expected 6"),
        (structs.replace(WALK, preset="paper"), None, "preset: expected 'paper'"),
        (POLISHED, None, "preset: expected 'polish'.*found 'default'"),
        (POLISHED, lambda run, walk: _polished(run), "start: expected '[0-9a-f]{64}'.*found ''"),
        (RUN, None, "simulated capture: expected False.*found True"),
        (KINECT, None, "simulated capture: expected False.*found True"),
        (WALK, lambda run, walk: write_run(run, recorded(walk)), "simulated capture: expected True"),
        (RUN, lambda run, walk: write_run(run, recorded(walk, source="b")), "stock motion.*_run.txt.*'b'"),
        (KINECT, lambda run, walk: write_run(run, recorded(walk, sha256="b")), "recording: .*found 'b'"),
        (WALK, lambda run, walk: _ended_early(run), "budget spent: expected True.*found False"),
        (WALK, lambda run, walk: _other_scores(run), "scored policy"),
        (WALK, lambda run, walk: (run / SCORES).unlink(), "scores.json: expected a file"),
        (WALK, lambda run, walk: _swell(run), "too large to ship"),
        (WALK, lambda run, walk: _tracker(run), "expected a run trained by `train`, found a tracker's"),
    ],
)
def test_a_run_that_does_not_match_its_recipe_is_refused(
    tmp_path: Path, walk: Motion, recipe: Recipe, spoil: Callable[[Path, Motion], Any] | None, found: str
) -> None:
    run = write_run(tmp_path / "run", walk)
    if spoil is not None:
        spoil(run, walk)
    with pytest.raises(KinemimicError, match=found):
        publish(run, recipe, tmp_path / "shelf")
    assert not (tmp_path / "shelf").exists()


def _ended_early(run: Path) -> None:
    write_json(run / RECORD, {**read_json(run / RECORD), "samples": 4})


def _polished(run: Path) -> None:
    write_json(run / RECORD, {**read_json(run / RECORD), "preset": "polish"})


def _other_scores(run: Path) -> None:
    scores = read_json(run / SCORES)
    scores["provenance"]["inputs"]["policy"] = "another"
    write_json(run / SCORES, scores)


def _tracker(run: Path) -> None:
    record = read_json(run / RECORD)
    record["provenance"]["inputs"] = {"library": "x"}
    write_json(run / RECORD, record)


def _swell(run: Path) -> None:
    scores = read_json(run / SCORES)
    write_json(run / SCORES, {**scores, "more": "x" * LARGEST})


@pytest.fixture
def trained(walk: Motion, monkeypatch: pytest.MonkeyPatch) -> list[tuple[Path | None, str]]:
    """What `reproduce` has run, capture and preset; each run ends at once as its recipe wants it."""
    calls: list[tuple[Path | None, str]] = []

    def stand_in(capture: Path | None, folder: Path, *, options: Any, quiet: bool) -> None:
        motion = walk if capture is None else recorded(walk, source=capture.name, sha256=file_hash(capture))
        write_run(folder, motion, seed=options["train"]["seed"], budget=options["train"]["budget"])
        calls.append((capture, options["train"]["preset"]))

    monkeypatch.setattr(module, "run_stages", stand_in)
    return calls


def test_policies_are_trained_one_after_the_other(tmp_path: Path, trained: list[Any]) -> None:
    made = reproduce([WALK, structs.replace(RUN, seed=9)], tmp_path / "runs", tmp_path / "shelf", quiet=True)
    assert made == [tmp_path / "shelf" / "walk", tmp_path / "shelf" / "run"]
    assert trained == [(None, "default"), (stock_motion("run"), "default")]
    assert read_json(tmp_path / "shelf" / "run" / RECORD)["seed"] == 9


def test_a_policy_that_fails_elsewhere_does_not_affect_the_others(
    tmp_path: Path, trained: list[Any], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As on a cluster, whose nodes have other folders; the second recipe finds its run folder as it was."""

    def there(capture: Path | None, folder: Path, *, options: Any, quiet: bool) -> None:
        assert not folder.is_relative_to(tmp_path)
        assert options["train"]["workers"] == options["evaluate"]["workers"] == 1
        if options["train"]["seed"] == 4:
            (folder / "kept").write_text("made before the error")
            raise KinemimicError("expected a motion,\nfound none")
        module.run_stages(capture, folder, options=options, quiet=quiet)

    class There:
        """Carries out tasks in this process, as an executor of a cluster does on its nodes."""

        shares_disk = False

        def __init__(self, **_: Any) -> None: ...

        def map(self, work: Any, tasks: Any) -> Any:
            return enumerate(map(work, tasks))

    monkeypatch.setattr(packed_recipe, "run", there)
    monkeypatch.setattr(module, "RayExecutor", There)
    monkeypatch.setattr(module, "cluster", lambda address: nullcontext(2))
    write_json(tmp_path / "runs" / "run" / "old.json", {"before": 1})
    wanted = [WALK, structs.replace(RUN, seed=4), structs.replace(WALK, name="slow", seed=9)]
    with pytest.raises(KinemimicError, match=r"found 1 of 3 that failed: run: expected a motion, found none"):
        reproduce(wanted, tmp_path / "runs", tmp_path / "shelf", ray="head:1")
    assert {path.name for path in (tmp_path / "shelf").iterdir()} == {"walk", "slow"}
    assert read_json(tmp_path / "shelf" / "slow" / RECORD)["seed"] == 9
    assert {path.name for path in (tmp_path / "runs" / "run").iterdir()} == {"old.json", "kept"}
    shelf = tmp_path / "shelf"
    assert capsys.readouterr().out.splitlines() == [
        f"walk: {shelf / 'walk'}",
        "run: expected a motion, found none",
        f"slow: {shelf / 'slow'}",
    ]


def test_a_run_folder_that_cannot_be_written_does_not_end_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class There:
        shares_disk = False

        def map(self, work: Any, tasks: Any) -> Any:
            return ((index, TrainedRecipe({"a": b"x"}, None)) for index, _ in enumerate(tasks))

    def full(folder: Path, files: PackedFiles, *, last: Any) -> None:
        if folder.name == "walk":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "walk/a")

    monkeypatch.setattr(packed_recipe, "write_files", full)
    found = [*train_recipes_on(There(), [WALK, RUN], [None, None], tmp_path, "native")]
    assert found == [(WALK, "walk/a: no space left on device"), (RUN, None)]


@pytest.mark.slow
def test_a_policy_trained_on_a_cluster_is_that_of_one_core(tmp_path: Path, ray_nodes: RayNodes) -> None:
    """A round of 4,096 samples, then every file that ships, except for what a clock says."""
    wanted = [structs.replace(recipes()["run"], budget=1)]
    there = reproduce(
        wanted, tmp_path / "there", tmp_path / "shelf", ray=ray_nodes.cluster.address, quiet=True
    )
    for recipe, folder in zip(wanted, there, strict=True):
        run = tmp_path / "here" / recipe.name
        options = stage_options(recipe, None, workers=1, teachers=None)
        run_stages(capture_of(recipe, None), run, options=options, quiet=True)
        here = publish(run, recipe, tmp_path / "other")
        assert {path.name for path in here.iterdir()} == {path.name for path in folder.iterdir()}
        assert (here / POLICY).read_bytes() == (folder / POLICY).read_bytes()
        assert read_motion_json(here / MOTION).identity == read_motion_json(folder / MOTION).identity
        one, other = ({**read_json(place / SCORES), "provenance": None} for place in (here, folder))
        for scores in (one, other):
            del scores["train"]["seconds"]
        assert one == other


def test_a_missing_recording_is_reported_before_training(
    tmp_path: Path, trained: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("KINEMIMIC_CAPTURES", str(tmp_path / "empty"))
    command = "kinemimic datasets fetch kinect1_bernstein_skl/r2.skl"
    for captures in (None, tmp_path):
        with pytest.raises(KinemimicError, match=rf"r2\.skl in .*`{command}"):
            reproduce([WALK, KINECT], tmp_path / "runs", tmp_path / "shelf", captures=captures)
    other = tmp_path / (KINECT.recording or "")
    other.parent.mkdir()
    other.write_text("another")
    with pytest.raises(KinemimicError, match="found another file"):
        reproduce([WALK, KINECT], tmp_path / "runs", tmp_path / "shelf", captures=tmp_path)
    assert trained == []


def test_the_recording_is_the_one_of_the_catalogue(captures: Path) -> None:
    assert capture_of(KINECT, captures) == captures / (KINECT.recording or "")


def test_command_publishes_an_existing_run(tmp_path: Path, walk: Motion) -> None:
    recipe = recipes()["walk"]
    run = write_run(tmp_path / "run", walk, seed=recipe.seed, budget=recipe.budget)
    shelf = tmp_path / "shelf"
    told = CliRunner().invoke(
        command,
        ["--only", "walk", "--from", str(run), "--into", str(shelf), "--json"],
        catch_exceptions=False,
    )
    assert json.loads(told.output) == [f"{shelf}/walk"]
    assert (shelf / "walk" / POLICY).is_file()
    assert CliRunner().invoke(command, ["--from", str(run)]).exit_code == 2
    with pytest.raises(KinemimicError, match=r"expected a recipe among walk, run, .*, found 'wlk'"):
        CliRunner().invoke(command, ["--only", "wlk"], catch_exceptions=False)
