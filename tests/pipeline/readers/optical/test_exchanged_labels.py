"""Markers of a walking body that carry each other's labels for a while, or a place that is not theirs."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from samples.motion import walk
from samples.trc import markers

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.readers.optical.exchanged_labels import exchange_labels
from kinemimic.pipeline.readers.recognise import read

WALK = walk(240, 60.0)
PLACES = markers(WALK)
LABELS = tuple(PLACES)
POINTS = np.stack([PLACES[label] for label in LABELS], axis=1)
POINTS.setflags(write=False)


def relabelled(frames: slice, *labels: str) -> Array:
    """The points with each label at the place of the next one for some frames."""
    points = POINTS.copy()
    numbers = [LABELS.index(label) for label in labels]
    points[frames, numbers] = POINTS[frames, numbers[1:] + numbers[:1]]
    return points


def test_labels_that_are_right_stay() -> None:
    points, found = exchange_labels(LABELS, POINTS)
    assert points is POINTS
    assert not found


@pytest.mark.parametrize("frames", [slice(70, 71), slice(0, 40), slice(150, 240), slice(60, 160)])
@pytest.mark.parametrize(
    "pair", [("L.Knee.Lat", "R.Knee.Lat"), ("L.Ankle.Med", "R.Ankle.Med"), ("L.Knee.Lat", "L.Elbow")]
)
def test_two_exchanged_markers_are_put_back(pair: tuple[str, str], frames: slice) -> None:
    points, (found,) = exchange_labels(LABELS, relabelled(frames, *pair))
    assert np.array_equal(points, POINTS)
    assert found.action == "repaired"
    assert found.frames == ((frames.start, frames.stop - 1),)
    assert all(label in found.text for label in pair)


def test_a_cycle_of_three_is_undone() -> None:
    points, (found,) = exchange_labels(
        LABELS, relabelled(slice(40, 60), "L.Knee.Lat", "R.Ankle.Lat", "L.Elbow")
    )
    assert np.array_equal(points, POINTS)
    assert found.count == 20


def test_a_marker_whose_label_another_took_while_it_was_hidden() -> None:
    """The right knee's label is at the left knee, and the left knee's label nowhere."""
    left, right = LABELS.index("L.Knee.Lat"), LABELS.index("R.Knee.Lat")
    shown = POINTS.copy()
    shown[100:130, right] = POINTS[100:130, left]
    shown[100:130, left] = np.nan
    points, _ = exchange_labels(LABELS, shown)
    assert np.array_equal(points[:, left], POINTS[:, left])
    assert np.isnan(points[100:130, right]).all()
    assert np.array_equal(np.delete(points, right, axis=1), np.delete(POINTS, right, axis=1))


def test_a_position_that_no_pose_explains_is_removed() -> None:
    knee = LABELS.index("L.Knee.Lat")
    shown = POINTS.copy()
    shown[30:50, knee] += [0.0, 0.0, 2.0]
    points, (found,) = exchange_labels(LABELS, shown)
    assert np.isnan(points[30:50, knee]).all()
    assert np.array_equal(np.delete(points, knee, axis=1), np.delete(POINTS, knee, axis=1))
    assert found.frames == ((30, 49),)
    assert "L.Knee.Lat off its segment in 20 frames, removed" in found.text


@pytest.mark.parametrize("standing", [0, 600, 4000])
@pytest.mark.parametrize("gaps", [0, 1, 3])
def test_a_few_steps_after_minutes_of_standing_are_no_exchange(standing: int, gaps: int) -> None:
    """Distances that hardly change in standing are off in the steps, and every marker is in its place."""
    generator = np.random.default_rng(5)
    shown = np.concatenate([np.repeat(POINTS[:1], standing, axis=0), POINTS])
    shown = shown + generator.normal(scale=0.0005, size=shown.shape)
    for marker in range(len(LABELS)):
        for start in generator.integers(standing, standing + 220, size=gaps):
            shown[start : start + 20, marker] = np.nan
    points, found = exchange_labels(LABELS, shown)
    assert points is shown
    assert not found


def test_raised_arms_after_minutes_of_standing_are_no_exchange() -> None:
    still = np.repeat(POINTS[:1], 1000, axis=0) + np.random.default_rng(6).normal(
        scale=0.001, size=(1000, *POINTS.shape[1:])
    )
    raised = np.sin(np.linspace(0.0, np.pi, 60))[:, None, None]
    for side, out in (("L", 1.0), ("R", -1.0)):
        arm = [LABELS.index(f"{side}.{name}") for name in ("Elbow", "Wrist.Lat", "Wrist.Med")]
        still[800:860, arm] += raised * [0.0, 0.4 * out, 0.0] + raised * np.array(
            [[0.0, 0.0, 0.3], [0.0, 0.0, 0.6], [0.0, 0.0, 0.6]]
        )
    points, found = exchange_labels(LABELS, still)
    assert points is still
    assert not found


@pytest.mark.parametrize("frames", [1, 2, 3])
def test_a_few_frames_are_no_error(frames: int) -> None:
    points, _ = exchange_labels(LABELS, POINTS[:frames])
    assert np.array_equal(points, POINTS[:frames])


def test_frames_without_either_marker_do_not_count() -> None:
    knees = [LABELS.index("L.Knee.Lat"), LABELS.index("R.Knee.Lat")]
    shown = POINTS.copy()
    shown[100:120, knees] = POINTS[100:120, knees[::-1]]
    shown[120:, knees] = np.nan
    points, (found,) = exchange_labels(LABELS, shown)
    assert np.array_equal(points[:120], POINTS[:120])
    assert found.count == 20


@pytest.mark.parametrize("missing", [0.0, 0.3])
def test_most_exchanges_of_any_two_are_put_back_and_no_other_marker_is_touched(missing: float) -> None:
    """Two that are alike to their mates (both wrists, both ASIS) cannot be told apart."""
    generator = np.random.default_rng(3)
    hidden = generator.random(POINTS.shape[:2]) < missing
    whole = np.where(hidden[..., None], np.nan, POINTS)
    undone = 0
    pairs = list(combinations(LABELS, 2))[::11]
    for pair in pairs:
        shown = whole.copy()
        numbers = [LABELS.index(label) for label in pair]
        shown[80:100, numbers] = whole[80:100, numbers[::-1]]
        points, _ = exchange_labels(LABELS, shown)
        undone += np.array_equal(points, whole, equal_nan=True)
        assert np.array_equal(
            np.delete(points, numbers, axis=1), np.delete(whole, numbers, axis=1), equal_nan=True
        )
    assert undone >= 0.8 * len(pairs)


@pytest.mark.parametrize(
    "pair",
    [
        ("R.Thigh.Front", "L.Shank.Front"),
        ("R.ASIS", "L.ASIS"),
        ("L.Heel", "L.Toe.Tip"),
        ("V.Sacral", "R.Thigh.Rear"),
    ],
)
def test_a_laboratory_walk_with_two_exchanged_labels_is_the_walk(
    captures: Path, tmp_path: Path, pair: tuple[str, str]
) -> None:
    recorded = captures / "lab_opensim_gait" / "Gait2354_Simbody__subject01_walk1.trc"
    lines = recorded.read_text().splitlines()
    names = lines[3].split("\t")
    first, second = (slice(names.index(label), names.index(label) + 3) for label in pair)
    for k in range(60, 100):
        cells = lines[k].split("\t")
        cells[first], cells[second] = cells[second], cells[first]
        lines[k] = "\t".join(cells)
    other = tmp_path / "walk.trc"
    other.write_text("\n".join(lines) + "\n")
    expected, found = read(recorded), read(other)
    assert np.array_equal(found.positions, expected.positions, equal_nan=True)
    assert not expected.provenance["reading"]["defects"]
    (defect,) = found.provenance["reading"]["defects"]
    assert (defect["rule"], defect["count"], defect["action"]) == ("wrong_labels", 40, "repaired")
