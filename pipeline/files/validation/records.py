"""Records from TOML or JSON values, checked by msgspec; errors are one line with the file and the key."""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, TypeVar

import msgspec
from msgspec import inspect

from kinemimic.pipeline.errors import CaptureError

T = TypeVar("T")
# From the record to a value in it: keys of tables, and positions in lists from 0.
Steps = tuple[str | int, ...]

_DEEPEST = 32
_STEP = re.compile(r"\.([^.\[]+)|\[(\d+|\.\.\.)\]")
_FIELD = re.compile(r"Object (missing required|contains unknown) field `(.*)`", re.DOTALL)


class RecordError(ValueError):
    """A value that does not fit; `__post_init__` raises it, `convert` adds its place."""

    def __init__(self, *key: str | int, expected: str, found: str, advice: str | None = None) -> None:
        super().__init__(f"{dotted(key)}: expected {expected}, found {found}")
        self.key, self.expected, self.found, self.advice = key, expected, found, advice

    def of_file(self, path: Path | str, where: Callable[[Steps], str] | None = None) -> CaptureError:
        """The same error with its file; where: text for the place of a key, by default "key KEY"."""
        return CaptureError(
            path,
            where=where(self.key) if where else f"key {short(dotted(self.key))}" if self.key else None,
            expected=short(self.expected, 300),
            found=short(self.found),
            advice=None if self.advice is None else short(self.advice, 200),
        )


def convert(
    values: Any,
    kind: type[T],
    path: Path | str,
    *,
    complete: bool = False,
    within: Steps = (),
    where: Callable[[Steps], str] | None = None,
    advice: str | None = None,
) -> T:
    """The values of a TOML or JSON file as a dataclass or msgspec Struct.

    complete: whether every key must be there, also those with a default, as in records that the program
    wrote; within: key of the record in the file; where: see `RecordError.of_file`; advice: used
    where there is none closer. CaptureError for the first value that does not fit, and for whole numbers of
    more than 64 bits and deep nesting, which Python parses but cannot always print.
    """
    try:
        _check_size(values)
        try:
            made = msgspec.convert(values, kind)
        except msgspec.ValidationError as error:
            raise _explained(error, values, kind) from None
        _check_keys(values, made, complete)
    except RecordError as error:
        error.key = (*within, *error.key)
        error.advice = error.advice or advice
        raise error.of_file(path, where) from None
    return made


def one_of(choices: Sequence[str]) -> msgspec.Meta:
    """The constraint of a text that is one of several words, for choices that are not a Literal."""
    return msgspec.Meta(
        pattern=f"^(?:{'|'.join(map(re.escape, choices))})\\Z",
        description=f"one of {', '.join(choices)}",
        extra={"choices": tuple(choices)},
    )


def did_you_mean(word: object, choices: Sequence[str]) -> str | None:
    """Advice for a misspelt word."""
    near = difflib.get_close_matches(word, choices, n=1) if isinstance(word, str) else []
    return f"did you mean {near[0]!r}?" if near else None


def dotted(steps: Steps) -> str:
    """A key in messages, "force[1].at"; positions in lists are shown from 1."""
    text = "".join(f"[{step + 1}]" if isinstance(step, int) else f".{step}" for step in steps)
    return text.removeprefix(".")


def short(text: str, most: int = 80) -> str:
    """A text on one line, truncated to a length that fits into a message."""
    line = " ".join(text.split())
    return line if len(line) <= most else f"{line[: most - 2]} …"


def _check_size(value: Any, *key: str | int) -> None:
    if len(key) > _DEEPEST:
        # Dotted keys nest without limit; it is printing them that fails.
        raise RecordError(expected="a record", found="deep nesting")
    if isinstance(value, dict | list | tuple):
        for step, item in value.items() if isinstance(value, dict) else enumerate(value):
            _check_size(item, *key, step)
    elif isinstance(value, int) and not -(2**63) <= value < 2**63:
        found = f"one of some {1 + int(0.30103 * value.bit_length()):,} digits"
        raise RecordError(*key, expected="whole numbers from -2^63 to 2^63 - 1", found=found)


def _check_keys(values: Any, made: Any, complete: bool, *key: str | int) -> None:
    """Unknown keys, and missing ones if `complete`: Structs forbid unknown keys, dataclasses ignore them."""
    if isinstance(made, dict | list | tuple):
        for step, item in made.items() if isinstance(made, dict) else enumerate(made):
            _check_keys(values[step], item, complete, *key, step)
    elif isinstance(made, msgspec.Struct) and complete:
        if missing := [name for name in made.__struct_encode_fields__ if name not in values]:
            raise RecordError(*key, missing[0], expected="a value", found="none")
    elif is_dataclass(made):
        known = [field.name for field in fields(made)]
        if complete and (missing := [name for name in known if name not in values]):
            raise RecordError(*key, missing[0], expected="a value", found="none")
        for name, value in values.items():
            if name not in known:
                raise _unknown((*key, name), known)
            _check_keys(value, getattr(made, name), complete, *key, name)


