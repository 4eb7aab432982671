"""Damaged files of every format: each gives a clear error or a valid clip, in bounded time.

The first few hundred of each format with every test, two thousand with a slow one. All but C3D, whose library
reads in a process of its own.
"""

from __future__ import annotations

import faulthandler
import gzip
import importlib
import pkgutil
import resource
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import samples
from samples.mutate import mutated

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import MISSING
from kinemimic.pipeline.quality.check import check_capture
from kinemimic.pipeline.readers import recognise

INPUTS, FEW = 2000, 400
FRAMES = 24
# A hang, not slowness, is what is looked for: the slowest of these inputs takes about a tenth of a second.
SECONDS = 20
MEMORY = 400 * 2**20
NO_FORMATS = {
    "asymmetry",
    "bouts",
    "c3d",
    "converted",
    "corpus",
    "depth_scene",
    "described_euler",
    "live_stream",
    "mirror",
    "motion",
    "mutate",
    "noiseless",
    "one_leg",
    "other_steps",
    "walker",
    "workbook",
}
FORMATS = sorted(name for _, name, _ in pkgutil.iter_modules(samples.__path__) if name not in NO_FORMATS)


@pytest.fixture(autouse=True)
def bounds() -> Iterator[None]:
    """Any input that hangs ends the test with its traceback; growing memory fails it."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    yield
    faulthandler.cancel_dump_traceback_later()
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024
    assert grown < MEMORY


def unpacked(content: bytes) -> bytes:
    return gzip.decompress(content) if content[:2] == b"\x1f\x8b" else content


def check(clip: Clip) -> None:
    """What every clip promises, whatever it was read from."""
    frames, joints = len(clip.times), len(clip.skeleton.names)
    assert frames > 0
    assert clip.positions.shape == (frames, joints, 3)
    assert np.isfinite(clip.times).all()
    assert (np.diff(clip.times) > 0).all()
    missing = clip.states == MISSING
    assert np.isnan(clip.positions[missing]).all()
    assert np.isfinite(clip.positions[~missing]).all()
    assert np.isin(clip.states, (0, 1, 2)).all()


@pytest.mark.parametrize("name", FORMATS)
def test_damaged_files(name: str, tmp_path: Path) -> None:
    read_damaged(name, tmp_path, FEW)


@pytest.mark.slow
@pytest.mark.parametrize("name", FORMATS)
def test_two_thousand_damaged_files(name: str, tmp_path: Path) -> None:
    read_damaged(name, tmp_path, INPUTS)


def read_damaged(name: str, folder: Path, inputs: int) -> None:
    module: ModuleType = importlib.import_module(f"samples.{name}")
    # gzip's checksum would catch damage inside a compressed file; here the reader must.
    files = {name: unpacked(content) for name, content in module.files(FRAMES).items()}
    rng = np.random.default_rng(2026)
    capture = folder / next(iter(files))
    clips = errors = 0
    for number in range(inputs):
        # The capture mostly; now and then what lies beside it.
        victim = list(files)[int(rng.integers(len(files)))] if rng.random() < 0.3 else capture.name
        for file, content in files.items():
            (folder / file).write_bytes(mutated(content, rng) if file == victim else content)
        faulthandler.dump_traceback_later(SECONDS, exit=True)
        try:
            clip = recognise.read(capture)
            check(clip)
            check(check_capture(clip).clip)
            clips += 1
        except KinemimicError as error:
            assert len(str(error).splitlines()) == 1
            assert len(str(error)) < 1000
            errors += 1
        except Exception as error:
            error.add_note(f"input {number} of {name}, damaged {victim}, kept in {folder}")
            raise
    assert clips + errors == inputs
    # The mutations must leave some files readable and break others.
    assert errors > inputs // 5
