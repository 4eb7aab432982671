"""What a node's simulation depends on, so that nodes whose results would differ are told apart."""

from __future__ import annotations

import platform
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.train.sim.engines import resolve

_CPU = Path("/proc/cpuinfo")
# Extensions that compilers and numerical libraries choose their code by; the other flags, such as those of a
# hypervisor, change no result.
_CHOSEN_BY = ("sse", "ssse", "avx", "fma", "f16c", "bmi", "amx", "asimd", "sve", "neon")


@dataclass(frozen=True)
class NodeIdentity:
    """versions: of Python and the packages that compute; native: the native engine's interface and precision,
    None with pybullet; processor: its architecture and those of its extensions that change results."""

    versions: tuple[tuple[str, str], ...]
    native: str | None
    processor: tuple[str, ...]

    @classmethod
    def here(cls, engine: str) -> NodeIdentity:
        """Of this machine. KinemimicError if the engine is not installed."""
        packages = ["kinemimic", "numpy", "scipy"]
        native = None
        if resolve(engine) == "native":
            import kinemimic_native  # noqa: PLC0415 (may not be built)

            packages.append("kinemimic-native")
            precision = "double" if kinemimic_native.double_precision else "single"
            native = f"interface {kinemimic_native.interface}, {precision} precision"
        else:
            packages.append("pybullet")
        versions = (("python", platform.python_version()), *((name, _version(name)) for name in packages))
        return cls(versions, native, (platform.machine(), *_extensions()))

    def require(self, found: NodeIdentity, node: str) -> None:
        """KinemimicError if the node `found` would not compute what this one does."""
        for (name, wanted), (_, other) in zip(self.versions, found.versions, strict=True):
            if wanted != other:
                raise KinemimicError(
                    f"node {node}: expected {name} {wanted} as on the driver, found {other}; install the "
                    "same versions on every node"
                )
        if self.native != found.native:
            raise KinemimicError(
                f"node {node}: expected the native engine with {self.native} as on the driver, found "
                f"{found.native}; build it there with `make setup`"
            )
        if missing := set(self.processor) ^ set(found.processor):
            lacking = sorted(missing - set(found.processor))
            added = sorted(missing - set(self.processor))
            differs = ", ".join([*(f"no {flag}" for flag in lacking), *added])
            raise KinemimicError(
                f"node {node}: expected a processor like the driver's, found another ({differs}); "
                "results would differ in the last bits: use nodes of one kind"
            )


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "none"


def _extensions() -> tuple[str, ...]:
    """Sorted extensions of the first processor; none where the system does not list them."""
    if not _CPU.exists():
        return ()
    for line in _CPU.read_text().splitlines():
        name, _, flags = line.partition(":")
        if name.strip() in ("flags", "Features"):
            return tuple(sorted(flag for flag in flags.split() if flag.startswith(_CHOSEN_BY)))
    return ()
