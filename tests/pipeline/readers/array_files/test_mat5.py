"""MAT-files that scipy writes, and its own reader as the other opinion."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
from samples.matlab_markers import cells, saved
from scipy.io import loadmat

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.readers.array_files import mat5
from kinemimic.pipeline.readers.base.source import Source

# Files of MATLAB 6.1 (big-endian) to 7.4 for scipy's own tests; others are damaged, or of functions.
DATA = Path(scipy.io.__file__).parent / "matlab" / "tests" / "data"
OF_MATLAB = [
    path
    for kind in ("3dmatrix", "cell", "cellnest", "complex", "double", "emptycell", "matrix", "minus", "multi",
                 "onechar", "simplecell", "string", "stringarray", "struct", "structarr", "structnest",
                 "unicode")
    for path in sorted(DATA.glob(f"test{kind}_*.mat"))
    if "_4" not in path.stem
]  # fmt: skip
RANDOM = np.random.default_rng(0)
VARIABLES: dict[str, Any] = {
    **{
        f"of_{dtype}": (100.0 * RANDOM.random((3, 4, 5))).astype(dtype)
        for dtype in ("f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8")
    },
    "scalar": 3.5,
    "row": np.arange(4.0),
    "words": "a walk, à pied",
    "lines": np.array(["one", "three"]),
    "names": cells(["LASI", "RASI"]),
    "nested": {"inner": {"rate": 100.0, "labels": cells(["a", "b"])}, "empty": np.zeros((0, 3))},
}


def source(content: bytes) -> Source:
    return Source(Path("x.mat"), content, "")


@pytest.mark.parametrize("compressed", [True, False])
def test_values_are_those_that_were_saved(compressed: bool) -> None:
    content = saved(**VARIABLES, compressed=compressed)
    found = mat5.variables(source(content), VARIABLES)
    for name, value in loadmat(io.BytesIO(content)).items():
        if isinstance(value, np.ndarray) and value.dtype.kind in "fiu":
            assert found[name].dtype == value.dtype
            np.testing.assert_array_equal(found[name], value)
    assert found["words"] == VARIABLES["words"]
    assert mat5.texts(found["lines"]) == ("one", "three")
    assert mat5.texts(found["names"]) == ("LASI", "RASI")
    assert mat5.field(found["nested"], "inner", "rate") == 100.0
    assert mat5.texts(mat5.field(found["nested"], "inner", "labels")) == ("a", "b")
    assert mat5.field(found["nested"], "empty").shape == (0, 3)
    assert mat5.field(found["nested"], "inner", "other", "more") is None
    assert mat5.variables(source(content), ["absent"]) == {}


def plain(value: Any) -> Any:
    """What scipy's reader gives, in the form of ours; None for what ours does not read."""
    if not isinstance(value, np.ndarray) or value.dtype.kind == "c" or type(value) is not np.ndarray:
        return None
    if value.dtype.names:
        rows = [{name: plain(one[name]) for name in value.dtype.names} for one in value.flatten("F")]
        return rows[0] if value.size == 1 else rows
    if value.dtype == object:
        return [plain(one) for one in value.flatten("F")]
    if value.dtype.kind == "U":
        lines = [str(one).rstrip() if len(value) > 1 else str(one) for one in value.ravel()]
        return lines if len(lines) > 1 else "".join(lines)
    return value


def equal(ours: Any, theirs: Any) -> bool:
    if isinstance(theirs, dict):
        return ours.keys() == theirs.keys() and all(equal(ours[key], theirs[key]) for key in theirs)
    if isinstance(theirs, list):
        return len(ours) == len(theirs) and all(map(equal, ours, theirs))
    if isinstance(theirs, np.ndarray) and theirs.size:
        return ours.shape == theirs.shape and np.array_equal(ours, theirs)
    return ours is None or np.size(ours) == 0 or ours == theirs


@pytest.mark.skipif(not OF_MATLAB, reason="this build of scipy has no files of MATLAB for its tests")
@pytest.mark.parametrize("path", OF_MATLAB, ids=lambda path: path.stem)
def test_files_that_matlab_wrote(path: Path) -> None:
    content = path.read_bytes()
    theirs = {name: value for name, value in loadmat(path).items() if not name.startswith("__")}
    ours = mat5.variables(source(content), theirs)
    assert ours.keys() == theirs.keys()
    for name, value in theirs.items():
        assert equal(ours[name], plain(value)), name


@pytest.mark.parametrize("compressed", [True, False])
def test_heads_tell_shapes_kinds_and_fields(compressed: bool) -> None:
    heads = mat5.heads(source(saved(**VARIABLES, compressed=compressed)))
    assert list(heads) == list(VARIABLES)
    assert heads["of_f4"] == mat5.Head((3, 4, 5), "number")
    assert heads["nested"] == mat5.Head((1, 1), "struct", ("inner", "empty"))
    assert (heads["names"].kind, heads["words"].kind) == ("cell", "char")


