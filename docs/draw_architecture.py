"""Draw docs/architecture.svg: the packages and the imports between them.

`make architecture` runs this script; tests/docs/test_architecture.py fails if the picture is out of date. A
package is drawn above every package that it imports. Within a folder, only the transitive reduction of the
imports is drawn; between folders, only their direction.
"""

from __future__ import annotations

import sys
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from html import escape
from pathlib import Path

import grimp

FOLDERS = ("evaluate", "train", "retarget", "pipeline")
OUTPUT = Path(__file__).with_name("architecture.svg")
# Pixels.
_BOX, _HEIGHT, _GAP, _ROW, _HEAD, _MARGIN = 160, 38, 10, 62, 42, 34

Imports = dict[str, set[str]]


def package_of(module: str) -> str:
    """The package of a module: its folder below `kinemimic`, so that `kinemimic.pipeline.gait.events` is in
    `pipeline/gait`. Of `pipeline`'s own modules some are the lowest and some the highest: each stands alone.
    """
    parts = module.split(".")[1:]
    return "/".join(parts if parts[0] == "pipeline" and len(parts) < 3 else parts[:-1])


def packages() -> tuple[Counter[str], Imports]:
    """Modules in each package, and the packages that each package imports."""
    graph = grimp.build_graph("kinemimic", cache_dir=None)
    inside = tuple(f"kinemimic.{folder}." for folder in FOLDERS)
    modules = [name for name in graph.modules if name.startswith(inside) and not graph.find_children(name)]
    imports: Imports = defaultdict(set)
    for name in modules:
        for imported in graph.find_modules_directly_imported_by(name):
            if package_of(name) != package_of(imported):
                imports[package_of(name)].add(package_of(imported))
    return Counter(package_of(name) for name in modules), imports


def cycle(imports: Mapping[str, Iterable[str]]) -> list[str]:
    """Packages that import each other in a ring, or an empty list."""
    done: set[str] = set()

    def visit(package: str, path: tuple[str, ...]) -> list[str]:
        if package in path:
            return [*path[path.index(package) :], package]
        if package not in done:
            for imported in sorted(imports.get(package, ())):
                if found := visit(imported, (*path, package)):
                    return found
            done.add(package)
        return []

    for package in sorted(imports):
        if found := visit(package, ()):
            return found
    return []


def reduced(imports: Mapping[str, set[str]]) -> Imports:
    """Without the imports that a longer way implies."""
    reach: Imports = {}

    def below(package: str) -> set[str]:
        if package not in reach:
            direct = imports.get(package, set())
            reach[package] = set(direct).union(*(below(other) for other in direct))
        return reach[package]

    return {
        package: {one for one in direct if not any(one in below(other) for other in direct - {one})}
        for package, direct in imports.items()
    }


def levels(names: Iterable[str], imports: Mapping[str, set[str]]) -> list[list[str]]:
    """Rows of packages, highest first: a package's row is its longest way down to one that imports none."""
    depth: dict[str, int] = {}

    def deep(package: str) -> int:
        if package not in depth:
            depth[package] = 1 + max((deep(other) for other in imports.get(package, ())), default=-1)
        return depth[package]

    rows: dict[int, list[str]] = defaultdict(list)
    for name in sorted(names):
        rows[deep(name)].append(name)
    return [rows[level] for level in sorted(rows, reverse=True)]


def svg() -> str:
    """The whole picture: a column for each folder, each importing from those to its right."""
    sizes, imports = packages()
    boxes: list[str] = []
    lines: list[str] = []
    left = bottom = 0.0
    columns: list[tuple[str, float, float]] = []
    for folder in FOLDERS:
        names = [name for name in sizes if name.split("/")[0] == folder]
        inside = {name: {o for o in imports.get(name, ()) if o.split("/")[0] == folder} for name in names}
        rows = levels(names, inside)
        width = max(len(row) for row in rows) * (_BOX + _GAP) + _GAP
        columns.append((folder, left, width))
        places: dict[str, tuple[float, float]] = {}
        for level, row in enumerate(rows):
            first = left + (width - len(row) * (_BOX + _GAP) + _GAP) / 2
            for k, name in enumerate(row):
                x, y = first + k * (_BOX + _GAP), _HEAD + level * _ROW
                places[name] = (x + _BOX / 2, y)
                label = name.removeprefix(f"{folder}/") if "/" in name else "(stage)"
                count = f"{sizes[name]} modules" if sizes[name] > 1 else "1 module"
                boxes.append(
                    f'<rect x="{x:.0f}" y="{y}" width="{_BOX}" height="{_HEIGHT}" rx="5" class="package"/>'
                    f'<text x="{x + _BOX / 2:.0f}" y="{y + 17}" class="name">{escape(label)}</text>'
                    f'<text x="{x + _BOX / 2:.0f}" y="{y + 31}" class="size">{count}</text>'
                )
        for name, direct in sorted(reduced(inside).items()):
            for other in sorted(direct):
                (x0, y0), (x1, y1) = places[name], places[other]
                lines.append(f'<path d="M{x0:.0f} {y0 + _HEIGHT} L{x1:.0f} {y1}" class="import"/>')
        left += width + _MARGIN
        bottom = max(bottom, _HEAD + len(rows) * _ROW)
    frames = [
        f'<rect x="{x:.0f}" y="4" width="{width:.0f}" height="{bottom:.0f}" rx="8" class="folder"/>'
        f'<text x="{x + 12:.0f}" y="28" class="title">{folder}/</text>'
        for folder, x, width in columns
    ]
    frames += [
        f'<path d="M{x + width + 3:.0f} {bottom / 2:.0f} h{_MARGIN - 12}" class="down"/>'
        for _, x, width in columns[:-1]
    ]
    lines = [*frames, *lines]
    style = (
        "text{font-family:sans-serif;text-anchor:middle;fill:#1f2933}.name{font-size:11.5px;font-weight:600}"
        ".size{font-size:10px;fill:#52606d}.title{font-size:16px;font-weight:700;text-anchor:start}"
        ".folder{fill:#f5f7fa;stroke:#cbd2d9}.package{fill:#fff;stroke:#3e6b8f;stroke-width:1.3}"
        ".import{stroke:#829ab1;stroke-width:1;fill:none}.down{stroke:#334e68;stroke-width:3;marker-end:url(#tip)}"
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="-4 0 {left - _MARGIN + 8:.0f} {bottom + 10:.0f}" '
        'role="img" aria-label="Packages of kinemimic and the imports between them">'
        f'<style>{style}</style><defs><marker id="tip" viewBox="0 0 6 6" refX="3" refY="3" markerWidth="3" '
        'markerHeight="3" orient="auto"><path d="M0 0 L6 3 L0 6 z" fill="#334e68"/></marker></defs>\n'
        + "\n".join([*lines, *boxes])
        + "\n</svg>\n"
    )


def main() -> int:
    """Write the picture, or with --check say whether it is up to date."""
    picture = svg()
    if sys.argv[1:] == ["--check"]:
        return int(not OUTPUT.exists() or OUTPUT.read_text() != picture)
    OUTPUT.write_text(picture)
    return 0


if __name__ == "__main__":
    sys.exit(main())
