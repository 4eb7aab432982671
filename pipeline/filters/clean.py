"""Clean a clip within each pass: fill short gaps, remove noise and outliers."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.filters.bone_lengths import bone_weights
from kinemimic.pipeline.filters.fill import LONGEST_GAP, fill_gaps
from kinemimic.pipeline.filters.kalman import smooth
from kinemimic.pipeline.filters.low_pass import CUTOFF, low_pass
from kinemimic.pipeline.filters.one_euro import one_euro
from kinemimic.pipeline.filters.options import FILTERS
from kinemimic.pipeline.filters.spikes import despike
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.euler import rotations_of_channels, world_positions
from kinemimic.pipeline.kinematics.rotations import continuous, normalize
from kinemimic.pipeline.kinematics.skeleton import INFERRED
from kinemimic.pipeline.kinematics.spans import all_finite

# One line for each filter, for reports and plans.
FILTER_DESCRIPTIONS: dict[str, str] = {
    "kalman": "Kalman-RTS smoother, cut-offs by likelihood, outliers rejected",
    "butterworth": f"zero-phase Butterworth, 4th order, {CUTOFF:g} Hz",
    "one-euro": "One-Euro filter, causal",
    "none": "not filtered",
}


@dataclass(frozen=True)
class Cleaning:
    """filled: (T, J) filled gaps; spikes: (T, J) outliers replaced or rejected; done: the steps in words."""

    filled: Mask
    spikes: Mask
    done: tuple[str, ...]


def clean(clip: Clip, method: str) -> tuple[Clip, Cleaning]:
    """The clip cleaned by one of FILTERS, with the same frames, and a record of the changes.

    Positions, and quaternions that the sensor recorded with them, are filled and filtered. Of a capture of
    Euler channels, `euler` stays as recorded; filled or filtered `rotations` are added. Frames outside passes
    stay as recorded. KinemimicError for an unknown method.
    """
    if method not in FILTERS:
        raise KinemimicError(f"expected a filter among {', '.join(FILTERS)}, found {method!r}")
    if clip.euler is not None:
        return _clean_channels(clip, method)
    positions, filled = fill_gaps(clip.positions, clip.times, clip.passes)
    done = [f"gaps up to {LONGEST_GAP} s filled: {int(filled.sum())} joint positions"]
    spikes = np.zeros(filled.shape, dtype=np.bool_)
    if method in ("butterworth", "one-euro"):
        positions, spikes = despike(positions, clip.passes)
        done.append(f"spikes replaced by the median of five frames: {int(spikes.sum())} joint positions")
    credibility = bone_weights(positions, clip.skeleton, clip.passes).positions
    positions, overruled, note = _filter(clip, positions, filled, method, credibility)
    if method == "kalman":
        spikes = overruled
        done.append(f"outliers rejected: {int(spikes.sum())} joint positions")
    if method != "none":
        done.append(note)
    states = np.where(filled, INFERRED, clip.states).astype(np.uint8)
    rotations = clip.rotations
    if rotations is not None:
        rotations, _, _ = _clean_rotations(clip, rotations, method, credibility)
    cleaned = replace(clip, positions=positions, rotations=rotations, states=states)
    return cleaned, Cleaning(filled, spikes, tuple(done))


def _clean_channels(clip: Clip, method: str) -> tuple[Clip, Cleaning]:
    assert clip.euler is not None and clip.orders is not None and clip.translations is not None  # noqa: S101
    recorded = rotations_of_channels(clip.euler, clip.orders, clip.world_from_file, clip.rests)
    places = world_positions(clip.skeleton, clip.translations, recorded, clip.world_from_file)
    gaps = ~(all_finite(recorded) & all_finite(places))
    if method == "none" and not gaps.any():
        return clip, Cleaning(gaps, gaps, ("rotations as recorded, not filtered",))
    weights = bone_weights(places, clip.skeleton, clip.passes)
    del places
    rotations, spikes, note = _clean_rotations(clip, recorded, method, weights.rotations)
    translations, bridged = fill_gaps(clip.translations, clip.times, clip.passes)
    translations, _, _ = _filter(clip, translations, bridged, method, weights.bones)
    positions = world_positions(clip.skeleton, translations, rotations, clip.world_from_file)
    filled = gaps & all_finite(rotations) & all_finite(positions)
    cleaned = replace(
        clip,
        positions=positions,
        translations=translations,
        rotations=rotations,
        states=np.where(filled, INFERRED, clip.states).astype(np.uint8),
    )
    done = [f"gaps up to {LONGEST_GAP} s filled: {int(filled.sum())} joints"] if gaps.any() else []
    return cleaned, Cleaning(filled, spikes, (*done, f"rotations: {note}"))


def _clean_rotations(
    clip: Clip, rotations: Array, method: str, credibility: Array
) -> tuple[Array, Mask, str]:
    """Quaternions (T, J, 4) filled and filtered as four-vectors, then normalised.

    Sign-continuous quaternions are a smooth curve on the sphere through any number of full turns, unlike
    Euler angles and rotation vectors; the filtered curve stays close to the sphere.
    """
    # Recorded signs are continuous, but not where a repair has exchanged sides or dropped frames.
    whole, filled = fill_gaps(continuous(rotations), clip.times, clip.passes)
    filtered, overruled, note = _filter(clip, whole, filled, method, credibility)
    if method == "none" and not filled.any():
        return rotations, overruled, note
    return continuous(normalize(filtered)), overruled, note


def _filter(
    clip: Clip, values: Array, filled: Mask, method: str, credibility: Array
) -> tuple[Array, Mask, str]:
    """Filtered values (T, J, K), a mask (T, J) of rejected outliers, and a description of the filter.

    credibility: (T, J) weights of the values, which only the Kalman smoother heeds.
    """
    nothing = np.zeros(filled.shape, dtype=np.bool_)
    if method == "kalman":
        found = smooth(values, clip.times, clip.passes, clip.states, filled, credibility)
        return found.values, found.overruled, _cut_offs(found.cutoff)
    if method == "butterworth":
        filtered, note = low_pass(values, clip.times, clip.passes)
        return filtered, nothing, note
    if method == "one-euro":
        return one_euro(values, clip.times, clip.passes), nothing, FILTER_DESCRIPTIONS[method]
    return values, nothing, FILTER_DESCRIPTIONS[method]


def _cut_offs(found: Array) -> str:
    seen = found[np.isfinite(found)]
    span = f"cut-offs {seen.min():.1f} to {seen.max():.1f} Hz" if len(seen) else "nothing moves"
    return f"Kalman-RTS smoother, {span} by likelihood"
