"""Vicon Nexus exports: trajectories of markers, and outputs of Plug-in-Gait (nexus_sections.py).

Outputs win over trajectories: their segments hold Vicon's own joint centres. A segment's nine numbers are its
orientation (degrees about an axis), the position of its origin, the joint at its far end, and its length. Z
is along the segment, from that joint to the one above. Plug-in-Gait's angles of knee and hip are kept beside
ours.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import IDENTITY, from_rotvec, rotate
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.quality.rules.length_units import SET_BY_USER, UNITS
from kinemimic.pipeline.readers.base.absolute_orientations import child_to_parent
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import increasing_times, refuse_remote
from kinemimic.pipeline.readers.base.node_parents import skeleton_of
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.laboratory.nexus_sections import (
    FIELD,
    MODEL_OUTPUTS,
    TRAJECTORIES,
    Item,
    Section,
    is_components,
    is_events,
    read_section,
    separator_of,
    title_of,
    titles,
)
from kinemimic.pipeline.readers.optical.declared_unit import in_metres, unit_named
from kinemimic.pipeline.readers.optical.marker_names import landmarks
from kinemimic.pipeline.readers.optical.marker_set import marker_set
from kinemimic.pipeline.readers.optical.markers import clip_of_markers
from kinemimic.pipeline.readers.optical.people import other_people, seen_most, without_others

FORMAT = Format(
    name="Vicon Nexus CSV",
    sensor="optical",
    holds="positions of markers; segments and angles of Plug-in-Gait",
    recognised_by='a line "Trajectories" or "Model Outputs" above one of "Frame" or "Field #"',
    width_in_header=True,
    right_handed=True,
)
# Lines above the first title in files of older programs.
_MOST_FACTS = 16
_MARKER = ("X", "Y", "Z")
_SEGMENT = ("RX", "RY", "RZ", "TX", "TY", "TZ", "SX", "SY", "SZ")
# Node -> the segment at whose origin it is, "+" for the other end, and the segment that it is fixed to.
_NODES: dict[str, tuple[str, str]] = {
    "hip_center": ("PEL", "PEL"),
    "shoulder_center": ("TRX", "TRX"),
    "head": ("HED", "HED"),
    **{
        f"{node}_{side}": (f"{s}{origin}", f"{s}{fixed}" if fixed != "PEL" else fixed)
        for side, s in (("left", "L"), ("right", "R"))
        for node, origin, fixed in (
            ("shoulder", "CL", "CL"), ("elbow", "HU", "HU"), ("wrist", "RA", "RA"), ("hand", "HN", "HN"),
            ("hip", "FE+", "PEL"), ("knee", "FE", "FE"), ("ankle", "TI", "TI"), ("foot", "FO", "FO"),
        )
    },
}  # fmt: skip
# Of an orientation; larger numbers are damage.
_MAX_DEGREES = 1e4
_LEGS = tuple(f"{s}{segment}" for s in "LR" for segment in ("FE", "TI"))
_ANGLES = {
    f"{joint.lower()}_{side}": f"{s}{joint}Angles"
    for joint in ("Knee", "Hip")
    for side, s in (("left", "L"), ("right", "R"))
}


def recognises(source: Source) -> bool:
    """True if a line is the title of a section, with a line of components below: the first line, or in files
    of older programs one below a few facts (Title, Date …)."""
    separator = separator_of(source)
    head = source.head[:_MOST_FACTS]
    title = next((k for k, line in enumerate(head) if title_of(line, separator)), None)
    if title is None:
        return False
    if title == 0 and any(is_events(line) for line in head[1:4]):
        return True
    components = next((line for line in source.head[title + 1 : title + 8] if is_components(line)), "")
    return bool(components) and (title == 0 or components.lstrip(' "').startswith(FIELD[0]))


def read(source: Source) -> Clip:
    """The clip of the joint centres: those of the outputs' segments, else those that the markers give.

    Raises CaptureError for a damaged section, a file without either, and markers from which legs cannot be
    computed.
    """
    there = titles(source.lines, separator_of(source))
    if not any(title in (TRAJECTORIES, MODEL_OUTPUTS) for _, title in there):
        raise source.error(
            expected=f"a section {TRAJECTORIES} or {MODEL_OUTPUTS}",
            found=", ".join(title for _, title in there)[:80],
        )
    sections = {
        title: read_section(source, start, title)
        for start, title in there
        if title in (TRAJECTORIES, MODEL_OUTPUTS)
    }
    outputs = sections.get(MODEL_OUTPUTS)
    if outputs is not None:
        walkers = _with_legs(outputs)
        if walkers:
            return _of_segments(outputs, walkers, source)
        if TRAJECTORIES not in sections:
            raise source.error(
                expected=f"outputs of the segments {', '.join(_LEGS)}, or a section {TRAJECTORIES}",
                found=", ".join(item.name for item in outputs.items)[:200],
            )
    return _of_markers(sections[TRAJECTORIES], outputs, source)


@dataclass(frozen=True)
class _Clock:
    times: Array
    later: Mask
    defects: list[Defect]


def _clock(section: Section) -> _Clock:
    """Seconds from the first frame, by the frames' numbers."""
    later, defects = increasing_times(section.frames)
    return _Clock((section.frames[later] - section.frames[0]) / section.rate, later, defects)


