"""Gaps filled, spikes taken out, noise filtered: inside a pass, never across its ends."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.signal import butter, sosfiltfilt

from kinemimic.pipeline.clip import Clip
from kinemimic.pipeline.euler import local_rotations, world_positions
from kinemimic.pipeline.rotations import continuous, normalize
from kinemimic.pipeline.skeleton import INFERRED

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Longer gaps stay gaps: a fifth of a second is about a fifth of a stride, beyond which a curve through
# the ends is invention.
LONGEST_GAP = 0.2
CUTOFF = 6.0
# A value this far (metres) from the median of five frames, and further than three times the usual scatter
# about it, is a spike.
SPIKE = 0.03
# Clocks within this share of the step count as even.
EVEN_CLOCK = 0.02


@dataclass(frozen=True)
class Cleaning:
    """filled: (T, J) values that interpolation put there; spikes: (T, J) values replaced; done: in words."""

    filled: Mask
    spikes: Mask
    done: tuple[str, ...]


def clean(clip: Clip, *, butterworth: bool) -> tuple[Clip, Cleaning]:
    """The clip with the same frames, cleaned, and what was done to it.

    A capture of positions is filled, freed of spikes and filtered. One of rotations has neither gaps nor
    spikes; filtering it leaves `euler` as recorded and puts the filtered `rotations` beside it.
    Frames outside passes stay as recorded.
    """
    nothing = np.zeros(clip.states.shape, dtype=np.bool_)
    if clip.euler is not None:
        if not butterworth:
            return clip, Cleaning(nothing, nothing, ("rotations as recorded, not filtered",))
        filtered, note = _filter_rotations(clip)
        return filtered, Cleaning(nothing, nothing, (note,))
    positions, filled = fill(clip)
    done = [f"gaps up to {LONGEST_GAP} s filled: {int(filled.sum())} joint positions"]
    spikes = nothing
    if butterworth:
        positions, spikes = despike(positions, clip.passes)
        done.append(f"spikes replaced by the median of five frames: {int(spikes.sum())} joint positions")
        positions, note = low_pass(positions, clip.times, clip.passes)
        done.append(note)
    rotations = clip.rotations
    if rotations is not None and butterworth:
        # Sign-continuous quaternions as four-vectors, as in _filter_rotations.
        rotations = continuous(normalize(low_pass(rotations, clip.times, clip.passes)[0]))
    states = np.where(filled, INFERRED, clip.states).astype(np.uint8)
    return replace(clip, positions=positions, rotations=rotations, states=states), Cleaning(
        filled, spikes, tuple(done)
    )


def runs(mask: Mask) -> Iterator[slice]:
    """The stretches of True in a mask (T,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    yield from (slice(int(begin), int(end)) for begin, end in edges.reshape(-1, 2))


def _whole(values: Array, axis: int | tuple[int, ...] = -1) -> Mask:
    """Where no value along `axis` is missing."""
    return np.asarray(np.isfinite(values).all(axis=axis), dtype=np.bool_)


def _passes(passes: NDArray[np.int32]) -> Iterator[slice]:
    for number in range(int(passes.max(initial=-1)) + 1):
        yield from runs(passes == number)


def fill(clip: Clip) -> tuple[Array, Mask]:
    """Positions (T, J, 3) with the short gaps of each pass interpolated, and where (T, J).

    A gap is filled if the frames on both its sides are at most LONGEST_GAP plus one usual step apart; the
    edges of a pass are not extrapolated. Monotone cubics do not swing beyond what was measured.
    """
    positions, filled = clip.positions.copy(), np.zeros(clip.states.shape, dtype=np.bool_)
    step = float(np.median(np.diff(clip.times))) if len(clip.times) > 1 else 0.0
    for span in _passes(clip.passes):
        times = clip.times[span]
        for joint in range(positions.shape[1]):
            p = positions[span, joint]
            there = _whole(p)
            if there.all() or there.sum() < 2:
                continue
            curve = PchipInterpolator(times[there], p[there])
            for gap in runs(~there):
                if gap.start == 0 or gap.stop == len(times):
                    continue
                if times[gap.stop] - times[gap.start - 1] <= LONGEST_GAP + step + 1e-6:
                    p[gap] = curve(times[gap])
                    filled[span, joint][gap] = True
    return positions, filled


def despike(positions: Array, passes: NDArray[np.int32]) -> tuple[Array, Mask]:
    """Positions with spikes replaced by the median of five frames, and where (T, J): a Hampel filter.

    The first and last two frames of a pass have no such window and stay.
    """
    result, spikes = positions.copy(), np.zeros(positions.shape[:2], dtype=np.bool_)
    for span in _passes(passes):
        if span.stop - span.start < 5:
            continue
        p = positions[span]
        window = np.moveaxis(np.lib.stride_tricks.sliding_window_view(p, 5, axis=0), -1, 1)  # (T-4, 5, J, 3)
        whole = _whole(window, (1, 3))
        median = np.median(np.where(whole[:, None, :, None], window, 0.0), axis=1)
        off = np.linalg.norm(np.where(whole[..., None], p[2:-2] - median, 0.0), axis=-1)
        scatter = [np.median(d[w]) if w.any() else 0.0 for d, w in zip(off.T, whole.T, strict=True)]
        spike = off > np.maximum(SPIKE, 3.0 * np.array(scatter))
        result[span][2:-2][spike] = median[spike]
        spikes[span][2:-2] = spike
    return result, spikes


def low_pass(values: Array, times: Array, passes: NDArray[np.int32]) -> tuple[Array, str]:
    """Values (T, J, K) low-passed at CUTOFF in each pass, and a line that says how.

    NaN stay, and each stretch between them is filtered by itself. An uneven clock is first brought to an
    even one (cubic), and back afterwards.
    """
    result = values.copy()
    short = 0
    spans = list(_passes(passes))
    rate = 1.0 / float(np.median(np.concatenate([np.diff(times[span]) for span in spans])))
    smooth = zero_phase(rate)
    if smooth is None:
        return result, f"not filtered: {rate:.4g} frames a second are too few for {CUTOFF} Hz"
    for span in spans:
        whole = _whole(values[span])
        complete = whole.all(axis=0)
        groups = [(slice(0, len(whole)), complete)] if complete.any() else []
        for joint in np.flatnonzero(~complete):
            only = np.arange(whole.shape[1]) == joint
            groups += [(stretch, only) for stretch in runs(whole[:, joint])]
        for stretch, joints in groups:
            if stretch.stop - stretch.start < 4:
                short += int(joints.sum())
                continue
            part = result[span][stretch]
            part[:, joints] = _on_even_clock(part[:, joints], times[span][stretch], rate, smooth)
    note = f"zero-phase Butterworth, 4th order, {CUTOFF} Hz"
    return result, note + (f"; {short} stretches of under four frames left as they are" if short else "")


def zero_phase(rate: float) -> Callable[[Array], Array] | None:
    """A filter along axis 0 of evenly sampled values, or None if `rate` (Hz) is too low for CUTOFF.

    Two poles forward and two backward make four and no delay; the design is shifted so that the pair, not
    each, is 3 dB down at the cut-off (Winter 2009, Biomechanics and Motor Control, eq. 3.18).
    """
    correction = (np.sqrt(2.0) - 1.0) ** 0.25
    if 0.4 * rate < CUTOFF:
        return None
    design = np.arctan(np.tan(np.pi * CUTOFF / rate) / correction) / np.pi * rate
    sections = butter(2, design, fs=rate, output="sos")

    def smooth(values: Array) -> Array:
        # Mirrored through its end, the curve goes on for three periods, as far as there is data, so that
        # the filter has forgotten its start where the data begin.
        padding = min(len(values) - 1, int(3.0 * rate / CUTOFF))
        return np.asarray(sosfiltfilt(sections, values, axis=0, padlen=padding))

    return smooth


def _on_even_clock(values: Array, times: Array, rate: float, smooth: Callable[[Array], Array]) -> Array:
    steps = np.diff(times)
    if np.ptp(steps) <= EVEN_CLOCK * float(np.median(steps)):
        return smooth(values)
    even = np.linspace(times[0], times[-1], max(4, round((times[-1] - times[0]) * rate) + 1))
    return np.asarray(CubicSpline(even, smooth(CubicSpline(times, values)(even)))(times))


def _filter_rotations(clip: Clip) -> tuple[Clip, str]:
    """Quaternions low-passed as four-vectors and renormalised, joint positions in their parents likewise.

    Sign-continuous quaternions are a smooth curve on the sphere through any number of full turns, which
    Euler angles and rotation vectors are not; the low-passed curve stays near it, and is put back on it.
    """
    assert clip.euler is not None and clip.orders is not None and clip.translations is not None  # noqa: S101
    recorded = local_rotations(clip.euler, clip.orders, clip.world_from_file, clip.rests)
    filtered, note = low_pass(recorded, clip.times, clip.passes)
    rotations = continuous(normalize(filtered))
    translations, _ = low_pass(clip.translations, clip.times, clip.passes)
    positions = world_positions(clip.skeleton, translations, rotations, clip.world_from_file)
    cleaned = replace(clip, positions=positions, translations=translations, rotations=rotations)
    return cleaned, f"rotations: {note}"
