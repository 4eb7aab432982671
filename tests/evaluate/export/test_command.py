"""kinemimic export: every motion in every format, read back; errors for missing or damaged files."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from click.testing import CliRunner
from samples.converted import write_converted
from samples.motion import rigid_walk, seen_clip

from kinemimic.evaluate.export.both import pair_of_run, require_both
from kinemimic.evaluate.export.command import WRITERS, command, export, export_run
from kinemimic.evaluate.export.motion_source import SOURCES, source_of_mcap, sources_of_run
from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.cli.main import main
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.sidecars import note_path
from kinemimic.pipeline.gait.curve_metrics import joint_fits
from kinemimic.pipeline.ingest import ingest
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.kinematics.orientation.rest_pose import recorded_knees
from kinemimic.pipeline.kinematics.rotations import (
    angle_between,
    conjugate,
    from_axis_angle,
    from_rotvec,
    multiply,
)
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.pipeline.readers.mocap.deepmimic import read_deepmimic
from kinemimic.pipeline.readers.recognise import read
from kinemimic.pipeline.writers.mot import coordinates
from kinemimic.retarget.formats.motion_json import motion_to_json, read_motion_json
from kinemimic.retarget.formats.read_mcap import read_mcap
from kinemimic.retarget.formats.write_mcap import write_mcap
from kinemimic.retarget.humanoid.motion import Motion, joint_angles
from kinemimic.train.rollout.trajectory import Trajectory

FRAMES = 90


def captured() -> Clip:
    """Two passes of 30 and 60 frames, seen by a sensor at uneven times."""
    shown = rigid_walk(FRAMES, 30.0)
    steps = np.tile([0.032, 0.033, 0.035], FRAMES // 3)
    return replace(
        seen_clip(shown.joints, 50.0 + np.cumsum(steps)),
        passes=np.repeat([0, 1], [30, 60]).astype(np.int32),
        provenance={"source": "walk.skl", "simulated": True},
    )


@pytest.fixture(scope="module")
def run(
    tmp_path_factory: pytest.TempPathFactory, walk: Motion, performance: Callable[..., Trajectory]
) -> Path:
    folder = tmp_path_factory.mktemp("export") / "walk"
    folder.mkdir()
    write_converted(folder, captured())
    (folder / "motion.json").write_text(motion_to_json(walk))
    identity = read_motion_json(folder / "motion.json").identity
    replace(performance(2, FRAMES, offset=0.1), motion=identity).save(folder / "trajectory.npz")
    return folder


@pytest.fixture(scope="module")
def files(run: Path) -> list[dict[str, object]]:
    """The --json output of an export of everything."""
    result = CliRunner().invoke(command, ["--run", str(run), "--json"], catch_exceptions=False)
    assert result.exit_code == 0
    return json.loads(result.stdout)  # type: ignore[no-any-return]


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


def of(files: list[dict[str, object]], what: str, form: str) -> Path:
    return next(Path(str(r["path"])) for r in files if (r["what"], r["format"]) == (what, form))


@pytest.mark.parametrize("what", list(SOURCES))
def test_positions_agree_across_formats(run: Path, files: list[dict[str, object]], what: str) -> None:
    source = sources_of_run(run)[what]
    expected, _ = source.poses.kinematics()
    for form in ("bvh", "trc"):
        back = read(of(files, what, form))
        index = [back.skeleton.index(node) for node in NODES]
        wanted = source.clip.positions if form == "trc" else expected
        np.testing.assert_allclose(back.positions[:, index], wanted, atol=1e-6)
    for motion in (
        read_motion_json(of(files, what, "json")),
        read_mcap(of(files, what, "mcap")),
    ):
        # These two have rigid bones; a capture's are as long as they mostly were.
        found = motion.kinematics()[0]
        np.testing.assert_allclose(found, expected, atol=0.02 if what == "capture" else 1e-8)
    angles = read(of(files, what, "mot")).angles
    assert angles is not None
    for name, curve in source.angles.items():
        if what != "capture":  # its times are uneven, and those of a MOT even
            np.testing.assert_allclose(angles[name], curve, atol=1e-8)
    peers = read_deepmimic(of(files, what, "deepmimic"))
    told = next(r["frames"] for r in files if (r["what"], r["format"]) == (what, "deepmimic"))
    assert len(peers.times) == told == len(expected) + (what == "reference")


def test_a_cycle_is_closed_for_deepmimic(walk: Motion, files: list[dict[str, object]]) -> None:
    content = json.loads(of(files, "reference", "deepmimic").read_text())
    assert content["Loop"] == "wrap"
    first, last = np.array(content["Frames"][0]), np.array(content["Frames"][-1])
    assert len(content["Frames"]) == len(walk.root) + 1
    np.testing.assert_allclose(last[4:], first[4:], atol=1e-9)
    legs = 0.78 / 0.831416  # of the body's leg in the format's
    np.testing.assert_allclose((last - first)[1:4] * legs, [walk.cycle_offset[0], 0.0, 0.0], atol=1e-5)
    assert json.loads(of(files, "simulated", "deepmimic").read_text())["Loop"] == "none"


def test_the_capture_is_the_longest_or_the_requested_pass(run: Path, tmp_path: Path) -> None:
    clip = captured()
    source = sources_of_run(run, ["capture"])["capture"]
    np.testing.assert_allclose(source.clip.times, clip.times[30:] - clip.times[30], atol=1e-12)
    assert source.starts_at == clip.times[30]
    assert source.note("csv") == "from a SIMULATED capture; pass 1 of 2"
    assert len(sources_of_run(run, ["capture"], 0)["capture"].clip.times) == 30
    with pytest.raises(KinemimicError, match="expected pass 2, found 2 passes, counted from 0"):
        sources_of_run(run, ["capture"], 2)


def test_a_recorded_head_rotation_is_kept(tmp_path: Path) -> None:
    """A head that looks a little to the left, all the time."""
    clip, neck = captured(), NODES.index("shoulder_center")
    assert clip.rotations is not None
    turned = clip.rotations.copy()
    turned[:, neck] = from_axis_angle("Z", np.full(len(turned), 0.4))
    write_converted(tmp_path, replace(clip, rotations=turned))
    exported = sources_of_run(tmp_path)["capture"].on_nodes.rotations[:, neck]
    assert np.abs(angle_between(exported, turned[:1, neck])).max() < 1e-6


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


def test_the_body_is_a_tree_of_bodies(files: list[dict[str, object]]) -> None:
    robot = ET.fromstring(of(files, "humanoid", "urdf").read_text())
    joints = [joint.get("type") for joint in robot.findall("joint")]
    assert joints.count("revolute") == 3 * 14 and joints.count("fixed") == 1
    assert len(robot.findall("link")) == 16 + 2 * 14  # two of little mass between the hinges of each joint


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


def test_both_figures_are_in_one_recording(run: Path, files: list[dict[str, object]], walk: Motion) -> None:
    """Simulated and reference, frame by frame, as the trajectory has them; marked as simulated."""
    trajectory = Trajectory.load(run / "trajectory.npz", read_motion_json(run / "motion.json"))
    glb = of(files, "both", "glb").read_bytes()
    scene = json.loads(glb[20 : 20 + int.from_bytes(glb[12:16], "little")])
    assert [scene["nodes"][k]["name"] for k in scene["scenes"][0]["nodes"]] == ["simulated", "reference"]
    record = next(r for r in files if (r["what"], r["format"]) == ("both", "glb"))
    assert (record["frames"], record["rate"]) == (FRAMES + 1, 30.0)  # and the start
    assert scene["asset"]["extras"]["provenance"]["simulated"] is True
    pair = pair_of_run(run)
    for figure, root, rotations in zip(
        pair.figures,
        (trajectory.root, trajectory.reference_root),
        (trajectory.rotations, trajectory.reference_rotations),
        strict=True,
    ):
        np.testing.assert_array_equal(figure.motion.root[1:], root[0])
        np.testing.assert_allclose(angle_between(figure.motion.rotations[1:], rotations[0]), 0.0, atol=1e-7)
        np.testing.assert_allclose(figure.motion.root[0], walk.root[0], atol=1e-9)
    for form in ("mcap", "glb"):
        note = json.loads(note_path(of(files, "both", form)).read_text())
        assert note["simulated"] is True and len(note["inputs"]["trajectory"]) == 64


def test_a_recording_of_both_needs_a_trajectory(run: Path, tmp_path: Path) -> None:
    (tmp_path / "motion.json").write_bytes((run / "motion.json").read_bytes())
    for asked in (["--format", "glb"], ["--what", "both"]):
        with pytest.raises(KinemimicError, match=r"expected motion\.json and trajectory\.npz"):
            CliRunner().invoke(command, ["--run", str(tmp_path), *asked], catch_exceptions=False)
    assert not (tmp_path / "export").exists()
    result = CliRunner().invoke(command, ["--run", str(tmp_path), "--json"], catch_exceptions=False)
    assert {record["what"] for record in json.loads(result.stdout)} == {"reference", "humanoid"}


def table_of(path: Path) -> dict[str, Array]:
    """The columns of a CSV, of a MOT or, times alone, of a TRC."""
    lines = path.read_text().splitlines()
    if path.suffix == ".trc":
        return {"time": np.array([float(line.split("\t")[1]) for line in lines[5:] if line.strip()])}
    split = "," if path.suffix == ".csv" else "\t"
    if path.suffix == ".mot":
        lines = lines[lines.index("endheader") + 1 :]
    rows = np.array([[float(cell or "nan") for cell in line.split(split)] for line in lines[1:]])
    return dict(zip(lines[0].split(split), rows.T, strict=True))


def test_simulated_and_reference_differ_at_equal_times_as_the_scores_say(
    run: Path, files: list[dict[str, object]], walk: Motion
) -> None:
    trajectory = Trajectory.load(run / "trajectory.npz", read_motion_json(run / "motion.json"))
    fit = joint_fits(joint_angles(trajectory.reference_rotations[0]), joint_angles(trajectory.rotations[0]))
    moved, wanted = (table_of(of(files, what, "csv")) for what in ("simulated", "reference"))
    times = moved["time_s"]
    np.testing.assert_allclose(times, np.arange(FRAMES + 1) / 30.0, atol=1e-6)
    for side in ("left", "right"):
        knee = wanted[f"knee_{side}_deg"]
        # One cycle; the file of the reference ends a frame before it begins again.
        at = np.interp(times, wanted["time_s"], knee, period=walk.duration)
        apart = moved[f"knee_{side}_deg"] - at
        assert abs(apart[0]) < 1e-3  # the start is the reference's pose
        rms = float(np.sqrt(np.mean(apart[1:] ** 2)))
        assert rms == pytest.approx(getattr(fit["knee"], side).rmse_deg, abs=0.1)


@pytest.mark.parametrize("what", list(SOURCES))
def test_all_files_of_a_motion_have_one_clock(files: list[dict[str, object]], what: str) -> None:
    """The first frame is at 0; the sidecar file says when that was."""
    clocks = [table_of(of(files, what, form)) for form in ("csv", "mot", "trc")]
    starts = [next(iter(columns.values()))[0] for columns in clocks]
    assert starts == [0.0, 0.0, 0.0]
    note = json.loads(note_path(of(files, what, "csv")).read_text())
    assert note["starts_at_s"] == (captured().times[30] if what == "capture" else 0.0)


def test_a_capture_has_one_pelvis(tmp_path: Path) -> None:
    """A recorded one that leans further than hips and spine show: the hips of CSV and MOT follow it."""
    clip, pelvis = captured(), NODES.index("hip_center")
    assert clip.rotations is not None
    turned = clip.rotations.copy()
    lean = from_axis_angle("Y", np.full(len(turned), 0.1))
    turned[:, pelvis] = multiply(turned[:, pelvis], lean)
    for node in ("spine", "hip_left", "hip_right"):
        turned[:, NODES.index(node)] = multiply(conjugate(lean), turned[:, NODES.index(node)])
    even = replace(clip, rotations=turned, times=np.arange(FRAMES) / 30.0)
    write_converted(tmp_path, even)
    source = sources_of_run(tmp_path)["capture"]
    measured, shown = coordinates(source.on_nodes), leg_angles(clip.positions)
    for side in ("left", "right"):
        flexion = measured[f"hip_flexion_{side[0]}"]
        np.testing.assert_allclose(np.degrees(source.angles[f"hip_{side}"]), flexion, atol=1e-6)
        leaning = np.degrees(shown[f"hip_{side}"][30:] + 0.1)
        np.testing.assert_allclose(flexion, leaning, atol=1.0)


def test_the_knees_of_the_simulated_body_are_its_own(run: Path, tmp_path: Path) -> None:
    """A swing out of hyperextension, too fast for a noisy sensor, of a knee that gives way to the side."""
    source = sources_of_run(run, ["simulated"])["simulated"]
    motion, knee = source.motion, NODES.index("knee_left")
    degrees = np.tile([-1.0, -5.7, -10.6, -8.6, -4.0, 12.7, 36.0, 60.0, 30.0, 5.0], 9)
    turns = motion.rotations[: len(degrees)].copy()
    turns[:, knee] = from_rotvec(np.radians(np.stack([np.full(90, 5.0), degrees, np.zeros(90)], axis=-1)))
    motion = replace(
        motion, rotations=turns, root=motion.root[: len(degrees)], contacts=motion.contacts[: len(degrees)]
    )
    write_mcap(tmp_path / "swing.mcap", motion)
    swing = {"simulated": source_of_mcap(tmp_path / "swing.mcap", recover=False)}
    bvh, trc, table = (one.path for one in export(swing, ["mot", "bvh", "trc"], tmp_path, "swing"))
    np.testing.assert_allclose(-table_of(table)["knee_angle_l"], degrees, atol=1e-4)
    back = read(bvh)
    found = leg_angles(to_nodes(back)[0], times=back.times, knees=recorded_knees(back))
    np.testing.assert_allclose(np.degrees(found["knee_left"]), degrees, atol=0.1)
    # Points show no hinge: the bend to the side counts, too, but the sign is right.
    back = read(trc)
    seen = np.degrees(leg_angles(to_nodes(back)[0], times=back.times)["knee_left"])
    far = np.abs(degrees) > 5.0
    assert (np.sign(seen[far]) == np.sign(degrees[far])).all()


@pytest.mark.parametrize("what", ["capture", "reference"])
def test_what_selects_motions_alone(run: Path, tmp_path: Path, what: str) -> None:
    arguments = ["--run", str(run), "--what", what, "--out", str(tmp_path), "--json"]
    result = CliRunner().invoke(command, arguments, catch_exceptions=False)
    assert {record["what"] for record in json.loads(result.stdout)} == {what}
    with pytest.raises(KinemimicError, match="expected formats of a motion, found urdf"):
        export_run(run, what=[what], formats=["bvh", "urdf"], out=tmp_path)


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
