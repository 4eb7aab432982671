"""What ships gets into a run folder, performs there, and never takes the place of somebody's own work."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
from click.testing import CliRunner
from peers.shelf import RECIPES, write_run

from kinemimic.evaluate.export import command as export
from kinemimic.evaluate.policies import command as policies
from kinemimic.evaluate.policies import shipped
from kinemimic.evaluate.policies.recipe import recording
from kinemimic.evaluate.policies.shipped import MOTION, POLICY, RECORD, SCORES, evaluated, unpack
from kinemimic.evaluate.scoring import command as stage
from kinemimic.evaluate.view import command as view
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import file_hash, read_json, write_json, write_text
from kinemimic.retarget.formats.motion_json import motion_to_json, read_motion_json
from kinemimic.retarget.humanoid.motion import Motion


@pytest.fixture
def shelf(tmp_path: Path, walk: Motion, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Two policies that ship: of a short performance, and of a recording, without its motion."""
    folder = tmp_path / "shelf"
    once = replace(walk, cyclic=False)
    write_run(folder / "walk", once)
    write_run(folder / "kinect_walk", once, bias=0.01)
    (folder / "kinect_walk" / MOTION).unlink()
    (folder / "recipes.toml").write_text(RECIPES)
    monkeypatch.setattr(policies, "POLICIES", folder)
    monkeypatch.setattr(shipped, "unpack", partial(unpack, folder=folder))
    monkeypatch.chdir(tmp_path)
    return folder


