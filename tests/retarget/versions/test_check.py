"""A locked data set passes its check; every change is reported by name."""

from __future__ import annotations

import json
import math
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.canonical import Canonical
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, multiply
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.retarget.versions import check as module
from kinemimic.retarget.versions.build import build_capture, built_path
from kinemimic.retarget.versions.build import command as build_command
from kinemimic.retarget.versions.check import check
from kinemimic.retarget.versions.check import command as check_command
from kinemimic.retarget.versions.manifest import Manifest, lock
from kinemimic.retarget.versions.manifest import command as lock_command
from kinemimic.retarget.versions.params import PARAMS, Params

MANIFEST = Path("datasets/versions/manifest.json")
NAME = "kinect_walk"


def bent(motion: Canonical, degrees: float, node: str, frame: int) -> Canonical:
    """The motion with one joint rotated in one frame."""
    rotations = motion.arrays["rotations"].copy()
    turn = from_axis_angle("Y", np.array(math.radians(degrees)))
    rotations[frame, NODE_INDEX[node]] = multiply(rotations[frame, NODE_INDEX[node]], turn)
    return replace(motion, arrays={**motion.arrays, "rotations": np.round(rotations, 5) + 0.0})


def test_a_locked_data_set_passes(root: Path, params: Params) -> None:
    assert check(params, root) == []
    # The large files may be elsewhere.
    for file in ("clip.json", "quaternions.json"):
        built_path(params, root, NAME, file).unlink()
    assert check(params, root) == []


