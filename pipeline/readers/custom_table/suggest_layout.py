"""Where the joints of a table stand: by names in a column, by names in the header, or by making a body."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.nodes import joints_of_nodes
from kinemimic.pipeline.readers.custom_table.suggest_names import Columns, joints_of_header
from kinemimic.pipeline.readers.custom_table.suggest_orders import (
    ORDERS,
    SURE,
    Order,
    body_score,
    order_of,
    order_of_points,
)
from kinemimic.pipeline.readers.custom_table.suggest_table import Sheet

# Fewer joints are no body, more are no sensor's.
_JOINTS = (5, 80)
# So many of the 20 nodes among the names, and they name a body.
_ENOUGH = 8
_STATES = (0.0, 1.0, 2.0)
_PLACE = re.compile(r"(?:pos(?:ition)?|p|t)?[ _.]*([xyz])(?:[ _]*[\[(].*[\])])?", re.IGNORECASE)
_TURN = re.compile(r"(?:q|quat(?:ernion)?|rot(?:ation)?|orientation)[ _.]*([xyzw])", re.IGNORECASE)


@dataclass(frozen=True)
class Layout:
    """names: (J,) of the joints, as the file has them, or those of a known sequence (then `numbered`);
    columns: (J,) of each, or one for all where a row holds one joint (then `long`); points: (T, J, 3);
    turns: (T, J, 4 or 3) if there are any; joint_column: of the names; why: how it is known;
    lettered: the header says which column is which axis."""

    names: tuple[str, ...]
    columns: tuple[Columns, ...]
    points: Array
    turns: Array | None
    numbered: bool
    long: bool
    joint_column: int | None
    why: str
    lettered: bool = False


def layout_of(sheet: Sheet) -> Layout | None:
    """The joints of a table; None if no body is found in it."""
    return _by_column(sheet) or _by_header(sheet) or _by_body(sheet)


def _by_column(sheet: Sheet) -> Layout | None:
    """A column of joint names, a row for each joint."""
    for column, cells in sheet.words.items():
        counts = Counter(cells)
        names = tuple(dict.fromkeys(cells))
        often = min(counts.values()) > 1 or len(cells) < 3 * len(names)
        if not (_JOINTS[0] <= len(names) <= _JOINTS[1] and often and len(joints_of_nodes(names)) >= _ENOUGH):
            continue
        one = _columns_of_row(sheet)
        if not one.position:
            return None
        begins = np.array([cell == cells[0] for cell in cells])
        frame = np.cumsum(begins) - 1
        joint = np.array([names.index(cell) for cell in cells])
        points = np.full((int(frame[-1]) + 1, len(names), 3), np.nan)
        points[frame, joint] = sheet.values[:, one.position]
        turns = None
        if one.quaternion:
            turns = np.full((*points.shape[:2], 4), np.nan)
            turns[frame, joint] = sheet.values[:, one.quaternion]
        why = f"named in column {column + 1}"
        return Layout(names, (one,), points, turns, False, True, column, why, lettered=True)
    return None


def _columns_of_row(sheet: Sheet) -> Columns:
    """Columns of x, y, z and more where a row holds one joint."""
    one = Columns()
    for part, pattern, axes in (("position", _PLACE, "xyz"), ("quaternion", _TURN, "xyzw")):
        found = {
            match[1].lower(): k for k, name in enumerate(sheet.names) if (match := pattern.fullmatch(name))
        }
        if set(axes) <= found.keys():
            setattr(one, part, tuple(found[axis] for axis in axes))
    if not one.position and not sheet.names:
        # Times and frame numbers only grow; places do not.
        moving = [
            k
            for k in range(sheet.width)
            if k not in sheet.words
            and (np.diff(sheet.values[:, k]) < 0).any()
            and not _is_state(sheet.values[:, k])
        ]
        one.position = tuple(moving[:3]) if len(moving) >= 3 else ()
    taken = {*one.position, *one.quaternion}
    rest = [k for k in range(sheet.width) if k not in taken]
    states = [k for k in rest if k not in sheet.words and _is_state(sheet.values[:, k])]
    words = [k for k in rest if k in sheet.words and len(set(sheet.words[k])) <= _JOINTS[0]]
    one.state = tuple((states or words)[:1])
    return one


def _by_header(sheet: Sheet) -> Layout | None:
    """Columns of joints named in the header; their numbers may stand for a known sequence."""
    found = joints_of_header(sheet.names)
    placed = {name: columns for name, columns in found.items() if columns.position}
    if len(placed) < _JOINTS[0]:
        return None
    points = np.stack([sheet.values[:, columns.position] for columns in placed.values()], axis=1)
    names, columns = tuple(placed), tuple(placed.values())
    turns = _turns(sheet, columns)
    known = order_of_points(points)
    telling = len(joints_of_nodes(names)) >= _ENOUGH
    score = body_score(points, names) if telling else np.inf
    # Some recorders' headers name the joints in a wrong sequence.
    wrong = known is not None and SURE <= score < np.inf and known[1] < 0.5 * score
    if known is not None and known[1] < SURE and (wrong or not telling):
        told = "the header's names make no body" if telling else "the header only numbers them"
        why = f"{told}; taken in the sequence of the {known[0]} (please check)"
        return Layout(ORDERS[known[0]], columns, points, turns, True, False, None, why, lettered=True)
    if not telling:
        return None
    why = "named in the header"
    return Layout(names, columns, points, turns, False, False, None, why, lettered=True)


def _by_body(sheet: Sheet) -> Layout | None:
    """Columns by their numbers: the known sequence that makes a body."""
    order = order_of(sheet.values)
    if order is None:
        return None
    why = (
        f"the sequence of the {order.name}: bone lengths fit an adult's with a score of {order.score:.2f} "
        f"(0 is perfect)"
        + (f", the next best sequence's with {order.second:.2f}" if np.isfinite(order.second) else "")
        + ("" if order.score < SURE else "; that is no good fit: please check")
    )
    if order.step == 0:
        one = Columns(position=tuple(range(order.first, order.first + 3)))
        rest = [k for k in range(sheet.width) if k not in one.position and _is_state(sheet.values[:, k])]
        one.state = tuple(rest[:1])
        whole = len(sheet.values) // len(order.joints) * len(order.joints)
        points = sheet.values[:whole, one.position].reshape(-1, len(order.joints), 3)
        return Layout(order.joints, (one,), points, None, True, True, None, why)
    state, turn = _beside(sheet, order)
    columns = tuple(
        Columns(
            position=tuple(begin + k for k in range(3)),
            state=() if state is None else (begin + state,),
            quaternion=() if turn is None else tuple(begin + turn + k for k in range(4)),
        )
        for begin in range(order.first, order.first + order.step * len(order.joints), order.step)
    )
    points = np.stack([sheet.values[:, one.position] for one in columns], axis=1)
    return Layout(order.joints, columns, points, _turns(sheet, columns), True, False, None, why)


def _beside(sheet: Sheet, order: Order) -> tuple[int | None, int | None]:
    """Where, from a joint's x, its state and its quaternion stand: those that all joints have."""
    begins = order.first + order.step * np.arange(len(order.joints))

    def block(offset: int, count: int) -> Array | None:
        columns = begins[:, None] + offset + np.arange(count)
        inside = columns.min() >= 0 and columns.max() < sheet.width
        return sheet.values[:, columns] if inside else None

    turn = None
    for offset in (3, 4):
        if order.step >= offset + 4 and (q := block(offset, 4)) is not None:
            length = np.linalg.norm(q, axis=-1)
            seen = length[np.isfinite(length) & (length > 0)]
            if len(seen) and np.mean(np.abs(seen - 1.0) < 0.01) > 0.9:
                turn = offset
                break
    free = [k for k in (3, 7, -1) if turn is None or not turn <= k < turn + 4]
    if order.step == 3 or (order.step == 7 and turn is not None):
        return None, turn
    for offset in free:
        if (state := block(offset, 1)) is not None and _is_state(state):
            return offset, turn
    return None, turn


def _is_state(values: Array) -> bool:
    """Whether values are states 0, 1, 2, or a confidence from 0 to 1 that mostly is one of its ends."""
    seen = values[np.isfinite(values)]
    if len(seen) == 0 or seen.min() < 0 or seen.max() > 2:
        return False
    return bool(np.isin(seen, _STATES).mean() > 0.5)


def _turns(sheet: Sheet, columns: tuple[Columns, ...]) -> Array | None:
    for part, count in (("quaternion", 4), ("euler", 3)):
        these = [getattr(one, part) for one in columns]
        if any(these):
            none = np.full((len(sheet.values), count), np.nan)
            return np.stack([sheet.values[:, of] if of else none for of in these], axis=1)
    return None
