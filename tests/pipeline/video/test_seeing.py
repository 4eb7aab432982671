"""Anchors, boxes, regions and heat maps: each against what its geometry says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.video.detector import (
    OUTPUTS,
    SIDE,
    Detection,
    Detector,
    anchors,
    letterbox,
    suppressed,
)
from kinemimic.pipeline.video.landmarks import OUTPUTS as LANDMARK_OUTPUTS
from kinemimic.pipeline.video.landmarks import LandmarkNetwork, refined
from kinemimic.pipeline.video.region import Region
from kinemimic.pipeline.video.track import Followed, PersonTracker


class Fake:
    """A network with fixed outputs."""

    def __init__(self, *outputs: Array) -> None:
        self.outputs, self.inputs = [one.astype(np.float32) for one in outputs], []

    def run(self, values: Array) -> list[np.ndarray]:
        self.inputs.append(values)
        return self.outputs


def test_anchors_cover_the_square_evenly() -> None:
    found = anchors()
    assert found.size == OUTPUTS[0] // 6 and len(found) == OUTPUTS[1]
    assert found.mean(axis=0) == pytest.approx([0.5, 0.5])
    cells, counts = np.unique(found[:1568], axis=0, return_counts=True)
    assert len(cells) == 28 * 28 and set(counts) == {2}


def test_a_point_keeps_its_place_in_the_letterbox() -> None:
    image = np.zeros((1280, 720, 3), dtype=np.uint8)
    image[600:640, 100:140] = (10, 20, 250)
    square, scale, offset = letterbox(image)
    assert square.shape == (1, SIDE, SIDE, 3)
    red = square[0, :, :, 0]
    rows, columns = np.nonzero(red > 125)
    centre = (np.array([columns.mean(), rows.mean()]) + 0.5 - offset) / scale
    assert centre == pytest.approx([120.0, 620.0], abs=3.0)


def test_detections_are_decoded_in_pixels_of_the_image() -> None:
    numbers, logits = np.zeros((1, OUTPUTS[1], 12)), np.full((1, OUTPUTS[1], 1), -50.0)
    best = 1000
    logits[0, best] = 8.0
    numbers[0, best] = [0, 0, 20, 30, 0, 40, 0, 80, 0, 0, 0, 0]
    image = np.zeros((448, 448, 3), dtype=np.uint8)
    (found,) = Detector(Fake(numbers, logits)).people(image)
    at = anchors()[best] * 448.0
    half, below = np.array([20.0, 30.0]), np.array([0.0, 80.0])
    assert found.box == pytest.approx(np.concatenate([at - half, at + half]))
    assert found.centre == pytest.approx(at + below)
    assert found.radius == pytest.approx(80.0)


def test_no_person_is_an_empty_list() -> None:
    network = Fake(np.zeros((1, OUTPUTS[1], 12)), np.full((1, OUTPUTS[1], 1), -50.0))
    assert Detector(network).people(np.zeros((64, 32, 3), dtype=np.uint8)) == []


def test_of_boxes_that_overlap_the_best_is_kept() -> None:
    boxes = np.array([[0, 0, 10, 10], [1, 1, 11, 11], [30, 30, 40, 40]], dtype=float)
    assert suppressed(boxes, np.array([0.6, 0.9, 0.7])) == [1, 2]


@pytest.mark.parametrize("angle", [0.0, 0.4, -2.0, np.pi])
def test_a_dot_in_a_turned_region_comes_back_to_its_pixel(angle: float) -> None:
    centre = np.array([300.0, 200.0])
    region = Region.about(centre, centre + 80.0 * np.array([np.sin(angle), -np.cos(angle)]))
    assert region.side == pytest.approx(200.0)
    image = np.zeros((400, 600, 3), dtype=np.uint8)
    dot = np.array([330.0, 160.0])
    image[157:163, 327:333] = 255
    patch = region.crop(image, 256)[0, :, :, 0]
    rows, columns = np.nonzero(patch > 127)
    share = (np.array([columns.mean(), rows.mean()]) + 0.5) / 256.0
    assert region.to_image(share[None])[0] == pytest.approx(dot, abs=1.0)


def test_a_large_person_is_averaged_and_the_image_is_left_as_it_was() -> None:
    image = np.zeros((1000, 1000, 3), dtype=np.uint8)
    image[::2] = 255
    before = image.copy()
    patch = Region(np.array([500.0, 500.0]), 900.0, 0.0).crop(image, 100)
    assert np.std(patch[0, 10:-10, 10:-10]) < 20.0
    assert (image == before).all()


def test_a_heat_map_pulls_a_point_to_its_peak_and_a_flat_one_does_not() -> None:
    heat = np.full((64, 64, 2), -20.0)
    heat[30, 21, 0] = 20.0
    points = np.array([[20.5 / 64, 30.5 / 64], [0.3, 0.3]])
    found = refined(points, heat)
    assert found[0] == pytest.approx([21 / 64, 30 / 64])
    assert found[1] == pytest.approx(points[1])


def landmark_network(score: float, x: float = 128.0) -> LandmarkNetwork:
    values = np.zeros((39, 5))
    values[:, 0], values[:, 1], values[:, 3:] = x, 128.0, 9.0
    values[34] = [x, 64.0, 0, 9, 9]  # a radius of a quarter of the square
    world = np.tile([0.1, -0.2, 0.3], (39, 1))
    outputs = (values, np.array([score]), np.full(LANDMARK_OUTPUTS[2], -20.0), world)
    return LandmarkNetwork(Fake(*(one.reshape(1, -1) for one in outputs)))


def test_landmarks_are_in_the_image_and_the_metres_turn_with_the_region() -> None:
    image = np.zeros((400, 400, 3), dtype=np.uint8)
    region = Region(np.array([200.0, 180.0]), 128.0, np.pi / 2.0)
    found = landmark_network(0.9)(image, region)
    assert found.pixels == pytest.approx(np.tile([200.0, 180.0], (33, 1)))
    # A quarter turn clockwise: the square's right is the image's down.
    assert found.world[0] == pytest.approx([0.2, 0.1, 0.3], abs=1e-6)
    assert (found.visibility > 0.99).all()
    assert found.region.side == pytest.approx(2.5 * 32.0)


class People:
    """A detector of people at fixed places, largest first."""

    def __init__(self, *places: float) -> None:
        self.places, self.calls = places, 0

    def people(self, image: np.ndarray) -> list[Detection]:
        self.calls += 1
        sizes = np.linspace(90.0, 60.0, len(self.places))
        return [
            Detection(0.9, np.zeros(4), np.array([x, 200.0]), np.array([x, 200.0 - r]))
            for x, r in zip(self.places, sizes, strict=True)
        ]


@pytest.mark.parametrize(("person", "x"), [(None, 500.0), (1, 100.0), (2, 300.0), (3, 500.0)])
def test_the_largest_is_followed_or_the_one_that_was_asked_for(person: int | None, x: float) -> None:
    image = np.zeros((400, 600, 3), dtype=np.uint8)
    found = PersonTracker(People(500.0, 100.0, 300.0), landmark_network(0.9), person=person)(image)
    assert found is not None and found.pixels[0, 0] == pytest.approx(x)


def lost(tracker: PersonTracker) -> Followed:
    """As if the next frame had not shown the person."""
    return replace(tracker.followed, lost=1, frames=tracker.followed.frames + 1)


def test_the_detector_rests_while_a_person_is_followed_and_finds_a_lost_one_nearby() -> None:
    image = np.zeros((400, 600, 3), dtype=np.uint8)
    detector = People(500.0, 100.0)
    tracker = PersonTracker(detector, landmark_network(0.9), person=1)
    for _ in range(5):
        assert tracker(image) is not None
    assert detector.calls == 1 and tracker.most_people == 2
    tracker.followed = lost(tracker)
    found = tracker(image)
    assert found is None or found.pixels[0, 0] == pytest.approx(100.0)


def test_somebody_elsewhere_is_not_the_lost_person_until_there_was_time_to_walk_there() -> None:
    image = np.zeros((400, 2000, 3), dtype=np.uint8)
    detector = People(100.0)
    tracker = PersonTracker(detector, landmark_network(0.9))
    assert tracker(image) is not None
    detector.places, tracker.followed = (1000.0,), lost(tracker)
    found = [tracker(image) for _ in range(600)]
    assert all(one is None for one in found[:60])
    later = next(one for one in found if one is not None)
    assert later.pixels[0, 0] == pytest.approx(1000.0)


def test_a_person_who_is_not_there_is_not_followed() -> None:
    image = np.zeros((400, 600, 3), dtype=np.uint8)
    assert PersonTracker(People(500.0), landmark_network(0.1))(image) is None
    assert PersonTracker(People(500.0), landmark_network(0.9), person=2)(image) is None
