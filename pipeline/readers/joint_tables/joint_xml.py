"""XML of joints, whatever its elements are called: the objects that they make, read like JSON.

Programs for Kinects write such files, by hand or with .NET's serialisation. Attributes and elements are an
object's entries alike; elements of one name within another are a list.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any
from xml.parsers import expat

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.json_text import MAX_VALUES
from kinemimic.pipeline.readers.base.numbers import to_number
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.joint_tables.joint_json import clip_of_document, name_legs

FORMAT = Format(
    name="joint XML",
    sensor="unknown",
    holds="positions of joints with known names, or in a known order",
    recognised_by="XML with the names of hips, knees and ankles, or with joints or a skeleton",
)
_SEARCHED = 2**20
_NAME = re.compile(rb"[<\"'>]\s*([A-Za-z][\w .:-]{1,40})")
_JOINTS = re.compile(rb"<[\w:]*(?:joint|skeleton|bod(?:y|ies)\b)", re.IGNORECASE)
# Files of other programs: robots and simulations, whose joints connect links.
_OTHERS = re.compile(rb"<(?:robot|mujoco|sdf|COLLADA|svg|html|mvnx|OpenSimDocument)\b", re.IGNORECASE)
_TEXT = "value"
_NUMBERS = re.compile(r"[\s,;()]+")
_DEEPEST = 50


def recognises(source: Source) -> bool:
    """True for XML that names joints of legs in its first megabyte, or says that it holds joints."""
    if not source.head[0].lstrip().startswith("<"):
        return False
    begin = source.content[:_SEARCHED]
    if _OTHERS.search(begin[:4096]):
        return False
    return bool(_JOINTS.search(begin)) or name_legs({name.decode() for name in _NAME.findall(begin)})


def read(source: Source) -> Clip:
    """The clip of the joints, as of JSON; CaptureError for damaged XML, and where these are not certain."""
    return clip_of_document(_document(source), source, FORMAT)


class _Element:
    """An element as it is parsed: its name without a prefix, its attributes, elements and text."""

    def __init__(self, name: str, attributes: Mapping[str, str]) -> None:
        self.name = _local(name)
        self.attributes = {_local(key): value for key, value in attributes.items() if key[:5] != "xmlns"}
        self.elements: list[_Element] = []
        self.texts: list[str] = []

    @property
    def text(self) -> str:
        """What stands between its tags, without its elements."""
        return "".join(self.texts)


def _document(source: Source) -> Any:
    """The objects of the file; CaptureError for anything but well-formed XML without entities, with which a
    small file can be made to fill the memory."""
    outermost = _Element("", {})
    within = [outermost]
    count = 0
    parser = expat.ParserCreate()

    def start(name: str, attributes: Mapping[str, str]) -> None:
        nonlocal count
        count += 1 + len(attributes)
        if count > MAX_VALUES or len(within) > _DEEPEST:
            raise source.error(
                expected=f"XML of at most {MAX_VALUES} values, {_DEEPEST} deep", found="more",
                line=parser.CurrentLineNumber,
            )  # fmt: skip
        element = _Element(name, attributes)
        within[-1].elements.append(element)
        within.append(element)

    def text(part: str) -> None:
        within[-1].texts.append(part)

    def entity(*_: object) -> None:
        raise source.error(expected="XML without entities", found="one", line=parser.CurrentLineNumber)

    parser.StartElementHandler = start
    parser.EndElementHandler = lambda _: within.pop()
    parser.CharacterDataHandler = text
    parser.EntityDeclHandler = entity
    parser.buffer_text = True
    try:
        parser.Parse(source.content, True)
    except expat.ExpatError as error:
        found = expat.ErrorString(error.code) or "damage"
        raise source.error(expected="XML", found=found, line=error.lineno) from None
    except (LookupError, UnicodeError):
        raise source.error(expected="XML", found="an unknown encoding") from None
    (root,) = outermost.elements
    return _object(root, frozenset(_repeated(root)))


def _local(name: str) -> str:
    return name.rsplit(":", 1)[-1]


def _repeated(element: _Element) -> Iterator[tuple[str, str]]:
    """The names of elements of which one of another name has several, and that other's."""
    names = Counter(inner.name for inner in element.elements)
    yield from ((element.name, name) for name, count in names.items() if count > 1)
    for inner in element.elements:
        yield from _repeated(inner)


def _object(element: _Element, repeated: frozenset[tuple[str, str]]) -> Any:
    """An element's entries; its text alone without any."""
    found: dict[str, Any] = {key: _value(text) for key, text in element.attributes.items()}
    for inner in element.elements:
        value = _object(inner, repeated)
        if (element.name, inner.name) in repeated:
            found.setdefault(inner.name, []).append(value)
        else:
            found.setdefault(inner.name, value)
    if not found:
        return _value(element.text)
    if element.text.strip():
        found.setdefault(_TEXT, _value(element.text))
    return found


def _value(text: str) -> Any:
    """A number, also with a decimal comma, a list of several, or the text."""
    text = text.strip()
    number = to_number(text.replace(",", ".") if text.count(",") == 1 and "." not in text else text)
    if number is not None:
        return int(number) if text.isdecimal() and math.isfinite(number) else number
    numbers = [to_number(part) for part in _NUMBERS.split(text.strip("()")) if part]
    return numbers if len(numbers) > 1 and None not in numbers else text
