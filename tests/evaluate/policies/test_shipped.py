"""Shipped policies are copied into a run folder and used there, and never replace a user's own files."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
from click.testing import CliRunner
from peers.shelf import RECIPES, write_run
from peers.trackers import write_idle_tracker

from kinemimic.evaluate.command import command as evaluate_command
from kinemimic.evaluate.export import command as export
from kinemimic.evaluate.policies import command as policies
from kinemimic.evaluate.policies.recipe import recording
from kinemimic.evaluate.policies.shipped import RECORD, SCORES, ShippedPolicies, evaluated
from kinemimic.evaluate.view import command as view
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import file_hash, read_json, write_json, write_text
from kinemimic.retarget.formats.motion_json import MOTION, motion_to_json, read_motion_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.library.exercises import exercise
from kinemimic.train.config.tracker import STANDING
from kinemimic.train.rollout.policy import POLICY, load_trained


@pytest.fixture
def shelf(tmp_path: Path, walk: Motion, monkeypatch: pytest.MonkeyPatch) -> ShippedPolicies:
    """Two policies: of a short non-cyclic motion, and of a recording, without its motion."""
    folder = tmp_path / "shelf"
    once = replace(walk, cyclic=False)
    write_run(folder / "walk", once)
    write_run(folder / "kinect_walk", once, bias=0.01)
    (folder / "kinect_walk" / MOTION).unlink()
    (folder / "recipes.toml").write_text(RECIPES)
    monkeypatch.chdir(tmp_path)
    return ShippedPolicies(folder)


def test_policy_and_motion_are_copied_once(shelf: ShippedPolicies, tmp_path: Path) -> None:
    run = tmp_path / "run"
    shelf.prepare("walk", run)
    assert {path.name for path in run.iterdir()} == {MOTION, POLICY, RECORD}
    for path in run.iterdir():
        assert path.read_bytes() == (shelf.folder / "walk" / path.name).read_bytes()
    before = {path: path.stat().st_mtime_ns for path in run.iterdir()}
    shelf.prepare("walk", run)
    assert before == {path: path.stat().st_mtime_ns for path in run.iterdir()}
    # An interrupted copy is completed.
    (run / POLICY).unlink()
    shelf.prepare("walk", run)
    assert file_hash(run / POLICY) == file_hash(shelf.folder / "walk" / POLICY)


def test_a_users_policy_or_motion_is_kept(shelf: ShippedPolicies, tmp_path: Path, walk: Motion) -> None:
    own = write_run(tmp_path / "own", walk, bias=0.5)
    before = {path: path.read_bytes() for path in own.iterdir()}
    with pytest.raises(KinemimicError, match="expected policy 'walk', found another; choose another --run"):
        shelf.prepare("walk", own)
    assert before == {path: path.read_bytes() for path in own.iterdir()}
    (own / POLICY).unlink()
    for name in ("walk", "kinect_walk"):
        with pytest.raises(KinemimicError, match="expected no motion, found that of another run"):
            shelf.prepare(name, own)
    assert before[own / MOTION] == (own / MOTION).read_bytes()
    assert not (own / POLICY).exists()


def test_available_policies_are_named(shelf: ShippedPolicies, tmp_path: Path) -> None:
    with pytest.raises(
        KinemimicError,
        match=r"policy \(walk, kinect_walk\) or a folder with a tracker, found 'r'",
    ):
        shelf.prepare("r", tmp_path / "run")
    with pytest.raises(KinemimicError, match="leave out --capture"):
        shelf.prepare("walk", tmp_path / "run", capture=tmp_path / "walk.skl")
    assert not (tmp_path / "run").exists()


def test_a_recording_that_does_not_ship_is_requested(shelf: ShippedPolicies, tmp_path: Path) -> None:
    fetching = "kinemimic datasets fetch kinect1_bernstein_skl/r2.skl"
    with pytest.raises(KinemimicError, match=rf'expected --capture .*none stated.*"\$\({fetching}\)"$'):
        shelf.prepare("kinect_walk", tmp_path / "run")
    other = tmp_path / "other.skl"
    with pytest.raises(KinemimicError, match=f"found no file; `{fetching}` downloads it"):
        shelf.prepare("kinect_walk", tmp_path / "run", capture=other)
    other.write_text("another")
    with pytest.raises(KinemimicError, match=r"r2\.skl, found another file"):
        shelf.prepare("kinect_walk", tmp_path / "run", capture=other)
    assert not (tmp_path / "run").exists()


@pytest.fixture
def recorded(shelf: ShippedPolicies, tmp_path: Path, walk: Motion) -> tuple[ShippedPolicies, Path]:
    """The same policies with a recording in the catalogue from which the synthetic walk is built."""
    capture = tmp_path / "r2.skl"
    capture.write_text("recorded")
    wanted = replace(recording("kinect1_bernstein_skl/r2.skl"), sha256=file_hash(capture))
    motion = replace(walk, cyclic=False, provenance={"capture": {"sha256": wanted.sha256}})

    def build(_: Path, run: Path) -> None:
        write_text(run / MOTION, motion_to_json(motion))

    return replace(shelf, recording=lambda _: wanted, build_motion=build), capture


def test_a_motion_is_rebuilt_from_its_recording(
    recorded: tuple[ShippedPolicies, Path], tmp_path: Path
) -> None:
    (shelf, capture), run = recorded, tmp_path / "run"
    shelf.prepare("kinect_walk", run, capture=capture)
    made, record = read_motion_json(run / MOTION), read_json(run / RECORD)
    assert record["provenance"]["inputs"]["motion"] == record["trained_motion"] == made.identity
    assert file_hash(run / POLICY) == file_hash(shelf.folder / "kinect_walk" / POLICY)
    # With the motion in place, the recording is not needed.
    (run / POLICY).unlink()
    shelf.prepare("kinect_walk", run)
    assert (run / POLICY).exists()


@pytest.mark.parametrize(("factor", "refused"), [(1.005, False), (1.02, True)])
def test_the_rebuilt_motion_may_differ_slightly(
    recorded: tuple[ShippedPolicies, Path], tmp_path: Path, factor: float, *, refused: bool
) -> None:
    """As with another version of numpy or `retarget`, but not with another duration."""
    shelf, capture = recorded
    record = read_json(shelf.folder / "kinect_walk" / RECORD)
    record["imitates"]["duration_s"] *= factor
    record["provenance"]["inputs"]["motion"] = "learnt"
    write_json(shelf.folder / "kinect_walk" / RECORD, record)
    run = tmp_path / "run"
    if refused:
        with pytest.raises(KinemimicError, match="builds another motion from the recording"):
            shelf.prepare("kinect_walk", run, capture=capture)
        assert not (run / POLICY).exists()
    else:
        shelf.prepare("kinect_walk", run, capture=capture)
        found = read_json(run / RECORD)
        assert found["trained_motion"] == "learnt"
        assert found["provenance"]["inputs"]["motion"] == read_motion_json(run / MOTION).identity


def test_view_evaluates_the_policy_unless_it_has_been_evaluated(shelf: ShippedPolicies) -> None:
    invoke = partial(CliRunner().invoke, view.command, catch_exceptions=False, obj=shelf)
    run = Path("runs/policy-walk")
    told = json.loads(invoke(["--policy", "walk", "--json"]).output)
    assert told["recording"] == f"{run}/view.rrd"
    assert (run / "view.rrd").is_file()
    scores = read_json(run / SCORES)
    assert scores["provenance"]["inputs"]["policy"] == file_hash(shelf.folder / "walk" / POLICY)
    assert scores["survival"]["of"] == 35
    written = (run / SCORES).stat().st_mtime_ns
    assert invoke(["--policy", "walk"]).exit_code == 0
    assert (run / SCORES).stat().st_mtime_ns == written


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--at", "3"], "--at needs --screenshot"),
        (["--seconds", "3"], "--seconds needs --video"),
        (["--trial", "3"], "--trial and --seed need --scenario"),
    ],
)
def test_options_of_view_are_checked_before_the_policy_is_evaluated(
    shelf: ShippedPolicies, options: list[str], message: str
) -> None:
    done = CliRunner().invoke(view.command, ["--policy", "walk", *options], obj=shelf)
    assert done.exit_code == 2 and message in done.output
    assert not Path("runs").exists()


@pytest.mark.parametrize("scores", [{}, [], {"provenance": []}, {"provenance": {"inputs": "x"}}])
def test_scores_without_provenance_belong_to_no_policy(
    shelf: ShippedPolicies, tmp_path: Path, scores: object
) -> None:
    shelf.prepare("walk", tmp_path / "run")
    (tmp_path / "run" / "trajectory.npz").touch()
    write_json(tmp_path / "run" / SCORES, scores)
    assert not evaluated(tmp_path / "run")


def test_evaluate_and_export_take_its_name(shelf: ShippedPolicies) -> None:
    invoke = partial(CliRunner().invoke, catch_exceptions=False, obj=shelf)
    scores = json.loads(invoke(evaluate_command, ["--policy", "walk", "--run", "mine", "--json"]).output)
    assert scores == read_json(Path("mine") / SCORES)
    assert (Path("mine") / POLICY).is_file()
    told = invoke(export.command, ["--policy", "walk", "--format", "onnx", "--out", "out", "--json"]).output
    assert [Path(one["path"]).name for one in json.loads(told)] == ["policy-walk-policy.onnx"]


def test_a_capture_without_a_policy_is_refused() -> None:
    done = CliRunner().invoke(evaluate_command, ["--capture", "x.skl"])
    assert done.exit_code == 2
    assert "add --policy" in done.output


def test_the_list_shows_the_scores(shelf: ShippedPolicies) -> None:
    invoke = partial(CliRunner().invoke, policies.command, catch_exceptions=False, obj=shelf)
    first, second = json.loads(invoke(["--json"]).output)
    assert (first["name"], first["motion_ships"]) == ("walk", True)
    assert (second["name"], second["motion_ships"]) == ("kinect_walk", False)
    assert first["r2_upright"] == {"knee": 0.987, "hip": 0.976}
    assert first["bytes"] == (shelf.folder / "walk" / POLICY).stat().st_size
    printed = " ".join(invoke([]).output.split())
    assert "600/600" in printed and "12/13" in printed and "a made-up walk" in printed
    assert "needs the recording" in printed


def test_onnx_is_skipped_if_it_is_not_installed(
    shelf: ShippedPolicies, tmp_path: Path, walk: Motion, monkeypatch: pytest.MonkeyPatch
) -> None:
    invoke = partial(CliRunner().invoke, export.command, catch_exceptions=False)
    run = write_run(tmp_path / "run", walk)
    monkeypatch.delitem(sys.modules, "kinemimic.train.rollout.export_onnx", raising=False)
    monkeypatch.setitem(sys.modules, "onnx", None)
    with pytest.raises(KinemimicError, match=r"onnx is not installed; pip install 'kinemimic\[onnx\]'"):
        invoke(["--run", str(run), "--format", "onnx"])
    told = json.loads(invoke(["--run", str(run), "--json"]).output)
    assert "json" in {one["format"] for one in told}
    assert "onnx" not in {one["format"] for one in told}


def test_onnx_without_a_policy_is_one_line(shelf: ShippedPolicies, tmp_path: Path, walk: Motion) -> None:
    invoke = partial(CliRunner().invoke, export.command, catch_exceptions=False)
    run = write_run(tmp_path / "run", walk)
    (run / POLICY).unlink()
    with pytest.raises(KinemimicError, match=r"policy\.safetensors: expected a policy"):
        invoke(["--run", str(run), "--format", "onnx"])
    assert invoke(["--from", "walk.mcap", "--format", "onnx"]).exit_code == 2


@pytest.fixture
def with_tracker(shelf: ShippedPolicies) -> ShippedPolicies:
    write_idle_tracker(shelf.folder / "tracker")
    lines = (
        'name = "tracker"',
        'description = "any"',
        'test = ["07"]',
        "variants = 1",
        "budget = 1",
        "seed = 0",
    )
    recipe = "\n".join(["", "[[tracker]]", *lines])
    write_text(shelf.folder / "recipes.toml", RECIPES + recipe)
    return shelf


def test_a_tracker_performs_the_motion_of_the_run(
    with_tracker: ShippedPolicies, tmp_path: Path, walk: Motion
) -> None:
    run = tmp_path / "run"
    with pytest.raises(KinemimicError, match=r"expected a motion for tracker to perform, found no file"):
        with_tracker.prepare("tracker", run)
    write_text(run / MOTION, motion_to_json(walk))
    with_tracker.prepare("tracker", run)
    motion, policy, record = load_trained(run)
    assert motion.duration == walk.duration
    assert policy.critic
    assert record["samples"] == 7
    assert with_tracker.names() == ("walk", "kinect_walk")
    assert with_tracker.trackers() == ("tracker",)


def test_the_list_shows_trackers_too(with_tracker: ShippedPolicies) -> None:
    row = {
        "split": "test", "kind": "walk", "motions": 4, "whole": 0.75, "succeeded": 1.0, "mpjpe_l_mm": 30.0,
        "r2_knee": 0.95, "r2_hip": None,
    }  # fmt: skip
    write_json(with_tracker.folder / "tracker/scores.json", {"summary": [row]})
    listed = CliRunner().invoke(policies.command, obj=with_tracker)
    assert "tracker: any; 7 samples. Of 4 walks" in listed.output
    assert "75 % have no fall from any start phase (R² knee 0.950, hip -)" in listed.output
    found = json.loads(CliRunner().invoke(policies.command, ["--json"], obj=with_tracker).output)
    assert found[-1]["unseen_walks"]["motions"] == 4
    write_json(with_tracker.folder / "tracker/scores.json", {"summary": []})
    assert "Not scored on unseen motions" in CliRunner().invoke(policies.command, obj=with_tracker).output
    still = {**row, "kind": "motion", "motions": 6, "whole": 0.5}
    write_json(with_tracker.folder / "tracker/scores.json", {"summary": [still]})
    listed = CliRunner().invoke(policies.command, obj=with_tracker)
    assert "Of 6 motions without strides that were not in its training, it performs 50 %" in listed.output


def test_a_motion_without_strides_gets_the_tracker_that_has_learned_such(
    with_tracker: ShippedPolicies, tmp_path: Path, walk: Motion
) -> None:
    write_idle_tracker(with_tracker.folder / "standing", STANDING)
    recipe = (with_tracker.folder / "recipes.toml").read_text()
    lines = recipe[recipe.index("[[tracker]]") :].replace('"tracker"', f'"{STANDING}"')
    write_text(with_tracker.folder / "recipes.toml", f"{recipe}\n\n{lines}")
    still = tmp_path / "still"
    write_text(still / MOTION, motion_to_json(exercise(0, 0)))
    with_tracker.prepare("tracker", still)
    assert load_trained(still)[2]["preset"] == STANDING
    gait = tmp_path / "gait"
    write_text(gait / MOTION, motion_to_json(walk))
    with pytest.raises(KinemimicError, match=r"expected a motion without strides, .* use --policy tracker"):
        with_tracker.prepare(STANDING, gait)
    assert not (gait / POLICY).exists()


def test_a_tracker_may_be_a_folder(with_tracker: ShippedPolicies, tmp_path: Path, walk: Motion) -> None:
    run = tmp_path / "run"
    write_text(run / MOTION, motion_to_json(walk))
    with_tracker.prepare(str(write_idle_tracker(tmp_path / "own")), run)
    assert load_trained(run)[2]["samples"] == 7
    other = write_run(tmp_path / "other", walk, bias=0.5)
    with pytest.raises(KinemimicError, match="expected a tracker, which performs any motion"):
        with_tracker.prepare(str(other), run)
    with pytest.raises(
        KinemimicError, match="expected policy 'tracker', found another; choose another --run"
    ):
        with_tracker.prepare("tracker", other)
