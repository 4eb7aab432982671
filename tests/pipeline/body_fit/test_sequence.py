"""A body that walks in front of a known camera is found again from its points in the image."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.body_fit import sequence
from kinemimic.pipeline.body_fit.body import (
    LENGTHS,
    POINT_INDEX,
    POINTS,
    SEGMENT_INDEX,
    SEGMENTS,
    UNKNOWNS,
    kind_of,
)
from kinemimic.pipeline.body_fit.camera import SceneCamera
from kinemimic.pipeline.body_fit.expectations import add_limits
from kinemimic.pipeline.body_fit.normal_equations import NormalEquations
from kinemimic.pipeline.body_fit.observed import Observed
from kinemimic.pipeline.body_fit.pose import Poses, place
from kinemimic.pipeline.body_fit.sequence import FittedBody, fit_body
from kinemimic.pipeline.body_fit.settings import POINT_ERRORS, FitSettings

CAMERA = SceneCamera((720, 1280), 967.0, 1.45, pitch=0.06, roll=0.01)
RATE, HEIGHT = 30.0, 1.75


def walker(frames: int) -> Poses:
    """Poses of a walk towards the camera and to one side: sines at a stride a second."""
    still = np.broadcast_to(np.eye(3), (frames, len(SEGMENTS), 3, 3)).copy()
    start = Poses(np.zeros((frames, 3)), still, np.zeros((frames, len(SEGMENTS))))
    phase = 2.0 * np.pi * np.arange(frames) / RATE
    step = np.zeros((frames, UNKNOWNS.count))
    for side, shift in (("left", 0.0), ("right", np.pi)):
        swing = np.sin(phase + shift)
        thigh, shank = (UNKNOWNS.columns(SEGMENT_INDEX[f"{name}_{side}"]) for name in ("thigh", "shank"))
        step[:, thigh.start + 1] = -0.1 - 0.35 * swing
        step[:, shank.start] = 0.35 + 0.3 * np.cos(phase + shift)
        step[:, UNKNOWNS.columns(SEGMENT_INDEX[f"forearm_{side}"]).start] = 0.4
    poses = start.moved(step)
    heading = np.zeros((frames, UNKNOWNS.count))
    heading[:, 5] = np.pi - 0.7  # facing the camera, turned aside
    poses = poses.moved(heading)
    at = np.arange(frames) / RATE
    root = np.column_stack([5.0 - 0.6 * at, -0.6 + 0.5 * at, np.zeros(frames)])
    lowest = place(poses, np.ones(len(LENGTHS)), HEIGHT).points[..., 2].min(axis=1)
    return replace(poses, root=root - np.column_stack([0.0 * lowest, 0.0 * lowest, lowest]))


def seen(points: Array, noise: float) -> Observed:
    """What a network makes of points (T, P, 3): pixels with noise, places with half of the depth."""
    rng = np.random.default_rng(0)
    pixels = CAMERA.project(points) + rng.normal(0.0, noise, (*points.shape[:2], 2))
    rough = CAMERA.seen(points)
    rough -= rough[:, None, POINT_INDEX["hip_center"]]
    rough[..., 2] *= 0.7
    shown = np.array([kind_of(point.name) in POINT_ERRORS for point in POINTS])
    certainty = np.broadcast_to(shown.astype(float), points.shape[:2]).copy()
    pixels[:, ~shown] = rough[:, ~shown] = np.nan
    return Observed(np.arange(len(points)) / RATE, pixels, certainty, rough, CAMERA.size)


def knees(points: Array) -> Array:
    """(T, 2) degrees."""
    found = []
    for side in ("left", "right"):
        hip, knee, ankle = (points[:, POINT_INDEX[f"{joint}_{side}"]] for joint in ("hip", "knee", "ankle"))
        a, b = knee - hip, ankle - knee
        cosine = np.sum(a * b, axis=-1) / np.linalg.norm(a, axis=-1) / np.linalg.norm(b, axis=-1)
        found.append(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
    return np.stack(found, axis=1)


def fitted(observed: Observed) -> FittedBody:
    body = fit_body(observed, height=HEIGHT)
    assert body is not None
    return body


@pytest.fixture(scope="module")
def truth() -> Array:
    return place(walker(75), np.ones(len(LENGTHS)), HEIGHT).points


@pytest.fixture(scope="module")
def found(truth: Array) -> FittedBody:
    return fitted(seen(truth, noise=2.0))


def test_the_knees_are_found_again(truth: Array, found: FittedBody) -> None:
    error = knees(found.points) - knees(truth)
    assert np.sqrt(np.mean(error**2)) < 5.0
    assert np.corrcoef(knees(found.points).ravel(), knees(truth).ravel())[0, 1] > 0.97


def test_feet_are_on_the_floor_and_the_scene_has_the_persons_size(truth: Array, found: FittedBody) -> None:
    feet = [POINT_INDEX[f"{name}_{side}"] for name in ("heel", "foot") for side in ("left", "right")]
    assert found.points[:, feet, 2].min() > -0.03
    assert np.median(found.points[:, feet, 2].min(axis=1)) < 0.03
    trunk = found.points[:, POINT_INDEX["shoulder_center"]] - found.points[:, POINT_INDEX["hip_center"]]
    true = truth[:, POINT_INDEX["shoulder_center"]] - truth[:, POINT_INDEX["hip_center"]]
    ratio = np.linalg.norm(trunk, axis=-1).mean() / np.linalg.norm(true, axis=-1).mean()
    assert 0.93 < ratio < 1.07
    assert found.scene.camera.pitch == pytest.approx(CAMERA.pitch, abs=0.08)


def test_bones_do_not_change_their_length(found: FittedBody) -> None:
    for a, b in (("hip_left", "knee_left"), ("knee_right", "ankle_right")):
        length = np.linalg.norm(found.points[:, POINT_INDEX[a]] - found.points[:, POINT_INDEX[b]], axis=-1)
        assert np.ptp(length) < 1e-9


def test_frames_without_the_person_are_bridged_or_missing(truth: Array) -> None:
    observed = seen(truth, noise=2.0)
    for frames in (slice(20, 25), slice(40, 60)):  # a sixth of a second, and longer than LONGEST_GAP
        observed.certainty[frames] = 0.0
        observed.pixels[frames] = observed.world[frames] = np.nan
    points = fitted(observed).points
    assert np.isfinite(points[:40]).all() and np.isfinite(points[60:]).all()
    assert np.isnan(points[40:60]).all()
    assert np.abs(knees(points[20:25]) - knees(truth[20:25])).max() < 20.0


def test_windows_agree_with_one_fit(truth: Array, found: FittedBody, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sequence, "WINDOW", 40)
    monkeypatch.setattr(sequence, "OVERLAP", 14)
    done: list[int] = []
    body = fit_body(seen(truth, noise=2.0), height=HEIGHT, advance=done.append)
    assert body is not None and sum(done) == len(truth)
    assert np.sqrt(np.mean((knees(body.points) - knees(found.points)) ** 2)) < 4.0


def test_nobody_in_view_is_no_body(truth: Array) -> None:
    observed = seen(truth, noise=0.0)
    observed.certainty[:] = 0.0
    assert fit_body(observed) is None
    assert fit_body(seen(truth[:3], noise=0.0)) is None


def test_a_knee_that_bends_forwards_costs() -> None:
    poses = walker(4)
    step = np.zeros((4, UNKNOWNS.count))
    step[:, UNKNOWNS.columns(SEGMENT_INDEX["shank_left"])] = -2.0
    costs = []
    for tried in (poses, poses.moved(step)):
        equations = NormalEquations(4, UNKNOWNS.count, len(LENGTHS) + 4)
        add_limits(equations, tried, 1.0)
        costs.append(equations.cost)
    assert costs[1] > costs[0] + 100.0


def test_every_term_can_be_left_out_and_makes_a_difference(truth: Array) -> None:
    observed = seen(truth[:20], noise=2.0)
    whole = fit_body(observed, height=HEIGHT)
    assert whole is not None
    for name in ("image", "depth", "floor", "limits", "smooth"):
        body = fit_body(observed, height=HEIGHT, settings=FitSettings(**{name: False}))
        assert body is not None and np.isfinite(body.points).all()
        assert np.abs(body.points - whole.points).max() > 1e-4, name
