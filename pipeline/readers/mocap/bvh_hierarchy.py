"""Parse the hierarchy of a BVH file: its trees of joints with their offsets and channels."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.readers.base.numbers import to_number
from kinemimic.pipeline.readers.base.source import Source

# Limits against files that are not of a person: a body with all fingers is about 12 deep and has 70 joints.
MAX_DEPTH = 128
MAX_JOINTS = 1024
# In any unit and in degrees. Larger numbers are damage, and would overflow later.
MAX_NUMBER = 1e9
CHANNELS: tuple[str, ...] = tuple(
    f"{axis}{kind}" for kind in ("position", "rotation", "scale") for axis in "XYZ"
)
# Spelling -> name; some tools shorten it to Xpos and Xrot.
_CHANNEL = {name.lower(): name for name in CHANNELS} | {name[:4].lower(): name for name in CHANNELS}


@dataclass
class Joint:
    """A joint as in the file. end: an End Site, named `<parent>_end`; parent: index, -1 for the root."""

    name: str
    parent: int
    end: bool = False
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    channels: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Token:
    text: str
    line: int


class Tokens:
    """words: of the hierarchy with their lines; a brace is a word of its own."""

    def __init__(self, lines: Sequence[str], source: Source) -> None:
        self.source = source
        self.words = self._split(lines)
        self._last = len(lines)

    @staticmethod
    def _split(lines: Sequence[str]) -> Iterator[_Token]:
        for number, line in enumerate(lines, 1):
            for word in line.replace("{", " { ").replace("}", " } ").split():
                yield _Token(word, number)

    def next(self, expected: str) -> _Token:
        token = next(self.words, None)
        if token is None:
            raise self.source.error(
                expected=expected,
                found="the end of the file",
                line=self._last,
                advice="the file is cut off there",
            )
        return token

    def require(self, word: str) -> _Token:
        token = self.next(word)
        if token.text.lower() != word.lower():
            raise self.error(token, word)
        return token

    def number(self, expected: str) -> float:
        token = self.next(expected)
        value = to_number(token.text)
        if value is None or not abs(value) < MAX_NUMBER:
            raise self.error(token, expected)
        return value

    def error(self, token: _Token, expected: str) -> CaptureError:
        return self.source.error(expected=expected, found=repr(token.text[:40]), line=token.line)


def hierarchy(tokens: Tokens) -> list[list[Joint]]:
    """The trees of a file, each with its joints in the file's order, a parent's index within its own tree:
    that of a person, and perhaps others for a second one, a camera or a thing."""
    tokens.require("HIERARCHY")
    tokens.require("ROOT")
    trees = [_tree(tokens, MAX_JOINTS)]
    while (extra := next(tokens.words, None)) is not None:
        if extra.text.lower() != "root":
            raise tokens.error(extra, "MOTION or another ROOT")
        trees.append(_tree(tokens, MAX_JOINTS - sum(map(len, trees))))
    return trees


def _tree(tokens: Tokens, most: int) -> list[Joint]:
    """The joints below a ROOT, at most so many. Iterative, so that nesting needs no stack."""
    joints: list[Joint] = []
    names: set[str] = set()
    open_joints: list[int] = []

    def begin(end: bool) -> None:
        # A name may contain spaces; the brace ends it.
        words: list[str] = []
        while (token := tokens.next("a joint's name and {")).text != "{":
            words.append(token.text)
        parent = open_joints[-1] if open_joints else -1
        name = f"{joints[parent].name}_end" if end else " ".join(words)
        if not name:
            raise tokens.error(token, "a joint's name")
        if len(open_joints) >= MAX_DEPTH or len(joints) >= most:
            raise tokens.source.error(
                expected=f"at most {MAX_JOINTS} joints, nested at most {MAX_DEPTH} deep",
                found="more",
                line=token.line,
            )
        unique, count = name, 1
        while unique in names:
            count += 1
            unique = f"{name}_{count}"
        names.add(unique)
        open_joints.append(len(joints))
        joints.append(Joint(unique, parent, end))

    begin(end=False)
    while open_joints:
        joint = joints[open_joints[-1]]
        token = tokens.next("OFFSET, CHANNELS, JOINT, End Site or }")
        match token.text.lower():
            case "offset":
                x, y, z = (tokens.number("three numbers after OFFSET") for _ in range(3))
                joint.offset = (x, y, z)
            case "channels":
                joint.channels = _channels(tokens)
            case "joint" if not joint.end:
                begin(end=False)
            case "end" | "endsite" if not joint.end:
                begin(end=True)
            case "}":
                open_joints.pop()
            case _:
                raise tokens.source.error(
                    expected="OFFSET, CHANNELS, JOINT, End Site or }",
                    found=repr(token.text[:40]),
                    line=token.line,
                    advice="BVH has no such keyword: delete its lines, or export again",
                )
    return joints


def _channels(tokens: Tokens) -> tuple[str, ...]:
    count = tokens.next("the number of channels")
    if count.text not in {str(n) for n in range(len(CHANNELS) + 1)}:
        raise tokens.error(count, f"0 to {len(CHANNELS)} channels")
    names: list[str] = []
    for _ in range(int(count.text)):
        token = tokens.next("a channel")
        name = _CHANNEL.get(token.text.lower())
        if name is None or name in names:
            raise tokens.error(token, f"channels among {', '.join(CHANNELS)}, each once")
        names.append(name)
    return tuple(names)
