"""Parse the text of an ASF skeleton: bones with axes, lengths and degrees of freedom, not interpreted
further.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import IDENTITY, ORDERS, from_euler
from kinemimic.pipeline.readers.base.numbers import to_number
from kinemimic.pipeline.readers.base.source import Source

ROOT = "root"
MAX_BONES = 1024
# In any unit and in degrees. Larger numbers are damage, and would overflow later.
MAX_NUMBER = 1e9
_SCALES = (1e-4, 1e4)
_SECTIONS = ("units", "root", "bonedata", "hierarchy")
ROTATIONS: tuple[str, ...] = ("rx", "ry", "rz")
ROOT_DOFS: tuple[str, ...] = ("tx", "ty", "tz", *ROTATIONS)
# The degrees of freedom that a bone may have; l is a varying length.
DOFS: tuple[str, ...] = (*ROTATIONS, "tx", "ty", "tz", "l")
# Lengths of a direction, which some converters round; it is made a unit vector.
_DIRECTION = (0.9, 1.1)
_Line = tuple[int, list[str]]


@dataclass
class Bone:
    """A bone, or the root. axis: (4,) its frame at rest in the file's world; end: (3,) from its start to its
    end at rest, in the file's world and unit; dofs: its values in a frame of motion, in this order."""

    name: str
    axis: Array = field(default_factory=IDENTITY.copy)
    end: Array = field(default_factory=lambda: np.zeros(3))
    dofs: tuple[str, ...] = ()
    parent: int = -1


@dataclass
class AsfText:
    """bones: parents before children, the root first; position: (3,) of the root, in the file's unit; length:
    the divisor of the file's lengths; degrees: whether angles are degrees, not radians."""

    bones: list[Bone]
    position: Array
    length: float
    degrees: bool


def parse(source: Source) -> AsfText:
    """The skeleton; CaptureError names the line of the first mistake."""
    sections = _sections(source)
    for name in _SECTIONS[1:]:
        if name not in sections:
            raise source.error(expected=f"a section :{name}", found="none", advice="the skeleton is cut off")
    length, degrees = _units(source, sections.get("units", []))
    root, position = _root(source, sections["root"], degrees)
    bones = {ROOT: root}
    for block in _blocks(source, sections["bonedata"]):
        bone = _bone(source, block, degrees)
        if bone.name in bones:
            raise source.error(expected="each bone once", found=f"{bone.name!r} twice", line=block[0][0])
        if len(bones) > MAX_BONES:
            raise source.error(expected=f"at most {MAX_BONES} bones", found="more")
        bones[bone.name] = bone
    return AsfText(_tree(source, sections["hierarchy"], bones), position, length, degrees)


def _sections(source: Source) -> Mapping[str, list[_Line]]:
    """The words of each line, by the keyword above them (":root"), without comments and blank lines."""
    sections: dict[str, list[_Line]] = {}
    current: list[_Line] = []
    for number, line in enumerate(source.lines, 1):
        words = line.partition("#")[0].split()
        if words and words[0].startswith(":"):
            current = sections.setdefault(words[0][1:].lower(), [])
        elif words:
            current.append((number, words))
    return sections


def _units(source: Source, lines: Sequence[_Line]) -> tuple[float, bool]:
    length, degrees = 1.0, True
    for number, words in lines:
        match words[0].lower():
            case "length":
                length = float(_numbers(source, number, words[1:], 1, "a length scale")[0])
                if not _SCALES[0] <= length <= _SCALES[1]:
                    raise source.error(
                        expected=f"a length scale of {_SCALES[0]:g} to {_SCALES[1]:g}",
                        found=words[1][:40],
                        line=number,
                    )
            case "angle":
                degrees = not words[-1].lower().startswith("rad")
    return length, degrees


def _root(source: Source, lines: Sequence[_Line], degrees: bool) -> tuple[Bone, Array]:
    root, position, angles, order = Bone(ROOT, dofs=ROOT_DOFS), np.zeros(3), np.zeros(3), "XYZ"
    for number, words in lines:
        match words[0].lower():
            case "order":
                root.dofs = _dofs(source, number, words[1:], ROOT_DOFS)
            case "axis":
                order = _order(source, number, words[1:])
            case "position":
                position = _numbers(source, number, words[1:], 3, "the root's position")
            case "orientation":
                angles = _numbers(source, number, words[1:], 3, "the root's orientation")
    root.axis = _axis(angles, order, degrees)
    return root, position