def _main_subject(items: Sequence[Item]) -> str:
    """The subject with most items; of several, the one with most known markers.

    A box or a second person may have more markers: the person is whose markers have known names.
    """
    count = Counter(item.subject for item in items)
    known = Counter(item.subject for item in items if landmarks((item.name,)))
    main = count.most_common(1)[0][0]
    return known.most_common(1)[0][0] if known and known[main] < max(known.values()) else main


def _with_legs(section: Section) -> dict[str, dict[str, Item]]:
    """Each subject with the segments of both legs -> name -> item."""
    named: dict[str, dict[str, Item]] = {}
    for item in section.items:
        named.setdefault(item.subject, {})[item.name] = item
    return {
        subject: items
        for subject, items in named.items()
        if all(leg in items and items[leg].components == _SEGMENT for leg in _LEGS)
    }


def _leg_values(section: Section, items: dict[str, Item]) -> Array:
    return np.hstack([section.values[:, items[leg].columns] for leg in _LEGS])


def _of_segments(section: Section, walkers: dict[str, dict[str, Item]], source: Source) -> Clip:
    clock = _clock(section)
    seen: dict[str, Mask] = {
        subject: np.asarray(np.isfinite(_leg_values(section, items)[clock.later]).all(axis=1))
        for subject, items in walkers.items()
    }
    subject = seen_most(seen)
    named = walkers[subject]
    lines = np.flatnonzero(clock.later)
    segments = [name for name, item in named.items() if item.components == _SEGMENT]
    values = np.stack([section.values[clock.later, named[name].columns] for name in segments], axis=1)
    unit = source.unit or _unit([named[leg].units[3] for leg in _LEGS], source)
    values[..., 3:] *= UNITS[unit]
    # Before anything is computed from them: a damaged file may hold any number.
    for first in (3, 6):
        refuse_remote(
            values[..., first : first + 3],
            segments,
            source,
            lambda row: section.table.where(int(lines[row])),
            unit=unit,
        )
    values[~np.isfinite(values) | (np.abs(values) > _MAX_DEGREES)] = np.nan
    turns = {name: from_rotvec(np.radians(values[:, k, :3])) for k, name in enumerate(segments)}

    def segment(name: str, first: int) -> Array:
        return np.asarray(values[:, segments.index(name), first : first + 3])

    nodes = tuple(node for node in NODES if node in _NODES and _NODES[node][0].rstrip("+") in turns)
    points, frames = [], []
    for node in nodes:
        origin, fixed = _NODES[node]
        place = segment(origin.rstrip("+"), 3)
        if origin.endswith("+"):
            along = np.zeros_like(place)
            along[:, 2] = segment(origin.rstrip("+"), 6)[:, 2]
            place = place + rotate(turns[origin.rstrip("+")], along)
        points.append(place)
        frames.append(turns.get(fixed, np.full((len(place), 4), np.nan)))
    places = np.stack(points, axis=1)
    skeleton = skeleton_of(nodes)
    return clip_of_points(
        skeleton,
        clock.times,
        places,
        None,
        format=FORMAT,
        reading=reading(
            units=unit,
            units_rule=SET_BY_USER if source.unit else "the file's",
            defects=[*clock.defects, *other_people(seen, subject)],
            notes=["joint centres of Plug-in-Gait's segments", "no axes in the file: read as Z up"],
            section=section.title,
            columns=section.values.shape[1],
        ),
        world_from_file=IDENTITY,
        rotations=child_to_parent(np.stack(frames, axis=1), skeleton, IDENTITY),
        angles=_angles(section, clock.later, subject),
    )


