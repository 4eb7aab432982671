"""A predictor is learned from a library, stored, and predicts walks better than going on as before."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from peers.trackers import write_small_library
from safetensors.numpy import load_file, save_file

from kinemimic.pipeline.cli.main import main
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.data_folder import DATASETS
from kinemimic.pipeline.kinematics.rotations import IDENTITY, angle_between
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.retarget.humanoid.motion import joint_angles
from kinemimic.train.prediction import command
from kinemimic.train.prediction.command import train_predictor
from kinemimic.train.prediction.moments import FUTURE, PAST
from kinemimic.train.prediction.predictor import PREDICTOR, SIZES, Predictor
from kinemimic.train.reference.reference import Reference
from kinemimic.train.sim.world import CONTROL_RATE

NOW = max(PAST)


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_small_library(tmp_path_factory.mktemp("library"))


@pytest.fixture(scope="module")
def made(library: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("predictor")
    train_predictor(library, out, count=4000, seed=3)
    return out


def test_it_beats_both_controls(made: Path) -> None:
    """On the motions that it has learned from, and on a slower walk."""
    by_split = json.loads((made / "predictor.json").read_text())["rmse_deg"]
    assert set(by_split) == {"train", "test"}
    for errors, seconds, joint in product(by_split.values(), ("0.10", "0.20", "0.40"), ("knee", "hip")):
        predicted = errors["predicted"][seconds][joint]
        assert predicted < 0.5 * errors["held"][seconds][joint]
        assert predicted < 0.5 * errors["steady"][seconds][joint]
        assert errors["denoised"][seconds][joint] < 0.8 * errors["noisy"][seconds][joint]


def test_the_same_seed_gives_the_same_bytes(library: Path, made: Path, tmp_path: Path) -> None:
    train_predictor(library, tmp_path / "again", count=4000, seed=3)
    assert (tmp_path / "again" / PREDICTOR).read_bytes() == (made / PREDICTOR).read_bytes()
    train_predictor(library, tmp_path / "other", count=4000, seed=4)
    assert (tmp_path / "other" / PREDICTOR).read_bytes() != (made / PREDICTOR).read_bytes()


def test_the_command_prints_both_splits(
    library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(command, "PREDICTION", replace(command.PREDICTION, epochs=1))
    monkeypatch.setattr(command, "DENOISING", replace(command.DENOISING, epochs=1))
    out = tmp_path / "predictor"
    with pytest.raises(SystemExit) as ended:
        main(["train-predictor", str(library), "--out", str(out), "--moments", "600"])
    assert ended.value.code in (0, None)
    printed = capsys.readouterr().out
    for split in ("train", "test"):
        assert f"the split `{split}`" in printed
    assert "after 0.40 s" in printed
    assert f"{out / PREDICTOR}: 600 moments" in printed


def test_the_one_that_ships_foresees_a_walk() -> None:
    """The virtual Kinect's walk, which it has not learned from: a third of the error of the newest pose."""
    motion = read_motion_json(DATASETS / "policies/walk/motion.json")
    reference, predictor = Reference(motion), Predictor.load()
    errors, held = [], []
    for start in np.arange(0.0, 1.0, 0.05):
        phases = start + np.arange(NOW + 1 + FUTURE) / CONTROL_RATE / motion.duration
        root, rotations = reference.root(phases), reference.nodes(phases)
        _, predicted = predictor.continued(root[: NOW + 1], rotations[: NOW + 1])
        came = joint_angles(rotations)
        for name, curve in joint_angles(predicted).items():
            errors.append(curve[1:] - came[name][NOW + 1 :])
            held.append(came[name][NOW] - came[name][NOW + 1 :])
    assert np.std(errors) < np.std(held) / 3.0
    assert np.degrees(np.sqrt(np.mean(np.square(errors)))) < 8.0


def test_who_stands_still_is_expected_to_stand() -> None:
    rotations = np.tile(IDENTITY, (NOW + 1, 20, 1))
    root = np.tile([1.0, 2.0, 0.95], (NOW + 1, 1))
    next_root, next_rotations = Predictor.load().continued(root, rotations)
    assert np.abs(next_root - root[0]).max() < 0.02
    moved = angle_between(next_rotations, np.broadcast_to(IDENTITY, next_rotations.shape))
    assert np.degrees(moved.max()) < 5.0


def test_damage_is_one_line(made: Path, tmp_path: Path) -> None:
    tensors = load_file(made / PREDICTOR)
    path = tmp_path / PREDICTOR
    with pytest.raises(KinemimicError, match="found no file"):
        Predictor.load(path)
    path.write_bytes((made / PREDICTOR).read_bytes()[:-100])
    with pytest.raises(KinemimicError, match="cut off or damaged"):
        Predictor.load(path)
    for kind in SIZES:
        linear, scale = f"{kind}.linear", f"{kind}.scale"
        save_file({name: one for name, one in tensors.items() if name != linear}, path)
        with pytest.raises(KinemimicError, match=f"no tensor '{linear}'"):
            Predictor.load(path)
        for damaged in ({linear: tensors[linear][:-1]}, {scale: 0.0 * tensors[scale]}):
            save_file({**tensors, **damaged}, path)
            with pytest.raises(KinemimicError, match=f"a network for {kind} of .* found another"):
                Predictor.load(path)


def test_a_library_for_tests_alone_is_refused(tmp_path: Path) -> None:
    library = write_small_library(tmp_path / "library")
    manifest = library / "library.json"
    manifest.write_text(manifest.read_text().replace('"train"', '"test"'))
    with pytest.raises(KinemimicError, match="in the split `train`, found none"):
        train_predictor(library, tmp_path / "out")
    assert not (tmp_path / "out").exists()
