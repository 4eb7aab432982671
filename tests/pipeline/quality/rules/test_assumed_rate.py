"""A Kinect v1 file that declares 50 Hz: its clock is repaired only if the gait is then a human's."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples import source_of, treadmill

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.quality.check import check_capture
from kinemimic.pipeline.quality.rules.assumed_rate import WALK_RATIO, StrideEstimate, gait_of
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.clocks.frame_rate import at_rate
from kinemimic.pipeline.readers.recognise import read, read_source


def recorded(rate: float, change: tuple[str, str] = ("", "")) -> Clip:
    """The known walk, of 1.27 s per stride, sampled at a rate that the file does not tell."""
    text = treadmill.files(240, rate)["skeleton_3d.txt"].decode().replace(*change, 1)
    return read_source(source_of(text, Path("walk.txt")))


def checked(clip: Clip) -> tuple[Clip, Defect]:
    result = check_capture(clip)
    return result.clip, next(one for one in result.defects if one.rule == "wrong_rate")


def test_thirty_frames_per_second_are_repaired() -> None:
    clip, found = checked(recorded(30.0))
    assert clip.rate == pytest.approx(30.0)
    assert found.action == "repaired" and "declared 50 Hz" in found.text
    assert "read at 30 Hz (1." in found.text


def test_a_gait_that_is_no_humans_is_not_repaired_and_the_user_is_asked() -> None:
    """Recorded at 15 frames per second, as a slow computer does: 30 would give 189 steps a minute."""
    clip, found = checked(recorded(15.0))
    assert found.action == "flagged" and found.text.endswith("give the true rate as --rate")
    assert "no human walks or runs like this at that rate" in found.text
    told = check_capture(at_rate(recorded(15.0), 15.0))
    assert told.clip.rate == pytest.approx(15.0)
    assert not [one for one in told.defects if one.rule == "wrong_rate"]
    assert told.clip.provenance["reading"]["rate_hz"] == 15.0
    assert np.array_equal(told.clip.positions, clip.positions, equal_nan=True)


def test_a_declared_rate_at_which_the_gait_is_more_human_stays() -> None:
    """Resampled to 50 Hz by the exporter: at 30 the same steps would be slower than people take them."""
    clip, found = checked(recorded(50.0))
    assert clip.rate == pytest.approx(50.0)
    assert found.action == "flagged" and "left at 50 Hz; give the true rate as --rate" in found.text


def test_without_a_gait_the_user_is_asked() -> None:
    text = treadmill.files(40)["skeleton_3d.txt"].decode()
    clip, found = checked(read_source(source_of(text, Path("walk.txt"))))
    assert gait_of(clip) is None
    assert found.action == "flagged" and "no clear gait confirms it" in found.text


def test_a_rate_that_a_kinect_delivers_is_taken_as_declared() -> None:
    text = treadmill.files(240, 15.0)["skeleton_3d.txt"].decode()
    lines = text.split("\n")
    lines[2:4] = [line.replace("50", "15") for line in lines[2:4]]
    lines[8:-1] = [f"{k / 15:g}\t" + line.split("\t", 1)[1] for k, line in enumerate(lines[8:-1])]
    result = check_capture(read_source(source_of("\n".join(lines), Path("walk.txt"))))
    assert result.clip.rate == pytest.approx(15.0)
    assert not [one for one in result.defects if one.rule == "wrong_rate"]


@pytest.mark.parametrize(
    ("gait", "human"),
    [
        (StrideEstimate(1.1, 0.62, 0.86, np.radians(60)), True),  # an adult's walk
        (StrideEstimate(0.85, 0.80, 0.90, np.radians(62)), True),  # a brisk one
        (StrideEstimate(2.1, 0.48, 0.85, np.radians(50)), True),  # a patient's
        (StrideEstimate(0.75, 0.36, 0.50, np.radians(60)), True),  # a child's
        (StrideEstimate(0.70, 1.00, 0.90, np.radians(105)), True),  # a run
        (StrideEstimate(0.72, 0.57, 0.87, np.radians(41)), False),  # 167 steps a minute on a walker's knees
        (StrideEstimate(0.64, 0.60, 0.85, np.radians(55)), False),
        (StrideEstimate(3.0, 0.60, 0.85, np.radians(55)), False),
    ],
)
def test_what_a_human_gait_is(gait: StrideEstimate, human: bool) -> None:
    assert gait.human is human


def test_the_usual_walk_ratio() -> None:
    """0.0064 m per step/min on a leg of 0.88 m, at any cadence."""
    for cadence in (80.0, 120.0):
        gait = StrideEstimate(120.0 / cadence, 0.0064 * cadence, 0.88, 1.0)
        assert gait.walk_ratio == pytest.approx(WALK_RATIO, abs=0.01)


def test_the_real_takes_are_asked_for(captures: Path) -> None:
    """Their walker takes 174 to 180 steps a minute at 30 Hz, on knees that bend 36 and 55 degrees."""
    for take in ("19h58m42", "20h17m38"):
        clip, found = checked(read(captures / "kinect1_treadmill_c3d" / f"skeleton_3d_{take}.txt"))
        assert found.action == "flagged" and "--rate" in found.text
        gait = gait_of(clip)
        assert gait is not None and not gait.human and gait.at(0.5).human
