from __future__ import annotations

import importlib
import io
import zipfile
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.rollout.rollout import collect_trajectories
from kinemimic.train.rollout.trajectory import Trajectory


def test_round_trip_and_damage(tmp_path: Path, motion: Motion) -> None:
    path = tmp_path / "trajectory.npz"
    with pytest.raises(KinemimicError, match="found no file"):
        Trajectory.load(path, motion)
    played = collect_trajectories(motion, None, EnvConfig(), start_phases=np.zeros(1), frames=2, workers=1)
    played.save(path)
    again = Trajectory.load(path, motion)
    for f in fields(Trajectory):
        np.testing.assert_array_equal(getattr(again, f.name), getattr(played, f.name))
    whole = path.read_bytes()
    for damaged in (whole[: len(whole) // 2], b"", b"not a zip"):
        path.write_bytes(damaged)
        with pytest.raises(KinemimicError, match="expected a trajectory, found a damaged or another file"):
            Trajectory.load(path, motion)


@pytest.fixture(scope="module")
def arrays(motion: Motion, tmp_path_factory: pytest.TempPathFactory) -> dict[str, np.ndarray]:
    """Of two rollouts of three frames, as they are stored."""
    path = tmp_path_factory.mktemp("played") / "trajectory.npz"
    collect_trajectories(
        motion, None, EnvConfig(), start_phases=np.array([0.0, 0.5]), frames=3, workers=1
    ).save(path)
    return dict(np.load(path))


CHANGES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "root": lambda a: a[0],
    "rotations": lambda a: a[:, :, :19],
    "reference_root": lambda a: np.full(a.shape, "x"),
    "reference_rotations": lambda a: a.astype(complex),
    "rewards": lambda a: a[:, :2],
    "reward_names": lambda a: a[:1],
    "fallen_at": lambda a: np.array(["x", "y"]),
    "torques": lambda a: a * np.nan,
    "contacts": lambda a: a.astype(float),
    "contact_forces": lambda a: a + np.inf,
    "phases": lambda a: a[:, ::-1],
    "start_phases": lambda a: a[:0],
    "schema": lambda a: np.arange(3),
}


@pytest.mark.parametrize("name", CHANGES)
def test_arrays_that_are_no_trajectory_are_one_clear_line(
    tmp_path: Path, arrays: dict[str, np.ndarray], name: str, motion: Motion
) -> None:
    path = tmp_path / "trajectory.npz"
    np.savez_compressed(path, **{**arrays, name: CHANGES[name](arrays[name])})
    with pytest.raises(
        KinemimicError, match=r"trajectory\.npz: expected a trajectory, found .*; run `evaluate` ag"
    ):
        Trajectory.load(path, motion)


@pytest.mark.parametrize("cut", [np.s_[:0], np.s_[:, :0]])
def test_no_rollouts_or_frames_are_no_trajectory(
    tmp_path: Path, arrays: dict[str, np.ndarray], cut: Any, motion: Motion
) -> None:
    kept = {
        name: a[cut] if name not in ("schema", "reward_names") and a.ndim > 1 else a
        for name, a in arrays.items()
    }
    np.savez_compressed(tmp_path / "trajectory.npz", **kept)
    with pytest.raises(KinemimicError, match="found no rollouts"):
        Trajectory.load(tmp_path / "trajectory.npz", motion)


def _marked(content: bytes, field: int, value: int) -> bytes:
    """A zip file with a field of all its entries changed; field: its offset in the directory's entries."""
    for mark, at in ((b"PK\1\2", field), (b"PK\3\4", field - 2)):
        parts = content.split(mark)
        parts[1:] = [part[: at - 4] + value.to_bytes(2, "little") + part[at - 2 :] for part in parts[1:]]
        content = mark.join(parts)
    return content


@pytest.mark.parametrize(("field", "value"), [(8, 1), (10, 1), (10, 9), (10, 12), (10, 14), (10, 98)])
def test_an_archive_that_is_encrypted_or_packed_otherwise_is_one_clear_line(
    tmp_path: Path, arrays: dict[str, np.ndarray], field: int, value: int, motion: Motion
) -> None:
    path = tmp_path / "trajectory.npz"
    np.savez_compressed(path, **arrays)
    path.write_bytes(_marked(path.read_bytes(), field, value))
    with pytest.raises(KinemimicError, match="found a damaged or another file"):
        Trajectory.load(path, motion)


@pytest.mark.parametrize("rows", [2**33, 2**62, -1])
def test_a_header_that_announces_more_than_there_is_is_one_clear_line(
    tmp_path: Path, arrays: dict[str, np.ndarray], rows: int, motion: Motion
) -> None:
    path, header = tmp_path / "trajectory.npz", io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (rows,)})
    np.savez_compressed(path, **{name: a for name, a in arrays.items() if name != "root"})
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("root.npy", header.getvalue())
    with pytest.raises(KinemimicError, match="found a damaged or another file"):
        Trajectory.load(path, motion)


def test_what_unpacks_to_more_than_fits_is_not_unpacked(
    tmp_path: Path, arrays: dict[str, np.ndarray], monkeypatch: pytest.MonkeyPatch, motion: Motion
) -> None:
    path = tmp_path / "trajectory.npz"
    np.savez_compressed(path, **arrays)
    module = importlib.import_module("kinemimic.train.rollout.trajectory")
    monkeypatch.setattr(module, "_LIMIT", sum(array.nbytes for array in arrays.values()))
    with pytest.raises(KinemimicError, match="found a damaged or another file"):
        Trajectory.load(path, motion)


def test_what_an_engine_overwrites_is_kept(motion: Motion, puppets, monkeypatch: pytest.MonkeyPatch) -> None:
    """A puppet goes one metre a frame, in memory that every step writes anew."""
    module = importlib.import_module("kinemimic.train.rollout.rollout")
    monkeypatch.setattr(module, "open_world", lambda size, engine, measure_torques: puppets(size))
    played = module._collect_one((motion, None, EnvConfig(), 0.0, 4, "puppets"))
    np.testing.assert_allclose(np.diff(played.root[0, :, 0]), 1.0)
