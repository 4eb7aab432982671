"""Tables of joints that nobody described: the draft of `inspect --suggest` is read at once, where it is sure.

It is sure of the joints if their names are known, in the header or in a column, or if the table has no names
and the joints of one sensor alone make a human body. The unit is the one that makes a leg human, up is where
the head is, and the clock is the column of times; the notes tell all that. Rotations in such a table could be
of any convention, and are left out.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import replace

import msgspec
import numpy as np

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.joint_names import REQUIRED, joints_by_name, normalised
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.base.clip_building import reading
from kinemimic.pipeline.readers.base.column_names import words_of
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.clocks.clock import says_time
from kinemimic.pipeline.readers.clocks.video_clock import RATE, Rate, rate_apart
from kinemimic.pipeline.readers.custom_table.custom_table import clip_of
from kinemimic.pipeline.readers.custom_table.description import Description
from kinemimic.pipeline.readers.custom_table.description_file import parse
from kinemimic.pipeline.readers.custom_table.rows import rows_of
from kinemimic.pipeline.readers.custom_table.suggest import draft
from kinemimic.pipeline.readers.custom_table.suggest_body import axes_of
from kinemimic.pipeline.readers.custom_table.suggest_layout import Layout, layout_of
from kinemimic.pipeline.readers.custom_table.suggest_table import Sheet, sheet_of
from kinemimic.pipeline.readers.custom_table.tree import tree_of
from kinemimic.pipeline.readers.joint_tables.body_rows import from_first_body, of_one_person
from kinemimic.pipeline.readers.joint_tables.cells_apart import with_cells_apart
from kinemimic.pipeline.readers.joint_tables.implied_axes import with_axes
from kinemimic.pipeline.readers.joint_tables.names_in_rows import with_names_above
from kinemimic.pipeline.readers.joint_tables.stacked_header import with_one_header

FORMAT = Format(
    name="joint table",
    sensor="unknown",
    holds="positions of joints with known names, or in a known order",
    recognised_by="a header, or a column, with the names of hips, knees, ankles and a trunk; without names, "
    "numbers that make a body in the order of one sensor's joints alone",
)
# Where mistakes in such a table are shown, in the place of a description's name.
_DRAFT = "the draft of `kinemimic inspect --suggest`"
_TRUNK = ("spine", "shoulder_center", "shoulder_left")
_SIDE = re.compile("left|right|[lr]")
# The SDKs' words; a joint with any others counts as tracked where it has a place.
_STATES = frozenset(("", "nottracked", "inferred", "tracked", "none", "low", "medium", "high"))
# How clearly the sequence of unnamed joints must win (suggest_orders.py).
_MARGIN = 0.1


def recognises(source: Source) -> bool:
    """True if the first lines are a table in which the joints are certain."""
    return _layout(_plain_table(source)) is not None


def read(source: Source) -> Clip:
    """The clip of the joints, of the person seen in most rows; without times, at 30 Hz.

    Raises CaptureError for damaged rows, and for coordinates outside any room.
    """
    return clip_of_table(source, FORMAT)


def clip_of_table(source: Source, format: Format, rate: Rate | None = None) -> Clip:
    """`read`, for a table that is recognised, in a file of some format; rate: the one that it states."""
    source = _plain_table(source)
    found = _layout(source)
    assert found is not None  # noqa: S101 (recognises() holds)
    sheet, layout = found
    description = parse(source.path, draft(source, sheet, layout))
    alone, others = of_one_person(source, sheet, description, _DRAFT)
    if alone is not source:  # whose rows have a clock of their own
        source, (sheet, layout) = alone, _layout(alone) or found
        description = parse(source.path, draft(source, sheet, layout))
    unread = list[Defect]()
    if description.clock.counted:
        stated = rate or rate_apart(source)
        unread = [] if stated else _unread_times(sheet, description)
        rate = stated or Rate(RATE)
        clock = msgspec.structs.replace(description.clock, rate=rate.hertz)
        description = replace(description, clock=clock)
    rows = rows_of(source, description, _DRAFT)
    record = reading(
        units=description.space.unit,
        units_rule="thigh and shank as long as a person's",
        defects=[*rows.defects, *others, *unread, *_mirrored(description, len(rows.times))],
        notes=_notes(description, layout, rate),
        columns=sheet.width,
    )
    return clip_of(description, rows, tree_of(description), record, format)


def _plain_table(source: Source) -> Source:
    """The source as a table of one header and a number in each cell, from when somebody is seen."""
    return from_first_body(with_axes(with_one_header(with_cells_apart(with_names_above(source)))))


def _layout(source: Source) -> tuple[Sheet, Layout] | None:
    """The table and its joints, without rotations; None where they are not certain."""
    try:
        sheet = sheet_of(source)
    except CaptureError:
        return None
    layout = layout_of(sheet)
    if layout is None or not _is_certain(layout):
        return None
    if layout.long and layout.numbered and not sheet.even:  # lines of counts: rows of another format
        return None
    words = {word for one in layout.columns for column in one.state for word in sheet.words.get(column, ())}
    state: dict[str, tuple[int, ...]] = {} if _plain(words) <= _STATES else {"state": ()}
    columns = tuple(replace(one, quaternion=(), euler=(), **state) for one in layout.columns)
    return sheet, replace(layout, columns=columns, rotations=None)


def _plain(words: Collection[str]) -> set[str]:
    return {"".join(words_of(word)) for word in words}


def _is_certain(layout: Layout) -> bool:
    nodes = joints_by_name(layout.names)
    legs = [layout.names[nodes[node]] for node in REQUIRED if node in nodes]
    whole = len(legs) == len(REQUIRED) and any(node in nodes for node in _TRUNK)
    # Without its ankle, a leg has its foot in that place, unlike the other one.
    half = len(legs) // 2
    whole &= [_SIDE.sub("", normalised(name)) for name in legs[:half]] == [
        _SIDE.sub("", normalised(name)) for name in legs[half:]
    ]
    return whole and all(one.position for one in layout.columns) and layout.margin >= _MARGIN


def _unread_times(sheet: Sheet, description: Description) -> list[Defect]:
    """A defect if a column calls itself a time, changes, and has no times that the table could be read by."""
    if description.clock.column is not None:
        return []
    for column, name in enumerate(sheet.names):
        values = sheet.values[:, column]
        found = set(sheet.words.get(column, values[np.isfinite(values)].tolist()))
        if says_time(name) and len(found) > 1:
            text = (
                f"the times in the column {name[:40]!r} are not understood: {RATE:g} Hz assumed, unless "
                "--rate says what it has"
            )
            return [Defect("wrong_rate", len(sheet.values), "frames", "flagged", text)]
    return []


def _mirrored(description: Description, frames: int) -> list[Defect]:
    """A defect for axes that are taken as left-handed (see quality/rules/mirrored_body.py)."""
    if description.space.left is None:
        return []
    text = (
        "toes point backward in right-handed axes: taken as left-handed, names kept; if left and right are "
        "exchanged instead, each leg's curves are the other's"
    )
    return [Defect("mirrored", frames, "frames", "repaired", text)]


def _notes(description: Description, layout: Layout, rate: Rate | None) -> list[str]:
    """What is not in the file, and how it is known."""
    clock, space = description.clock, description.space
    if rate is not None and clock.counted:
        which = (
            "no time in the file:" if clock.column is None else f"times are frame numbers ({clock.column}) at"
        )
        how = f" ({rate.name})" if rate.name else ", unless --rate says what it has"
        time = f"{which} {rate.hertz:g} Hz{how}"
    else:
        time = f"times in {clock.unit} (column {clock.column})"
    up = axes_of(layout.points, layout.names).notes["up"]
    return [f"joints: {layout.reason}", f"{space.up} points up, {up}", time]
