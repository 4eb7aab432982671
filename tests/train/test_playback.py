from __future__ import annotations

import importlib
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.retarget.motion import Motion
from kinemimic.train.config import EnvConfig
from kinemimic.train.perform import perform
from kinemimic.train.playback import Playback


def test_round_trip_and_damage(tmp_path: Path, motion: Motion) -> None:
    path = tmp_path / "playback.npz"
    with pytest.raises(KinemimicError, match="found no file"):
        Playback.load(path)
    played = perform(motion, None, start_phases=np.zeros(1), frames=2, workers=1)
    played.save(path)
    again = Playback.load(path)
    for f in fields(Playback):
        np.testing.assert_array_equal(getattr(again, f.name), getattr(played, f.name))
    whole = path.read_bytes()
    for damaged in (whole[: len(whole) // 2], b"", b"not a zip"):
        path.write_bytes(damaged)
        with pytest.raises(KinemimicError, match="expected a playback, found a damaged or another file"):
            Playback.load(path)


def test_what_an_engine_overwrites_is_kept(motion: Motion, puppets, monkeypatch: pytest.MonkeyPatch) -> None:
    """A puppet goes one metre a frame, in memory that every step writes anew."""
    module = importlib.import_module("kinemimic.train.perform")
    monkeypatch.setattr(module, "open_world", lambda size, engine, measure_torques: puppets(size))
    played = module._perform_one((motion, None, EnvConfig(), 0.0, 4, "puppets"))
    np.testing.assert_allclose(np.diff(played.root[0, :, 0]), 1.0)
