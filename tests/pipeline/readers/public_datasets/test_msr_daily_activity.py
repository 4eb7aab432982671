"""MSR Daily Activity 3D: one person comes back, frame by frame; counts must agree with the rows."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples import msr_daily_activity as sample
from samples import source_of
from samples.motion import in_range, walk

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import MISSING
from kinemimic.pipeline.readers import recognise

PATH = Path("take.txt")
TAKE = next(iter(sample.files().values())).decode()


def read(text: str) -> Clip:
    return recognise.read_source(source_of(text, PATH))


def test_the_walker_comes_back() -> None:
    clip = read(TAKE)
    assert clip.provenance["format"] == "MSR Daily Activity 3D skeletons"
    assert np.allclose(clip.times, np.arange(90) / 30)
    assert (clip.states[sample.EMPTY] == MISSING).all()
    seen = np.arange(90) != sample.EMPTY
    assert np.abs(clip.positions - in_range(walk(90)))[seen].max() < 1e-5
    defects = {defect["rule"]: defect["frames"] for defect in clip.provenance["reading"]["defects"]}
    assert defects == {"several_people": [[sample.BOTH] * 2], "zero_frames": [[sample.EMPTY] * 2]}


def test_a_person_of_zeros_is_nobody() -> None:
    lines = TAKE.split("\n")
    lines[2] = "80"  # of the second frame
    lines[3:3] = ["0 0 0 0"] * 40
    clip = read("\n".join(lines))
    assert np.abs(clip.positions - in_range(walk(90)))[1].max() < 1e-5


def test_nobody_at_all() -> None:
    with pytest.raises(CaptureError, match="expected a person, found 9 frames without one"):
        read("\n".join(["9 20", *["0"] * 9]))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda n: n.__setitem__(0, "91 20"), "expected a number of rows, .* found the end of the file"),
        (
            lambda n: n.__setitem__(0, "89 20"),
            "line 3651: expected the end of the file .*; correct the number",
        ),
        (lambda n: n.__delitem__(slice(-9, None)), "expected 40 rows of a person, found the end of the file"),
        (lambda n: n.pop(60), "line 85: expected a number of rows, 0 or 40 per person, found '0"),
        (lambda n: n.__setitem__(60, "1 2 3"), "line 61: expected 4 numbers, found 3"),
        (lambda n: n.__setitem__(58, "1 2 900 1"), "rows from line 45: expected at most 100 m in Z of"),
    ],
)
def test_damage_names_its_place(change: Callable[[list[str]], object], says: str) -> None:
    lines = TAKE.rstrip("\n").split("\n")
    change(lines)
    with pytest.raises(CaptureError, match=says):
        read("\n".join(lines) + "\n")
