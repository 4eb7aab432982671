"""A live capture of a walker whose truth is known: causal, in any axes and unit, gaps, swapped legs."""

from __future__ import annotations

import numpy as np
import pytest
from samples.live_stream import CLIP, STEP, TIMES, frames, played, seen, truth

from kinemimic.pipeline.kinematics.rotations import conjugate, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.live.capture import LAG, LiveCapture, Moment
from kinemimic.pipeline.live.recogniser import _TURNS, UP_NAMES, Recogniser


def test_the_moments_follow_the_walker_at_the_lag() -> None:
    found = seen(played(frames()))
    assert len(found) > 60
    for moment in found[10:]:
        assert moment.lag == pytest.approx(LAG, abs=STEP)
        assert np.abs(moment.positions[moment.now] - truth(moment)).max() < 0.02
    assert np.diff([moment.time for moment in found]) == pytest.approx(STEP, rel=0.06)


def test_nothing_later_changes_a_moment() -> None:
    """Causal: the moments are the same to the bit if the sender goes on otherwise."""
    whole, half = played(frames()), len(TIMES) // 2
    wild = CLIP.positions.copy()
    wild[half:] += 5.0
    other = played(frames(wild))
    count = int(TIMES[half] / STEP)
    for one, two in zip(whole[:count], other[:count], strict=True):
        assert (one is None) == (two is None)
        if one is not None and two is not None:
            assert np.array_equal(one.positions, two.positions, equal_nan=True)


@pytest.mark.parametrize("up", sorted(UP_NAMES))
def test_axes_and_units_are_recognised(up: str) -> None:
    turn = _TURNS[UP_NAMES[up]]
    sent = 1000.0 * rotate(conjugate(turn), CLIP.positions)
    capture = LiveCapture(step=STEP)
    found = seen(played(frames(sent), capture))
    reading = capture.recogniser.reading
    assert reading is not None
    assert (reading.up, reading.unit) == (up, "mm")
    assert np.abs(found[-1].positions[found[-1].now] - truth(found[-1])).max() < 0.02


def test_hips_at_the_outside_of_the_pelvis_come_together() -> None:
    wide = CLIP.positions.copy()
    half = 0.5 * (wide[:, N["hip_left"]] - wide[:, N["hip_right"]])
    wide[:, N["hip_left"]] += half
    wide[:, N["hip_right"]] -= half
    hips = [N["hip_left"], N["hip_right"]]
    found = seen(played(frames(wide)))
    assert len(found) > 60
    for moment in found[10:]:
        assert np.abs(moment.positions[moment.now] - truth(moment))[hips].max() < 0.03


@pytest.mark.parametrize("apart", [1.0, 2.0])
def test_a_hip_that_a_sender_loses(apart: float) -> None:
    """It takes the other along only where that one's own place is unknown."""
    points = CLIP.positions.copy()
    hips = [N["hip_left"], N["hip_right"]]
    half = 0.5 * (apart - 1.0) * (points[:, hips[0]] - points[:, hips[1]])
    points[:, hips[0]] += half
    points[:, hips[1]] -= half
    recogniser = Recogniser()
    for frame in frames(points)[:20]:
        recogniser.take(frame)
    assert recogniser.reading is not None
    points[30, hips[1]] = np.nan
    found, states = recogniser.reading.nodes(frames(points)[30])
    assert np.isfinite(found[hips[0]]).all() == (apart == 1.0)
    assert (states[hips[0]] > 0) == (apart == 1.0)
    assert states[hips[1]] == 0


def test_gaps_late_repeated_and_reordered_frames() -> None:
    sent = frames()
    rng = np.random.default_rng(1)
    hidden = CLIP.positions.copy()
    hidden[40:43, N["knee_left"]] = np.nan
    order = [*frames(hidden)]
    for k in rng.choice(len(order) - 2, 12, replace=False):
        order[k], order[k + 1] = order[k + 1], order[k]
    capture = LiveCapture(step=STEP)
    out = list[Moment | None]()
    for k, frame in enumerate([one for pair in zip(order, order, strict=True) for one in pair]):
        capture.take(frame)
        if k % 2:
            out.append(capture.advance())
    assert capture.late >= len(sent)
    found = seen(out)
    errors = [np.abs(moment.positions[moment.now] - truth(moment)).max() for moment in found[10:]]
    assert np.quantile(errors, 0.95) < 0.03


def test_swapped_legs_are_put_back() -> None:
    swapped = CLIP.positions.copy()
    legs = [[N[f"{joint}_{side}"] for joint in ("knee", "ankle", "foot")] for side in ("left", "right")]
    apart = np.linalg.norm(CLIP.positions[:, legs[0][1]] - CLIP.positions[:, legs[1][1]], axis=-1)
    k = 30 + int(np.argmax(apart[30:60]))
    for rows in (slice(k - 1, k + 2),):
        swapped[rows, legs[0]], swapped[rows, legs[1]] = (
            CLIP.positions[rows, legs[1]],
            CLIP.positions[rows, legs[0]],
        )
    capture = LiveCapture(step=STEP)
    found = seen(played(frames(swapped), capture))
    assert capture.sides.swaps == 3
    assert max(np.abs(m.positions[m.now] - truth(m)).max() for m in found[10:]) < 0.02


def test_a_walker_seen_from_behind_gets_their_sides_back() -> None:
    other = CLIP.positions.copy()
    for node, index in N.items():
        if node.endswith("_left"):
            mirror = N[node.replace("_left", "_right")]
            other[:, index], other[:, mirror] = CLIP.positions[:, mirror], CLIP.positions[:, index]
    capture = LiveCapture(step=STEP)
    found = seen(played(frames(other), capture))
    assert capture.sides.reversals > 30
    assert np.abs(found[-1].positions[found[-1].now] - truth(found[-1])).max() < 0.02