def _unknown(key: Steps, known: Sequence[str]) -> RecordError:
    name, expected = key[-1], f"one of {', '.join(known)}"
    return RecordError(*key, expected=expected, found=repr(name), advice=did_you_mean(name, known))


def _explained(error: msgspec.ValidationError, values: Any, kind: Any) -> RecordError:
    """msgspec's error as ours.

    It gives the location of the value, and the type at that location gives the expected value.
    """
    text, at, location = str(error).rpartition(" - at `$")
    text, location = (text, location) if at else (location, "")
    steps: Steps = ()
    value, node = values, inspect.type_info(kind)
    for name, index in _STEP.findall(location.removesuffix("`")):
        step = name or (_culprit(values, steps, value, kind) if index == "..." else int(index))
        steps = (*steps, step)
        value, node = value[step], _inner(node, step)
    if isinstance(cause := error.__cause__, RecordError):
        cause.key = (*steps, *cause.key)
        return cause
    if field := _FIELD.fullmatch(text):
        key = (*steps, field[2])
        if field[1] == "contains unknown":
            return _unknown(key, [f.encode_name for one in _arms(node) for f in getattr(one, "fields", ())])
        return RecordError(*key, expected=_expected(_inner(node, field[2])), found="none")
    choices = [word for one in _arms(node) for word in getattr(one, "values", ())]
    for one in getattr(node, "types", (node,)):
        choices += (getattr(one, "extra", None) or {}).get("choices", ())
    advice = did_you_mean(value, choices)
    return RecordError(*steps, expected=_expected(node), found=repr(value), advice=advice)


def _culprit(values: Any, steps: Steps, table: dict[str, Any], kind: Any) -> str:
    """The key of the value that does not fit, in a table with arbitrary keys; msgspec does not report it."""

    def replaced(value: Any, path: Steps, item: Any) -> Any:
        if not path:
            return item
        copy = value.copy()
        copy[path[0]] = replaced(value[path[0]], path[1:], item)
        return copy

    for key, item in table.items():
        try:
            msgspec.convert(replaced(values, steps, {key: item}), kind)
        except msgspec.ValidationError:
            return key
    raise AssertionError("a table fails without a value that does")


def _arms(node: Any) -> list[Any]:
    """The types of a union, or the only type."""
    node = getattr(node, "type", node)
    return [arm for one in node.types for arm in _arms(one)] if hasattr(node, "types") else [node]


def _inner(node: Any, step: str | int) -> Any:
    """The type of the value at a key or position."""
    for one in _arms(node):
        for field in getattr(one, "fields", ()):
            if field.encode_name == step:
                return field.type
        if isinstance(step, int) and hasattr(one, "item_types"):
            return one.item_types[step]
        if inner := getattr(one, "item_type" if isinstance(step, int) else "value_type", None):
            return inner
    tags = [one.tag for one in _arms(node) if getattr(one, "tag_field", None) == step]
    return inspect.LiteralType(tuple(tags))


def _expected(node: inspect.Type) -> str:
    """A type in words: its description if it has one."""
    match node:
        case inspect.Metadata():
            words = (node.extra_json_schema or {}).get("description") or _expected(node.type)
        case inspect.UnionType():
            types = [one for one in node.types if not isinstance(one, inspect.NoneType)]
            words = " or ".join(map(_expected, types))
        case inspect.LiteralType():
            words = ("one of " if len(node.values) > 1 else "") + ", ".join(map(str, node.values))
        case inspect.IntType() | inspect.FloatType():
            words = "a whole number" if isinstance(node, inspect.IntType) else "a number"
            words += "".join(
                f" {word} {bound if isinstance(bound, int) else f'{bound:g}'}"
                for word, bound in (("from", node.ge), ("to", node.le))
                if bound is not None
            )
        case inspect.TupleType():
            words = f"{len(node.item_types)} numbers"
        case inspect.ListType() | inspect.VarTupleType():
            words = "a list" if node.max_length is None else f"a list of at most {node.max_length}"
        case inspect.DictType() if not isinstance(node.value_type, inspect.AnyType):
            words = f"a table with {_expected(node.value_type)} under each key"
        case inspect.StructType() if len(node.fields) < 4:
            words = f"a table of {' and '.join(field.encode_name for field in node.fields)}"
        case _:
            words = {"BoolType": "true or false", "StrType": "text in quotes"}.get(
                type(node).__name__, "a table"
            )
    return str(words)
