"""The One-Euro filter: causal, smoother at low speed, with the lag of its cut-off."""

from __future__ import annotations

import numpy as np
import pytest

from kinemimic.pipeline.filters.one_euro import REST_CUTOFF, one_euro

STEP = 1.0 / 30.0


def passes(frames: int) -> np.typing.NDArray[np.int32]:
    return np.zeros(frames, dtype=np.int32)


def test_the_first_step_by_hand() -> None:
    """From rest to a millimetre: the speed is a hundredth, so the cut-off is the one at rest."""
    values = np.zeros((3, 1, 3))
    values[1:, 0, 0] = 1e-6
    out = one_euro(values, STEP * np.arange(3), passes(3))
    turn = 2 * np.pi * REST_CUTOFF * STEP
    first = turn / (1 + turn)
    assert out[1, 0, 0] == pytest.approx(1e-6 * first, rel=1e-4)
    assert out[2, 0, 0] == pytest.approx(1e-6 * (first + (1 - first) * first), rel=1e-4)


def test_nothing_later_changes_what_was_before() -> None:
    values = np.cumsum(np.random.default_rng(0).standard_normal((60, 2, 3)), axis=0)
    cut = values.copy()
    cut[40:] = 0.0
    times = STEP * np.arange(60)
    assert np.array_equal(one_euro(values, times, passes(60))[:40], one_euro(cut, times, passes(60))[:40])


def test_noise_at_rest_shrinks_and_quick_motion_is_followed() -> None:
    rng = np.random.default_rng(1)
    noise = 0.01 * rng.standard_normal((600, 1, 3))
    times = STEP * np.arange(600)
    still = one_euro(noise, times, passes(600))
    assert np.std(still[30:]) < 0.5 * np.std(noise)
    slow, quick = (one_euro(v * times[:, None, None] * np.ones(3), times, passes(600)) for v in (0.1, 5.0))
    late = [float(times[-1] - out[-1, 0, 0] / v) for out, v in ((slow, 0.1), (quick, 5.0))]
    assert 0.05 < late[0] < 1.0 / (2 * np.pi * REST_CUTOFF)
    assert 0.0 < late[1] < 0.2 * late[0]


def test_each_stretch_starts_afresh() -> None:
    values = np.ones((40, 1, 3))
    values[20:] = 5.0
    values[18:20] = np.nan
    out = one_euro(values, STEP * np.arange(40), passes(40))
    assert np.array_equal(out, values, equal_nan=True)
    numbered = np.repeat([0, 1], 20).astype(np.int32)
    values[18:20] = 1.0
    assert np.array_equal(one_euro(values, STEP * np.arange(40), numbered), values)
