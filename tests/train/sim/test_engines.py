"""The engine is the requested one, or one line says why not."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from types import ModuleType

import pytest

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.train.sim import engines


@pytest.fixture(autouse=True)
def fresh() -> Iterator[None]:
    engines._native_trouble.cache_clear()
    yield
    engines._native_trouble.cache_clear()


def test_auto_selects_native_where_it_is_built(monkeypatch: pytest.MonkeyPatch) -> None:
    native = ModuleType("kinemimic_native")
    native.interface = engines._INTERFACE  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "kinemimic_native", native)
    monkeypatch.setattr(engines, "find_spec", lambda name: name)
    assert [engines.resolve(name) for name in engines.ENGINES] == ["native", "native", "pybullet"]


def test_auto_falls_back_to_pybullet(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engines, "find_spec", lambda name: None if name == "kinemimic_native" else name)
    assert engines.resolve("auto") == "pybullet"
    with pytest.raises(KinemimicError, match=r"not built: `make setup`.*; or use --engine pybullet"):
        engines.resolve("native")


def test_without_any_engine_one_line_says_what_to_build(monkeypatch: pytest.MonkeyPatch) -> None:
    """As with Python 3.12, for which pybullet has no wheel."""
    monkeypatch.setattr(engines, "find_spec", lambda name: None)
    for engine in ("auto", "pybullet"):
        with pytest.raises(KinemimicError, match=r"expected pybullet, found none.* `make setup` builds it"):
            engines.resolve(engine)


def test_an_extension_of_another_version_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "kinemimic_native", ModuleType("kinemimic_native"))
    monkeypatch.setattr(engines, "find_spec", lambda name: name)
    assert engines.resolve("auto") == "pybullet"
    with pytest.raises(KinemimicError, match="another version"):
        engines.resolve("native")


def test_an_unknown_engine_is_named() -> None:
    with pytest.raises(KinemimicError, match="auto, native, pybullet, found 'mujoco'"):
        engines.resolve("mujoco")