def _blocks(source: Source, lines: Sequence[_Line]) -> Iterator[list[_Line]]:
    """The lines between each `begin` and its `end`."""
    block: list[_Line] | None = None
    for number, words in lines:
        word = words[0].lower()
        if (word == "begin") == (block is not None) and word in ("begin", "end"):
            raise source.error(expected="alternating begin and end", found=repr(word), line=number)
        if word == "begin":
            block = []
        elif word == "end":
            if block:
                yield block
            block = None
        elif block is not None:
            block.append((number, words))
    if block is not None:
        raise source.error(expected="an end", found="none", advice="the skeleton is cut off")


def _bone(source: Source, lines: Sequence[_Line], degrees: bool) -> Bone:
    bone = Bone("")
    direction, length = np.zeros(3), 0.0
    for number, words in lines:
        match words[0].lower():
            case "name":
                bone.name = " ".join(words[1:])
            case "direction":
                direction = _numbers(source, number, words[1:], 3, "a bone's direction")
            case "length":
                length = float(_numbers(source, number, words[1:], 1, "a bone's length")[0])
            case "axis":
                angles = _numbers(source, number, words[1:4], 3, "a bone's axis: three angles and an order")
                bone.axis = _axis(angles, _order(source, number, words[4:]), degrees)
            case "dof":
                bone.dofs = _dofs(source, number, words[1:], DOFS)
    line = lines[0][0]
    if not bone.name:
        raise source.error(expected="a bone's name", found="none", line=line)
    size = float(np.linalg.norm(direction))
    if size > 0 and not _DIRECTION[0] <= size <= _DIRECTION[1]:
        raise source.error(
            expected=f"a direction of length 1 at {bone.name}", found=f"length {size:.4g}", line=line
        )
    bone.end = direction * (length / size if size > 0 else length)
    return bone


def _tree(source: Source, lines: Sequence[_Line], bones: dict[str, Bone]) -> list[Bone]:
    """Bones in depth-first order of the hierarchy, as files list them."""
    children: dict[str, list[str]] = {}
    seen = {ROOT}
    for number, words in (line for block in _blocks(source, lines) for line in block):
        for name in words:
            if name not in bones:
                raise source.error(expected="a bone of :bonedata", found=repr(name[:40]), line=number)
        for name in words[1:]:
            if name in seen:
                raise source.error(expected="one parent per bone", found=f"{name!r} again", line=number)
            seen.add(name)
        children.setdefault(words[0], []).extend(words[1:])
    ordered: list[Bone] = []
    pending = [(ROOT, -1)]
    while pending:
        name, parent = pending.pop()
        bones[name].parent = parent
        pending += [(child, len(ordered)) for child in reversed(children.get(name, []))]
        ordered.append(bones[name])
    unreachable = [name for name in bones if name not in {bone.name for bone in ordered}]
    if unreachable:
        raise source.error(
            expected="every bone in :hierarchy below root", found=f"no {', '.join(unreachable[:4])} there"
        )
    return ordered


def _axis(angles: Array, order: str, degrees: bool) -> Array:
    """A rotation of ASF's extrinsic order: XYZ rotates about X first, R = Rz Ry Rx, which is our ZYX."""
    return from_euler((np.radians(angles) if degrees else angles)[::-1], order[::-1])


def _order(source: Source, number: int, words: Sequence[str]) -> str:
    order = "".join(words).upper() or "XYZ"
    if order not in ORDERS:
        raise source.error(expected="an order of axes such as XYZ", found=repr(order[:40]), line=number)
    return order


def _dofs(source: Source, number: int, words: Sequence[str], known: tuple[str, ...]) -> tuple[str, ...]:
    dofs = tuple(word.lower() for word in words)
    if not set(dofs) <= set(known) or len(set(dofs)) != len(dofs):
        raise source.error(
            expected=f"degrees of freedom among {' '.join(known)}, each once",
            found=repr(" ".join(words)[:40]),
            line=number,
        )
    return dofs


def _numbers(source: Source, number: int, words: Sequence[str], count: int, expected: str) -> Array:
    """The first `count` words as numbers."""
    values = np.array([value for word in words[:count] if (value := to_number(word)) is not None])
    if len(values) < count or not (np.abs(values) < MAX_NUMBER).all():
        raise source.error(expected=expected, found=repr(" ".join(words)[:40]), line=number)
    return values
