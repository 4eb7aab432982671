"""A recorded capture looked over: what is wrong with it by rule, what is repaired, where its passes are.

Rules about the whole body (axes, units, sides) come before the division into passes, which measures speeds
in metres; rules about single frames and joints come after it, because nothing may reach across a pass's end.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.filters.clean import FILTERS, WORDS
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.quality.passes import MIN_PASS_DURATION, Acquisition, find_passes, with_passes
from kinemimic.pipeline.quality.rules import (
    calibration_frames,
    clock,
    duplicate_frames,
    gaps,
    jumps,
    limb_lengths,
    mirrored_body,
    seen_from_behind,
    swapped_limbs,
    turning_camera,
    wrong_rate,
    wrong_units,
    wrong_up_axis,
)
from kinemimic.pipeline.quality.rules.defect import RULES, Defect, defect_from_json, sorted_defects
from kinemimic.pipeline.quality.rules.frame_selection import renumber_defects


@dataclass(frozen=True)
class CheckedCapture:
    """clip: repaired, as recorded otherwise, its passes numbered; defects: the reader's and the rules'."""

    clip: Clip
    acquisition: Acquisition
    defects: tuple[Defect, ...]

    @property
    def refused(self) -> Defect | None:
        """The first defect for which the capture is refused, if any."""
        return next((defect for defect in self.defects if defect.action == "refused"), None)


# Each gives the clip, repaired where that can be, and what it found; in this sequence.
_OF_THE_BODY = (calibration_frames.repair, wrong_units.repair, wrong_up_axis.repair, mirrored_body.repair)
_IN_PASSES = (swapped_limbs.repair, seen_from_behind.repair, jumps.repair)
_ONLY_TOLD = (limb_lengths.detect, turning_camera.detect, wrong_rate.detect)


def check_capture(recorded: Clip) -> CheckedCapture:
    """Every rule, in turn, over a capture as its reader gave it.

    Raises nothing for what a capture may hold: where nothing good can come of it, `refused` says why.
    """
    read = [defect_from_json(record) for record in recorded.provenance["reading"]["defects"]]
    clip, defects = recorded, list[Defect]()
    for repair in _OF_THE_BODY:
        clip, found = repair(clip)
        defects += found
    read = _still_there(read, recorded, clip)
    clip, acquisition = _passes(clip)
    refused = [one for one in defects if one.action == "refused"]
    if refused or acquisition.count == 0:
        # In a wrong unit no limb can be judged, and everybody jumps all the time; nor can the axes or sides
        # of nobody.
        why = refused or [_nobody(clip, acquisition)]
        return CheckedCapture(clip, acquisition, sorted_defects([*read, *why]))
    once, found = duplicate_frames.repair(clip)
    if found:
        read, defects = _still_there(read, clip, once), [*defects, *found]
        clip, acquisition = _passes(once)
        if acquisition.count == 0:
            return CheckedCapture(
                clip, acquisition, sorted_defects([*read, *defects, _nobody(clip, acquisition)])
            )
    defects += clock.detect(clip) + gaps.detect(clip)
    for repair in _IN_PASSES:
        clip, found = repair(clip)
        defects += found
    for tell in _ONLY_TOLD:
        defects += tell(clip)
    if not any(defect.action == "refused" for defect in defects):
        defects += _nameless(clip)
    return CheckedCapture(clip, acquisition, sorted_defects([*read, *defects]))


def _still_there(defects: list[Defect], before: Clip, after: Clip) -> list[Defect]:
    """The defects with frames numbered as in the clip after some were dropped."""
    if len(after.times) == len(before.times):
        return defects
    return renumber_defects(defects, np.isin(before.times, after.times))


def _passes(clip: Clip) -> tuple[Clip, Acquisition]:
    acquisition = find_passes(clip)
    return with_passes(clip, acquisition), acquisition


def planned_steps(examination: CheckedCapture, *, filter_name: str | None = None) -> list[str]:
    """What ingest will do with the capture, in sentences; filter_name: by default as ingest chooses."""
    return list(_sentences(examination, filter_name))


def _sentences(examination: CheckedCapture, filter_name: str | None) -> Iterator[str]:
    if examination.refused is not None:
        yield f"refused: {examination.refused.text}"
        return
    clip, acquisition = examination.clip, examination.acquisition
    lengths = [clip.times[clip.passes == number] for number in range(acquisition.count)]
    seconds = sum(float(times[-1] - times[0]) for times in lengths)
    plural = "es" if acquisition.count != 1 else ""
    yield f"{acquisition.count} pass{plural} of {sum(map(len, lengths))} frames in all, {seconds:.1f} s"
    outside = len(clip.times) - sum(map(len, lengths))
    if outside or acquisition.discarded:
        yield f"{outside} frames outside of passes are left out ({acquisition.discarded} moments too short)"
    for defect in examination.defects:
        if defect.action == "repaired" or defect.rule == "gaps":
            yield f"{RULES[defect.rule]}: {defect.text}"
    what = "positions" if clip.euler is None else "rotations"
    yield f"{what}: {WORDS[filter_name or FILTERS[0]]}"


def _nobody(clip: Clip, acquisition: Acquisition) -> Defect:
    seen = any(event.reason == "subject seen" for event in acquisition.events)
    if seen:
        text = f"{acquisition.discarded} moments shorter than {MIN_PASS_DURATION} s"
        return Defect("gaps", acquisition.discarded, "moments", "refused", text)
    frames = len(clip.times)
    return Defect("zero_frames", frames, "frames", "refused", f"nobody in any of {frames} frames")


def _nameless(clip: Clip) -> list[Defect]:
    """A body on which the 20 nodes cannot be found is of no use to any later stage."""
    try:
        to_nodes(clip)
    except KinemimicError as error:
        return [Defect("wrong_names", len(clip.skeleton.names), "joints", "refused", str(error))]
    return []
