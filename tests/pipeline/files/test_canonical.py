"""Canonical arrays: equal content gives equal bytes, and differences below the rounding vanish."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.canonical import Canonical

VALUES = arrays(np.float64, (4, 2, 3), elements=st.floats(-1e3, 1e3) | st.just(float("nan")))


@given(VALUES)
@settings(deadline=None)  # it writes files
def test_what_is_written_is_read(tmp_path_factory: pytest.TempPathFactory, values: np.ndarray) -> None:
    path = tmp_path_factory.mktemp("arrays") / "one.json"
    one = Canonical.of("clip", ("a", "b"), {"positions": values, "rate": 30.0}, {"a": [1]})
    one.write(path)
    again = Canonical.read(path)
    assert again.identity == one.identity
    np.testing.assert_array_equal(again.arrays["positions"], one.arrays["positions"])
    np.testing.assert_allclose(again.arrays["positions"], values, atol=0.5e-5 + 1e-12)
    content = path.read_bytes()
    again.write(path)
    assert path.read_bytes() == content


def test_signs_of_nothing_are_no_content() -> None:
    plus, minus = np.array([[0.0, np.nan, 1e-9]]), np.array([[-0.0, -np.nan, -1e-9]])
    assert np.signbit(minus[0, 1]) != np.signbit(plus[0, 1])
    one, other = (Canonical.of("clip", (), {"x": array}, {}) for array in (plus, minus))
    assert one.identity == other.identity


def test_a_frame_is_a_line_and_a_gap_is_null(tmp_path: Path) -> None:
    values = np.array([[0.123456, 2.0], [np.nan, -1.000004]])
    Canonical.of("clip", (), {"x": values}, {}).write(tmp_path / "one.json")
    text = (tmp_path / "one.json").read_text()
    assert "      [0.12346, 2],\n      [null, -1]\n" in text
    assert json.loads(text)["decimals"] == 5


def test_any_number_name_or_joint_is_content() -> None:
    base = Canonical.of("clip", ("a",), {"x": np.zeros((2, 1))}, {})
    others = (
        Canonical.of("clip", ("a",), {"x": np.full((2, 1), 1e-5)}, {}),
        Canonical.of("clip", ("b",), {"x": np.zeros((2, 1))}, {}),
        Canonical.of("motion", ("a",), {"x": np.zeros((2, 1))}, {}),
        Canonical.of("clip", ("a",), {"y": np.zeros((2, 1))}, {}),
        Canonical.of("clip", ("a",), {"x": np.zeros((1, 2))}, {}),
        Canonical.of("clip", ("a",), {"x": np.zeros((2, 1))}, {"simulated": True}),
    )
    assert len({one.identity for one in (base, *others)}) == 1 + len(others)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[]", "expected kinemimic.arrays, found None"),
        ('{"format": "kinemimic.arrays", "schema": 9}', "expected arrays of schema 1, found 9"),
        ('{"format": "kinemimic.arrays", "schema": 1}', "found 'arrays'"),
        (
            '{"format": "kinemimic.arrays", "schema": 1, "kind": "", "joints": [], "arrays": {"x": ["a"]}}',
            "could not convert",
        ),
    ],
)
def test_another_file_is_one_line(text: str, told: str, tmp_path: Path) -> None:
    (tmp_path / "one.json").write_text(text)
    with pytest.raises(KinemimicError, match=told):
        Canonical.read(tmp_path / "one.json")
