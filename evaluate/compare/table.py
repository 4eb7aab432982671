"""Results of a comparison: metrics of each cell, medians over the seeds, CSV, and tables for a terminal."""

from __future__ import annotations

import csv
import io
import statistics
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rich.console import RenderableType

from kinemimic.evaluate.compare.learning_curves import aggregated, converged_at
from kinemimic.pipeline.cli.terminal import grid, heading, number

Row = Mapping[str, Any]
_KEY = ("task", "variant", "budget")
_DECIMALS = 6
_CURVES = ("reward", "critic_loss")  # of the evaluations during training


def metrics(record: Row, scores: Row) -> dict[str, float | None]:
    """Metrics of one policy, from its policy.json and scores.json; None where one is undefined.

    frames: survived from phase 0; phases: start phases without a fall; …_r2: from phase 0, with no credit
    after a fall (`r2_upright`); …_gap_deg: largest gap; capture_…: against the capture as read; return: of
    the best evaluation, as a share of the maximum; converged_samples: samples after which the return stays
    near its maximum (`learning_curves.py`); seconds: of training.
    """
    survival, fit, root = scores["survival"], scores["fit"], scores["root"]
    capture, walk = scores["fit_capture"], record["first_walk"]
    return {
        "frames": survival["frames"],
        "of": survival["of"],
        "phases": survival["phases"],
        "phases_of": survival["phases_of"],
        **{f"{joint}_r2": fit[joint]["r2_upright"] for joint in ("knee", "hip")},
        **{f"{joint}_gap_deg": fit[joint]["max_gap_deg"] for joint in ("knee", "hip")},
        "speed_ratio": root["speed_ratio"],
        "end_off_m": root["path_error_m"],
        "return": round(record["best"]["reward"], _DECIMALS),
        "converged_samples": converged_at(
            [one["samples"] for one in record["evaluations"]],
            [one["reward"] for one in record["evaluations"]],
        ),
        "first_walk_samples": walk and walk["samples"],
        "first_walk_seconds": walk and walk["seconds"],
        **{f"capture_{joint}_r2": capture and capture[joint]["r2_upright"] for joint in ("knee", "hip")},
        "kept_samples": record["best"]["samples"],
        "samples": record["samples"],
        "seconds": record["seconds"],
    }


def summary(cells: Sequence[Row]) -> list[dict[str, Any]]:
    """Per task, variant and budget: median, minimum and maximum of each metric over the seeds.

    seeds: number of seeds; n: number of seeds for which the metric is defined.
    """
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for cell in cells:
        groups.setdefault(tuple(cell[name] for name in _KEY), []).append(cell)
    named = (*_KEY, "seed", "engine")
    return [
        {
            **dict(zip(_KEY, key, strict=True)),
            "seeds": len(group),
            "metrics": {
                name: _spread([cell[name] for cell in group if cell[name] is not None])
                for name in group[0]
                if name not in named
            },
        }
        for key, group in groups.items()
    ]


def _spread(values: Sequence[float]) -> dict[str, Any]:
    if not values:
        return {"median": None, "min": None, "max": None, "n": 0}
    return {
        "median": round(statistics.median(values), _DECIMALS),
        "min": min(values),
        "max": max(values),
        "n": len(values),
    }


def curves(records: Mapping[tuple[str, str], Sequence[Row]]) -> list[dict[str, Any]]:
    """Per task and variant, over the samples: return and critic loss of the evaluations of all seeds.

    records: per seed, the policy.json of its largest budget.
    """
    return [
        {
            "task": task,
            "variant": variant,
            **{key: aggregated(seeds, key) for key in _CURVES},
        }
        for (task, variant), seeds in records.items()
    ]


def table_csv(cells: Sequence[Row]) -> str:
    """One line per cell and budget; undefined values are empty."""
    stream = io.StringIO()
    writer = csv.DictWriter(stream, list(cells[0]) if cells else ["task"], lineterminator="\n")
    writer.writeheader()
    writer.writerows(cells)
    return stream.getvalue()


