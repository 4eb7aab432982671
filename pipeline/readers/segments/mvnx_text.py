"""The content of an MVNX file that a clip is made of, from the events of an XML parser.

Only segments with their points, joints and the frames' positions, orientations and joint angles are kept.
Entities, with which a small XML file can be made to fill the memory or to include other files, are refused.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple
from xml.parsers import expat

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.readers.base.numbers import numbers_of
from kinemimic.pipeline.readers.base.source import Source

# Elements of a frame whose numbers are kept.
FIELDS: tuple[str, ...] = ("orientation", "position", "jointAngle")
# Start of the names of elements with the segments and joints of fingers, which frames list apart.
_FINGERS = "fingerTracking"
# An hour at 240 Hz.
MAX_FRAMES = 864_000


@dataclass
class Frame:
    """A frame of type "normal". time: as in the file, or None; line: of its start; values: numbers by element
    (FIELDS)."""

    time: float | None
    line: int
    values: dict[str, list[float]] = field(default_factory=dict)


class Joint(NamedTuple):
    """A joint's label; the segments that it connects, and which of their points it is."""

    label: str
    above: str
    below: str
    point_above: str
    point_below: str


@dataclass
class Content:
    """version: of the format; rate: Hz as stated, or ""; segments: labels in the order of the numbers;
    points: segment and point -> its place on the segment, metres; joints: between the segments; frames: of
    the first subject; subjects: how many the file has."""

    version: str = ""
    rate: str = ""
    segments: list[str] = field(default_factory=list)
    points: dict[tuple[str, str], list[float]] = field(default_factory=dict)
    joints: list[Joint] = field(default_factory=list)
    frames: list[Frame] = field(default_factory=list)
    subjects: int = 0


def parse_mvnx(source: Source) -> Content:
    """The content of the file.

    Raises CaptureError with the line for anything but well-formed XML without entities, for text in place of
    numbers, and for more than MAX_FRAMES frames.
    """
    parser = expat.ParserCreate("utf-8")
    handlers = _Handlers(source, parser)
    parser.StartElementHandler = handlers.start
    parser.EndElementHandler = handlers.end
    parser.CharacterDataHandler = handlers.text
    parser.EntityDeclHandler = handlers.entity
    parser.buffer_text = True
    try:
        parser.Parse(source.content, True)
    except expat.ExpatError as error:
        last = source.content.count(b"\n") + 1
        raise source.error(
            expected="XML",
            found=expat.ErrorString(error.code) or "damage",
            line=error.lineno,
            advice="the file is cut off there" if error.lineno >= last else None,
        ) from None
    return handlers.content


class _Handlers:
    def __init__(self, source: Source, parser: expat.XMLParserType) -> None:
        self.source, self.parser = source, parser
        self.content = Content()
        self.frame: Frame | None = None
        self.words: list[str] | None = None
        self.joint = Joint("", "", "", "", "")
        self.point = ""
        self.in_fingers = 0

    def start(self, name: str, attributes: Mapping[str, str]) -> None:
        # A namespace's prefix, which some writers use, says nothing here.
        name = name.rpartition(":")[2]
        self.in_fingers += name.startswith(_FINGERS)
        if self.in_fingers:
            return
        if name == "mvnx":
            self.content.version = attributes.get("version", "")
        elif name == "subject":
            self.content.subjects += 1
            if self.content.subjects == 1:
                self.content.rate = attributes.get("frameRate", "")
        elif self.content.subjects > 1:
            return
        elif name == "segment" and self.frame is None:
            self.content.segments.append(attributes.get("label", ""))
        elif name == "joint":
            self.joint = Joint(attributes.get("label", ""), "", "", "", "")
        elif name == "point":
            self.point = attributes.get("label", "")
        elif name == "frame":
            self._start_frame(attributes)
        elif name in ("connector1", "connector2", "pos_b") or (name in FIELDS and self.frame is not None):
            self.words = []

    def end(self, name: str) -> None:
        name = name.rpartition(":")[2]
        if self.in_fingers:
            self.in_fingers -= name.startswith(_FINGERS)
            return
        if name == "frame":
            self.frame = None
        elif name == "joint" and self.joint.above:
            self.content.joints.append(self.joint)
            self.joint = Joint("", "", "", "", "")
        elif self.words is not None:
            text, self.words = "".join(self.words), None
            if name.startswith("connector"):
                # "Pelvis/jL5S1": the segment, and its point that is the joint.
                segment, _, point = text.strip().partition("/")
                self.joint = (
                    self.joint._replace(above=segment, point_above=point)
                    if name == "connector1"
                    else self.joint._replace(below=segment, point_below=point)
                )
            elif name == "pos_b" and self.content.segments:
                self.content.points[self.content.segments[-1], self.point] = numbers_of(text, None) or []
            elif self.frame is not None and name in FIELDS:
                values = numbers_of(text, None)
                if values is None:
                    raise self.source.error(
                        expected=f"numbers in <{name}>", found="something else", line=self.frame.line
                    )
                self.frame.values[name] = values

    def text(self, words: str) -> None:
        if self.words is not None:
            self.words.append(words)

    def entity(self, *_: object) -> None:
        raise self.source.error(
            expected="XML without entities", found="one", line=self.parser.CurrentLineNumber
        )

    def _start_frame(self, attributes: Mapping[str, str]) -> None:
        # Identity and T-pose come before the movement; the oldest versions have no types.
        if attributes.get("type", "normal") != "normal":
            return
        line = self.parser.CurrentLineNumber
        given = attributes.get("time", "")
        time = numbers_of(given, None) if given.strip() else None
        if given.strip() and (time is None or len(time) != 1):
            raise self.source.error(expected="a time in ms", found=repr(given[:20]), line=line)
        self.frame = Frame(time[0] if time else None, line)
        self.content.frames.append(self.frame)
        if len(self.content.frames) > MAX_FRAMES:
            raise CaptureError(
                self.source.path, expected=f"at most {MAX_FRAMES} frames", found="more", where=f"line {line}"
            )
