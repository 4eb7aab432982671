"""A first draft of a description for a table of no known format, for a person to check.

`kinemimic inspect --suggest FILE` prints it. What cannot be known stands there with "please check".
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from kinemimic.pipeline.files.toml_text import column as column_of
from kinemimic.pipeline.files.toml_text import folded, key, one_or_list, quoted
from kinemimic.pipeline.kinematics.nodes import joints_of_nodes
from kinemimic.pipeline.kinematics.skeleton import NODE_PARENTS, NODES
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.custom_table.suggest_body import axes_of, quaternion_order, time_unit
from kinemimic.pipeline.readers.custom_table.suggest_layout import Layout, layout_of
from kinemimic.pipeline.readers.custom_table.suggest_names import TIME
from kinemimic.pipeline.readers.custom_table.suggest_table import Sheet, sheet_of
from kinemimic.pipeline.readers.kinect.azure_joints import azure_skeleton
from kinemimic.pipeline.readers.kinect.kinect_v2 import SDK_JOINTS, SDK_PARENTS

_PARTS = ("position", "quaternion", "euler", "state")


def suggest(source: Source) -> str:
    """The draft as TOML text; CaptureError if the file is no table, or no body is found in it."""
    if not source.is_text:
        raise source.error(expected="a table of text", found="a binary file")
    sheet = sheet_of(source)
    layout = layout_of(sheet)
    if layout is None:
        raise source.error(
            expected="columns of joints, by their names or by making a body",
            found=f"a table of {sheet.width} columns of which neither is true",
            advice="docs/describe-your-columns.md shows how to write the description by hand",
        )
    return "\n".join(_draft(source, sheet, layout)) + "\n"


def _draft(source: Source, sheet: Sheet, layout: Layout) -> Iterator[str]:
    yield f"# Drafted from {source.path.name}: save it beside it as {source.path.with_suffix('.toml').name}."
    yield '# Look at every line that says "please check"; docs/describe-your-columns.md explains all keys.'
    yield "kinemimic = 1"
    yield ""
    yield f"# {len(layout.names)} joints: {layout.why}."
    names = _node_names(layout.names)
    plain = layout.turns is None and layout.numbered
    if plain:
        yield from folded("joints", [quoted(name) for name in names])
    yield from _table(sheet, layout)
    yield from _time(sheet, layout)
    yield from _space(layout)
    yield from _columns(sheet, layout)
    yield from _rotations(layout)
    yield from _states(sheet, layout)
    if not plain:
        yield from _joints(sheet, layout, names)


def _node_names(names: Sequence[str]) -> tuple[str, ...]:
    """Our node for each joint that is one, its own name for the others."""
    nodes = {joint: node for node, joint in joints_of_nodes(tuple(names)).items()}
    return tuple(nodes.get(k, name) for k, name in enumerate(names))


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
    taken = {column for one in layout.columns for part in _PARTS for column in getattr(one, part)}
    free = [k for k in range(sheet.width) if k not in taken and k not in sheet.words]
    free.sort(key=lambda k: not (sheet.names and TIME.fullmatch(sheet.names[k])))
    found = [(k, times) for k in free if (times := _unit_of(sheet, layout, k)) is not None]
    # A clock is better than a count of frames.
    found.sort(key=lambda item: item[1][0] == "frame")
    if not found:
        yield "rate = 30.0  # frames per second; please check: no column holds a time"
        return
    column, (unit, step) = found[0]
    yield f"column = {column_of(sheet.names, column)}"
    if unit == "frame":
        yield 'unit = "frame"'
        yield "rate = 30.0  # please check"
    else:
        yield f'unit = "{unit}"  # steps of {1000.0 * step:.1f} ms'


def _unit_of(sheet: Sheet, layout: Layout, column: int) -> tuple[str, float] | None:
    times = sheet.values[:, column]
    if layout.long:
        times = times[np.concatenate([[True], np.diff(times) != 0])]
        if len(times) < len(layout.points) // 2 or len(times) > 2 * len(layout.points):
            return None
    return time_unit(times, sheet.names[column].lower() if sheet.names else "")


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
    """What can be said of all joints at once, in TOML, and the step of column numbers."""
    common: dict[str, str] = {}
    step = 0
    for part in _PARTS:
        these = [getattr(one, part) for one in layout.columns]
        if not all(these):
            continue
        if layout.long:
            common[part] = _listed(part, [column_of(sheet.names, k) for k in these[0]])
            continue
        steps = {b - a for one, two in pairwise(these) for a, b in zip(one, two, strict=True)}
        if layout.numbered and len(steps) == 1 and step in (0, *steps) and min(steps) > 0:
            (step,) = steps
            common[part] = _listed(part, [str(k + 1) for k in these[0]])
        elif not layout.numbered:
            patterns = {
                tuple(_pattern(sheet.names[column], name) for column in of)
                for of, name in zip(these, layout.names, strict=True)
            }
            if len(patterns) == 1:
                common[part] = _listed(part, [quoted(pattern) for pattern in patterns.pop()])
    return common, step


def _pattern(column: str, joint: str) -> str:
    return column.replace(joint, "{joint}") if column.count(joint) == 1 else column


def _rotations(layout: Layout) -> Iterator[str]:
    if layout.turns is None:
        return
    yield ""
    yield "[rotations]"
    if layout.turns.shape[-1] == 3:
        largest = float(np.nanmax(np.abs(layout.turns))) if np.isfinite(layout.turns).any() else 0.0
        yield 'order = "XYZ"  # please check: the intrinsic order, in which columns.euler are listed too'
        unit = "deg" if largest > 2 * np.pi else "rad"
        yield f'unit = "{unit}"  # please check: angles up to {largest:.3g}'
        yield 'relative_to = "parent"  # please check'
        return
    order, world, why = quaternion_order(layout.turns, layout.points, _parents(layout.names))
    # Columns that the header gives letters are listed in the sequence of the letters.
    yield 'order = "xyzw"' if layout.lettered else f'order = "{order}"  # {why}'
    yield f'relative_to = "{"parent" if world is False else "world"}"' + ("" if world else "  # please check")


def _parents(names: Sequence[str]) -> list[int]:
    """Index of each joint's parent: a Kinect's own, else that of the 20 nodes; -1 where nothing is known."""
    known = dict(zip(SDK_JOINTS, SDK_PARENTS, strict=True))
    azure = azure_skeleton()
    known |= {n: azure.names[p] if p >= 0 else "" for n, p in zip(azure.names, azure.parents, strict=True)}
    nodes = joints_of_nodes(tuple(names))
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
        yield from (f"{state} = [{', '.join(quoted(word) for word in these)}]" for state, these in lists)
        return
    values = sheet.values[:, columns]
    seen = values[np.isfinite(values)]
    if not np.isin(seen, (0.0, 1.0, 2.0)).all():
        yield from ("", "[states]  # please check: a confidence")
        yield from ("inferred_from = 0.01", f"tracked_from = {0.5 * float(seen.max()):g}")
    elif not (seen == 2.0).any():
        yield from ("", "[states]  # please check: no 2 was found, so 1 is taken for tracked")
        yield from ("missing = [0]", "tracked = [1]")


def _listed(part: str, items: Sequence[str]) -> str:
    return one_or_list(items, single=part == "state")


def _joints(sheet: Sheet, layout: Layout, names: Sequence[str]) -> Iterator[str]:
    common, _ = _common(sheet, layout)
    parents = _parents(layout.names)
    turned = layout.turns is not None
    yield ""
    yield "[joints]"
    each = layout.columns * (len(names) if layout.long else 1)
    for k, (name, called, one) in enumerate(zip(names, layout.names, each, strict=True)):
        said = [] if layout.numbered or name == called else [f"name = {quoted(called)}"]
        said += [
            f"{part} = {_listed(part, [column_of(sheet.names, k) for k in getattr(one, part)])}"
            for part in _PARTS
            if part not in common and getattr(one, part)
        ]
        note = ""
        if name not in NODES and (parents[k] >= 0 or turned):
            said.append(f"parent = {quoted(names[parents[k]] if parents[k] >= 0 else 'hip_center')}")
        if name not in NODES and parents[k] < 0:
            note = "  # please check: none of the 20 nodes"
        only_name = said and len(said) == 1 and said[0].startswith("name")
        value = (
            said[0].removeprefix("name = ") if only_name else "{ " + ", ".join(said) + " }" if said else "{}"
        )
        yield f"{key(name)} = {value}{note}"
