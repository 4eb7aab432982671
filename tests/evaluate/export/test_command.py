"""kinemimic export: what is asked for is written and listed; errors for missing or damaged files."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from peers.exported import of
from samples.motion import rigid_walk

from kinemimic.evaluate.export.both import require_both
from kinemimic.evaluate.export.command import command, export_run
from kinemimic.evaluate.export.files import WRITERS, export
from kinemimic.evaluate.export.motion_source import SOURCES, sources_of_run
from kinemimic.pipeline.cli.main import main
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.sidecars import note_path, write_note
from kinemimic.pipeline.files.store import read_json
from kinemimic.pipeline.ingest import ingest
from kinemimic.pipeline.readers.recognise import read
from kinemimic.retarget.formats.read_mcap import read_mcap
from kinemimic.retarget.formats.write_mcap import write_mcap
from kinemimic.retarget.humanoid.motion import Motion


def test_the_body_alone_needs_no_motion(run: Path, tmp_path: Path) -> None:
    other = tmp_path / "walk"
    shutil.copytree(run, other)
    (other / "trajectory.npz").write_bytes(b"damaged")
    written = export_run(other, formats=["urdf", "mjcf"], out=tmp_path / "out")
    assert [(one.what, one.format) for one in written] == [("humanoid", "urdf"), ("humanoid", "mjcf")]
    with pytest.raises(KinemimicError, match=r"trajectory\.npz"):
        export_run(other, formats=["bvh"], out=tmp_path / "out")


def test_everything_is_written_and_listed_once(run: Path, files: list[dict[str, object]]) -> None:
    kinds = [(record["what"], record["format"]) for record in files]
    expected = [(what, form) for what in SOURCES for form in WRITERS]
    both = [("both", "mcap"), ("both", "glb")]
    assert kinds == [*expected, *both, ("humanoid", "urdf"), ("humanoid", "mjcf")]
    top = run / "export"
    written = {Path(str(record["path"])).relative_to(top) for record in files}
    motions = [path for path in written if "humanoid" not in path.name]
    notes = {note_path(top / path).relative_to(top) for path in motions}
    assert {path.relative_to(top) for path in top.rglob("*") if path.is_file()} == written | notes
    # A subfolder for each program, and what it opens.
    assert {path.parts[0]: path.suffix for path in written if path.parts[0] != "opensim"} == {
        "blender": ".bvh", "tables": ".csv", "python": ".npz", "deepmimic": ".json", "kinemimic": ".json",
        "foxglove": ".mcap", "web": ".glb", "ros": ".urdf", "mujoco": ".xml",
    }  # fmt: skip
    assert {path.suffix for path in written if path.parts[0] == "opensim"} == {".trc", ".mot"}
    for record in files:
        assert Path(str(record["path"])).stat().st_size == record["bytes"]


def test_provenance_names_inputs_and_simulation(
    run: Path, files: list[dict[str, object]], tmp_path: Path
) -> None:
    note = json.loads((run / "export" / "blender" / "walk-capture.provenance.json").read_text())
    assert (note["stage"], note["source"], note["simulated"]) == ("export", "walk.skl", True)
    assert len(note["inputs"]["clip"]) == 64
    for form in ("bvh", "trc", "mot", "deepmimic"):
        assert ingest(of(files, "capture", form), tmp_path / form).simulated, form


@pytest.mark.parametrize(("what", "made"), [("reference", False), ("simulated", True)])
def test_rollouts_from_a_real_capture_are_marked_as_simulated(
    run: Path, tmp_path: Path, what: str, made: bool
) -> None:
    source = sources_of_run(run)[what]
    real = replace(source, clip=replace(source.clip, provenance={}), provenance={})
    (written,) = export({what: real}, ["bvh"], tmp_path, "walk")
    assert json.loads(written.path.with_suffix(".provenance.json").read_text())["simulated"] is made


def test_repeated_exports_are_byte_identical(
    run: Path, files: list[dict[str, object]], tmp_path: Path
) -> None:
    """And --out takes the files as they are, without subfolders."""
    CliRunner().invoke(command, ["--run", str(run), "--out", str(tmp_path)], catch_exceptions=False)
    there = [path for path in (run / "export").rglob("*") if path.is_file()]
    assert len(there) > 30
    assert {path.name for path in tmp_path.iterdir()} == {path.name for path in there}
    for path in there:
        assert (tmp_path / path.name).read_bytes() == path.read_bytes(), path.name


def test_a_recording_of_both_needs_a_trajectory(run: Path, tmp_path: Path) -> None:
    (tmp_path / "motion.json").write_bytes((run / "motion.json").read_bytes())
    for asked in (["--format", "glb"], ["--what", "both"]):
        with pytest.raises(KinemimicError, match=r"expected motion\.json and trajectory\.npz"):
            CliRunner().invoke(command, ["--run", str(tmp_path), *asked], catch_exceptions=False)
    assert not (tmp_path / "export").exists()
    result = CliRunner().invoke(command, ["--run", str(tmp_path), "--json"], catch_exceptions=False)
    assert {record["what"] for record in json.loads(result.stdout)} == {"reference", "humanoid"}


@pytest.mark.parametrize("what", ["capture", "reference"])
def test_what_selects_motions_alone(run: Path, tmp_path: Path, what: str) -> None:
    arguments = ["--run", str(run), "--what", what, "--out", str(tmp_path), "--json"]
    result = CliRunner().invoke(command, arguments, catch_exceptions=False)
    assert {record["what"] for record in json.loads(result.stdout)} == {what}
    with pytest.raises(KinemimicError, match="expected formats of a motion, found urdf"):
        export_run(run, what=[what], formats=["bvh", "urdf"], out=tmp_path)


@pytest.mark.parametrize("simulated", [False, True])
def test_a_simulated_motion_that_is_exported_again_stays_simulated(tmp_path: Path, simulated: bool) -> None:
    """A rollout that follows a real recording: only its sidecar file says that it is simulated."""
    source, walk = tmp_path / "walk.mcap", rigid_walk(60, 60.0)
    write_mcap(source, Motion(60.0, walk.root, walk.rotations, np.ones((60, 2), dtype=bool), cyclic=False))
    write_note(note_path(source), {"simulated": simulated})
    arguments = ["--from", str(source), "--format", "bvh", "--out", str(tmp_path / "out")]
    CliRunner().invoke(command, arguments, catch_exceptions=False)
    (note,) = (tmp_path / "out").glob("*.provenance.json")
    assert read_json(note)["simulated"] is simulated


def test_only_requested_formats_are_written(run: Path, tmp_path: Path) -> None:
    arguments = ["--run", str(run), "--what", "reference", "--format", "npz", "--format", "bvh"]
    result = CliRunner().invoke(command, [*arguments, "--out", str(tmp_path / "new")], catch_exceptions=False)
    names = sorted(path.name for path in (tmp_path / "new").iterdir())
    assert names == ["walk-reference.bvh", "walk-reference.npz", "walk-reference.provenance.json"]
    assert "walk-reference.bvh" in result.stdout and "one cycle" in result.stdout


def test_a_damaged_mcap_is_named_and_recovered(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = tmp_path / "long.mcap"
    random = rigid_walk(400, 60.0)
    motion = Motion(60.0, random.root, random.rotations, np.ones((400, 2), dtype=bool), cyclic=False)
    write_mcap(whole, motion)
    short = tmp_path / "cut.mcap"
    short.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    with pytest.raises(SystemExit) as caught:
        main(["export", "--from", str(short), "--format", "mcap"])
    assert caught.value.code == 2
    said = capsys.readouterr().err
    assert "cut.mcap: expected a complete MCAP, found it truncated" in said and said.count("\n") == 1
    assert not (tmp_path / "export").exists()
    arguments = ["--from", str(short), "--recover", "--format", "mcap", "--format", "bvh", "--json"]
    result = CliRunner().invoke(command, arguments, catch_exceptions=False)
    (bvh, mcap) = json.loads(result.stdout)
    assert Path(mcap["path"]).name == "cut-recovered.mcap" and "truncated" in mcap["note"]
    back = read_mcap(Path(mcap["path"]))
    assert 80 < len(back.root) == mcap["frames"] == len(read(Path(bvh["path"])).times) < 400
    np.testing.assert_array_equal(back.rotations, motion.rotations[: len(back.root)])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--run", "none"], "expected a run folder, found none"),
        (["--run", "."], "expected quaternions.parquet, motion.json, trajectory.npz, found none"),
        (["--run", ".", "--what", "simulated"], "motion.json: expected a file, found none"),
        (["--recover"], "--recover needs --from"),
        (["--from", "a.mcap", "--what", "capture"], "leave out --what and --pass"),
        (["--from", "a.mcap", "--policy", "walk"], "leave out --run and --policy"),
        (["--from", "a.mcap", "--run", "."], "leave out --run and --policy"),
        (["--what", "both", "--format", "mcap", "--format", "bvh"], "written as mcap and glb: leave out bvh"),
        (["--what", "reference", "--pass", "1"], "--pass selects a pass of the capture"),
        (["--what", "capture", "--format", "glb"], "a .glb shows both figures of a run: use --what both"),
        (["--what", "capture", "--format", "onnx"], "onnx: not a motion; leave out --what"),
        (["--what", "both", "--format", "bvh"], "--what both is written as mcap and glb"),
        (["--from", "a.mcap"], "expected an MCAP file, found none"),
        (["--format", "fbx"], "'fbx' is not one of"),
    ],
)  # fmt: skip
def test_invalid_options_are_one_line_errors(
    arguments: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as caught:
        main(["export", *arguments])
    assert caught.value.code == 2
    assert message in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("out", ["/dev/null", "/proc/nowhere"])
def test_a_folder_that_cannot_be_made_is_one_line(run: Path, out: str) -> None:
    with pytest.raises(KinemimicError, match=f"--out: expected a folder .*{out}.*; choose another"):
        export_run(run, what=["reference"], formats=["csv"], out=Path(out))


def test_the_file_that_both_figures_lack_is_named(run: Path, tmp_path: Path) -> None:
    shutil.copy(run / "motion.json", tmp_path / "motion.json")
    with pytest.raises(KinemimicError, match=r"found no trajectory\.npz; run `kinemimic evaluate`"):
        require_both(tmp_path)
