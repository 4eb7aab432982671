"""The page of `inspect --plot`: figures of each file's angles, bones, joint states and path."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.cli.html import number, render
from kinemimic.pipeline.cli.palette import light
from kinemimic.pipeline.cli.picture import Draw, legend, panel_grid
from kinemimic.pipeline.files.store import write_text
from kinemimic.pipeline.inspect.file_report import InspectedFile
from kinemimic.pipeline.inspect.measures import SEGMENTS, available_nodes
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.joint_names import joints_by_name
from kinemimic.pipeline.kinematics.orientation.rest_pose import recorded_knees
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, SIDES
from kinemimic.pipeline.quality.rules.defect import RULES, Defect

_TEMPLATES = Path(__file__).with_name("templates")
_SIDE_COLORS = {"left": light("blue"), "right": light("red"), "": light("ink")}
_RECORDED = light("ghost")
_STATES = {"missing": light("bad"), "inferred": light("orange"), "tracked": light("band")}
_MARKS = {"flagged": light("partial-tint"), "repaired": light("good-tint"), "refused": light("bad-tint")}
_FIRST_PASS = 0.35  # opacity; the last one is opaque
_PASS_GAP = 0.4  # s between passes, as drawn
# Upper limits of what a figure can show.
_MAX_POINTS, _MAX_COLUMNS, _MAX_MARKED = 700, 600, 60
# The figures of a capture take about 0.7 MB, and browsers struggle with larger pages.
MAX_PLOTTED = 40


def section(inspected: InspectedFile) -> str:
    """HTML section of one file: its description and, if it could be read, its figures."""
    report = inspected.report
    values: dict[str, Any] = {"report": report, "name": Path(report["file"]).name, "drawings": None}
    if inspected.checked is not None:
        clip, defects = inspected.checked.clip, inspected.checked.defects
        nodes, _, _ = available_nodes(clip)
        values["lead"] = _lead(report)
        values["defects"] = [f"{RULES[one.rule]}, {one.action}: {one.text}" for one in defects]
        values["drawings"] = {
            "angles": _angles(clip, nodes, defects),
            "bones": _bones(clip, nodes),
            "states": _states(clip),
            "path": _path(clip, nodes),
        }
    return render(_TEMPLATES / "capture.html", **values)


def write_page(path: Path, captures: Sequence[dict[str, Any]], sections: Sequence[str]) -> None:
    """Write one page atomically: the sections of the first captures, and a table of the others.

    captures: the reports; sections: HTML of the first captures, at most MAX_PLOTTED.
    """
    heading = Path(captures[0]["file"]).name if len(captures) == 1 else f"{len(captures)} captures"
    page = render(
        _TEMPLATES / "inspect.html",
        title=f"{heading}: kinemimic inspect",
        heading=heading,
        read=sum(report["read"] for report in captures),
        total=len(captures),
        sections=sections,
        others=[
            (report["file"], report["format"] or "–", report["status"])
            for report in captures[len(sections) :]
        ],
    )
    write_text(path, page)


def _lead(report: dict[str, Any]) -> str:
    simulated = ", SIMULATED" if report["simulated"] else ""
    peak, gait = report["angles"]["knee_peak_deg"], report["gait"]
    parts = [
        f"{report['format']}{simulated}",
        f"{report['frames']} frames at {number(report['rate_hz'], 1)} Hz",
        f"thigh {number(report['bones_m']['thigh']['median'], 3)} m",
        f"shank {number(report['bones_m']['shank']['median'], 3)} m",
        f"knee peak {number(peak, 0)}°",
        f"gait period {number(gait['period_s'], 2)} s" if gait else "no gait",
        str(report["status"]),
    ]
    return " · ".join(parts)


def _time_in_passes(clip: Clip) -> Array:
    """Seconds (T,) on the time axis: passes in sequence, _PASS_GAP apart; NaN outside them.

    A recorder may run for minutes with nobody in view, which would squeeze the passes into thin lines.
    """
    shown = np.full(len(clip.times), np.nan)
    begin = 0.0
    for count in range(int(clip.passes.max(initial=-1)) + 1):
        frames = clip.passes == count
        times = clip.times[frames]
        shown[frames] = begin + times - times[0]
        begin += float(times[-1] - times[0]) + _PASS_GAP
    return shown


def _time_axis(axes: Axes, clip: Clip) -> None:
    shown = _time_in_passes(clip)
    if np.isfinite(shown).any():
        axes.set_xlim(0.0, max(float(np.nanmax(shown)), 1e-3))
    axes.set_xlabel("time in passes [s]")


def _line(axes: Axes, clip: Clip, values: Array, **style: Any) -> None:
    """Plot a curve (T,) over the frames in passes, thinned to a visible resolution, broken between passes."""
    curve = np.where(clip.passes >= 0, values, np.nan)
    breaks = np.flatnonzero(np.diff(clip.passes) != 0)
    curve[breaks] = np.nan
    thin = max(1, len(curve) // _MAX_POINTS)
    axes.plot(_time_in_passes(clip)[::thin], curve[::thin], **style)


def _angles(clip: Clip, nodes: Array, defects: Sequence[Defect]) -> Draw:
    ours = leg_angles(nodes, times=clip.times, knees=recorded_knees(clip))

    def draw(phone: bool) -> Figure:
        figure, panels = panel_grid(2, 1, 1.9, phone, sharex=True)
        for axes, joint in zip(panels, ("knee", "hip"), strict=True):
            for action in _shade(axes, clip, defects):
                axes.fill_between([], [], color=_MARKS[action], label=action)
            for side in SIDES:
                name = f"{joint}_{side}"
                _line(axes, clip, np.degrees(ours[name]), color=_SIDE_COLORS[side], label=side)
                recorded = (clip.angles or {}).get(name)
                if recorded is not None:
                    _line(
                        axes, clip, np.degrees(recorded), color=_RECORDED, linestyle="--", linewidth=0.9,
                        label="from the file" if side == "right" else None,
                    )  # fmt: skip
            axes.set(title=joint, ylabel="flexion [°]", ylim=_range(clip, ours, joint))
        _time_axis(panels[-1], clip)
        legend(figure, panels[0])
        return figure

    return draw


def _range(clip: Clip, curves: dict[str, Array], joint: str) -> tuple[float, float]:
    """Limits in degrees that show all but the most extreme hundredth of the frames."""
    both = np.degrees(np.concatenate([curves[f"{joint}_{side}"][clip.passes >= 0] for side in SIDES]))
    both = both[np.isfinite(both)]
    if not len(both):
        return -10.0, 90.0
    low, high = np.percentile(both, [0.5, 99.5])
    return float(low) - 10.0, float(high) + 10.0


def _shade(axes: Axes, clip: Clip, defects: Sequence[Defect]) -> list[str]:
    """Shade the frames of defects; returns the actions that were shaded."""
    shaded: dict[str, None] = {}
    step = float(np.median(np.diff(clip.times))) if len(clip.times) > 1 else 0.0
    times = _time_in_passes(clip)
    for defect in defects:
        for first, last in defect.frames[:_MAX_MARKED]:
            marked = times[first : last + 1]
            marked = marked[np.isfinite(marked)]
            if len(marked):
                axes.axvspan(
                    marked[0] - step / 2, marked[-1] + step / 2,
                    color=_MARKS[defect.action], linewidth=0, zorder=0,
                )  # fmt: skip
                shaded[defect.action] = None
    return list(shaded)


def _bones(clip: Clip, nodes: Array) -> Draw:
    def draw(phone: bool) -> Figure:
        figure, panels = panel_grid(2, 1, 1.7, phone, sharex=True)
        for axes, title, segments in (
            (panels[0], "legs", ("thigh", "shank")),
            (panels[1], "arms and trunk", ("upper_arm", "forearm", "trunk")),
        ):
            for segment, style in zip(segments, ("-", "--", ":"), strict=False):
                start, end = SEGMENTS[segment]
                for side in SIDES if "{}" in start else ("",):
                    a, b = NODE_INDEX[start.format(side)], NODE_INDEX[end.format(side)]
                    length = np.linalg.norm(nodes[:, b] - nodes[:, a], axis=-1)
                    label = f"{side} {segment}".strip().replace("_", " ")
                    _line(
                        axes, clip, length, color=_SIDE_COLORS[side], linestyle=style, linewidth=0.9,
                        label=label,
                    )  # fmt: skip
            axes.set(title=title, ylabel="length [m]", ylim=(0, None))
            if phone:
                axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, fontsize=7)
            else:
                axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8)
        _time_axis(panels[-1], clip)
        return figure

    return draw


def _states(clip: Clip) -> Draw:
    names = clip.skeleton.names
    shown = sorted(set(joints_by_name(names).values())) or list(range(len(names)))
    times, inside = _time_in_passes(clip), np.flatnonzero(clip.passes >= 0)
    end = float(np.nanmax(times)) if len(inside) else 1.0
    edges = np.linspace(0.0, end, max(1, min(_MAX_COLUMNS, len(inside))) + 1)
    column = np.clip(np.searchsorted(edges, times, side="right") - 1, 0, len(edges) - 2)
    worst = np.full((len(shown), len(edges) - 1), np.nan)
    for frame in inside:
        worst[:, column[frame]] = np.fmin(worst[:, column[frame]], clip.states[frame, shown])
    # A column narrower than the step between two frames of a pass repeats the state before it.
    filled = np.maximum.accumulate(np.where(np.isfinite(worst[0]), np.arange(worst.shape[1]), 0))
    near = np.arange(worst.shape[1]) - filled <= 2
    worst = np.where(near & np.isnan(worst), worst[:, filled], worst)

    def draw(phone: bool) -> Figure:
        figure, (axes,) = panel_grid(1, 1, 0.7 + 0.16 * len(shown), phone)
        # Rectangles and not a picture, so that the colours follow the page's.
        for row, states in enumerate(worst):
            for state, color in enumerate(_STATES.values()):
                spans = [(edges[first], edges[last] - edges[first]) for first, last in _runs(states == state)]
                axes.broken_barh(spans, (row - 0.5, 1.0), color=color, linewidth=0)
        axes.set(xlim=(edges[0], edges[-1]), ylim=(len(shown) - 0.5, -0.5))
        axes.set_yticks(range(len(shown)), [names[joint] for joint in shown], fontsize=7.5)
        _time_axis(axes, clip)
        axes.grid(visible=False)
        handles = [Patch(color=color, label=state) for state, color in _STATES.items()]
        figure.legend(handles=handles, loc="outside upper left", ncols=3)
        return figure

    return draw


def _runs(mask: Mask) -> list[tuple[int, int]]:
    """First element and the one after the last of every run of True in a mask (N,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]])))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _path(clip: Clip, nodes: Array) -> Draw:
    middle = nodes[:, [NODE_INDEX["hip_left"], NODE_INDEX["hip_right"]], :2].mean(axis=1)
    count = int(clip.passes.max(initial=-1)) + 1

    def draw(phone: bool) -> Figure:
        figure, (axes,) = panel_grid(1, 1, 3.0, phone)
        for number_ in range(count):
            path = middle[clip.passes == number_]
            path = path[np.isfinite(path).all(axis=-1)]
            if not len(path):
                continue
            style: dict[str, Any] = {"color": light("blue")}
            style["alpha"] = _FIRST_PASS + (1 - _FIRST_PASS) * (number_ + 1) / count if count > 1 else 1.0
            name = {0: "first pass", count - 1: "last pass"}.get(number_) if count > 1 else "path of the hips"
            thin = max(1, len(path) // _MAX_POINTS)
            axes.plot(path[::thin, 0], path[::thin, 1], linewidth=1.0, label=name, **style)
            axes.plot(*path[0], "o", markersize=4, label="start" if number_ == count - 1 else None, **style)
        axes.set(xlabel="forward [m]", ylabel="to the left [m]")
        axes.set_aspect("equal", adjustable="datalim")
        if axes.get_legend_handles_labels()[1]:
            legend(figure, axes)
        return figure

    return draw