def tables(comparison: Row) -> Iterator[RenderableType]:
    """Headings and tables, one set per task and budget. comparison: the content of compare.json."""
    pairs = dict.fromkeys((row["task"], row["budget"]) for row in comparison["summary"])
    for task, budget in pairs:
        rows = [row for row in comparison["summary"] if (row["task"], row["budget"]) == (task, budget)]
        info = comparison["tasks"][task]
        simulated = ", SIMULATED CAPTURE" if info["simulated"] else ""
        yield heading(f"{task}{simulated}, {budget:,} samples; medians over the seeds")
        yield from _cyclic(rows, info) if info["cyclic"] else (_single(rows),)


def _single(rows: Sequence[Row]) -> RenderableType:
    """The table of a non-cyclic motion."""
    table = grid("", "seeds", "frames", "min", "return %", "min")
    for row in rows:
        of = row["metrics"]
        table.add_row(
            row["variant"],
            f"{row['seeds']}",
            f"{_at(of, 'frames', 0)}/{of['of']['max']}",
            _at(of, "frames", 0, "min"),
            _at(of, "return", 1, scale=100),
            _at(of, "return", 1, "min", scale=100),
        )
    return table


def _cyclic(rows: Sequence[Row], info: Row) -> Iterator[RenderableType]:
    """The tables of a loop."""
    yield _fit(rows)
    yield ""
    yield _cost(rows)
    if any(row["metrics"]["capture_knee_r2"]["n"] for row in rows):
        yield ""
        yield _capture(rows, info)


def _fit(rows: Sequence[Row]) -> RenderableType:
    """How well the reference is followed."""
    names = ("frames", "phases", "R² knee", "min", "hip", "min", "gap °", "speed", "path error m")
    table = grid("", "seeds", *names, gap=1)
    for row in rows:
        of = row["metrics"]
        table.add_row(
            row["variant"],
            f"{row['seeds']}",
            f"{_at(of, 'frames', 0)}/{of['of']['max']}",
            f"{_at(of, 'phases', 0)}/{of['phases_of']['max']}",
            _at(of, "knee_r2", 3),
            _at(of, "knee_r2", 3, "min"),
            _at(of, "hip_r2", 3),
            _at(of, "hip_r2", 3, "min"),
            _at(of, "hip_gap_deg", 1),
            _at(of, "speed_ratio", 3),
            _at(of, "end_off_m", 2),
        )
    return table


def _cost(rows: Sequence[Row]) -> RenderableType:
    """Return, and the samples and seconds that it took."""
    table = grid("", "return %", "converged", "of seeds", "first walk", "after s", "of seeds", "training s")
    for row in rows:
        of = row["metrics"]
        table.add_row(
            row["variant"],
            _at(of, "return", 1, scale=100),
            _whole(of["converged_samples"]["median"]),
            f"{of['converged_samples']['n']}/{row['seeds']}",
            _whole(of["first_walk_samples"]["median"]),
            _at(of, "first_walk_seconds", 0),
            f"{of['first_walk_samples']['n']}/{row['seeds']}",
            _at(of, "seconds", 0),
        )
    return table


def _capture(rows: Sequence[Row], info: Row) -> RenderableType:
    """R² against the capture, beside that of the reference."""
    table = grid("R² against the capture", "knee", "ceiling", "hip", "ceiling")
    for row in rows:
        cells = (
            (_at(row["metrics"], f"capture_{joint}_r2", 3), number(info["ceiling"][joint], 3))
            for joint in ("knee", "hip")
        )
        table.add_row(row["variant"], *(text for cell in cells for text in cell))
    return table


def _whole(value: float | None) -> str:
    return "-" if value is None else f"{value:,.0f}"


def _at(of: Row, name: str, digits: int, which: str = "median", scale: float = 1.0) -> str:
    value = of[name][which]
    return number(None if value is None else scale * value, digits)