def test_a_policy_and_its_motion_are_put_into_the_run_folder_once(shelf: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    shipped.unpack("walk", run)
    assert {path.name for path in run.iterdir()} == {MOTION, POLICY, RECORD}
    for path in run.iterdir():
        assert path.read_bytes() == (shelf / "walk" / path.name).read_bytes()
    before = {path: path.stat().st_mtime_ns for path in run.iterdir()}
    shipped.unpack("walk", run)
    assert before == {path: path.stat().st_mtime_ns for path in run.iterdir()}
    # Interrupted before its end, it is made whole.
    (run / POLICY).unlink()
    shipped.unpack("walk", run)
    assert file_hash(run / POLICY) == file_hash(shelf / "walk" / POLICY)


def test_ones_own_policy_or_motion_is_not_replaced(shelf: Path, tmp_path: Path, walk: Motion) -> None:
    own = write_run(tmp_path / "own", walk, bias=0.5)
    before = {path: path.read_bytes() for path in own.iterdir()}
    with pytest.raises(KinemimicError, match="expected the policy 'walk', found another; name another --run"):
        shipped.unpack("walk", own)
    assert before == {path: path.read_bytes() for path in own.iterdir()}
    (own / POLICY).unlink()
    for name in ("walk", "kinect_walk"):
        with pytest.raises(KinemimicError, match="expected no motion, found one of another run"):
            shipped.unpack(name, own)
    assert before[own / MOTION] == (own / MOTION).read_bytes()
    assert not (own / POLICY).exists()


def test_what_ships_is_named(shelf: Path, tmp_path: Path) -> None:
    with pytest.raises(
        KinemimicError, match=r"expected a policy that ships \(walk, kinect_walk\), found 'r'"
    ):
        shipped.unpack("r", tmp_path / "run")
    with pytest.raises(KinemimicError, match="leave out --capture"):
        shipped.unpack("walk", tmp_path / "run", capture=tmp_path / "walk.skl")
    assert not (tmp_path / "run").exists()


def test_a_recording_that_does_not_ship_is_asked_for(shelf: Path, tmp_path: Path) -> None:
    fetching = "kinemimic datasets fetch kinect1_bernstein_skl/r2.skl"
    with pytest.raises(KinemimicError, match=rf'expected --capture .*none stated.*"\$\({fetching}\)"$'):
        shipped.unpack("kinect_walk", tmp_path / "run")
    other = tmp_path / "other.skl"
    with pytest.raises(KinemimicError, match=f"found no file; `{fetching}` fetches it"):
        shipped.unpack("kinect_walk", tmp_path / "run", capture=other)
    other.write_text("another")
    with pytest.raises(KinemimicError, match=r"r2\.skl, found another file"):
        shipped.unpack("kinect_walk", tmp_path / "run", capture=other)
    assert not (tmp_path / "run").exists()


@pytest.fixture
def recorded(tmp_path: Path, walk: Motion, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A recording that the catalogue means; the stages on the way make the made-up walk of it."""
    capture = tmp_path / "r2.skl"
    capture.write_text("recorded")
    wanted = replace(recording("kinect1_bernstein_skl/r2.skl"), sha256=file_hash(capture))
    monkeypatch.setattr(shipped, "recording", lambda _: wanted)
    motion = replace(walk, cyclic=False, provenance={"capture": {"sha256": wanted.sha256}})
    monkeypatch.setattr("kinemimic.pipeline.ingest.ingest", lambda capture, run: None)
    monkeypatch.setattr("kinemimic.pipeline.convert.convert", lambda run: None)
    monkeypatch.setattr(
        "kinemimic.retarget.command.retarget", lambda run: write_text(run / MOTION, motion_to_json(motion))
    )
    return capture


def test_a_motion_is_made_again_of_its_recording(shelf: Path, tmp_path: Path, recorded: Path) -> None:
    run = tmp_path / "run"
    shipped.unpack("kinect_walk", run, capture=recorded)
    made, record = read_motion_json(run / MOTION), read_json(run / RECORD)
    assert record["provenance"]["inputs"]["motion"] == record["learnt_motion"] == made.identity
    assert file_hash(run / POLICY) == file_hash(shelf / "kinect_walk" / POLICY)
    # A run that has the recording's motion needs it no more.
    (run / POLICY).unlink()
    shipped.unpack("kinect_walk", run)
    assert (run / POLICY).exists()


@pytest.mark.parametrize(("factor", "refused"), [(1.005, False), (1.02, True)])
def test_the_motion_may_be_a_little_another(
    shelf: Path, tmp_path: Path, recorded: Path, factor: float, *, refused: bool
) -> None:
    """As another version of numpy makes it, or of the retargeting; not one that walks at another pace."""
    record = read_json(shelf / "kinect_walk" / RECORD)
    record["imitates"]["duration_s"] *= factor
    record["provenance"]["inputs"]["motion"] = "learnt"
    write_json(shelf / "kinect_walk" / RECORD, record)
    run = tmp_path / "run"
    if refused:
        with pytest.raises(KinemimicError, match="makes another motion of the recording"):
            shipped.unpack("kinect_walk", run, capture=recorded)
        assert not (run / POLICY).exists()
    else:
        shipped.unpack("kinect_walk", run, capture=recorded)
        found = read_json(run / RECORD)
        assert found["learnt_motion"] == "learnt"
        assert found["provenance"]["inputs"]["motion"] == read_motion_json(run / MOTION).identity


def test_a_view_lets_it_perform_where_nobody_has_yet(shelf: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    invoke = partial(CliRunner().invoke, view.command, catch_exceptions=False)
    run = Path("runs/policy-walk")
    told = json.loads(invoke(["--policy", "walk", "--json"]).output)
    assert told["recording"] == f"{run}/view.rrd"
    assert (run / "view.rrd").is_file()
    scores = read_json(run / SCORES)
    assert scores["provenance"]["inputs"]["policy"] == file_hash(shelf / "walk" / POLICY)
    assert scores["survival"]["of"] == 35
    monkeypatch.setattr(stage, "evaluate", lambda *_: pytest.fail("it was evaluated already"))
    assert invoke(["--policy", "walk"]).exit_code == 0


@pytest.mark.parametrize("scores", [{}, [], {"provenance": []}, {"provenance": {"inputs": "x"}}])
def test_scores_that_do_not_say_of_what_are_of_no_policy(shelf: Path, tmp_path: Path, scores: object) -> None:
    shipped.unpack("walk", tmp_path / "run")
    (tmp_path / "run" / "trajectory.npz").touch()
    write_json(tmp_path / "run" / SCORES, scores)
    assert not evaluated(tmp_path / "run")


def test_evaluate_and_export_take_its_name(shelf: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stage, "evaluate", lambda run, **_: {"run": str(run)})
    invoke = partial(CliRunner().invoke, catch_exceptions=False)
    for options, run in (([], "runs/policy-walk"), (["--run", "mine"], "mine")):
        told = invoke(stage.command, ["--policy", "walk", *options, "--json"]).output
        assert json.loads(told) == {"run": run}
        assert (Path(run) / POLICY).is_file()
    told = invoke(export.command, ["--policy", "walk", "--format", "onnx", "--out", "out", "--json"]).output
    assert [Path(one["path"]).name for one in json.loads(told)] == ["policy-walk-policy.onnx"]


def test_a_capture_without_a_policy_is_refused() -> None:
    done = CliRunner().invoke(stage.command, ["--capture", "x.skl"])
    assert done.exit_code == 2
    assert "name it with --policy" in done.output


def test_the_list_says_how_well_each_does(shelf: Path) -> None:
    invoke = partial(CliRunner().invoke, policies.command, catch_exceptions=False)
    first, second = json.loads(invoke(["--json"]).output)
    assert (first["name"], first["motion_ships"]) == ("walk", True)
    assert (second["name"], second["motion_ships"]) == ("kinect_walk", False)
    assert first["r2"] == {"knee": 0.987, "hip": 0.976}
    assert first["bytes"] == (shelf / "walk" / POLICY).stat().st_size
    printed = " ".join(invoke([]).output.split())
    assert "600/600" in printed and "12/13" in printed and "a made-up walk" in printed
    assert "asks for the recording" in printed


def test_onnx_is_left_out_of_all_where_it_cannot_be_had(
    shelf: Path, tmp_path: Path, walk: Motion, monkeypatch: pytest.MonkeyPatch
) -> None:
    invoke = partial(CliRunner().invoke, export.command, catch_exceptions=False)
    run = write_run(tmp_path / "run", walk)
    monkeypatch.delitem(sys.modules, "kinemimic.train.rollout.export_onnx", raising=False)
    monkeypatch.setitem(sys.modules, "onnx", None)
    with pytest.raises(KinemimicError, match=r"onnx is not installed; pip install 'kinemimic\[onnx\]'"):
        invoke(["--run", str(run), "--format", "onnx"])
    monkeypatch.setattr(export, "find_spec", lambda _: None)
    told = json.loads(invoke(["--run", str(run), "--json"]).output)
    assert "json" in {one["format"] for one in told}
    assert "onnx" not in {one["format"] for one in told}


def test_onnx_of_a_run_without_a_policy_is_one_clear_line(shelf: Path, tmp_path: Path, walk: Motion) -> None:
    invoke = partial(CliRunner().invoke, export.command, catch_exceptions=False)
    run = write_run(tmp_path / "run", walk)
    (run / POLICY).unlink()
    with pytest.raises(KinemimicError, match=r"policy\.safetensors: expected a policy"):
        invoke(["--run", str(run), "--format", "onnx"])
    assert invoke(["--from", "walk.mcap", "--format", "onnx"]).exit_code == 2