def test_a_changed_byte_of_a_raw_file_is_reported(
    root: Path, params: Params, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Raw files come first: nothing is built from them."""
    monkeypatch.setattr(module, "build_capture", lambda *_: pytest.fail("raw data come first"))
    recording = params.capture(NAME).file
    files = [path.relative_to(root) for path in sorted((root / recording).parent.iterdir())]
    assert len(files) == 3
    for file in files:
        content = bytearray((root / file).read_bytes())
        content[len(content) // 2] ^= 1
        (root / file).write_bytes(content)
        (line,) = check(params, root)
        assert line.startswith(f"{file.as_posix()}: expected SHA-256 ")
        content[len(content) // 2] ^= 1
        (root / file).write_bytes(content)
    (root / recording).unlink()
    (line,) = check(params, root)
    assert line.startswith(f"{recording}: expected the raw file of version 1, found none; restore the file")
    (root / recording).with_name("a.asf").write_text("another")
    assert f"{recording.parent}/a.asf: expected only the raw files of version 1" in check(params, root)[0]


def test_a_tenth_of_a_degree_is_reported_with_joint_and_frame(root: Path, params: Params) -> None:
    path = built_path(params, root, NAME, "motion.json")
    bent(Canonical.read(path), 0.1, "knee_left", 7).write(path)
    (line,) = check(params, root)
    assert line.startswith(f"{path}: expected the locked data, found rotations knee_left: 0.")
    degrees = float(line.split("knee_left: ")[1].split("°")[0])
    # Four numbers rounded to 1e-5.
    assert degrees == pytest.approx(0.1, abs=0.003)
    assert line.endswith("in frame 7; `make data` rebuilds it")


def test_committed_files_must_exist_and_be_complete(root: Path, params: Params) -> None:
    path = built_path(params, root, NAME, "motion.json")
    content = path.read_text()
    path.write_text(content[: len(content) // 2])
    built_path(params, root, NAME, "clip.json").write_text("{}")
    # One that cannot be read does not hide the next.
    lines = check(params, root)
    assert [line.split(":")[0] for line in lines] == [str(path.with_name("clip.json")), str(path)]
    assert all(line.endswith("`make data` rebuilds it") for line in lines)
    built_path(params, root, NAME, "clip.json").unlink()
    path.unlink()
    assert check(params, root) == [f"{path}: expected the committed file, found none; `make data` builds it"]


def test_code_that_builds_other_data_is_reported(
    root: Path, params: Params, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = dict(build_capture(params.capture(NAME), root))
    made["motion.json"] = bent(made["motion.json"], 0.1, "hip_right", 3)
    monkeypatch.setattr(module, "build_capture", lambda *_: made)
    (line,) = check(params, root)
    path = built_path(params, root, NAME, "motion.json")
    told = f"{path}: expected today's code to build the locked data, found other data"
    assert line.startswith(f"{told}: rotations hip_right: 0.")
    assert line.endswith("if intended, raise `version` and run `make data`")
    made["motion.json"].write(path)
    (line,) = check(params, root)
    assert line.startswith(f"{told}, which are built here but not locked; ")


def test_another_version_or_capture_is_reported(root: Path, params: Params) -> None:
    lines = check(replace(params, version=2), root)
    assert [line.split(":")[0] for line in lines] == [
        str(root / MANIFEST),
        str(root / "CHANGELOG.md"),
    ]
    lines = check(replace(params, captures={}), root)
    told = f"datasets/versions/raw/{NAME}.skl: expected the raw file of version 1, found none"
    assert any(line.startswith(told) for line in lines)


def test_changed_data_need_a_new_version_and_a_changelog_line(root: Path, params: Params) -> None:
    before = Manifest.load(root / MANIFEST)
    path = built_path(params, root, NAME, "motion.json")
    bent(Canonical.read(path), 0.1, "knee_left", 7).write(path)
    with pytest.raises(KinemimicError, match=rf"changes in {NAME}/motion.json; raise `version` in .* to 2"):
        lock(params, root)
    with pytest.raises(KinemimicError, match="expected a line that starts with '- Data 2: '"):
        lock(replace(params, version=2), root)
    assert Manifest.load(root / MANIFEST) == before
    (root / "CHANGELOG.md").write_text("- Data 2:\n- Data 1: a walk, as Data 2: is not.\n")
    with pytest.raises(KinemimicError, match="expected a line that starts with"):
        lock(replace(params, version=2), root)
    (root / "CHANGELOG.md").write_text("- Data 2: a knee.\n- Data 1: a walk.\n")
    after = lock(replace(params, version=2), root)
    assert after == Manifest.load(root / MANIFEST)
    assert after.content[f"{NAME}/clip.json"] == before.content[f"{NAME}/clip.json"]
    assert after.content[f"{NAME}/motion.json"] != before.content[f"{NAME}/motion.json"]
    # The same again is no change.
    assert lock(replace(params, version=2), root) == after


def test_a_rewritten_manifest_is_compared_with_an_earlier_commit(root: Path, params: Params) -> None:
    """Git history reveals a manifest that was edited by hand."""

    def git(*arguments: str) -> None:
        author = ("-c", "user.name=a", "-c", "user.email=a@b.c", "-c", "commit.gpgsign=false")
        subprocess.run(["git", *author, *arguments], cwd=root, check=True, capture_output=True)

    git("init", "-q")
    git("commit", "-q", "--allow-empty", "-m", "before there was a manifest")
    git("add", "datasets/versions/manifest.json")
    git("commit", "-q", "-m", "one")
    assert check(params, root, against="HEAD~1") == check(params, root, against="HEAD") == []
    written = json.loads((root / MANIFEST).read_text())
    path = built_path(params, root, NAME, "motion.json")
    other = bent(Canonical.read(path), 0.1, "knee_left", 7)
    written["content"][f"{NAME}/motion.json"] = other.identity
    (root / MANIFEST).write_text(json.dumps(written))
    lines = check(params, root, against="HEAD")
    assert lines[0].startswith(f"{MANIFEST}: expected the data of version 1, as at HEAD, found that ")
    assert f"{NAME}/motion.json changed" in lines[0]
    # However the parameters are named.
    absolute = replace(params, path=root / params.path)
    assert check(absolute, root, against="HEAD")[0] == lines[0].replace(str(PARAMS), str(root / PARAMS))
    for commit in ("nowhere", "--output=x"):
        with pytest.raises(KinemimicError, match=f"--against: expected a commit, found '{commit}'"):
            check(params, root, against=commit)
    (root / MANIFEST).write_text("{")
    git("commit", "-qam", "broken")
    (root / MANIFEST).write_text(json.dumps(written))
    with pytest.raises(KinemimicError, match=r"HEAD:.*manifest.json: expected JSON"):
        check(params, root, against="HEAD")


def test_a_file_that_is_no_manifest_is_refused_in_one_line(root: Path, params: Params) -> None:
    for text, told in (
        ("{}", "a manifest of schema 1, found none"),
        ("[1]", "a manifest of schema 1, found none"),
        ('{"schema": 2}', "written by a later version of kinemimic"),
        ('{"schema": 1}', "found no valid 'version'"),
        ('{"schema": 1, "version": 1, "raw": [], "content": {}}', "found no valid 'raw'"),
        ("{", "JSON"),
    ):
        (root / MANIFEST).write_text(text)
        with pytest.raises(KinemimicError, match=told):
            check(params, root)
    (root / MANIFEST).unlink()
    with pytest.raises(KinemimicError, match="`make data` writes it"):
        check(params, root)


def test_commands_report_by_exit_status(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(root)
    run = CliRunner().invoke
    assert run(check_command).stdout == f"{MANIFEST}: version 1, all as locked\n"
    assert run(lock_command).stdout == f"{MANIFEST}: version 1, 3 raw files, 3 built\n"
    assert json.loads(run(lock_command, ["--json"]).stdout)["version"] == 1
    before = Path(f"datasets/versions/built/{NAME}/clip.json")
    content = before.read_bytes()
    before.unlink()
    ended = run(build_command, [NAME, "--through", "ingest"])
    assert (ended.exit_code, ended.stdout) == (0, f"{before}\n")
    assert before.read_bytes() == content
    raw = Path(f"datasets/versions/raw/{NAME}.skl")
    raw.write_bytes(raw.read_bytes() + b"\n")
    ended = run(check_command)
    assert (ended.exit_code, ended.stdout) == (1, "")
    assert ended.stderr.startswith(f"datasets: {raw}: expected SHA-256 ")
    ended = run(check_command, ["--json"])
    assert ended.exit_code == 1
    assert len(json.loads(ended.stdout)["wrong"]) == 1
