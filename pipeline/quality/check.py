"""Check a recorded capture: apply every quality rule, repair what can be repaired, and find its passes.

Rules about the whole body (axes, units, sides) precede the division into passes, which measures speeds in
metres. Rules about single frames and joints follow it, because they must not reach across the end of a pass.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.filters.clean import FILTER_DESCRIPTIONS
from kinemimic.pipeline.filters.options import FILTERS
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.plural import plural
from kinemimic.pipeline.quality.passes import MIN_PASS_DURATION, Acquisition, find_passes, with_passes
from kinemimic.pipeline.quality.rules import (
    assumed_rate,
    calibration_frames,
    clock,
    duplicate_frames,
    exchanged_legs,
    gaps,
    hidden_legs,
    jumps,
    knee_sign,
    limb_lengths,
    mirrored_body,
    seen_from_behind,
    swapped_limbs,
    turning_camera,
    wide_hips,
    wrong_rate,
    wrong_units,
    wrong_up_axis,
)
from kinemimic.pipeline.quality.rules.defect import RULES, Defect, defect_from_json, sorted_defects
from kinemimic.pipeline.quality.rules.frame_selection import renumber_defects


@dataclass(frozen=True)
class CheckedCapture:
    """clip: repaired but unfiltered, with numbered passes; defects: found by the reader and the rules."""

    clip: Clip
    acquisition: Acquisition
    defects: tuple[Defect, ...]

    @property
    def refused(self) -> Defect | None:
        """The first defect that refuses the capture, if any."""
        return next((defect for defect in self.defects if defect.action == "refused"), None)


# In the order in which they run.
_BODY_RULES = (
    wrong_units.repair,
    calibration_frames.repair,
    wrong_up_axis.repair,
    mirrored_body.repair,
    wide_hips.repair,
    assumed_rate.repair,
)
# A person seen from behind first: where trunk and toes contradict the knees, the legs seem to be exchanged.
_RULES_IN_PASSES = (swapped_limbs.repair, seen_from_behind.repair, exchanged_legs.repair, jumps.repair)
_DETECTION_RULES = (
    limb_lengths.detect,
    turning_camera.detect,
    wrong_rate.detect,
    knee_sign.detect,
    hidden_legs.detect,
)


def check_capture(recorded: Clip) -> CheckedCapture:
    """Apply every rule, in order, to a capture as its reader returned it.

    Raises no error for bad data: `CheckedCapture.refused` gives the reason if the capture cannot be used.
    """
    read = [defect_from_json(record) for record in recorded.provenance["reading"]["defects"]]
    clip, defects = recorded, list[Defect]()
    for repair in _BODY_RULES:
        repaired, found = repair(clip)
        # At once: by the time a rule has changed the clock, frames are not known by their times any more.
        read, defects, clip = _renumbered(read, clip, repaired), [*defects, *found], repaired
    clip, acquisition = _passes(clip)
    refused = [one for one in defects if one.action == "refused"]
    if refused or acquisition.count == 0:
        # The remaining rules need metres and a subject.
        refusals = refused or [_no_subject(clip, acquisition)]
        return CheckedCapture(clip, acquisition, sorted_defects([*read, *refusals]))
    deduplicated, found = duplicate_frames.repair(clip)
    if found:
        read, defects = _renumbered(read, clip, deduplicated), [*defects, *found]
        clip, acquisition = _passes(deduplicated)
        if acquisition.count == 0:
            return CheckedCapture(
                clip, acquisition, sorted_defects([*read, *defects, _no_subject(clip, acquisition)])
            )
    clip, found = duplicate_frames.mark_frozen(clip, acquisition.repeats)
    defects += found
    defects += clock.detect(clip) + gaps.detect(clip)
    clip, found = jumps.repair_body(clip, acquisition.displaced)
    defects += found
    for repair in _RULES_IN_PASSES:
        clip, found = repair(clip)
        defects += found
    for detect in _DETECTION_RULES:
        defects += detect(clip)
    if not any(defect.action == "refused" for defect in defects):
        defects += _missing_nodes(clip)
    return CheckedCapture(clip, acquisition, sorted_defects([*read, *defects]))


def _renumbered(defects: list[Defect], before: Clip, after: Clip) -> list[Defect]:
    """The defects with their frames renumbered after frames were dropped from the clip."""
    if len(after.times) == len(before.times):
        return defects
    return renumber_defects(defects, np.isin(before.times, after.times))


def _passes(clip: Clip) -> tuple[Clip, Acquisition]:
    acquisition = find_passes(clip)
    return with_passes(clip, acquisition), acquisition


def planned_steps(checked: CheckedCapture) -> list[str]:
    """What `ingest` will do with the capture by default, as sentences."""
    if checked.refused is not None:
        return [f"refused: {checked.refused.text}"]
    clip, acquisition = checked.clip, checked.acquisition
    lengths = [clip.times[clip.passes == number] for number in range(acquisition.count)]
    frames = sum(map(len, lengths))
    seconds = sum(float(times[-1] - times[0]) for times in lengths)
    steps = [f"{plural(acquisition.count, 'pass', 'passes')}, {plural(frames, 'frame')}, {seconds:.1f} s"]
    if (outside := len(clip.times) - frames) or acquisition.discarded:
        short = plural(acquisition.discarded, "pass", "passes")
        steps.append(f"{plural(outside, 'frame')} outside passes left out ({short} too short)")
    steps += [
        f"{RULES[defect.rule]}: {defect.text}"
        for defect in checked.defects
        if defect.action == "repaired" or defect.rule == "gaps"
    ]
    values = "positions" if clip.euler is None else "rotations"
    return [*steps, f"{values}: {FILTER_DESCRIPTIONS[FILTERS[0]]}"]


def _no_subject(clip: Clip, acquisition: Acquisition) -> Defect:
    seen = any(event.reason == "subject seen" for event in acquisition.events)
    if seen:
        count = acquisition.discarded
        which = "the only pass is" if count == 1 else f"all {count} passes are"
        text = f"{which} shorter than {MIN_PASS_DURATION} s"
        return Defect("gaps", acquisition.discarded, "passes", "refused", text)
    frames = len(clip.times)
    if acquisition.repeats.nobody.all():
        text = f"nobody moves in any of {frames} frames: all repeat one pose, bit for bit"
        return Defect("duplicate_frames", frames, "frames", "refused", text)
    return Defect("zero_frames", frames, "frames", "refused", f"no subject in any of {frames} frames")


def _missing_nodes(clip: Clip) -> list[Defect]:
    """A refusal if the 20 nodes cannot be found, which every later stage needs."""
    try:
        to_nodes(clip)
    except KinemimicError as error:
        return [Defect("wrong_names", len(clip.skeleton.names), "joints", "refused", str(error))]
    return []
