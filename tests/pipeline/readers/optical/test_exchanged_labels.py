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
        LABELS, relabelled(slice(40, 90), "L.Knee.Lat", "R.Ankle.Lat", "L.Elbow")
    )
    assert np.array_equal(points, POINTS)
    assert found.count == 50


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


def test_a_label_lost_to_a_point_without_one_is_given_back() -> None:
    knee = LABELS.index("L.Knee.Lat")
    unnamed = np.full((len(POINTS), 1, 3), np.nan)
    shown = np.concatenate([POINTS, unnamed], axis=1)
    shown[100:140, -1] = POINTS[100:140, knee]
    shown[100:140, knee] = POINTS[100:140, knee] + [0.4, 0.3, 0.5]  # a reflection
    points, (found,) = exchange_labels((*LABELS, ""), shown)
    assert np.array_equal(points[:, :-1], POINTS)
    assert "a point without a label" in found.text


def test_a_position_that_no_pose_explains_is_removed() -> None:
    knee = LABELS.index("L.Knee.Lat")
    shown = POINTS.copy()
    shown[30:50, knee] += [0.0, 0.0, 2.0]
    points, (found,) = exchange_labels(LABELS, shown)
    assert np.isnan(points[30:50, knee]).all()
    assert np.array_equal(np.delete(points, knee, axis=1), np.delete(POINTS, knee, axis=1))
    assert found.frames == ((30, 49),)
    assert "L.Knee.Lat off its segment in 20 frames, removed" in found.text


def test_a_few_steps_after_minutes_of_standing_are_no_exchange() -> None:
    """Distances that hardly change in standing are off in the steps, and every marker is in its place."""
    still = np.concatenate([np.repeat(POINTS[:1], 600, axis=0), POINTS])
    points, found = exchange_labels(LABELS, still)
    assert points is still
    assert not found


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
        shown[80:120, numbers] = whole[80:120, numbers[::-1]]
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