def test_an_array_of_structures_and_what_is_no_number() -> None:
    people = np.zeros((1, 2), dtype=[("name", object), ("height", object)])
    people[0, 0], people[0, 1] = ("A", 1.7), ("B", 1.8)
    content = saved(people=people, wave=np.array([1.0 + 2.0j]))
    found = mat5.variables(source(content), ["people"])["people"]
    assert [(one["name"], float(one["height"][0, 0])) for one in found] == [("A", 1.7), ("B", 1.8)]
    assert mat5.field(found, "name") == "A"
    assert mat5.variables(source(content), ["wave"])["wave"] is None


def test_big_endian() -> None:
    matrix = b"".join([
        element(6, struct.pack(">II", 6, 0), ">"),
        element(5, struct.pack(">ii", 2, 2), ">"),
        element(1, b"a", ">"),
        element(9, struct.pack(">4d", 1.0, 2.0, 3.0, 4.0), ">"),
    ])  # fmt: skip
    header = mat5.MARK.ljust(124) + b"\x01\x00MI"
    found = mat5.variables(source(header + element(14, matrix, ">")), ["a"])["a"]
    np.testing.assert_array_equal(found, [[1.0, 3.0], [2.0, 4.0]])


@pytest.mark.parametrize("compressed", [True, False])
def test_a_file_that_is_cut_off(compressed: bool) -> None:
    content = saved(values=RANDOM.random((50, 20)), compressed=compressed)
    with pytest.raises(CaptureError, match="expected a whole MAT-file, found damage"):
        mat5.variables(source(content[: len(content) // 2]), ["values"])
    assert mat5.heads(source(content[:140])) == {}


def test_nesting_has_a_limit() -> None:
    value: Any = 1.0
    for _ in range(40):
        value = {"a": value}
    content = saved(value=value)
    with pytest.raises(CaptureError, match="too deep"):
        mat5.variables(source(content), ["value"])


def test_a_variable_that_unpacks_to_more_than_the_limit_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mat5, "MAX_BYTES", 2**20)
    content = saved(zeros=np.zeros(2**18))
    assert len(content) < 2**13
    with pytest.raises(CaptureError, match="at most 1 MB of markers or joints, found more"):
        mat5.variables(source(content), ["zeros"])


def test_only_what_is_wanted_is_unpacked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mat5, "MAX_BYTES", 2**20)
    content = saved(first=np.zeros(2**18), wanted=np.ones(3), last=np.zeros(2**18))
    assert mat5.variables(source(content[:-40]), ["wanted"])["wanted"].tolist() == [[1.0, 1.0, 1.0]]


def test_the_first_variable_of_a_name_counts() -> None:
    text, numbers = saved(a="walk"), saved(a=np.ones((2, 3)))
    content = source(text + numbers[128:])
    assert mat5.heads(content)["a"].kind == "char"
    assert mat5.variables(content, ["a"]) == {"a": "walk"}


def element(kind: int, data: bytes, order: str = "<") -> bytes:
    return struct.pack(order + "II", kind, len(data)) + data + bytes(-len(data) % 8)


def test_objects_of_matlab_are_passed_over() -> None:
    """A `string`: flags of class 17, the variable's name, and what only MATLAB knows."""
    inside = element(6, struct.pack("<II", 17, 0)) + element(1, b"s") + element(1, b"MCOS")
    content = saved(a=np.ones(2), compressed=False)
    content = content[:128] + element(14, inside + element(1, b"string")) + content[128:]
    assert mat5.heads(source(content))["s"].kind == ""
    assert mat5.variables(source(content), ["s", "a"])["s"] is None
    assert mat5.variables(source(content), ["a"])["a"].tolist() == [[1.0, 1.0]]


def test_lines_of_text_that_claim_more_than_there_is() -> None:
    content = bytearray(saved(text="walk", compressed=False))
    at = content.index(struct.pack("<ii", 1, 4))
    content[at : at + 8] = struct.pack("<ii", 2**28, 4)
    with pytest.raises(CaptureError, match="more than 1,000,000 values"):
        mat5.variables(source(bytes(content)), ["text"])


def test_zeros_behind_the_variables_are_not_read() -> None:
    content = source(saved(a=np.ones(2)) + bytes(2**24))
    assert list(mat5.heads(content)) == ["a"]


def test_cells_that_claim_more_than_there_is() -> None:
    content = bytearray(saved(names=cells(["a", "b"]), compressed=False))
    at = content.index(struct.pack("<ii", 1, 2))
    content[at : at + 8] = struct.pack("<ii", 2**15, 2**15)
    with pytest.raises(CaptureError, match="more than 1,000,000 values"):
        mat5.variables(source(bytes(content)), ["names"])


def test_other_files_have_no_heads() -> None:
    assert mat5.heads(source(zlib.compress(b"anything"))) == {}
