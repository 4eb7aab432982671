"""Choice of the simulation engine: native where it is built, else pybullet."""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.parallel.node_identity import NodeIdentity, package_version
from kinemimic.train.sim.world import World

ENGINES = ("auto", "native", "pybullet")
_INTERFACE = 6  # of train/native/module.cpp


@cache
def _native_trouble() -> str | None:
    """Why the native engine cannot be used, or None."""
    if find_spec("kinemimic_native") is None:
        return "it is not built: `make setup` builds it with a C++ compiler"
    try:
        import kinemimic_native  # noqa: PLC0415 (only the import shows whether it loads)
    except ImportError as error:
        return str(error)
    if getattr(kinemimic_native, "interface", None) != _INTERFACE:
        return "it was built for another version: `make setup` rebuilds it"
    return None


def resolve(engine: str) -> str:
    """The engine, "native" or "pybullet", for an option's value on this machine; KinemimicError if
    unavailable."""
    if engine not in ENGINES:
        raise KinemimicError(f"expected an engine among {', '.join(ENGINES)}, found {engine!r}")
    trouble = _native_trouble()
    if engine == "auto":
        engine = "pybullet" if trouble else "native"
    elif engine == "native" and trouble:
        raise KinemimicError(f"expected the native engine, found that {trouble}; or use --engine pybullet")
    if engine == "pybullet" and find_spec("pybullet") is None:
        native = f"the native engine cannot be used either ({trouble})" if trouble else "use --engine native"
        raise KinemimicError(f"expected pybullet, found none: its wheels end at Python 3.11; {native}")
    return engine


def open_world(size: int, engine: str = "auto", *, threads: int = 1, measure_torques: bool = False) -> World:
    """A world of `size` humanoids. threads: of the native engine; measure_torques: for `peak_torques`."""
    if resolve(engine) == "native":
        from kinemimic.train.sim.native_world import NativeWorld  # noqa: PLC0415 (may not be built)

        return NativeWorld(size, threads=threads)
    from kinemimic.train.sim.pybullet_world import BulletWorld  # noqa: PLC0415 (import cost)

    return BulletWorld(size, measure_torques=measure_torques)


def engine_identity(engine: str) -> NodeIdentity:
    """What a simulation with this engine depends on, on this machine; KinemimicError without the engine."""
    if resolve(engine) == "pybullet":
        return NodeIdentity.here({"pybullet": package_version("pybullet")})
    import kinemimic_native  # noqa: PLC0415 (may not be built)

    precision = "double" if kinemimic_native.double_precision else "single"
    return NodeIdentity.here(
        {
            "kinemimic-native": package_version("kinemimic-native"),
            "the native engine with interface": f"{kinemimic_native.interface}, {precision} precision",
        }
    )
