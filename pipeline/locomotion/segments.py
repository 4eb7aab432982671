"""Segments of a capture: walks, runs, turns, standing, other motion, recorded labels."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.pipeline.locomotion.bouts import Bout
from kinemimic.pipeline.locomotion.even_clock import RATE, even_pass
from kinemimic.pipeline.locomotion.path.heading import body_heading

MIN_DURATION = 0.5  # s
TURN = np.radians(90.0)  # between the headings before and after
STILL = 0.15  # m/s, median speed of hips, knees, ankles and wrists of a person who stands
STEP = 0.25  # m by which a foot of a person who stands may come and go
_MOVING = tuple(N[f"{joint}_{side}"] for joint in ("hip", "knee", "ankle", "wrist") for side in SIDES)
_TIMES = re.compile(r"\s*(\d+(?:\.\d*)?)\s*-\s*(\d+(?:\.\d*)?)\s*")


@dataclass(frozen=True)
class Segment:
    """A named part of a capture.

    name: such as walk-1, or the label that came with the recording; kind: walk, run, turn, stand, motion or
    label; pass_number: of the clip; start, end: seconds; bout: of a walk or run, else None.
    """

    name: str
    kind: str
    pass_number: int
    start: float
    end: float
    bout: Bout | None = None


def find_segments(clip: Clip, positions: Array, bouts: list[Bout]) -> list[Segment]:
    """The segments of a clip in order of time; positions: (T, 20, 3) of its frames; bouts: `find_bouts`'."""
    counts: Counter[str] = Counter()
    named = []
    for one in [*_by_movement(clip, positions, bouts), *_labelled(clip)]:
        name = one.name
        if one.kind != "label":
            counts[one.kind] += 1
            name = f"{one.kind}-{counts[one.kind]}"
        named.append(replace(one, name=name))
    return named


def _labelled(clip: Clip) -> list[Segment]:
    """The labels that came with the recording."""
    out = []
    for label in clip.labels:
        inside = (clip.times >= label.start) & (clip.times <= label.end) & (clip.passes >= 0)
        if inside.any():
            number = int(np.bincount(clip.passes[inside]).argmax())
            out.append(Segment(label.name, "label", number, label.start, label.end))
    return out


def _by_movement(clip: Clip, positions: Array, bouts: list[Bout]) -> Iterator[Segment]:
    for number in np.unique(clip.passes[clip.passes >= 0]).tolist():
        frames = np.flatnonzero(clip.passes == number)
        times = clip.times[frames]
        at = float(times[0])
        before: Bout | None = None
        for bout in [one for one in bouts if one.pass_number == number]:
            yield from _between(clip, positions, number, at, bout.times[0], (before, bout))
            start, at = bout.times
            yield Segment("", "run" if bout.running else "walk", number, start, at, bout)
            before = bout
        yield from _between(clip, positions, number, at, float(times[-1]), (before, None))


def _between(
    clip: Clip,
    positions: Array,
    number: int,
    start: float,
    end: float,
    beside: tuple[Bout | None, Bout | None],
) -> Iterator[Segment]:
    """The segment between two bouts, or before the first or after the last."""
    if end - start < MIN_DURATION:
        return
    inside = (clip.passes == number) & (clip.times >= start) & (clip.times <= end)
    even = even_pass(clip.times[inside], positions[inside])
    before, after = beside
    kind = "motion"
    if even is not None:
        speed = RATE * np.linalg.norm(np.diff(even.positions[:, _MOVING], axis=0), axis=-1)
        known = speed[np.isfinite(speed)]
        if len(known) and float(np.median(known)) < STILL and _feet_stay(even.positions):
            kind = "stand"
        elif before is not None and after is not None:
            heading, _ = body_heading(even.positions, RATE)
            change = np.angle(np.exp(1j * (np.median(after.heading) - np.median(before.heading))))
            kind = "turn" if max(abs(float(change)), float(np.ptp(heading))) > TURN else kind
    yield Segment("", kind, number, start, end)


def _feet_stay(positions: Array) -> bool:
    """Whether both feet of a body (T, 20, 3) stay, other than in a dance or a high step on one leg."""
    ankles = positions[:, [N[f"ankle_{side}"] for side in SIDES]]
    seen = ankles[np.isfinite(ankles).all(axis=(1, 2))]
    extent = np.ptp(np.percentile(seen, [5.0, 95.0], axis=0), axis=0) if len(seen) else np.zeros((2, 3))
    return bool(np.linalg.norm(extent, axis=-1).max() < STEP)


def only_segment(clip: Clip, segments: list[Segment], wanted: str) -> Clip:
    """The clip with all frames outside a segment taken out of their passes.

    segments: of the clip; wanted: the name of one of them, or "START-END" in seconds. KinemimicError if there
    is no such segment, or a shorter one than `ingest` keeps, and for times in the wrong order.
    """
    times = _TIMES.fullmatch(wanted)
    if times is not None:
        start, end = (float(text) for text in times.groups())
        if start >= end:
            raise KinemimicError(f"--segment: expected START before END, found {wanted!r}")
        inside = (clip.times >= start) & (clip.times <= end)
    else:
        chosen = [one for one in segments if one.name == wanted]
        if not chosen:
            names = ", ".join(f"{one.name} ({one.start:.1f}-{one.end:.1f} s)" for one in segments)
            raise KinemimicError(
                f"--segment: expected one of {names or 'no segments'}, or times such as 3.5-12, "
                f"found {wanted!r}"
            )
        start, end = chosen[0].start, chosen[0].end
        inside = (clip.passes == chosen[0].pass_number) & (clip.times >= start) & (clip.times <= end)
    passes = np.where(inside, clip.passes, -1).astype(np.int32)
    if (passes >= 0).sum() < 2:
        raise KinemimicError(
            f"--segment: expected frames between {start:g} and {end:g} s, found none; the capture has "
            f"{clip.times[0]:.1f} to {clip.times[-1]:.1f} s"
        )
    longest = max(
        float(np.ptp(clip.times[passes == number])) for number in np.unique(passes[passes >= 0]).tolist()
    )
    if longest < MIN_DURATION - 1e-6:
        raise KinemimicError(
            f"--segment: expected at least {MIN_DURATION:g} s of a pass, found {longest:.2f} s between "
            f"{start:g} and {end:g} s; choose a longer segment"
        )
    return replace(clip, passes=passes)
