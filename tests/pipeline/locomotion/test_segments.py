"""Segments have names and times, and `--segment` takes either."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from samples.bouts import bouts_of
from samples.walker import along, joined, standing, walker

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.clip import Clip, Label
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.locomotion.segments import Segment, find_segments, only_segment


def segments_of(clip: Clip) -> list[Segment]:
    return find_segments(clip, clip.positions, bouts_of(clip))


@pytest.fixture(scope="module")
def clip() -> Clip:
    """Stands for 2 s, walks for 6, stands for 3, walks for 5, in one pass."""
    there, back = walker(seconds=6.0).clip, walker(seconds=5.0).clip
    return joined(standing(there, 2.0), there, standing(there, 3.0, frame=-1), back)


def test_walks_and_standing_are_numbered_in_order_of_time(clip: Clip) -> None:
    found = segments_of(clip)
    assert [one.name for one in found] == ["stand-1", "walk-1", "stand-2", "walk-2"]
    assert [one.kind for one in found] == ["stand", "walk", "stand", "walk"]
    for one, (start, end) in zip(found, [(0, 2), (2, 8), (8, 11), (11, 16)], strict=True):
        assert one.start == pytest.approx(start, abs=0.6) and one.end == pytest.approx(end, abs=0.6)
        assert (one.bout is None) == (one.kind == "stand")
    for before, after in pairwise(found):
        assert before.end <= after.start + 1e-9


def test_a_turn_between_two_walks_is_one() -> None:
    """Turns on the spot by 180 degrees within a second and a half."""
    there, back = walker(seconds=5.0).clip, walker(seconds=5.0).clip
    spot = standing(there, 1.5, frame=-1)
    spot = along(spot, np.pi * np.arange(len(spot.times)) / (len(spot.times) - 1))
    back = along(back, np.full(len(back.times), np.pi))
    clip = joined(there, spot, back)
    names = [one.name for one in segments_of(clip)]
    assert names == ["walk-1", "turn-1", "walk-2"]


def test_a_high_step_on_one_leg_is_no_standing() -> None:
    """Most of the body is still, but one foot goes up and comes down."""
    still = standing(walker().clip, 4.0)
    assert [one.name for one in segments_of(still)] == ["stand-1"]
    stepping = still.positions.copy()
    leg = [N[f"{joint}_left"] for joint in ("knee", "ankle", "foot")]
    stepping[:, leg, 2] += 0.4 * np.sin(np.pi * np.linspace(0.0, 1.0, len(stepping)))[:, None] ** 2
    assert [one.name for one in segments_of(replace(still, positions=stepping))] == ["motion-1"]


def test_labels_of_the_recording_are_segments_too(clip: Clip) -> None:
    labelled = replace(clip, labels=(Label("gesture", 3.0, 5.0), Label("outside", 90.0, 99.0)))
    (one,) = [one for one in segments_of(labelled) if one.kind == "label"]
    assert (one.name, one.start, one.end) == ("gesture", 3.0, 5.0)
    kept = only_segment(labelled, segments_of(labelled), "gesture")
    inside = clip.times[kept.passes >= 0]
    assert inside[0] >= 3.0 and inside[-1] <= 5.0


def test_a_name_keeps_the_frames_of_its_segment(clip: Clip) -> None:
    (second,) = [one for one in segments_of(clip) if one.name == "walk-2"]
    kept = only_segment(clip, segments_of(clip), "walk-2")
    inside = clip.times[kept.passes >= 0]
    assert inside[0] == pytest.approx(second.start, abs=0.02)
    assert inside[-1] == pytest.approx(second.end, abs=0.02)
    assert (kept.positions == clip.positions).all()


@pytest.mark.parametrize("text", ["1.0-3.5", " 1 - 3.5 "])
def test_times_keep_the_frames_between_them(clip: Clip, text: str) -> None:
    inside = clip.times[only_segment(clip, segments_of(clip), text).passes >= 0]
    assert inside[0] == pytest.approx(1.0, abs=0.02) and inside[-1] == pytest.approx(3.5, abs=0.02)


def test_an_unknown_name_gives_one_line_with_the_names(clip: Clip) -> None:
    with pytest.raises(KinemimicError, match="found 'walk-9'") as caught:
        only_segment(clip, segments_of(clip), "walk-9")
    text = str(caught.value)
    assert "\n" not in text and all(name in text for name in ("stand-1", "walk-1", "stand-2", "walk-2"))


def test_times_outside_the_capture_give_one_line_with_its_times(clip: Clip) -> None:
    with pytest.raises(KinemimicError, match=r"found none; the capture has 0\.0 to 16\.0 s"):
        only_segment(clip, segments_of(clip), "90-99")
    for text in ("5-3", "3-3"):
        with pytest.raises(KinemimicError, match=f"^--segment: expected START before END, found '{text}'$"):
            only_segment(clip, segments_of(clip), text)


def test_a_segment_shorter_than_a_pass_that_ingest_keeps_is_refused(clip: Clip) -> None:
    with pytest.raises(
        KinemimicError, match=r"--segment: expected at least 0\.5 s of a pass, found 0\.\d+ s"
    ):
        only_segment(clip, segments_of(clip), "2.0-2.1")
