"""Which column of a MediaPipe table holds which number of which landmark, from the words of its name.

The field stands last or first, the landmark is named or numbered: "left_knee_x", "Left Knee (x)", "x25",
"landmark_25_x", "L25_x". "world" among the words, or "wx" for x, says that metres are meant where the table
also has image landmarks: then these are left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from kinemimic.pipeline.kinematics.joint_names import joints_by_name
from kinemimic.pipeline.readers.base.column_names import words_of
from kinemimic.pipeline.readers.landmarks.blaze_pose import LANDMARKS, NUMBER
from kinemimic.pipeline.readers.landmarks.joint_sets import COUNTS

FIELDS: tuple[str, ...] = ("x", "y", "z", "visibility", "presence")
_FIELD_OF_WORD: dict[str, str] = {
    **{field: field for field in FIELDS},
    "vis": "visibility",
    "v": "visibility",
}
_WORLD_AXES: dict[str, str] = {f"w{axis}": axis for axis in "xyz"}
# Numbered landmarks beside these words are those of MediaPipe's other models.
_OTHER_MODELS = frozenset(("hand", "face", "left", "right"))
# Joints that a table of another sensor or network numbers.
_OTHER_COUNTS = COUNTS - {len(LANDMARKS)}
_MARK = "landmark"
_MARKS = frozenset(
    (_MARK, *(f"{_MARK}{word}" for word in ("id", "idx", "index", "no", "num", "number", "name")))
)
# Names of a table of landmarks in rows, of which one is wider than this many columns.
_MOST_NAMES = 20


@dataclass(frozen=True)
class _Name:
    """A column's name, taken apart. landmark: the words between, without the field and "world"."""

    landmark: tuple[str, ...]
    field: str
    world: bool

    @classmethod
    def of(cls, name: str) -> _Name | None:
        words = words_of(name)
        world = "world" in words
        words = [word for word in words if word != "world"]
        for at in (-1, 0):
            word = words[at] if words else ""
            field = _FIELD_OF_WORD.get(word) or _WORLD_AXES.get(word)
            if field is not None:
                words.pop(at)
                return cls(tuple(words), field, world or word in _WORLD_AXES)
        return None

    @property
    def number(self) -> int | None:
        """The number of a landmark that is called by it."""
        *words, last = self.landmark or ("",)
        is_number = last.isdecimal() and len(last) <= 2 and not any(word.isdecimal() for word in words)
        return int(last) if is_number and len(words) <= 2 and not _OTHER_MODELS.intersection(words) else None


def landmark_columns(names: Sequence[str]) -> dict[int, tuple[int, str]]:
    """Column -> the landmark's number and the field (one of FIELDS).

    Numbers that begin at 1 and end at 33, as in "x1" … "v33", are one too high.
    """
    parts = {column: part for column, name in enumerate(names) if (part := _Name.of(name)) is not None}
    numbers = {part.number for part in parts.values()}
    counted = len(numbers - {None})
    if counted in _OTHER_COUNTS and numbers - {None} == set(range(counted)):
        return {}
    first = 1 if len(LANDMARKS) in numbers and 0 not in numbers else 0
    found: dict[int, tuple[int, _Name]] = {}
    for column, part in parts.items():
        number = NUMBER.get("_".join(part.landmark))
        if number is None and part.number is not None:
            number = part.number - first
        if number is not None and 0 <= number < len(LANDMARKS):
            found[column] = number, part
    places = {column: (number, part.field) for column, (number, part) in found.items()}
    world = {column for column, (_, part) in found.items() if part.world}
    return {column: places[column] for column in _of_the_world(places, world)}


def names_pelvis(names: Sequence[str]) -> bool:
    """Whether a column is of a pelvis, which is none of MediaPipe's landmarks."""
    parts = (_Name.of(name) for name in names)
    return "hip_center" in joints_by_name(tuple({" ".join(part.landmark) for part in parts if part}))


def mark_column(names: Sequence[str]) -> int | None:
    """The column that says which landmark a row is, of a table with a landmark in a row; else None."""
    mark = next((k for k, name in enumerate(names) if "".join(words_of(name)) in _MARKS), None)
    is_long = set("xyz") <= field_columns(names).keys() and len(names) < _MOST_NAMES
    return mark if is_long else None


def field_columns(names: Sequence[str]) -> dict[str, int]:
    """Field -> its column, of a table with a landmark in a row."""
    parts = {column: part for column, name in enumerate(names) if (part := _Name.of(name)) is not None}
    places = {column: (0, part.field) for column, part in parts.items() if not part.landmark}
    world = {column for column in places if parts[column].world}
    return {places[column][1]: column for column in _of_the_world(places, world)}


def _of_the_world(places: dict[int, tuple[int, str]], world: set[int]) -> list[int]:
    """The columns to read: those of the world if there are any, and the visibility that they lack."""
    if not any(places[column][1] in "xyz" for column in world):
        return list(places)
    there = {places[column] for column in world}
    return [
        column
        for column, place in places.items()
        if column in world or (place[1] not in "xyz" and place not in there)
    ]
