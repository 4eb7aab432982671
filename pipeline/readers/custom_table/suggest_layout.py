"""Find the columns of the joints: by names in a column or in the header, or because they form a body."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.joint_names import joints_by_name
from kinemimic.pipeline.readers.custom_table.suggest_names import STATE, Columns, joints_of_header
from kinemimic.pipeline.readers.custom_table.suggest_orders import (
    GOOD_SCORE,
    ORDERS,
    PENALTY_PER_SPARE,
    Order,
    body_score,
    order_of,
    order_of_points,
)
from kinemimic.pipeline.readers.custom_table.suggest_table import Sheet
from kinemimic.pipeline.readers.landmarks.one_person import is_person

# Fewer joints are not a body; no sensor tracks more.
_JOINT_COUNTS = (5, 80)
# Names that include this many of the 20 nodes name a body.
_MIN_NODES = 8
_STATES = (0.0, 1.0, 2.0)
# "poz_z" is a typing error in the sample scripts of Unity's best-known Kinect package.
_POSITION = re.compile(
    r"(?:po[sz](?:ition)?|p|t)?[ _.]*([xyz])(?:[ _]*[\[(].*[\])]|[ _](?:mm|cm|m))?", re.IGNORECASE
)
_QUATERNION = re.compile(r"(?:q|quat(?:ernion)?|rot(?:ation)?|orientation)[ _.]*([xyzw])", re.IGNORECASE)


@dataclass(frozen=True)
class Layout:
    """The columns of the joints.

    names: (J,) as in the file, or those of a known sequence (if `numbered`); columns: (J,) of each joint, or
    one for all if a row holds one joint (`long`); points: (T, J, 3); rotations: (T, J, 4 or 3) if there are
    any; joint_column: the column of joint names; reason: the evidence; lettered: the header names the axes;
    margin: by how much a known sequence is a better body than the next one (`body_score`), negative for a
    poor fit.
    """

    names: tuple[str, ...]
    columns: tuple[Columns, ...]
    points: Array
    rotations: Array | None
    numbered: bool
    long: bool
    joint_column: int | None
    reason: str
    lettered: bool = False
    margin: float = np.inf


def layout_of(sheet: Sheet) -> Layout | None:
    """The joints of a table; None if no body is found in it."""
    return _by_column(sheet) or _by_number(sheet) or _by_header(sheet) or _by_body(sheet)


def _by_column(sheet: Sheet) -> Layout | None:
    """A layout with a column of joint names and one row per joint."""
    for column, cells in sheet.words.items():
        counts = Counter(cells)
        names = tuple(dict.fromkeys(cells))
        repeated = min(counts.values()) > 1 or len(cells) < 3 * len(names)
        if not (
            _JOINT_COUNTS[0] <= len(names) <= _JOINT_COUNTS[1]
            and repeated
            and len(joints_by_name(names)) >= _MIN_NODES
        ):
            continue
        one = _columns_of_row(sheet)
        if not one.position:
            return None
        starts = np.array([cell == cells[0] for cell in cells])
        frame = np.cumsum(starts) - 1
        joint = np.array([names.index(cell) for cell in cells])
        points = np.full((int(frame[-1]) + 1, len(names), 3), np.nan)
        points[frame, joint] = sheet.values[:, one.position]
        rotations = None
        if one.quaternion:
            rotations = np.full((*points.shape[:2], 4), np.nan)
            rotations[frame, joint] = sheet.values[:, one.quaternion]
        reason = f"named in column {column + 1}"
        return Layout(names, (one,), points, rotations, False, True, column, reason, lettered=True)
    return None


def _by_number(sheet: Sheet) -> Layout | None:
    """A layout with one row per joint and a column that counts them, in each frame from the beginning."""
    one = _columns_of_row(sheet) if sheet.names else Columns()
    if not one.position:
        return None
    for column in range(sheet.width):
        count = None if column in one.position else _counted(sheet.values[:, column])
        if count is None:
            continue
        rows = len(sheet.values) // count * count
        points = sheet.values[:rows, one.position].reshape(-1, count, 3)
        known = order_of_points(points)
        if known is None or known[1] > GOOD_SCORE:
            return None
        reason = f"numbered in column {column + 1}; assumed to be in the sequence of the {known[0]}"
        return Layout(
            ORDERS[known[0]], (one,), points, None, True, True, None, reason, margin=known[2] - known[1]
        )
    return None


def _counted(values: Array) -> int | None:
    """How many numbers a column counts through, again and again, from 0 or 1; None for another column."""
    if not np.isfinite(values).all() or values[0] not in (0.0, 1.0):
        return None
    count = values.max() - values[0] + 1.0
    if not (_JOINT_COUNTS[0] <= count <= _JOINT_COUNTS[1] and len(values) >= 2 * count):
        return None
    return int(count) if (values == values[0] + np.arange(len(values)) % int(count)).all() else None


def _columns_of_row(sheet: Sheet) -> Columns:
    """Columns of position, quaternion and state if a row holds one joint."""
    one = Columns()
    for part, pattern, axes in (("position", _POSITION, "xyz"), ("quaternion", _QUATERNION, "xyzw")):
        found = {
            match[1].lower(): k for k, name in enumerate(sheet.names) if (match := pattern.fullmatch(name))
        }
        if set(axes) <= found.keys():
            setattr(one, part, tuple(found[axis] for axis in axes))
    if not one.position and not sheet.names:
        # Times and frame numbers only increase; coordinates do not.
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
    # Numbers of people, or joints, look like states.
    named = [k for k in rest if sheet.names and STATE.fullmatch(sheet.names[k])]
    rest = named or [k for k in rest if not (sheet.names and is_person(sheet.names[k]))]
    states = [k for k in rest if k not in sheet.words and _is_state(sheet.values[:, k])]
    words = [k for k in rest if k in sheet.words and len(set(sheet.words[k])) <= _JOINT_COUNTS[0]]
    one.state = tuple((states or words)[:1])
    return one


def _by_header(sheet: Sheet) -> Layout | None:
    """A layout with joint columns named in the header; numbered names may stand for a known sequence."""
    found = joints_of_header(sheet.names)
    with_position = {name: columns for name, columns in found.items() if columns.position}
    if len(with_position) < _JOINT_COUNTS[0]:
        return None
    points = np.stack([sheet.values[:, columns.position] for columns in with_position.values()], axis=1)
    names, columns = tuple(with_position), tuple(with_position.values())
    rotations = _rotations(sheet, columns)
    known = order_of_points(points)
    margin = -np.inf if known is None or known[1] > GOOD_SCORE else known[2] - known[1]
    has_node_names = len(joints_by_name(names)) >= _MIN_NODES
    score = body_score(points, names) if has_node_names else np.inf
    # Some recorders' headers list the joints in a wrong sequence.
    names_are_wrong = known is not None and GOOD_SCORE <= score < np.inf and known[1] < 0.5 * score
    if known is not None and known[1] < GOOD_SCORE and (names_are_wrong or not has_node_names):
        reason = "the header's names do not form a body" if has_node_names else "the header only numbers them"
        reason = f"{reason}; assumed to be in the sequence of the {known[0]} (please check)"
        return Layout(
            ORDERS[known[0]],
            columns,
            points,
            rotations,
            True,
            False,
            None,
            reason,
            lettered=True,
            margin=margin,
        )
    if not has_node_names:
        return None
    reason = "named in the header"
    return Layout(names, columns, points, rotations, False, False, None, reason, lettered=True)


def _by_body(sheet: Sheet) -> Layout | None:
    """A layout without names: the known sequence of joints that forms a body."""
    order = order_of(sheet.values)
    if order is None:
        return None
    reason = (
        f"the sequence of the {order.name}: bone lengths differ from an adult's by a score of "
        f"{order.score:.2f} (0 is perfect)"
        + (f", the next best sequence's with {order.second:.2f}" if np.isfinite(order.second) else "")
        + ("" if order.score < GOOD_SCORE else "; a poor fit: please check")
    )
    poor = order.score + PENALTY_PER_SPARE * order.spare > GOOD_SCORE
    margin = -np.inf if poor else order.second - order.score
    if order.step == 0:
        one = Columns(position=tuple(range(order.first, order.first + 3)))
        rest = [k for k in range(sheet.width) if k not in one.position and _is_state(sheet.values[:, k])]
        one.state = tuple(rest[:1])
        complete_rows = len(sheet.values) // len(order.joints) * len(order.joints)
        points = sheet.values[:complete_rows, one.position].reshape(-1, len(order.joints), 3)
        return Layout(order.joints, (one,), points, None, True, True, None, reason, margin=margin)
    state, quaternion = _state_and_quaternion_offsets(sheet, order)
    columns = tuple(
        Columns(
            position=tuple(start + k for k in range(3)),
            state=() if state is None else (start + state,),
            quaternion=() if quaternion is None else tuple(start + quaternion + k for k in range(4)),
        )
        for start in range(order.first, order.first + order.step * len(order.joints), order.step)
    )
    points = np.stack([sheet.values[:, one.position] for one in columns], axis=1)
    rotations = _rotations(sheet, columns)
    return Layout(order.joints, columns, points, rotations, True, False, None, reason, margin=margin)


def _state_and_quaternion_offsets(sheet: Sheet, order: Order) -> tuple[int | None, int | None]:
    """Offsets from a joint's x to its state and its quaternion, if all joints have them."""
    starts = order.first + order.step * np.arange(len(order.joints))

    def block(offset: int, count: int) -> Array | None:
        columns = starts[:, None] + offset + np.arange(count)
        inside = columns.min() >= 0 and columns.max() < sheet.width
        return sheet.values[:, columns] if inside else None

    quaternion = None
    for offset in (3, 4):
        if order.step >= offset + 4 and (q := block(offset, 4)) is not None:
            length = np.linalg.norm(q, axis=-1)
            seen = length[np.isfinite(length) & (length > 0)]
            if len(seen) and np.mean(np.abs(seen - 1.0) < 0.01) > 0.9:
                quaternion = offset
                break
    free = [k for k in (3, 7, -1) if quaternion is None or not quaternion <= k < quaternion + 4]
    if order.step == 3 or (order.step == 7 and quaternion is not None):
        return None, quaternion
    for offset in free:
        if (state := block(offset, 1)) is not None and _is_state(state):
            return offset, quaternion
    return None, quaternion


def _is_state(values: Array) -> bool:
    """Whether values are states 0, 1, 2, or a confidence from 0 to 1 that is mostly 0 or 1."""
    seen = values[np.isfinite(values)]
    if len(seen) == 0 or seen.min() < 0 or seen.max() > 2:
        return False
    return bool(np.isin(seen, _STATES).mean() > 0.5)


def _rotations(sheet: Sheet, columns: tuple[Columns, ...]) -> Array | None:
    for part, count in (("quaternion", 4), ("euler", 3)):
        columns_of_joints = [getattr(one, part) for one in columns]
        if any(columns_of_joints):
            empty = np.full((len(sheet.values), count), np.nan)
            return np.stack([sheet.values[:, of] if of else empty for of in columns_of_joints], axis=1)
    return None
