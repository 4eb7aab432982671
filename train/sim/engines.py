"""Which engine simulates: the native one where it is built, pybullet everywhere."""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.train.sim.world import World

ENGINES = ("auto", "native", "pybullet")
_INTERFACE = 3  # of train/native/module.cpp


@cache
def _native_trouble() -> str | None:
    """Why the native engine cannot be had, or None."""
    if find_spec("kinemimic_native") is None:
        return "it is not built: `make setup` builds it where there is a C++ compiler"
    try:
        import kinemimic_native  # noqa: PLC0415 (whether it is built, and loads, shows only here)
    except ImportError as error:
        return str(error)
    if getattr(kinemimic_native, "interface", None) != _INTERFACE:
        return "it is built for another version: `make setup` builds it anew"
    return None


def resolve(engine: str) -> str:
    """The engine that `engine` means on this machine: "native" or "pybullet"."""
    if engine not in ENGINES:
        raise KinemimicError(f"expected an engine among {', '.join(ENGINES)}, found {engine!r}")
    if engine == "auto":
        return "pybullet" if _native_trouble() else "native"
    if engine == "native" and (trouble := _native_trouble()):
        raise KinemimicError(f"expected the native engine, found that {trouble}; or take --engine pybullet")
    return engine


def open_world(size: int, engine: str = "auto", *, threads: int = 1, measure_torques: bool = False) -> World:
    """A world of `size` figures. threads: of the native engine; measure_torques: for `peak_torques`."""
    if resolve(engine) == "native":
        from kinemimic.train.sim.native_world import NativeWorld  # noqa: PLC0415 (may not be built)

        return NativeWorld(size, threads=threads)
    from kinemimic.train.sim.pybullet_world import BulletWorld  # noqa: PLC0415 (loads what the other needs not)

    return BulletWorld(size, measure_torques=measure_torques)
