"""Draft a description for a table of unknown format, for the user to check.

`kinemimic inspect --suggest FILE` prints it. Guesses are marked "please check".
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from kinemimic.pipeline.files.sidecars import stem_of
from kinemimic.pipeline.files.toml_text import column as column_of
from kinemimic.pipeline.files.toml_text import folded, key, one_or_list, quoted
from kinemimic.pipeline.kinematics.joint_names import joints_by_name
from kinemimic.pipeline.kinematics.skeleton import NODE_PARENTS, NODES
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.clocks.dates import seconds_of_dates
from kinemimic.pipeline.readers.custom_table.description import DATE
from kinemimic.pipeline.readers.custom_table.suggest_body import axes_of, quaternion_order, time_unit
from kinemimic.pipeline.readers.custom_table.suggest_layout import Layout, layout_of
from kinemimic.pipeline.readers.custom_table.suggest_names import TIME
from kinemimic.pipeline.readers.custom_table.suggest_table import Sheet, sheet_of
from kinemimic.pipeline.readers.kinect.azure_joints import azure_skeleton
from kinemimic.pipeline.readers.kinect.kinect_v2 import SDK_JOINTS, SDK_PARENTS

_PARTS = ("position", "quaternion", "euler", "state")


def suggest(source: Source) -> str:
    """The draft as TOML text; CaptureError if the file is not a table, or no body is found in it."""
    if not source.is_text:
        raise source.error(expected="a text table", found="a binary file")
    sheet = sheet_of(source)
    layout = layout_of(sheet)
    if layout is None:
        raise source.error(
            expected="columns of joints, recognisable by their names or as a body",
            found=f"a table of {sheet.width} columns with neither",
            advice="docs/describe-your-columns.md shows how to write the description by hand",
        )
    return draft(source, sheet, layout)


def draft(source: Source, sheet: Sheet, layout: Layout) -> str:
    """The draft for a table and its joints, as TOML text."""
    return "\n".join(_draft(source, sheet, layout)) + "\n"


def _draft(source: Source, sheet: Sheet, layout: Layout) -> Iterator[str]:
    saved_as = f"{stem_of(source.path)}.toml"
    yield f"# Draft for {source.path.name}: save it as {saved_as} in the same folder."
    yield '# Check every line marked "please check"; docs/describe-your-columns.md explains all keys.'
    yield "kinemimic = 1"
    yield ""
    yield f"# {len(layout.names)} joints: {layout.reason}."
    names = _node_names(layout.names)
    names_only = layout.rotations is None and layout.numbered
    if names_only:
        yield from folded("joints", [quoted(name) for name in names])
    yield from _table(sheet, layout)
    yield from _time(sheet, layout)
    yield from _space(layout)
    yield from _columns(sheet, layout)
    yield from _rotations(layout)
    yield from _states(sheet, layout)
    if not names_only:
        yield from _joints(sheet, layout, names)


def _node_names(names: Sequence[str]) -> tuple[str, ...]:
    """The node's name for each joint that is one of the 20, the joint's own name for the others.

    A "head" beside a "head_end", which is the node, becomes head_joint.
    """
    found = joints_by_name(tuple(names))
    nodes = {joint: node for node, joint in found.items()}
    return tuple(nodes.get(k, f"{name}_joint" if name in found else name) for k, name in enumerate(names))


def _table(sheet: Sheet, layout: Layout) -> Iterator[str]:
    yield ""
    yield "[table]"
    yield f'separator = "{sheet.separator}"'
    if sheet.decimal != ".":
        yield f'decimal = "{sheet.decimal}"'
    if sheet.header:
        yield f"header = {sheet.header}"
    if sheet.first != sheet.header + 1:
        yield f"first_row = {sheet.first}"
    if layout.long:
        yield 'rows = "joint"'
    if sheet.comment:
        yield f'comment = "{sheet.comment}"'
    if sheet.marks:
        yield f"missing = [{', '.join(sheet.marks)}]  # please check"


def _time(sheet: Sheet, layout: Layout) -> Iterator[str]:
    yield ""
    yield "[time]"
    used = {column for one in layout.columns for part in _PARTS for column in getattr(one, part)}
    free = [k for k in range(sheet.width) if k not in used]
    free.sort(key=lambda k: not (sheet.names and TIME.fullmatch(sheet.names[k])))
    candidates = [(k, times) for k in free if (times := _time_unit_of(sheet, layout, k)) is not None]
    # A clock is preferred to frame numbers.
    candidates.sort(key=lambda item: item[1][0] == "frame")
    if not candidates:
        yield "rate = 30.0  # frames per second; please check: no column holds a time"
        return
    column, (unit, step) = candidates[0]
    yield f"column = {column_of(sheet.names, column)}"
    if unit == "frame":
        yield 'unit = "frame"'
        yield "rate = 30.0  # please check"
    else:
        yield f'unit = "{unit}"  # steps of {1000.0 * step:.1f} ms'


def _time_unit_of(sheet: Sheet, layout: Layout, column: int) -> tuple[str, float] | None:
    dates = sheet.words.get(column)
    times = sheet.values[:, column] if dates is None else np.array([*seconds_of_dates(dates)])
    if layout.long:
        times = times[np.concatenate([[True], np.diff(times) != 0])]
        if len(times) < len(layout.points) // 2 or len(times) > 2 * len(layout.points):
            return None
    found = time_unit(times, sheet.names[column].lower() if sheet.names else "")
    if found is None or dates is None:
        return found
    return (DATE, found[1]) if found[0] == "s" else None


def _space(layout: Layout) -> Iterator[str]:
    axes = axes_of(layout.points, layout.names)
    yield ""
    yield "[space]"
    for part in ("unit", "up", "forward", "left"):
        if value := getattr(axes, part):
            note = axes.notes.get(part)
            yield f'{part} = "{value}"' + (f"  # {note}" if note else "")


def _columns(sheet: Sheet, layout: Layout) -> Iterator[str]:
    common, step = _common(sheet, layout)
    lines = [f"{part} = {value}" for part, value in common.items()]
    if layout.joint_column is not None:
        lines.insert(0, f"joint = {column_of(sheet.names, layout.joint_column)}")
    if step:
        lines.append(f"step = {step}")
    if lines:
        yield ""
        yield "[columns]"
        yield from lines


def _common(sheet: Sheet, layout: Layout) -> tuple[dict[str, str], int]:
    """The TOML values shared by all joints, and the step between their column numbers."""
    common: dict[str, str] = {}
    step = 0
    for part in _PARTS:
        columns_of_joints = [getattr(one, part) for one in layout.columns]
        if not all(columns_of_joints):
            continue
        if layout.long:
            common[part] = _as_toml(part, [column_of(sheet.names, k) for k in columns_of_joints[0]])
            continue
        steps = {b - a for one, two in pairwise(columns_of_joints) for a, b in zip(one, two, strict=True)}
        if layout.numbered and len(steps) == 1 and step in (0, *steps) and min(steps) > 0:
            (step,) = steps
            common[part] = _as_toml(part, [str(k + 1) for k in columns_of_joints[0]])
        elif not layout.numbered:
            patterns = {
                tuple(_pattern(sheet.names[column], name) for column in of)
                for of, name in zip(columns_of_joints, layout.names, strict=True)
            }
            if len(patterns) == 1:
                common[part] = _as_toml(part, [quoted(pattern) for pattern in patterns.pop()])
    return common, step


def _pattern(column: str, joint: str) -> str:
    return column.replace(joint, "{joint}") if column.count(joint) == 1 else column


def _rotations(layout: Layout) -> Iterator[str]:
    if layout.rotations is None:
        return
    yield ""
    yield "[rotations]"
    if layout.rotations.shape[-1] == 3:
        largest = float(np.nanmax(np.abs(layout.rotations))) if np.isfinite(layout.rotations).any() else 0.0
        yield 'order = "XYZ"  # please check: the intrinsic order, also that of columns.euler'
        unit = "deg" if largest > 2 * np.pi else "rad"
        yield f'unit = "{unit}"  # please check: angles up to {largest:.3g}'
        yield 'relative_to = "parent"  # please check'
        return
    order, world, reason = quaternion_order(layout.rotations, layout.points, _parents(layout.names))
    # Columns with letters in the header are listed in the sequence of the letters.
    yield 'order = "xyzw"' if layout.lettered else f'order = "{order}"  # {reason}'
    yield f'relative_to = "{"parent" if world is False else "world"}"' + ("" if world else "  # please check")


def _parents(names: Sequence[str]) -> list[int]:
    """Index of each joint's parent: a Kinect's own, else that of the 20 nodes; -1 if unknown."""
    known = dict(zip(SDK_JOINTS, SDK_PARENTS, strict=True))
    azure = azure_skeleton()
    known |= {n: azure.names[p] if p >= 0 else "" for n, p in zip(azure.names, azure.parents, strict=True)}
    nodes = joints_by_name(tuple(names))
    of_joint = {joint: NODES.index(node) for node, joint in nodes.items()}
    parents = []
    for k, name in enumerate(names):
        parent = -1
        if name in known:
            parent = names.index(known[name]) if known[name] in names else -1
        elif k in of_joint and (above := NODE_PARENTS[of_joint[k]]) >= 0:
            parent = nodes.get(NODES[above], -1)
        parents.append(parent)
    return parents


def _states(sheet: Sheet, layout: Layout) -> Iterator[str]:
    columns = sorted({column for one in layout.columns for column in one.state})
    if not columns:
        return
    words = sorted(
        {word for column in columns if column in sheet.words for word in sheet.words[column] if word}
    )
    if words:
        missing = [
            w for w in words if any(part in w.lower() for part in ("not", "miss", "lost", "none", "un"))
        ]
        inferred = [
            w for w in words if w not in missing and any(p in w.lower() for p in ("infer", "occl", "low"))
        ]
        tracked = [w for w in words if w not in missing and w not in inferred]
        lists = (("missing", missing), ("inferred", inferred), ("tracked", tracked))
        yield from ("", "[states]  # please check")
        yield from (f"{state} = [{', '.join(quoted(word) for word in listed)}]" for state, listed in lists)
        return
    values = sheet.values[:, columns]
    seen = values[np.isfinite(values)]
    if not np.isin(seen, (0.0, 1.0, 2.0)).all():
        yield from ("", "[states]  # please check: a confidence")
        yield from ("inferred_from = 0.01", f"tracked_from = {0.5 * float(seen.max()):g}")
    elif not (seen == 2.0).any():
        yield from ("", "[states]  # please check: there is no 2, so 1 is taken as tracked")
        yield from ("missing = [0]", "tracked = [1]")


def _as_toml(part: str, items: Sequence[str]) -> str:
    return one_or_list(items, single=part == "state")


def _joints(sheet: Sheet, layout: Layout, names: Sequence[str]) -> Iterator[str]:
    common, _ = _common(sheet, layout)
    parents = _parents(layout.names)
    turned = layout.rotations is not None
    yield ""
    yield "[joints]"
    columns_of_each = layout.columns * (len(names) if layout.long else 1)
    for k, (name, name_in_file, one) in enumerate(zip(names, layout.names, columns_of_each, strict=True)):
        entries = [] if layout.numbered or name == name_in_file else [f"name = {quoted(name_in_file)}"]
        entries += [
            f"{part} = {_as_toml(part, [column_of(sheet.names, k) for k in getattr(one, part)])}"
            for part in _PARTS
            if part not in common and getattr(one, part)
        ]
        note = ""
        if name not in NODES and (parents[k] >= 0 or turned):
            entries.append(f"parent = {quoted(names[parents[k]] if parents[k] >= 0 else 'hip_center')}")
        if name not in NODES and parents[k] < 0:
            note = "  # please check: not one of the 20 nodes"
        only_name = entries and len(entries) == 1 and entries[0].startswith("name")
        value = (
            entries[0].removeprefix("name = ")
            if only_name
            else "{ " + ", ".join(entries) + " }"
            if entries
            else "{}"
        )
        yield f"{key(name)} = {value}{note}"