def _of_markers(section: Section, outputs: Section | None, source: Source) -> Clip:
    clock = _clock(section)
    values = section.values[clock.later]
    items, people = _of_main_person(section, values)
    subject = _main_subject(items)
    main = [item for item in items if item.subject == subject]
    others = len({item.subject for item in items}) - 1
    wrong = next((item for item in main if item.components != _MARKER), None)
    if wrong is not None:
        raise source.error(
            expected=f"X, Y and Z of the marker {wrong.name[:40]}", found=", ".join(wrong.components)[:60]
        )
    labels = tuple(item.name for item in main)
    labels = marker_set(source).renamed(labels, source)
    unit = source.unit or _unit([item.units[0] for item in main], source)
    points = np.stack([values[:, item.columns] for item in main], axis=1) * UNITS[unit]
    defects = [*clock.defects, *people]
    if source.unit is None:
        points, unit_defects = in_metres(labels, points)
        defects += unit_defects
        lines = np.flatnonzero(clock.later)
        refuse_remote(
            points,
            labels,
            source,
            lambda row: section.table.where(int(lines[row])),
            unit="m" if unit_defects else unit,
        )
    notes = ["no axes in the file: read as Z up"]
    if others:
        notes.append(f"{others} other subjects or objects are not read")
    # The outputs' angles are the markers' only if both sections have the same frames.
    same = outputs is not None and np.array_equal(outputs.frames, section.frames)
    return clip_of_markers(
        labels,
        clock.times,
        points,
        format=FORMAT,
        reading=reading(
            units=unit,
            units_rule=SET_BY_USER if source.unit else "the file's",
            defects=defects,
            notes=notes,
            section=section.title,
            columns=section.values.shape[1],
            markers=[label for label in labels if label],
        ),
        world_from_file=IDENTITY,
        source=source,
        angles=_angles(outputs, clock.later, subject) if same and outputs is not None else None,
    )


def _of_main_person(section: Section, values: Array) -> tuple[list[Item], list[Defect]]:
    """The items without those of other people (optical/people.py), and the defect; values: (T, columns)."""
    markers = [item for item in section.items if item.components == _MARKER]
    if not markers:
        return list(section.items), []
    labels = tuple(f"{item.subject}:{item.name}" if item.subject else item.name for item in markers)
    places = np.stack([values[:, item.columns] for item in markers], axis=1)
    kept, new, defects = without_others(labels, places)
    mine = [replace(markers[k], name=name.rpartition(":")[2]) for k, name in zip(kept, new, strict=True)]
    return [*mine, *(item for item in section.items if item.components != _MARKER)], defects


def _unit(stated: list[str], source: Source) -> str:
    """The unit (a key of UNITS) that the line of units states."""
    unit = Counter(stated).most_common(1)[0][0]
    if (named := unit_named(unit)) is None:
        raise source.error(
            expected=f"a unit of length among {', '.join(UNITS)}",
            found=repr(unit[:20]),
            advice="set it with --unit",
        )
    return named


def _angles(section: Section, later: Mask, subject: str) -> dict[str, Array] | None:
    """Plug-in-Gait's flexion of a subject's knees and hips (T,) in radians, NaN where empty."""
    named = {item.name: item for item in section.items if item.subject == subject}
    found = {
        angle: np.radians(section.values[later, named[name].columns.start])
        for angle, name in _ANGLES.items()
        if name in named and named[name].units[:1] == ("deg",)
    }
    return {name: np.where(np.isfinite(curve), curve, np.nan) for name, curve in found.items()} or None
