"""A recorded capture looked over: what is wrong with it by rule, what is repaired, where its passes are.

Rules about the whole body (axes, units, sides) come before the division into passes, which measures speeds
in metres; rules about single frames and joints come after it, because nothing may reach across a pass's end.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from kinemimic.pipeline.acquire import SHORTEST_PASS, Acquisition, acquire, in_passes
from kinemimic.pipeline.clip import Clip
from kinemimic.pipeline.defect import Defect, defect_from_json, in_order
from kinemimic.pipeline.rules import clock, duplicates


@dataclass(frozen=True)
class Examination:
    """clip: repaired, as recorded otherwise, its passes numbered; defects: the reader's and the rules'."""

    clip: Clip
    acquisition: Acquisition
    defects: tuple[Defect, ...]

    @property
    def refused(self) -> Defect | None:
        """The first defect for which the capture is refused, if any."""
        return next((defect for defect in self.defects if defect.action == "refused"), None)


def examine(recorded: Clip) -> Examination:
    """Every rule, in turn, over a capture as its reader gave it; never raises for what a capture may hold."""
    clip = recorded
    defects = [defect_from_json(record) for record in clip.provenance["reading"]["defects"]]
    acquisition = acquire(clip)
    clip = in_passes(clip, acquisition)
    if acquisition.count == 0:
        defects.append(_nobody(clip, acquisition))
        return Examination(clip, acquisition, in_order(defects))
    whole = clip
    clip, found = duplicates.check(clip)
    defects += found
    if clip is not whole:
        acquisition = acquire(clip)
        clip = in_passes(clip, acquisition)
    defects += clock.check(clip)
    return Examination(clip, acquisition, in_order(defects))


def plan(examination: Examination, *, butterworth: bool | None = None) -> list[str]:
    """What ingest will do with the capture, in sentences; butterworth: by default as ingest chooses."""
    return list(_sentences(examination, butterworth))


def _sentences(examination: Examination, butterworth: bool | None) -> Iterator[str]:
    refused = examination.refused
    if refused:
        yield f"refused: {refused.text}"
        return
    clip, acquisition = examination.clip, examination.acquisition
    inside = int((clip.passes >= 0).sum())
    plural = "es" if acquisition.count != 1 else ""
    yield f"{acquisition.count} pass{plural} of {inside} frames; {len(clip.times) - inside} frames outside"
    if acquisition.discarded:
        yield f"{acquisition.discarded} moments under {SHORTEST_PASS} s left out"
    for defect in examination.defects:
        if defect.action == "repaired":
            yield f"repaired: {defect.text}"
    filtered = clip.euler is None if butterworth is None else butterworth
    if filtered:
        yield "gaps filled, spikes taken out, low-passed (zero-phase Butterworth)"
    else:
        yield "left unfiltered"


def _nobody(clip: Clip, acquisition: Acquisition) -> Defect:
    seen = any(event.reason == "subject seen" for event in acquisition.events)
    if seen:
        text = f"{acquisition.discarded} moments shorter than {SHORTEST_PASS} s"
        return Defect("gaps", acquisition.discarded, "moments", "refused", text)
    frames = len(clip.times)
    return Defect("zero_frames", frames, "frames", "refused", f"nobody in any of {frames} frames")
