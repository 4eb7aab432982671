"""What a node's results depend on besides its tasks, to refuse nodes whose results would differ."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from kinemimic.pipeline.errors import KinemimicError

_CPU = Path("/proc/cpuinfo")
_PACKAGES = ("kinemimic", "numpy", "scipy", "pandas", "pyarrow")
# Extensions that compilers and numerical libraries choose their code by; the other flags, such as those of a
# hypervisor, change no result.
_CHOSEN_BY = ("sse", "ssse", "avx", "fma", "f16c", "bmi", "amx", "asimd", "sve", "neon")


@dataclass(frozen=True)
class NodeIdentity:
    """versions: of Python and of what computes, by name; processor: its architecture, and those of its
    extensions that change results."""

    versions: tuple[tuple[str, str], ...]
    processor: tuple[str, ...]

    @classmethod
    def here(cls, further: Mapping[str, str] | None = None) -> NodeIdentity:
        """Of this machine; further: versions of what else computes."""
        packages = {name: package_version(name) for name in _PACKAGES}
        versions = {"python": platform.python_version(), **packages, **(further or {})}
        return cls(tuple(versions.items()), (platform.machine(), *_extensions()))

    def require(self, found: NodeIdentity, node: str) -> None:
        """KinemimicError if the node `found` would not compute what this one does."""
        there = dict(found.versions)
        for name, wanted in self.versions:
            if there.get(name) != wanted:
                raise KinemimicError(
                    f"node {node}: expected {name} {wanted} as on the driver, found {there.get(name)}; "
                    "install the same versions on every node"
                )
        lacking = sorted(set(self.processor) - set(found.processor))
        added = sorted(set(found.processor) - set(self.processor))
        if lacking or added:
            raise KinemimicError(
                f"node {node}: expected a processor like the driver's, found another "
                f"({', '.join([*(f'no {flag}' for flag in lacking), *added])}); results would differ in "
                "the last bits: use nodes of one kind"
            )


def package_version(package: str) -> str:
    """The version of an installed package, or "none"."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "none"


@cache
def _extensions() -> tuple[str, ...]:
    """Sorted extensions of the first processor; none where the system does not list them."""
    if not _CPU.exists():
        return ()
    for line in _CPU.read_text().splitlines():
        name, _, flags = line.partition(":")
        if name.strip() in ("flags", "Features"):
            return tuple(sorted(flag for flag in flags.split() if flag.startswith(_CHOSEN_BY)))
    return ()
