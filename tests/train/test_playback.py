from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.retarget.motion import Motion
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
